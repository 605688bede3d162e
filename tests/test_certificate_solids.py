"""The certificate has eyes in 3-D: vectors of friction, and moments about all axes."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
import skfem as fem
from placed import Placement, everywhere
from scipy.spatial.transform import Rotation
from solid_meshes import at, cube, elastic

import skfem_contact as sc
from skfem_contact.answers import Certificate, answer_of

# As in `test_certificate`: round-off of bodies of some hundred DOFs, and what a tenth of a force is.
SOLVED = 1e-11
SEEN = 1e-3


PLAIN = Placement("plain")


def block(name, n, corner, held=(), push=None, placed=PLAIN, E=1.0):
    """A unit cube with its lowest corner at a place; `held` and `push` are told in the plain view."""
    mesh = cube("quad4", n, lambda x: placed.points(x.T + np.array(corner, dtype=float)).T)
    held = tuple((there(where, placed), axes) for where, axes in held)
    if push is not None:
        push = there(push[0], placed), tuple(placed.unit * placed.vectors(push[1]))
    return elastic(mesh, "quad4", name, E=E, held=held, push=push)


def there(where, placed):
    """A function of position in the plain view, of positions in their place; to round-off of a move."""

    def found(x):
        back = placed.back(np.reshape(x, (3, -1)).T).T
        return where(np.round(back, 9)).reshape(x.shape[1:])

    return found


def solved(placed=PLAIN, E=1.0):
    """A block on a smooth floor, glued to one that is clamped; another pressed on it, hanging over."""
    top = at(2, 2.0)
    low = block("low", 3, (0, 0, 0), placed=placed, E=E)
    side = block("side", 2, (-1, 0.2, 0.1), held=((at(0, -1.0), (0, 1, 2)),), placed=placed, E=E)
    up = block(
        "up", 2, (0.3, 0.2, 1), ((top, (0, 1, 2)),), (top, (0.0, 0.01, -0.03)), placed=placed, E=E
    )
    floor = sc.RigidPlane(placed.points([(0, 0, 0)])[0], placed.vectors((0, 0, 1)))

    def face(body, axis, value):
        return body.surface(there(at(axis, value), placed))

    contacts = [
        sc.Contact(face(low, 2, 0.0), floor, name="base"),
        sc.Contact(face(low, 2, 1.0), face(up, 2, 1.0), method="node", name="joint"),
        sc.Contact(face(side, 0, 0.0), face(low, 0, 0.0), tied=True, method="node", name="glue"),
    ]
    return sc.ContactSolver([low, side, up], contacts).solve()


@pytest.fixture(scope="module")
def result():
    return solved()


def spoiled(result, u=None, gap0=None, contacts=None, plastic=None, **state):
    """The certificate of the result with parts of it replaced."""
    answer = answer_of(result)
    parts = {"state": replace(answer.state, **state)}
    if plastic is not None:
        parts["plastic_slip"] = plastic
    if gap0 is not None:
        parts["seen"] = replace(answer.seen, gap0=gap0)
    if contacts is not None:
        parts["contacts"] = contacts
    wrong = replace(answer, **parts)
    vars(wrong)["u"] = result.u if u is None else u
    return sc.answers.ContactResult(wrong).certificate


def part(result, name):
    return answer_of(result).slices()[result.names.index(name)]


def largest(result, name):
    """The point of a contact that carries most."""
    where = part(result, name)
    return where.start + int(np.argmax(answer_of(result).state.normal_force[where]))


def forces_by_a_tenth(result):
    return spoiled(result, normal_force=1.1 * answer_of(result).state.normal_force)


def a_point_that_pulls(result):
    wrong, i = answer_of(result).state.normal_force.copy(), largest(result, "joint")
    wrong[i] = -wrong[i]
    return spoiled(result, normal_force=wrong)


def a_closed_point_opened(result):
    """The node of the floor's most loaded point is lifted."""
    i, contact = largest(result, "base"), result.contacts[0]
    u = result.u.copy()
    start = result.system.slice(contact.secondary.body).start
    u[start + contact.secondary.dofs[i - part(result, "base").start, 2]] += 0.01
    return spoiled(result, u=u)


def a_gap_closed_too_far(result):
    gap0 = answer_of(result).seen.gap0.copy()
    gap0[largest(result, "joint")] -= 0.01
    return spoiled(result, gap0=gap0)


