"""Steps that are cut to what points may slide, and contact that comes and goes along the way."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from sliding_scenes import dragged_block, elastic, rectangle, travel

import skfem_contact as sc
from skfem_contact.answers import answer_of

MU = 0.3


def test_P9_one_big_step_is_many_small_ones():
    """On a rigid track a step over 20 facets ends in the state of 40 small ones, and says so."""
    big = travel(dragged_block(rigid="outline"), [0.0, 2.5])[-1]
    small = travel(dragged_block(rigid="outline"), np.arange(41) * 0.0625)[-1]
    # gross slip on a flat track forgets its path: round-off is left
    assert_allclose(big.normal_force, small.normal_force, rtol=0, atol=1e-11)
    assert_allclose(big.tangential_force, small.tangential_force, rtol=0, atol=1e-11)
    assert_allclose(big.slip, small.slip, rtol=0, atol=1e-11)
    # work by the trapezoidal rule; only the step in which the block begins to slip is another
    assert_allclose(big.dissipation_total, small.dissipation_total, rtol=2e-2)
    assert "step cut" in big.message and "substep" in big.message
    assert "cut" not in small.message


def test_steps_on_an_elastic_track_are_cut_to_the_facet():
    """A step over ten facets is cut so that no point slides over more than one at a time."""
    solver = dragged_block(rigid=False)
    big = travel(solver, [0.0, 1.25])[-1]
    substeps = int(big.message.split("substep ")[1].split()[0].rstrip(")"))
    # ten facets at up to 95 %, and a start in which the block sticks
    assert 10 <= substeps <= 14
    small = travel(dragged_block(rigid=False), np.arange(21) * 0.0625)[-1]
    # another path through the joints with the same end: what is left is the pairing's 1e-4 and the
    # slip of the corners, which remembers where joints were met
    assert_allclose(big.force, small.force, rtol=1e-4)


def test_no_step_is_cut_on_a_plane():
    """A rigid plane is the same all along the way: one step ends where forty do."""
    big = travel(dragged_block(rigid=True), [0.0, 2.5])[-1]
    small = travel(dragged_block(rigid=True), np.arange(41) * 0.0625)[-1]
    assert "cut" not in big.message
    for name in ("normal_force", "tangential_force", "slip"):
        assert_allclose(getattr(big, name), getattr(small, name), rtol=0, atol=1e-11)


def test_more_substeps_than_halvings():
    """A hundred facets in one step need no more cuts than one in a row."""
    big = travel(dragged_block(rigid="outline"), [0.0, 12.5])[-1]
    assert int(big.message.split("substep ")[1].split()[0].rstrip(")")) >= 100
    assert_allclose(big.force, [-MU, 1.0], rtol=0, atol=1e-10)


def test_travel_without_limit():
    """With max_travel = inf steps are taken as given."""
    solver = dragged_block(rigid="outline")
    free = sc.ContactSolver(
        solver.system.bodies, solver.contacts, options=sc.Options(max_travel=np.inf)
    )
    big = travel(free, [0.0, 2.5])[-1]
    assert "cut" not in big.message
    assert_allclose(big.force, [-MU, 1.0], rtol=0, atol=1e-10)


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_points_leave_the_primary_surface_and_come_back(method):
    """Dragged over the end of the track and back, the block loses points and finds them again.

    Friction at its foot shifts the resultant forward by mu times its height, to 0.8 of its width: it
    would tip over if it lost the node at 0.875 too.
    """
    facets = np.linspace(-0.5, 1.125, 14)
    there = np.linspace(0, 0.24, 9)
    solver = dragged_block(rigid=False, facets=facets, method=method)
    # node by node the edge of the track presses unseen into what lies between two nodes of the block
    with (
        pytest.warns(sc.ContactWarning, match=r"overlap by up to 0\.00.* 'track/top' lies in the body")
        if method == "node"
        else nullcontext()
    ):
        results = travel(solver, [*there, *there[-2::-1], -0.1])
    count = [int(answer_of(r).kin.paired.sum()) for r in results]
    assert count[0] == 9 and count[8] < 9 and count[-1] == 9
    # what is beyond the end carries nothing, and the rest carries all of the load
    assert all(np.all(r.normal_force[~answer_of(r).kin.paired] == 0.0) for r in results)
    assert_allclose([r.force[1] for r in results], 1.0, rtol=1e-9)
    friction = np.array([r.force[0] for r in results])
    # frames tilt by p/E at the edge of the track, several times as much as in its middle
    assert_allclose(friction[3:9], -MU, rtol=0.05)
    assert_allclose(friction[-3:], MU, rtol=0.05)


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_both_sides_of_a_slot(method):
    """A key that is too thick for its slot is pushed against friction on both flanks at once."""
    E, overlap = 1e3, 2e-3
    key_basis = rectangle(np.linspace(0, 1, 9), np.linspace(0, 0.5, 5))
    D = key_basis.get_dofs("right").nodal["u^1"]
    x = np.zeros(key_basis.N)
    x[D] = 1.0
    key = sc.Body(key_basis, elastic(E), D=D, x=x, name="key")
    flanks = [
        sc.Body(rectangle(np.linspace(-1, 2, 28), y), elastic(E), D=tag, name=name)
        for name, y, tag in (
            ("lower", np.linspace(-0.5, 0, 5), "bottom"),
            ("upper", np.linspace(0.5, 1.0, 5), "top"),
        )
    ]
    contacts = [
        sc.Contact(
            key.surface(side),
            flank.surface(other),
            friction=sc.Coulomb(MU),
            sliding="finite",
            method=method,
            interference=overlap,
            name=flank.name,
        )
        for flank, side, other in zip(flanks, ("bottom", "top"), ("top", "bottom"), strict=True)
    ]
    solver = sc.ContactSolver([key, *flanks], contacts)
    results = travel_key(solver, np.arange(0, 7) * 0.1)
    for r in results[3:]:
        low, high = r["lower"].force, r["upper"].force
        assert low[1] > 0 > high[1]
        # mirror images: what is left are the nodes at joints, which one flank may hold
        assert_allclose(low[1], -high[1], rtol=1e-6)
        assert_allclose(low[0], high[0], rtol=1e-5)
        assert_allclose(-low[0], MU * low[1], rtol=0.02)  # frames tilt by p/E


def travel_key(solver, distances):
    return list(solver.history([{"x": {"key": d}} for d in distances]))


def test_a_surface_against_itself_is_refused():
    """The same surface on both sides, or two that share facets, is refused in words."""
    body = sc.Body(rectangle([0, 1, 2], [0, 1, 2]), elastic(1.0), D="bottom", name="ring")
    top = body.surface("top")
    with pytest.raises(sc.errors.InputError, match="'ring/top' share 2 facets of one body"):
        sc.Contact(top, body.surface("top"))
    mesh = body.basis.mesh
    both = body.surface(mesh.facets_satisfying(lambda p: (p[1] > 1 - 1e-9) | (p[0] > 2 - 1e-9), True))
    with pytest.raises(sc.errors.InputError, match="in contact with itself is not supported"):
        sc.Contact(both, top, friction=sc.Coulomb(0.1))


def c_spring():
    """A bar with a slit, whose two flanks are disjoint surfaces of one body."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 11), np.linspace(0, 0.5, 6))
    middle = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.restrict(~((np.abs(middle[1] - 0.25) < 0.06) & (middle[0] > 0.3)))
    tags = {
        "lower": mesh.facets_satisfying(lambda p: (np.abs(p[1] - 0.2) < 1e-9) & (p[0] > 0.3), True),
        "upper": mesh.facets_satisfying(lambda p: (np.abs(p[1] - 0.3) < 1e-9) & (p[0] > 0.3), True),
        "left": mesh.facets_satisfying(lambda p: p[0] < 1e-9),
        "top": mesh.facets_satisfying(lambda p: p[1] > 0.5 - 1e-9),
    }
    return fem.Basis(mesh.with_boundaries(tags), fem.ElementVector(fem.ElementQuad1()))


