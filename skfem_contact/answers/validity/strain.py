r"""Strains and rotations of bodies: the limits of linear bodies.

**Locking**: elements that can not keep their volume but by hardly moving at all.

Nearly incompressible bodies deform by shear alone. First-order elements have too few motions for that:
to keep the volume in each of their points, or in each of them, they move by a fraction of what they
should, and forces come out several times too large. The energy shows it. Where a body locks, much of
the energy is in changes of volume :math:`\theta` that are forced upon the elements and take turns,
inside an element or from one to the next; their mean over the elements around a node is next to
nothing. With the mean :math:`\bar\theta` of these patches, interpolated, the share

.. math:: \frac{\int K (\theta^2 - \bar\theta^2)\,dx}{\int \sigma : \varepsilon\,dx}

of the energy is taken back by neighbours. Where pressure is smooth, as elements of second order have
it, it is next to nothing. Of a share s forces are about ``1 / (1 - s)`` times too large, and more where
s is near one: rigid cylinders and balls pressed into rubber of nu .49 to .4999 gave 1.09 for .085, 1.26
for .23, 1.66 for .38, 3.3 for .65, 22 for .93.

Where elements of first order lock altogether hardly any change of volume is left to take turns, and the
share falls again: .19, .02 and .001 where forces are 70, 84 and 1700 times too large. Then pressure
and shear take turns nevertheless. With the share of the shear that averages take away as well, both
times the quotient of bulk and shear modulus, their product is above 800 where forces are twice too
large or more; at most 100 where they are right by 6 %, whatever the mesh.

The moduli are those of an isotropic body that is integrated at all points. What the energy differs by
from theirs is no locking, and taken off: reduced integration, other materials, springs in a matrix.

**Large displacements** of slender bodies: a strip that is held at both ends stretches as it bends, a
disc spring loses its height. The equations of Biot's strain, of which the linear ones are the first
order in displacements, tell how much that is (Koiter's expansion). With the strain e, the rotation w
(skew) and the stress s of the linear answer u, and

.. math:: q = (e w - w e - w w) / 2, \qquad W = \int C e : e / 2 + C e : q + C q : q / 2,

forces of second order are those of the second term, f2, and of third order those of the third. What f2
alone moves, d, has taken up most of q where a body may: a cantilever that bends becomes shorter. What
contact forces and displacements then change by is the answer to the rest, ``f2(u) + f2'(u) d + f3(u)``,
with all points open, stuck and slipping as they are. Strips pressed by a half, once and twice their
thickness have forces that are 18, 72 and 287 % too small by it, and 18, 71 and 274 % in truth.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import skfem

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.validity.support import SUPPORTED, Support
from skfem_contact.answers.validity.validity import A_TENTH, LOCKED
from skfem_contact.arrays import Array
from skfem_contact.bodies.assembly import (
    chunks,
    element_values,
    hoop_strain,
    point_volumes,
    scalar_element,
    shape_gradients,
    with_points,
)
from skfem_contact.bodies.body import STIFF_BULK, Body, may_lock
from skfem_contact.bodies.equations import Gradients, scattered
from skfem_contact.bodies.member import unit_motions
from skfem_contact.conditions.state import OPEN, STICK, LoadCase
from skfem_contact.linalg.dense_factors import single_threaded
from skfem_contact.problem.points import Conditions
from skfem_contact.problem.seam import ContactProblem, Source, Workspace

#: Quotient of bulk and shear modulus, times the share of the energy and times that of the shear that
#: averages take away, both: first-order elements that lock altogether. 860 where forces are 120 times
#: too large and nearly all shear is smooth, 4 000 and more else; 100 where they are right by 6 %.
ALTERNATING = 800.0


def strains(body: Body, u: Array) -> tuple[float, float, float, float]:
    """Strain and rotation of a body.

    Parameters
    ----------
    body : Body
    u : ndarray, shape (n_body,)
        [length]

    Returns
    -------
    mean : float
        Largest principal strain, averaged with its own square: where most of the energy is.
    largest : float
        In any point of integration.
    rotation : float
        Root of the mean square over the body [rad].
    there : float
        The same, where most of the energy is.
    """
    square = cubed = turned = there = whole = largest = 0.0
    basis = with_points(body.basis)
    for elements in chunks(basis, 8 * basis.Nbfun * basis.X.shape[1]):
        size, turn, volume = _strained(body, basis, u, elements)
        square += float(np.sum(size**2 * volume))
        cubed += float(np.sum(size**3 * volume))
        turned += float(np.sum(turn * volume))
        there += float(np.sum(turn * size**2 * volume))
        whole += float(np.sum(volume))
        largest = float(np.maximum(largest, np.max(size)))  # keeps NaN
    mean, there = (cubed / square, there / square) if square > 0 else (0.0, 0.0)
    return mean, largest, float(np.sqrt(turned / whole)), float(np.sqrt(there))


def gradient(basis: Any, u: Array, elements: Any) -> Array:
    """Derivatives of the displacement at the points of integration of some elements, (d, d, e, q)."""
    moved = element_values(basis, u, elements)
    # (e, c, k) @ (e, k, q) for each coordinate j: derivatives by j of component c
    G = shape_gradients(basis, elements)
    moved_by = np.ascontiguousarray(np.moveaxis(moved, 2, 0).swapaxes(1, 2))
    return np.stack([np.moveaxis(moved_by @ G[:, j], 1, 0) for j in range(G.shape[1])], axis=1)


def _strained(body: Body, basis: Any, u: Array, elements: Any) -> tuple[Array, Array, Array]:
    """Largest principal strain, squared rotation and volume at the points of some elements, (e, q)."""
    slope, volume = gradient(basis, u, elements), point_volumes(basis, elements)
    if body.dim == 3:
        G = np.moveaxis(slope, (0, 1), (2, 3))
        other = np.swapaxes(G, 2, 3)
        size = np.abs(np.linalg.eigvalsh(0.5 * (G + other))).max(axis=2)
        # half of the squares of a skew matrix are those of its vector
        return size, np.sum((0.5 * (G - other)) ** 2, axis=(2, 3)) / 2, volume
    (a, b), (c, e) = slope
    middle, radius = 0.5 * (a + e), np.sqrt(0.25 * (a - e) ** 2 + 0.25 * (b + c) ** 2)
    size = np.abs(middle) + radius
    if body.axisymmetric:
        r = basis.mapping.F(basis.X, elements)[0]
        size, volume = np.maximum(size, np.abs(hoop_strain(basis, u, elements))), volume * r
    return size, 0.25 * (c - b) ** 2, volume


# -- locking ---------------------------------------------------------------------------------------


#: Shape functions of the corners, by the shape of an element.
FIRST_ORDER = {
    element.refdom: element
    for element in (skfem.ElementTriP1, skfem.ElementQuad1, skfem.ElementTetP1, skfem.ElementHex1)
}


def lockable(result: Answer) -> list[str]:
    """Names of the bodies that may lock, where the answer is by their own stiffness."""
    given = dict(zip(result.system.names, result.stiffness, strict=True))
    return [name for name, b in result.system.solids.items() if may_lock(b) and given[name] is b.K]


def locked(result: Answer, name: str) -> float:
    """The `locked_share` of a body in an answer; measured once, for the validity and the estimate."""
    key = "locked", name
    if key not in result.measured:
        body = result.system.solids[name]
        result.measured[key] = locked_share(body, result.stretched(name))
    return result.measured[key]


def locked_share(body: Body, u: Array) -> float:
    """Share of the energy that averages over neighbouring elements take away; 0 without energy.

    It is 1 where first-order elements lock altogether, so that nothing is left to be taken away.

    Parameters
    ----------
    body : Body
        That `may_lock`.
    u : ndarray, shape (n_body,)
        Its displacement [length].
    """
    basis, mesh, known = with_points(body.basis), body.basis.mesh, body.moduli
    energy = float(u @ (body.K @ u))
    if known is None or not energy > 0:
        return 0.0
    found = [
        (*_strain(body, basis, u, elements), point_volumes(basis, elements))
        for elements in chunks(basis, 8 * body.dim * basis.Nbfun * basis.X.shape[1])
    ]
    # in all elements at once: patches go over the parts
    theta, square, dx = (np.concatenate(part) for part in zip(*found, strict=True))
    bulk, shear = (np.broadcast_to(modulus, len(theta)) for modulus in known)
    density = bulk[:, None] * theta**2 + 2 * shear[:, None] * square
    other = abs(float(np.sum(density * dx)) - energy)
    # the pressure of what is nearly incompressible goes through, where materials meet
    some = np.flatnonzero(bulk > STIFF_BULK * shear)
    pressure, dx, bulk = bulk[some, None] * theta[some], dx[some], bulk[some]
    numbers = np.arange(mesh.nelements) if basis.tind is None else np.asarray(basis.tind)
    smooth = _averaged(mesh, numbers[some], basis, pressure, dx)
    taken = np.sum((pressure**2 - smooth**2) * dx / bulk[:, None])
    share = max((float(taken) - other) / energy, 0.0)
    first_order = issubclass(type(scalar_element(basis.elem)), tuple(FIRST_ORDER.values()))
    if first_order and 0 < share <= LOCKED and other <= LOCKED * energy:
        varies = _shear_taken(body, basis, u)
        return 1.0 if share * varies * known.quotient**2 > ALTERNATING else share
    return share


def _shear_taken(body: Body, basis: Any, u: Array) -> float:
    """Share of the squared shear that averages over neighbouring elements take away."""
    mesh, d = basis.mesh, body.dim
    numbers = np.arange(mesh.nelements) if basis.tind is None else np.asarray(basis.tind)
    parts = chunks(basis, 8 * d * d * basis.Nbfun * basis.X.shape[1])
    found = [(gradient(basis, u, some), point_volumes(basis, some)) for some in parts]
    slope, dx = (np.concatenate(part, axis=-2) for part in zip(*found, strict=True))
    strain = 0.5 * (slope + np.swapaxes(slope, 0, 1))
    strain -= np.eye(d)[:, :, None, None] * np.trace(strain) / d
    smooth = sum(
        np.sum(_averaged(mesh, numbers, basis, component, dx) ** 2 * dx)
        for component in strain.reshape(d * d, *dx.shape)
    )
    whole = float(np.sum(strain**2 * dx))
    return 1 - float(smooth) / whole if whole > 0 else 0.0


def _averaged(mesh: Any, numbers: Any, basis: Any, values: Array, dx: Array) -> Array:
    """Values at points of elements (e, q), averaged over those round each corner and interpolated."""
    corners, count = mesh.t[:, numbers], len(mesh.t)
    weight, sums = (
        np.bincount(corners.ravel(), np.tile(one.sum(axis=1), count), mesh.nvertices)
        for one in (dx, values * dx)
    )
    mean = np.divide(sums, weight, out=np.zeros(len(sums)), where=weight > 0)
    linear = FIRST_ORDER[mesh.elem.refdom]()
    shapes = np.array(
        [np.broadcast_to(linear.lbasis(basis.X, i)[0], len(basis.W)) for i in range(count)]
    )
    return np.asarray(mean[corners].T @ shapes)


def _strain(body: Body, basis: Any, u: Array, elements: Any) -> tuple[Array, Array]:
    """Change of volume at the points of integration of some elements, and the rest squared, (e, q).

    The energy is the integral of the bulk modulus times the square of the first, and of twice the
    shear modulus times the other.
    """
    d, slope = body.dim, gradient(basis, u, elements)
    strain = 0.5 * (slope + np.swapaxes(slope, 0, 1))
    theta, square = np.trace(strain), np.einsum("cjeq,cjeq->eq", strain, strain)
    if body.axisymmetric:
        hoop = hoop_strain(basis, u, elements)
        theta, square = theta + hoop, square + hoop**2
    return np.asarray(theta), np.asarray(square - theta**2 / d)


# -- large displacements ---------------------------------------------------------------------------


def displaced_far(result: Answer, name: str, strain: float, rotation: float) -> float:
    """What large displacements of a linear body would change of contact forces, or of its way.

    Over the largest; zero where the squared rotation is less than a hundredth of the strain, or less
    than a tenth of it and the change below ten strains. (Shallow arches lose a tenth of their force
    where it is a twentieth of the strain, and are strained by a thousandth.) NaN where it is not known:
    of bodies that yield, are warmed or not isotropic, and where one may stand elsewhere as well.

    Parameters
    ----------
    result : Answer
    name : str
        Of the body.
    strain, rotation : float
        Where most of its energy is, see `strains`.
    """
    body = result.system.solids[name]
    if rotation**2 <= A_TENTH**2 * strain:
        return 0.0
    K, u = result.stiffness[result.system.index(body)], result.stretched(name)
    unknown = body.nonlinear or body.thermal is not None or body.moduli is None or K is not body.K
    if unknown or result.indifferent:
        return np.nan
    second, third, energy = _turned_forces(body, name, u)
    if abs(energy / float(u @ (K @ u)) - 1.0) > A_TENTH:
        return np.nan
    with Workspace() as work, single_threaded:
        kin = None if result.model.kin is result.kin else result.kin
        problem = work.borrowed(result.model.problem_on(kin, None))
        own = second(u)
        d = _moved(result, problem, body, -own)[0]
        left = own + 0.5 * (second(u + d) - second(u - d)) + third(u)
        moved, change = _moved(result, problem, body, -left)
    forces = result.local.normal_force
    summed = [(change[part].sum(), forces[part].sum()) for part in result.slices()]
    changed, whole = np.abs(summed).max(axis=0)
    of_forces = changed / whole if whole > 0 else 0.0
    share = float(max(of_forces, np.abs(moved).max() / np.abs(u).max()))
    # a block that hardly turns changes by some times its strain, which tells it, an arch by far more
    return share if rotation**2 > A_TENTH * strain or A_TENTH * share > strain else 0.0


def _moved(result: Answer, problem: ContactProblem, body: Body, f: Array) -> tuple[Array, Array]:
    """Displacements of a body and normal forces of all points by a small load (n_body,) on it.

    Points stay open, stuck and slipping, with the coefficient of friction that they have.
    """
    local, (m, t), n = result.local, result.local.slip.shape, result.system.n
    part, still = result.system.slice(body), np.zeros((m, t))
    closed, stick = local.status != OPEN, local.status == STICK
    pressed = np.where(closed & ~stick & (local.normal_force > 0), local.normal_force, np.inf)
    coupling = local.tangential_force / pressed[:, None]
    held = Conditions(closed, stick, still, np.zeros((m, t, t)), still, coupling)
    case = LoadCase(np.zeros(n), np.zeros(n), np.zeros(m), still, np.zeros(m), ())
    case.f[part] = f
    load = problem.other_load(case)
    found = problem.solve(held, load)
    source = problem.source(load, found)
    given = Source(source.values[:, None], source.forces), [None], [case]
    return problem.bodies.recover(*given)[0][part], found.normal_force


def _turned_forces(body: Body, name: str, u: Array) -> tuple[Any, Any, float]:
    """Internal forces of second and third order of displacements, functions; twice the energy of u."""
    assert body.moduli is not None
    on = Gradients(with_points(body.basis), None, body.axisymmetric, name)
    still = _without_turn(body, on.dx)
    bulk, shear = (modulus[:, None] for modulus in body.moduli)  # weights of axisymmetry are in them

    def stress(e: Array) -> Array:
        unit = np.eye(len(e))[:, :, None, None]
        return (bulk - 2 * shear / body.dim) * np.trace(e) * unit + 2 * shear * e

    def parts(u: Array) -> tuple[Array, Array, Array]:
        H = on.of(u)
        e, w = 0.5 * (H + H.swapaxes(0, 1)), still(0.5 * (H - H.swapaxes(0, 1)))
        return e, w, stress(0.5 * (times(e, w) - times(w, e) - times(w, w)))

    def forces(P: Array) -> Array:
        other = P.swapaxes(0, 1)
        return scattered(on.forces(0.5 * (P + other) + still(0.5 * (P - other))), on.basis)

    def second(u: Array) -> Array:
        e, w, s = parts(u)
        return forces(s + times(w, stress(e)))

    def third(u: Array) -> Array:
        e, w, s = parts(u)
        return forces(times(w, s) + 0.5 * (times(e, s) - times(s, e)))

    e = parts(u)[0]
    return second, third, float(np.sum(np.einsum("ijeq,ijeq->eq", stress(e), e) * on.dx))


def _without_turn(body: Body, dx: Array) -> Callable[[Array], Array]:
    """Return what takes the mean off skew fields (d, d, e, q), as far as supports let the body turn.

    Turned as a whole with what it touches, by linear motions as well, a body is not strained by it.
    """
    d = body.dim
    axes, size, _ = np.linalg.svd(Support.of(body, 0).free[d:])
    axes = axes[:, : np.count_nonzero(size > SUPPORTED)]
    if not axes.size:
        return lambda w: w
    turns = np.einsum("mik,ka->aim", unit_motions(np.eye(d), np.zeros(d), 1.0)[:, :, d:], axes)

    def still(w: Array) -> Array:
        mean = np.einsum("ijeq,eq->ij", w, dx) / dx.sum()
        turn = np.einsum("aij,akl,kl->ij", turns, turns, mean) / 2
        return np.asarray(w - turn[:, :, None, None])

    return still


def times(a: Array, b: Array) -> Array:
    """Products of matrices (d, d, e, q)."""
    return np.einsum("ik...,kj...->ij...", a, b)
