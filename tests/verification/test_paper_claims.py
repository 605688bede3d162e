"""What the 2014 paper claims for its method, held against independent formulations.

[M] V. L. Marchenko, *Solving contact problems by the finite element method at considerable slip and
friction forces* (in Ukrainian), Khmelnytskyi National University, 2014. Eliminating the contact
DOFs keeps the matrix symmetric, shortens it by one equation per contact point, hardly widens its
band, needs no penalty, and the tangential elements stop the rigid motion of a body that nothing
but friction holds.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import UPRIGHT, Pose, block_basis, elastic, field, stress_load, weight_load
from scipy.sparse.csgraph import reverse_cuthill_mckee

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.conditions import pair, tangential_matrix
from skfem_contact.conditions.kinematics import join, kinematics


def even(n, start=0.0, length=1.0):
    return start + length * np.linspace(0.0, 1.0, n + 1)


def stack_of(counts, *, kind="Q1", pose=UPRIGHT, friction=None, method="node", width=2.0):
    """Blocks of different stiffness on one another, the lowest held, the top one loaded."""
    bodies = []
    for i, n in enumerate(counts):
        basis = block_basis(even(n, 0.0, width), even(3, float(i)), kind=kind, pose=pose)
        last = i == len(counts) - 1
        # pressed harder at the left than in the middle: an uneven pressure, closed everywhere
        f = stress_load(basis, "top", np.diag([0.0, -1e-3]), pose) if last else None
        f = f if not last else f + weight_load(basis, pose.turn((2e-4, -5e-4)))
        D = "bottom" if i == 0 else None
        bodies.append(sc.Body(basis, elastic(1.0 / (1 + i), 0.3), f, D=D, name=f"block {i}"))
    contacts = [
        sc.Contact(
            upper.surface("bottom"),
            lower.surface("top"),
            friction=friction,
            method=method,
            name=f"joint {i}",
        )
        for i, (lower, upper) in enumerate(pairwise(bodies))
    ]
    return bodies, contacts


def kinematics_of(system, contacts):
    return join([kinematics(system, c, pair(c)) for c in contacts])


def saddle_point(K, f, C, b, D, x):
    """Solve with multipliers: rows ``C u = b`` and prescribed values as further unknowns, densely.

    Redundant rows make the matrix singular: the least-squares solution still has the right u.
    """
    n = len(f)
    rows = np.vstack([C.toarray(), np.eye(n)[D]])
    rhs = np.concatenate([f, b, x[D]])
    A = np.block([[K.toarray(), rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    redundant = np.linalg.matrix_rank(rows) < len(rows)
    solution = np.linalg.lstsq(A, rhs, rcond=1e-13)[0] if redundant else np.linalg.solve(A, rhs)
    return solution[:n], -solution[n : n + len(b)]


# -- the reduced matrix ------------------------------------------------------------------------


@pytest.mark.pairwise
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("kind", ["Q1", "P1"])
@pytest.mark.parametrize("angle", [0.0, 33.0, 90.0])
@pytest.mark.parametrize("counts", [(4, 6), (4, 6, 5)])
def test_K_r_is_symmetric_and_m_equations_shorter(counts, angle, kind, method):
    """T'KT is symmetric to round-off and has one equation less for every closed contact point."""
    bodies, contacts = stack_of(counts, kind=kind, pose=Pose(angle), method=method)
    system = sc.bodies.stack(bodies)
    rows = sc.elimination.contact_rows(system, contacts)
    K_r, *_ = sc.elimination.condense(system.K, system.f, rows=rows, D=system.D, x=system.x)
    m = sum(len(c.secondary.points) for c in contacts)
    assert K_r.shape[0] == system.n - len(system.D) - m
    largest = np.abs(K_r.data).max()
    # a few units in the last place of the largest entry
    assert np.abs((K_r - K_r.T).toarray()).max() <= 4 * np.finfo(float).eps * largest
    # positive semidefinite; the free motions are those sideways of each block above the first
    values = np.linalg.eigvalsh(K_r.toarray())
    free = len(counts) - 1
    assert np.abs(values[:free]).max() < 1e-12 * values[-1]
    assert values[free] > 1e-6 * values[-1]


def without_round_off(A):
    """A without entries that are zero but for round-off, which no two machines have alike."""
    A = A.tocsr().copy()
    # sums of a few products of entries up to the largest
    A.data[np.abs(A.data) < 1e-13 * np.abs(A.data).max()] = 0.0
    A.eliminate_zeros()
    return A


def bandwidth(A):
    """Half bandwidth after the ordering of Cuthill and McKee."""
    A = without_round_off(A)
    order = reverse_cuthill_mckee(A, symmetric_mode=True)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    A = A.tocoo()
    return int(np.abs(place[A.row] - place[A.col]).max())


