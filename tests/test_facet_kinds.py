"""Kinds of facets carry all that is asked of them: one more is added as docs/extending.md says.

Faces of 7 nodes of tetrahedra of 14; scikit-fem has neither as elements whose DOFs are values at nodes.
"""

from __future__ import annotations

import pickle

import matplotlib.pyplot as plt
import meshio
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.bodies import KINDS, SUPPORTED, FacetKind, kind_of
from skfem_contact.errors import InputError

TET = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3), (0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]
TRI = [(0, 1), (1, 2), (0, 2), (0, 1, 2)]
# polynomials by barycentric coordinates: quadratic ones, less what they are where bubbles are one
CORNER, EDGE, CENTRE = (2.0, -1.0, 3.0), (4.0, -12.0), 27.0


def values(x, corners, middles, i):
    """Lagrange function i of the corners, middles of edges and centres of triangles of a simplex."""
    bubbles = {t: np.prod([x[a] for a in t], axis=0) for t in middles if len(t) == 3}
    if i < corners:
        around = sum(b for t, b in bubbles.items() if i in t)
        return CORNER[0] * x[i] ** 2 + CORNER[1] * x[i] + CORNER[2] * around
    some = middles[i - corners]
    if len(some) == 3:
        return CENTRE * bubbles[some]
    around = sum(b for t, b in bubbles.items() if set(some) <= set(t))
    return EDGE[0] * x[some[0]] * x[some[1]] + EDGE[1] * around


class Simplex(fem.element.ElementH1):
    """Lagrange functions of corners, middles of edges and centres of triangles."""

    nodal_dofs, facet_dofs = 1, 1
    maxdeg = 3
    dofnames = ("u", "u", "u")

    def lbasis(self, X, i):
        """A function, and its derivatives by complex steps, exact to round-off."""
        step, corners = 1e-100, len(X) + 1
        slopes = []
        for shift in 1j * step * np.eye(len(X)):
            Z = [x + s for x, s in zip(X, shift, strict=True)]
            slopes.append(values([1 - sum(Z), *Z], corners, self.middles, i).imag / step)
        return values([1 - sum(X), *X], corners, self.middles, i), np.array(slopes)


def places(d, middles):
    """Reference coordinates of all nodes."""
    at = np.vstack([np.zeros(d), np.eye(d)])
    return np.vstack([at, *(at[list(some)].mean(axis=0) for some in middles)])


class Tri7(Simplex):
    interior_dofs = 1
    middles = TRI
    refdom = fem.refdom.RefTri
    doflocs = places(2, TRI)


class Tet14(Simplex):
    edge_dofs = 1
    middles = TET
    refdom = fem.refdom.RefTet
    doflocs = places(3, TET)


PARTS = [(0, 3, 6), (3, 1, 6), (1, 4, 6), (4, 2, 6), (2, 5, 6), (5, 0, 6)]


@pytest.fixture(autouse=True)
def foreign(monkeypatch):
    """The two entries of docs/extending.md."""
    monkeypatch.setitem(KINDS, "tri7", FacetKind("tri7", Tri7(), 3, 8, "triangle7", 34, PARTS))
    monkeypatch.setitem(SUPPORTED, Tet14, "tetra10")


def cube(name, low, n, element=Tet14, **given):
    """A cube of tetrahedra, from z = `low` upwards."""
    x = np.linspace(0.0, 1.0, n + 1)
    mesh = (
        fem.MeshTet.init_tensor(x, x, x)
        .translated((0.0, 0.0, low))
        .with_boundaries(
            {
                "low": lambda x: np.isclose(x[2], low),
                "high": lambda x: np.isclose(x[2], low + 1.0),
                "left": lambda x: np.isclose(x[0], 0.0),
                "front": lambda x: np.isclose(x[1], 0.0),
            }
        )
    )
    basis = fem.Basis(mesh, fem.ElementVector(element()), intorder=6)
    return sc.Body(basis, linear_elasticity(1.0, 1.0), name=name, **given)


