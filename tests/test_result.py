"""Results: the identities between their numbers, and how they are reached."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc


def block(name, y, **data):
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 6), np.linspace(*y, 4)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    if "move" in data:
        data["x"] = np.zeros(basis.N)
        data["x"][basis.nodal_dofs] = np.reshape(data.pop("move"), (2, 1))
    return sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), name=name, **data)


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


def test_a_result_is_one_line_where_nobody_prints_it(result):
    """In a notebook, and in the list of results that an exception carries: no pages of arrays."""
    line = repr(result)
    assert line.startswith("<ContactResult: converged in ") and "\n" not in line and len(line) < 200
    for values in result.values:
        counts = [int(np.sum(values.status == k)) for k in range(3)]
        words = f"<{values.name}: {counts[0]} open, {counts[1]} stick, {counts[2]} slip>"
        assert repr(values) == words and words in line
