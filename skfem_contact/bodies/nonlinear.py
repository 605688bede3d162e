"""`NonlinearBody`: a body whose internal forces are not proportional to its displacements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from skfem import ElementTetP1, ElementTriP1
from skfem.assembly import BilinearForm, CellBasis, LinearForm

from skfem_contact.arguments import check_switch, numbers, shown, with_known_keywords
from skfem_contact.arrays import Array, check_finite
from skfem_contact.bodies.assembly import LINEAR, boundary_basis, scalar_element
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.equations import Continuum, Differentiated, Forms, Gradients, scattered
from skfem_contact.bodies.inputs import Dofs, Loads, Values, check_points, dof_values, several
from skfem_contact.bodies.member import Linearized, State
from skfem_contact.bodies.selection import boundary_dofs, check_not_lost
from skfem_contact.errors import InputError, warn
from skfem_contact.materials.elastic import OfMaterial
from skfem_contact.materials.material import FromFunction, Material, Split, deformation, solid
from skfem_contact.records import dataclass

#: Elements of first order that the mean change of volume does not help: theirs is constant.
SIMPLICES = ElementTriP1, ElementTetP1


@with_known_keywords(
    load="write f",
    K="NonlinearBody has a material, or forms",
    form="write residual",
    density="write mass=density, or give it to the material",
)
@dataclass(frozen=True, eq=False, init=False, repr=False)
class NonlinearBody(Body):
    """A body that yields or strains by large amounts.

    Its equations come from a material; or from a residual and a tangent; or from an energy, or a
    residual alone, which JAX differentiates.

    Parameters
    ----------
    basis : skfem.CellBasis
        Basis of an `ElementVector`, as for `Body`.
    material : Material or callable
        `J2`, `MooneyRivlin` or another of `skfem_contact.materials`; or a function
        ``(H, state) -> stress, tangent, state`` of small strains without internal variables, see
        `skfem_contact.materials.FromFunction` for others. Plane bodies are in plane strain.
    f, D, x, name
        As for `Body`. A number on a boundary, ``{"bore": 5.0}``, is the pressure of a fluid, or a
        function of the component-first position of the facets' midpoints that returns it: where strains
        may be large it acts at right angles to the deformed boundary, by deformed area.
    measure : callable, optional
        Weight of the area, as for `Body`: with ``lambda x: 2 * np.pi * x[0]`` the body is
        axisymmetric, and its material gets the hoop strain. Forms have their weight in themselves.
    residual : LinearForm or callable
        Work of the internal forces on v, with the displacements ``w["u"]``. Without a `tangent` a
        function of u, v and w.
    tangent : BilinearForm
        The derivative of `residual`, symmetric.
    state, initial : callable and dict
        Internal variables of forms: a function of w that returns their new values by name, arrays
        (..., e, q), from ``w["u"]`` and the values at the beginning of the step, ``w["prev"].name``;
        and their first values at a point.
    energy : callable
        Energy by volume, a function of u and w.
    finite_strain : bool, optional
        Whether a body that is given by forms may turn and strain by any amount: contact is then on the
        deformed mesh. Materials know it.
    pressures : ndarray, shape (facets of the mesh,), optional
        Those of fluids in f, as the attribute has them, where f is a vector [stress].
    mean_dilatation : bool, optional
        Whether the change of volume is the mean of the element. If it is not given: for elements of
        first order of `J2` and `MooneyRivlin`, which would lock.

    Attributes
    ----------
    K : csr_matrix, shape (n, n)
        The tangent of the undeformed body.
    material : Material or None
        None of a body that is given by forms.
    mean_dilatation : bool
    pressures : ndarray or None
        Of fluids, by facet; their load on the undeformed boundary is part of `f` [stress].
    nonlinear : bool
        True.

    Raises
    ------
    InputError
        As of `Body`; stress, tangent or internal variables of other shapes, a tangent that is not
        symmetric; JAX is not installed.

    Notes
    -----
    Mean dilatation is that of Simo, Taylor and Pister (1985), with small strains B-bar: quadrilaterals
    and hexahedra of first order then bend and flow without changing volume. On triangles and
    tetrahedra of first order it does nothing, and they lock, with a warning: take second order.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> mesh = fem.MeshQuad().with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> steel = sc.J2(210e3, 0.3, [(250, 0), (300, 0.01)])
    >>> billet = sc.NonlinearBody(basis, steel, D="bottom", name="billet")
    >>> u = 0.01 * basis.doflocs[0]
    >>> K, internal, state = billet.linearize(u)
    >>> state["equivalent_plastic_strain"].shape, billet.stress(u, state).shape
    ((1, 4), (3, 3, 1, 4))
    """

    nonlinear: ClassVar[bool] = True  # type: ignore[misc]
    K: csr_matrix = field(init=False)
    material: Material | None = None
    mean_dilatation: bool = False
    pressures: Array | None = None
    equations: Any = field(init=False)

    def __init__(
        self,
        basis: CellBasis,
        material: Material | Callable[..., Any] | None = None,
        f: Loads | None = None,
        *,
        residual: LinearForm | Callable[..., Any] | None = None,
        tangent: BilinearForm | None = None,
        state: Callable[..., Any] | None = None,
        initial: Mapping[str, ArrayLike] | None = None,
        energy: Callable[..., Any] | None = None,
        finite_strain: bool = False,
        D: Dofs | None = None,
        x: Values | None = None,
        measure: Callable[[Array], Array] | None = None,
        mean_dilatation: bool | None = None,
        pressures: Array | None = None,
        mass: Any = None,
        name: str | None = None,
    ) -> None:
        whose = self._place(basis, measure, name)
        if self.components == 1:
            raise InputError(f"{whose} is a scalar problem: NonlinearBody has displacements")
        check_points(basis, f"the internal force of {whose}")
        check_switch(finite_strain, "finite_strain")
        if sum(part is not None for part in (material, residual, energy)) != 1:
            raise InputError(f"{whose} needs one of: a material, residual= (with tangent=), or energy=")
        equations: Any
        if material is not None:
            if any(part is not None for part in (tangent, state, initial)) or finite_strain:
                raise InputError(
                    f"tangent, state, initial and finite_strain of {whose} belong to a residual; a "
                    "material has its own, see skfem_contact.materials.FromFunction"
                )
            equations = self._continuum(material, mean_dilatation, whose)
        elif energy is not None or (tangent is None and not isinstance(residual, LinearForm)):
            equations = Differentiated(basis, energy, residual, finite_strain, whose)
        else:
            equations = Forms(basis, residual, tangent, state, initial, finite_strain, whose)
        own = "material", "mean_dilatation", "finite_strain"
        vars(self).update({name: getattr(equations, name) for name in own}, equations=equations)
        K = equations.linearize(np.zeros(self.n), equations.initial_state).K
        mass = (getattr(material, "density", 0.0) or None) if mass is None else mass
        super().__init__(basis, K, f, D=D, x=x, measure=measure, mass=mass, name=name)
        followed = self.finite_strain and (isinstance(f, Mapping) or several(f))
        vars(self)["pressures"] = self.thermal if followed else pressures

    def _continuum(self, material: Any, mean_dilatation: bool | None, whose: str) -> Continuum:
        """Equations from a material."""
        if not isinstance(material, Material):
            material = FromFunction(material)
        element = scalar_element(self.basis.elem)
        if material.mean_dilatation and isinstance(element, SIMPLICES):
            kind = type(element).__name__
            warn(
                f"{whose}: {kind} can not keep its volume, as {type(material).__name__} has to, and "
                "locks: forces may be several times too large. Take elements of second order, or "
                "quadrilaterals and hexahedra"
            )
        if mean_dilatation is None:
            mean_dilatation = material.mean_dilatation and isinstance(element, LINEAR)
        check_switch(mean_dilatation, "mean_dilatation")
        if mean_dilatation and not isinstance(material, Split):
            raise InputError(
                f"mean_dilatation of {whose}: {type(material).__name__} does not tell the change of "
                "volume from the rest; derive it from skfem_contact.materials.Split"
            )
        gradients = Gradients(self.basis, self.measure, self.axisymmetric, whose)
        return Continuum(material, gradients, mean_dilatation, whose)

    @property
    def initial_state(self) -> State:
        """Internal variables of the undeformed body, arrays (..., e, q) by name."""
        return dict(self.equations.initial_state)

    def linearize(self, u: Array | None = None, state: State | None = None) -> Linearized:
        """Tangent, internal forces and internal variables at displacements u, see `Member`."""
        return self.equations.linearize(self._displacements(u), self._state(state))

    def energy(self, u: ArrayLike, state: State | None = None) -> tuple[float, float]:
        """Energy that is stored, and that was dissipated until now, of internal variables after a step.

        Raises
        ------
        InputError
            If what the body is given by does not tell its energy.
        """
        return self._asked("energy", u, state)

    def stress(self, u: ArrayLike, state: State | None = None) -> Array:
        """Cauchy's stress at points of integration.

        Parameters
        ----------
        u : ndarray, shape (n,)
            Displacements of this body [length].
        state : dict of ndarray, optional
            Internal variables that go with u; those of the virgin material if not given.

        Returns
        -------
        ndarray, shape (3, 3, e, q)
            The third axis is the thickness, or the hoop direction [stress].

        Raises
        ------
        InputError
            If the body is given by forms, which do not tell stresses.
        """
        return np.asarray(self._asked("stress", u, state))

    def _asked(self, what: str, u: ArrayLike, state: State | None) -> Any:
        if not hasattr(self.equations, what):
            raise InputError(f"body {self.name!r} is given by forms: its {what} is not known")
        return getattr(self.equations, what)(self._displacements(u), self._state(state))

    def load(self, f: Any, what: str) -> Array:
        """The load (n,) that a user means; of a fluid as it is on the undeformed boundary."""
        if not isinstance(f, Mapping):
            return super().load(f, what)
        varying = {name: value for name, value in f.items() if self.finite_strain and callable(value)}
        load = super().load({name: f[name] for name in f if name not in varying}, what)
        for name, value in varying.items():
            boundary_dofs(self.basis, name, what)
            check_not_lost([value], self.basis, name, f"{what} on boundary {name!r}")
        pressures = self.fluid(varying)
        return load if pressures is None else load + self.pressed(pressures)[0]

    def apart(self, f: Any, load: Array) -> Array | None:
        if several(f) or not self.finite_strain:
            return super().apart(f, load)
        if isinstance(f, OfMaterial) and f.holding is not None:
            warn(
                f"body {self.name!r} may strain by large amounts, and the load of a temperature is "
                "that of small strains: stresses of the body have its strains in them"
            )
        return self.fluid(f)

    def fluid(self, f: Any) -> Array | None:
        """Pressures of fluids on all facets of the mesh (k,), of a load by boundary name [stress]."""
        if not self.finite_strain or not isinstance(f, Mapping):
            return None
        mesh = self.basis.mesh
        pressures = np.zeros(mesh.nfacets)
        for name, value in f.items():
            if callable(value) or np.ndim(value) == 0:
                facets = np.asarray(mesh.boundaries[name])
                middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
                pressures[facets] += _pressure(value, middle, name) if callable(value) else value
        check_finite(pressures, "a pressure", "facet")
        return pressures if pressures.any() else None

    def pressed(self, pressures: Array, u: ArrayLike | None = None) -> tuple[Array, csr_matrix]:
        """The load of fluids on the boundary as it stands at displacements u, and its derivative by u.

        Parameters
        ----------
        pressures : ndarray, shape (facets of the mesh,)
            By deformed area, positive inwards [stress].
        u : ndarray, shape (n,), optional
            Displacements of this body [length].

        Returns
        -------
        load : ndarray, shape (n,)
        derivative : csr_matrix, shape (n, n)
            Symmetric but for the rim of the pressed surface.

        Notes
        -----
        By Nanson's formula the deformed area with its normal is ``J F^-T N dA``.

        Examples
        --------
        >>> import skfem as fem
        >>> import skfem_contact as sc
        >>> basis = fem.Basis(fem.MeshQuad().with_defaults(), fem.ElementVector(fem.ElementQuad1()))
        >>> seal = sc.NonlinearBody(basis, sc.materials.NeoHooke.of(1.0, 0.3))
        >>> longer = 0.5 * basis.doflocs[1] * (seal.dof_component == 1)  # by a half along y
        >>> load, _ = seal.pressed(seal.fluid({"left": 2.0}), longer)
        >>> float(load[seal.dof_component == 0].sum())
        3.0
        """
        if not pressures.any():  # a load that was taken back
            return np.zeros(self.n), csr_matrix((self.n, self.n))
        on, d = boundary_basis(self.basis, np.flatnonzero(pressures)), self.dim
        weight, x = on.dx * pressures[on.find][:, None], np.asarray(on.global_coordinates())
        if self.measure is not None:
            weight = weight * self.measure(x)
        v = np.stack([np.asarray(on.basis[a][0]) for a in range(on.Nbfun)])  # (a, d, facets, q)
        dH = np.stack([solid(np.asarray(on.basis[a][0].grad)) for a in range(on.Nbfun)])
        if self.axisymmetric:
            dH[:, 2, 2] = v[:, 0] / x[0]
        H = np.einsum("af,aij...fq->ij...fq", self._displacements(u)[on.element_dofs], dH)
        _, J, G = deformation(H)
        normal = np.einsum("ij...,j...->i...", G[:, :d], np.asarray(on.normals))
        load = -np.einsum("aifq,ifq->af", v, weight * J * normal[:d])
        grows = np.einsum("ij...,bij...->b...", G, dH)[:, None] * normal
        turns = np.einsum("ij...,bkj...,k...->bi...", G, dH, normal, optimize=True)
        slope = -np.einsum("aifq,bifq->abf", v, weight * J * (grows - turns)[:, :d], optimize=True)
        rows, columns = np.broadcast_arrays(on.element_dofs[:, None], on.element_dofs)
        K = csr_matrix((slope.ravel(), (rows.ravel(), columns.ravel())), shape=(self.n, self.n))
        return scattered(load, on), K

    def _displacements(self, u: Any) -> Array:
        what = "u, which has to be as result.displacement(body),"
        return np.zeros(self.n) if u is None else dof_values(u, self.basis, what)

    def _state(self, state: State | None) -> State:
        """Internal variables by name, in the order of the initial ones."""
        known = self.equations.initial_state
        if state is None:
            return known
        if not isinstance(state, Mapping) or set(state) != set(known):
            raise InputError(
                f"state of body {self.name!r} is {shown(state)}, not a dict of {sorted(known)}"
            )
        return {key: state[key] for key in known}


def _pressure(function: Callable[[Array], Any], x: Array, name: str) -> Array:
    """What a user's function says of the pressure at positions x (d, k) of a boundary, checked."""
    what = f"what the pressure on boundary {name!r} returned"
    usage = "it must return one number for each position (for tractions assemble a vector)"
    found = numbers(function(x), what, usage)
    if found.shape not in ((), x.shape[1:]):
        raise InputError(f"{what} has shape {found.shape} for positions of shape {x.shape}; {usage}")
    return found
