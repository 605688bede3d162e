"""`RigidBody`: an obstacle with the DOFs of its motion, under force and moment control."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix, issparse, sparray, spmatrix

from skfem_contact.arguments import (
    check_kind,
    check_name,
    finite,
    number,
    numbers,
    shown,
    suggest,
    with_known_keywords,
)
from skfem_contact.arrays import Array
from skfem_contact.bodies.inputs import csr32
from skfem_contact.bodies.member import Member, motion_names
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import MotionLike, Obstacle
from skfem_contact.records import dataclass, seal, sealed, sealed_matrix


@with_known_keywords(f="write force and moment", motion="write D and x", load="write force and moment")
@dataclass(frozen=True, eq=False, init=False, repr=False)
class RigidBody(Member, Obstacle):
    """A rigid tool that moves by its loads and contacts: a die under a force, a roller, a lever.

    An obstacle with the DOFs of its motion, 3 in the plane (``x``, ``y``, ``rotation``) and 6 in space
    (``x``, ``y``, ``z``, ``rotation x``, ``rotation y``, ``rotation z``): the translation of the point
    `about` [length], and the rotation about it [rad]. It is one of the bodies of the solver, and the
    primary side of its contacts::

        die = sc.RigidBody(sc.RigidCylinder((0, 1), 1.0), force=(0, -5e3), D=("x", "rotation"))
        solver = sc.ContactSolver([block, die], [sc.Contact(block.surface("top"), die)])

    Parameters
    ----------
    obstacle : obstacle
        Its shape.
    force : array, shape (d,), optional
        Load at `about`, fixed in space, and carried along by the motion [force].
    moment : float, or array (3,) in 3-D, optional
        Counterclockwise, or about the axes [force length].
    about : array, shape (d,), optional
        The point; by default the centre of a round obstacle, or the point of a plane.
    D : (tuple of) names of DOFs, or their numbers, optional
        Motions that are prescribed; a rigid body is free in the others.
    x : dict by name of DOF, or array (3,) or (6,), optional
        Their values; zero if not given [length, rad].
    K : array (3,) or (3, 3), (6,) or (6, 6), optional
        Springs of its supports, to the ground: stiffness of every DOF, or a symmetric matrix
        [force/length], [force length/rad].
    mass : array (3,) or (3, 3), (6,) or (6, 6), optional
        For `ContactSolver.modes`: mass for translations and moments of inertia about `about` for
        rotations, or the symmetric matrix of both where `about` is not the centre of mass. `mass` of
        the rigid body is the matrix, or None [mass], [mass length^2].
    name : str, optional
        That of the obstacle if not given.

    Attributes
    ----------
    f, x : ndarray, shape (n,)
        Loads (force and moment), prescribed values.

    Raises
    ------
    InputError
        What is no obstacle, shapes, unknown DOFs, stiffness that is not symmetric or negative.

    Notes
    -----
    In load steps its loads and prescribed motions are named by DOF,
    ``{"f": {"die": {"y": -5e3}}, "x": {"die": {"rotation": 0.1}}}``, and what is not named stays as it
    was; or given as vectors. Where it is after a step says ``result.motion("die")``.

    With ``sliding="small"`` points move by ``v + w x r`` with the arms `r` of the undeformed place:
    right for small rotations. With ``sliding="finite"`` the obstacle is turned by the whole angle.

    Examples
    --------
    A roller pressed upon a block by a force of one:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> basis = fem.Basis(
    ...     fem.MeshQuad().refined(3).with_defaults(), fem.ElementVector(fem.ElementQuad1())
    ... )
    >>> block = sc.Body(basis, linear_elasticity(0.0, 50.0), D="bottom", name="block")
    >>> shape = sc.RigidCylinder((0.5, 2.0), 1.0)
    >>> roller = sc.RigidBody(shape, force=(0, -1), D=("x", "rotation"), name="roller")
    >>> result = sc.ContactSolver([block, roller], [sc.Contact(block.surface("top"), roller)]).solve()
    >>> (result.force_on_primary.round(12) + 0.0).tolist()
    [0.0, 1.0]
    >>> translation, angle, centre = result.motion("roller")
    >>> bool(-0.03 < translation[1] < -0.01), angle
    (True, 0.0)
    """

    obstacle: Obstacle
    f: Array
    about: Array
    D: NDArray[np.int64]
    x: Array
    K: csr_matrix
    mass: csr_matrix | None
    name: str | None

    def __init__(
        self,
        obstacle: Obstacle,
        *,
        force: ArrayLike | None = None,
        moment: ArrayLike | None = None,
        about: ArrayLike | None = None,
        D: str | int | Iterable[str | int] | None = None,
        x: ArrayLike | Mapping[str, float] | None = None,
        K: ArrayLike | sparray | spmatrix | None = None,
        mass: ArrayLike | None = None,
        name: str | None = None,
    ) -> None:
        check_name(name, "name of a RigidBody")
        usage = "give its shape, such as RigidCylinder((0, 1), 1.0)"
        check_kind(obstacle, Obstacle, "obstacle of a RigidBody", usage)
        if isinstance(obstacle, RigidBody):
            raise InputError(f"obstacle of a RigidBody is {obstacle!r}; {usage}")
        name = name or obstacle.name
        vars(self).update(
            obstacle=obstacle, name=name, about=about_of(about, obstacle, self._whose(name))
        )
        whose = self._whose(name)
        load = np.zeros(self.n)
        load[: self.dim] = vector_of(force, self.dim, f"force of {whose}")
        turns = self.n - self.dim
        if moment is not None:
            given = moment if turns > 1 else [number(moment, f"moment of {whose}", "give one number")]
            load[self.dim :] = vector_of(given, turns, f"moment of {whose}")
        vars(self).update(
            f=load,
            D=held_dofs(D, self.directions, f"D of {whose}"),
            K=self.stiffness(K, f"K of {whose}"),
            mass=None if mass is None else definite(mass, self.n, f"mass of {whose}"),
        )
        vars(self).update(x=self._prescribed(x, f"x of {whose}"))
        seal(self)

    def __setstate__(self, known: dict[str, Any]) -> None:
        vars(self).update(known)
        seal(self)

    @staticmethod
    def _whose(name: str | None) -> str:
        return f"rigid body {name!r}" if name else "a rigid body"

    def __repr__(self) -> str:
        free = [word for i, word in enumerate(self.directions) if i not in self.D]
        return f"<RigidBody {self.name or '(no name)'}: {self.obstacle!r}, free: {', '.join(free)}>"

    @property
    def label(self) -> str:
        """Name for messages."""
        return self.name or "rigid body"

    # -- an obstacle ----------------------------------------------------------------------------

    def moved(self, motion: MotionLike) -> Obstacle:
        """The obstacle after a rigid motion, see `Obstacle.moved`."""
        return self.obstacle.moved(motion)

    @property
    def outline(self) -> ContactSurface | None:
        """The edges of its obstacle where it was made, see `Obstacle.outline`."""
        return self.obstacle.outline

    @property
    def bend(self) -> Array | None:
        """The curvature of its obstacle, see `Obstacle.bend`."""
        return self.obstacle.bend

    def distance(self, surface: ContactSurface) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Signed distances, normals and partners where it was made, see `Obstacle.distance`."""
        return self.obstacle.distance(surface)

    def motion(self, u: Array) -> tuple[Array, Any, Array]:
        """Its displacements (n,) as a motion of the obstacle: translation, angle, centre."""
        turn = u[self.dim :]
        return np.array(u[: self.dim]), float(turn[0]) if len(turn) == 1 else turn, self.about

    # -- a body ---------------------------------------------------------------------------------

    @property
    def directions(self) -> tuple[str, ...]:
        """Names of its DOFs."""
        return DIRECTIONS[self.dim]

    @property
    def n(self) -> int:
        """Number of DOFs: 3 or 6."""
        return len(self.directions)

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return len(self.about)

    @property
    def components(self) -> int:
        """Components of a displacement."""
        return self.dim

    @property
    def dof_points(self) -> Array:
        """The point `about`, for every DOF, shape (n, d)."""
        return np.tile(self.about, (self.n, 1))

    @property
    def dof_component(self) -> Array:
        """Components of the translation, then rotations, shape (n,)."""
        return np.arange(self.n, dtype=np.int32)

    @property
    def rigid_modes(self) -> Array:
        """All that it can do, shape (n, n)."""
        return np.eye(self.n)

    @property
    def rigid_mode_names(self) -> tuple[str, ...]:
        """The motions in words."""
        return motion_names(self.dim, self.components)

    def stiffness(self, K: Any, what: str) -> csr_matrix:
        """Springs (n, n) that a user means: a stiffness for every DOF, a matrix, or none."""
        return definite(np.zeros(self.n) if K is None else K, self.n, what)

    def load(self, f: Any, what: str) -> Array:
        """The load (n,) that a user means: forces and moments by name of DOF, or all of them."""
        if f is None:
            return np.zeros(self.n)
        if not isinstance(f, Mapping):
            return vector_of(f, self.n, what)
        return self.displaced(f, np.zeros(self.n), what)

    def displaced(self, x: Mapping[str, Any], before: Array, what: str) -> Array:
        """Values (n,) with those of some DOFs replaced, by name."""
        out = np.array(before)
        for i, (name, value) in zip(self.numbers(x, what), x.items(), strict=True):
            out[i] = number(value, f"{what}: {name!r}", "give one number")
        if not np.isfinite(out).all():
            raise InputError(f"{what} is {shown(dict(x))}, which is not finite")
        return out

    def _prescribed(self, x: Any, what: str) -> Array:
        if x is None:
            return np.zeros(self.n)
        given = self.load(x, what)
        self.check_held(self.numbers(x, what) if isinstance(x, Mapping) else self.D, what)
        return np.where(np.isin(np.arange(self.n), self.D), given, 0.0)

    def numbers(self, named: Mapping[str, Any], what: str) -> list[int]:
        """Numbers of the DOFs that a dict names."""
        return [dof_number(name, self.directions, what) for name in named]

    def check_held(self, dofs: Iterable[int], what: str) -> None:
        """Refuse values of DOFs that are not prescribed."""
        free = [self.directions[i] for i in dofs if i not in self.D]
        if free or not len(self.D):
            listed = f"{', '.join(map(repr, free))} " if free else ""
            raise InputError(
                f"{what} prescribes values {listed}that D does not have: name these DOFs in "
                "D=(...) of the RigidBody, or give it a force"
            )


