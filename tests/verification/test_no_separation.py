"""Contact without separation: bonds, glue lines and guides, that pull as well as they press.

Closed forms of pull-out and shear lag, a convex problem solved by least squares with bounds, and
resultants that statics alone decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import internals
import numpy as np
import pytest
import skfem as fem
from scenes import block_basis, elastic, field
from scipy.linalg import cholesky, null_space
from scipy.optimize import lsq_linear
from skfem.helpers import sym_grad
from skfem.models.elasticity import lame_parameters
from solid_meshes import at, cube
from solid_meshes import elastic as solid

import skfem_contact as sc
from skfem_contact.conditions import escape

TAU = 5.0


def axisymmetric(E: float, nu: float) -> Any:
    """Forces per full turn."""
    lam, mu = lame_parameters(E, nu)

    @fem.BilinearForm
    def form(u: Any, v: Any, w: Any) -> Any:
        r = w.x[0]
        a, b = sym_grad(u), sym_grad(v)
        hoop, other = u[0] / r, v[0] / r
        volume = (a[0, 0] + a[1, 1] + hoop) * (b[0, 0] + b[1, 1] + other)
        both = a[0, 0] * b[0, 0] + a[1, 1] * b[1, 1] + 2 * a[0, 1] * b[0, 1] + hoop * other
        return 2 * np.pi * r * (lam * volume + 2 * mu * both)

    return form


def pulled_bar(radius: float = 8.0, length: float = 100.0, n: int = 25, **settings: Any) -> Any:
    """A steel bar in a block of concrete that is held at its face, and pulled by 1 at its end."""
    out = length * 1.2
    bar = block_basis(np.linspace(0, radius, 4), np.linspace(0, out, 6 * n // 5 + 1))
    mesh = bar.mesh.with_boundaries(
        {
            "side": lambda x: np.isclose(x[0], radius) & (x[1] < length),
            "end": lambda x: x[1] > out - 1e-9,
        }
    )
    bar = fem.Basis(mesh, bar.elem, intorder=4)
    block = block_basis(np.linspace(radius, 6 * radius, 7), np.linspace(0, length, n + 1))
    turn = {"measure": lambda x: 2 * np.pi * x[0]}
    end, pull = mesh.boundaries["end"], np.zeros(bar.N)
    pull[bar.get_dofs(end).all("u^2")] = 1.0
    D = np.concatenate([bar.get_dofs("left").all("u^1"), bar.get_dofs(end).all("u^2")])
    bodies = [
        sc.Body(bar, axisymmetric(210e3, 0.3), D=D, x=pull, name="bar", **turn),
        sc.Body(block, axisymmetric(30e3, 0.2), D=block.get_dofs("top"), name="block", **turn),
    ]
    sides = bodies[0].surface("side"), bodies[1].surface("left")
    return bodies, sc.Contact(*sides, friction=sc.Tresca(TAU), name="bond", **settings)


@pytest.mark.parametrize("method", ["mortar", "node"])
@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_pull_out_takes_the_bond_times_the_area(method, loop):
    """However the bar thins: tau times perimeter times length, where it slips all over."""
    bodies, bond = pulled_bar(separation=False, method=method)
    result = sc.ContactSolver(bodies, bond, loop=loop).solve()
    wanted = TAU * 2 * np.pi * 8.0 * 100.0
    assert abs(result.force[1] / -wanted - 1) < 1e-12
    assert result.pressure.min() < -TAU < TAU < result.pressure.max()  # it thins, and is pressed below
    assert (result.status == 2).all() and np.abs(result.gap).max() < 1e-12
    # tension is no violation: `direct` has a tangential stiffness, and the same forces
    assert result.certificate.tension == 0.0 and result.certificate.worst < 1e-9
    assert "no separation, Tresca: 0 open, 0 stick" in str(result)
    assert "largest tension" in str(result) and "friction force / normal" not in str(result)


def test_what_may_separate_loses_nearly_all_of_it():
    """The same with a contact that opens: Poisson's contraction of the bar leaves a few points."""
    bodies, bond = pulled_bar()
    result = sc.ContactSolver(bodies, bond).solve()
    assert abs(result.force[1]) < 0.1 * TAU * 2 * np.pi * 8.0 * 100.0


