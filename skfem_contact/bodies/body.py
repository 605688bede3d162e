"""`Body`: basis, stiffness, load and prescribed DOFs of one body.

Together with `surface` and `io` this is the border with scikit-fem: behind it there are only NumPy
arrays and SciPy sparse matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from functools import cached_property
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from skfem.assembly import BilinearForm, CellBasis, LinearForm

from skfem_contact.arguments import check_name, known_keywords, with_known_keywords
from skfem_contact.arrays import Array
from skfem_contact.bodies.assembly import Moduli, mean_moduli, moduli, volume
from skfem_contact.bodies.equations import Gradients
from skfem_contact.bodies.inputs import (
    CONDENSED,
    Dofs,
    Loads,
    Values,
    assembled_stiffness,
    check_basis,
    check_unprescribed,
    deferred_basis,
    load_of,
    mass_of,
    prescribed_dofs,
    prescribed_values,
    several,
    stiffness_of,
)
from skfem_contact.bodies.member import Meshed, State, motion_names, rigid_modes
from skfem_contact.bodies.selection import displacements, pieces, tractions
from skfem_contact.bodies.surface import ContactSurface, extract_surface
from skfem_contact.errors import InputError, warn
from skfem_contact.materials.elastic import Elastic, OfMaterial
from skfem_contact.records import can_be_carried, carried, dataclass, seal, sealed

#: Bulk over shear modulus from which on elements may lock: a Poisson's ratio of .46, where four
#: elements of first order under a contact give forces that are 6 % larger, over true ones, than at .3.
STIFF_BULK = 12.0


@with_known_keywords(
    f". {CONDENSED}",
    stiffness="write K",
    load="write f",
    springs="add their matrix to K",
    density="write mass=density, or give it to the material",
)
@dataclass(frozen=True, eq=False, init=False)
class Body(Meshed):
    """One body: a scikit-fem basis with the linear system assembled on it.

    Two bodies that live in one mesh are one `Body`; contact is then between two of its surfaces.

    Parameters
    ----------
    basis : skfem.CellBasis
        Basis of an `ElementVector` of P1, P2, Q1, Q2 or S2 elements; of the scalar element itself
        for heat conduction and the like (tied contact only).
    K : sparse matrix, shape (n, n), or BilinearForm, or Elastic
        Stiffness [force/length], or a material. A form is assembled here, once, by the points of
        integration of `basis`: pass the form itself, which takes a small part of the time of
        ``form.assemble(basis)`` where it sees the gradients of u and v alone, as elasticity does. Of a
        matrix whose last digits are not symmetric the symmetric part is kept. Springs to the ground are
        added to it.
    f : ndarray, shape (n,), or LinearForm, or dict by boundary name, optional
        Load [force]; zero if not given. A form is integrated over the volume of `basis`. A dict
        gives tractions on boundaries, ``{"top": (0.0, -5.0)}``, in global axes [stress], or a
        pressure, ``{"bore": 5.0}``, which presses along the normals of the undeformed mesh, or a
        function of the component-first position that returns one of these,
        ``{"wall": lambda x: rho * g * (h - x[1])}``. A list of such loads is their sum.
    D : (list of) boundary names, dict by boundary name, ndarray, DofsView, or callable, optional
        Prescribed DOFs. A boundary name stands for all components, a dict names them,
        ``{"left": "x", "base": ("x", "z")}``. All that `skfem.condense` takes is taken, and a function
        of the basis that returns one of these.
    x : ndarray, shape (n,), or dict by boundary name, optional
        Prescribed values [length]; only the entries `D` are used. Zero if not given. A dict gives
        constant displacements of boundaries, ``{"top": (0.0, -0.01)}``, None for a component that
        is free there; `D` has to have the others.
    measure : callable, optional
        Weight of the area where `K` carries one, a function of the component-first position:
        ``lambda x: 2 * np.pi * x[0]`` for axisymmetric bodies, a thickness for plane ones. A
        thickness goes with the body: it is asked for at undeformed positions.
    mass : float, BilinearForm or sparse matrix, optional
        For `ContactSolver.modes`: the mass by volume, in the plane by area where `measure` is no
        thickness, or a form or matrix (n, n); by default the density of a material. `mass` of the body
        is the matrix, or None [mass].
    name : str, optional
        Name for reports and results.

    Attributes
    ----------
    K : csr_matrix, shape (n, n)
        The stiffness, assembled, symmetric [force/length].
    f : ndarray, shape (n,)
        The load, assembled [force].
    D : ndarray of int
        Sorted, without repetitions.
    x : ndarray, shape (n,)
        Zero where not prescribed.
    form : BilinearForm or None
        What `K` was assembled from, where it was one; the error estimate measures energy by it.
    material : Elastic or None
        What was given in the place of a stiffness.
    by_skfem : str
        Why scikit-fem assembled the form, function by function: it uses more than the gradients of
        u and v. Empty for other forms, whose stiffness is known from two calls of the form.

    Raises
    ------
    InputError
        Wrong element, shapes that belong to another basis, NaN or infinite numbers, unknown names, a
        stiffness that is not symmetric.

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity
    >>> basis = fem.Basis(fem.MeshQuad().with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    >>> body = Body(basis, linear_elasticity(), D="bottom", name="block")
    >>> body.n, body.dim, body.D.tolist()
    (8, 2, [0, 1, 2, 3])
    >>> bool(abs(body.K @ body.rigid_modes).max() < 1e-12)
    True
    """

    basis: Any
    K: csr_matrix
    f: Array
    D: NDArray[np.int64]
    x: Array
    measure: Callable[[Array], Array] | None
    name: str | None
    form: BilinearForm | None = field(init=False)
    by_skfem: str = field(init=False)
    material: Any = field(init=False)
    _stiffness: Stiffness = field(init=False, repr=False)
    _mass: Any = field(init=False, repr=False)

    def __init__(
        self,
        basis: CellBasis,
        K: Any,
        f: Loads | None = None,
        *,
        D: Dofs | None = None,
        x: Values | None = None,
        measure: Callable[[Array], Array] | None = None,
        mass: Any = None,
        name: str | None = None,
    ) -> None:
        whose = self._place(basis, measure, name)
        if mass is None:
            mass = getattr(K, "density", 0.0) or None
        # bodies that are not linear have set theirs
        vars(self).setdefault("material", K if isinstance(K, Elastic) else None)
        fixed = prescribed_dofs(D, basis, whose)
        stiffness = Stiffness.of(self._form(K), basis, fixed, whose)
        by_skfem = stiffness.by_skfem
        if by_skfem and measure is not None and isinstance(K, Elastic | OfMaterial):  # no user's form
            by_skfem = "the measure of the body is a function of the position"
        own = vars(self)
        own.update(K=stiffness.K, form=stiffness.form, by_skfem=by_skfem, D=fixed)
        own.update(_stiffness=stiffness, _mass=mass, f=self.load(f, f"f of {whose}"))
        own.update(thermal=self.apart(f, self.f), x=self.prescribed(x, D is None, whose))
        seal(self)

    def _place(self, basis: Any, measure: Any, name: Any) -> str:
        """Take what does not depend on the stiffness; return the body in words."""
        check_name(name, "name of a body")
        whose = f"body {name!r}" if name else "a body"
        check_basis(basis, whose)
        if measure is not None and not callable(measure):
            raise InputError(
                f"measure of {whose} is a {type(measure).__name__}, not a function of position; "
                f"for a constant thickness pass measure=lambda x: {measure!r} + 0 * x[0]"
            )
        vars(self).update(basis=basis, measure=measure, name=name)
        return whose

    @classmethod
    @known_keywords(stiffness="write K", load="write f", springs="add their matrix to K")
    def from_mesh(
        cls,
        mesh: skfem.Mesh,
        element: skfem.Element,
        K: Any,
        f: Loads | None = None,
        *,
        D: Dofs | None = None,
        x: Values | None = None,
        intorder: int | None = None,
        measure: Callable[[Array], Array] | None = None,
        mass: Any = None,
        name: str | None = None,
    ) -> Body:
        """Make a body without shape functions at points of integration, which fill the memory.

        A `skfem.Basis` of linear hexahedra takes 18 kB for each of them, a multiple of the stiffness.
        Here its numbering alone is made; `basis` evaluates the shape functions when they are asked for.

        Parameters
        ----------
        mesh : skfem.Mesh
        element : skfem.Element
            As for `skfem.Basis`: ``ElementVector(ElementHex1())``.
        K, f, D, x, measure, mass, name
            As for `Body`. A form that uses more than the gradients of u and v, and a load that is a
            form, are integrated some elements at a time.
        intorder : int, optional
            Degree of the polynomials that are integrated exactly. If it is not given, that of products
            of two shape functions: 2 for linear elements, 4 for quadratic ones.

        Returns
        -------
        Body

        Raises
        ------
        InputError
            As of `Body`, and if the mesh and the element do not belong together.

        Examples
        --------
        >>> import skfem as fem
        >>> from skfem.models.elasticity import linear_elasticity
        >>> mesh = fem.MeshHex().refined(2).with_defaults()
        >>> element = fem.ElementVector(fem.ElementHex1())
        >>> weight = fem.LinearForm(lambda v, w: -1e-3 * v[2])
        >>> cube = Body.from_mesh(mesh, element, linear_elasticity(), weight, D="bottom", name="cube")
        >>> cube
        <Body cube: 375 DOFs, 75 prescribed, MeshHex1 of 64 elements>
        >>> float(cube.f.sum().round(12))
        -0.001
        """
        return cls(
            deferred_basis(mesh, element, intorder, f"body {name!r}" if name else "a body"),
            K,
            f,
            D=D,
            x=x,
            measure=measure,
            mass=mass,
            name=name,
        )

    @cached_property
    def mass(self) -> csr_matrix | None:
        """Mass (n, n), or None if the body has none [mass]."""
        if self._mass is None:
            return None
        return mass_of(self._mass, self.basis, self.measure, f"body {self.name or 'without name'!r}")

    def stress(self, u: Array, state: State | None = None) -> Array:
        """Stress (3, 3, e, q) of a body with a material, at points of integration [stress].

        Of displacements u (n,); that of a temperature is not in it.
        """
        if not isinstance(self.material, Elastic):
            raise InputError(
                f"body {self.name!r} keeps no material that would tell its stress: give "
                "sc.Elastic(E, nu) in the place of its stiffness, or use sc.nodal_stress"
            )
        gradients = Gradients(self.basis, self.measure, self.axisymmetric, f"body {self.name!r}")
        return self.material.stress(gradients.of(u))

    def stiffness(self, K: Any, what: str) -> csr_matrix:
        """The stiffness (n, n) that a user means: a matrix, a form, or an elastic material."""
        return stiffness_of(self._form(K), self.basis, what)

    def _form(self, K: Any) -> Any:
        """The form of an elastic material on this body; anything else as it is."""
        if isinstance(K, Elastic):
            K = K.form()
        return K.on(self.measure, self.axisymmetric) if isinstance(K, OfMaterial) else K

    def load(self, f: Any, what: str) -> Array:
        """The load (n,) that a user means: a vector, a form, or tractions by boundary name."""
        if several(f):
            return np.sum([self.load(part, what) for part in f], axis=0)
        if isinstance(f, Mapping):
            return tractions(f, self.basis, self.measure, what)
        if isinstance(f, LinearForm) and not isinstance(f, OfMaterial):
            self._warned_of_weight  # noqa: B018  # once
        return load_of(self._form(f), self.basis, what)

    @cached_property
    def _warned_of_weight(self) -> None:
        """Say that a form of the user's own has no weight, where the stiffness of a material has."""
        if self.measure is not None and self.material is not None:
            warn(
                f"body {self.name or 'without name'!r} has a measure that weighs its stiffness, "
                "tractions and steel.weight(...); f is a LinearForm, which is integrated as it stands. "
                "Multiply it by the measure of w.x unless it has that already, and pass what "
                "it gives, f=form.assemble(basis), which is taken without a word"
            )

    def apart(self, f: Any, load: Array) -> Array | None:
        if several(f):
            found = [self.apart(part, self.load(part, f"f of body {self.name!r}")) for part in f]
            known = [part for part in found if part is not None]
            return np.sum(known, axis=0) if known else None
        if not isinstance(f, OfMaterial) or f.holding is None:
            return None
        x = np.asarray(self.basis.mapping.F(self.basis.X, self.basis.tind))
        return np.concatenate([load, np.ravel(np.broadcast_to(f.holding(x), x.shape[1:]))])

    def prescribed(self, x: Any, no_D: bool, whose: str) -> Array:
        """Values (n,) of the prescribed DOFs that a user means: a vector, or by boundary name."""
        if isinstance(x, Mapping):
            return self.displaced(x, np.zeros(self.n), f"x of {whose}")
        return prescribed_values(x, self.D, no_D, self.basis, whose)

    def displaced(self, x: Mapping[str, Any], before: Array, what: str) -> Array:
        """Prescribed values (n,) with those on some boundaries replaced, see `displacements`."""
        return displacements(x, before, self.basis, self.dof_component, self.D, what)

    def __getstate__(self) -> dict[str, Any]:
        known = dict(vars(self))
        known.pop("dof_points", None)  # of the basis
        if self.measure is not None and self.components > 1:
            known["axisymmetric"] = self.axisymmetric  # what depends on it is told without it
        known["measure"] = carried(self.measure, f"measure of body {self.name or 'without name'!r}")
        known["moduli"], known["mass"], known["_mass"] = self.moduli, self.mass, None
        known["form"] = self.form if can_be_carried(self.form) else None  # K is what it gave
        del known["_stiffness"]
        return known

    def __setstate__(self, known: dict[str, Any]) -> None:
        vars(self).update(known)
        shared = Stiffness(self.K, self.basis, self.form, self.by_skfem).remembered()
        object.__setattr__(self, "_stiffness", shared)
        seal(self)

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} {self.name or '(no name)'}: {self.n} DOFs, "
            f"{len(self.D)} prescribed, "
            f"{type(self.basis.mesh).__name__} of {self.basis.mesh.nelements} elements>"
        )

    @cached_property
    def n(self) -> int:
        """Number of DOFs."""
        return int(self.basis.N)

    @cached_property
    def dim(self) -> int:
        """Dimension of space."""
        return int(self.basis.mesh.dim())

    @cached_property
    def components(self) -> int:
        """DOFs per node: `dim` for displacements, 1 for a scalar field."""
        return self.dim if isinstance(self.basis.elem, skfem.ElementVector) else 1

    @cached_property
    def dof_points(self) -> Array:
        """Position of every DOF, shape (n, d)."""
        return sealed(np.array(self.basis.doflocs.T, dtype=float, order="C"))

    @cached_property
    def dof_component(self) -> NDArray[Any]:
        """Component (0 for x) that every DOF stands for, shape (n,)."""
        component = np.zeros(self.n, dtype=np.int32)
        dofs = self.basis.dofs
        for rows in (dofs.nodal_dofs, dofs.edge_dofs, dofs.facet_dofs, dofs.interior_dofs):
            component[rows] = (np.arange(rows.shape[0]) % self.components)[:, None]
        return component

    @cached_property
    def moduli(self) -> Moduli | None:
        """Bulk and shear modulus of the material of every element; None if nothing tells them.

        Of a stiffness that was given as a matrix they are the means over the body.
        """
        if self.components == 1:
            return None
        if self.form is not None:
            return moduli(self.form, self.basis, self._stiffness.tensor)
        if self.axisymmetric:
            return None
        return mean_moduli(self.K, self.dof_points, self.dof_component, volume(self.basis))

    def energy_density(self, u: Any, w: Any) -> Array:
        """Twice the energy of a displacement by volume, with the body's measure if its form has it.

        Parameters
        ----------
        u : skfem.DiscreteField
            At points of integration.
        w : skfem's parameters of a form there
        """
        A = self._stiffness.tensor
        if A is not None:  # what the form was when the body was made
            slope = np.asarray(u.grad)
            slope = slope.reshape(len(A), A.shape[1], *slope.shape[-2:])
            return np.einsum("cj...,cjek,ek...->...", slope, A, slope, optimize=True)
        assert self.form is not None
        return np.asarray(self.form.form(u, u, w))

    @cached_property
    def parts(self) -> NDArray[Any]:
        """Number of the connected part of the mesh that every DOF belongs to, shape (n,)."""
        return pieces(self.basis.dofs.element_dofs, self.n)

    @cached_property
    def rigid_modes(self) -> Array:
        """Motions without strain, shape (n, 3) in 2-D and (n, 6) in 3-D, for each part of the mesh.

        Translations of unit length, then rotations about the centroid of the nodes, divided by the
        largest lever arm so that no entry exceeds one whatever the unit of length. A scalar field
        has the constant, shape (n, 1); an axisymmetric body the translation along its axis, (n, 1).
        A mesh of several pieces has the modes of the first, then those of the second, ...
        """
        return rigid_modes(
            self.dof_points, self.dof_component, self.components, self.axisymmetric, self.parts
        )

    @property
    def rigid_mode_names(self) -> tuple[str, ...]:
        """The motions of `rigid_modes` in words."""
        names = motion_names(self.dim, self.components, self.axisymmetric)
        count = int(self.parts.max()) + 1
        if count == 1:
            return names
        return tuple(f"{name} of part {i + 1}" for i in range(count) for name in names)

    @known_keywords()
    def surface(self, where: Any, nodes: bool = False, *, name: str | None = None) -> ContactSurface:
        """Part of the boundary that may come into contact.

        Parameters
        ----------
        where : str, callable, int, ndarray, or list, tuple or set of these
            What `skfem.Mesh.normalize_facets` takes, intersected with the boundary of the mesh: a
            boundary name, a function of the component-first position of the facet midpoints, facet
            numbers.
        nodes : bool, optional
            A callable selects the facets all of whose mesh nodes satisfy it (circles: the midpoint
            of a chord is not on the circle), instead of the midpoints.
        name : str, optional
            Name for reports; the boundary name or the name of the function if not given.

        Returns
        -------
        ContactSurface
            A curve of a plane body, faces of a solid.

        Raises
        ------
        InputError
            Nothing selected, unknown names (the message lists those known), degenerate facets.
        """
        return extract_surface(self, where, nodes=nodes, name=name)