@pytest.mark.filterwarnings("ignore:.*has turned.*:skfem_contact.ContactWarning")
def test_two_flanks_of_one_body():
    """The flanks of a slit in one body may touch: they are two surfaces without a common facet."""
    basis = c_spring()
    load = fem.LinearForm(lambda v, w: -10.0 * v[1]).assemble(basis.boundary("top"))
    body = sc.Body(basis, elastic(1e3), f=load, D="left", name="clip")
    contact = sc.Contact(
        body.surface("upper"), body.surface("lower"), friction=sc.Coulomb(MU), sliding="finite"
    )
    *_, last = sc.ContactSolver([body], contact).history(np.linspace(0.25, 1, 4))
    assert last.force[1] > 0 and np.any(last.status != 0)
    # forces between two parts of one body cancel: the wall carries the load alone
    assert last.certificate.worst < 1e-8


def slab(obstacle, **settings):
    """An elastic slab held at the top, above an obstacle that sticks out by 0.01."""
    basis = rectangle(np.linspace(0, 2, 41), np.linspace(0, 0.5, 11))
    body = sc.Body(basis, elastic(1e3), D="top", name="slab")
    contact = sc.Contact(
        body.surface("bottom"), obstacle, friction=sc.Coulomb(MU), sliding="finite", **settings
    )
    return sc.ContactSolver([body], contact)