def shape_of(tool: Obstacle) -> Obstacle:
    """The obstacle that a rigid body is made of; any other itself."""
    return tool.obstacle if isinstance(tool, RigidBody) else tool


#: Names of the DOFs, by the dimension of space.
DIRECTIONS = {2: ("x", "y", "rotation"), 3: ("x", "y", "z", "rotation x", "rotation y", "rotation z")}


def held_dofs(D: Any, directions: tuple[str, ...], what: str) -> np.ndarray:
    """Sorted numbers of the DOFs that a user means by names or numbers."""
    if D is None:
        return np.zeros(0, dtype=np.int64)
    try:
        given = [D] if isinstance(D, str) or np.ndim(D) == 0 else list(D)
    except (TypeError, ValueError):
        raise InputError(f"{what} is {shown(D)}; give names of DOFs") from None
    return np.array(sorted({dof_number(entry, directions, what) for entry in given}), dtype=np.int64)


def dof_number(entry: Any, directions: tuple[str, ...], what: str) -> int:
    """The DOF that a user means by its name or number."""
    if isinstance(entry, str):
        if entry not in directions:
            raise InputError(f"{what}: {entry!r} is none{suggest(entry, directions, 'DOFs')}")
        return directions.index(entry)
    if (
        not isinstance(entry, int | np.integer)
        or isinstance(entry, bool)
        or not 0 <= entry < len(directions)
    ):
        known = ", ".join(map(repr, directions))
        raise InputError(f"{what} is {shown(entry)}, no DOF of a rigid body; it has {known}")
    return int(entry)


