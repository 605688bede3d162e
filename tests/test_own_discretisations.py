"""Discretisations from outside the package: `Contact(method=function)`, as docs/extending.md says."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix, identity
from scipy.spatial import cKDTree

import skfem_contact as sc
from skfem_contact.bodies import tangents
from skfem_contact.pairing import Pairing, dual_mortar, node_to_segment


def nearest_nodes(secondary: Any, primary: Any, *, reach: float | None = None) -> Pairing:
    """Every node and the nearest one of the other side: exact where meshes match."""
    m = len(secondary.points)
    distance, node = cKDTree(primary.points).query(secondary.points)
    paired = distance <= (np.inf if reach is None else reach)
    normal = primary.normals[node]
    gap = np.sum(normal * (secondary.points - primary.points[node]), axis=1)
    return Pairing(
        points=secondary.points,
        normal=normal,
        tangent=tangents(normal),
        gap=np.where(paired, gap, np.inf),
        area=secondary.area,
        secondary_weights=identity(m, format="csr"),
        primary_weights=csr_matrix((np.ones(m), (np.arange(m), node)), (m, len(primary.points))),
        paired=paired,
        miss=np.where(paired, 0.0, np.inf),
        facet=np.full(m, -1),
    )


def own_node(secondary: Any, primary: Any, *, reach: float | None = None) -> Pairing:
    return node_to_segment(secondary, primary, reach=reach)


def own_mortar(secondary: Any, primary: Any, *, reach: float | None = None) -> Pairing:
    return dual_mortar(secondary, primary, reach=reach)


def block(dim: int, low: float, n: int, **given: Any) -> sc.Body:
    """A unit square or cube of n elements a side."""
    x = np.linspace(0, 1, n + 1)
    kinds = {
        2: (fem.MeshQuad, fem.ElementQuad1, "top", "bottom"),
        3: (fem.MeshHex, fem.ElementHex1, "high", "low"),
    }
    mesh, element, high, deep = kinds[dim]
    made = mesh.init_tensor(*[x] * (dim - 1), x + low).with_boundaries(
        {
            high: lambda x: np.isclose(x[-1], low + 1),
            deep: lambda x: np.isclose(x[-1], low),
        }
    )
    basis = fem.Basis(made, fem.ElementVector(element()), intorder=2)
    return sc.Body(basis, linear_elasticity(), **given)


def pressed(method: Any, dim: int = 2, below: int = 3, sliding: str = "small") -> sc.ContactSolver:
    """A block pressed on another one, and pushed aside, with friction."""
    high, low = ("top", "bottom") if dim == 2 else ("high", "low")
    down = {high: (0.01, *[0.0] * (dim - 2), -0.02)}
    upper = block(dim, 1.0, 3, D=high, x=down, name="upper")
    lower = block(dim, 0.0, below, D=low, name="lower")
    contact = sc.Contact(
        upper.surface(low),
        lower.surface(high),
        method=method,
        friction=sc.Coulomb(0.2),
        sliding=sliding,
    )
    return sc.ContactSolver([upper, lower], contact)


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize(("own", "known"), [(own_node, "node"), (own_mortar, "mortar")])
def test_a_discretisation_from_outside_is_as_good_as_one_from_inside(own, known, sliding):
    """The library's own, given as functions: the same answer, on meshes that do not match."""
    mine, theirs = (pressed(method, below=5, sliding=sliding).solve() for method in (own, known))
    assert_allclose(mine.u, theirs.u, rtol=0, atol=1e-13)
    assert mine.certificate.worst < 1e-12


@pytest.mark.parametrize("dim", [2, 3])
def test_nearest_nodes_are_exact_where_meshes_match(dim):
    """As node to segment there, in the plane and in space; with the rest of the library around it."""
    solver = pressed(nearest_nodes, dim)
    result = solver.solve()
    assert_allclose(result.u, pressed("node", dim).solve().u, rtol=0, atol=1e-13)
    assert "nearest_nodes" in str(solver)
    assert "Certificate" in result.report()
    moved = pickle.loads(pickle.dumps(solver)).solve()
    assert_allclose(moved.pressure, result.pressure)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"primary_weights": 2.0}, r"weights .* add up to one in each row; point 0 at \(0, 1\)"),
        ({"secondary_weights": 0.5}, r"weights .* add up to one"),
        ({"normal": 1.1}, "normals of length one"),
        ({"gap": np.nan}, "finite gaps"),
    ],
)
def test_a_pairing_that_is_out_of_balance_is_refused(change, words):
    """Weights that do not add up would make forces from nothing."""

    def wrong(*sides, reach=None):
        right = nearest_nodes(*sides, reach=reach)
        return replace(right, **{name: getattr(right, name) * by for name, by in change.items()})

    with pytest.raises(sc.errors.InputError, match=f"method=wrong has to return .*{words}"):
        pressed(wrong)


def test_what_is_no_pairing_is_refused():
    """Another object, another shape, another word."""
    with pytest.raises(sc.errors.InputError, match=r"returns None, not a .*Pairing"):
        pressed(lambda *sides, reach: None)
    with pytest.raises(sc.errors.InputError, match=r"returns gap of shape \(3,\); .* \(4,\)"):
        pressed(lambda *sides, reach: replace(nearest_nodes(*sides), gap=np.zeros(3)))
    with pytest.raises(sc.errors.InputError, match="nor a function that returns a Pairing"):
        pressed("nodes")


def test_obstacles_are_met_node_by_node():
    """A method is one of two surfaces."""
    upper = block(2, 0.0, 3, D="top", x={"top": (0.0, -0.02)})
    floor = sc.RigidPlane((0, 0), (0, 1))
    contacts = (sc.Contact(upper.surface("bottom"), floor, method=m) for m in (nearest_nodes, "node"))
    mine, theirs = (sc.ContactSolver(upper, contact).solve() for contact in contacts)
    assert_allclose(mine.pressure, theirs.pressure)
