"""The problems that are timed: two elastic blocks pressed together, pushed, and pushed back.

    base lowered, guided, and pushed sideways by Q
    _______________________________
    |                             |
    |            upper            |      meshes graded towards the contact zone |x| < 1.5 a;
    |___________________________,-|      the profile x^2 / 2R is given as the initial gap
    |-'                           |
    |            lower            |      plane strain, Coulomb friction mu = 0.3
    |_____________________________|
    base guided, pushed by -Q

Both blocks are alike and so are their loads, up to sign: pressure is Hertz's whatever Q, and friction
is Cattaneo's and Mindlin's. The closed forms take the measured load and the finite depth into account.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import (
    block_curvature,
    cattaneo_mindlin,
    effective_modulus,
    fretting_dissipation_line,
    hertz_line,
)

E, NU, R, H, WIDTH = 1.0, 0.3, 100.0, 20.0, 2.0
RATIO = 1.1  # growth of the elements outside the fine zone
FINE = 1.5  # half width of that zone; the contact's is about 1
KINDS = {
    "Q1": (fem.MeshQuad, fem.ElementQuad1, 1),
    "P2": (fem.MeshTri, fem.ElementTriP2, 2),
}


@dataclass(frozen=True)
class Case:
    """One row of the table."""

    name: str
    dofs: float
    kind: str = "Q1"
    method: str = "node"
    mu: float = 0.3
    mismatch: float = 1.0  # element size of the lower block over that of the upper one
    rounds: int = 3  # repetitions of every timing, of which the median counts
    sparse: bool = True  # compare with the sparse route, which takes minutes where it is large
    thin: bool = False  # fine at the surface alone, for many points on few DOFs
    optional: bool = False


CASES = [
    Case("Q1 4k", 4e3, rounds=7),
    Case("Q1 20k", 20e3, rounds=5),
    Case("Q1 100k", 100e3),
    Case("P2 100k", 100e3, kind="P2"),
    Case("mortar 100k", 100e3, method="mortar", mismatch=0.83),
    Case("Q1 400k", 400e3, rounds=2, sparse=False),
    Case("Q1 1M", 1e6, rounds=1, sparse=False, optional=True),
]


def graded(h: float, end: float, fine: float = FINE, ratio: float = RATIO) -> np.ndarray:
    """Coordinates from 0 to `end`: steps `h` in the fine zone, growing by a ratio beyond."""
    even = h * np.arange(round(fine / h) + 1)
    rest = end - even[-1]
    count = max(int(np.ceil(np.log1p(rest * (ratio - 1) / (ratio * h)) / np.log(ratio))), 1)
    steps = h * ratio ** np.arange(1, count + 1)
    return np.concatenate([even, even[-1] + np.cumsum(steps) * rest / steps.sum()])


def element_size(case: Case) -> float:
    """The size that gives the wanted number of DOFs."""
    order = KINDS[case.kind][2]

    def dofs(h: float) -> int:
        x, y = len(graded(h, WIDTH * H)) - 1, len(graded(h, H)) - 1
        return 4 * (2 * order * x + 1) * (order * y + 1)

    low, high = 1e-4, 1.0
    for _ in range(40):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if dofs(middle) < case.dofs else (middle, high)
    return float(high)


@dataclass(eq=False)
class Scene:
    """Bodies, contact and loads of a case."""

    case: Case
    h: float | None = None

    def __post_init__(self) -> None:
        h = self.h = self.h or element_size(self.case)
        self.bases = {
            "upper": self._basis(h, 1, "top"),
            "lower": self._basis(h * self.case.mismatch, -1, "bottom"),
        }

    def _basis(self, h: float, side: int, base: str) -> Any:
        mesh_type, element, _ = KINDS[self.case.kind]
        x, y = graded(h, WIDTH * H), graded(h, H)
        if self.case.thin:
            x, y = graded(h, WIDTH * H, ratio=1.25), graded(h, H, fine=10 * h, ratio=1.25)
        y = y if side > 0 else -y[::-1]
        mesh = mesh_type.init_tensor(np.concatenate([-x[:0:-1], x]), y).with_defaults()
        return fem.Basis(mesh, fem.ElementVector(element()), intorder=2)

    @cached_property
    def bodies(self) -> list[sc.Body]:
        """Assembled when first asked for."""
        stiffness = linear_elasticity(*lame_parameters(E, NU))
        upper, lower = self.bases["upper"], self.bases["lower"]
        guided = upper.get_dofs("top").all("u^2")
        if self.case.mu == 0:  # otherwise friction alone holds it sideways
            guided = np.append(guided, middle(upper, "top"))
        held = np.append(lower.get_dofs("bottom").all("u^2"), middle(lower, "bottom"))
        return [
            sc.Body(upper, stiffness, D=guided, name="upper"),
            sc.Body(lower, stiffness, D=held, name="lower"),
        ]

    def contact(self, tied: bool = False) -> sc.Contact:
        """The contact, or the same surfaces glued."""
        upper, lower = self.bodies
        friction = None if tied or self.case.mu == 0 else sc.Coulomb(self.case.mu)
        return sc.Contact(
            upper.surface("bottom"),
            lower.surface("top"),
            method=self.case.method,
            friction=friction,
            gap=lambda x: x[0] ** 2 / (2 * R),
            tied=tied,
        )

    @property
    def E_star(self) -> float:
        return effective_modulus(E, NU, E, NU)

    @property
    def depth(self) -> float:
        """How far the base comes down: Johnson's approach of two layers for a half width of one."""
        P = np.pi / 4 * self.E_star / R
        return float(P / (np.pi * self.E_star) * 2 * np.log(2 * H))

    def lowered(self, share: float) -> dict[str, np.ndarray]:
        """Prescribed displacements of the upper base."""
        x = np.zeros(self.bodies[0].n)
        x[self.base] = -share * self.depth
        return {"upper": x}

    @cached_property
    def base(self) -> np.ndarray:
        """Vertical DOFs of the upper base."""
        return np.asarray(self.bases["upper"].get_dofs("top").all("u^2"))

    @cached_property
    def shear(self) -> dict[str, np.ndarray]:
        """Loads of a unit push on both bases."""
        loads = {}
        for name, base, sign in (("upper", "top", 1), ("lower", "bottom", -1)):
            basis = self.bases[name]
            facets = fem.FacetBasis(basis.mesh, basis.elem, facets=base)
            f = fem.LinearForm(lambda v, w: v[0]).assemble(facets)
            loads[name] = sign * f / f.sum()
        return loads

    def pushed(self, Q: float) -> dict[str, np.ndarray]:
        """Loads of a push."""
        return {name: Q * f for name, f in self.shear.items()}

    def run(self, solver: sc.ContactSolver, press: int = 10, push: int = 20) -> Iterator[Any]:
        """Press in equal steps, push to 0.95 mu P, and push back as far to the other side.

        The limit follows from the pressing force, which is measured.
        """
        result = None
        for result in solver.history({"x": self.lowered(s)} for s in steps(0, 1, press)):
            yield result
        if self.case.mu == 0:
            return
        Q = 0.95 * self.case.mu * float(result.normal_force.sum())
        way = np.concatenate([steps(0, Q, push), steps(Q, -Q, push)])
        down = self.lowered(1)
        yield from solver.history(({"f": self.pushed(q), "x": down} for q in way), start=result)

    def errors(self, results: list[Any]) -> dict[str, float]:
        """Relative L2 errors of pressure and traction at the turning point, error of the last state."""
        last = results[-1]
        P = float(last.normal_force.sum())
        curvature = 2 * block_curvature(P, H, E, NU, base="roller", width=WIDTH)
        hertz = hertz_line(P, R, self.E_star, added_curvature=curvature)
        errors = {"pressure": rms(last, last.pressure - hertz.pressure(last.points[:, 0]))}
        errors["pressure"] /= rms(last, last.pressure)
        if self.case.mu == 0:
            return errors
        Q = 0.95 * self.case.mu * P
        for what, result, path in (("push", None, ()), ("reverse", last, (Q,))):
            force = -Q if what == "reverse" else Q
            result = result or max(results, key=lambda r: r.force[0])
            law = cattaneo_mindlin(hertz, self.case.mu, force, after=path)
            exact = law.traction(result.points[:, 0])
            found = result.traction[:, 0] * np.sign(result.force[0]) * np.sign(force)
            errors[what] = rms(result, found - exact) / rms(result, exact)
        return errors

    def loop_energy(self, P: float, Q: float) -> float:
        """Energy lost in a cycle between -Q and Q."""
        curvature = 2 * block_curvature(P, H, E, NU, base="roller", width=WIDTH)
        hertz = hertz_line(P, R, self.E_star, added_curvature=curvature)
        return fretting_dissipation_line(hertz, self.case.mu, Q)


def middle(basis: Any, side: str) -> int:
    """The horizontal DOF in the middle of a side."""
    dofs = basis.get_dofs(side).all("u^1")
    return int(dofs[np.argmin(np.abs(basis.doflocs[0, dofs]))])


def steps(begin: float, end: float, count: int) -> np.ndarray:
    """Equal steps without the first point."""
    return np.linspace(begin, end, count + 1)[1:]


def rms(result: Any, values: np.ndarray) -> float:
    """Root of the integral of a square over the contact surface."""
    return float(np.sqrt(result.area @ values**2))
