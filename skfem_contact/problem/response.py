r"""The question of one iteration to a contact problem, and the answer.

One nonlinear iteration asks one linear question: with these points closed, those sticking and a
given linear friction law on the rest (`Conditions`), what are the gaps, slips and contact forces
(`Response`) under this load (`Load`)?
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from skfem_contact.arrays import Array, Mask
from skfem_contact.digits import SOLVED
from skfem_contact.records import dataclass


@dataclass(eq=False)
class Conditions:
    r"""The conditions at every point during one linear solve.

    A closed point has no gap. If it sticks, its slip is `anchor`; otherwise its friction force is
    ``tau = offset + spring (s - anchor) + coupling lambda``: springs may be far stiffer than points,
    and what they give is then a small part of the slip. An open point carries nothing.

    Attributes
    ----------
    closed, stick : ndarray of bool, shape (m,)
    anchor, offset, coupling : ndarray, shape (m, d-1)
        [length], [force], [1]
    spring : ndarray, shape (m, d-1, d-1)
        [force/length]
    rough : bool
        Whether an answer on the way will do: where linear problems are iterated, one that leaves a
        hundredth of what is wrong with the iterate before.
    """

    closed: Mask
    stick: Mask
    anchor: Array
    spring: Array
    offset: Array
    coupling: Array
    rough: bool = False

    @cached_property
    def gives(self) -> bool:
        """Return whether any point has a spring."""
        return bool(np.count_nonzero(self.spring))

    @property
    def even_springs(self) -> bool:
        """Return whether all springs are symmetric.

        They are not where a bound grows with the slip: the force along the direction of friction then
        changes with slip along another, that of all slip so far.
        """
        spring = self.spring
        if spring.shape[1] == 1 or not self.gives:
            return True
        return not np.count_nonzero(_skewed(spring))

    def matrix_key(self) -> bytes:
        """Equal for conditions with the same matrix, so that a factorisation can be kept."""
        masks = self.closed.tobytes() + self.stick.tobytes()
        return masks + self.spring.tobytes() + self.coupling.tobytes()


def odd_round_off(spring: Array) -> Array:
    """Return what takes springs (m, t, t) that count as symmetric from being so; zero for the others.

    >>> odd_round_off(np.array([[[2.0, 1e-12], [0.0, 2.0]], [[2.0, 1.0], [0.0, 2.0]]])).tolist()
    [[[0.0, 5e-13], [-5e-13, 0.0]], [[0.0, 0.0], [0.0, 0.0]]]
    """
    odd = 0.5 * (spring - spring.swapaxes(1, 2))
    odd[_skewed(spring)] = 0.0
    return odd


def _skewed(spring: Array) -> Mask:
    """Springs (m, t, t) that differ from their transposes by more than round-off."""
    size = np.max(np.abs(spring), axis=(1, 2))
    skew = np.max(np.abs(spring - spring.swapaxes(1, 2)), axis=(1, 2))
    return np.asarray(skew > SOLVED * size)


@dataclass(eq=False)
class Response:
    """Gaps, slips and forces of all points, and the solution in the space's own unknowns.

    `rough`: bodies are not yet in equilibrium as well as they will be, see `Conditions`.
    """

    gap: Array
    slip: Array
    normal_force: Array
    tangential_force: Array
    solution: Array
    rough: bool = False


class Resistance(NamedTuple):
    """The resistance of each point by itself, the others free to move, (m,) [force/length].

    Attributes
    ----------
    normal : ndarray, shape (m,)
        Against a change of its gap.
    tangential : ndarray, shape (m,)
        Against slip, in the direction in which it resists least.
    """

    normal: Array
    tangential: Array


@dataclass(eq=False)
class Load:
    """One load step in the unknowns of a space: forces and initial gaps and slips.

    Attributes
    ----------
    force : ndarray
        Empty where it follows from `moved`.
    components : tuple
        What the bodies remember of the load, for the interior.
    moved : ndarray
        Changes of gaps, slips and anchors where contact carries nothing; on gaps and slips.
    """

    force: Array
    gap0: Array
    slip0: Array
    prescribed: Array
    components: tuple[Any, ...] = ()
    moved: Array | None = None


@dataclass(eq=False)
class Source:
    """The forces or displacements that the displacements of the bodies follow from.

    Attributes
    ----------
    values : ndarray, shape (n_c,) or (n_c, r), or with n in place of n_c
        Forces on the contact DOFs, contact forces included; or displacements of the contact DOFs; or
        of all DOFs.
    forces : bool
    """

    values: Array
    forces: bool


def friction_force(conditions: Conditions, moved: Array, normal_force: Array) -> Array:
    """The linear friction law of the points that do not stick exactly, moved from their anchors."""
    force = conditions.offset
    if conditions.gives:
        force = force + np.einsum("ikl,il->ik", conditions.spring, moved)
    return force + conditions.coupling * normal_force[:, None]