def circle(x):
    return np.hypot(x[0] - 0.6, x[1] + 1.0) - 1.0


OBSTACLES = {
    "sphere": sc.RigidSphere((0.6, -1.0), 1.0, name="tool"),
    "level set": sc.obstacles.LevelSet(circle, name="tool"),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", OBSTACLES)
def test_a_roller_that_spins_drags_by_mu(kind):
    """Spun about its axis by half a turn, a roller moves nowhere and drags by mu times its force."""
    solver = slab(OBSTACLES[kind])
    down = [{"motion": {"tool": (0.0, 0.01)}}]
    spin = [{"motion": {"tool": ((0.0, 0.01), angle, (0.6, -1.0))}} for angle in (0.05, 0.1, 1.0, 3.0)]
    pressed, *turned = solver.history(down + spin)
    for r in turned[1:]:
        assert np.all(r.status[r.status != 0] == 2)
        # the surface of a roller that turns counterclockwise moves to the left at its top; the contact
        # is inclined to both sides by up to 0.1 and shifted a little: second order in that
        assert_allclose(r.force[0] / r.force[1], -MU, rtol=0.02)
        # pressure and shear are coupled by the layer: the normal force changes by a few per cent
        assert_allclose(r.force[1], pressed.force[1], rtol=0.06)
    # gross slip does not depend on how far it has gone
    assert_allclose(turned[-1].force, turned[-2].force, rtol=1e-6)


def test_a_level_set_is_the_cylinder_it_describes():
    """Sliding along under a slab, a level set and the cylinder give the same forces."""
    path = [{"motion": {"tool": (0.02 * k, 0.01)}} for k in range(1, 31)]
    a = np.array([r.force for r in slab(OBSTACLES["sphere"]).history(path)])
    b = np.array([r.force for r in slab(OBSTACLES["level set"]).history(path)])
    # gaps of the level set come from its value and gradient, projected by Newton's method
    assert_allclose(b, a, rtol=1e-6, atol=1e-8)
    # points open behind it and close before it, with a ripple of the facets over the zone's five
    assert_allclose(a[15:, 0] / a[15:, 1], MU, rtol=0.05)


def test_a_roller_creeps_before_it_slides():
    """A roller that spins a little faster or slower than it travels drags this way or that.

    In between it sticks in a part of the contact (Carter), and drags less than when it slides.
    """
    ratio = []
    for creep in (-0.05, 0.0, 0.05):
        solver = slab(OBSTACLES["sphere"])
        path = [
            {"motion": {"tool": ((s, 0.01), s * (1 - creep), (0.6, -1.0))}}
            for s in np.linspace(0.0, 0.6, 16)
        ]
        *_, last = solver.history(path)
        ratio.append(last.force[0] / last.force[1])
        assert np.any(last.status == 1) == (creep == 0.0)
    # the facets of the slab lean by up to one facet over the radius
    assert_allclose([ratio[0], ratio[2]], [-MU, MU], rtol=0.05)
    assert ratio[0] < 0.6 * -abs(ratio[1]) and ratio[2] > 1.5 * abs(ratio[1])


def test_turns_of_an_obstacle_add_up_whatever_the_centre():
    """A motion is the same one about another centre, and a spin slides by the length of the arc."""
    from skfem_contact.conditions import Motion

    a = Motion(np.array([0.3, -0.2]), 0.7, np.array([1.0, 2.0]))
    b = a.about(np.array([-4.0, 0.5]))
    x = np.array([[0.0, 0.0], [2.0, 1.0], [-3.0, 0.1]])
    assert_allclose(b.shift(x), a.shift(x), rtol=0, atol=1e-14)
    spun = Motion(a.translation, 2.7, a.centre)
    top = a.centre + a.translation + np.array([[0.0, 1.0]])
    assert_allclose(spun.slid(a, top), [[-2.0, 0.0]], rtol=0, atol=1e-14)
    assert_allclose(spun.slid(b, top), [[-2.0, 0.0]], rtol=0, atol=1e-14)
    # turned before, and turned now about another centre: only the difference counts
    assert_allclose(b.slid(a, top), [[0.0, 0.0]], rtol=0, atol=1e-14)


def ironing_ripple(method):
    """Ripple of the ratio of forces while an elastic die passes the nodes of a softer block."""
    block = sc.Body(
        rectangle(np.linspace(0, 3, 61), np.linspace(-1, 0, 13)), elastic(1.0), D="bottom", name="block"
    )
    polar = fem.MeshQuad.init_tensor(np.linspace(0.5, 1, 5), np.linspace(-0.6, 0.6, 21) - np.pi / 2)
    tags = {
        "inner": polar.facets_satisfying(lambda x: x[0] < 0.51),
        "outer": polar.facets_satisfying(lambda x: x[0] > 0.99),
    }
    r, angle = polar.p
    bent = fem.MeshQuad(
        np.array([1.2 + 0.5 * r * np.cos(angle), 0.5 + 0.5 * r * np.sin(angle)]), polar.t
    )
    basis = fem.Basis(bent.with_boundaries(tags), fem.ElementVector(fem.ElementQuad1()), intorder=4)
    held = basis.get_dofs("inner")
    right, down = np.zeros((2, basis.N))
    right[held.nodal["u^1"]], down[held.nodal["u^2"]] = 1.0, -1.0
    die = sc.Body(basis, elastic(10.0), D=held, name="die")
    contact = sc.Contact(
        block.surface("top"),
        die.surface("outer"),
        friction=sc.Coulomb(MU),
        sliding="finite",
        method=method,
    )
    solver = sc.ContactSolver([block, die], [contact])
    press = [{"x": {"die": 0.02 * k * down}} for k in (1, 2)]
    drag = [{"x": {"die": 0.04 * down + s * right}} for s in 0.02 * np.arange(1, 21)]
    force = np.array([r.force for r in solver.history(press + drag)])[-10:]
    ratio = force[:, 0] / -force[:, 1]
    return np.ptp(ratio) / ratio.mean()


@pytest.mark.slow
def test_ironing_with_mortar_ripples_less():
    """Nodes of the block that meet and leave the die are felt node by node, hardly with mortar."""
    node, mortar = ironing_ripple("node"), ironing_ripple("mortar")
    # a die whose zone has about five facets of the block: one of five nodes comes and goes
    assert node < 0.1
    assert mortar < 0.005
    assert mortar < 0.2 * node


@pytest.mark.parametrize("rigid", [True, False])
def test_slip_without_friction_is_the_way(rigid):
    """A smooth block slips by the way of its top, however many steps it takes."""
    rough = dragged_block(rigid=rigid)
    smooth = rough.with_friction(None)
    distances = [0.0, 0.1, 0.2, 0.3, 0.4]
    first, *results = travel(smooth, distances)
    for distance, result in zip(distances[1:], results, strict=True):
        slip = (result.slip - first.slip)[:, 0] * np.sign(result.tangent[0, 0, 0])
        # on the plane nothing else moves; the elastic track spreads under the block by strains of P/E
        assert_allclose(slip, distance, rtol=0, atol=1e-12 if rigid else 1e-3)
        assert (result.status == 2).all()
