"""`System`: several bodies under one numbering of their DOFs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import field
from functools import cached_property

import numpy as np
from scipy.sparse import block_diag, csr_matrix, diags

from skfem_contact import arguments
from skfem_contact.arguments import suggest
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.inputs import csr32
from skfem_contact.bodies.member import Member, check_whole
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass, sealed, sealed_matrix


@dataclass(frozen=True, eq=False)
class System:
    """Several bodies under one numbering: the DOFs of the first, then those of the second, ...

    In the numbering of a system all DOFs are lengths and all loads forces: rotations of rigid bodies
    are counted as displacements at the distance `extent`, see `scale`.

    Attributes
    ----------
    bodies : tuple of Body or RigidBody
    names : tuple of str
        A body without a name is "body 1", "body 2", ... after its position.
    offsets : ndarray of int, shape (number of bodies + 1,)
        Body `i` has the DOFs ``offsets[i]`` to ``offsets[i + 1]``.
    slides : dict
        Of bodies with bolts, by their number: motions (n_body, j) besides the rigid ones that the
        stiffness does not resist while a bolt has a given force, and their names.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> def square(y, **settings):
    ...     mesh = fem.MeshQuad().refined(1).translated((0, y)).with_defaults()
    ...     basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    ...     return sc.Body(basis, linear_elasticity(), **settings)
    >>> low = square(0, D="bottom", name="low")
    >>> high = square(1, D="top", x={"top": (0, 0.01)}, name="high")
    >>> system = sc.bodies.stack([low, high])
    >>> system.K.shape, len(system.D), system.names
    ((36, 36), 12, ('low', 'high'))
    """

    bodies: tuple[Member, ...]
    names: tuple[str, ...]
    offsets: np.ndarray
    slides: dict[int, tuple[np.ndarray, tuple[str, ...]]] = field(default_factory=dict)

    def modes(self, body: Member | int) -> np.ndarray:
        """Motions (n_body, k) that the stiffness of a body may leave free: rigid ones, and `slides`."""
        i = body if isinstance(body, int) else self.index(body)
        rigid = self.bodies[i].rigid_modes
        return np.column_stack([rigid, self.slides[i][0]]) if i in self.slides else rigid

    def mode_names(self, body: Member | int) -> tuple[str, ...]:
        """The motions of `modes` in words."""
        i = body if isinstance(body, int) else self.index(body)
        return self.bodies[i].rigid_mode_names + (self.slides[i][1] if i in self.slides else ())

    @cached_property
    def spans(self) -> list[slice]:
        """The DOFs of each body."""
        return slices(self.offsets)

    @cached_property
    def n(self) -> int:
        """Number of DOFs of all bodies."""
        return int(self.offsets[-1])

    @cached_property
    def K(self) -> csr_matrix:
        """Block diagonal stiffness, shape (n, n) [force/length]."""
        stiffness = self.linearize()[0]
        check_whole(stiffness, "System.K needs all of it")
        return sealed_matrix(csr32(block_diag(stiffness, format="csr")))

    @cached_property
    def f(self) -> np.ndarray:
        """Load, shape (n,) [force]."""
        return sealed(np.concatenate([body.f / self.scale(body) for body in self.bodies]))

    def linearize(self) -> tuple[list[csr_matrix], np.ndarray]:
        """Stiffness of each undeformed body and the loads on all, (n,), less what strains them already.

        Of bodies that are not linear the loads from outside: their internal force is asked for later.
        """
        answers = [body.linearize() for body in self.bodies]
        pairs = list(zip(self.bodies, answers, strict=True))
        K = [self.scaled(body, answer.K) for body, answer in pairs]
        f = [
            (body.f if body.nonlinear else body.f - answer.internal) / self.scale(body)
            for body, answer in pairs
        ]
        return K, sealed(np.concatenate(f))

    def scale(self, body: Member | str) -> np.ndarray | float:
        """Return the factor of a body's displacements in the numbering of the system: 1 as a rule.

        Shape (n_body,) of a rigid body, whose rotations become lengths. Loads are divided by it.
        """
        own = self.bodies[self.index(body)]
        if not len(own.rotations):
            return 1.0
        out = np.ones(own.n)
        out[own.rotations] = self.extent
        return sealed(out)

    def scaled(self, body: Member | str, K: csr_matrix) -> csr_matrix:
        """The stiffness of a body in the numbering of the system, see `scale`."""
        scale = self.scale(body)
        if isinstance(scale, float):
            return K
        return sealed_matrix(csr32(diags(1 / scale) @ K @ diags(1 / scale)))

    @cached_property
    def units(self) -> np.ndarray | float:
        """The scales of all bodies, shape (n,); 1.0 where there is no rigid body."""
        if not any(len(body.rotations) for body in self.bodies):
            return 1.0
        parts = [np.broadcast_to(self.scale(body), body.n) for body in self.bodies]
        return sealed(np.concatenate(parts))

    @cached_property
    def D(self) -> np.ndarray:
        """Prescribed DOFs in the stacked numbering, sorted."""
        parts = [body.D + start for body, start in zip(self.bodies, self.offsets, strict=False)]
        return sealed(np.concatenate(parts))

    @cached_property
    def supports(self) -> list[slice]:
        """The places of the prescribed DOFs of each body in `D`."""
        return slices(np.cumsum([0, *(len(body.D) for body in self.bodies)]))

    @cached_property
    def x(self) -> np.ndarray:
        """Prescribed values, shape (n,); zero where not prescribed [length]."""
        return sealed(np.concatenate([body.x * self.scale(body) for body in self.bodies]))

    @cached_property
    def solids(self) -> dict[str, Body]:
        """The bodies that have a mesh, by name."""
        named = zip(self.names, self.bodies, strict=True)
        return {name: body for name, body in named if isinstance(body, Body)}

    @cached_property
    def extent(self) -> float:
        """Largest extent of a mesh along an axis: the scale to judge lengths by [length]."""
        return max(float(np.ptp(body.basis.mesh.p, axis=1).max()) for body in self.solids.values())

    def index(self, body: Member | str) -> int:
        """Position of a body, given by itself or by its name."""
        if isinstance(body, str):
            if body in self.names:
                return self.names.index(body)
            raise InputError(f"there is no body {body!r}{suggest(body, self.names, 'bodies')}")
        for position, mine in enumerate(self.bodies):
            if mine is body:
                return position
        raise InputError(
            f"{body!r} is not one of the stacked bodies ({', '.join(self.names)}); a surface "
            "belongs to the very Body object it was taken from, a contact to the very rigid body: pass "
            "that object in `bodies`"
        )

    def slice(self, body: Member | str) -> slice:
        """DOFs of a body, given by itself or by its name."""
        i = self.index(body)
        return slice(int(self.offsets[i]), int(self.offsets[i + 1]))


def slices(offsets: np.ndarray) -> list[slice]:
    """From each number to the next.

    >>> slices(np.array([0, 2, 5]))
    [slice(0, 2, None), slice(2, 5, None)]
    """
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(offsets)]


def stack(bodies: Member | Sequence[Member]) -> System:
    """Number the DOFs of several bodies one after the other.

    Parameters
    ----------
    bodies : sequence of Body or RigidBody
        A missing name is numbered.

    Returns
    -------
    System

    Raises
    ------
    InputError
        No body, a body or a name given twice, bodies of different dimension, rigid ones alone.

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity
    >>> basis = fem.Basis(fem.MeshTri(), fem.ElementVector(fem.ElementTriP1()))
    >>> system = stack(
    ...     [Body(basis, linear_elasticity(), name="punch"), Body(basis, linear_elasticity())]
    ... )
    >>> system.names, system.n, system.slice("body 2")
    (('punch', 'body 2'), 16, slice(8, 16, None))
    """
    usage = "make each by Body(basis, K, ...) or RigidBody(obstacle, ...)"
    members = tuple(arguments.members(bodies, Member, "bodies", usage, "Body"))
    if not any(isinstance(body, Body) for body in members):
        raise InputError(
            "there are no bodies to stack: give at least one Body"
            + (", that has a mesh; rigid bodies touch no rigid bodies" if members else "")
        )
    for i, body in enumerate(members):
        if any(body is other for other in members[:i]):
            raise InputError(f"{body!r} is given twice; two equal bodies need two Body objects")
    names = arguments.names_of(members, "body", "bodies")
    if len({body.dim for body in members}) > 1:
        found = ", ".join(f"{n!r} {b.dim}-D" for n, b in zip(names, members, strict=True))
        raise InputError(f"bodies of different dimension can not touch: {found}")
    _check_motions(members, names)
    sizes = np.array([body.n for body in members], dtype=np.int64)
    return System(members, names, np.concatenate([[0], np.cumsum(sizes)]))


def _check_motions(members: Sequence[Member], names: Sequence[str]) -> None:
    """Refuse rigid bodies whose motions the others do not have."""
    solids = [body for body in members if isinstance(body, Body)]
    for body, name in zip(members, names, strict=True):
        if isinstance(body, Body):
            continue
        if any(solid.components == 1 for solid in solids):
            raise InputError(f"rigid body {name!r} moves, and bodies with a scalar field do not")
        off_axis = np.flatnonzero(body.dof_component != 1)
        if any(s.axisymmetric for s in solids) and not np.isin(off_axis, body.D).all():
            raise InputError(
                f"rigid body {name!r} is among axisymmetric bodies, and so moves along their axis "
                "alone: hold the rest by D=('x', 'rotation')"
            )
