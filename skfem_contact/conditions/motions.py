"""Rigid motions that the supports leave free, whether contact holds them, and what loads on them need.

No direct solver says that a matrix is singular, so this is asked before anything is factorised:
the rigid modes of all bodies together, less what prescribed DOFs and the stiffness itself hold,
against the rows that contact and friction hold at the moment.

**Statics** asks whether any forces at the contact points balance a load. On the k free motions ``c``
the loads are ``Q = R'f``, and an equilibrium needs

    Q + N' lambda - T' tau = 0,    lambda >= 0,    |tau| <= mu lambda.

These forces make a cone. If ``-Q`` is outside of it, some motion separates the two (Farkas): the load
drives it, and no force that contact can give does work against it. That is a proof that there is no
equilibrium, whatever the stiffness. The other way round proves nothing where there is friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.linalg.lapack import dsyev
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies import member
from skfem_contact.bodies.system import System
from skfem_contact.conditions.friction import Coulomb
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.state import LocalState
from skfem_contact.digits import COMPUTED, GIVEN, ROUND_OFF, SINGLE, SOLVED
from skfem_contact.errors import NoEquilibrium
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.records import ByFields, dataclass

# A mode with less than this share of a motion is not named in messages.
NOT_NAMED = 1e-3

# Free motions up to which the products of their rows are kept point by point: those of two bodies in
# space, which take less than the rows' own matrix.
FEW_MODES = 12

# What is known of an equilibrium that was not found.
SHOWN = (
    "The load drives a motion that no force at the contact points can stop, friction at its bound "
    "included: there is no equilibrium. "
)
NOT_SHOWN = (
    "Whether there is an equilibrium is not shown: forces at the contact points could balance the "
    "load, but no way to them was found. "
)

SHOWN_HERE = (
    "Where the bodies are now, the load drives a motion that no force at the contact points can stop, "
    "friction at its bound included; whether there is an equilibrium elsewhere is not shown. "
)

DRIVEN = (
    "Only strains drive it: no load works along this motion, but the surfaces that carry the load turn "
    "with the strains, and to hold the bodies where they move least takes {:.1e} of the largest force "
    "at a contact point (of second order). If that is too little to matter, hold the motion by a DOF. "
)

#: Why a body may stand elsewhere.
NOWHERE = "nothing loads it and nothing holds it there; it stands where it has moved least"
NEAR = (
    "nothing loads it and nothing holds it there; it stands near where it has moved least, just where "
    "points change their partners"
)
BARELY = (
    "nothing holds it there but friction that is at its bound, or forces that are round-off; it stands "
    "where the iterations left it"
)


@dataclass(frozen=True, eq=False)
class RigidMotions(ByFields):
    """The k rigid motions left free by supports, seen from the contact points.

    Attributes
    ----------
    modes : ndarray, shape (n, k)
        Displacements, each mode with largest displacement one.
    kin : Kinematics
        The contact points.
    system : System
    """

    modes: Array
    kin: Kinematics
    system: System

    @cached_property
    def k(self) -> int:
        """Number of free motions."""
        return self.modes.shape[1]

    @cached_property
    def normal(self) -> Array:
        """Change of the gap by each mode, shape (m, k)."""
        return np.asarray(self.kin.B_n @ self.modes)

    @cached_property
    def tangential(self) -> Array:
        """Change of the slip by each mode, shape (m, d-1, k); asked for where points may stick."""
        kin = self.kin
        return np.asarray(kin.B_t @ self.modes).reshape(kin.m, kin.tangents, self.k)

    def seen_by(self, kin: Kinematics) -> RigidMotions:
        """The same motions seen from another pairing."""
        return replace(self, kin=kin)

    def free(
        self, closed: Mask, stick: Mask, firmly: float = SOLVED, more: Array | None = None
    ) -> Array:
        """Combinations of modes that closed and sticking points do not hold, shape (k, j).

        `firmly`: how far a point has to move at least where a mode of unit size is held. `more`: what
        else holds, rows of shape (r, k) of unit size where they hold firmly.
        """
        if self.k == 0:
            return np.zeros((0, 0))
        rows = self.rows(closed, stick)
        return null_space(rows if more is None else np.concatenate([rows, more]), firmly)

    @cached_property
    def _normal_products(self) -> Array:
        """Of each point the products of the numbers in its row of `normal`, (m, k k)."""
        products = self.normal[:, :, None] * self.normal[:, None, :]
        return products.reshape(len(products), -1)

    @cached_property
    def _tangential_products(self) -> Array:
        """The same of `tangential`, the sum over the tangents, (m, k k)."""
        products = np.einsum("mtk,mtl->mkl", self.tangential, self.tangential)
        return products.reshape(len(products), -1)

    def held(self, closed: Array | Mask, stick: Mask, least: float = SOLVED) -> bool:
        """Closed and sticking points hold all motions by far, as in nearly every step.

        Where they do `free` finds none, and takes longer. `closed` may be weights: the squares of what
        the rows of `normal` are multiplied by, (m,).
        """
        if self.k > FEW_MODES:
            return False
        products = closed.astype(float).dot(self._normal_products)
        if np.count_nonzero(stick):
            products += stick.astype(float).dot(self._tangential_products)
        return _held(products.reshape(self.k, self.k), least)

    def rows(self, closed: Mask, stick: Mask) -> Array:
        """Motion of closed points along normals, then of sticking ones along tangents, (r, k)."""
        normal = self.normal[closed]
        if not np.count_nonzero(stick):
            return normal
        return np.concatenate([normal, self.tangential[stick].reshape(-1, self.k)])

    def describe(self, combination: Array) -> tuple[tuple[str, ...], str]:
        """The bodies that move and their motion in words."""
        u = self.modes @ combination
        scale = np.max(np.abs(u))
        bodies, motions = [], []
        for i, (name, part) in enumerate(zip(self.system.names, self._parts(u), strict=True)):
            if np.max(np.abs(part)) > GIVEN * scale:
                bodies.append(name)
                motions.append(motion_words(self.system.modes(i), self.system.mode_names(i), part))
        same = len(set(motions)) == 1
        words = motions[0] if same else "; ".join(map(": ".join, zip(bodies, motions, strict=True)))
        return tuple(bodies), words

    def load_along(self, combination: Array, f: Array) -> dict[str, float]:
        """The sums of the load f (n,) on what moves, along the axes that it moves along [force]."""
        u = self.modes @ combination
        sums: dict[str, float] = {}
        parts = zip(self.system.bodies, self._parts(u), self._parts(f), strict=True)
        for body, moved, load in parts:
            if np.max(np.abs(moved), initial=0.0) > GIVEN * np.max(np.abs(u)):
                modes, names = self.system.modes(body), self.system.mode_names(body)
                known = _moving(modes, names, moved)
                for mode, name in zip(modes.T, names, strict=True):
                    motion, _, axis = name.partition(" of part ")[0].partition(" along ")
                    if name in known and motion == "translation":
                        force = float(mode @ load / np.max(np.abs(mode)))
                        sums[axis] = sums.get(axis, 0.0) + force
        return sums

    def indifferent(self, free: Array, why: str = NOWHERE) -> tuple[str, ...]:
        """A sentence for each body and motion that is free and not loaded, from (k, j).

        The turn of a disc about its centre that nothing feels is no other place.
        """
        u = self.modes @ free
        sentences = []
        for body, name, part in zip(self.system.bodies, self.system.names, self._parts(u), strict=True):
            size = np.linalg.norm(part)
            if isinstance(body, RigidBody) and body.obstacle.turns_in_itself(body.about):
                size = np.linalg.norm(part[: body.dim])
            if size > GIVEN * np.linalg.norm(u):
                words = motion_words(self.system.modes(body), self.system.mode_names(body), part)
                sentences.append((name, words))
        return tuple(
            f"The place of body '{name}' is indifferent ({words}): {why}, and the forces are the same "
            "wherever it can move freely."
            for name, words in sentences
        )

    def _parts(self, u: Array) -> list[Array]:
        offsets = self.system.offsets
        return [u[offsets[i] : offsets[i + 1]] for i in range(len(offsets) - 1)]


def rigid_motions(system: System, kin: Kinematics, stiffness: Sequence[csr_matrix]) -> RigidMotions:
    """Find the rigid motions that neither prescribed DOFs nor the stiffness resist."""
    blocks = []
    for i, (body, K) in enumerate(zip(system.bodies, stiffness, strict=True)):
        R = system.modes(i) / member.largest(system.modes(i))
        # prescribed DOFs and springs to the ground: rows that a free motion leaves at zero
        left = null_space(R[body.D])
        if left.shape[1]:  # where supports hold all motions, springs have none to hold
            springs = _resistance(K, R)
            left = null_space(np.concatenate([R[body.D], springs])) if len(springs) else left
        free = R @ left
        peak = member.largest(free)
        blocks.append(free / np.where(peak > 0, peak, 1.0))
    return RigidMotions(block_diag(*blocks), kin, system)


def _resistance(K: csr_matrix, R: Array) -> Array:
    """Unit rows for the modes that the stiffness itself resists; none for a free body.

    The resistance of a rigid mode of a free body is round-off, some 1e-16 per row; how strong a
    genuine spring is does not matter here, only that there is one.
    """
    forces, least = K @ R, ROUND_OFF * np.sqrt(K.shape[0])
    # no singular value is above the norm, and the scale is not below what the diagonal alone gives
    if np.linalg.norm(forces) <= least * np.max(np.abs(K.diagonal()[:, None] * R), initial=0.0):
        return np.zeros((0, R.shape[1]))
    scale = np.max(abs(K) @ np.abs(R))
    _, values, rows = np.linalg.svd(forces / scale, full_matrices=False)
    return rows[values > least]


def no_equilibrium(
    motions: RigidMotions,
    free: Array,
    when: str,
    f: Array | None = None,
    result: Any = None,
    shown: str = "",
    pull: float = 0.0,
    carries: str = "",
) -> NoEquilibrium:
    """The error for bodies that contact does not hold.

    Parameters
    ----------
    motions : RigidMotions
    free : ndarray, shape (k, j)
        Combinations of modes that nothing holds, from `RigidMotions.free`.
    when : str
        Under which circumstances, in words.
    f : ndarray, shape (n,), optional
        Load [force]: of several motions the one that it drives is named.
    result : ContactResult, optional
        The last state reached, which the error carries.
    shown : str
        What statics alone shows of the load, in words.
    pull : float
        What it takes to hold the bodies where they move least, over the largest point force, if known.
    carries : str
        How much of the load is carried, in words.
    """
    moves = free[:, 0]
    if f is not None:
        driven = free @ (free.T @ (motions.modes.T @ f))
        moves = driven if driven.any() else moves
    bodies, motion = motions.describe(moves)
    names = " and ".join(f"'{name}'" for name in bodies)
    subject, together = (
        (f"Body {names} is", "") if len(bodies) == 1 else (f"Bodies {names} are", " together")
    )
    known = "" if f is None else NOT_SHOWN
    if shown and f is not None:
        known = shown + _out_of_balance(motions.load_along(moves, f), f, len(bodies) == 1)
    if pull > 0.0:
        known = DRIVEN.format(pull)
    return NoEquilibrium(
        f"{subject} free to move{together}: {motion}, {when}. {known}{carries}"
        "Usually a support is missing, the load pulls the bodies apart, or friction is too weak for "
        "the load. Prescribe a DOF (D=...), press the bodies together first, add friction, or hold "
        "the body with weak springs in K.",
        bodies,
        motion,
        result,
    )


def _out_of_balance(sums: Mapping[str, float], f: Array, alone: bool) -> str:
    """Say what the loads on the bodies that move come to: what no support takes."""
    if max(map(abs, sums.values()), default=0.0) <= SOLVED * np.sum(np.abs(f)):
        return ""  # a moment
    words = " and ".join(f"{force:.6g} along {axis}" for axis, force in sums.items())
    return f"The loads on {'it' if alone else 'them'} add up to {words}. "


def null_space(rows: Array, least: float = SOLVED) -> Array:
    """Directions that all rows leave at zero, shape (k, j), orthonormal."""
    k = rows.shape[1]
    if rows.size == 0:
        return np.eye(k)
    if _held(rows.T @ rows, least):
        return np.zeros((k, 0))
    _, values, directions = np.linalg.svd(rows, full_matrices=rows.shape[0] < k)
    values = np.concatenate([values, np.zeros(len(directions) - len(values))])
    return directions[values < least * max(1.0, np.max(values, initial=0.0))].T


def _held(products: Array, least: float) -> bool:
    """Return whether no direction is near the bound, from the products ``rows' rows``, (k, k).

    By the squares of the singular values, the eigenvalues of a matrix of few directions. They have
    half of the digits, so the bound is taken twice as high, and above their round-off.
    """
    # every iteration asks: NumPy's checks take three times as long as LAPACK
    squares = dsyev(products, compute_v=0)[0] if len(products) > 1 else products.ravel()
    smallest, largest = float(squares[0]), float(squares[-1])
    return smallest > (2 * least) ** 2 * max(1.0, largest) + COMPUTED * largest


def motion_words(modes: Array, names: tuple[str, ...], u: Array) -> str:
    """The motion u (n,), or motions (n, j), in words: which rigid modes (n, k) have a part in it."""
    return joined(_moving(modes, names, u))


def _moving(modes: Array, names: tuple[str, ...], u: Array) -> list[str]:
    """The names of the rigid modes (n, k) that have a part in a motion u (n,), or motions (n, j)."""
    scaled = modes / np.max(np.abs(modes), axis=0)
    share = np.abs(np.linalg.lstsq(scaled, u, rcond=None)[0])
    share = share if share.ndim == 1 else np.max(share, axis=1)
    return [name for name, s in zip(names, share, strict=True) if s > NOT_NAMED * share.max()]


def joined(names: Sequence[str]) -> str:
    """Rigid motions as one: those of a kind by their axes, one kind with the other.

    >>> joined(["translation along x", "translation along y", "rotation"])
    'translation along x and y with rotation'
    >>> joined(
    ...     [
    ...         "translation along x of part 2",
    ...         "rotation about x",
    ...         "rotation about y",
    ...         "rotation about z",
    ...     ]
    ... )
    'translation along x of part 2 with rotation about x, y and z'
    """
    kinds: dict[tuple[str, str], list[str]] = {}
    for name in names:
        motion, _, part = name.partition(" of part ")
        kind, _, axis = motion.rpartition(" ")
        if axis not in ("x", "y", "z"):
            kind, axis = motion, ""
        kinds.setdefault((kind, part), []).append(axis)
    words = []
    for (kind, part), axes in kinds.items():
        listed = " and ".join(filter(None, (", ".join(axes[:-1]), axes[-1])))
        words.append(f"{kind} {listed}".strip() + (f" of part {part}" if part else ""))
    return " with ".join(words)


# Directions of friction in 3-D; the polygon lies around the circle of Coulomb's law, and is off it by
# half a per cent at most. More take time alone.
DIRECTIONS = 32

# What may be left of the forces along a free motion: they balance to the digits of the contact problem,
# 1e-8 with moduli 1e6 apart, and where a body ran away nothing of them does.
LEFT_ALONG = 1e-4


def load_on(motions: RigidMotions, f: Array) -> tuple[Array, float]:
    """Load on each free motion (k,), and the sum of the sizes of its parts, to judge it by [force]."""
    return motions.modes.T @ f, float(np.max(np.abs(motions.modes.T) @ np.abs(f), initial=0.0))


def drives(motions: RigidMotions, f: Array, free: Array, beyond: float = SOLVED) -> bool:
    """Return whether a load does work on some of these motions (k, j), beyond a share of its parts."""
    Q, size = load_on(motions, f)
    return bool(np.max(np.abs(free.T @ Q), initial=0.0) > beyond * size)


def escape(motions: RigidMotions, interface: Interface, paired: Mask, f: Array) -> Array | None:
    """A motion that the load drives and that no contact force can stop; None if there is none.

    Parameters
    ----------
    motions : RigidMotions
    interface : Interface
        Laws of the points. Bounds that do not follow from the normal force alone count as endless.
    paired : ndarray of bool, shape (m,)
        Points that may carry a force.
    f : ndarray, shape (n,)
        Load [force].

    Returns
    -------
    ndarray, shape (k,), or None
    """
    from scipy.optimize import linprog  # half of scipy's import time, for a rare question

    Q, size = load_on(motions, f)
    if size == 0.0:
        return None
    G = _cone(motions, interface, paired)
    one = np.eye(motions.k)
    cost = np.concatenate([np.zeros(G.shape[1]), np.ones(2 * motions.k)])
    found = linprog(
        cost,
        A_eq=np.hstack([G, one, -one]),
        b_eq=-Q / size,
        method="highs",
        options={"primal_feasibility_tolerance": SOLVED, "dual_feasibility_tolerance": SOLVED},
    )
    if found.status != 0 or found.fun <= SOLVED:
        return None
    c = -np.asarray(found.eqlin.marginals)
    proven = np.min(c @ G, initial=0.0) > -SOLVED and c @ Q > 0.5 * SOLVED * size
    return c if proven else None


def _cone(motions: RigidMotions, interface: Interface, paired: Mask) -> Array:
    """Forces on the free motions that contact points can give, as columns of length one, (k, g)."""
    grip = friction_coefficients(interface, len(paired))
    normal, tied = motions.normal, interface.tied & paired
    both_ways = interface.bilateral & paired
    columns = [normal[both_ways].T, -normal[both_ways].T]
    smooth = paired & ~tied & ~(grip > 0)
    endless = paired & ~tied & np.isinf(grip)
    columns += [normal[smooth].T, normal[endless].T]
    rough = paired & ~tied & (grip > 0) & np.isfinite(grip)
    if (tied | endless | rough).any():
        tangential = motions.tangential
        for k in range(tangential.shape[1]):
            both = tangential[tied | endless, k].T
            columns += [both, -both]
        for direction in _directions(tangential.shape[1]):
            along = np.einsum("ikj,k->ij", tangential[rough], direction)
            columns.append((normal[rough] + grip[rough, None] * along).T)
    G = np.concatenate(columns, axis=1)
    size = np.linalg.norm(G, axis=0)
    return np.asarray(G[:, size > 0] / size[size > 0])


def _directions(tangents: int) -> Sequence[Array]:
    if tangents == 1:
        return [np.array([1.0]), np.array([-1.0])]
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return list(np.column_stack([np.cos(angle), np.sin(angle)]) / np.cos(np.pi / DIRECTIONS))


def friction_coefficients(interface: Interface, m: int) -> Array:
    """Largest friction over normal force at every point: endless for laws with cohesion, (m,)."""
    grip = np.zeros(m)
    for contact, part in zip(interface.contacts, interface.point_slices, strict=True):
        law = contact.friction
        grip[part] = np.inf
        if isinstance(law, Coulomb) and type(law) is Coulomb and not np.any(law.cohesion):
            grip[part] = law.mu
        # along the axes of the rows, in which the ellipse is the circle of the larger coefficient
        if type(law) is OrthotropicCoulomb and not np.any(law.cohesion):
            grip[part] = law.larger
    return np.where(interface.frictional, grip, 0.0)


def balanced(
    motions: RigidMotions, f: Array, state: LocalState, noise: float, carried: float = 0.0
) -> bool:
    """Return whether loads and contact forces balance along the motions that supports leave free.

    A body that is hardly held may move by 1e10 of its size: then the round-off of its ``K u`` carries
    any load, equilibrium is met to all digits of that, and nothing balances the load. `noise` and
    `carried` are round-off of the forces in the softest and in the stiffest body that moves no further
    than supports do [force].
    """
    if motions.k == 0:
        return True
    force, friction = state.normal_force, state.tangential_force.ravel()  # zero at open points
    left = motions.normal.T.dot(force) + motions.modes.T.dot(f)
    rubs = bool(np.count_nonzero(friction))
    if rubs:
        left -= motions.tangential.reshape(-1, motions.k).T.dot(friction)
    left = np.abs(left)
    # along a motion that nothing pushes there is only the round-off of what acts across it; the largest
    # displacement of each motion is one. Nearly always the rest need not be looked at
    if left.max(initial=0.0) <= SOLVED * float(np.abs(force).sum()):
        return True
    parts = [(motions.normal, force), (motions.modes, f)]
    if rubs:
        parts.append((motions.tangential.reshape(-1, motions.k), friction))
    across = sum(float(np.abs(values).sum()) for _, values in parts)
    size = sum(np.abs(rows).T @ np.abs(values) for rows, values in parts)
    least = np.maximum(LEFT_ALONG * size, max(SOLVED * across, noise * len(f)))
    least = np.maximum(least, min(carried, SINGLE * across))
    return bool(np.all(left <= least))
