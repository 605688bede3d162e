"""Results: the identities between their numbers, and how they are reached."""

from __future__ import annotations

import warnings
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import rectangles
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters
from skfem.models.poisson import laplace

import skfem_contact as sc
from skfem_contact.answers import answer_of

# what a result has of its contact, where there is one
(OF_THE_CONTACT,) = (
    kind for kind in sc.answers.ContactResult.__mro__ if kind.__name__ == "OfTheContact"
)


def block(name, y, **data):
    return rectangles.block(name, y=y, n=(5, 3), **data)


def stack(mu=0.3):
    """A block between a floor and another block that presses and drags it."""
    low = block("low", (0, 1))
    up = block("up", (1, 2), D="top", move=(0.02, -0.02))
    law = None if mu is None else sc.Coulomb(mu)
    contacts = [
        sc.Contact(
            low.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.5), name="base"
        ),
        sc.Contact(up.surface("bottom"), low.surface("top"), friction=law, name="joint"),
    ]
    return sc.ContactSolver([low, up], contacts)


@pytest.fixture(scope="module")
def result():
    return stack().solve()


def test_tractions_are_made_of_pressure_and_friction(result):
    """traction = pressure normal + tangential_force tangent / area, and forces are its integral."""
    for v in result.values:
        along = v.tangential_force[:, 0, None] * v.tangent[:, 0] / v.area[:, None]
        assert_allclose(v.traction, v.pressure[:, None] * v.normal + along, rtol=1e-13, atol=1e-18)
        assert_allclose(v.forces, v.traction * v.area[:, None], rtol=1e-13, atol=1e-18)
        assert_allclose(v.force, v.forces.sum(axis=0))
        cross = v.points[:, 0] * v.forces[:, 1] - v.points[:, 1] * v.forces[:, 0]
        assert_allclose(v.moment(), cross.sum())
        shift = v.moment((0.3, -0.2)) - v.moment()
        assert_allclose(shift, 0.2 * -v.force[0] * -1 * -1 - 0.3 * v.force[1], rtol=0, atol=1e-15)
        assert_allclose(v.contact_area, v.area[v.status != 0].sum())


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("deformable", [False, True])
def test_moments_are_about_where_the_bodies_are(sliding, deformable):
    """A block dragged over a floor: forces act at moved points; with small sliding at old ones."""
    up = block("up", (0, 1), D="top", move=(0.05, -0.02))
    law = {"friction": sc.Coulomb(0.3), "method": "node", "sliding": sliding}
    low = sc.RigidPlane((0, 0), (0, 1))
    if deformable:
        mesh = fem.MeshQuad.init_tensor(np.linspace(-1, 2, 14), np.linspace(-1, 0, 4)).with_defaults()
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
        low = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), D="bottom", name="low")
    primary = low.surface("top") if deformable else low
    contact = sc.Contact(up.surface("bottom"), primary, **law)
    bodies = [up, low] if deformable else [up]
    v = sc.ContactSolver(bodies, contact, options=sc.Options(max_travel=np.inf)).solve()
    dofs = contact.secondary.dofs
    x = v.points + v.displacement("up")[dofs] * (sliding == "finite")
    assert_allclose(v.moment(), np.sum(x[:, 0] * v.forces[:, 1] - x[:, 1] * v.forces[:, 0]), rtol=1e-12)


def test_warnings_point_at_the_line_that_asked():
    """Whichever way through the library they came: a solution, a history, a property, a setting."""
    body = block("body", (0, 1), D="top", move=(0.0, -0.3))
    solver = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1))))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        solver.solve()
        history = list(solver.history([1.0]))
        object.__setattr__(history[0]._answer.diagnostics, "issued", frozenset())
        assert not history[0].validity.holds
        sc.ContactSolver(body, replace(solver.contacts[0], interference=10.0)).solve()
    assert len(told) >= 4  # the last says it of the load as well
    assert {warning.filename for warning in told} == {__file__}


def test_forces_balance_the_reactions(result):
    """The floor carries what the support of the upper block gives, and the joint passes it on."""
    up = result.system.bodies[1]
    r = up.K @ result.displacement("up")
    reaction = np.array([r[up.D[up.dof_component[up.D] == k]].sum() for k in range(2)])
    assert_allclose(result["joint"].force, -reaction, rtol=0, atol=1e-14)
    assert_allclose(result["base"].force, result["joint"].force, rtol=0, atol=1e-14)


