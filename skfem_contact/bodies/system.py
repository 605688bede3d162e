"""`System`: several bodies under one numbering of their DOFs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import block_diag, csr_matrix

from skfem_contact import arguments
from skfem_contact.arguments import suggest
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.inputs import csr32
from skfem_contact.bodies.linearizable import Linearizable
from skfem_contact.errors import InputError
from skfem_contact.sealed import sealed, sealed_matrix


@dataclass(frozen=True, eq=False)
class System:
    """Several bodies under one numbering: the DOFs of the first, then those of the second, ...

    Attributes
    ----------
    bodies : tuple of Body
    names : tuple of str
        A body without a name is "body 1", "body 2", ... after its position.
    offsets : ndarray of int, shape (number of bodies + 1,)
        Body `i` has the DOFs ``offsets[i]`` to ``offsets[i + 1]``.
    """

    bodies: tuple[Body, ...]
    names: tuple[str, ...]
    offsets: np.ndarray

    @property
    def n(self) -> int:
        """Number of DOFs of all bodies."""
        return int(self.offsets[-1])

    @cached_property
    def K(self) -> csr_matrix:
        """Block diagonal stiffness, shape (n, n) [force/length]."""
        return sealed_matrix(csr32(block_diag([body.K for body in self.bodies], format="csr")))

    @cached_property
    def f(self) -> np.ndarray:
        """Load, shape (n,) [force]."""
        return sealed(np.concatenate([body.f for body in self.bodies]))

    def linearize(self) -> tuple[list[csr_matrix], np.ndarray]:
        """Stiffness of each body and the load of all, (n,), near the undeformed state."""
        bodies: tuple[Linearizable, ...] = self.bodies
        equations = [body.linearize() for body in bodies]
        return [K for K, _ in equations], sealed(np.concatenate([f for _, f in equations]))

    @cached_property
    def D(self) -> np.ndarray:
        """Prescribed DOFs in the stacked numbering, sorted."""
        parts = [body.D + start for body, start in zip(self.bodies, self.offsets, strict=False)]
        return sealed(np.concatenate(parts))

    @cached_property
    def supports(self) -> list[slice]:
        """Where the prescribed DOFs of each body are in `D`."""
        return slices(np.cumsum([0, *(len(body.D) for body in self.bodies)]))

    @cached_property
    def x(self) -> np.ndarray:
        """Prescribed values, shape (n,); zero where not prescribed [length]."""
        return sealed(np.concatenate([body.x for body in self.bodies]))

    @cached_property
    def extent(self) -> float:
        """Largest extent of a body along an axis: the scale to judge lengths by [length]."""
        return max(float(np.ptp(body.basis.mesh.p, axis=1).max()) for body in self.bodies)

    def index(self, body: Body | str) -> int:
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
            "belongs to the very Body object it was taken from: pass that object in `bodies`"
        )

    def slice(self, body: Body | str) -> slice:
        """DOFs of a body, given by itself or by its name."""
        i = self.index(body)
        return slice(int(self.offsets[i]), int(self.offsets[i + 1]))


def slices(offsets: np.ndarray) -> list[slice]:
    """From each number to the next.

    >>> slices(np.array([0, 2, 5]))
    [slice(0, 2, None), slice(2, 5, None)]
    """
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(offsets)]


def stack(bodies: Body | Sequence[Body]) -> System:
    """Number the DOFs of several bodies one after the other.

    Parameters
    ----------
    bodies : sequence of Body
        A missing name is numbered.

    Returns
    -------
    System

    Raises
    ------
    InputError
        No body, a body or a name given twice, bodies of different dimension.

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
    members = tuple(arguments.members(bodies, Body, "bodies", "make each by Body(basis, K, ...)"))
    if not members:
        raise InputError("there are no bodies to stack: give at least one Body")
    for i, body in enumerate(members):
        if any(body is other for other in members[:i]):
            raise InputError(f"{body!r} is given twice; two equal bodies need two Body objects")
    names = tuple(body.name or f"body {i + 1}" for i, body in enumerate(members))
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise InputError(
            f"several bodies are named {', '.join(map(repr, repeated))}; give each its own `name`"
        )
    if len({body.dim for body in members}) > 1:
        found = ", ".join(f"{n!r} {b.dim}-D" for n, b in zip(names, members, strict=True))
        raise InputError(f"bodies of different dimension can not touch: {found}")
    sizes = np.array([body.n for body in members], dtype=np.int64)
    return System(members, names, np.concatenate([[0], np.cumsum(sizes)]))