def test_a_bar_that_slides_out_holds_by_what_is_left():
    """Finite sliding: the force falls with the embedded length; each node leaves by itself."""
    bodies, bond = pulled_bar(length=20.0, separation=False, sliding="finite", method="node")
    bar, solver = bodies[0], sc.ContactSolver(bodies, bond)
    spacing = 20.0 / 25
    steps = [{"x": {"bar": bar.x * way}} for way in (0.5, 1.0, 2.0, 4.0)]
    for result, way in zip(solver.history(steps), (0.5, 1.0, 2.0, 4.0), strict=True):
        held = -result.force[1] / (TAU * 2 * np.pi * 8.0)
        assert abs(held - (20.0 - way)) < spacing  # it is known within one node
        assert np.abs(result.gap[result.status > 0]).max() < 1e-9


def strip(
    law: sc.conditions.FrictionLaw, pull: float, E: float = 1000.0, n: int = 200, **solver: Any
) -> Any:
    """A bar of length 100 and thickness 1 with a bond on both faces, that only stretches along x.

    With the motion across prescribed, gaps and normal forces are no unknowns: only slips are left.
    """
    basis = block_basis(np.linspace(0, 100, n + 1), [0.0, 1.0])
    x = np.zeros(basis.N)
    x[basis.get_dofs("right").all("u^1")] = pull
    D = np.concatenate([basis.get_dofs(elements=True).all("u^2"), basis.get_dofs("right").all("u^1")])
    bar = sc.Body(basis, elastic(E, 0.0), D=np.unique(D), x=x, name="bar")
    planes = {"bottom": sc.RigidPlane((0, 0), (0, 1)), "top": sc.RigidPlane((0, 1), (0, -1))}
    bonds = [
        sc.Contact(bar.surface(side), plane, friction=law, separation=False, name=side)
        for side, plane in planes.items()
    ]
    result = sc.ContactSolver([bar], bonds, **solver).solve()
    return result, -sum(result[name].force[0] for name in planes)


def test_the_slipping_length_of_a_bond_with_a_strength():
    """Shear lag of a rigid bond: ``F = sqrt(2 E A tau p pull)``, and slip over ``F / (tau p)``."""
    result, force = strip(sc.Tresca(1.0), 0.05)
    wanted = np.sqrt(2 * 1000.0 * 1.0 * 2.0 * 0.05)
    assert abs(force / wanted - 1) < 1e-4  # elements of 1/14 of the length that slips; of second order
    slips = result["top"].points[result["top"].status == 2, 0]
    # within one element, and the half that the last node stands for beyond itself
    assert abs(100 - slips.min() - wanted / 2.0) < 0.75


@dataclass(frozen=True, eq=False)
class BondSlip(sc.conditions.FrictionLaw):
    """Shear that grows with the slip up to a strength, whatever presses."""

    shear_stiffness: float = 2.0  # stress / length
    strength: float = 10.0

    def limit(self, normal_force: Any, area: Any, slip: Any) -> Any:
        size = np.linalg.norm(slip, axis=1)
        return area * np.minimum(self.shear_stiffness * size, self.strength)


@pytest.mark.parametrize("loop, linear", [("newton", "auto"), ("newton", sc.linalg.Direct())], ids=str)
def test_shear_lag_of_a_bond_that_gives(loop, linear):
    """``F = E A lambda pull tanh(lambda l)``, ``lambda^2 = k p / (E A)`` (Volkersen 1938).

    A law without any bound at rest: every point slips, and which way, nothing has told when it begins.
    """
    result, force = strip(BondSlip(), 0.01, n=100, loop=loop, linear=linear)
    rate = np.sqrt(2.0 * 2.0 / 1000.0)
    assert abs(force / (1000.0 * rate * 0.01 * np.tanh(rate * 100)) - 1) < 1e-3  # (rate h)^2 / 8
    values = result["top"]
    stress = -np.sum(values.friction_stress * np.sign(values.slip), axis=1)
    assert np.allclose(stress, 2.0 * np.abs(values.slip[:, 0]), rtol=1e-6)
    assert result.certificate.worst < 1e-9


