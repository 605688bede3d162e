"""One solver, and more different loads than it remembers the directions of."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from rectangles import rectangle

import skfem_contact as sc
from skfem_contact.linalg import MultifrontalCholesky

# The library keeps 12 directions of loads. These are more than it keeps, and none is in the span of
# the others.
LOADS = 15


def block():
    """A square of 6 by 6 elements that stands on a rough floor."""
    basis = rectangle(*[np.linspace(0, 1, 7)] * 2, order=2)
    return sc.Body(basis, linear_elasticity(1.0, 1.0), D="top", name="block")


def blocks_below():
    """A wider one under it, of other elements."""
    basis = rectangle(np.linspace(-1, 2, 10), np.linspace(-1, 0, 5), order=2)
    return sc.Body(basis, linear_elasticity(1.0, 1.0), D="bottom", name="low")


def solver_of(body, contact):
    return sc.ContactSolver(body, contact, linear="condensed")


def contact_of(body):
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    return sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")


def forces(body, k):
    """A load at all nodes that is unlike all the others, pressing down and here and there aside."""
    rng = np.random.default_rng(k)
    down = body.dof_component == 1
    f = np.where(down, -0.004, 0.0) + rng.uniform(-0.002, 0.002, body.n)
    return np.where(body.dof_points[:, 1] < 1.0, f, 0.0)


def moves(body, k):
    """Displacements of the upper side, unlike all the others in its seven nodes of two components."""
    x = np.zeros(body.n)
    rng = np.random.default_rng(k)
    x[body.D] = rng.uniform(-0.003, 0.003, len(body.D))
    x[body.D] -= np.where(body.dof_component[body.D] == 1, 0.02, 0.0)
    return x


@pytest.mark.parametrize("kind", ["f", "x"])
def test_more_directions_than_are_remembered(kind):
    """The 13th different load, those after it, and then the first again: as a fresh solver has them."""
    body = block()
    contact = contact_of(body)
    of = {"f": forces, "x": moves}[kind]
    order = [*range(LOADS if kind == "f" else len(body.D)), 0, 12, 3]
    loads = [of(body, k) for k in range(max(order) + 1)]
    assert np.linalg.matrix_rank(np.array(loads)) == len(loads) > 12
    solver = solver_of(body, contact)
    for count, k in enumerate(order):
        result = solver.solve(**{kind: loads[k]})
        if count < 11:
            continue
        known = solver_of(body, contact).solve(**{kind: loads[k]})
        # the two differ in the order of sums alone, with a stiffness of condition 1e3
        for name in ("forces", "slip", "gap"):
            ours, theirs = getattr(result, name), getattr(known, name)
            assert_allclose(ours, theirs, rtol=0, atol=1e-10 * max(np.abs(theirs).max(), 1e-3))
        u, v = result.displacement("block"), known.displacement("block")
        assert_allclose(u, v, rtol=0, atol=1e-10 * np.abs(v).max())
        assert result.force[1] > 1e-3 and result.certificate.worst < 1e-10


def test_only_the_body_whose_load_changes_is_eliminated_again(monkeypatch):
    """The other one has had as many loads; the last of them is remembered while it stays."""
    upper, lower = block(), blocks_below()
    contacts = sc.Contact(upper.surface("bottom"), lower.surface("top"), friction=sc.Coulomb(0.3))
    solver, eliminated = solver_of([upper, lower], contacts), []
    inner = MultifrontalCholesky.eliminate

    def counted(factor, f):
        eliminated.append(len(f))
        return inner(factor, f)

    monkeypatch.setattr(MultifrontalCholesky, "eliminate", counted)
    loads = [{"f": {"block": forces(upper, k), "low": 0.1 * forces(lower, k)}} for k in range(LOADS)]
    loads += [{"f": {"block": forces(upper, k)}} for k in range(LOADS, LOADS + 4)]
    results, counts = [], []
    for result in solver.history(loads):
        results.append(result)
        counts.append(len(eliminated))
    assert np.diff(counts)[-4:].tolist() == [1, 1, 1, 1]
    known = list(solver_of([upper, lower], contacts).history(loads[-1:], start=results[-2]))[-1]
    for ours, theirs in ((results[-1].forces, known.forces), (results[-1].u, known.u)):
        assert_allclose(ours, theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())


def test_a_history_of_more_directions_than_are_remembered():
    """A history whose results are asked for at its end has the interiors of all its steps.

    They are recovered at once, those of remembered directions beside those of the others.
    """
    body = block()
    contact = contact_of(body)
    loads = [forces(body, k) for k in range(LOADS)]
    results = list(solver_of(body, contact).history([{"f": {"block": f}} for f in loads]))
    start = None
    for f, result in zip(loads, results, strict=True):
        fresh = solver_of(body, contact)
        known = list(fresh.history([{"f": {"block": f}}], start=start))[-1]
        u, v = result.displacement("block"), known.displacement("block")
        assert_allclose(u, v, rtol=0, atol=1e-10 * np.abs(v).max())
        start = result
