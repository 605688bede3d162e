"""The dry run says what of a body may be other than meant: slits, half held sides, another mesh's K."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity

import skfem_contact as sc

SLIT = "of its nodes lie where another one is"
HALF = "D holds the corners of"
TURN = "K resists rotations of the whole body and no translations"
QUADRATIC = (
    (fem.MeshTri, fem.ElementTriP2),
    (fem.MeshQuad, fem.ElementQuad2),
    (fem.MeshQuad, fem.ElementQuadS2),
    (fem.MeshTet, fem.ElementTetP2),
    (fem.MeshHex, fem.ElementHexS2),
)


def said(body, *others, surface="bottom"):
    """The dry run of a body on a rigid floor, or of the contacts that are given."""
    up = np.eye(body.dim)[{"bottom": 1}.get(surface, 0)]
    floor = sc.Contact(body.surface(surface), sc.RigidPlane(np.zeros(body.dim), up))
    return str(sc.ContactSolver(body, [floor, *others]))


def squares(*left):
    """Unit squares with their left sides at these places, each with nodes of its own."""
    parts = [fem.MeshQuad().refined(2).translated((x, 0.0)) for x in left]
    p = np.hstack([part.p for part in parts])
    t = np.hstack([part.t + i * parts[0].p.shape[1] for i, part in enumerate(parts)])
    return fem.MeshQuad(p, t).with_defaults()


def elastic(mesh, element=None, **settings):
    basis = fem.Basis(mesh, fem.ElementVector(element or fem.ElementQuad1()))
    return sc.Body(basis, settings.pop("K", linear_elasticity()), name="body", **settings)


def test_parts_that_were_not_merged_are_told():
    """Nodes at one place, unless they stand in contact with each other; merged they are one."""
    two = squares(0.0, 1.0)
    # the lowest of the five stand in the contact with the floor, both of them
    assert f"  4 {SLIT}" in said(elastic(two, D="top"))
    assert SLIT not in said(elastic(two.remove_duplicate_nodes().with_defaults(), D="top"))
    assert SLIT not in said(elastic(squares(0.0, 1.5), D="top"))
    sides = two.with_boundaries(
        {
            name: np.flatnonzero(
                np.isclose(two.p[0][two.facets], 1.0).all(axis=0)
                & (two.f2t[1] < 0)
                & ((two.p[0][two.t[:, two.f2t[0]]].mean(axis=0) < 1.0) == (name == "one"))
            )
            for name in ("one", "other")
        }
    )
    body = elastic(sides, D="top")
    joint = sc.Contact(body.surface("one"), body.surface("other"), name="joint")
    assert SLIT not in said(body, joint)


@pytest.mark.parametrize(("mesh", "element"), QUADRATIC)
def test_sides_held_at_their_corners_only_are_told(mesh, element):
    """`nodal` leaves out what is between the corners; a row of elements between two sides does not."""
    dim = 3 if mesh in (fem.MeshTet, fem.MeshHex) else 2
    for n, names in ((2, "top"), (1, ["top", "bottom"])):
        grid = [np.linspace(0.0, 1.0, 3)] * dim
        grid[1] = np.linspace(0.0, 1.0, n + 1)
        whole = elastic(mesh.init_tensor(*grid).with_defaults(), element(), D=names)
        assert HALF not in said(whole, surface="left")
    dofs = whole.basis.get_dofs("top").nodal
    half = elastic(whole.basis.mesh, element(), D=np.concatenate([np.ravel(d) for d in dofs.values()]))
    facets = {fem.MeshTet: 8, fem.MeshHex: 4}.get(mesh, 2)
    assert f"  {HALF} {facets} facets" in said(half, surface="left")


def test_the_stiffness_of_another_mesh_is_told():
    """It resists turns of the body; springs resist translations too, a uniform scale is right."""
    mesh = fem.MeshQuad().refined(2).with_defaults()
    body = elastic(mesh, D="top")
    assert TURN not in said(body)
    for scale in ((1.001, 1.0), (1.0, 3.0)):
        other = elastic(mesh.scaled(scale), D="top")
        assert f"  {TURN}" in said(elastic(mesh, D="top", K=other.K))
    assert TURN not in said(elastic(mesh, D="top", K=elastic(mesh.scaled(0.001)).K))
    bedding = fem.BilinearForm(lambda u, v, w: 1e-3 * (u[0] * v[0] + u[1] * v[1])).assemble(body.basis)
    assert TURN not in said(elastic(mesh, D="top", K=body.K + bedding))
