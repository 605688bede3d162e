"""Two mirrored blocks with a smooth gap between them: the scene of Hertz, Cattaneo and Mindlin.

Flat blocks with equal meshes face each other; the profile is given as the initial gap, so that
the linear theory is met exactly. The bases are guided ("roller": no vertical displacement, free
of shear) or held ("fixed"). The base of the upper block is lowered as a whole, which leaves it no
tilt; with guided bases it is pushed sideways by a load, and only friction answers. Reflected in
the plane of contact, both blocks then see the same normal and opposite tangential loads: the
normal load does not depend on the tangential one, node by node.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem as fem
from scenes import ELEMENTS, elastic
from scipy.optimize import newton

import skfem_contact as sc
from skfem_contact.reference import block_curvature, effective_modulus


def graded(h: float, fine: float, end: float, ratio: float = 1.15) -> np.ndarray:
    """Coordinates from 0 to `end`: steps `h` up to `fine`, growing by `ratio` beyond."""
    even = h * np.arange(round(fine / h) + 1)
    count = max(int(np.ceil(np.log1p((end - even[-1]) * (ratio - 1) / (ratio * h)) / np.log(ratio))), 1)
    steps = h * ratio ** np.arange(1, count + 1)
    return np.concatenate([even, even[-1] + np.cumsum(steps) * (end - even[-1]) / steps.sum()])


@dataclass(eq=False)
class Blocks:
    """The scene, and its solver with `loop` and `law`.

    Attributes
    ----------
    h : element size in the zone of contact
    fine, fine_depth : half width and depth of the zone with this size; growing by 15 % beyond
    H, width : depth of each block, half width over depth
    E, nu : elastic constants, pairs (upper, lower)
    pushed : whether the sideways position of the upper base answers to a load, or is prescribed
    """

    h: float
    gap: Callable[[np.ndarray], np.ndarray]
    law: sc.conditions.FrictionLaw | None = None
    fine: float = 1.5
    fine_depth: float | None = None
    H: float = 20.0
    width: float = 2.0
    E: tuple[float, float] = (1.0, 1.0)
    nu: tuple[float, float] = (0.3, 0.3)
    base: str = "roller"
    kind: str = "Q1"
    loop: str = "newton"
    linear: Any = "auto"
    pushed: bool = True
    options: sc.Options | None = None

    def __post_init__(self) -> None:
        depth = self.fine if self.fine_depth is None else self.fine_depth
        x, y = graded(self.h, self.fine, self.width * self.H), graded(self.h, depth, self.H)
        x = np.concatenate([-x[:0:-1], x])
        upper = self._body(x, y, "top", "upper")
        lower = self._body(x, -y[::-1], "bottom", "lower")
        self.bodies = upper, lower
        self.contact = sc.Contact(
            upper.surface("bottom"), lower.surface("top"), friction=self.law, gap=self.gap
        )
        self.solver = sc.ContactSolver(
            self.bodies,
            [self.contact],
            loop=self.loop,
            linear=self.linear,
            options=self.options,
        )

    def _body(self, x: np.ndarray, y: np.ndarray, base: str, name: str) -> sc.Body:
        mesh_type, element = ELEMENTS[self.kind]
        mesh = mesh_type.init_tensor(x, y).with_defaults()
        basis = fem.Basis(mesh, fem.ElementVector(element()), intorder=2)
        i = ("upper", "lower").index(name)
        dofs = basis.get_dofs(base)
        if self.base == "fixed" or not self.pushed:
            D = dofs.all()
        elif name == "upper" and self.law is not None:
            D = dofs.all("u^2")  # sideways held by friction alone
        else:  # one node, which by symmetry bears nothing, stops the translation
            on_axis = np.intersect1d(np.flatnonzero(mesh.p[0] == 0), dofs.nodal_ix)
            D = np.append(dofs.all("u^2"), basis.nodal_dofs[0, on_axis])
        return sc.Body(basis, elastic(self.E[i], self.nu[i]), D=D, name=name)

    @property
    def E_star(self) -> float:
        (E1, E2), (nu1, nu2) = self.E, self.nu
        return effective_modulus(E1, nu1, E2, nu2)

    def added_curvature(self, P: float) -> float:
        """What the finite size of both blocks adds to the curvature of the profile."""
        return sum(
            block_curvature(P, self.H, E, nu, base=self.base, width=self.width)
            for E, nu in zip(self.E, self.nu, strict=True)
        )

    def load_for(self, a: float, R: float) -> float:
        """The load whose exact half width on a profile of radius `R` is `a`."""
        P = half_plane = np.pi / 4 * self.E_star * a**2 / R
        for _ in range(30):
            P = half_plane + np.pi / 4 * self.E_star * a**2 * self.added_curvature(P)
        return float(P)

    def lowered(self, d: float, shift: float = 0.0) -> dict[str, np.ndarray]:
        """Prescribed displacement of the upper base: down by `d` and sideways by `shift`."""
        upper = self.bodies[0]
        x = np.zeros(upper.n)
        down = np.isin(upper.D, upper.basis.nodal_dofs[1])
        x[upper.D] = np.where(down, -d, shift)
        return {"upper": x}

    def push(self, Q: float) -> dict[str, np.ndarray]:
        """Opposite uniform shear on the two bases, resultant `Q` on the upper one."""
        return opposite_shear(self.bodies, Q)

    def press(self, P: float, a: float) -> tuple[sc.answers.ContactResult, float]:
        """The state under the normal load `P`, and how far the base had to be lowered for it."""

        def excess(d: float) -> float:
            nonlocal result
            result = self.solver.solve(x=self.lowered(d))
            return float(result.force[1] / P - 1)

        result = None
        # Johnson (1985) section 5.6: approach of a layer of depth H, to start from
        guess = P / (np.pi * self.E_star) * 2 * np.log(2 * self.H / a)
        d = newton(excess, 0.9 * guess, x1=guess, tol=1e-12 * guess, rtol=0)
        excess(d)
        return result, float(d)


def ordered(values: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """From left to right: position, tributary length, pressure, shear traction on the lower block."""
    order = np.argsort(values.points[:, 0])
    shear = -values.traction[order, 0]
    return values.points[order, 0], values.area[order], values.pressure[order], shear


def hat_averages(x: np.ndarray, pressure: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Averages of a pressure weighted with the hat functions of the sorted nodes `x`.

    This is what a nodal force over its tributary length stands for.
    """
    t, w = np.polynomial.legendre.leggauss(200)  # the root at the edge: error below 1e-6
    t, w = (t + 1) / 2, w / 2
    step = np.diff(x)
    p = pressure(x[:-1, None] + step[:, None] * t) * w * step[:, None]
    total, length = np.zeros_like(x), np.zeros_like(x)
    total[:-1] += p @ (1 - t)
    total[1:] += p @ t
    length[:-1] += step / 2
    length[1:] += step / 2
    return total / length


def opposite_shear(bodies: list[sc.Body], Q: float) -> dict[str, np.ndarray]:
    """Loads on the top of the upper and the bottom of the lower body, resultants `Q` and -`Q`."""
    loads = {}
    for body, base, sign in zip(bodies, ("top", "bottom"), (1, -1), strict=True):
        basis = body.basis
        facets = fem.FacetBasis(basis.mesh, basis.elem, facets=base)
        f = fem.LinearForm(lambda v, w: v[0]).assemble(facets)
        loads[body.name] = sign * Q / f.sum() * f
    return loads