def test_laws_hold_point_by_point(result):
    """Pressure and gap exclude each other; friction opposes slip and is on the bound where it slips."""
    for v, mu in zip(result.values, (0.5, 0.3), strict=True):
        assert (v.pressure >= 0).all() and (v.gap >= -1e-14).all()
        assert_allclose(v.normal_force * np.where(np.isinf(v.gap), 0, v.gap), 0.0, atol=1e-16)
        friction, slip = v.tangential_force[:, 0], v.slip[:, 0]
        slides = v.status == 2
        assert_allclose(np.abs(friction[slides]), mu * v.normal_force[slides], rtol=1e-10)
        assert (friction[slides] * slip[slides] <= 0).all()
        assert_allclose(slip[v.status == 1], 0.0, atol=1e-14)


def test_contacts_are_reached_by_name_number_and_object(result):
    """By name, by position, and by the object itself: the same values."""
    for i, contact in enumerate(result.contacts):
        assert result[contact] is result[i] is result[contact.name] is result.values[i]
    assert result[-1] is result.values[1]


def test_displacements_are_shared_out(result):
    """Every body has its part of u."""
    parts = [result.displacement(name) for name in ("low", "up")]
    assert_array_equal(np.concatenate(parts), result.u)
    up = result.system.bodies[1]
    assert_array_equal(parts[1][up.D], up.x[up.D])


def test_dissipation_adds_up():
    """The total of a history is the sum of its steps, and of its contacts."""
    results = list(stack().history([0.5, 1.0, 0.6]))
    steps = np.cumsum([r.dissipation for r in results])
    assert_allclose([r.dissipation_total for r in results], steps, rtol=1e-13)
    last = results[-1]
    assert_allclose(sum(v.dissipation_total for v in last.values), last.dissipation_total, rtol=1e-13)
    assert_allclose(sum(v.dissipation for v in last.values), last.dissipation, rtol=1e-13)
    assert all(r.dissipation >= 0 for r in results)


def test_frictionless_contacts_report_their_slip():
    """Without friction nothing tangential is modelled, but what slides by is still known."""
    v = stack(mu=None).solve()["joint"]
    assert set(v.status) <= {0, 2} and not v.tangential_force.any()
    assert np.abs(v.slip[v.status == 2]).max() > 1e-3


def test_the_report_names_what_there_is(result):
    """print(result): how it ended, every contact with its numbers, and the certificate."""
    text = str(result)
    for words in ("Contact result: converged", "base: low/bottom on", "joint: up/bottom on low/top"):
        assert words in text
    for words in (
        "force on the secondary",
        "largest pressure",
        "energy lost by friction",
        "equilibrium",
    ):
        assert words in text


def test_the_largest_pressure_is_where_there_is_contact():
    """Of a head over the rims of its seat: not at the nodes beyond, which show that of the rims."""
    seat = rectangles.block("seat", y=(-1, 0), n=(6, 3), D="bottom")
    head = rectangles.block("head", x=(-0.13, 1.12), y=(0, 1), n=(6, 3), D="top", move=(0, -0.01))
    result = sc.ContactSolver(
        [seat, head], sc.Contact(head.surface("bottom"), seat.surface("top"), method="mortar")
    ).solve()
    beyond = np.abs(result.points[:, 0] - 0.5) > 0.5
    assert beyond.any() and result.pressure[beyond].max() == result.pressure.max()
    (line,) = [text for text in str(result).splitlines() if "largest pressure" in text]
    place = float(line.partition("(")[2].partition(",")[0])
    assert 0 <= place <= 1


def test_printing_costs_the_certificate_and_the_verdict():
    """No estimate, nor search for other answers: the report has these, and it is said."""
    result = stack().solve()
    shown, text = repr(result), str(result)
    assert len(shown.splitlines()) == 3
    assert "uniqueness" not in vars(result) and "Validity of the model: holds" in text
    assert not any("error_estimate" in vars(v) for v in result)
    assert "estimated error   " not in text and "print(result.report()) adds" in text
    report = result.report()
    assert "estimated error" in report and "Validity of the model: holds" in report
    for line in text.split("\n\n")[1].splitlines():  # what is printed is in the report
        assert line in report
    for name in ("base", "joint"):
        part = str(result[name])
        assert part in text and part.startswith(f"{name}: ") and len(repr(result[name])) < 100


