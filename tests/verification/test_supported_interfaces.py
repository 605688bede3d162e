"""Mortar contact where supports meet the interface: clamped and gripped ends, lines of symmetry.

The oracles are node-to-segment contact on the same mesh, the whole model for half a model, and
fields that are linear between prescribed ends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scenes import elastic
from skfem.models.poisson import laplace
from unlike_meshes import KINDS, named_sides, rectangle

import skfem_contact as sc

FORM = elastic(1.0, 0.3)
DEEP = 1e-3  # interference, and by how much blocks are pushed together
ENDS = r"prescribed displacements push"
ALL = tuple(KINDS)
FLOOR = 1e-6  # of the terms that cancel, a scale where nothing acts: see `Certificate`
# facets of the two bodies: matching, nearly so, coarse, nearly so and finer
MESHES = [(20, 20), (20, 21), (20, 24), pytest.param((40, 41), marks=pytest.mark.slow)]


def held(basis, *where):
    """DOFs of sides, each with its components, as in ``("left", "u^1")``."""
    dofs = [
        basis.get_dofs(side).all(parts) if parts else basis.get_dofs(side).all()
        for side, parts in where
    ]
    return np.unique(np.concatenate([np.zeros(0, dtype=int), *dofs]))


def towards(n):
    """Nodes from 0 to 1 that get closer and closer to 1: the other side of the body matters little."""
    return 1 - np.linspace(1, 0, n + 1) ** 2


def press_fit(kind, facets, law=None):
    """Shaft and hub, twice as high as thick, clamped on one floor and guided at their far sides."""
    shaft, hub = (np.linspace(0, 2, n + 1) for n in facets)
    bases = rectangle(kind, towards(8), shaft), rectangle(kind, 2 - towards(8)[::-1], hub)
    bodies = [
        sc.Body(basis, FORM, D=held(basis, ("bottom", None), (far, "u^1")), name=name)
        for basis, far, name in zip(bases, ("left", "right"), ("shaft", "hub"), strict=True)
    ]
    surfaces = bodies[0].surface("right"), bodies[1].surface("left")
    return bodies, surfaces, {"interference": DEEP, "friction": law}


def gripped_blocks(kind, facets, law=None, parts=None):
    """Two blocks, one pushed into the other, gripped at their sides in all or in one direction."""
    bodies = []
    depth = towards(8)
    for n, y, push, name in ((facets[0], depth, 0.0, "low"), (facets[1], 2 - depth[::-1], DEEP, "top")):
        basis = rectangle(kind, np.linspace(0, 1, n + 1), y)
        sides = (("left", parts), ("right", parts))
        D = held(basis, *sides, ("bottom" if name == "low" else "top", "u^1"))
        x = np.zeros(basis.N)
        x[held(basis, ("left", "u^2"), ("right", "u^2"))] = -push
        bodies.append(sc.Body(basis, FORM, D=D, x=x, name=name))
    surfaces = bodies[0].surface("top"), bodies[1].surface("bottom")
    return bodies, surfaces, {"friction": law}


def total(scene, method, swap):
    """Contact force normal to the interface; the overlap at the ends that no row can mend is said."""
    bodies, surfaces, settings = scene
    contact = sc.Contact(*surfaces[:: -1 if swap else 1], method=method, **settings)
    with pytest.warns(sc.ContactWarning, match=ENDS):
        result = sc.ContactSolver(bodies, contact).solve()
    assert result.converged
    # all rows that can be fulfilled are; the overlap at the ends is that of the prescribed nodes
    certificate = result.certificate
    assert max(certificate.equilibrium, certificate.force_balance, certificate.moment_balance) < 1e-12
    n = result.normal[len(result.normal) // 2]
    return abs(result.force @ n), result


def compare(scene):
    """Totals of node-to-segment contact, and of mortar over them, for both choices of the secondary."""
    node = np.array([total(scene, "node", swap)[0] for swap in (False, True)])
    mortar = np.array([total(scene, "mortar", swap)[0] for swap in (False, True)])
    return node, mortar / node


@pytest.mark.every_value
@pytest.mark.parametrize("facets", MESHES, ids=str)
@pytest.mark.parametrize("kind", ALL)
def test_press_fit_on_a_clamped_floor(kind, facets):
    """The force of an interference between clamped bodies does not depend on the method.

    The clamped end is singular, so totals grow slowly with the mesh, and those of quadratic
    elements are those of a finer mesh. Mortar was wrong by up to 6e5 times.
    """
    node, ratio = compare(press_fit(kind, facets))
    assert np.all((node > 1.3 * DEEP) & (node < 1.9 * DEEP))
    # meshes that differ by a fifth have totals that differ by 7 %, and mortar is between
    assert_allclose(ratio, 1.0, atol=0.04)
    if facets[0] == facets[1]:  # matching: the same rows
        assert_allclose(ratio, 1.0, atol=1e-9)


@pytest.mark.every_value
@pytest.mark.parametrize("parts", [None, "u^2"], ids=["all", "along"])
@pytest.mark.parametrize("facets", MESHES, ids=str)
@pytest.mark.parametrize("kind", ["Q1", "P2", "S2"])
def test_gripped_blocks(kind, facets, parts):
    """The same for blocks pushed together by grips at their sides, both ends singular."""
    node, ratio = compare(gripped_blocks(kind, facets, parts=parts))
    assert np.all((node > 1.2 * DEEP) & (node < 2.3 * DEEP))
    assert_allclose(ratio, 1.0, atol=0.04)


@pytest.mark.every_value
@pytest.mark.parametrize("scene", [press_fit, gripped_blocks])
@pytest.mark.parametrize("kind", ["Q1", "Q2"])
def test_with_friction(kind, scene):
    """With friction too, whose rows at the clamped node are prescribed as well."""
    _, ratio = compare(scene(kind, (20, 21), sc.Coulomb(0.3)))
    assert_allclose(ratio, 1.0, atol=0.04)


def test_prescribed_node_carries_nothing_and_is_seen():
    """Where both bodies are clamped the row is that of node-to-segment contact: open, overlapping."""
    _, result = total(press_fit("Q1", (20, 21)), "mortar", False)
    end = np.argmin(result.points[:, 1])
    assert result.status[end] == 0 and result.pressure[end] == 0.0
    assert_allclose(result["contact 1"].gap[end], -DEEP)
    assert_allclose(result.area.sum(), 2.0)
    assert_allclose(result.certificate.penetration * 2.0, DEEP)  # over the extent of the bodies


@pytest.mark.every_value
@pytest.mark.parametrize("facets", [(20, 21), (40, 41)], ids=str)
@pytest.mark.parametrize("method", ["node", "mortar"])
def test_clamps_that_end_near_each_other(method, facets):
    """Of bodies clamped up to a fifth of their height one clamp ends a fifth of a facet earlier.

    The secondary's last clamped node stands beside the primary's, before the free one. To close its gap
    that one would have to go five times as far: the force was 29 times that of clamps of one length.
    """

    def force(facets, method):
        bodies, surfaces, settings = press_fit("Q1", facets)
        clamped = [
            sc.Body(b.basis, FORM, D=np.union1d(b.D, np.flatnonzero(b.dof_points[:, 1] <= 0.4 + 1e-9)))
            for b in bodies
        ]
        surfaces = clamped[0].surface("right"), clamped[1].surface("left")
        return total((clamped, surfaces, settings), method, False)[0]

    # that the primary is free a fifth of a facet earlier is what is left
    assert force(facets, method) == pytest.approx(force((facets[0],) * 2, "node"), rel=0.05)


@pytest.mark.every_value
@pytest.mark.parametrize("scene", [press_fit, gripped_blocks])
@pytest.mark.parametrize("method", ["node", "mortar"])
def test_finite_sliding_and_all_dofs_agree(method, scene):
    """The same forces where the pairing follows, and where nothing is condensed.

    Displacements are a thousandth of the bodies, and so is what they change of the forces.
    """
    bodies, surfaces, settings = scene("Q1", (12, 13), sc.Coulomb(0.3))
    forces = []
    for sliding, linear in (("small", "auto"), ("small", sc.linalg.Direct()), ("finite", "auto")):
        contact = sc.Contact(*surfaces, method=method, sliding=sliding, **settings)
        with pytest.warns(sc.ContactWarning, match=ENDS):
            forces.append(sc.ContactSolver(bodies, contact, linear=linear).solve().force)
    assert_allclose(forces[1], forces[0], rtol=1e-9, atol=1e-9 * DEEP)
    assert_allclose(forces[2], forces[0], rtol=DEEP, atol=DEEP * DEEP)


def pressed_at_one_side(n, method):
    """A block guided down at its left side, on a longer layer: a secondary that is clamped alone."""
    layer = rectangle("Q1", np.linspace(-1, 2, 3 * n + 4), np.linspace(-1, 0, n // 2 + 1))
    basis = rectangle("Q1", np.linspace(0, 1, n + 1), np.linspace(0, 1, n // 2 + 1))
    x = np.zeros(basis.N)
    x[held(basis, ("left", "u^2"))] = -DEEP
    low = sc.Body(layer, FORM, D="bottom", name="layer")
    top = sc.Body(basis, FORM, D="left", x=x, name="block")
    contact = sc.Contact(top.surface("bottom"), low.surface("top"), method=method)
    return sc.ContactSolver([low, top], contact).solve()


def test_clamped_alone_hands_its_multiplier_over():
    """The clamped corner shows its neighbour's pressure, forces are exact, the total is nearer."""
    result = pressed_at_one_side(12, "mortar")
    corner, beside = np.argsort(result.points[:, 0])[:2]
    assert result.certificate.worst < 1e-12
    assert result.pressure[corner] == result.pressure[beside] > 0
    assert result.area[corner] == result.normal_force[corner] == 0.0
    assert_allclose(result.integrate(result.traction), result.force, rtol=1e-12)
    # of three halves of a facet in the row one is the corner's, and acts there
    assert_allclose(result["contact 1"].action[beside, 0], 2 / 3 / 12, rtol=1e-12)
    exact = pressed_at_one_side(96, "mortar").force[1]
    coarse = pressed_at_one_side(12, "node").force[1]
    assert abs(result.force[1] / exact - 1) < 0.5 * abs(coarse / exact - 1)


