"""Random states of two blocks in contact with friction, and derivatives by central differences."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import skfem as fem
from numpy.typing import NDArray
from quick_elasticity import linear_elasticity
from rectangles import rectangle
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc

Array = NDArray[np.float64]
NUMBERS = "friction", "stiffness", "displacement", "interference"
QUANTITIES = "force", "pressure", "slip", "dissipation", "u"


class State:
    """A scene of two blocks in the plane or in space, with a history of one or four steps.

    The upper block is rounded by a gap, pressed down by its top and moved to and fro.
    """

    def __init__(
        self, seed: int, dim: int = 2, law: Callable[[float], sc.conditions.FrictionLaw] = sc.Coulomb
    ):
        draw = np.random.default_rng(seed)
        self.dim, self.law = dim, law
        self.ours = isinstance(law(0.3), sc.Coulomb | sc.Tresca | sc.conditions.OrthotropicCoulomb)
        self.method = draw.choice(["mortar", "node"])
        steps = int(draw.choice([1, 4]))
        d = dim - 1
        self.mu, self.round = draw.uniform(0.1, 0.5), draw.uniform(0.0, 0.08, d)
        down = 0.015 * draw.uniform(0.7, 1.3, steps)
        self.ways = [(*draw.uniform(-0.008, 0.008, d), -height) for height in down]
        if dim == 2:
            cells = draw.integers([8, 3, 5, 2], [13, 5, 9, 4])
            self.bases = (
                rectangle(np.linspace(-1, 1, cells[0] + 1), np.linspace(-1, 0, cells[1] + 1)),
                rectangle(np.linspace(-0.6, 0.6, cells[2] + 1), np.linspace(0, 0.8, cells[3] + 1)),
            )
        else:
            lower, upper = draw.integers([3, 3, 2], 5), draw.integers([2, 2, 1], 4)
            self.bases = box(-1.0, 1.0, -1.0, 0.0, lower), box(-0.6, 0.6, 0.0, 0.8, upper)
        el = linear_elasticity(*lame_parameters(1.0, draw.uniform(0.1, 0.4)))
        self.K = [el.assemble(basis) for basis in self.bases]

    def solver(self, by: str = "", shift: float = 0.0) -> sc.ContactSolver:
        """The scene with one of the `NUMBERS` shifted."""
        factor = 1.0 + (shift if by == "stiffness" else 0.0)
        low = sc.Body(self.bases[0], factor * self.K[0], D="bottom", name="low")
        up = sc.Body(self.bases[1], self.K[1], D="top", name="up")
        contact = sc.Contact(
            up.surface("bottom"),
            low.surface("top"),
            friction=self.law(self.mu + (shift if by == "friction" else 0.0)),
            method=self.method,
            gap=lambda x: self.round @ x[: self.dim - 1] ** 2,
            interference=shift if by == "interference" else 0.0,
            name="joint",
        )
        return sc.ContactSolver([low, up], contact, options=sc.Options(tolerance=1e-14))

    @cached_property
    def as_it_is(self) -> sc.ContactSolver:
        """The scene, for many histories."""
        return self.solver()

    @cached_property
    def results(self) -> list[sc.answers.ContactResult]:
        """Its history."""
        return list(self.as_it_is.history(self.steps()))

    def steps(self, by: str = "", shift: float = 0.0) -> list[Any]:
        factor = 1.0 + (shift if by == "displacement" else 0.0)
        return [{"x": {"up": {"top": tuple(factor * np.array(way))}}} for way in self.ways]

    def history(self, by: str = "", shift: float = 0.0) -> list[sc.answers.ContactResult]:
        return list(self.solver(by, shift).history(self.steps(by, shift)))

    def parameter(self, by: str) -> sc.answers.Parameter:
        return sc.answers.Parameter(by, of={"stiffness": "low", "displacement": "up"}.get(by))


def box(a: float, b: float, low: float, high: float, cells: Any) -> fem.CellBasis:
    """A box of hexahedra, with its boundaries "bottom" and "top"."""
    lines = [
        np.linspace(*ends, n + 1) for ends, n in zip([(a, b), (a, b), (low, high)], cells, strict=True)
    ]
    mesh = fem.MeshHex.init_tensor(*lines).with_boundaries(
        {"bottom": lambda x: x[2] == low, "top": lambda x: x[2] == high}
    )
    return fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)


def quantities(result: sc.answers.ContactResult) -> dict[str, Array]:
    return {name: np.array(getattr(result, name), dtype=float) for name in QUANTITIES}


def forward(
    results: list[sc.answers.ContactResult], by: sc.answers.Parameter, side: int = 0
) -> sc.answers.Sensitivity:
    """Derivatives of the last result of a history."""
    found = None
    for result in results:
        found = result.sensitivity(by, after=found, side=side)
    return found


def differences(state: State, by: str, width: float) -> dict[str, Array] | None:
    """The same by central differences of order four; None where a point changes on the way."""
    ends = {side: state.history(by, side * width) for side in (-2, -1, 1, 2)}
    here = state.results
    for end in ends.values():
        if any(not np.array_equal(a.status, b.status) for a, b in zip(end, here, strict=True)):
            return None
    at = {side: quantities(end[-1]) for side, end in ends.items()}
    return {
        name: (8 * (at[1][name] - at[-1][name]) - (at[2][name] - at[-2][name])) / (12 * width)
        for name in QUANTITIES
    }


def worst(state: State, by: str, width: float) -> float | None:
    """Largest deviation of all quantities from central differences, over the largest derivative."""
    wanted = differences(state, by, width)
    if wanted is None:
        return None
    results = state.results
    found, off = forward(results, state.parameter(by)), 0.0
    for name, values in wanted.items():
        if name == "dissipation" and not state.ours:
            continue
        size = np.max(np.abs(values))
        if name == "dissipation":  # a sum of such terms, which may cancel
            size = max(size, np.max(results[-1].normal_force) * np.max(np.abs(wanted["slip"])))
        # what changes by a thousandth where the number changes by one does not depend on it
        size = max(size, 1e-3 * np.max(np.abs(getattr(results[-1], name))))
        if size > 0:
            off = max(off, float(np.max(np.abs(np.asarray(getattr(found, name)) - values)) / size))
    return off