def glue_apart(result):
    gap0 = answer_of(result).seen.gap0.copy()
    gap0[part(result, "glue")] += 0.01
    return spoiled(result, gap0=gap0)


def forces_moved_along(axis):
    """The floor pushes at other points, mirrored across a plane: the resultant stays."""

    def spoil(result):
        where = part(result, "base")
        points = result["base"].points
        mirrored = points.copy()
        mirrored[:, axis] = 1.0 - mirrored[:, axis]
        other = np.linalg.norm(points[:, None] - mirrored, axis=2).argmin(axis=1)
        wrong = answer_of(result).state.normal_force.copy()
        wrong[where] = wrong[where][other]
        return spoiled(result, normal_force=wrong)

    spoil.__name__ = f"forces_moved_along_{'xy'[axis]}"
    return spoil


def glue_turned(result):
    """The tangential forces of the glue turned by 90 degrees."""
    force = answer_of(result).state.tangential_force.copy()
    where = part(result, "glue")
    force[where] = np.cross(answer_of(result).kin.normal[where], force[where])
    return spoiled(result, tangential_force=force)


CASES = [
    (forces_by_a_tenth, {"equilibrium", "force_balance", "moment_balance"}),
    (a_point_that_pulls, {"equilibrium", "tension"}),
    (a_closed_point_opened, {"equilibrium", "complementarity"}),
    (a_gap_closed_too_far, {"penetration"}),
    (glue_apart, {"penetration"}),
    (forces_moved_along(0), {"equilibrium", "moment_balance"}),
    (forces_moved_along(1), {"equilibrium", "moment_balance"}),
    (glue_turned, {"equilibrium"}),
]


@pytest.mark.parametrize(("spoil", "numbers"), CASES, ids=lambda v: getattr(v, "__name__", ""))
def test_what_is_wrong_shows(result, spoil, numbers):
    """The numbers made for a defect see it."""
    certificate = spoil(result)
    assert {name for name in numbers if getattr(certificate, name) > SEEN} == numbers
    assert certificate.worst > SEEN


@everywhere
@pytest.mark.parametrize("E", [1.0, 210e9, 1e-9])
def test_forces_balance_wherever_a_scene_lies(result, placed, E):
    """Moved, turned, stiff and soft, in any unit: round-off is left, and forces and moments are K's.

    The forces on a body, its supports' among them, add up to none, and so do their moments about any
    point, of each body by itself.
    """
    found = solved(placed, E)
    # coordinates of a thousand sizes leave 13 digits of them, 11 of a gap of .03
    lost = 1e-9 if placed.move else SOLVED
    values = {f.name: getattr(found.certificate, f.name) for f in fields(Certificate)}
    assert max(values.values()) < lost
    assert np.array_equal(answer_of(found).state.status, answer_of(result).state.status)
    force = E * placed.unit**2
    for name in ("base", "joint", "glue"):
        # the same forces, turned
        expected = force * placed.vectors(result[name].force)
        size = force * np.abs(result["base"].force).max()
        assert np.abs(found[name].force - expected).max() < 10 * lost * size
    centre = placed.points([(0.4, 0.6, 0.9)])[0]
    for name in ("base", "glue"):
        plain = result[name].moment((0.4, 0.6, 0.9))
        expected = force * placed.unit * placed.vectors(plain)
        assert np.abs(found[name].moment(centre) - expected).max() < 10 * lost * size * placed.unit
    # low: pressed by the floor, the joint and the glue, whose secondary is the other side
    rest = found["base"].force + found["joint"].force - found["glue"].force
    assert np.abs(rest).max() < lost * size
    turns = [found[name].moment(centre) for name in ("base", "joint", "glue")]
    assert np.abs(turns[0] + turns[1] - turns[2]).max() < 10 * lost * size * placed.unit


def test_the_answer_as_solved(result):
    """All numbers are round-off; glue on meshes that do not match has its points on the other side."""
    values = {f.name: getattr(result.certificate, f.name) for f in fields(Certificate)}
    assert set(answer_of(result).state.status) == {0, 1}
    assert np.all(np.abs(result["base"].force) > [-1, -1, SEEN])
    assert max(values.values()) < SOLVED and not np.isnan(values["moment_balance"])


