"""Fields of bodies for pictures and files: stresses, what materials remember, and units.

Fields are those that users ask for, one or several: numbers, vectors or tensors. Units are the user's
own words, since the library has none. The solver needs none of this.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from functools import cached_property
from typing import Any, Literal
from weakref import WeakKeyDictionary

import numpy as np
import skfem
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix
from skfem.assembly import BilinearForm

from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import check_kind, known_keywords, numbers, shown, suggest
from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body, body_nodes
from skfem_contact.bodies.inputs import SUPPORTED
from skfem_contact.bodies.member import Member
from skfem_contact.digits import ROUND_OFF
from skfem_contact.errors import InputError
from skfem_contact.materials.elastic import Elastic
from skfem_contact.records import dataclass, sealed

PLANES = ("strain", "stress", "axisymmetric")

Stress = Callable[[Body, Array], Array] | str
#: What a picture shows: one field, or one under a name of the user's.
OneStress = Stress | Mapping[str, Stress]

KINDS = ("length", "force", "stress", "area", "energy", "time")
UNITS = "give a dict such as {'length': 'mm', 'force': 'N', 'stress': 'MPa'}"
USAGE = (
    "give the name of a field that materials know, such as 'von_mises', or a function (body, u) -> "
    "values at the nodes, or a dict of them by name"
)
#: Components of a symmetric tensor, in the order of VTK.
SIX = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
#: Nodes of a tetrahedron whose first two corners change places.
MIRRORED = (1, 0, 2, 3, 4, 6, 5, 8, 7, 9)


def displaced(result: ContactResult, u: Any) -> ContactResult:
    """The result with other displacements (n,), such as a shape of vibration, to be shown."""
    if u is None:
        return result
    values = numbers(u, "u", "give displacements (n,) of all bodies")
    if values.shape != (result.system.n,):
        raise InputError(
            f"u has shape {values.shape}, not ({result.system.n},): displacements of all bodies"
        )
    answer = copy(answer_of(result))
    vars(answer)["u"] = sealed(values)
    return ContactResult(answer)


def body_cells(body: Body) -> tuple[str, NDArray[np.int64]]:
    """The type of cell in the words of meshio, and the nodes of each cell, (elements, nodes).

    Without nodes of the element that the cell does not have.
    """
    element = body.basis.elem
    inner = element.elem if isinstance(element, skfem.ElementVector) else element
    kind = next(name for cls, name in SUPPORTED.items() if isinstance(inner, cls))
    node = np.zeros(body.n, dtype=np.int64)
    nodes = body_nodes(body)
    node[nodes] = np.arange(len(nodes))[:, None]
    cells = node[body.basis.dofs.element_dofs[:: body.components]]
    cells = cells[: int("".join(filter(str.isdigit, kind)) or len(cells))]
    if kind.startswith("hexahedron"):  # scikit-fem counts the corners of a brick in another order
        from skfem.io.meshio import HEX_MAPPING  # which imports meshio

        cells = cells[HEX_MAPPING[: len(cells)]]
    if kind.startswith("tetra"):  # scikit-fem has them of either orientation, readers of files of one
        a, b, c, d = body.dof_points[nodes[cells[:4], 0]]
        inside_out = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
        cells[:, inside_out] = cells[np.array(MIRRORED[: len(cells)])][:, inside_out]
    return kind, cells.T


def three(vectors: Array) -> Array:
    """Vectors with three components, as VTK wants them, shape (m, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def field_name(field: Any) -> str:
    """Return the name of a field in files and pictures: its own, or that of its function.

    >>> from functools import partial
    >>> from skfem_contact import von_mises
    >>> field_name(von_mises), field_name(partial(von_mises, E=1.0, nu=0.3)), field_name(lambda b, u: u)
    ('von_mises', 'von_mises', 'stress')
    """
    if isinstance(field, str):
        return field
    name = getattr(getattr(field, "func", field), "__name__", "<lambda>")
    return "stress" if name == "<lambda>" else str(name)


def asked(stress: Any) -> dict[str, Stress]:
    """Functions, or names that materials know, by the names of their fields.

    >>> asked({"sigma": lambda body, u: u}).keys(), asked(["stress"]), asked(None)
    (dict_keys(['sigma']), {'stress': 'stress'}, {})
    """
    if stress is None:
        return {}
    if isinstance(stress, Mapping):
        named = [(name, function) for name, function in stress.items()]
    elif callable(stress) or isinstance(stress, str) or not isinstance(stress, Iterable):
        named = [(field_name(stress), stress)]
    else:
        named = [(field_name(function), function) for function in stress]
    for name, function in named:
        if not (callable(function) or isinstance(function, str)) or not isinstance(name, str):
            raise InputError(f"stress has {shown(function)} for {shown(name)}; {USAGE}")
    if len(dict(named)) < len(named):
        raise InputError("two fields have the same name: give stress={'name': function, ...}")
    return dict(named)


def checked_field(values: Any, count: int, body: str) -> Array:
    """Values of a body's nodes: numbers (nodes,), vectors (nodes, 2 or 3), tensors (nodes, 3, 3)."""
    array = numbers(values, f"what stress(body, u) returned for body {body!r}", "see von_mises")
    if array.shape[:1] != (count,) or array.shape[1:] not in ((), (2,), (3,), (3, 3)):
        raise InputError(
            f"stress(body, u) returned shape {array.shape} for body {body!r}, which has {count} "
            "nodes. It has to return a number for each node, as skfem_contact.von_mises does, a vector "
            "(nodes, 2 or 3), or a tensor (nodes, 3, 3), as nodal_stress does."
        )
    return array


def as_columns(values: Array) -> Array:
    """Arrange values as files have them: one number, three of a vector, or six of a tensor."""
    if values.ndim == 3:
        return np.stack([values[:, i, j] for i, j in SIX.values()], axis=1)
    return three(values) if values.ndim == 2 else values


def component(values: Array, which: str | None, name: str) -> Array:
    """One number per node for a picture, of a tensor or a vector the component `which`.

    >>> component(np.eye(3)[None] * 2.0, "yy", "sigma")
    array([2.])
    """
    if values.ndim == 1:
        if which is not None:
            raise InputError(f"component={which!r}: {name!r} is one number per node, and has none")
        return values
    names = {**SIX, **{k[::-1]: v for k, v in SIX.items()}}
    known: dict[str, Any] = names if values.ndim == 3 else dict(zip("xyz", range(3), strict=True))
    if which not in known or (values.ndim == 2 and known[which] >= values.shape[1]):
        listed = ", ".join(map(repr, SIX if values.ndim == 3 else "xyz"[: values.shape[1]]))
        raise InputError(f"component={which!r} of {name!r}: a picture shows one of {listed}")
    index = (slice(None), *np.atleast_1d(known[which]))
    return values[index]


def checked_units(units: Mapping[str, str] | None) -> dict[str, str]:
    """Units by kind of quantity, as users give them.

    >>> checked_units({"lenght": "mm"})
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: units has no kind 'lenght'; did you mean 'length'? Known kinds: ...
    """
    if units is None:
        return {}
    if not isinstance(units, Mapping):
        raise InputError(f"units is {shown(units)}; {UNITS}")
    for kind, unit in units.items():
        if kind not in KINDS:
            raise InputError(f"units has no kind {kind!r}{suggest(kind, KINDS, 'kinds')}")
        if not isinstance(unit, str):
            raise InputError(f"units[{kind!r}] is {shown(unit)}, which is no word; {UNITS}")
    return dict(units)


def labelled(words: str, kind: str, units: Mapping[str, str]) -> str:
    """A label with its unit, where there is one.

    >>> labelled("pressure", "stress", {"stress": "MPa"}), labelled("x", "length", {})
    ('pressure [MPa]', 'x')
    """
    return f"{words} [{units[kind]}]" if units.get(kind) else words


def quantity(value: float, kind: str, units: Mapping[str, str]) -> str:
    """A number in words with its unit.

    >>> quantity(104.73, "stress", {"stress": "MPa"}), quantity(1363.2, "stress", {})
    ('105 MPa', '1360')
    """
    return f"{float(f'{value:.3g}'):g} {units.get(kind, '')}".strip()


@known_keywords()
def nodal_stress(
    body: Body,
    u: ArrayLike,
    *,
    E: float,
    nu: float,
    plane: Literal["strain", "stress", "axisymmetric"] | None = None,
) -> Array:
    r"""Stress tensor at the nodes of a homogeneous isotropic body, by projection.

    Parameters
    ----------
    body : Body
    u : ndarray, shape (n,)
        Displacement of this body [length].
    E, nu : float
        Young's modulus [stress] and Poisson's ratio.
    plane : {"strain", "stress", "axisymmetric"}, optional
        What the third direction does in 2-D; not used in 3-D. By default "axisymmetric" of bodies with
        such a `measure`, else "strain". Axisymmetric: r and z are the first and the second coordinate.

    Returns
    -------
    ndarray, shape (nodes, 3, 3)
        The third axis is the thickness, or the hoop direction [stress]. The nodes are those of the
        scalar element, in the order of its DOFs.

    Raises
    ------
    InputError
        If `plane` is unknown, `u` has another size, E or nu are none, or the body is a scalar problem.

    Notes
    -----
    ``sigma = lambda tr(eps) 1 + 2 mu eps``, in plane stress with ``eps_zz = -nu/(1 - nu)
    (eps_xx + eps_yy)``; strains are projected in L2 on the continuous finite elements
    (`Projection`).
    The first stress of a body takes as long as its assembly; the next ones take a tenth of that.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> stress = sc.nodal_stress(block, result.displacement("block"), E=2.5, nu=0.25)
    >>> stress.shape == (mesh.nvertices, 3, 3)
    True
    """
    check_kind(body, Body, "body", "stresses are those of bodies with a mesh")
    if plane is None:
        plane = "axisymmetric" if body.axisymmetric else "strain"
    if not isinstance(plane, str) or plane not in PLANES:
        raise InputError(f"plane = {shown(plane)} is not one of {PLANES}.")
    if body.components == 1:
        raise InputError(f"body {body.name!r} is a scalar problem: it has no stress tensor.")
    material = Elastic(E, nu)
    values = numbers(u, "u", "take result.displacement(body)")
    if values.shape != (body.n,):
        raise InputError(
            f"u has shape {values.shape}, but body {body.name!r} has {body.n} DOFs; take "
            "result.displacement(body), not result.u."
        )
    projection, nodal = Projection.of(body), values[body_nodes(body)]
    gradient, d = projection.gradient(nodal), body.dim
    strain = np.zeros((len(nodal), 3, 3))
    strain[:, :d, :d] = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
    if d == 2 and plane == "stress":
        strain[:, 2, 2] = material.nu / (material.nu - 1.0) * (strain[:, 0, 0] + strain[:, 1, 1])
    if d == 2 and plane == "axisymmetric":
        strain[:, 2, 2] = projection.over_radius(nodal[:, 0])
    return np.ascontiguousarray(np.moveaxis(material.hooke(np.moveaxis(strain, 0, -1)), -1, 0))


@known_keywords()
def von_mises(
    body: Body,
    u: ArrayLike,
    *,
    E: float,
    nu: float,
    plane: Literal["strain", "stress", "axisymmetric"] | None = None,
) -> Array:
    """Von Mises stress at the nodes, shape (nodes,) [stress]; parameters as in `nodal_stress`.

    Examples
    --------
    A bar in tension: the stress is the modulus times the strain.

    >>> import numpy as np
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> basis = fem.Basis(fem.MeshQuad(), fem.ElementVector(fem.ElementQuad1()))
    >>> bar = sc.Body(basis, linear_elasticity())
    >>> u = (
    ...     np.where(bar.dof_component == 0, 0.01, -0.003)
    ...     * basis.doflocs[bar.dof_component, np.arange(bar.n)]
    ... )
    >>> von_mises(bar, u, E=200.0, nu=0.3, plane="stress").round(9)
    array([2., 2., 2., 2.])
    """
    return _mises(nodal_stress(body, u, E=E, nu=nu, plane=plane))


def _mises(stress: Array) -> Array:
    mean = np.trace(stress, axis1=1, axis2=2) / 3.0
    deviator = stress - mean[:, None, None] * np.eye(3)
    return np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2)))