def definite(K: Any, n: int, what: str) -> csr_matrix:
    """Springs or a mass (n, n) that a user means: a number for every DOF, or a matrix."""
    usage = f"give {n} numbers, or a symmetric ({n}, {n}) matrix"
    given = numbers(K.toarray() if issparse(K) else K, what, usage)
    matrix = np.diag(given) if given.shape == (n,) else given
    if matrix.shape != (n, n) or not np.isfinite(matrix).all():
        raise InputError(f"{what} has shape {given.shape}, or is not finite; {usage}")
    # each entry against the two springs that it couples: forces and moments have other units
    diagonal = np.diag(matrix)
    scale = np.sqrt(np.abs(np.outer(diagonal, diagonal)))
    if np.any(np.abs(matrix - matrix.T) > GIVEN * scale):
        raise InputError(f"{what} is not symmetric; {usage}")
    root = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    if np.linalg.eigvalsh(matrix / np.outer(root, root))[0] < -GIVEN:
        raise InputError(f"{what} is negative along some motion: springs and masses are >= 0")
    return sealed_matrix(csr32(csr_matrix(0.5 * (matrix + matrix.T))))


def about_of(about: Any, obstacle: Obstacle, whose: str) -> np.ndarray:
    """The point (d,) that a user means, or that of the obstacle itself [length]."""
    if about is None:
        about = obstacle.reference
    if about is None:
        raise InputError(
            f"{whose} needs the point that its force acts at and its rotation is counted about: "
            f"{obstacle.label!r} has no centre of its own, give about=(...)"
        )
    point = finite(about, (2, 3), f"about of {whose}", "2 or 3 finite coordinates")
    own = obstacle.reference
    if own is not None and len(own) != len(point):
        raise InputError(f"about of {whose} is {shown(about)}, but its obstacle is {len(own)}-D")
    return sealed(point)


def vector_of(value: Any, size: int, what: str) -> np.ndarray:
    """A vector of this size that a user means; zero where not given."""
    if value is None:
        return np.zeros(size)
    return finite(value, (size,), what, f"{size} finite numbers")