def two_blocks(nx: int = 6, kind: str = "Q1") -> tuple[sc.Body, sc.Body]:
    """A block of other elements on one that is held, and nothing else holds it."""
    low = block_basis(np.linspace(0, 2, 5), np.linspace(-1, 0, 3), kind=kind)
    up = block_basis(np.linspace(0, 2, nx + 1), np.linspace(0, 1, 4), kind=kind)
    lower = sc.Body(low, elastic(1.0, 0.3), D=low.get_dofs("bottom"), name="lower")
    return lower, sc.Body(up, elastic(2.0, 0.2), name="upper")


@pytest.mark.parametrize("method", ["mortar", "node"])
@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_a_bond_of_given_strength_is_least_squares_with_bounds(method, loop):
    """Forces of the bond minimise the complementary energy within +-L: found by another solver."""
    lower, upper = two_blocks()
    law = sc.Tresca(0.004, stiffness=np.inf)
    sides = upper.surface("bottom"), lower.surface("top")
    bond = sc.Contact(*sides, friction=law, separation=False, method=method)
    solver = sc.ContactSolver([lower, upper], bond, loop=loop)
    system, kin = sc.bodies.stack([lower, upper]), solver.kin
    rng, seen = np.random.default_rng(3), set()
    for _ in range(3):
        load = np.zeros(upper.n)
        top = upper.basis.get_dofs("top").all()
        load[top] = 0.02 * rng.standard_normal(len(top))
        load[top[0::2]] -= load[top[0::2]].mean()  # what shears the whole bond
        result = solver.solve(f={"upper": load})
        # displacements that keep the gaps closed and the supports still
        free = np.setdiff1d(np.arange(system.n), system.D)
        Z = null_space(kin.B_n.toarray()[:, free])
        K = Z.T @ system.K.toarray()[np.ix_(free, free)] @ Z
        f = Z.T @ np.r_[np.zeros(lower.n), load][free]
        B = kin.B_t.toarray()[:, free] @ Z
        # min over u of u'Ku/2 - f'u + L|Bu|: the dual is min |U^-T (f - B' tau)|^2 within bounds.
        # the block slides freely along the interface: weak springs, far softer than all else
        U = cholesky(K + 1e-9 * np.eye(len(K)))
        bound = 0.004 * kin.area
        A, b = np.linalg.solve(U.T, B.T), np.linalg.solve(U.T, f)
        tau = lsq_linear(A, b, (-bound, bound), method="bvls", tol=1e-14).x
        assert np.abs(tau + result.tangential_force[:, 0]).max() < 1e-5 * bound.max()
        seen |= {int(k) for k in result.status}
        assert result.pressure.min() < 0 < result.pressure.max()
    assert seen == {1, 2}


@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_coulomb_counts_pressure_only(loop):
    """Bent and dragged: one half is pressed, the other pulled; friction is mu times what presses."""
    lower, upper = two_blocks()
    top = upper.basis.get_dofs("top")
    D, x = top.all(), field(upper.basis, lambda p: [0.05 + 0 * p[0], 0.005 * (p[0] - 1.2)])
    upper = sc.Body(upper.basis, upper.K, D=D, x=x, name="upper")
    bond = sc.Contact(
        upper.surface("bottom"), lower.surface("top"), friction=sc.Coulomb(0.4), separation=False
    )
    result = sc.ContactSolver([lower, upper], bond, loop=loop).solve()
    pressed = np.maximum(result.normal_force, 0.0)
    assert result.normal_force.min() < -5e-4 and pressed.max() > 5e-4
    assert (
        np.abs(result.tangential_force[:, 0] + 0.4 * pressed * np.sign(result.slip[:, 0])).max() < 1e-12
    )
    assert (result.status == 2).all() and np.abs(result.gap).max() < 1e-14
    assert result.certificate.worst < 1e-10 and result.dissipation > 0
    assert "no separation, Coulomb" in repr(result[0])