@dataclass(frozen=True, eq=False)
class Stiffness:
    """A checked stiffness, what it was assembled from, and why by scikit-fem where it was."""

    K: csr_matrix
    basis: Any
    form: BilinearForm | None
    by_skfem: str = ""
    tensor: NDArray[np.float64] | None = None

    @classmethod
    def of(cls, K: Any, basis: Any, D: NDArray[np.int64], whose: str) -> Stiffness:
        """Say that of the body whose `K` this is, as in dataclasses.replace, or a new one.

        `D` are the prescribed DOFs.
        """
        known = _KNOWN.get(id(K))
        if known is not None and known.K is K and known.basis is basis:
            return known
        form = K if isinstance(K, BilinearForm) else None
        matrix, made = assembled_stiffness(K, basis, whose)
        if made is None:
            check_unprescribed(matrix, D, whose)
            return cls(matrix, basis, form).remembered()
        return cls(matrix, basis, form, made.by_skfem, made.tensor).remembered()

    def remembered(self) -> Stiffness:
        """Itself, from now on found by its matrix as long as a body has it."""
        _KNOWN[id(self.K)] = self
        return self


_KNOWN: WeakValueDictionary[int, Stiffness] = WeakValueDictionary()


def may_lock(body: Body) -> bool:
    """Return whether some material of a body hardly changes its volume, as far as that is known."""
    return body.moduli is not None and body.moduli.quotient > STIFF_BULK


def body_nodes(body: Body) -> NDArray[np.int64]:
    """DOFs of each node of a body, shape (nodes, components).

    Vertices first, then edges, facets and interiors: the numbering of the DOFs of the scalar
    element, so nodal values of `skfem.Basis.project` go with it.
    """
    dofs, c = body.basis.dofs, body.components
    parts = (dofs.nodal_dofs, dofs.edge_dofs, dofs.facet_dofs, dofs.interior_dofs)
    # one node per entity: all supported elements have at most that
    table = [np.asarray(part).T for part in parts if np.asarray(part).shape[0] == c]
    return np.concatenate(table).astype(np.int64)
