"""Bolts with closed forms: a clamped stack of springs, and two plates between head and nut."""

from functools import cache

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

STEEL = linear_elasticity(*lame_parameters(210e3, 0.3))


def rod(x0, x1, form, cells, name, seed=0):
    """A plane rod of height 10 on (x0, x1), its inner nodes displaced at random."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(x0, x1, 4), np.linspace(0, 10, cells + 1))
    p = np.array(mesh.p)
    inner = (p[1] > 0) & (p[1] < 10) & (p[0] > x0) & (p[0] < x1)
    p[:, inner] += 0.13 * np.random.default_rng(seed).uniform(-1, 1, (2, inner.sum()))
    mesh = fem.MeshQuad(p, mesh.t).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=3)
    # nothing else says where along x it all stands
    return sc.Body(basis, form, D=[int(basis.nodal_dofs[0, 0])], name=name)


def stack(seed=0, at=4.7, stiff=1e5, **settings):
    """A bolt of stiffness 2e5 and a plate of 8e5 between the ground and a rigid head; nu = 0."""
    bolt = rod(0, 1, linear_elasticity(0.0, 10 * stiff), 11, "bolt", seed)
    plate = rod(2, 4, linear_elasticity(0.0, 20 * stiff), 7, "plate", seed + 1)
    ground = sc.RigidPlane((0, 0), (0, 1), name="ground")
    down = sc.RigidPlane((0, 10), (0, -1))
    head = sc.RigidBody(down, about=(0, 10), D=("x", "rotation"), name="head")
    contacts = [
        sc.Contact(bolt.surface("bottom"), ground, tied=True, name="nut"),
        sc.Contact(bolt.surface("top"), head, tied=True, name="seat"),
        sc.Contact(plate.surface("bottom"), ground, name="foot"),
        sc.Contact(plate.surface("top"), head, name="joint"),
    ]
    bolts = [sc.Bolt(bolt, point=(0.5, at), axis=(0, 2), name="M")]
    return sc.ContactSolver([bolt, plate, head], contacts, bolts=bolts, **settings)


ELEMENTS = {
    fem.MeshHex: fem.ElementHex1,
    fem.MeshTet: fem.ElementTetP1,
    fem.MeshTet2: fem.ElementTetP2,
}
TIGHTEN = {"bolt": {"M": {"force": 10.0}}}


def grid(*axes):
    return fem.MeshHex.init_tensor(*(np.asarray(axis, dtype=float) for axis in axes))


def parts(kind, seed=0):
    """A square bolt through two plates with a square hole: height 6, shank 2, head 4, plates 8."""
    across, along = [-2, -1, 0, 1, 2], [-5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5]
    bolt = grid(across, across, along)
    shank = lambda x: (abs(x[0]) < 1) & (abs(x[1]) < 1)  # noqa: E731
    bolt = bolt.restrict(bolt.elements_satisfying(lambda x: shank(x) | (abs(x[2]) > 3)))
    wide = [-4, -2.5, -1.2, 1.2, 2.5, 4]
    plate = grid(wide, wide, [0, 1.5, 3])
    plate = plate.restrict(plate.elements_satisfying(lambda x: (abs(x[0]) > 1.2) | (abs(x[1]) > 1.2)))
    lower = plate.translated((0, 0, -3))
    meshes = [bolt, plate, lower]
    if kind is fem.MeshTet:
        meshes = [mesh.to_meshtet() for mesh in meshes]
        inner = np.setdiff1d(np.arange(meshes[0].p.shape[1]), meshes[0].boundary_nodes())
        p = np.array(meshes[0].p)
        p[:, inner] += 0.2 * np.random.default_rng(seed).uniform(-1, 1, (3, len(inner)))
        meshes[0] = fem.MeshTet(p, meshes[0].t)
    return meshes


def clamped(meshes, turn=None, unit=1.0, at=0.4, axis=1.0, mu=0.2, seed=None, form=STEEL):
    """Bodies, contacts and solver; `turn` (3, 3) turns it all, `seed` numbers the nodes anew."""
    turn = np.eye(3) if turn is None else turn
    bodies, surfaces = [], []
    for mesh, name in zip(meshes, ("bolt", "upper", "lower"), strict=True):
        p, t = mesh.p, mesh.t
        if seed is not None:
            order = np.random.default_rng(seed).permutation(p.shape[1])
            p, t = p[:, np.argsort(order)], order[t]
        here = type(mesh)(unit * (turn @ p), t)
        element = ELEMENTS[type(mesh)]()
        basis = fem.Basis(here, fem.ElementVector(element), intorder=2)
        D = None
        if name == "lower":  # at its rim
            back = turn.T @ here.p / unit
            D = basis.nodal_dofs[:, np.flatnonzero(abs(abs(back[0]) - 4) < 1e-9)].ravel()
        bodies.append(sc.Body(basis, form, D=D, name=name))
    bolt, upper, lower = bodies

    def on(z):
        return lambda x: abs(np.tensordot(turn[:, 2], x, axes=1) / unit - z) < 1e-6

    surfaces = [
        (bolt.surface(on(3), name="head"), upper.surface(on(3), name="top")),
        (bolt.surface(on(-3), name="nut"), lower.surface(on(-3), name="bottom")),
        (upper.surface(on(0), name="under"), lower.surface(on(0), name="over")),
    ]
    names = ("head", "nut", "joint")
    friction = sc.Coulomb(mu)
    contacts = [sc.Contact(*s, friction=friction, name=n) for s, n in zip(surfaces, names, strict=True)]
    point = unit * (turn @ np.array([0, 0, at]))
    section = sc.Bolt(bolt, point=point, axis=axis * turn[:, 2], name="M")
    return sc.ContactSolver(bodies, contacts, bolts=[section])


def pull_of(upper, turn=None, unit=1.0):
    """The upper plate is pulled up by 1500 and aside at its rim."""
    turn = np.eye(3) if turn is None else turn
    back = turn.T @ upper.dof_points.T
    rim = np.flatnonzero(abs(abs(back[1]) / unit - 4) < 1e-6)
    way = turn @ np.array([0.3, 0.1, 1.0])
    f = np.zeros(upper.n)
    f[rim] = way[upper.dof_component[rim]] * 1500 / len(rim) * 3
    return f


def pulled(solver, turn=None, unit=1.0):
    """Tightened to 8000, then pulled."""
    f = pull_of(solver.system.bodies[1], turn, unit)
    return list(solver.history([{"bolt": {"M": {"force": 8e3}}}, {"f": {"upper": f}}]))


@cache
def upright():
    return pulled(clamped(parts(fem.MeshHex)))
