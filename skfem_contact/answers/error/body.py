r"""Error of tractions by the bodies behind them: meshes too stiff, sticking points that give way.

In a body the gradient of the displacement, which jumps from element to element, is compared with its
averages at the nodes, interpolated: O. C. Zienkiewicz and J. Z. Zhu, A simple error estimator and
adaptive procedure for practical engineering analysis, Int. J. Numer. Methods Eng. 24 (1987) 337-357.
The difference is measured by the energy of the body's own bilinear form. Relative to the energy of the
displacement it is the relative error of a compliance.

Elements within half a contact width of the contact count in full; farther ones less, by the square of
the distance: what they do wrong reaches the contact as a field that varies little over it.
"""

from __future__ import annotations

import numpy as np
import skfem
from numpy.typing import NDArray
from skfem.element import DiscreteField

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.error.sources import Elements
from skfem_contact.answers.thresholds import FARTHEST
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.body import Body
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.rows import compliance_scale
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def bodies_error(result: Answer, values: ContactValues) -> tuple[float, dict[str, Elements]]:
    """Relative energy error of the bodies, as far as the traction feels it."""
    part = result.slices()[result.names.index(values.name)]
    touching = np.unique(result.kin.B_n[part][values.status != OPEN].indices)
    found: dict[str, Elements] = {}
    error = total = 0.0
    for i, (body, name) in enumerate(zip(result.system.bodies, result.system.names, strict=True)):
        span = result.system.slice(body)
        dofs = touching[(touching >= span.start) & (touching < span.stop)] - span.start
        if not len(dofs) or not isinstance(body, Body):
            continue
        if body.nonlinear or body.form is None or result.stiffness[i] is not body.K:
            return np.nan, {}
        # where the body itself is touched: with finite sliding that is not where the other one was
        near, weight = _near(body, body.dof_points[dofs])
        lost, stored = energy_error(body, result.stretched(body), near)
        found[name] = near, weight * lost
        error, total = error + float(weight @ lost), total + float(weight @ stored)
    shares = {name: (near, lost / error if error else lost) for name, (near, lost) in found.items()}
    return (float(error / (error + total)) if total > 0 else 0.0), shares


def _near(body: Body, touched: Array) -> Elements:
    """Elements around touched points, and their influence on the traction there.

    One up to half the width of the contact, from there on it falls with the square of the distance.
    """
    mesh = body.basis.mesh
    corners = mesh.p[:, mesh.t]
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=0).max(axis=0)
    reach = np.maximum(0.5 * np.linalg.norm(np.ptp(touched, axis=0)), 2.0 * radius)
    distance = Tree(touched).distances(middle.T)
    near = np.flatnonzero(distance <= FARTHEST * reach)
    return near, np.minimum(1.0, reach[near] / np.maximum(distance[near], reach[near])) ** 2


def stiffness_error(result: Answer, contact: Contact, values: ContactValues, traction: Array) -> float:
    """Return what a finite tangential stiffness G takes from the friction of sticking points.

    A body of stiffness k in series with G bears ``k / (k + G)`` less. The bodies' stiffness at a node
    belongs to motions of one node; all sticking points together are softer by their number.
    """
    stick = values.status == STICK
    if contact.friction is None or not stick.any() or not traction.any():
        return 0.0
    part = result.slices()[result.names.index(values.name)]
    G = result.tangential_stiffness[part]
    if not np.isfinite(G[stick]).any():
        return 0.0
    t = result.kin.tangents
    rows = result.kin.B_t[part.start * t : part.stop * t]
    diagonal = np.concatenate([K.diagonal() for K in result.stiffness])
    k = compliance_scale(rows, diagonal).reshape(-1, t).min(axis=1) / np.sum(stick)
    lost = np.where(stick, k / (k + G), 0.0)[:, None] * traction[:, 1:]
    # of faces some nodes have none, see `pairing.control`
    area = (values.surface if values.surface.dim == 2 else values).area[:, None]
    return float(np.sqrt(np.sum(area * lost**2) / np.sum(area * traction**2)))


def energy_error(body: Body, u: Array, elements: Index) -> tuple[Array, Array]:
    """Energies of the estimated error and of the displacement, per element.

    Parameters
    ----------
    body : Body
        With a `form`.
    u : ndarray, shape (n,)
        Displacement of the body [length].
    elements : ndarray of int, shape (k,)

    Returns
    -------
    tuple of ndarray, each of shape (k,)
        [force length]
    """
    own = body.basis
    scalar = own.elem.elem if isinstance(own.elem, skfem.ElementVector) else own.elem
    shared = {"elements": elements, "dofs": own.dofs}
    basis = skfem.Basis(own.mesh, own.elem, own.mapping, quadrature=own.quadrature, **shared)
    corners = scalar.doflocs.T, np.ones(len(scalar.doflocs))
    at_nodes = skfem.Basis(own.mesh, own.elem, own.mapping, quadrature=corners, **shared)
    raw = np.asarray(at_nodes.interpolate(u).grad)  # (..., k, nodes of an element)
    smooth = basis.with_element(scalar)
    dofs, weight = smooth.element_dofs, np.asarray(basis.dx).sum(axis=1)
    total = np.bincount(dofs.ravel(), np.tile(weight, len(dofs)), smooth.N)
    field = basis.interpolate(u)
    error = np.zeros_like(np.asarray(field.grad))
    for at in np.ndindex(raw.shape[:-2]):
        mean = np.bincount(dofs.ravel(), (raw[at].T * weight).ravel(), smooth.N)
        mean = np.divide(mean, total, out=np.zeros_like(mean), where=total > 0)
        error[at] = np.asarray(smooth.interpolate(mean)) - field.grad[at]
    # the form sees a displacement whose gradient is the difference
    energy = skfem.Functional(lambda w: body.energy_density(w["e"], w))
    difference = DiscreteField(np.zeros_like(np.asarray(field)), error)
    return energy.elemental(basis, e=difference), energy.elemental(basis, e=field)
