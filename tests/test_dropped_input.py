"""Input that was dropped or read as something else: taken as meant, or refused in words."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import rectangles
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal

import skfem_contact as sc

block = partial(rectangles.block, nu=0.0)


def stacked(f=None, **settings):
    """A punch without prescribed DOFs on a block that is held, pressed by `f`."""
    base = block("base", y=(-1.0, 0.0), D="bottom")
    punch = block("punch", f=f)
    pair = sc.Contact(
        punch.surface("bottom"), base.surface("top"), friction=sc.Coulomb(0.5), name="joint"
    )
    return sc.ContactSolver([base, punch], pair, **settings)


def weight(solver, size=0.01):
    punch = solver.system.bodies[1]
    f = np.zeros(punch.n)
    top = punch.basis.get_dofs("top").all("u^2")
    f[top] = -size / len(top)
    return f


def test_prescribed_values_without_a_place():
    """x of a body that has no D went nowhere: the punch was not moved, and nothing was said."""
    solver = stacked()
    f, x = {"punch": weight(solver)}, np.full(solver.system.bodies[1].n, -0.01)
    for call in (
        lambda: solver.solve(f=f, x={"punch": x}),
        lambda: list(solver.history([{"f": f, "x": {"punch": x}}])),
        lambda: solver.solve(f=f, x={"punch": 0.5}),
        lambda: solver.solve(f=f, x=np.concatenate([np.zeros(solver.system.n - len(x)), x])),
    ):
        with pytest.raises(sc.errors.InputError, match=r"x of body 'punch' .* no prescribed DOFs"):
            call()
    assert solver.solve(f=f, x=np.zeros(solver.system.n)).converged


def test_factors_on_nothing():
    """A factor on a load or on values that are zero changes nothing, which is never what is meant."""
    solver = stacked()
    for given, what in (
        ({"f": {"punch": 2.0}}, "f of body 'punch'"),
        ({"x": {"base": -1}}, "x of body"),
    ):
        with pytest.raises(sc.errors.InputError, match=rf"{what}.* a factor on its own .* is zero"):
            list(solver.history([given]))
    with pytest.raises(
        sc.errors.InputError, match=r"a load step is 0\.5, a factor .* are zero.*interference"
    ):
        list(solver.history([0.5]))
    # zero is zero, whatever it is a factor on; and a body that has a load takes factors
    loaded = stacked(f=weight(solver))
    half = loaded.solve(f={"base": 0.0, "punch": 0.5})
    assert_allclose(half.force[1], 0.005, rtol=1e-12)


@pytest.mark.parametrize(
    "steps", [["1.0"], [True], [np.True_], [b"1"], [np.ones(1)], "12", {"f": 1.0}, [["0.5"]]]
)
def test_what_only_looks_like_a_load_step(steps):
    """Words, switches and lists that Python turns into numbers are no load steps."""
    solver = stacked()
    with pytest.raises(sc.errors.InputError, match=r"a load step is|steps is .* write \[step\]"):
        list(stacked(f=weight(solver)).history(steps))


@pytest.mark.parametrize(
    "motion", [("0", "1"), True, 0.1, ((0, 1), "1", (0, 0)), ((0, 1), True, (0, 0))]
)
def test_what_only_looks_like_a_motion(motion):
    """A number is no translation: it moved obstacles along the diagonal; nor are words and switches."""
    body = block("punch", D="top")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    solver = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor))
    with pytest.raises(
        sc.errors.InputError, match=r"motion of 'contact 1' is .* a translation of 2 numbers"
    ):
        list(solver.history([{"motion": {"floor": motion}}]))


def test_switches_are_no_numbers():
    """True is 1.0 for NumPy, but nobody means it: an interference, a coefficient, a factor."""
    body = block("punch", D="top")
    for call in (
        lambda: sc.Coulomb(True),
        lambda: sc.RigidPlane(np.array([True, True]), (0, 1)),
        lambda: stacked().solve(f={"punch": True}),
        lambda: sc.RigidCylinder((0, 0), np.array("1.0", dtype=object)),
        lambda: sc.ContactSolver(
            body, sc.Contact(body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), gap=True)
        ),
    ):
        with pytest.raises(sc.errors.InputError, match="not made of real numbers"):
            call()


def test_dofs_are_no_facets():
    """What get_dofs returns was read as facet numbers: DOFs of the left side select other facets."""
    linear, quadratic = block("punch"), block("punch", element=fem.ElementQuad2())
    with pytest.raises(sc.errors.InputError, match=r"surface 'punch/surface': where is what get_dofs"):
        linear.surface(linear.basis.get_dofs("left"))
    # as plain numbers they can not be told from facets, except that most of these lie inside
    with pytest.warns(sc.ContactWarning, match=r"facet numbers given are inside the mesh and left out"):
        linear.surface(linear.basis.get_dofs("left").all())
    # facets that have DOFs of their own are known from them
    left = quadratic.surface(quadratic.basis.get_dofs("left"))
    assert_array_equal(left.mesh_facets, quadratic.surface("left").mesh_facets)
    assert_allclose(left.points[:, 0], 0.0)
    for wrong in (quadratic.basis.get_dofs(nodes=np.arange(2)), block("other").basis.get_dofs("left")):
        with pytest.raises(sc.errors.InputError, match=r"is not known"):
            quadratic.surface([wrong])


def test_nodes_and_facets_are_no_dofs():
    """Numbers of nodes or facets in D held the body somewhere inside, and nothing was said."""
    punch = block("punch")
    mesh, basis = punch.basis.mesh, punch.basis
    top = mesh.boundaries["top"]
    for numbers, kind in ((np.unique(mesh.facets[:, top]), "nodes"), (top, "facets")):
        for given in (numbers, numbers.tolist(), {"top": numbers}):
            with pytest.warns(
                sc.ContactWarning,
                match=rf"D of body 'b': all {len(numbers)} numbers are those of {kind}",
            ):
                sc.Body(basis, punch.K, D=given, name="b")
    nodes = np.unique(mesh.facets[:, top])
    inside = mesh.p.shape[1] // 2
    for right in (
        "top",
        basis.get_dofs("top"),
        basis.get_dofs("top").flatten(),
        basis.nodal_dofs[:, nodes].ravel(),
        basis.nodal_dofs[:, inside],  # a node inside may be held
        np.append(basis.get_dofs("top").flatten(), basis.nodal_dofs[:, inside]),
        np.arange(basis.N),
    ):
        sc.Body(basis, punch.K, D=right, name="b")


def pressed_on(obstacle, **settings):
    body = block("punch", D="top")
    return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), obstacle, **settings))


def test_gradient_that_is_not_that_of_its_function():
    """A gradient 45 degrees off turned the pressure by as much; its length is free."""
    function = lambda x: x[1] + 0.1 * x[0] ** 2  # noqa: E731
    right = lambda x: np.stack([0.2 * x[0], np.ones_like(x[0])])  # noqa: E731
    turned = lambda x: np.stack([0.2 * x[0] - 1, 1 + 0.2 * x[0]])  # noqa: E731
    with pytest.raises(
        sc.errors.InputError,
        match=r"gradient of 'bump' is not that of its function: at \(.*\) it is \(-",
    ):
        pressed_on(sc.obstacles.LevelSet(function, turned, name="bump"))
    for wrong in (lambda x: -right(x), lambda x: right(x)[::-1]):
        with pytest.raises(sc.errors.InputError, match="another direction"):
            pressed_on(sc.obstacles.LevelSet(function, wrong))
    unit = lambda x: right(x) / np.linalg.norm(right(x), axis=0)  # noqa: E731
    for gradient in (right, unit, lambda x: 3 * right(x)):
        pressed_on(sc.obstacles.LevelSet(function, gradient))


def test_gradients_at_kinks_are_what_they_are():
    """Where a function has a kink there is no gradient to compare with: one side's will do."""
    roof = lambda x: x[1] + 0.1 * np.abs(x[0] - 0.5)  # noqa: E731
    side = lambda x: np.stack([np.where(x[0] >= 0.5, 0.1, -0.1), np.ones_like(x[0])])  # noqa: E731
    assert pressed_on(sc.obstacles.LevelSet(roof, side)).kin.m == 5


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_both_passes_over_one_interface(sliding):
    """Two contacts that share the same facets share out one force in no way that is known."""
    base, punch = block("base", y=(-1.0, 0.0), D="bottom"), block("punch", D="top")
    low, up = base.surface("top"), punch.surface("bottom")
    go = sc.Contact(up, low, sliding=sliding, name="there")
    back = sc.Contact(low, up, sliding=sliding, name="back")
    with pytest.raises(
        sc.errors.InputError, match=r"contacts 'there' .* and 'back' .* one from one side"
    ):
        sc.ContactSolver([base, punch], [go, back])
    again = sc.Contact(punch.surface("bottom"), base.surface("top"), sliding=sliding)
    with pytest.raises(
        sc.errors.InputError, match=r"contacts 'there' .* and 'contact 2' .* same facets\. The"
    ):
        sc.ContactSolver([base, punch], [go, again])
    # parts of a surface each way, and one surface against two others, are no such thing
    left, right = (punch.surface(lambda x, s=s: (x[1] == 0) & (s * (x[0] - 0.5) > 0)) for s in (-1, 1))
    sc.ContactSolver([base, punch], [sc.Contact(left, low, name="l"), sc.Contact(low, right, name="r")])