@pytest.mark.parametrize(
    "method, kind, linear", [("mortar", "quad4", "auto"), ("node", "tri3", sc.linalg.Direct())]
)
def test_a_pulled_plate_slips_obliquely_at_its_strength(method, kind, linear):
    """Solids: dragged in any direction under tension, tau A against the slip; tension from statics."""
    low, up = cube(kind, 2, lambda x: x * 2 - [[0.5], [0.5], [2]]), cube(kind, 3)
    lower = solid(low, kind, "lower", held=((at(2, -2.0), (0, 1, 2)),))
    upper = solid(up, kind, "upper", held=((at(2, 1.0), (0, 1)),), push=(at(2, 1.0), (0.03, 0.04, 0.0)))
    pull = np.zeros(upper.n)
    pull[upper.basis.get_dofs(lambda x: np.isclose(x[2], 1.0)).all("u^3")] = 1e-4 / 16
    sides = [b.surface(lambda x: np.isclose(x[2], 0.0)) for b in (upper, lower)]
    bond = sc.Contact(*sides, friction=sc.Tresca(2e-4), separation=False, method=method)
    result = sc.ContactSolver([lower, upper], bond, linear=linear).solve(f={"upper": pull})
    assert (result.status == 2).all()
    assert abs(result.force[2] + 1e-4) < 1e-15  # hangs on it
    # the faces deform, so that slips are not quite parallel; their sizes are all at the bound
    size = np.linalg.norm(result.tangential_force, axis=1)
    assert np.allclose(size, 2e-4 * result.area, rtol=1e-9)
    drag = result.force[:2] @ [0.6, 0.8]
    assert -2e-4 <= drag < -1.98e-4
    assert result.certificate.worst < 1e-10


def test_the_proximal_point_ends_where_newton_does(monkeypatch):
    """Solids: from springs in series, whose forces pull as well, to the answer of Newton's method."""
    lower = solid(
        cube("quad4", 2, lambda x: x - [[0], [0], [1]]),
        "quad4",
        "lower",
        held=((at(2, -1.0), (0, 1, 2)),),
    )
    upper = solid(
        cube("quad4", 3),
        "quad4",
        "upper",
        held=((at(2, 1.0), (0, 1, 2)),),
        push=(at(2, 1.0), (0.004, 0.003, 0.01)),
    )
    sides = [b.surface(lambda x: np.isclose(x[2], 0.0)) for b in (upper, lower)]
    bond = sc.Contact(*sides, friction=sc.Tresca(4.3e-4), separation=False)
    usual = sc.ContactSolver([lower, upper], bond).solve()
    assert {int(k) for k in usual.status} == {1, 2} and usual.pressure.max() < 0
    internals.replace(monkeypatch, "loops.STARTS", ("proximal", "proximal"))
    near = sc.ContactSolver([lower, upper], bond).solve()
    assert np.abs(near.u - usual.u).max() < 1e-9 * np.abs(usual.u).max()


def test_statics_knows_that_a_bond_pulls():
    """No motion is driven that it could not stop, but along a guide without friction."""
    lower, upper = two_blocks()
    sides = upper.surface("bottom"), lower.surface("top")
    lifted, pushed = np.zeros(lower.n + upper.n), np.zeros(lower.n + upper.n)
    lifted[lower.n + upper.basis.get_dofs("top").all("u^2")] = 0.01
    pushed[lower.n + upper.basis.get_dofs("top").all("u^1")] = 0.01
    for settings, stops in (({}, (False, False)), ({"separation": False}, (True, False))):
        model = sc.ContactSolver([lower, upper], sc.Contact(*sides, **settings)).linear_model
        known = model.motions, model.interface, model.kin.paired
        assert tuple(escape(*known, f) is None for f in (lifted, pushed)) == stops


