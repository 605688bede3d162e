"""`RigidBody`: what users pass, what is refused, and how it shows in results and reports."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity

import skfem_contact as sc

PLANE = sc.RigidPlane((0.0, 0.5), (0, -1), name="floor")


def block(**given):
    mesh = fem.MeshQuad().refined(3).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    return sc.Body(basis, linear_elasticity(0.0, 0.5), D="bottom", name="block", **given)


def pressed(shape=None, linear="auto", **given):
    body = block()
    shape = shape or sc.RigidPlane((0.5, 1.0), (0, -1), name="die")
    die = sc.RigidBody(shape, **({"force": (0, -0.01), "D": "x"} | given))
    return sc.ContactSolver([body, die], [sc.Contact(body.surface("top"), die)], linear=linear)


def test_what_a_rigid_body_is_made_of():
    """Loads, prescribed motions and springs by name or number; the point and name of its obstacle."""
    die = sc.RigidBody(PLANE, force=(1, -2), moment=3, D=("rotation", "x"), x={"rotation": 0.1})
    assert die.name == "floor" and die.n == 3 and die.dim == 2 and die.about.tolist() == [0.0, 0.5]
    assert die.f.tolist() == [1, -2, 3] and die.D.tolist() == [0, 2] and die.x.tolist() == [0, 0, 0.1]
    assert die.K.nnz == 0 and repr(die).endswith("free: y>")
    other = sc.RigidBody(PLANE, D=[0, 2], x=(0.0, 7.0, 0.1), K=np.diag([1.0, 2, 3]), name="die")
    assert other.name == "die" and other.x.tolist() == [0, 0, 0.1]
    assert other.K.toarray().tolist() == np.diag([1.0, 2, 3]).tolist()
    space = sc.RigidBody(sc.RigidSphere((0, 0, 1.0), 1.0), moment=(1, 2, 3), D="rotation z")
    assert space.n == 6 and space.f.tolist() == [0, 0, 0, 1, 2, 3] and space.D.tolist() == [5]
    for array in (die.f, die.D, die.x, die.about, die.K.data):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 1
    twin = pickle.loads(pickle.dumps(other))
    assert np.array_equal(twin.x, other.x) and not twin.x.flags.writeable


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"force": 1.0}, "force of rigid body 'floor' is 1.0; give 2 finite numbers"),
        ({"force": (0, np.nan)}, "give 2 finite numbers"),
        ({"moment": (1, 2)}, "has to be one number"),
        ({"about": (0, 0, 1)}, "its obstacle is 2-D"),
        ({"about": "centre"}, "about of rigid body 'floor'"),
        ({"D": "z"}, "'z' is none; Known DOFs: 'rotation', 'x', 'y'"),
        ({"D": ("x", 3)}, "no DOF of a rigid body"),
        ({"D": True}, "no DOF of a rigid body"),
        ({"x": {"y": 1.0}}, "prescribes values 'y' that D does not have"),
        ({"x": (0, 1, 0)}, "prescribes values that D does not have"),
        ({"D": "x", "x": {"y": 1.0}}, "prescribes values 'y' that D does not have"),
        ({"D": "x", "x": {"x": np.inf}}, "not finite"),
        ({"K": (1, 2)}, "give 3 numbers"),
        ({"K": -np.ones(3)}, "springs and masses are >= 0"),
        ({"K": [[1, 0, 0.5], [0, 1, 0], [0, 0, 1]]}, "not symmetric"),
        ({"name": 3}, "name of a RigidBody"),
        ({"motion": (0, 1)}, "write D and x"),
    ],
)
def test_what_is_refused(given, words):
    """Every argument that can not be meant is refused with its name."""
    with pytest.raises((sc.errors.InputError, TypeError), match=words):
        sc.RigidBody(PLANE, **given)


def test_shapes_that_are_refused():
    """Bodies are no shapes; a level set has no point of its own to turn about."""
    with pytest.raises(sc.errors.InputError, match=r"obstacle of a RigidBody is .* give its shape"):
        sc.RigidBody(block())
    with pytest.raises(sc.errors.InputError, match="give its shape"):
        sc.RigidBody(sc.RigidBody(PLANE))
    wavy = sc.obstacles.LevelSet(lambda x: x[1], name="wavy")
    with pytest.raises(sc.errors.InputError, match="'wavy' has no centre of its own, give about"):
        sc.RigidBody(wavy)
    assert sc.RigidBody(wavy, about=(0, 1)).dim == 2


def test_two_rigid_sides_do_not_touch():
    """Rigid against rigid is refused in words, and so is a rigid secondary side."""
    die = sc.RigidBody(PLANE, name="die")
    with pytest.raises(sc.errors.InputError, match="Two rigid sides do not touch"):
        sc.Contact(die, die)
    with pytest.raises(sc.errors.InputError, match="can only be the primary, swap the two"):
        sc.Contact(die, block().surface("top"))
    with pytest.raises(sc.errors.InputError, match="give at least one Body, that has a mesh"):
        sc.bodies.stack([die])


def test_a_rigid_body_has_to_be_one_of_the_solver():
    """In the contact and not among the bodies, or another one of the same shape."""
    body, die = block(), sc.RigidBody(PLANE, name="die")
    contact = sc.Contact(body.surface("top"), die)
    with pytest.raises(sc.errors.InputError, match=r"die.* is not one of the stacked bodies \(block\)"):
        sc.ContactSolver([body], [contact])
    with pytest.raises(sc.errors.InputError, match="a contact to the very rigid body"):
        sc.ContactSolver([body, sc.RigidBody(PLANE, name="die")], [contact])


def test_scalar_fields_touch_no_tools():
    """A temperature moves nothing."""
    mesh = fem.MeshQuad().with_defaults()
    basis = fem.Basis(mesh, fem.ElementQuad1())
    plate = sc.Body(
        basis, fem.BilinearForm(lambda u, v, w: u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1])
    )
    die = sc.RigidBody(PLANE)
    with pytest.raises(sc.errors.InputError, match="bodies with a scalar field do not"):
        sc.bodies.stack([plate, die])


def test_steps_name_loads_and_motions():
    """By name of DOF, as vectors, as factors of the own ones, or stacked; answers are the same."""
    solver = pressed(D=("x", "rotation"), moment=0.05)
    ways = [
        {"f": {"die": {"y": -0.005}}, "x": {"die": {"rotation": 0.001}}},
        {"f": {"die": (0, -0.005, 0)}, "x": {"die": (0, 0, 0.001)}},
        {"f": np.array([*np.zeros(162), 0, -0.005, 0]), "x": np.array([*np.zeros(162), 0, 0, 0.001])},
    ]
    found = [next(solver.history([way])) for way in ways]
    for result in found:
        assert_allclose(result.displacement("die"), found[0].displacement("die"), atol=1e-15)
        assert_allclose(result.force, [0, -0.005], atol=1e-15)
    assert_allclose(found[0].motion("die")[1], 0.001, rtol=1e-12)
    assert_allclose(found[0].u[-3:], found[0].displacement("die"), rtol=0)
    half = next(solver.history([0.5]))
    assert_allclose(half.force, [0, -0.005], atol=1e-15)
    assert_allclose(half.reaction("die")[2], -0.025 - -half.moment((0.5, 1.0)), atol=1e-12)
    assert_allclose(next(solver.history([{"f": {"die": 0.5}}])).force, [0, -0.005], atol=1e-15)
    other = solver.with_load("die", {"y": -0.02}).solve()
    assert_allclose(other.force, [0, -0.02], atol=1e-15)


def test_moments_of_what_holds_a_rigid_body():
    """About its own point that of its reaction, about others with the moment of the force there."""
    result = pressed(D=("x", "rotation"), moment=0.05).solve()
    force, moment = np.split(result.reaction("die"), [2])
    assert_allclose(result.reaction_moment("die", about=(0.5, 1.0)), moment[0], rtol=1e-13)
    there = moment[0] - 0.5 * force[1] + 3.0 * force[0]
    assert_allclose(result.reaction_moment("die", about=(1.0, 4.0)), there, rtol=1e-13)
    with pytest.raises(sc.errors.InputError, match="rigid body 'die' has no boundary 'top'"):
        result.reaction_moment("die", "top")


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_moments_of_what_holds_a_rigid_body_in_space(sliding):
    """Supports, load and contact balance about any point, with the die where it has moved to."""
    x = np.linspace(0, 10, 4)
    basis = fem.Basis(
        fem.MeshHex.init_tensor(x, x, x).with_defaults(),
        fem.ElementVector(fem.ElementHex1()),
        intorder=2,
    )
    low = sc.Body(basis, sc.Elastic(210e3, 0.3), D="bottom", name="low")
    about, force = np.array([4.0, 12, 5]), np.array([0, -1000.0, 0])
    turns = ("rotation x", "rotation y", "rotation z")
    die = sc.RigidBody(
        sc.RigidPlane((5, 10, 5), (0, -1, 0), name="die"),
        about=about,
        force=force,
        D=("x", "z", *turns),
        x={"x": 0.02, "z": 0.01},
    )
    foot = sc.Contact(low.surface("top"), die, friction=sc.Coulomb(0.3), sliding=sliding)
    result = sc.ContactSolver([low, die], foot).solve()
    moved = result.displacement("die")[:3] * (sliding == "finite")
    for point in (np.zeros(3), np.array([1.0, 2, 3])):
        total = result.reaction_moment("die", about=point) - result.moment(point)
        assert_allclose(total, -np.cross(about + moved - point, force), rtol=0, atol=1e-9)
    assert_allclose(
        result.reaction_moment("die", about=about + moved), result.reaction("die")[3:], atol=1e-9
    )


def test_loads_that_a_step_does_not_name_stay():
    """A moment that comes after the force, by its name, leaves the force as it is."""
    solver = pressed(D=("x", "rotation"), moment=0.05)
    steps = [1.0, {"f": {"die": {"y": -0.02}}}, {"f": {"die": {"rotation": 0.01}}}, {"f": {"die": {}}}]
    found = list(solver.history(steps))
    # the moment goes to the support
    for result, (force, moment) in zip(
        found, [(-0.01, 0.05), (-0.02, 0.05)] + 2 * [(-0.02, 0.01)], strict=True
    ):
        assert_allclose(result.force, [0, force], atol=1e-15)
        assert_allclose(result.reaction("die")[2], result.moment((0.5, 1.0)) - moment, atol=1e-12)
    named, vector = (
        solver.solve(start=found[0], f={"die": f}) for f in ({"y": -0.02}, (0, -0.02, 0.05))
    )
    assert_allclose(named.u, vector.u, rtol=0)


def test_steps_that_are_refused():
    """Motions are prescribed by D and x; what is free takes no values; names are known."""
    solver = pressed()
    for step, words in (
        ({"motion": {"die": (0, -0.1)}}, "'die' is a rigid body, which moves by its loads"),
        ({"x": {"die": {"y": -0.1}}}, "prescribes values 'y' that D does not have"),
        ({"x": {"die": {"z": -0.1}}}, "'z' is none"),
        ({"f": {"die": {"top": (0, 1)}}}, "'top' is none; Known DOFs"),
        ({"f": {"die": (0, -1)}}, r"is rigid, is \(0, -1\) \(tuple\): write {'y': -1.0}, of 'x', 'y'"),
        ({"x": {"die": (0, -0.1)}}, r"write {'y': -0.1}, of 'x', 'y', 'rotation', or 3 numbers"),
    ):
        with pytest.raises(sc.errors.InputError, match=words):
            next(solver.history([step]))
    free = pressed(D=None)
    with pytest.raises(sc.errors.InputError, match="has no prescribed DOFs"):
        next(free.history([{"x": {"die": (0, 1, 0)}}]))


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()])
def test_springs_may_be_changed(linear):
    """`with_stiffness` takes springs as RigidBody does."""
    solver = pressed(linear=linear)
    stiff = solver.with_stiffness("die", (0, 1.0, 0)).solve()
    v = stiff.motion("die")[0][1]
    assert_allclose(stiff.force, [0, -0.01 - v], atol=1e-15)
    with pytest.raises(sc.errors.InputError, match="give 3 numbers"):
        solver.with_stiffness("die", (1.0, 2.0))


def test_reports_and_pictures_know_rigid_bodies(tmp_path):
    """The dry run, the report, files and pictures of a solver with a rigid body."""
    solver = pressed()
    assert "body die: 3 DOFs, 1 prescribed, rigid" in str(solver)
    assert "free without contact and friction: die: translation along y" in str(solver)
    result = solver.solve()
    assert "block/top on die" in result.report() and result.certificate.worst < 1e-14
    with pytest.raises(sc.errors.InputError, match=r"is no rigid body; result\.displacement"):
        result.motion("block")
    with pytest.raises(sc.errors.InputError, match="rigid body 'die' has no boundary 'top'"):
        result.reaction("die", "top")
    bodies, _ = sc.write(tmp_path / "die.vtu", result)
    assert bodies.exists()
    pyplot = pytest.importorskip("matplotlib.pyplot")
    sc.plot_deformed(result)
    pyplot.close("all")
    twin = pickle.loads(pickle.dumps(result))
    assert np.array_equal(twin.displacement("die"), result.displacement("die"))
    again = copy.deepcopy(solver).solve()
    assert_allclose(again.u, result.u, atol=1e-15)


def test_the_escape_hatch_has_rows_of_rigid_bodies():
    """A die glued to a block, by elimination in a script of one's own; rotations are lengths there."""
    body = block()
    die = sc.RigidBody(PLANE, force=(0.0, 0.03), moment=0.002, about=(0.5, 1.0), name="die")
    tie = sc.Contact(body.surface("top"), die, tied=True)
    system = sc.bodies.stack([body, die])
    rows = sc.elimination.contact_rows(system, tie)
    u = fem.solve(*sc.elimination.condense(system.K, system.f, rows=rows, D=system.D, x=system.x))
    known = sc.ContactSolver([body, die], [tie]).solve()
    assert_allclose(u / system.units, known.u, atol=1e-13)
    assert system.scale("die").tolist() == [1, 1, system.extent] and system.scale("block") == 1.0