def test_a_short_repr_recovers_nothing():
    """The displacements of the interior stay where they are until somebody asks."""
    result = stack().solve()
    repr(result)
    assert "u" not in vars(answer_of(result))


def test_notebooks_show_a_table(result):
    """One row per contact, with its name, and well-formed."""
    root = ElementTree.fromstring(f"<div>{result._repr_html_()}</div>")
    rows = [[cell.text for cell in row] for row in root.find("table/tbody")]
    assert [row[0] for row in rows] == [
        "base: low/bottom on rigid plane",
        "joint: up/bottom on low/top",
    ]
    assert "converged" in "".join(root.find("p").itertext())


def test_several_contacts_are_not_joined(result):
    """What belongs to a contact is an AttributeError that names the contacts, for hasattr as well."""
    for name in vars(OF_THE_CONTACT):
        if isinstance(vars(OF_THE_CONTACT)[name], property):
            assert not hasattr(result, name)
            with pytest.raises(AttributeError, match=rf"2 of them \(base, joint\).*\['base'\].{name}"):
                getattr(result, name)
    assert not hasattr(result, "wear_depth") and not hasattr(result, "presure")


def test_one_contact_is_the_result_itself():
    """Every property of the only contact is the result's: the same arrays, in dir and annotated."""
    body = block("block", (0, 1), D="top", move=(0.0, -0.01))
    floor = sc.RigidPlane((0, 0), (0, 1))
    result = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor)).solve()
    (values,) = result
    for name, own in vars(OF_THE_CONTACT).items():
        if isinstance(own, property):
            assert name in dir(result) and own.__doc__ and own.fget.__annotations__["return"]
            found, expected = getattr(result, name), getattr(values, name)
            if isinstance(expected, np.ndarray):
                assert_array_equal(found, expected)
            else:
                assert found == expected or found is expected


def test_results_are_gone_through_by_contact(result):
    """Iteration, number and membership: contacts, by name, object or values."""
    assert [v.name for v in result] == ["base", "joint"] and len(result) == 2 and result
    assert "joint" in result and result.contacts[0] in result and result["joint"] in result
    assert "joints" not in result and 7 not in result
    with pytest.raises(sc.errors.InputError, match="did you mean 'joint'"):
        result["joints"]


def test_reactions_are_the_forces_of_the_supports():
    """Against the balance of every body: loads, contacts and supports add up to nothing."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 6), np.linspace(0, 1, 4)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    form = linear_elasticity(*lame_parameters(1.0, 0.3))
    pull = fem.LinearForm(lambda v, w: 0.01 * v[0] - 0.02 * v[1]).assemble(basis.boundary("left"))
    low = sc.Body(basis, form, f=pull, D=["bottom", "right"], name="low")
    up = block("up", (1, 2), D="top", move=(0.02, -0.02))
    joint = sc.Contact(up.surface("bottom"), low.surface("top"), friction=sc.Coulomb(0.3), name="joint")
    result = sc.ContactSolver([low, up], joint).solve()
    held = result.reaction("low")
    assert_allclose(held, result.force - [0.01, -0.02], rtol=0, atol=1e-14)
    assert_allclose(result.reaction(up, "top"), -result.force, rtol=0, atol=1e-14)
    # the node at the corner counts for both boundaries
    corner = mesh.p[0] + (1 - mesh.p[1]) == 2
    residual = low.K @ result.displacement("low") - pull
    twice = residual[basis.nodal_dofs[:, corner].ravel()]
    parts = result.reaction("low", "bottom") + result.reaction("low", "right")
    assert_allclose(parts - held, twice, rtol=0, atol=1e-15)
    with pytest.raises(sc.errors.InputError, match=r"reaction of body 'low': .* did you mean 'bottom'"):
        result.reaction("low", "botom")
    with pytest.raises(
        sc.errors.InputError, match="'up' has no prescribed DOFs on its boundary 'bottom'"
    ):
        result.reaction("up", "bottom")


def test_reactions_leave_contact_forces_out():
    """Where a node is prescribed and in contact, the support's part is what contact does not give."""
    free = block("block", (0, 1))
    guided = free.basis.get_dofs("bottom").nodal["u^1"]
    top = free.basis.get_dofs("top").flatten()
    body = block("block", (0, 1), D=np.concatenate([top, guided]), move=(0.1, -0.02))
    floor = sc.RigidPlane((0, 0), (0, 1))
    contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3))
    result = sc.ContactSolver(body, contact).solve()
    # supports drag the bottom over the plane by as much as the top: nothing is sheared, and what
    # the guide holds is the friction of all points
    assert_allclose(result.force[0], -0.3 * result.force[1], rtol=1e-12)
    total = result.reaction("block") + result.force
    assert_allclose(total, 0.0, rtol=0, atol=1e-14)
    below = result.reaction("block", "bottom")
    assert_allclose(below, [-result.force[0] - result.reaction("block", "top")[0], 0.0], atol=1e-14)