def test_a_bar_in_a_hole_of_a_solid():
    """Four sides of a square bar, edges too: the strength times perimeter times length."""
    n, kind = 4, "quad4"
    t, z = np.linspace(0, 1, n + 1), np.linspace(0, 3, 7)
    bar = solid(
        fem.MeshHex.init_tensor(t, t, z),
        kind,
        "bar",
        push=(at(2, 3.0), (0, 0, 0.01)),
        held=((at(2, 3.0), (0, 1, 2)),),
    )
    wide = np.linspace(-1, 2, 3 * n + 1)
    mesh = fem.MeshHex.init_tensor(wide, wide, np.linspace(0, 2, 5))
    x, y, _ = mesh.p[:, mesh.t].mean(axis=1)
    hole = np.flatnonzero((x > 0) & (x < 1) & (y > 0) & (y < 1))
    block = solid(mesh.remove_elements(hole), kind, "block", held=((at(2, 2.0), (0, 1, 2)),))

    def flank(x):
        inside = (x[:2] > -1e-9).all(axis=0) & (x[:2] < 1 + 1e-9).all(axis=0)
        edge = np.isclose(x[0], 0) | np.isclose(x[0], 1) | np.isclose(x[1], 0) | np.isclose(x[1], 1)
        return inside & edge & (x[2] < 2.001)

    sides = bar.surface(flank, nodes=True), block.surface(flank, nodes=True)
    bond = sc.Contact(*sides, friction=sc.Tresca(1e-4), separation=False, method="node")
    result = sc.ContactSolver([block, bar], bond).solve()
    assert abs(result.force[2] / -(1e-4 * 4 * 2) - 1) < 1e-3
    assert (result.status == 2).all() and result.pressure.min() < 0


def test_a_slider_stays_on_a_round_guide():
    """Finite sliding: drawn along a rigid cylinder and pulled off it, each point keeps its gap."""
    radius, pull, ways = 50.0, 0.02, (0.5, 2.0, 4.0)
    basis = block_basis(np.linspace(-1, 1, 9), np.linspace(0, 1, 5))
    x, f, top = np.zeros(basis.N), np.zeros(basis.N), basis.get_dofs("top")
    x[top.all("u^1")], f[top.all("u^2")] = 1.0, pull / 9
    slider = sc.Body(basis, elastic(1.0, 0.3), f, D=top.all("u^1"), x=x, name="slider")
    guide = sc.RigidCylinder((0, -radius), radius)
    held = sc.Contact(slider.surface("bottom"), guide, separation=False, sliding="finite")
    first = np.linalg.norm(held.secondary.points + [0, radius], axis=1)  # it is plane
    steps = [{"x": {"slider": way * x}, "f": {"slider": f}} for way in ways]
    for result in sc.ContactSolver([slider], held).history(steps):
        moved = held.secondary.points + result.u[held.secondary.dofs]
        # on the pairing of its answer, which is settled to 1e-4 of the extent
        assert np.abs(np.linalg.norm(moved + [0, radius], axis=1) - first).max() < 1e-4
        assert result.pressure.min() < 0 and abs(result.force[1] + pull) < 1e-12
        assert result.certificate.worst < 1e-10


def test_a_hung_body_takes_its_weight_in_tension():
    """Only a bond holds it, without friction: what is free along it is said to be."""
    lower, upper = two_blocks()
    hung = sc.Contact(upper.surface("bottom"), lower.surface("top"), separation=False, name="hung")
    up = np.zeros(upper.n)
    up[upper.basis.get_dofs("top").all("u^2")] = 0.01 / 7
    with pytest.warns(sc.ContactWarning, match="translation along x"):
        result = sc.ContactSolver([lower, upper], hung).solve(f={"upper": up})
    assert np.allclose(result.force, [0, -0.01], atol=1e-12) and result.pressure.max() < 0.01
    assert "no separation, frictionless" in str(result)
    push = np.zeros(upper.n)
    push[upper.basis.get_dofs("top").all("u^1")] = 0.01
    with pytest.raises(sc.errors.NoEquilibrium, match="translation along x"):
        sc.ContactSolver([lower, upper], hung).solve(f={"upper": push})