# --- lines of symmetry --------------------------------------------------------------------------


def layers(kind, facets, *, whole=False, slope=0.0):
    """Two layers of unlike stiffness under a load that varies: the half of them, or the whole."""
    bodies = []
    for n, y, modulus, name in ((facets[0], 0, 1.0, "low"), (facets[1], 1, 5.0, "top")):
        mesh = rectangle(kind, np.linspace(0, 1, n + 1), y + np.linspace(0, 1, 4)).mesh
        mesh = replace(mesh, doflocs=mesh.p + np.array([[0.0], [slope]]) * mesh.p[0])
        if whole:  # the mirror image shares the nodes on x = 0
            mesh = named_sides(mesh + mesh.mirrored((1.0, 0.0)))
        basis = fem.Basis(mesh, fem.ElementVector(KINDS[kind]()), intorder=4)
        D = held(basis, *([] if whole else [("left", "u^1")]), *([("bottom", "u^2")] * (y == 0)))
        f = np.zeros(basis.N)
        if y == 0 and whole:
            D = np.append(D, basis.nodal_dofs[0, np.all(np.isclose(mesh.p, 0.0), axis=0)])
        if y == 1:
            load = fem.LinearForm(lambda v, w: -1e-3 * (1 + w.x[0] ** 2) * v[1])
            f = load.assemble(basis.boundary("top"))
        form = elastic(modulus, 0.3)
        bodies.append(sc.Body(basis, form, f=f, D=D, name=name))
    return bodies, (bodies[0].surface("top"), bodies[1].surface("bottom"))


