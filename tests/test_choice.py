"""Which way the bodies enter the contact problem: what is chosen, and what memory decides."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity
from scipy.sparse.linalg import spsolve

import skfem_contact as sc
from skfem_contact.linalg import Limits
from skfem_contact.problem import Choice

BASIS = fem.Basis(fem.MeshQuad().refined(3).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
BODY = sc.Body(BASIS, linear_elasticity(), D="top", name="block")
SYSTEM = sc.bodies.stack([BODY])
CONDENSES = SimpleNamespace(condenses=True, complements=0)
SOLVES = SimpleNamespace(condenses=False)
MUCH = 1e12


@pytest.mark.parametrize(
    ("linear", "dense", "factors", "route"),
    [
        ("auto", MUCH, MUCH, "condensed"),
        ("auto", 1.0, MUCH, "iterated"),
        ("auto", MUCH, 1.0, "multigrid"),
        ("auto", 1.0, 1.0, "multigrid"),
        # a backend that condenses has factors of its own, and how large they are is its own affair
        (CONDENSES, MUCH, MUCH, "condensed"),
        (CONDENSES, 1.0, MUCH, "iterated"),
        (CONDENSES, MUCH, 1.0, "condensed"),
        (CONDENSES, 1.0, 1.0, "iterated"),
        # what is chosen is taken, whatever memory it needs
        ("condensed", 1.0, 1.0, "condensed"),
        ("iterated", MUCH, 1.0, "iterated"),
        (SOLVES, MUCH, MUCH, "full"),
        (sc.linalg.Direct(), MUCH, MUCH, "full"),
        (sc.linalg.AMG(), MUCH, MUCH, "multigrid"),
    ],
)
def test_the_way_is_what_is_chosen_or_what_memory_allows(linear, dense, factors, route):
    """Dense matrices decide between two ways, and factors, of this library's own alone, on a third."""
    wanted = np.unique(BODY.surface("bottom").dofs)
    given = Choice(linear, Limits(dense, factors), SYSTEM, [BODY.K], 18, lambda: wanted)
    assert given.route == route
    assert (given.reason == "as chosen") == (linear not in ("auto", CONDENSES))


def test_a_limit_is_kept_to_the_byte():
    """Matrices of just as many bytes as are allowed are made; with one byte less they are not."""
    wanted = np.unique(BODY.surface("bottom").dofs)

    def way(dense):
        return Choice("auto", Limits(dense, MUCH), SYSTEM, [BODY.K], 18, lambda: wanted)

    size = way(MUCH).dense_bytes
    assert way(size).route == "condensed" and way(size - 1).route == "iterated"
    # the flexibility of 18 contact DOFs, and two and a half matrices of 18 gaps and slips
    assert size == 8 * 18**2 + int(2.5 * 8 * 18**2)


def solve_with_scipy(A, b):
    return spsolve(A.tocsc(), b)


@pytest.mark.parametrize(
    ("linear", "condenses"),
    [
        ("condensed", True),
        (sc.linalg.Direct(), True),
        ("iterated", False),
        (sc.linalg.AMG(), False),
        (solve_with_scipy, False),
    ],
    ids=["condensed", "Direct", "iterated", "AMG", "callable"],
)
def test_what_is_chosen_for_large_bodies_is_not_condensed_beside_it(linear, condenses):
    """Where a step is hard, bodies are condensed for it if they are factorised anyway.

    A solver of the user's, or one without factors, is taken where a factorisation is too much.
    """
    foot = sc.Contact(BODY.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.3))
    model = sc.ContactSolver(BODY, foot, linear=linear).linear_model
    assert model.condenses == condenses
    problem = model.problem_on(None, None)
    assert (model.on_points(problem) is problem) == (linear == "condensed" or not condenses)