def bar(mesh, element, kind=sc.Body, law=None, **data):
    """A bar along x, and a plane far below that it never meets: nothing but loads and supports."""
    basis = fem.Basis(mesh.with_defaults(), fem.ElementVector(element), intorder=2 * element.maxdeg)
    body = kind(basis, law or sc.Elastic(1e3, 0.3), name="bar", **data)
    below = np.eye(mesh.dim())[1]
    return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), sc.RigidPlane(-9 * below, below)))


PLATE = fem.MeshQuad.init_tensor(np.linspace(0, 4, 9), np.linspace(0, 1, 4))
BAR = fem.MeshHex.init_tensor(np.linspace(0, 4, 7), np.linspace(0, 1, 3), np.linspace(0, 2, 3))


@pytest.mark.parametrize(
    ("mesh", "element", "total", "centre", "about"),
    [
        (PLATE, fem.ElementQuad1(), (0.02, -0.01), (4, 0.5), (3.0, -1.0)),
        (PLATE.translated((1, 2)), fem.ElementQuad2(), (0.02, -0.01), (5, 2.5), (3.0, -1.0)),
        (BAR, fem.ElementHex1(), (0.02, -0.01, 0.005), (4, 0.5, 1), (3.0, -1.0, 2.0)),
        (BAR, fem.ElementHex2(), (0.02, -0.01, 0.005), (4, 0.5, 1), (3.0, -1.0, 2.0)),
    ],
)
def test_the_moment_of_a_wall_is_that_of_the_load_on_a_cantilever(mesh, element, total, centre, about):
    """A load at the centre of the free end, whatever the body: statics alone tells the moment."""
    area = 1.0 if mesh.dim() == 2 else 2.0
    load = {"right": tuple(np.array(total) / area)}
    result = bar(mesh, element, D="left", f=load).solve()
    for point in (None, about):
        arm = np.array(centre, dtype=float) - (0.0 if point is None else point)
        if mesh.dim() == 2:
            expected = -(arm[0] * total[1] - arm[1] * total[0])
        else:
            expected = -np.cross(arm, total)
        for boundary in (None, "left"):
            found = result.reaction_moment("bar", boundary, about=point)
            assert np.shape(found) == np.shape(expected)
            assert_allclose(found, expected, rtol=0, atol=1e-11)
    with pytest.raises(
        sc.errors.InputError, match=r"about has shape .*; give a point of \d coordinates"
    ):
        result.reaction_moment("bar", "left", about=(1.0,))
    with pytest.raises(sc.errors.InputError, match=r"reaction of body 'bar': .* did you mean 'left'"):
        result.reaction_moment("bar", "lift")
    with pytest.raises(sc.errors.UnknownKeyword, match="has no argument 'at'"):
        result.reaction_moment("bar", "left", at=(0, 0))


def test_moments_of_supports_of_one_component():
    """A bar on a sliding edge and a pin, pushed down at its end: forces are 4 and -3 times the load."""
    pin = {"left": "x"}
    held = lambda basis: [pin, basis.nodal_dofs[1, PLATE.nodes_satisfying(lambda x: x[0] < 1.1)]]  # noqa: E731
    result = bar(PLATE, fem.ElementQuad1(), D=held, f={"right": (0, -0.01)}).solve()
    assert_allclose(result.reaction("bar"), [0.0, 0.01], atol=1e-13)
    assert_allclose(result.reaction_moment("bar"), 0.04, rtol=1e-10)