def test_a_bond_that_its_load_exceeds_is_no_equilibrium():
    """More shear than strength times area: refused, whichever way it is pulled."""
    lower, upper = two_blocks()
    law = sc.Tresca(0.02)
    bond = sc.Contact(upper.surface("bottom"), lower.surface("top"), friction=law, separation=False)
    load = np.zeros(upper.n)
    dofs = upper.basis.get_dofs("bottom").all("u^1")
    load[dofs] = 0.05 / len(dofs)
    solver = sc.ContactSolver([lower, upper], bond)
    result = solver.solve(f={"upper": 0.79 * load})  # 0.02 times 2 is the strength of 0.04
    assert abs(result.force[0] + 0.79 * 0.05) < 1e-12
    with pytest.raises(sc.errors.NoEquilibrium):
        solver.solve(f={"upper": 0.81 * load})


def test_words():
    """What is modelled and refused."""
    lower, upper = two_blocks()
    sides = upper.surface("bottom"), lower.surface("top")
    bond = sc.Contact(*sides, friction=sc.Tresca(0.02), separation=False)
    assert "no separation: gaps are zero, also in tension; friction Tresca" in str(
        sc.ContactSolver([lower, upper], bond)
    )
    with pytest.raises(sc.errors.InputError, match=r"separation=False, friction="):
        sc.Contact(*sides, friction=sc.Tresca(0.02), tied=True)
    with pytest.raises(TypeError, match="write separation=False"):
        sc.Contact(*sides, no_separation=True)
    with pytest.raises(sc.errors.InputError, match="separation"):
        sc.Contact(*sides, separation="no")
    held = [
        sc.Body(b.basis, b.K, D=b.basis.get_dofs(), x=np.tile([0.0, v], b.n // 2), name=b.name)
        for b, v in ((lower, 0.0), (upper, 0.1))
    ]
    torn = sc.Contact(held[1].surface("bottom"), held[0].surface("top"), separation=False)
    with pytest.raises(sc.errors.ConstraintError, match="holds together 7 points"):
        sc.ContactSolver(held, torn).solve()


@pytest.mark.parametrize("linear", [sc.linalg.Direct(), "iterated"])
@pytest.mark.parametrize("separation", [True, False])
def test_a_guide_that_is_pushed_along_has_no_equilibrium(linear, separation):
    """Nothing is to be decided where all points are guided; each way of solving says what is free."""
    pad = block_basis(np.linspace(-0.5, 0.5, 5), np.linspace(0, 1, 4))
    track = block_basis(np.linspace(-1, 1, 7), np.linspace(-1, 0, 3))
    pad = sc.Body(pad, elastic(1.0, 0.3), f={"top": (0.002, -0.01)}, name="pad")
    track = sc.Body(track, elastic(1.0, 0.3), D="bottom", name="track")
    guide = sc.Contact(
        pad.surface("bottom"), track.surface("top"), separation=separation, sliding="finite"
    )
    with pytest.raises(sc.errors.NoEquilibrium, match="'pad' is free to move: translation along x"):
        sc.ContactSolver([pad, track], guide, linear=linear).solve()


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("kind", [{"tied": True}, {"separation": False}])
def test_glue_that_reaches_nothing_is_refused(sliding, kind):
    """Two surfaces 0.02 apart and a reach of 0.01: glued to nothing, whatever may come later."""
    pad = block_basis(np.linspace(-0.5, 0.5, 5), np.linspace(0.02, 1, 4))
    track = block_basis(np.linspace(-1, 1, 7), np.linspace(-1, 0, 3))
    pad = sc.Body(pad, elastic(1.0, 0.3), D="top", name="pad")
    track = sc.Body(track, elastic(1.0, 0.3), D="bottom", name="track")

    def glued(reach):
        glue = sc.Contact(
            pad.surface("bottom"), track.surface("top"), reach=reach, sliding=sliding, **kind
        )
        return sc.ContactSolver([pad, track], glue)

    with pytest.raises(sc.errors.InputError, match="None of the 5 points"):
        glued(0.01)
    assert np.isfinite(glued(0.03).solve(x={"pad": {"top": (0, 0.01)}}).gap).all()
