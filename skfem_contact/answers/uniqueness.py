r"""Whether a load may have other answers: critical friction of points, index of an answer, and a proof.

With the stiffness S of gaps and slips (`problem.points`) a load step is an equation made of pieces. In
2-D these are linear: the patterns of open, sticking and slipping points, with the rows of S of open
points, and for slipping points ``S_t + mu d S_n`` (`d` = 1 or -1, the direction of friction).

*Every load has exactly one answer if and only if the determinants of all 4^m pieces are positive*:
at most four pieces meet in a face of codimension two, and then pieces of one orientation suffice (Kuhn
and Löwen, 1987). Too many to try; but two consequences of it are cheap:

* If one piece is negative, loads inside it have several answers. With a single point slipping, the
  others open or stuck, its sign is that of ``k_tt - mu |k_tn|``, k the stiffness that this point meets.
  So ``mu > k_tt / |k_tn|`` at one point is *sufficient* for loads with several answers to exist, and
  for a problem with one point necessary too. With more points it is not: they can do it together.
* The signs of all answers to one load, their indices, add up to one if supports hold all bodies, since
  the degree of the map does not change on the way from ``mu = 0``. So an answer of index -1 is
  *sufficient* for at least two further answers to this very load.

In 3-D pieces are not linear, as the direction of friction turns with the slip s: it adds a spring
``mu lambda / |s| (1 - d d')`` to the rows. Degree and indices are what they were, and so are both
consequences, with the least coefficient for which any direction and any such spring makes the
determinant of one point negative: `pieces.critical_friction`.

That there is exactly *one* answer to every load is shown by energy, in both dimensions and up to a
coefficient that falls with the number of points across the contact: `one_answer.unique_up_to`.

Forces of contacts may be undetermined where displacements are not, as conditions of points that press
depend on each other. Forces v with ``B'v = 0`` can then be added to those of an answer, as long as all
points still press and no friction exceeds its bound: displacements stay what they are. So it is between
contacts that share an edge, with friction or walls at an acute angle, where a tool that supports hold
is finer than what it presses, and where supports and friction hold the same node.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix, vstack
from scipy.sparse.csgraph import connected_components

from skfem_contact.answers.answer import Answer
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import Coulomb, Tresca
from skfem_contact.conditions.friction_rule import CheckedLaw
from skfem_contact.conditions.kinematics import without_columns
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.state import SLIP, STICK
from skfem_contact.digits import SOLVED
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Uniqueness:
    """What is known about other answers to the load of a result.

    All of it is about this load step: from the state before it, on the pairing of the result.

    Attributes
    ----------
    critical_friction : ndarray, shape (m,)
        Coefficient of friction from which on this point alone gives loads with several answers, the
        other points open or stuck as in this answer; ``inf`` if no coefficient does, NaN at points
        without friction or partner. Over all contacts: ``len(values.points)`` for each of the result.
    friction : ndarray, shape (m,)
        Coefficient of the friction law in this answer, ``dL / d lambda``; NaN at the same points. Of
        `OrthotropicCoulomb` both are the larger one of two whose ratio stays.
    index : int
        Sign of the determinant of this answer's linear problem. If it is -1, and supports hold all
        bodies, this very load has at least two other answers. 0 where nothing follows from it: with
        wear, with a user's own law, where a bound is not zero on points that open (Tresca, cohesion),
        and at the critical friction itself, where the determinant is round-off.
    held : bool
        Whether they do.
    unique_up_to : float
        *Every* load has exactly one answer while no coefficient of friction is more than this many
        times what it is here. That is shown, not measured: beyond it nothing is known, and 0 is where
        nothing is known at all: with bodies that supports do not hold, with wear, laws of one's own,
        and bounds that are not zero on points that open.

    Examples
    --------
    >>> known = Uniqueness(np.array([1.5, np.inf]), np.array([2.0, 2.0]), 1, True, 0.5)
    >>> known.may_be_several
    array([ True, False])
    >>> known.only_one
    False
    """

    critical_friction: Array
    friction: Array
    index: int
    held: bool
    unique_up_to: float = 0.0

    @property
    def may_be_several(self) -> Mask:
        """Points whose friction is above the critical one, shape (m,)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.friction > self.critical_friction)

    @property
    def only_one(self) -> bool:
        """Whether it is shown that this load has no other answer; False is not known."""
        return self.unique_up_to >= 1.0


def uniqueness(result: Answer) -> Uniqueness | None:
    """What is known about other answers to the load of a result.

    Parameters
    ----------
    result : Answer

    Returns
    -------
    Uniqueness or None
        None where it is not computed: on the sparse route, with contact rows that depend on each
        other, and where the answer leaves a motion free.
    """
    from skfem_contact.answers.one_answer import unique_up_to
    from skfem_contact.answers.pieces import critical_friction, orientation, turning_springs

    found = result.recover.space(result.kin)
    if found is None:
        return None
    space, held = found
    friction, G = coefficients(result), result.tangential_stiffness
    able = (space.normal_rows >= 0) & (space.tangential_rows >= 0).any(axis=1)
    friction = np.where(able, friction, np.nan)
    status, resisting = result.state.status, result.local.tangential_force
    steepest = np.where(able, steepest_bounds(result), 0.0)
    one = not np.isnan(steepest).any()
    try:
        critical = critical_friction(space, status, friction, G)
        springs = turning_springs(resisting, result.plastic_slip, G, space)
        index = orientation(space, status, resisting, friction, G, springs) if one else 0
    except LinAlgError:
        return None
    at_most = unique_up_to(space, steepest, G, result.kin.tied) if one and held else 0.0
    return Uniqueness(critical, friction, index, held, at_most)