def lawful(result, turn=0.0, size=1.0, backwards=False):
    """The floor given friction: its forces at the bound along a slip, both in directions of their own.

    `turn`: the friction is turned by that angle out of the slip; `size`: over its bound.
    """
    answer, where = answer_of(result), part(result, "base")
    angle = np.linspace(0.0, 5.0, where.stop - where.start)
    way = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    closed = answer.state.status[where] != 0
    pushed = Rotation.from_rotvec([0, 0, turn]).apply(way)
    force, tangent = answer.state.tangential_force.copy(), answer.kin.tangent[where]
    force[where] = size * 0.3 * answer.state.normal_force[where][:, None] * pushed
    plastic = answer.plastic_slip.copy()
    slip = np.einsum("mkd,md->mk", tangent, -way if backwards else way)
    plastic[where] = 0.01 * np.where(closed[:, None], slip, 0.0)
    rough = replace(result.contacts[0], friction=sc.Coulomb(0.3))
    contacts = (rough, *result.contacts[1:])
    return spoiled(result, contacts=contacts, plastic=plastic, tangential_force=force).friction


def test_friction_is_a_vector(result):
    """Along the slip and of the size of its bound it is lawful; half, turned or against it is not."""
    assert lawful(result) < SOLVED
    assert lawful(result, size=0.5) > 0.1
    assert lawful(result, turn=np.pi / 2) > 0.1
    assert lawful(result, turn=0.05) > 0.005  # of the largest force, of which friction is 0.3
    assert lawful(result, backwards=True) > 0.1
    assert lawful(result, size=1.1) > 0.02


def test_moment_of_friction_across_gaps(result):
    """Tangential forces T across a gap g have the moment T g, over the sum of forces and the extent."""
    answer = answer_of(result)
    where = part(result, "joint")
    force = answer.state.tangential_force.copy()
    force[where] = [0.001, 0.0, 0.0]
    offset = answer.kin.offset.copy()
    offset[where] = [0.0, 0.0, 0.2]
    wrong = replace(
        answer,
        kin=replace(answer.kin, offset=offset),
        state=replace(answer.state, tangential_force=force),
    )
    vars(wrong)["u"] = result.u
    certificate = sc.answers.ContactResult(wrong).certificate
    # (0, 0, 0.2) x (-0.001, 0, 0) = (0, -0.0002, 0) for each point
    about_y = 2e-4 * (where.stop - where.start)
    glue = np.cross(
        answer.kin.offset[part(result, "glue")], -answer.state.tangential_force[part(result, "glue")]
    ).sum(axis=0)
    assert np.abs(glue).max() < 1e-12 * about_y  # the glued sides are one plane
    K_u = np.concatenate(
        [K @ result.displacement(n) for K, n in zip(answer.stiffness, result.system.names, strict=True)]
    )
    B_t = answer.kin.B_t.T @ wrong.local.tangential_force.ravel()
    contact = answer.kin.B_n.T @ answer.state.normal_force - B_t
    D = result.system.D
    total = max(np.abs(contact).sum(), np.abs((K_u - contact)[D]).sum())
    expected = about_y / (total * result.system.extent)
    assert certificate.moment_gap == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("tied", [True, False])
def test_a_scalar_field_has_no_friction(tied):
    """Heat through two unit cubes, from one face at 1 to one at 0: a flow of 1/2 if they are glued."""
    conduct = fem.BilinearForm(lambda u, v, w: (u.grad * v.grad).sum(axis=0))

    def wall(name, n, below, held, x=0.0):
        mesh = cube("quad4", n, lambda x: x + np.array([0.0, 0.0, below])[:, None])
        basis = fem.Basis(mesh, fem.ElementHex1())
        return sc.Body(basis, conduct, D=basis.get_dofs(at(2, held)), x=x + basis.zeros(), name=name)

    low, up = wall("low", 2, 0.0, 0.0), wall("up", 3, 1.0, 2.0, x=1.0)
    joint = sc.Contact(up.surface(at(2, 1.0)), low.surface(at(2, 1.0)), tied=tied)
    result = sc.ContactSolver([low, up], joint).solve()
    assert result.certificate.worst < (SOLVED if tied else 1e-9)  # no flow is all round-off
    assert np.isnan(result.certificate.moment_balance)
    assert abs(result.normal_force.sum() + (0.5 if tied else 0.0)) < 1e-13
    assert "round-off where everything holds" in str(result)
