"""Two blocks whose meshes do not match, of any element order, with a smooth gap or glued.

Like `smooth_contacts`, but the lower block has a mesh of its own, both blocks may be quadratic, and
the way in which they meet can be chosen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import skfem as fem
from scenes import elastic
from scipy.optimize import newton
from smooth_contacts import graded, opposite_shear

import skfem_contact as sc
from skfem_contact.reference import block_curvature, effective_modulus

KINDS = {
    "P1": fem.ElementTriP1,
    "Q1": fem.ElementQuad1,
    "P2": fem.ElementTriP2,
    "Q2": fem.ElementQuad2,
    "S2": fem.ElementQuadS2,
}
QUADRATIC = ("P2", "Q2", "S2")


def rectangle(kind: str, x: Any, y: Any, *, scalar: bool = False) -> Any:
    """Basis of a kind of element on a rectangle with the sides named."""
    mesh = fem.MeshQuad.init_tensor(np.asarray(x, float), np.asarray(y, float))
    if kind.startswith("P"):
        mesh = mesh.to_meshtri()
    element = KINDS[kind]()
    # exact for products of quadratics on parallelograms; the default does too little for Q2
    order = 4 if kind in QUADRATIC else 2
    return fem.Basis(
        named_sides(mesh), element if scalar else fem.ElementVector(element), intorder=order
    )


def named_sides(mesh: Any) -> Any:
    """The mesh with left, right, bottom, top named by all nodes of a facet, not by its middle."""
    p, ends = mesh.p, mesh.facets
    sides = {}
    for name, axis, value in (
        ("left", 0, p[0].min()),
        ("right", 0, p[0].max()),
        ("bottom", 1, p[1].min()),
        ("top", 1, p[1].max()),
    ):
        on = np.isclose(p[axis], value, rtol=0, atol=1e-12 * np.ptp(p, axis=1).max())
        facets = np.flatnonzero(on[ends].all(axis=0))
        sides[name] = np.intersect1d(facets, mesh.boundary_facets())
    return mesh.with_boundaries(sides)


@dataclass(eq=False)
class UnlikeBlocks:
    """Two blocks on guided bases with a smooth gap; the upper one carries the contact points.

    Attributes
    ----------
    h : size of the upper elements in the zone of contact
    ratio : size of the lower elements over that of the upper ones
    fine, depth : half width and depth of the zone of small elements
    growth : of the elements beyond, from one to the next
    sliding : whether the pairing follows the motion
    """

    h: float
    gap: Callable[[np.ndarray], np.ndarray] | None
    method: str = "mortar"
    ratio: float = 0.77
    kind: str = "Q1"
    law: sc.conditions.FrictionLaw | None = None
    fine: float = 1.2
    depth: float = 0.4
    H: float = 20.0
    width: float = 2.0
    nu: float = 0.3
    growth: float = 1.15
    sliding: str = "small"
    settings: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        upper = self._body(self.h, "upper", 1)
        lower = self._body(self.ratio * self.h, "lower", -1)
        self.bodies = upper, lower
        self.contact = sc.Contact(
            upper.surface("bottom"),
            lower.surface("top"),
            friction=self.law,
            gap=self.gap,
            method=self.method,
            sliding=self.sliding,
        )
        self.solver = sc.ContactSolver([upper, lower], [self.contact], **self.settings)

    def _body(self, h: float, name: str, side: int) -> sc.Body:
        x = graded(h, self.fine, self.width * self.H, self.growth)
        y = graded(h, self.depth, self.H, self.growth)
        x = np.concatenate([-x[:0:-1], x])
        basis = rectangle(self.kind, x, y if side > 0 else -y[::-1])
        D = basis.get_dofs("top" if side > 0 else "bottom")
        fixed = D.all("u^2")
        if name == "lower" or self.law is None:  # else held sideways by friction alone
            rows = D.all("u^1")
            fixed = np.append(fixed, rows[np.abs(basis.doflocs[0, rows]).argmin()])
        return sc.Body(basis, elastic(1.0, self.nu), D=fixed, name=name)

    @property
    def E_star(self) -> float:
        return effective_modulus(1.0, self.nu, 1.0, self.nu)

    def added_curvature(self, P: float) -> float:
        """What the finite size of both blocks adds to the curvature of the profile."""
        return 2 * block_curvature(P, self.H, 1.0, self.nu, base="roller", width=self.width)

    def lowered(self, d: float) -> dict[str, np.ndarray]:
        """Prescribed displacements: base of the upper block down by `d`."""
        upper = self.bodies[0]
        x = np.zeros(upper.n)
        x[upper.basis.get_dofs("top").all("u^2")] = -d
        return {"upper": x}

    def push(self, Q: float) -> dict[str, np.ndarray]:
        """Opposite uniform shear on the two bases, resultant `Q` on the upper one."""
        return opposite_shear(self.bodies, Q)

    def press(self, P: float, a: float) -> tuple[sc.answers.ContactResult, float]:
        """The state under the normal load `P`, and how far the base had to be lowered for it."""
        result = None

        def excess(d: float) -> float:
            nonlocal result
            result = self.solver.solve(x=self.lowered(d), guess=result)
            return float(result.force[1] / P - 1)

        # Johnson (1985) section 5.6: approach of a layer of depth H, to start from
        guess = P / (np.pi * self.E_star) * 2 * np.log(2 * self.H / a)
        d = newton(excess, 0.9 * guess, x1=guess, tol=1e-12 * guess, rtol=0)
        excess(d)
        return result, float(d)