def pressed(method, below=Tet14):
    """A cube that is pressed on another one by 1 %, both between planes of symmetry."""

    def held(*wanted):
        return lambda basis: np.concatenate(
            [basis.get_dofs(side).all([f"u^{axis}"]) for side, axis in wanted]
        )

    symmetric = ("left", 1), ("front", 2)
    lower = cube("lower", 0.0, 2, below, D=held(("low", 3), *symmetric))
    upper = cube("upper", 1.0, 3)
    D = held(("high", 3), *symmetric)(upper.basis)
    x = np.zeros(upper.basis.N)
    x[held(("high", 3))(upper.basis)] = -0.02
    upper = cube("upper", 1.0, 3, D=D, x=x)
    contact = sc.Contact(upper.surface("low"), lower.surface("high"), method=method)
    return sc.ContactSolver([upper, lower], contact).solve()


def test_shape_functions_of_the_foreign_kind():
    """They are one at their nodes and zero at the others, and add up to one."""
    for element in (Tri7(), Tet14()):
        at = element.doflocs.T
        N = np.array([element.lbasis(at, i)[0] for i in range(len(element.doflocs))])
        assert_allclose(N, np.eye(len(N)), rtol=0, atol=1e-14)
    kind = kind_of(3, 7)
    N, dN = kind.shapes(kind.quadrature()[0])
    assert_allclose(N.sum(axis=1), 1.0)
    assert_allclose(dN.sum(axis=1), 0.0, atol=1e-14)
    assert (kind.linear.name, kind.order, kind.taken, kind.centreless) == ("tri3", 3, 0.0, False)


@pytest.mark.parametrize("name", ["tri3", "tri6", "tri7", "quad4", "quad8", "quad9"])
def test_triangles_and_parts_fill_the_face(name):
    """Triangles, linear faces and cuts all have the area of the face, and none is turned over."""
    kind = KINDS[name]
    at = np.vstack([kind.locations, kind.middle])
    for parts in (kind.simplices, kind.cut, kind.linear_parts):
        x, y = np.moveaxis(at[np.asarray(parts)], 2, 0)
        area = 0.5 * np.sum(x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y, axis=1)
        assert np.all(area > 0)
        assert_allclose(area.sum(), 0.5 if kind.triangle else 1.0)
    assert pickle.loads(pickle.dumps(kind)) is kind


def test_elements_with_bubbles_are_refused(monkeypatch):
    """Also where they are said to be supported: a bubble has no place."""
    monkeypatch.setitem(SUPPORTED, fem.ElementTriP2B, "triangle7")
    basis = fem.Basis(fem.MeshTri(), fem.ElementVector(fem.ElementTriP2B()))
    with pytest.raises(InputError, match="ElementTriP2B, some of whose DOFs are values at no node"):
        sc.Body(basis, linear_elasticity())


def test_unknown_kinds_are_named():
    """Not as a KeyError."""
    with pytest.raises(InputError, match=r"5 nodes.*KINDS"):
        kind_of(3, 5)


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_bodies_with_foreign_faces(method, tmp_path):
    """Contact, estimate, validity, files and pictures of cubes under uniaxial pressure, 1 % of E."""
    result = pressed(method)
    values = result.values[0]
    assert values.surface.kind.name == "tri7"
    assert_allclose(values.surface.area.sum(), 1.0)
    assert result.certificate.worst < 1e-12
    exact = 0.01 * 2.5  # E = mu (3 lambda + 2 mu) / (lambda + mu)
    if method == "mortar":
        assert_allclose(values.pressure, exact, rtol=1e-10)
        assert values.error_estimate.pressure.total < 1e-10
    else:
        assert_allclose(values.force[2], exact, rtol=2e-3)
        assert_allclose(values.pressure.mean(), exact, rtol=0.05)
    assert_allclose(values.contact_area, 1.0)
    assert "holds" in str(result)
    assert pickle.loads(pickle.dumps(values.surface)).kind is values.surface.kind
    bodies, contacts = sc.write(tmp_path / "cubes.vtu", result)
    assert [block.data.shape for block in meshio.read(bodies).cells] == [(6 * 8 + 6 * 27, 10)]
    # VTK's number of a triangle of seven nodes, which meshio can not read, is 34
    read = pytest.importorskip("pyvista").read(contacts).cells_dict
    assert {cell: nodes.shape for cell, nodes in read.items()} == {34: (18, 7)}
    sc.plot_deformed(result)
    sc.plot_contact(result)
    plt.close("all")


def test_foreign_faces_on_known_ones():
    """The pressure of a cube on one of quadratic tetrahedra is uniform."""
    mixed = pressed("mortar", below=fem.ElementTetP2)
    assert_allclose(mixed.values[0].pressure, 0.025, rtol=1e-10)