def solved(bodies, surfaces, **settings):
    """Result, and its points in the order of x."""
    result = sc.ContactSolver(bodies, sc.Contact(*surfaces, **settings)).solve()
    found = result.certificate
    assert replace(found, friction=0.0).worst < 1e-11
    # where all points stick their slips are round-off: differences of a few displacements, measured
    # against `FLOOR` of the largest of these
    stuck = 4 * np.finfo(float).eps / FLOOR if np.all(result.status != 2) else 0.0
    assert found.friction < 1e-11 + stuck
    return result, np.lexsort(result.points[:, ::-1].T)


LAWS = {
    "slipping": {"friction": sc.Coulomb(0.05)},
    "sticking": {"friction": sc.Coulomb(2.0)},
    "glue": {"tied": True},
}


@pytest.mark.every_value
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "facets", [(6, 8), *(pytest.param(at, marks=pytest.mark.slow) for at in ((8, 6), (5, 7)))], ids=str
)
@pytest.mark.parametrize("kind", ALL)
def test_half_a_model_is_half_of_the_whole(kind, facets, law):
    """The tractions of half a model are those of the whole, without shear on the line of symmetry."""
    half, first = solved(*layers(kind, facets), method="mortar", **LAWS[law])
    whole, order = solved(*layers(kind, facets, whole=True), method="mortar", **LAWS[law])
    order = order[len(order) // 2 :]
    assert_allclose(half.points[first], whole.points[order], atol=1e-12)
    largest = np.abs(whole.friction_stress).max()
    assert largest > 1e-5
    # the certificate of either answer has twelve digits
    assert_allclose(half.traction[first], whole.traction[order], atol=1e-10 * largest)
    assert np.abs(half.friction_stress[first[0]]).max() <= 1e-10 * largest
    assert half.status[first[0]] == 1


@pytest.mark.pairwise
@pytest.mark.parametrize("law", ["slipping", "sticking", "glue"])
@pytest.mark.parametrize("slope", [0.1, 1.0])
@pytest.mark.parametrize("kind", ["Q1", "S2"])
def test_inclined_interface_on_a_line_of_symmetry(kind, slope, law):
    """Across the line of symmetry one DOF is left for both rows, and pressure and friction are smooth.

    With rows of mortar the second would be closed by the few free nodes of the primary that have some
    weight in it: forces 20 times as large, of either sign.
    """
    same, first = solved(*layers(kind, (8, 8), slope=slope), method="node", **LAWS[law])
    for facets in ((8, 9), (8, 10)):
        found, order = solved(*layers(kind, facets, slope=slope), method="mortar", **LAWS[law])
        # the primary mesh is finer by a fifth at most, next to a concentration of stress
        assert found.pressure[order[0]] == pytest.approx(same.pressure[first[0]], rel=0.04)
        friction, alike = found.friction_stress[order[0]], same.friction_stress[first[0]]
        assert_allclose(friction, alike, rtol=0, atol=0.04 * same.pressure[first[0]])


# --- what has to stay exact ---------------------------------------------------------------------


@pytest.mark.every_value
@pytest.mark.parametrize("settings", [{}, {"friction": sc.Coulomb(0.3)}, {"tied": True}], ids=str)
@pytest.mark.parametrize("ends", ["all", "u^1", "u^2"])
@pytest.mark.parametrize("kind", ALL)
def test_linear_fields_pass_between_prescribed_ends(kind, ends, settings):
    """Uniform compression with the sides prescribed, in all or one direction: the exact field."""
    shear = 0.0 if not settings.get("tied") else 0.4
    nu, E = 0.3, 1.0
    stress = np.array([[-0.2, shear], [shear, -1.0]])
    if ends == "u^1":
        stress[0, 1] = stress[1, 0] = 0.0  # a wall that guides has no shear
    # plane strain
    strain = (1 + nu) / E * (stress - nu * np.trace(stress) * np.eye(2))
    slope = 1e-3 * (strain + np.array([[0.0, 0.1], [-0.1, 0.0]]))
    bodies = []
    traction = fem.LinearForm(
        lambda v, w: 1e-3 * sum(stress[i, j] * w.n[j] * v[i] for i in range(2) for j in range(2))
    )
    bodies, exact = [], []
    for n, y, far, name in ((5, 0, "bottom", "low"), (7, 1, "top", "top")):
        basis = rectangle(kind, np.linspace(0, 1, n + 1), y + np.linspace(0, 1, 3))
        parts = None if ends == "all" else ends
        D = held(basis, ("left", parts), ("right", parts), (far, None))
        f = sum(traction.assemble(basis.boundary(side)) for side in ("left", "right"))
        body = sc.Body(basis, FORM, f=f, name=name)
        exact.append(np.einsum("nj,nj->n", slope[body.dof_component], body.dof_points))
        bodies.append(sc.Body(basis, body.K, f=f, D=D, x=exact[-1], name=name))
    surfaces = bodies[0].surface("top"), bodies[1].surface("bottom")
    result, _ = solved(bodies, surfaces, method="mortar", **settings)
    assert_allclose(result.u, np.concatenate(exact), atol=1e-11 * np.abs(result.u).max())
    # where the gap is prescribed on both sides the supports carry, as with node-to-segment contact
    inner = (result.points[:, 0] > 0) & (result.points[:, 0] < 1) | (ends == "u^1")
    assert_allclose(result.pressure[inner], 1e-3, rtol=1e-8)


@pytest.mark.parametrize("kind", ALL)
def test_linear_temperatures_pass_between_prescribed_ends(kind):
    """Heat through glue between sides of given temperature: the exact field, and its flux."""
    bodies, exact = [], []
    for n, y, far, name in ((5, 0, "bottom", "low"), (7, 1, "top", "top")):
        basis = rectangle(kind, np.linspace(0, 1, n + 1), y + np.linspace(0, 1, 3), scalar=True)
        exact.append(1 + basis.doflocs[0] - 2 * basis.doflocs[1])
        D = np.concatenate([basis.get_dofs(side).all() for side in ("left", "right", far)])
        bodies.append(sc.Body(basis, laplace, D=D, x=exact[-1], name=name))
    surfaces = bodies[0].surface("top"), bodies[1].surface("bottom")
    result, _ = solved(bodies, surfaces, method="mortar", tied=True)
    assert_allclose(result.u, np.concatenate(exact), atol=1e-12)
    inner = (result.points[:, 0] > 0) & (result.points[:, 0] < 1)
    assert_allclose(np.abs(result.pressure[inner]), 2.0, rtol=1e-9)


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_more_prescribed_points_than_nodes_in_glue(method):
    """Tractions of a fine side that is half prescribed are 300 times too large: it is said."""
    low = rectangle("P2", np.linspace(0, 1, 42), np.linspace(-1, 0, 5))
    top = rectangle("P2", np.linspace(0, 1, 8), np.linspace(0, 1, 5))
    x = np.zeros(top.N)
    x[held(top, ("top", "u^2"))] = -DEEP
    face = low.get_dofs("top").all()
    D = np.union1d(held(low, ("bottom", None)), face[low.doflocs[0, face] < 0.47])
    bodies = sc.Body(low, FORM, D=D, name="low"), sc.Body(top, FORM, D="top", x=x, name="top")
    pair = bodies[0].surface("top"), bodies[1].surface("bottom")
    glue = sc.Contact(*pair, method=method, tied=True)
    with pytest.warns(sc.ContactWarning, match="glued points of 'low/top' are prescribed altogether"):
        first = sc.ContactSolver(bodies, glue).solve()
    swapped = sc.ContactSolver(bodies, sc.Contact(*pair[::-1], method=method, tied=True)).solve()
    # the displacements are right, and the sum: redundant rows hold the coarse side at more places
    assert_allclose(np.abs(first.force[1]), np.abs(swapped.force[1]), rtol=0.1)
    assert np.abs(first.pressure).max() > 10 * np.abs(swapped.pressure).max()