@known_keywords()
def nodal_field(result: ContactResult, body: Member | str, field: str) -> Array:
    """Return what the material of a body knows, at its nodes: its stress, or an internal variable.

    Parameters
    ----------
    result : ContactResult
    body : Body or str
    field : str
        "stress", Cauchy's tensor; "von_mises", its norm; or the name of an internal variable, such as
        "equivalent_plastic_strain" of `J2`.

    Returns
    -------
    ndarray, shape (nodes,) or (nodes, 3, 3)
        The nodes are those of the scalar element, in the order of its DOFs.

    Raises
    ------
    InputError
        The body has no such field: stresses are known of bodies with a material.

    Notes
    -----
    Values at points of integration are projected in L2 on the continuous finite elements, as those of
    `nodal_stress`. Where a field is steep a projection passes its bounds a little; numbers that are
    nowhere negative stay so.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> billet = sc.NonlinearBody(basis, sc.J2(1000.0, 0.3, 1.0), D="top", name="billet")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(billet.surface("bottom"), floor)
    >>> result = sc.ContactSolver(billet, foot).solve(x={"billet": {"top": (0.0, -0.01)}})
    >>> bool(sc.output.nodal_field(result, billet, "equivalent_plastic_strain").max() > 0.005)
    True
    >>> sc.output.nodal_field(result, billet, "plastic_strain").shape
    (25, 3, 3)
    """
    check_kind(result, ContactResult, "result", "what a solver returns")
    i = result.system.index(body)
    own: Any = result.system.bodies[i]
    name, known = result.system.names[i], _known(result, body)
    if field not in known:
        words = suggest(field, known, "fields") if known else f"; {NO_MATERIAL}"
        raise InputError(f"body {name!r} has no field {shown(field)}{words}")
    values = result.stress(body) if field in STRESSES else result.state[name][field]
    nodal = Projection.of(own).of_points(own.basis, values)
    if np.min(values) >= 0.0:
        nodal = np.maximum(nodal, 0.0)
    return _mises(nodal) if field == "von_mises" else nodal