def coefficients(result: Answer) -> Array:
    """Slope of the friction law at every point in this answer; NaN without law or partner, (m,)."""
    state, kin = result.local, result.kin
    out = np.full(kin.m, np.nan)
    slip = state.slip - state.reference
    for contact, part, name in zip(result.contacts, result.slices(), result.names, strict=True):
        if contact.friction is not None:
            force = np.maximum(state.normal_force[part], 0.0)
            law = CheckedLaw(contact.friction, name, contact.secondary.points)
            out[part] = law.slope(force, kin.area[part], slip[part])
    out = np.where(kin.bilateral & (state.normal_force < 0), 0.0 * out, out)  # tension changes no bound
    return np.where(kin.paired, out, np.nan)


def steepest_bounds(result: Answer) -> Array:
    """By how much a bound changes at most with the normal force, whatever that is, shape (m,).

    NaN where it may jump, or depend on more than the normal force. An open point has no friction: a
    bound that is not zero without pressure jumps there.
    """
    out = np.zeros(result.kin.m)
    for contact, part in zip(result.contacts, result.slices(), strict=True):
        if contact.friction is not None:
            out[part] = _steepest(contact)
    return out


def _steepest(contact: Contact) -> Array | float:
    law = contact.friction
    if contact.wear is not None:
        return np.nan
    if type(law) is Tresca and contact.bilateral:
        return 0.0
    if type(law) is Coulomb and (contact.bilateral or not np.any(law.cohesion)):
        return law.mu
    if type(law) is OrthotropicCoulomb and (contact.bilateral or not np.any(law.cohesion)):
        return law.larger
    return np.nan


def undetermined(answer: Answer) -> tuple[str, ...]:
    """A sentence per group of contacts whose forces are not unique; see `ContactResult.undetermined`.

    Points that hardly press count for nothing: what is left of them decides on no force.
    """
    if not answer.springs:
        return ()
    from skfem_contact.elimination.eliminate import eliminate

    rows, points = _rows(answer)
    redundant = eliminate(rows, np.zeros(len(points))).redundant
    _, group = connected_components(abs(rows) @ abs(rows).T, directed=False)
    of_point = np.concatenate([np.full(len(kin), i) for i, kin in enumerate(_parts(answer))])
    found: dict[tuple[int, ...], list[int]] = {}
    for g in np.unique(group[redundant]):
        contacts = tuple(np.unique(of_point[points[group == g]]).tolist())
        counts = found.setdefault(contacts, [0, 0])
        counts[0] += np.count_nonzero(group == g)
        counts[1] += np.count_nonzero(group[redundant] == g)
    return tuple(_words(answer, *item) for item in found.items())


def _words(answer: Answer, contacts: tuple[int, ...], counts: list[int]) -> str:
    *first, last = [f"'{answer.names[i]}'" for i in contacts]
    names = f"{', '.join(first)} and {last}" if first else last
    total, more = counts
    return (
        f"The contact forces of {names} are not unique: of {total} conditions at points that press "
        f"{more} follow from the others. Displacements are the same for all forces that fulfil them; "
        "these are chosen by the least squares of friction and of pressure over the surfaces, whatever "
        "the order of contacts and nodes."
    )


def _rows(answer: Answer) -> tuple[csr_matrix, Index]:
    """What the forces of points act along, over the free DOFs, and which point each is of.

    A point that slips has one row, as its friction follows the normal force.
    """
    system, state, conditions = answer.system, answer.state, answer.conditions
    free = np.setdiff1d(np.arange(system.n), system.D)
    kin = without_columns(answer.kin, free)
    m, t = kin.m, kin.tangents
    largest = np.max(np.abs(state.normal_force), initial=0.0)
    presses = kin.paired & (kin.bilateral | (state.normal_force > SOLVED * largest))
    presses &= state.status != 0
    rows, points = [kin.B_n], [np.arange(m)]
    if t:
        slips = np.where((state.status == SLIP)[:, None], conditions.coupling, 0.0)
        at = np.arange(m * t)
        spread = csr_matrix((slips.ravel(), (at // t, at)), shape=(m, m * t))
        rows[0] = csr_matrix(kin.B_n - spread @ kin.B_t)
        sticks = np.repeat(presses & (state.status == STICK) & conditions.stick, t)
        rows.append(kin.B_t[sticks])
        points.append(at[sticks] // t)
    rows[0], points[0] = rows[0][presses], points[0][presses]
    all_rows, all_points = csr_matrix(vstack(rows)), np.concatenate(points)
    moves = np.diff(all_rows.indptr) > 0  # the others are data: supports make them
    return csr_matrix(all_rows[moves]), all_points[moves]


def _parts(answer: Answer) -> list[Index]:
    """The points of each contact."""
    return [np.arange(answer.kin.m)[part] for part in answer.slices()]
