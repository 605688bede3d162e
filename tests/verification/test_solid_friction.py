"""Friction between solids, through the public interface: closed forms, and what holds by symmetry."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

sys.path.insert(0, str(Path(__file__).parent.parent))
from solid_meshes import KINDS, at, cube, elastic

import skfem_contact as sc
from skfem_contact.answers import answer_of

LOOPS = ("newton", "direct", "fictitious")
FLOOR = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")


class Sheared:
    """A cube with nu = 0 on a plane, under a given pressure and a uniform shear: every point alike.

    Its sides are loaded with the shear traction of the answer, so that the stress is uniform.
    """

    def __init__(self, kind, mu, p=0.01, E=1.0):
        self.mu, self.p, self.G = mu, p, E / 2
        mesh = cube(kind, 2)
        basis = fem.Basis(mesh, fem.ElementVector(KINDS[kind][2]()), intorder=4)
        self.top = basis.get_dofs(lambda x: np.isclose(x[2], 1.0)).all()
        stiffness = linear_elasticity(*lame_parameters(E, 0.0))
        self.block = sc.Body(basis, stiffness, D=self.top, name="block")
        self.sides = []
        for axis in (0, 1):
            facets = [mesh.facets_satisfying(at(axis, end)) for end in (0.0, 1.0)]
            loads = [
                fem.LinearForm(lambda v, w: v[2]).assemble(
                    fem.FacetBasis(mesh, basis.elem, facets=f, intorder=4)
                )
                for f in facets
            ]
            self.sides.append(loads[1] - loads[0])
        self.foot = self.block.surface(at(2, 0.0), name="foot")

    def solver(self, **settings):
        law = sc.Coulomb(self.mu)
        return sc.ContactSolver(
            self.block, sc.Contact(self.foot, FLOOR, friction=law, name="joint"), **settings
        )

    def load(self, moved, shear):
        """The top moved along x and y; `shear` is the friction traction of the answer on the foot."""
        x = np.zeros(self.block.n)
        component = self.block.dof_component
        for c, value in enumerate((*moved, -self.p)):  # E = 1, height 1
            x[self.top[component[self.top] == c]] = value
        f = sum(-t * side for t, side in zip(shear, self.sides, strict=True))
        return {"x": {"block": x}, "f": {"block": f}}


@pytest.mark.every_value
@pytest.mark.parametrize("kind", ["quad4", "tri3", pytest.param("quad9", marks=pytest.mark.slow)])
@pytest.mark.parametrize("angle", [0, 15, 75, 90, 165, 210, 255, 315])
def test_a_block_dragged_any_way(kind, angle):
    """Friction is mu p against the slip, whatever the direction: the cone is round."""
    block = Sheared(kind, 0.3)
    way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    solver = block.solver()
    pressed = solver.solve(**block.load((0, 0), (0, 0)))
    values = solver.solve(**block.load(0.05 * way, -0.003 * way), start=pressed)["joint"]
    expected = np.tile([*(-0.003 * way), 0.01], (len(values.points), 1))
    np.testing.assert_allclose(values.traction, expected, rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        values.slip_vector[:, :2], np.tile((0.05 - 0.006) * way, (len(values.points), 1)), atol=1e-11
    )


def back_onto(trial, radius):
    return trial * min(1.0, radius / np.linalg.norm(trial))


@pytest.mark.every_value
@pytest.mark.parametrize("steps, degrees", [(1, 45.0), (2, 43.35820), (5, 41.80918), (10, 41.14853)])
@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_turning_path(steps, degrees, loop):
    """Saturated along x, then moved along y by mu p H / G: every step is one return map, exactly."""
    block = Sheared("quad4", 0.3)
    bound = 0.3 * block.p
    solver = block.solver(loop=loop)
    way = [block.load((0, 0), (0, 0)), block.load((0.05, 0), (-bound, 0))]
    tau, taus = np.array([bound, 0.0]), []
    for k in range(steps):
        tau = back_onto(tau + [0.0, bound / steps], bound)
        taus.append(tau)
        way.append(block.load((0.05, (k + 1) / steps * bound / block.G), -tau))
    results = list(solver.history(way))
    assert abs(np.degrees(np.arctan2(tau[0], tau[1])) - degrees) < 5e-6
    tolerance = 1e-9 if loop == "newton" else 1e-3  # its springs are 1000 times as stiff
    for tau, result in zip(taus, results[2:], strict=True):
        found = result["joint"].traction[:, :2]
        np.testing.assert_allclose(
            found, np.tile(-tau, (len(found), 1)), rtol=0, atol=tolerance * bound
        )


def disc(n):
    """A disc of radius 1 and height 0.5: the square grid brought onto a circle."""

    def onto(x):
        y = 2 * x[:2] - 1
        largest, length = np.abs(y).max(axis=0), np.linalg.norm(y, axis=0)
        return np.vstack([y * largest / np.where(length > 0, length, 1.0), 0.5 * x[2]])

    return cube("quad4", n, onto)


def ring(n):
    """Radii 1 to 2, height 0.5, of n times 8 n elements, its seam closed."""
    radii, angles = np.linspace(1, 2, n + 1), np.arange(8 * n) * 2 * np.pi / (8 * n)
    heights = np.array([0.0, 0.25, 0.5])
    r, a, z = np.meshgrid(radii, angles, heights, indexing="ij")
    p = np.stack([r * np.cos(a), r * np.sin(a), z]).reshape(3, -1)
    i, j, k = (v.ravel() for v in np.meshgrid(range(n), range(8 * n), range(2), indexing="ij"))
    corners = ((0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0), (1, 1, 1))
    t = [((i + a) * 8 * n + (j + b) % (8 * n)) * 3 + k + c for a, b, c in corners]
    return fem.MeshHex(p, np.array(t))


@pytest.mark.every_value
@pytest.mark.parametrize(
    "mesh, factor, error",
    [
        (disc(6), 2 / 3, 0.013),
        pytest.param(disc(12), 2 / 3, 0.005, marks=pytest.mark.slow),
        (ring(3), 14 / 9, 1e-9),
    ],
    ids=["disc", "fine disc", "ring"],
)
@pytest.mark.parametrize("loop", LOOPS)
def test_torque_of_a_turning_foot(mesh, factor, error, loop):
    """Pressed uniformly and turned until all slips: 2/3 mu P R of a disc, 14/9 mu P of the ring.

    The pressure is uniform because nu is zero. Nodal areas times nodal radii are the polygon's own
    integral but for second order; on the ring, whose nodes are alike on each circle, they are exact.
    """
    mu, p = 0.4, 1e-3
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=4)
    top = basis.get_dofs(lambda x: np.isclose(x[2], 0.5))
    sides = fem.FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(at(2, 0.5)), intorder=4)
    load = fem.LinearForm(lambda v, w: -p * v[2]).assemble(sides)
    D = [top.all(["u^1"]), top.all(["u^2"])]
    body = sc.Body(
        basis, linear_elasticity(*lame_parameters(1.0, 0.0)), load, D=np.concatenate(D), name="foot"
    )
    contact = sc.Contact(body.surface(at(2, 0.0)), FLOOR, friction=sc.Coulomb(mu), name="joint")
    solver = sc.ContactSolver(body, contact, loop=loop)
    steps = []
    for angle in (0.0, 1e-3, 1e-2):
        x = np.zeros(basis.N)
        x[D[0]], x[D[1]] = -angle * basis.doflocs[1, D[0]], angle * basis.doflocs[0, D[1]]
        steps.append({"x": {"foot": x}})
    values = list(solver.history(steps))[-1]["joint"]
    force, moment = values.force, values.moment()
    np.testing.assert_allclose(force[:2], 0.0, atol=1e-9 * force[2])
    np.testing.assert_allclose(moment[:2], 0.0, atol=1e-9 * force[2])
    assert abs(-moment[2] / (factor * mu * force[2]) - 1) < error
    # against the slip, which is round about the axis
    x, t = values.points, values.traction
    far = np.linalg.norm(x[:, :2], axis=1) > 0.1
    assert np.all(t[far, 0] * -x[far, 1] + t[far, 1] * x[far, 0] < 0)


def pushed_block(loop, mu=0.4):
    """A block that stands on friction alone, and a load on its top as a function of its direction."""
    mesh = cube("quad4", 3, lambda x: x * [[1.0], [1.0], [0.5]])
    block = elastic(mesh, "quad4", "block", press=(at(2, 0.5), (0.0, 0.0, -1e-3)))
    contact = sc.Contact(block.surface(at(2, 0.0)), FLOOR, friction=sc.Coulomb(mu), name="joint")
    sides = fem.FacetBasis(
        mesh, block.basis.elem, facets=mesh.facets_satisfying(at(2, 0.5)), intorder=4
    )

    def load(fx, fy):
        form = fem.LinearForm(lambda v, w: 1e-3 * (fx * v[0] + fy * v[1] - v[2]))
        return {"block": form.assemble(sides)}

    return sc.ContactSolver(block, contact, loop=loop), load


@pytest.mark.parametrize("loop", LOOPS)
def test_friction_alone_holds_a_block(loop):
    """No rigid motion is held by supports: pushed in turning directions it carries what it is given."""
    solver, load = pushed_block(loop)
    start = None
    for push in ((0.0, 0.0), (0.2, 0.0), (0.2, 0.2), (0.0, 0.3)):
        start = solver.solve(f=load(*push), start=start)
        # nothing of the load is carried by anything else; the loops end at 1e-10
        np.testing.assert_allclose(
            start["joint"].force, [-push[0] * 1e-3, -push[1] * 1e-3, 1e-3], rtol=0, atol=1e-12
        )
        assert start.certificate.worst < 1e-9 and start.indifferent == ()


@pytest.mark.every_value
@pytest.mark.parametrize("loop", ["newton", "direct"])
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_a_push_beyond_friction_has_no_equilibrium(loop, angle):
    """2 % more than mu N in any direction: refused, with the proof from statics."""
    solver, load = pushed_block(loop)
    push = 0.408 * np.array([np.cos(angle), np.sin(angle)])
    start = solver.solve(f=load(0.0, 0.0))
    with pytest.raises(sc.errors.NoEquilibrium, match="no force at the contact points can stop"):
        solver.solve(f=load(*push), start=start)


def test_the_certificate_judges_direction_and_size():
    """Friction turned by a thousandth, or as much too large, is told from friction that is right."""
    solver, load = pushed_block("newton")
    pressed = solver.solve(f=load(0.0, 0.0))
    result = answer_of(solver.solve(f=load(0.2, 0.2), start=pressed))
    assert (result.state.status == 2).any()
    assert sc.answers.ContactResult(result).certificate.friction < 1e-9
    right = result.state.tangential_force
    turned = right + 1e-3 * np.cross([0.0, 0.0, 1.0], right)
    for wrong in (turned, 1.001 * right):
        object.__setattr__(result.state, "tangential_force", wrong)
        for name in ("local", "certificate"):  # what is derived of the state
            vars(result).pop(name, None)
        scale = result.state.normal_force.max()
        at_fault = np.linalg.norm(wrong - right, axis=1)[result.state.status == 2].max() / scale
        assert 0.3 * at_fault < sc.answers.ContactResult(result).certificate.friction < 3 * at_fault


@pytest.mark.every_value
@pytest.mark.parametrize("linear", ["condensed", "sparse"])
@pytest.mark.parametrize("frame", [0.0, 0.6])
def test_half_a_block_is_half_of_the_whole(linear, frame):
    """A symmetry plane through the contact: its nodes slip along it, and half the forces come out.

    The foot is slanted about an axis across the plane, so that no tangent is given by an axis of it.
    """
    forces = []
    for half in (False, True):
        y = np.linspace(0.0, 1.0, 4) if half else np.linspace(-1.0, 1.0, 7)
        mesh = fem.MeshHex.init_tensor(np.linspace(0, 1, 4), y, np.linspace(0, 1, 4))
        turn = np.array(
            [[np.cos(frame), 0, np.sin(frame)], [0, 1, 0], [-np.sin(frame), 0, np.cos(frame)]]
        )
        mesh = fem.MeshHex(turn @ mesh.p, mesh.t)
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
        local = turn.T @ basis.doflocs
        top = np.isclose(local[2], 1.0)
        D = np.flatnonzero(top)
        if half:
            D = np.union1d(
                D, basis.split_indices()[1][np.isclose(local[1, basis.split_indices()[1]], 0)]
            )
        body = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), D=D, name="body")
        plane = sc.RigidPlane((0, 0, 0), turn[:, 2], name="floor")
        foot = body.surface(lambda x, turn=turn: np.isclose((turn.T @ x)[2], 0.0), name="foot")
        contact = sc.Contact(foot, plane, friction=sc.Coulomb(0.3), name="joint")
        settings = {"linear": sc.linalg.Direct()} if linear == "sparse" else {}
        solver = sc.ContactSolver(body, contact, **settings)
        steps = []
        for s in (0.0, 0.02, 0.01):
            x = np.zeros(basis.N)
            move = turn @ np.array([s, 0.0, -0.01])
            for c, dofs in enumerate(basis.split_indices()):
                on = dofs[top[dofs]]
                x[on] = move[c]
            steps.append({"x": {"body": x}})
        results = list(solver.history(steps))
        assert all(r.certificate.worst < 1e-9 for r in results)
        values = [r["joint"] for r in results]
        forces.append([v.force for v in values])
        assert (values[1].status == 2).any()
        if half:
            on_plane = np.isclose(values[1].points[:, 1], 0.0)
            assert np.abs(values[1].traction[on_plane, 1]).max() < 1e-12
    for whole, part in zip(*forces, strict=True):
        np.testing.assert_allclose(part[[0, 2]], 0.5 * whole[[0, 2]], rtol=1e-9, atol=1e-14)


@pytest.mark.every_value
@pytest.mark.parametrize("mu, far", [(0.3, 0.1), (0.3, 1e-3), (100.0, 1e-3)])
@pytest.mark.parametrize("moves", ["foot", "floor"])
@pytest.mark.parametrize(
    "linear", ["condensed", "iterated", sc.linalg.Direct(), sc.linalg.AMG()], ids=str
)
def test_supports_move_points_along_one_tangent(linear, moves, mu, far):
    """A foot that is moved along y, and free along x: friction is opposite to the slip along both.

    So it is where the foot stands still and the floor moves the other way; by however little, and
    whatever the friction: what is moved does not stick.
    """
    low, high = at(2, 0.0), at(2, 1.0)
    block = elastic(cube("quad4"), "quad4", "block", nu=0.0, held=((low, (1,)), (high, (0, 1, 2))))
    law = sc.Coulomb(mu)
    contact = sc.Contact(block.surface(low), FLOOR, friction=law, name="joint")
    steps = []
    for along, across in ((0.0, 0.0), (0.1, far), (0.1, 3 * far)):
        x = np.zeros(block.n)
        place, component = block.basis.doflocs, block.dof_component
        x[high(place) & (component == 0)] = along
        x[high(place) & (component == 2)] = -0.02
        if moves == "foot":
            x[component == 1] = across
            steps.append({"x": {"block": x}})
        else:
            steps.append({"x": {"block": x}, "motion": {"floor": (0.0, -across, 0.0)}})
    solver = sc.ContactSolver(block, contact, linear=linear)
    before = None
    for result in solver.history(steps):
        assert result.certificate.worst < 1e-9
        if before is not None:
            closed = result.normal_force > 0
            slip = (result.slip_vector - before.slip_vector)[closed]
            bound = mu * result.normal_force[closed]
            against = -bound[:, None] * slip / np.linalg.norm(slip, axis=1)[:, None]
            # multigrid ends at 1e-10 of the load
            force = result.tangential_force_vector[closed]
            np.testing.assert_allclose(force, against, rtol=0, atol=1e-8 * bound.max())
            assert np.all(result.status[closed] == 2) and np.abs(slip[:, 0]).min() > 0
        before = result


@pytest.mark.parametrize("dim, axis", [(2, 0), (3, 1)])
def test_round_off_of_prescribed_displacements_is_no_slip(dim, axis):
    """A foot that is held along an axis to 0.1 cos(pi / 2), which is 6e-18 and not zero, sticks."""
    ticks = [np.linspace(0, 1, 3)] * dim
    mesh, element = (fem.MeshQuad, fem.ElementQuad1()) if dim == 2 else (fem.MeshHex, fem.ElementHex1())
    basis = fem.Basis(mesh.init_tensor(*ticks), fem.ElementVector(element), intorder=2)
    low, high = at(dim - 1, 0.0), at(dim - 1, 1.0)
    parts = basis.split_indices()
    held = parts[axis][low(basis.doflocs[:, parts[axis]])]
    top = np.flatnonzero(high(basis.doflocs))
    stiffness = linear_elasticity(*lame_parameters(1.0, 0.0))
    block = sc.Body(basis, stiffness, D=np.union1d(top, held), name="block")
    floor = sc.RigidPlane((0,) * dim, (0,) * (dim - 1) + (1,), name="floor")
    solver = sc.ContactSolver(block, sc.Contact(block.surface(low), floor, friction=sc.Coulomb(0.3)))
    for moved in (0.1 * np.cos(np.pi / 2), 1e-9):
        x = np.zeros(basis.N)
        x[np.intersect1d(top, parts[-1])], x[held] = -0.02, moved
        result = solver.solve(x={"block": x})
        slips = moved == 1e-9
        assert np.all(result.status == (2 if slips else 1))
        # pressed by 0.02, with E = 1
        np.testing.assert_allclose(result.force[axis], -0.3 * 0.02 if slips else 0.0, atol=1e-12)