STRESSES = "stress", "von_mises"
NO_MATERIAL = (
    "it keeps no material: give sc.Elastic(E, nu) in the place of a stiffness, or a function "
    "(body, u), such as one that calls von_mises"
)


def _known(result: ContactResult, body: Any) -> tuple[str, ...]:
    """Names of the fields that the material of a body knows."""
    i = result.system.index(body)
    material = getattr(result.system.bodies[i], "material", None)
    return (*(STRESSES if material is not None else ()), *result.state.get(result.system.names[i], ()))


def field_values(result: ContactResult, body: Body, field: Stress) -> Array:
    """Values at the nodes of a body, of a function or by name; NaN where another body has the field."""
    index, nodes = result.system.index(body), len(body_nodes(body))
    if callable(field):
        return checked_field(field(body, result.stretched(body)), nodes, result.system.names[index])
    others = [b for b in result.system.solids.values() if field in _known(result, b)]
    if body in others or not others:
        return checked_field(nodal_field(result, body, field), nodes, result.system.names[index])
    return np.full((nodes, *nodal_field(result, others[0], field).shape[1:]), np.nan)


#: Products with the mass matrix that a projection may take: well-shaped cells need 60 at most.
PRODUCTS = 400


@dataclass(frozen=True, eq=False)
class Projection:
    r"""Derivatives of displacements at the nodes, by projection in L2 on the continuous elements.

    Of a scalar field the projection solves ``M g = G_k u`` with

        M_ij = ∫ N_i N_j,     G_k,ij = ∫ N_i ∂_k N_j,     H_ij = ∫ N_i N_j / r,

    integrated by the quadrature of the body's basis: what `skfem.CellBasis.project` gives. The
    matrices are those of the mesh alone, assembled once, whatever is asked of the body later.

    M is solved with by conjugate gradients, preconditioned by its diagonal: the condition is then
    bounded by a number that depends on the element and not on the mesh (Wathen 1987), so some 20 to 60
    products reach round-off, and nothing has to be factorised.

    Attributes
    ----------
    scalar : skfem.CellBasis
        The scalar element on the same mesh.
    """

    scalar: Any

    @classmethod
    def of(cls, body: Body) -> Projection:
        """Return the values of a body; bodies on one basis share them."""
        basis = body.basis
        if basis not in _KNOWN:
            scalar = basis.with_element(basis.elem.elem)
            if scalar.X.shape[1] < scalar.Nbfun:  # too few points to tell the functions apart
                scalar = skfem.Basis(basis.mesh, basis.elem.elem, mapping=basis.mapping)
            _KNOWN[basis] = cls(scalar)
        return _KNOWN[basis]

    def gradient(self, values: Array) -> Array:
        """Derivatives (nodes, c, d) of fields with values (nodes, c) at the nodes."""
        right = np.concatenate([G @ values for G in self._gradients], axis=1)
        along = self._solved(right).reshape(len(values), -1, values.shape[1])
        return np.swapaxes(along, 1, 2)

    def of_points(self, basis: Any, values: Array) -> Array:
        """The projection (nodes, ...) of values (..., e, q) at the points of integration of a basis."""
        own = basis.with_element(basis.elem.elem)
        flat = np.reshape(values, (-1, *np.shape(values)[-2:]))
        right = np.zeros((own.N, len(flat)))
        for dofs, shape in zip(own.element_dofs, own.basis, strict=True):
            np.add.at(right, dofs, np.einsum("keq,eq->ek", flat, np.asarray(shape[0]) * own.dx))
        return self._solved(right).reshape(own.N, *np.shape(values)[:-2])

    def over_radius(self, values: Array) -> Array:
        """The quotient (nodes,) of a field (nodes,) and the first coordinate."""
        return self._solved((self._by_radius @ values)[:, None])[:, 0]

    @cached_property
    def _mass(self) -> csr_matrix:
        return BilinearForm(lambda u, v, w: u * v).assemble(self.scalar)

    @cached_property
    def _gradients(self) -> list[csr_matrix]:
        forms = [lambda u, v, w, k=k: u.grad[k] * v for k in range(self.scalar.mesh.dim())]
        return [BilinearForm(form).assemble(self.scalar) for form in forms]

    @cached_property
    def _by_radius(self) -> csr_matrix:
        # Gauss points are never on the axis
        return BilinearForm(lambda u, v, w: u * v / w.x[0]).assemble(self.scalar)

    def _solved(self, b: Array) -> Array:
        """``M^-1 b`` for b of shape (nodes, r), all columns at once."""
        M, scale = self._mass, 1.0 / self._mass.diagonal()[:, None]
        x = scale * b
        r = b - M @ x
        z = scale * r
        p, rz = z, np.einsum("ik,ik->k", r, z)
        least = ROUND_OFF**2 * np.einsum("ik,ik->k", b, scale * b)
        for _ in range(PRODUCTS):
            if np.all(rz <= least):
                break
            Mp = M @ p
            pMp = np.einsum("ik,ik->k", p, Mp)
            step = np.divide(rz, pMp, out=np.zeros_like(rz), where=pMp > 0)
            x, r = x + step * p, r - step * Mp
            z = scale * r
            rz, before = np.einsum("ik,ik->k", r, z), rz
            p = z + np.divide(rz, before, out=np.zeros_like(rz), where=before > 0) * p
        else:  # cells with hardly any volume
            return np.asarray(skfem.solve(M, b))
        return x


_KNOWN: WeakKeyDictionary[Any, Projection] = WeakKeyDictionary()
