r"""Springs that lose their strain: contact forces where they are not unique (method of multipliers).

Where contact rows depend on each other, points are seen through stiff springs
(`skfem_contact.problem.seam`). A loop finds the answer with springs; then their rest forces p0 are
moved to the forces p, until no spring has a strain, ``E (p - p0) = 0``: they are as good as not there.
(Powell, 1969; Hestenes, 1969; as a proximal method, Rockafellar, 1976.) Under given conditions that is
a linear fixed point, ``p = P(p0)``; where they do not change it is found without a loop. From
``p0 = 0`` it is the one with the least ``p'E p``: what differs from it strains no spring, and is never
made. Where points stick, friction that is not needed is taken out of it in the end (`least_friction`):
of all forces that do the same to the bodies, first those with the least friction, in the mean square of
its pressure, then the least of these.

Rows that contradict each other leave a strain whatever the forces are, and these grow by the same
``v`` from one time to the next, ``B'v = 0``. Points whose v pulls open then, those whose friction grows
beyond its bound slip. Where v holds points together by their normal forces alone, ``v >= 0``,
``v'gap0 < 0``, no displacement closes or opens all of them: that is proved, and `Collision` names them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from skfem_contact.arrays import Array, Index, Mask, lengths, size_of
from skfem_contact.conditions.kinematics import without_columns
from skfem_contact.conditions.rows import stacked_rows
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import COMPUTED, GIVEN, ROUND_OFF, SOLVED
from skfem_contact.elimination.pivoting import AGREEMENT
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg.krylov import gmres
from skfem_contact.loops.active_set import Projection, largest_force
from skfem_contact.loops.step import Guess, Iterate, Step
from skfem_contact.problem.points import Response
from skfem_contact.records import dataclass

# Solves at most until springs have come to rest: moves, and GMRES where rows nearly depend on others.
MOST_MOVES = 40

# Share of the last change of forces beyond which the next one shows that rows contradict each other.
SLOW = 0.5

Iteration = Callable[[Step, Guess, float], Iterator[Iterate]]


class Collision(Exception):
    """Points that can not all be closed, or glued, at once.

    Attributes
    ----------
    points : ndarray of bool, shape (m,)
    slips : ndarray of bool, shape (m, d-1)
        Their glued tangents that take part.
    """

    def __init__(self, points: Mask, slips: Mask) -> None:
        super().__init__("contact forces grow without end")
        self.points, self.slips = points, slips


@dataclass(frozen=True, eq=False)
class Rested:
    """Forces at which springs have as little strain as some conditions allow.

    Attributes
    ----------
    response : Response
    growth : ndarray, shape (m, d)
        By what the normal and tangential forces of each point change from one time to the next [force].
    strained : bool
        Whether they do so without end.
    """

    response: Response
    growth: Array
    strained: bool


def through_springs(
    loop: Iteration, step: Step, guess: Guess, tolerance: float, known: Sequence[Iterate] = ()
) -> Iterator[Iterate]:
    """A loop, again and again, while the springs that points are seen through have a strain.

    Rest forces follow the forces of one answer after the other. What springs come to under the
    conditions of the first is tried before: it is the answer unless points change then. `known` is the
    answer with springs that have no forces, where it is known.
    """
    at, rest = step, None
    if guess.near and not known:
        rest = np.column_stack([guess.normal_force, guess.tangential_force])
        at = _at_rest(step, rest)
    change, least = np.zeros(0), np.inf
    iterates: Iterable[Iterate] = chain(known, loop(at, guess, tolerance))
    while True:
        for iterate in iterates:
            if iterate.converged:
                break
            yield iterate
        p, before = _forces(iterate.response), change
        change = p if rest is None else p - rest
        slow = rest is not None and len(before) > 0 and size_of(change) > SLOW * size_of(before)
        if rest is not None and _lost(step, iterate, change, slow):
            yield with_least_friction(step, iterate)
        nearer = size_of(change) < least  # strains that fall are progress
        least = min(least, size_of(change))
        yield replace(iterate, converged=False, note="springs have a strain", nearer=nearer)
        if slow and size_of(change - before) <= GIVEN * size_of(change):
            _check(step, change)
            share = _until_one_changes(step, iterate, p, change)
            if share >= 1.0 / GIVEN:
                _check(step, _without_friction(step, iterate))
                yield replace(iterate, converged=False, note="forces grow without end", jammed=True)
            p = p + share * change
        elif slow:
            found = rested(step, iterate)
            if not found.strained:  # at once to where they come to rest, or to where a point changes
                way = _forces(found.response) - p
                p = p + min(1.0, _until_one_changes(step, iterate, p, way)) * way
        rest = p
        iterates = loop(*_moved_to(step, p, iterate), tolerance)


def _without_friction(step: Step, iterate: Iterate) -> Array:
    """By what forces would grow without friction, (m, d); zero where they would not."""
    it = iterate.conditions
    none, stick = np.zeros_like(it.offset), it.stick & step.tied
    smooth = replace(it, stick=stick, offset=none, coupling=none, spring=np.zeros_like(it.spring))
    try:
        found = rested(step, replace(iterate, conditions=smooth))
    except SingularMatrix:  # bodies that friction alone holds
        return np.zeros((len(none), 1 + none.shape[1]))
    return found.growth if found.strained else np.zeros_like(found.growth)


def _until_one_changes(step: Step, iterate: Iterate, p: Array, growth: Array) -> float:
    """Return how often forces p grow, all (m, d), before a point opens, or slips."""
    closed = iterate.status != OPEN
    falls = closed & ~step.bilateral & (growth[:, 0] < 0)
    most = float(np.min(p[falls, 0] / -growth[falls, 0], initial=1.0 / GIVEN))
    sticks = (iterate.status == STICK) & step.frictional

    def slips(share: float) -> bool:
        force = p + share * growth
        beyond = step.friction.excess(force[:, 1:], force[:, 0], iterate.response.slip)
        return bool(np.any(beyond[sticks] > GIVEN * lengths(force[:, 1:])[sticks]))

    if most > 0 and sticks.any() and slips(most):
        least = 0.0
        while most - least > GIVEN * most:
            middle = 0.5 * (least + most)
            least, most = (least, middle) if slips(middle) else (middle, most)
    return max(most, 0.0)


def _moved_to(step: Step, p: Array, iterate: Iterate) -> tuple[Step, Guess]:
    """The step with springs at rest under forces (m, d), and where a loop begins there."""
    n, t = p[:, 0], p[:, 1:]
    at = _at_rest(step, p)
    there = replace(iterate.response, normal_force=n, tangential_force=t)
    return at, Projection(at, there).proposal(
        Guess(iterate.status, iterate.direction, n, t, there.slip)
    )


def _at_rest(step: Step, p: Array) -> Step:
    """The step with springs at rest under forces (m, d)."""
    load = step.problem.at_forces(step.load, p[:, 0], p[:, 1:])
    return step.under(load, step.last, step.noise, step.far)


def _lost(step: Step, iterate: Iterate, change: Array, slow: bool) -> bool:
    """Return whether forces have changed by so little that no spring has a strain.

    `slow`: the next change would hardly be smaller. Then what rows are known to is no strain.
    """
    assert step.problem.springs is not None
    strain = size_of(step.problem.springs[:, None] * change)
    known = AGREEMENT * _extent(step) if slow else _round_off(step, iterate.response)
    return strain <= known or size_of(change) <= SOLVED * largest_force(iterate.response)


def _forces(response: Response) -> Array:
    """Normal and tangential forces of all points, (m, d)."""
    return np.column_stack([response.normal_force, response.tangential_force])


def rested(step: Step, iterate: Iterate) -> Rested:
    """The forces that springs come to under the conditions of an iterate, the least of all."""
    problem, conditions = step.problem, replace(iterate.conditions, rough=False)
    assert problem.springs is not None
    give = problem.springs[:, None]

    def moved(p: Array) -> tuple[Response, Array]:
        found = problem.solve(conditions, problem.at_forces(step.load, p[:, 0], p[:, 1:]))
        return found, _forces(found)

    last, p = moved(np.zeros((len(give), 1 + iterate.direction.shape[1])))
    round_off, before, count, grows, iterated = (
        _round_off(step, last),
        np.zeros_like(p),
        1,
        False,
        False,
    )
    bend = np.inf  # from one change to the next
    while count < MOST_MOVES:
        last, new = moved(p)
        change, p, count = new - p, new, count + 1
        strain, size = size_of(give * change), size_of(change)
        if strain <= round_off or size <= SOLVED * size_of(p):
            break
        straighter, bend = bend, size_of(change - before)
        grows = bend <= GIVEN * size
        if grows:
            break
        if size > SLOW * size_of(before) and bend > SLOW * straighter:
            if iterated:
                break
            p, iterated = _by_gmres(moved, p, np.sqrt(give), round_off), True
        before = change
    if grows:
        p = p - count * change
    response = replace(last, normal_force=p[:, 0], tangential_force=p[:, 1:])
    return Rested(response, change, grows and strain > AGREEMENT * _extent(step))


def _by_gmres(
    moved: Callable[[Array], tuple[Response, Array]], p: Array, root: Array, round_off: float
) -> Array:
    """Forces (m, d) that change no more, where rows that nearly depend on each other are slow."""
    begin = moved(np.zeros_like(p))[1]

    def left(x: Array) -> Array:
        at = x.reshape(p.shape) / root
        return np.asarray(x - (root * (moved(at)[1] - begin)).ravel())

    goal = max(round_off / size_of(root), SOLVED * float(np.linalg.norm(root * p)))
    x = (root * p).ravel()
    found = gmres(left, (root * begin).ravel(), lambda r: r, x, goal, MOST_MOVES)
    return np.asarray(found.x.reshape(p.shape) / root)


def _round_off(step: Step, response: Response) -> float:
    """Strain that is round-off of gaps and slips [length]."""
    finite = np.isfinite(step.load.gap0)
    gaps = step.load.gap0[finite], response.gap[finite]
    return ROUND_OFF * max(size_of(a) for a in (*gaps, step.load.slip0, response.slip))


def _check(step: Step, growth: Array) -> None:
    """Raise `Collision` where what grows shows that points can not all be closed."""
    assert step.problem.springs is not None
    strain = step.problem.springs[:, None] * growth
    normal, tangential, most = strain[:, 0], strain[:, 1:], size_of(strain)
    if most <= AGREEMENT * _extent(step):
        return
    unglued = np.where(step.tied[:, None], 0.0, tangential)
    pulled = np.where(step.bilateral, 0.0, normal) < -GIVEN * most
    if not pulled.any() and not np.any(np.abs(unglued) > GIVEN * most):
        part = np.abs(tangential) > GIVEN * most
        raise Collision(np.abs(normal) > GIVEN * most, part)


def _extent(step: Step) -> float:
    """Size of the contact surfaces [length]."""
    points = step.motions.kin.points[step.paired]
    return float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0


def with_least_friction(step: Step, iterate: Iterate) -> Iterate:
    """The same answer with no more friction than is needed, where pressures and bounds allow it.

    Points that slip keep their forces: friction follows the normal force there. A set of rows is taken
    after the other, each by itself.

    Parameters
    ----------
    step : Step
    iterate : Iterate
        An answer in which no spring has a strain.
    """
    give, response, held = step.problem.springs, iterate.response, iterate.conditions
    sticks = held.closed & held.stick
    if give is None or not np.any(sticks & step.frictional):
        return iterate
    system, t = step.motions.system, step.motions.kin.tangents
    kin = without_columns(step.motions.kin, np.setdiff1d(np.arange(system.n), system.D))
    every = stacked_rows([kin.B_n, csr_matrix(-kin.B_t)])
    rests = held.closed & ((iterate.status != SLIP) | ~step.resisting)
    moves = np.diff(every.indptr) > 0  # the others are data: supports make them
    at = np.flatnonzero(np.append(rests, np.repeat(sticks, t)) & moves)
    rubs = np.append(np.zeros(len(rests), dtype=bool), np.repeat(step.frictional, t))[at]
    gives = np.append(give, np.repeat(give, t))[at]
    force = np.append(response.normal_force, response.tangential_force)
    for of, found in least_friction(csr_matrix(every[at]), rubs, gives, force[at]):
        new = force.copy()
        new[at[of]] = found
        force = new if _allowed(step, iterate, new) else force
    n, tau = np.split(force, [len(rests)])
    tau = tau.reshape(response.tangential_force.shape)
    return replace(iterate, response=replace(response, normal_force=n, tangential_force=tau))


def _allowed(step: Step, iterate: Iterate, force: Array) -> bool:
    """Return whether no point pulls, and no friction is beyond its bound, by more than in the answer.

    Normal forces (m,) come first. An answer is one to the tolerance of its loop.
    """
    n, tau = np.split(force, [len(iterate.status)])
    before, known = iterate.response, COMPUTED * size_of(force)
    sticks = iterate.conditions.stick & step.frictional
    beyond = step.friction.excess(tau.reshape(len(n), -1), n, before.slip)
    beyond -= step.friction.excess(before.tangential_force, before.normal_force, before.slip)
    pulls = np.minimum(before.normal_force, 0.0) - n
    return bool(np.all(pulls[~step.bilateral] <= known) and np.all(beyond[sticks] <= known))


def least_friction(
    rows: csr_matrix, friction: Mask, give: Array, force: Array
) -> Iterator[tuple[Index, Array]]:
    """Forces on rows that depend on each other, with the least friction, then the least of the others.

    Parameters
    ----------
    rows : csr_matrix, shape (r, n)
        What each force acts along, none of them empty.
    friction : ndarray of bool, shape (r,)
    give : ndarray, shape (r,)
        Compliance of the springs: weights of the squares [length/force].
    force : ndarray, shape (r,)
        Forces with the right ``rows.T @ force``.

    Yields
    ------
    of : ndarray of int
        A smallest set of rows that depend on no others, some of them of friction.
    forces : ndarray
        On these rows.

    Examples
    --------
    One normal force and one of friction along the same DOF:

    >>> rows = csr_matrix([[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    >>> friction = np.array([False, True, False])
    >>> [(of, forces)] = least_friction(rows, friction, np.ones(3), np.array([1.0, 1.0, 5.0]))
    >>> of.tolist(), np.round(forces, 12).tolist()
    ([0, 1], [3.0, 0.0])
    """
    from skfem_contact.elimination.constraint import eliminate

    found = eliminate(rows, np.zeros(len(force)))
    more, kept = found.redundant, found.rows_kept
    follow = (rows[more][:, found.dependent] @ found.pivot_inverse).tocoo()
    part = np.abs(follow.data) > COMPUTED
    pairs = more[follow.row[part]], kept[follow.col[part]]
    shape = (len(force), len(force))
    _, group = connected_components(csr_matrix((np.ones(len(pairs[0])), pairs), shape), directed=False)
    for g in np.unique(group[more]):
        of = np.flatnonzero(group == g)
        if friction[of].any():
            root, own = np.sqrt(give[of]), rows[of]
            A = own[:, np.unique(own.indices)].toarray().T / root
            yield of, _least_of_some(A, friction[of], root * force[of]) / root


def _least_of_some(A: Array, some: Mask, y: Array) -> Array:
    """Of all vectors with the same ``A y`` those with the least `some` entries, of these the least."""
    size, asked, out = float(np.linalg.norm(A)), A @ y, np.empty_like(y)
    U, s, V = _decomposed(A[:, ~some], size)
    across = A[:, some] - U @ (U.T @ A[:, some])  # what the other entries can not do instead
    P, t, Q = _decomposed(across, size)
    out[some] = Q.T @ (P.T @ asked / t)
    out[~some] = V.T @ (U.T @ (asked - A[:, some] @ out[some]) / s)
    return out


def _decomposed(A: Array, size: float) -> tuple[Array, Array, Array]:
    """Singular values and vectors of A, without those that are round-off of a matrix of this size."""
    U, s, V = np.linalg.svd(A, full_matrices=False)
    some = s > COMPUTED * size
    return U[:, some], s[some], V[some]