def narrowest(A):
    """Half bandwidth in breadth-first order from an end of the body (Gibbs, Poole, Stockmeyer).

    The last node of one order is an end from which the next one starts.
    """
    A = without_round_off(A)
    n, degree, best = A.shape[0], np.diff(A.indptr), A.shape[0]
    rows, columns = A.tocoo().row, A.tocoo().col
    for start in range(0, n, max(1, n // 10)):
        for _ in range(4):
            place, order = np.full(n, -1), [start]
            place[start] = 0
            for node in order:  # grows while it is read
                near = A.indices[A.indptr[node] : A.indptr[node + 1]]
                near = near[place[near] < 0]
                near = near[np.argsort(degree[near], kind="stable")]
                place[near] = len(order) + np.arange(len(near))
                order.extend(near)
            best = min(best, int(np.abs(place[rows] - place[columns]).max()))
            start = order[-1]
    return best


def reduced_and_merged(n, kind):
    """K_r of two blocks in contact, and the stiffness of one mesh with the surfaces merged."""
    bodies = []
    for i, k in enumerate(n):
        basis = block_basis(even(k, 0.0, 4.0), even(k, float(i)), kind=kind)
        D = "bottom" if i == 0 else "top"
        bodies.append(sc.Body(basis, elastic(1.0, 0.3), D=D, name=f"block {i}"))
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"), method="node")
    system = sc.bodies.stack(bodies)
    rows = sc.elimination.contact_rows(system, contact)
    K_r, *_ = sc.elimination.condense(system.K, system.f, rows=rows, D=system.D, x=system.x)
    k = max(n)  # as fine as the finer
    merged = block_basis(even(k, 0.0, 4.0), even(2 * k, 0.0, 2.0), kind=kind)
    whole = sc.Body(merged, elastic(1.0, 0.3), D=["bottom", "top"])
    free = np.setdiff1d(np.arange(whole.n), whole.D)
    return K_r, whole.K[free][:, free]


# SciPy starts from a node of least degree, not from one at the end of the body. On triangles, where
# entries of K_r are zero but for round-off, this may be a corner of the interface: the front then runs
# into both blocks at once, and the band is twice as wide. From an end it is not (the test below).
@pytest.mark.every_value
@pytest.mark.parametrize("n", [(8, 8), (12, 12), (8, 12), (24, 24)])
def test_bandwidth_in_the_ordering_of_scipy(n):
    """Ordered by SciPy, K_r has a band at most half as wide again as one conforming mesh has."""
    K_r, merged = reduced_and_merged(n, "Q1")
    assert bandwidth(K_r) <= 1.5 * bandwidth(merged)


@pytest.mark.every_value
@pytest.mark.parametrize("kind", ["Q1", "P1"])
@pytest.mark.parametrize("n", [(8, 8), (12, 12), (8, 12)])
def test_bandwidth_is_that_of_a_conforming_mesh(kind, n):
    """Ordered from an end of the body, K_r has hardly a wider band than the conforming mesh."""
    K_r, merged = reduced_and_merged(n, kind)
    # matching meshes: a node of the interface has three DOFs in place of two, the front as many nodes
    limit = 1.15 if n[0] == n[1] else 1.5
    assert narrowest(K_r) <= limit * narrowest(merged)


# -- a body held by friction alone ---------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 33.0, 90.0])
@pytest.mark.parametrize("counts", [(4, 4), (4, 6)])
def test_tangential_elements_stop_rigid_motion(counts, angle):
    """A block held by friction alone has no free motion left, and none that the primary shares."""
    pose = Pose(angle)
    bodies, contacts = stack_of(counts, pose=pose)
    system = sc.bodies.stack(bodies)
    kin, rows = kinematics_of(system, contacts), sc.elimination.contact_rows(system, contacts)
    T = sc.elimination.eliminate(rows.C, rows.b, system.D, system.x, prefer=rows.prefer)

    def lowest(G):
        K = system.K + tangential_matrix(kin.B_t, np.full((kin.m, 1, 1), G))
        values = np.linalg.eigvalsh(T.reduce(K)[0].toarray())
        return values[0] / values[-1]

    assert abs(lowest(0.0)) < 1e-13  # free to slide
    assert lowest(1.0) > 1e-5
    # the elements resist relative motion only: a motion of all bodies together costs nothing
    # (printed with opposite tangents they would tie the bodies to the ground)
    K_t = tangential_matrix(kin.B_t, np.ones((kin.m, 1, 1)))
    assert np.abs((K_t - K_t.T).toarray()).max() <= 1e-15
    for motion in ((1.0, 0.0), (0.0, 1.0)):
        together = np.concatenate([np.array(motion)[b.dof_component] for b in bodies])
        assert_allclose(K_t @ together, 0.0, atol=1e-14)


@pytest.mark.parametrize("loop", ["newton", "direct", "fictitious"])
def test_block_held_only_by_friction_rests(loop):
    """A block under an oblique load, held by nothing but friction, rests in all three loops."""
    bodies, contacts = stack_of((4, 4), friction=sc.Coulomb(0.6))
    result = sc.ContactSolver(bodies, contacts, loop=loop).solve()
    # 2 wide under 1e-3, and the body force: equilibrium alone. 1e-10 of the load
    assert_allclose(result.force, [-2e-4, 2e-3 + 5e-4], rtol=0, atol=1e-10 * 2.5e-3)
    assert result.converged
    assert np.abs(result.u).max() < 1.0


# -- elimination against multipliers ---------------------------------------------------------------


def check_against_multipliers(bodies, contacts):
    """All rows closed: displacements and forces of the elimination are those of a saddle point."""
    system = sc.bodies.stack(bodies)
    rows = sc.elimination.contact_rows(system, contacts)
    T = sc.elimination.eliminate(
        rows.C, rows.b, system.D, system.x, prefer=rows.prefer, scale=rows.scale
    )
    K_r, f_r = T.reduce(system.K, system.f)
    u = T.expand(np.linalg.solve(K_r.toarray(), f_r))
    exact, force = saddle_point(system.K, system.f, rows.C, rows.b, system.D, system.x)
    assert_allclose(u, exact, rtol=0, atol=1e-12 * np.abs(exact).max())
    p = T.multipliers(system.K @ u - system.f)
    # forces are K times displacements: an error of 1e-12 of the largest internal force
    internal = np.abs(system.K).max() * np.abs(exact).max()
    assert_allclose(p, force, rtol=0, atol=1e-12 * internal)


@pytest.mark.pairwise
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("kind", ["Q1", "P1"])
@pytest.mark.parametrize("angle", [0.0, 33.0, 270.0])
@pytest.mark.parametrize("counts", [(4, 6, 5), (5, 5, 5), (6, 3, 4)])
def test_T_against_multipliers_on_three_stacked_bodies(counts, angle, kind, method):
    """A chain of three bodies, eliminated, has the displacements and forces that multipliers give."""
    pose = Pose(angle)
    bodies, contacts = stack_of(counts, kind=kind, pose=pose, method=method)
    # glued at one joint, sliding at the other, which a prescribed top keeps from moving away
    top = bodies[-1]
    x = field(top.basis, lambda x: np.array([1e-3 + 0 * x[0], -2e-3 - 1e-3 * x[0]]), pose)
    bodies[-1] = sc.Body(top.basis, top.K, top.f, D="top", x=x, name=top.name)
    contacts[-1] = sc.Contact(
        bodies[-1].surface("bottom"), bodies[-2].surface("top"), method=method, tied=True
    )
    check_against_multipliers(bodies, contacts)


@pytest.mark.every_value
@pytest.mark.parametrize("angle", [0.0, 33.0, 90.0])
@pytest.mark.parametrize("interference", [0.0, 1e-3])
def test_T_against_multipliers_in_a_corner(interference, angle):
    """A block between two others, its corner in both contacts: as with multipliers."""
    pose = Pose(angle)
    block = block_basis(even(4), even(4), pose=pose)
    floor = block_basis(even(6, -0.5, 2.0), even(3, -1.0), pose=pose)
    wall = block_basis(even(3, -1.0), even(5, 0.0, 1.25), pose=pose)
    f = stress_load(block, ["right", "top"], np.diag([-1e-3, -2e-3]), pose)
    bodies = [
        sc.Body(block, elastic(1.0, 0.3), f, name="block"),
        sc.Body(floor, elastic(0.7, 0.2), D="bottom", name="floor"),
        sc.Body(wall, elastic(2.0, 0.3), D="left", name="wall"),
    ]
    contacts = [
        sc.Contact(bodies[0].surface("bottom"), bodies[1].surface("top"), interference=interference),
        sc.Contact(bodies[0].surface("left"), bodies[2].surface("right")),
    ]
    check_against_multipliers(bodies, contacts)


# -- no penalty: penetration and balance -----------------------------------------------------------


def resultants(result):
    """Resultant force and moment about the origin of each body: loads, reactions and contact.

    Measured from nodal forces: what acts on a body from outside is its load, the reaction of its
    prescribed DOFs, and the contact forces that the rows put on its nodes.
    """
    system, kin, state = result.system, answer_of(result).kin, answer_of(result).local
    contact = kin.B_n.T @ state.normal_force - kin.B_t.T @ state.tangential_force.ravel()
    out = []
    for i, body in enumerate(system.bodies):
        span = slice(system.offsets[i], system.offsets[i + 1])
        u, f, c = result.u[span], answer_of(result).case.f[span], contact[span]
        reaction = np.zeros(body.n)
        reaction[body.D] = (body.K @ u - f - c)[body.D]
        total, x, k = f + reaction + c, body.dof_points, body.dof_component
        force = np.array([total[k == 0].sum(), total[k == 1].sum()])
        moment = np.sum(np.where(k == 1, x[:, 0], -x[:, 1]) * total)
        out.append((force, moment, np.abs(total).max(), c))
    return out


@pytest.mark.pairwise
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("mu", [None, 0.3])
@pytest.mark.parametrize("angle", [0.0, 33.0, 90.0])
@pytest.mark.parametrize("counts", [(4, 6), (4, 6, 5)])
def test_no_penetration_and_balanced_forces(counts, angle, mu, method):
    """Closed points do not overlap, and every body is in balance, without any penalty."""
    pose = Pose(angle)
    law = None if mu is None else sc.Coulomb(mu)
    bodies, contacts = stack_of(counts, pose=pose, friction=law, method=method)
    if mu is None:  # nothing holds it sideways: the top surface moves as a whole
        for i in range(1, len(bodies)):
            b = bodies[i]
            D, x = b.basis.get_dofs("left"), field(b.basis, lambda x: np.array([0.0, -5e-3]), pose)
            bodies[i] = sc.Body(b.basis, b.K, b.f, D=D, x=x, name=b.name)
        contacts = [
            sc.Contact(up.surface("bottom"), low.surface("top"), method=method, name=c.name)
            for low, up, c in zip(bodies[:-1], bodies[1:], contacts, strict=True)
        ]
    result = sc.ContactSolver(bodies, contacts).solve()
    kin, state = answer_of(result).kin, answer_of(result).state
    gap = kin.gap0 + kin.B_n @ result.u
    closed = state.status != 0
    assert closed.any()
    size = 2.0
    # over the size of a block
    assert np.abs(gap[closed]).max() <= 1e-12 * size
    assert gap.min() >= -1e-12 * size
    for force, moment, largest, _ in resultants(result):
        assert np.abs(force).max() < 1e-10 * largest
        assert abs(moment) < 1e-10 * largest * size
    # and between them the contact forces cancel: action is reaction
    contact = sum(c.reshape(-1, 2).sum(axis=0) for *_, c in resultants(result))
    assert np.abs(contact).max() < 1e-10 * np.abs(state.normal_force).max()


@pytest.mark.parametrize("angle", [0.0, 33.0])
@pytest.mark.parametrize("opening", [0.0, 2e-3])
def test_moments_balance_up_to_friction_across_the_gap(opening, angle):
    """Contact moments cancel but for friction that acts across an initial gap, ``sum tau x gap0``."""
    pose = Pose(angle)
    low = block_basis(even(5), even(3), pose=pose)
    top = block_basis(even(5), even(3, 1.0 + opening), pose=pose)
    x = field(top, lambda x: np.array([2e-3 + 0 * x[0], -3e-3 - opening + 0 * x[0]]), pose)
    bodies = [
        sc.Body(low, elastic(1.0, 0.3), D="bottom", name="low"),
        sc.Body(top, elastic(0.7, 0.2), D="top", x=x, name="top"),
    ]
    contact = sc.Contact(
        bodies[1].surface("bottom"), bodies[0].surface("top"), friction=sc.Coulomb(0.3)
    )
    result = sc.ContactSolver(bodies, [contact]).solve()
    assert (result.status != 0).any()
    moment = 0.0
    for body, (*_, c) in zip(bodies, resultants(result), strict=True):
        x, k = body.dof_points, body.dof_component
        moment += np.sum(np.where(k == 1, x[:, 0], -x[:, 1]) * c)
    # friction on the secondary along the tangent, at the height gap0 along the normal above where
    # it acts on the primary; in the plane n x t = 1 for the tangent that is n turned by 90 degrees
    stated = np.sum(answer_of(result).kin.gap0 * result.tangential_force[:, 0])
    scale = np.abs(result.normal_force).sum()
    assert abs(moment - stated) < 1e-10 * scale
    if opening:
        assert abs(stated) > 1e-5 * scale
        # the certificate reports this term apart, by the same number
        assert result.certificate.moment_gap > 0
    else:
        assert abs(stated) < 1e-12 * scale
    assert result.certificate.moment_balance < 1e-10