def test_one_obstacle_twice():
    """The same obstacle met twice by the same surface is one contact too many."""
    body, floor = block("punch", D="top"), sc.RigidPlane((0, 0), (0, 1), name="floor")
    twice = [sc.Contact(body.surface("bottom"), floor, name=name) for name in "ab"]
    with pytest.raises(sc.errors.InputError, match=r"contacts .a. .* and .b. .* same facets"):
        sc.ContactSolver(body, twice)
    other = sc.Contact(body.surface("bottom"), sc.RigidPlane((0, -1), (0, 1)), name="far")
    assert len(sc.ContactSolver(body, [twice[0], other]).contacts) == 2


@pytest.mark.parametrize("linear", ["foo", "", 3, None, sc.linalg.Direct])
def test_linear_is_checked_at_once(linear):
    """A route that does not exist is refused where it is given, not when the first step is solved."""
    with pytest.raises(sc.errors.InputError, match=r"linear ?="):
        stacked(linear=linear)


def test_reach_of_nothing():
    """Within no reach there is no partner; and obstacles are met within reach as surfaces are."""
    body = block("punch", D="top")
    with pytest.raises(sc.errors.InputError, match="reach = 0 has to be a length > 0"):
        sc.Contact(body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), reach=0)
    slope = sc.RigidPlane((0, 0), (-1, 10))  # gaps from 0 to -0.1
    near = pressed_on(slope, reach=0.06).kin
    x = near.points[:, 0]
    assert_array_equal(near.paired, x < 0.6)
    assert_array_equal(np.isinf(near.gap0), x > 0.6)
    assert pressed_on(slope).kin.paired.all()