def test_flows_have_no_moment():
    """A scalar field has reactions, which are flows, and no moments."""
    low, up = (
        sc.Body(
            fem.Basis(fem.MeshQuad().translated((0, y)).with_defaults(), fem.ElementQuad1()),
            laplace,
            D=D,
            x=fem.Basis(fem.MeshQuad(), fem.ElementQuad1()).zeros() + y,
            name=D,
        )
        for y, D in ((0, "bottom"), (1, "top"))
    )
    joint = sc.Contact(up.surface("bottom"), low.surface("top"), tied=True)
    result = sc.ContactSolver([low, up], joint).solve()
    assert_allclose(result.reaction("top"), [0.5], rtol=1e-12)
    with pytest.raises(
        sc.errors.InputError, match="body 'top' has a scalar field: flows have no moment"
    ):
        result.reaction_moment("top")


def test_supports_of_large_strains_bear_their_moment_where_they_are():
    """A bar of rubber is bent by both ends: forces of the deformed bar have no moment in all."""
    rubber, move = sc.materials.NeoHooke(1.0, 10.0), {"left": (0, 0), "right": (-0.5, 1.5)}
    solver = bar(PLATE, fem.ElementQuad1(), sc.NonlinearBody, rubber, D=["left", "right"], x=move)
    *_, result = solver.history(np.linspace(0.25, 1, 4))
    parts = [result.reaction_moment("bar", name) for name in ("left", "right")]
    assert_allclose(sum(parts), 0.0, atol=1e-8 * abs(parts[0]))
    assert abs(parts[0]) > 0.01


@pytest.mark.parametrize(("sliding", "far"), [("small", 0.0), ("finite", 7.0)])
def test_supports_and_contact_have_no_moment_in_all(sliding, far):
    """A block that is pressed, and dragged along by many times its elastic displacement."""
    body = block("block", (0, 1), D="top", move=(far + 0.01, -1e-4))
    foot = sc.Contact(
        body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.3), sliding=sliding
    )
    result = sc.ContactSolver(body, foot).solve()
    # linear bodies are in balance where they were: what is left is of the order of their strain, 1e-4
    size = abs(result.moment()) + abs(result.force[1])
    error = result.reaction_moment("block", "top") + result.moment()
    assert abs(error) < (1e-11 if sliding == "small" else 1e-4) * size


def test_records_are_lines_of_the_log(result):
    """Every iteration is a line: sets, changes, residual of the law."""
    assert len(result.trace) == result.iterations
    assert str(result.trace[0]).split()[:3] == ["1", "open", str(result.trace[0].open)]
    assert result.trace[-1].changes == 0


def test_certificate_of_a_body_moved_as_a_whole():
    """A body carried along without strain has round-off for forces: no scale for its certificate."""
    body = block("block", (0, 1), D="top", move=(0.3, 0.2))
    contact = sc.Contact(
        body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.5)
    )
    moved = sc.ContactSolver(body, contact).solve()
    assert np.all(moved.status == 0)
    # round-off of K u, over the millionth part of its terms that stands in for a force
    assert moved.certificate.worst < 1e-8


def test_a_result_is_a_few_lines_where_nobody_prints_it(result):
    """In a console, and in the list of results that an exception carries: no pages of arrays."""
    lines = repr(result).splitlines()
    assert lines[0].startswith("<ContactResult: converged in ") and len(lines) == 3
    for values in result.values:
        counts = [int(np.sum(values.status == k)) for k in range(3)]
        words = f"{values.name}: Coulomb: {counts[0]} open, {counts[1]} stick, {counts[2]} slip"
        assert repr(values) == f"<{words}>"
        assert any(words in s for s in lines)


def test_an_answer_knows_what_its_last_solve_held(result):
    """Closed points have no gap, sticking ones are where they were, slipping ones follow their law."""
    held, local = answer_of(result).conditions, answer_of(result).local
    slips, sticks = local.status == 2, held.stick
    assert slips.any() and sticks.any()
    assert_array_equal(held.closed, local.status != 0)
    assert_allclose(local.slip[sticks], held.anchor[sticks], rtol=0, atol=1e-15)
    lawful = held.offset + held.coupling * local.normal_force[:, None]
    assert not held.spring.any()  # exact sticking, and a bound that does not grow with slip
    assert_allclose(local.tangential_force[slips], lawful[slips], rtol=0, atol=1e-12)
