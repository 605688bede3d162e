"""What the dry run and the message advise is one thing: followed, it leaves nothing to advise."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import internals
import numpy as np
import pytest
import rectangles
import skfem as fem
from quick_elasticity import linear_elasticity

import skfem_contact as sc

_advice = internals.original("answers._advice")


@cache
def block(name, y, n, E, width=1.0, **data):
    return rectangles.block(name, (0.0, width), (y, y + 1.0), (n, 3), E=E, nu=0.0, **data)


def advice(secondary, primary, method):
    """What print(solver) recommends: a swap, mortar, both, or nothing."""
    bodies = [secondary.body, primary.body]
    text = str(sc.ContactSolver(bodies, sc.Contact(secondary, primary, method=method)))
    return "swap secondary and primary" in text, 'use method="mortar"' in text


@pytest.mark.pairwise
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("facets", [(4, 4), (4, 8), (8, 4), (8, 7)], ids=str)
@pytest.mark.parametrize("width", [1.0, 0.8])
def test_followed_advice_leaves_none(facets, width, method):
    """Coarse and fine, soft and stiff, long and short sides: no advice is taken back by the next."""
    swaps, (n, m) = 0, facets
    for E in (1.0, 100.0, 0.01, 2.0):
        upper = block("upper", 0.0, n, E, D="top").surface("bottom")
        lower = block("lower", -1.0, m, 1.0, width, D="bottom").surface("top")
        for one, other in ((upper, lower), (lower, upper)):
            swap, mortar = advice(one, other, method)
            if swap:
                swaps += 1
                assert advice(other, one, method) == (False, False), (n, m, E, width)
            if mortar:
                assert method == "node" and not advice(one, other, "mortar")[1]
    assert swaps > 0


def pressed(n, friction=None, **settings):
    """A block with a rounded bottom, of which few points touch."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(-1, 1, n + 1), np.linspace(0, 1, 5)).with_defaults()
    mesh.doflocs[1] += 0.05 * mesh.p[0] ** 2 * (1 - mesh.p[1])
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    x = basis.project(lambda x: np.stack([0 * x[0], -0.01 + 0 * x[0]]))
    body = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", x=x)
    pair = sc.Contact(
        body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=friction, **settings
    )
    return sc.ContactSolver(body, pair)


def test_all_iterations_are_said():
    """With finite sliding a step is solved in rounds, and the message counts those of all."""
    result = pressed(16, sc.Coulomb(0.2), sliding="finite").solve()
    assert result.iterations == len(result.trace) > 1
    assert f"converged in {result.iterations} iterations" in result.message


def test_the_body_that_errs_most_is_named():
    """Of two meshes the one with the larger share in the error of the energy is to be refined."""
    upper = block("upper", 0.0, 4, 1.0).surface("bottom")
    contact = sc.Contact(upper, sc.RigidPlane((0, 0), (0, 1)))
    sources = sc.answers.ErrorSources(bodies=0.1, edges=0.01)
    values = SimpleNamespace(points=upper.points, contact=contact)
    for coarse, fine in (("upper", "lower"), ("lower", "upper")):
        numbers = np.arange(2)
        elements = {fine: (numbers, np.array([0.3, 0.1])), coarse: (numbers, np.array([0.25, 0.35]))}
        found = sc.answers.ErrorEstimate(sources, sources, np.zeros(5), elements, 0, "")
        words = _advice(contact, values, found)
        assert f"the mesh of {coarse} around the contact" in words
