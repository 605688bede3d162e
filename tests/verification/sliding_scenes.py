"""Scenes in which contact travels over many facets."""

from __future__ import annotations

import numpy as np
import rectangles
import skfem as fem
from scenes import elastic as elastic_form
from scipy.sparse import csr_matrix

import skfem_contact as sc

QUAD = fem.ElementVector(fem.ElementQuad1())


def rectangle(x, y):
    """Basis of Q1 elements on a tensor grid."""
    return rectangles.rectangle(x, y, order=2)


def elastic(E, nu=0.3):
    return elastic_form(E, nu)


def dragged_block(
    *,
    rigid,
    method="node",
    E=1e3,
    mu=0.3,
    P=1.0,
    nx=8,
    facets=None,
    sliding="finite",
    options=None,
):
    """A unit block, loaded by P at the top and moved along a flat track by its top nodes.

    The track is rigid, a plane or an outline, or an elastic layer with facets of unequal length.
    """
    basis = rectangle(np.linspace(0, 1, nx + 1), np.linspace(0, 1, nx + 1))
    load = fem.LinearForm(lambda v, w: -P * v[1]).assemble(basis.boundary("top"))
    D = basis.get_dofs("top").nodal["u^1"]
    x = np.zeros(basis.N)
    x[D] = 1.0
    block = sc.Body(basis, elastic(E), f=load, D=D, x=x, name="block")
    bodies = [block]
    if rigid == "outline":
        primary = sc.RigidPolyline([(20, 0), (-5, 0)], name="track")
    elif rigid:
        primary = sc.RigidPlane((0, 0), (0, 1), name="track")
    else:
        joints = np.linspace(-0.5, 5, 41) if facets is None else facets
        track = sc.Body(rectangle(joints, np.linspace(-1, 0, 7)), elastic(E), D="bottom", name="track")
        bodies.append(track)
        primary = track.surface("top")
    contact = sc.Contact(
        block.surface("bottom"), primary, friction=sc.Coulomb(mu), sliding=sliding, method=method
    )
    return sc.ContactSolver(bodies, [contact], options=options)


def travel(solver, distances):
    """The results of moving the block to each of these distances."""
    return list(solver.history([{"x": {"block": d}} for d in distances]))


def belt(start, *, thickness=0.02, wrap=np.pi / 2, n=120, mu=0.3, sliding="small", E=1e5):
    """A belt on a rigid drum of radius one: unit tension at one end, a stiff puller at the other.

    Returns the solver, the steps that pull it until everything slips, and the tension of a result.
    """
    angle = np.linspace(start, start + wrap, n + 1)
    mesh = fem.MeshQuad.init_tensor(angle, np.linspace(1, 1 + thickness, 4))
    left, right = mesh.facets_satisfying(lambda x: x[0] < start + 1e-9), None
    right = mesh.facets_satisfying(lambda x: x[0] > start + wrap - 1e-9)
    inside = mesh.facets_satisfying(lambda x: x[1] < 1 + 1e-9)
    a, r = mesh.p
    bent = fem.MeshQuad(np.array([r * np.cos(a), r * np.sin(a)]), mesh.t)
    bent = bent.with_boundaries({"slack": left, "tight": right, "inside": inside})
    basis = fem.Basis(bent, QUAD, intorder=4)

    def pull(tag, phi, sign):
        along = sign * np.array([-np.sin(phi), np.cos(phi)]) / thickness
        form = fem.LinearForm(lambda v, w: along[0] * v[0] + along[1] * v[1])
        return form.assemble(basis.boundary(tag))

    slack, tight = pull("slack", start, -1.0), pull("tight", start + wrap, 1.0)
    k = 0.1 * E  # a spring at the tight end, so that its tension is an answer
    column = csr_matrix(tight[:, None])
    K = csr_matrix(elastic(E, 0.0).assemble(basis) + k * (column @ column.T))
    body = sc.Body(basis, K, f=slack, name="belt")
    drum = sc.RigidSphere((0, 0), 1.0, name="drum")
    contact = sc.Contact(
        body.surface("inside"), drum, friction=sc.Coulomb(mu), adjust=1e-3, sliding=sliding
    )
    end = 300 / E
    steps = [{"f": {"belt": slack + k * d * tight}} for d in end * np.arange(1, 13) / 12]
    return sc.ContactSolver([body], contact), steps, lambda result: k * (end - tight @ result.u)
