"""Two blocks pressed and sheared over one another, in any pose, size and unit: the P2 problem.

The sides carry the exact shear, so that stress is uniform and the closed form holds point by point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.testing import assert_allclose
from scenes import UPRIGHT, Pose, block_basis, elastic, field, in_axes, stress_load

import skfem_contact as sc
from skfem_contact.reference import uniform_shear


@dataclass(frozen=True)
class Sheared:
    """The problem in its own units: lengths times `length`, stresses times `stress`."""

    U: float = 3e-4  # motion of the top along x
    d: float = 1e-3  # and down
    mu: float = 0.5
    layers: tuple[tuple[float, float], ...] = ((1.0, 1.0), (1.0, 0.7))  # (height, modulus)
    tau_max: float = np.inf
    n: int = 4
    width: float = 1.0
    length: float = 1.0
    stress: float = 1.0
    pose: Pose = UPRIGHT
    kind: str = "Q1"

    @property
    def state(self) -> Any:
        """Closed form in the problem's own units."""
        cap = self.tau_max
        return uniform_shear(self.d, self.U, self.layers, self.mu, tau_max=cap)

    def bodies(self) -> list[sc.Body]:
        """The lower block and the upper one, loaded and held."""
        state, s = self.state, self.length
        bodies, height = [], 0.0
        for (H, E), side, name in zip(self.layers, ("bottom", "top"), ("low", "up"), strict=True):
            y = height + H * np.linspace(0.0, 1.0, 4)
            x = np.linspace(0.0, 1.0, self.n + 1)
            stretch = s * np.array([[self.width], [1.0]])
            basis = block_basis(x, y, kind=self.kind, pose=self.pose, shape=lambda p, a=stretch: a * p)
            shear = self.stress * state.tau * np.array([[0.0, 1.0], [1.0, 0.0]])
            f = stress_load(basis, ["left", "right"], shear, self.pose)
            by = s * np.array([self.U, -self.d]) * (side == "top")
            u = field(basis, lambda x, by=by: by, self.pose)
            K = elastic(self.stress * E, 0.0)
            bodies.append(sc.Body(basis, K, f, D=side, x=u, name=name))
            height += H
        return bodies

    def law(self, **settings: Any) -> sc.Coulomb:
        """Coulomb's law with the cap in units of stress."""
        return sc.Coulomb(self.mu, tau_max=self.stress * self.tau_max, **settings)

    def contact(self, bodies: list[sc.Body], **settings: Any) -> sc.Contact:
        """The joint between the two."""
        sides = bodies[1].surface("bottom"), bodies[0].surface("top")
        return sc.Contact(*sides, **{"friction": self.law(), "name": "joint"} | settings)

    def solve(self, *, loop: str = "newton", linear: Any = "auto", **settings: Any) -> Any:
        """The result of one load step."""
        bodies = self.bodies()
        contact = self.contact(bodies, **settings)
        return sc.ContactSolver(bodies, [contact], loop=loop, linear=linear).solve()

    def measured(self, result: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pressure, shear and slip of all points in the problem's own units, sorted along x."""
        values = in_axes(result["joint"], self.pose)
        traction = values["forces"] / values["area"][:, None] / self.stress
        return traction[:, 1], -traction[:, 0], values["slip"][:, 0] / self.length

    def check(self, result: Any, rtol: float) -> None:
        """Every point has the pressure, shear and slip of the closed form."""
        p, tau, slip = self.measured(result)
        state = self.state
        scale = max(state.p, abs(state.tau))
        assert_allclose(p, state.p, rtol=rtol)
        assert_allclose(tau, state.tau, rtol=rtol, atol=rtol * 1e-3 * scale)
        length = max(abs(state.slip), abs(self.U))
        assert_allclose(slip, state.slip, rtol=0, atol=rtol * length)
