"""Bodies that are not linear and their contact, in one loop: closed forms, balances, counts."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.materials import FromFunction

LARGE = "large strains need a material of finite strain."
E, NU, YIELD, H = 210e3, 0.3, 300.0, 2100.0


def rectangle(x0: float, x1: float, y0: float, y1: float, nx: int, ny: int) -> fem.Basis:
    mesh = fem.MeshQuad.init_tensor(np.linspace(x0, x1, nx + 1), np.linspace(y0, y1, ny + 1))
    return fem.Basis(mesh.with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2)


def turned(basis: fem.Basis, angle: float, scale: float = 1.0) -> fem.Basis:
    """The same body turned about the origin and scaled."""
    c, s = np.cos(angle), np.sin(angle)
    mesh = basis.mesh
    mesh = type(mesh)(
        scale * (np.array([[c, -s], [s, c]]) @ mesh.p), mesh.t, _boundaries=mesh.boundaries
    )
    return fem.Basis(mesh, basis.elem, intorder=2)


def hardening(stress: float = 1.0) -> sc.J2:
    return sc.J2(E * stress, NU, [[YIELD * stress, 0.0], [(YIELD + H) * stress, 1.0]])


def pressed(
    angle: float = 0.0,
    scale: float = 1.0,
    stress: float = 1.0,
    flipped: bool = False,
    options: Any = None,
    law: Any = None,
    mu: float = 0.2,
) -> tuple[sc.ContactSolver, Callable[[float, float], dict[str, Any]]]:
    """A billet that yields under an elastic tool with friction; and its steps: down and along."""
    low = turned(rectangle(0, 1, 0, 1, 6, 6), angle, scale)
    high = turned(rectangle(-0.25, 1.15, 1, 1.5, 8, 3), angle, scale)
    billet = sc.NonlinearBody(low, law or hardening(stress), D="bottom", name="billet")
    steel = linear_elasticity(*lame_parameters(E * stress, NU))
    tool = sc.Body(high, steel, D="top", name="tool")
    contact = sc.Contact(
        billet.surface("top"), tool.surface("bottom"), friction=sc.Coulomb(mu), name="contact"
    )
    bodies = [tool, billet] if flipped else [billet, tool]

    def step(down: float, along: float) -> dict[str, Any]:
        c, s = np.cos(angle), np.sin(angle)
        return {
            "x": {"tool": {"top": (scale * (c * along + s * down), scale * (s * along - c * down))}}
        }

    return sc.ContactSolver(bodies, [contact], options=options), step


WAY = [(0.002, 0.0), (0.006, 0.0), (0.01, 0.001), (0.01, 0.004), (0.008, 0.004)]


@pytest.fixture(scope="module")
def results() -> list[sc.answers.ContactResult]:
    solver, step = pressed()
    return list(solver.history([step(*way) for way in WAY]))


def test_equations_hold_with_the_internal_forces_themselves(
    results: list[sc.answers.ContactResult],
) -> None:
    """The certificate judges f_int(u), not the last linearised problem: it holds beyond yield."""
    for result in results:
        assert result.certificate.worst < 1e-9  # the tolerance of equilibrium, and a digit
    assert results[-1].state["billet"]["plastic_strain"].max() > 0.005
    assert list(results[-1].state) == ["billet"]


def test_residuals_fall_quadratically(results: list[sc.answers.ContactResult]) -> None:
    """The last three residuals of a step: each below the square of the one before, times a factor."""
    print(results[1].newton)
    a, b, c = (iteration.residual for iteration in results[1].newton[-3:])
    assert a < 1e-2
    assert b < 10 * a**2
    assert c < max(10 * b**2, 1e-12)  # round-off of the forces
    assert len(str(results[1].newton).splitlines()) == len(results[1].newton)


def test_the_estimate_says_that_meshes_may_be_too_stiff_in_bending(
    results: list[sc.answers.ContactResult],
) -> None:
    """Of bodies that are not linear no part of the estimate shows it."""
    estimate = results[0].error_estimate
    assert np.isnan(estimate.traction.bodies)
    assert (
        "in bending, is not in it: a body is not linear; compare with a finer mesh" in estimate.advice
    )


def test_a_step_back_is_elastic(results: list[sc.answers.ContactResult]) -> None:
    """What yielded is linearised a little way back, where it is elastic, not at its yield surface.

    There round-off chooses between two tangents, point by point: it took 3 to 11 linearisations.
    """
    assert len(results[-1].newton) == 1


def test_the_tool_is_condensed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A linear body keeps its factorisation over all iterates; the other has one for each."""
    counted: list[int] = []
    original = internals.original("problem.Substructure._factorised")

    def counting(part: Any) -> Any:
        counted.append(part.body.nonlinear)
        return original(part)

    internals.replace(monkeypatch, "problem.Substructure._factorised", counting)
    solver, step = pressed()
    results = list(solver.history([step(*way) for way in WAY[:3]]))
    assert counted.count(False) == 1
    assert counted.count(True) == sum(len(result.newton) for result in results)


def test_restart_to_the_last_bit(tmp_path: Path) -> None:
    """A file keeps what the material remembers: another solver goes on as if never interrupted.

    Nor does the elastic tool remember loads from before, which lie in other directions.
    """
    solver, step = pressed()
    ways = [(0.002, 0.0005), (0.006, 0.001), (0.01, 0.0012), (0.0098, 0.004), (0.011, 0.003)]
    results = list(solver.history([step(*way) for way in ways]))
    path = solver.save_state(tmp_path / "state", results[1])
    for other in (solver, pressed()[0]):
        *_, last = other.history([step(*way) for way in ways[2:]], start=other.load_state(path))
        assert np.array_equal(last.u, results[-1].u)
        for name, value in results[-1].state["billet"].items():
            assert np.array_equal(last.state["billet"][name], value)


def test_a_state_of_linear_bodies_is_no_start() -> None:
    """Nobody knows what a material remembers of a state of linear bodies."""
    solver, step = pressed()
    billet, tool = solver.system.bodies
    assert isinstance(billet, sc.Body)
    linear = sc.Body(billet.basis, billet.K, D="bottom", name="billet")
    contact = sc.Contact(linear.surface("top"), tool.surface("bottom"), name="contact")
    start = sc.ContactSolver([linear, tool], [contact]).solve(**step(0.001, 0.0))
    with pytest.raises(sc.errors.InputError, match="no internal variables"):
        solver.solve(start=start)


def test_cut_steps_change_nothing_committed(results: list[sc.answers.ContactResult]) -> None:
    """A step that fails leaves the material as it was: what follows is the same to the last bit."""
    solver, step = pressed(options=sc.Options(max_placements=3, max_cuts=0))
    before = results[0]
    known = {name: np.array(value) for name, value in before.state["billet"].items()}
    with pytest.raises(sc.errors.NotConverged, match="bear up to 0 of this step") as failed:
        solver.solve(**step(0.03, 0.02), start=before)
    assert not failed.value.result.converged
    assert failed.value.result.certificate.equilibrium > 1e-9  # and says so
    for name, value in before.state["billet"].items():
        assert np.array_equal(value, known[name])
    again = pressed()[0].solve(**step(*WAY[1]), start=before)
    assert np.array_equal(again.u, results[1].u)


def test_a_step_is_cut_where_it_takes_too_long() -> None:
    """Too few linearisations for the whole step: parts of it arrive, each from where the last ended."""
    solver, step = pressed(options=sc.Options(max_placements=4))
    result = solver.solve(**step(0.02, 0.0))
    assert "step cut" in result.message
    assert result.newton[-1].aim == 1.0 and result.newton[0].aim == 1.0
    assert len({iteration.aim for iteration in result.newton}) > 1
    assert result.certificate.worst < 1e-9


@pytest.mark.parametrize("angle", [np.pi / 2, np.pi / 6])
def test_turned_and_in_other_units(results: list[sc.answers.ContactResult], angle: float) -> None:
    """Turned, in metres and pascals for millimetres and megapascals, and listed the other way round."""
    solver, step = pressed(angle, scale=1e-3, stress=1e6, flipped=True)
    *_, last, open_again = solver.history([step(*way) for way in WAY])
    force = results[-2].force
    c, s = np.cos(angle), np.sin(angle)
    there = 1e3 * np.array([c * force[0] - s * force[1], s * force[0] + c * force[1]])
    assert_allclose(last.force, there, rtol=0, atol=1e-8 * np.linalg.norm(there))
    found, expected = open_again.state["billet"], results[-1].state["billet"]
    found, expected = found["equivalent_plastic_strain"], expected["equivalent_plastic_strain"]
    assert_allclose(found, expected, rtol=0, atol=1e-8 * expected.max())


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("elements", [(3, 4), (7, 5)])
def test_confined_blocks(sliding: str, elements: tuple[int, int]) -> None:
    """Two neo-Hookean blocks squeezed by 30 %: pressure and stretches of the closed form, any mesh."""
    low, high = rectangle(0, 1, 0, 1, elements[0], 2), rectangle(0, 1, 1, 2, elements[1], 3)
    blocks = []
    for basis, modulus, nu, end in ((low, 1.0, 0.3, "bottom"), (high, 3.0, 0.2, "top")):
        D = np.union1d(basis.get_dofs(["left", "right"]).all("u^1"), basis.get_dofs(end).all())
        blocks.append(sc.NonlinearBody(basis, sc.materials.NeoHooke.of(modulus, nu), D=D, name=end))
    contact = sc.Contact(blocks[1].surface("bottom"), blocks[0].surface("top"), sliding=sliding)
    result = sc.ContactSolver(blocks, [contact]).solve(x={"top": {"top": (0.0, -0.6)}})
    assert_allclose(result.pressure, 0.8547955137, rtol=1e-9)
    below = result.displacement("bottom")[low.get_dofs("top").all("u^2")]
    assert_allclose(1 + below, 0.6123119944, rtol=1e-9)
    assert len(result.newton) <= 5
    assert result.validity.holds  # a strain of .4 is no fault of these bodies


def tresca(nu: float, limit: float) -> Callable[..., Any]:
    """Tresca's yield in the plane of hoop and radius, of an axisymmetric body; no hardening."""
    lame, mu = lame_parameters(E, nu)
    flow, one = np.diag([-1.0, 0.0, 1.0])[:, :, None, None], np.eye(3)
    elastic = lame * np.einsum("ij,kl->ijkl", one, one)
    elastic += mu * (np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one))
    flows = mu * np.einsum("ij,kl->ijkl", flow[..., 0, 0], flow[..., 0, 0])[..., None, None]

    def law(gradient: Any, state: Any) -> Any:
        strain = 0.5 * (gradient + gradient.swapaxes(0, 1)) - state["plastic"]
        stress = np.einsum("ijkl,kl...->ij...", elastic, strain)
        beyond = np.maximum(stress[2, 2] - stress[0, 0] - limit, 0.0)
        plastic = beyond / (4 * mu) * flow
        tangent = elastic[..., None, None] - np.where(beyond > 0, flows, 0.0)
        return stress - 2 * mu * plastic, tangent, {"plastic": state["plastic"] + plastic}

    return law


def test_shrink_ring_beyond_yield() -> None:
    """A hub shrunk on a solid shaft yields from inside (Hill): pressures over the interference."""
    a, b, count = 50.0, 100.0, 20
    mesh = [
        fem.MeshQuad.init_tensor(np.linspace(*ends, count + 1), np.array([0.0, 1.0])).with_defaults()
        for ends in ((0.0, a), (a, b))
    ]
    inner, outer = (fem.Basis(m, fem.ElementVector(fem.ElementQuad2()), intorder=4) for m in mesh)
    measure = lambda x: 2 * np.pi * x[0]  # noqa: E731
    axial = [np.unique(basis.get_dofs(elements=True).all("u^2")) for basis in (inner, outer)]
    D = np.union1d(axial[0], inner.get_dofs("left").all("u^1"))
    shaft = sc.NonlinearBody(inner, sc.Elastic(E, NU), D=D, measure=measure, name="shaft")
    law = FromFunction(tresca(NU, YIELD), {"plastic": np.zeros((3, 3))})
    hub = sc.NonlinearBody(outer, law, D=axial[1], measure=measure, name="hub")
    fit = sc.Contact(shaft.surface("right"), hub.surface("left"), name="fit")
    steps = [{"interference": {"fit": value}} for value in (0.065, 0.09, 0.13, 0.2, 0.26)]
    results = list(sc.ContactSolver([shaft, hub], [fit]).history(steps))
    pressures = [result.pressure.mean() for result in results]
    # the radius to which it yields lies within an element: 1e-4 at 20 of second order
    assert_allclose(pressures, [112.5, 146.8903, 178.9721, 203.2049, 207.9442], rtol=1e-4)
    assert all(len(result.newton) <= 5 for result in results)


def billet(friction: float, n: int, hardening: float = 0.0) -> sc.ContactSolver:
    """Half of a cylinder as high as its radius, under a rough platen; yield stress 1."""
    basis = rectangle(0, 1, 0, 0.5, n, n // 2)
    D = np.union1d(basis.get_dofs("left").all("u^1"), basis.get_dofs("bottom").all("u^2"))
    law = sc.J2(1000.0, 0.3, [[1.0, 0.0], [1.0 + hardening, 1.0]])
    body = sc.NonlinearBody(basis, law, D=D, measure=lambda x: 2 * np.pi * x[0], name="billet")
    platen = sc.RigidPlane((0, 0.5), (0, -1), name="platen")
    limit = sc.Tresca(friction / 3**0.5) if friction else None
    return sc.ContactSolver(body, sc.Contact(body.surface("top"), platen, friction=limit))


@pytest.mark.parametrize(
    ("friction", "low", "high"),
    # without friction the yield stress; else between that and the upper bound of a parallel flow
    [(0.0, 1 - 1e-6, 1 + 1e-6), (0.5, 1.0, 1.1925), (1.0, 1.0, 1.385)],
)
def test_billets_between_rough_platens(friction: float, low: float, high: float) -> None:
    """The limit load of a billet without hardening, whose tangents are singular in plastic flow."""
    steps = [{"motion": {"platen": (0, -down)}} for down in (0.0005, 0.001, 0.002, 0.004)]
    *_, result = billet(friction, 12).history(steps)
    assert low < -result.force[1] / np.pi < high


def test_a_limit_load_is_named() -> None:
    """Forces beyond the limit load have no equilibrium: the error says how much was borne."""
    basis = rectangle(0, 1, 0, 1, 2, 2)
    D = basis.get_dofs("left").all("u^1")
    block = sc.NonlinearBody(basis, sc.J2(1000.0, 0.3, 1.0), D=D, f={"top": (0.0, -1.0)}, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    foot = sc.Contact(block.surface("bottom"), floor)
    solver = sc.ContactSolver(block, foot, options=sc.Options(max_cuts=4))
    # in plane strain it yields at 2 / sqrt(3) = 1.1547; parts of a step are at least .3 / 16
    with pytest.raises(sc.errors.NotConverged, match=r"load factor of 1\.1[45]") as failed:
        list(solver.history([1.0, 1.3]))
    assert "limit point" in str(failed.value)
    assert len(failed.value.results) == 1


def test_energy_balance() -> None:
    """Work of the supports goes into bodies, plastic flow and friction: small steps miss little.

    The backward Euler steps of plastic flow miss a part of second order, which halves with the step.
    """
    missing = []
    for count in (4, 8):
        solver, step = pressed()
        work, last, force = 0.0, np.zeros(2), np.zeros(2)
        steps = [np.array(WAY[1]) * k / count for k in range(1, count + 1)]
        steps += [np.array(WAY[1]) + (0, 0.003 * k / count) for k in range(1, count + 1)]
        for way, result in zip(steps, solver.history([step(*w) for w in steps]), strict=True):
            now = result.reaction("tool")
            work += 0.5 * (now + force) @ (np.array([way[1], -way[0]]) - last)
            last, force = np.array([way[1], -way[0]]), now
        billet, tool = solver.system.bodies
        u = result.displacement(tool)
        stored, lost = billet.energy(result.displacement(billet), result.state["billet"])
        total = stored + lost + 0.5 * u @ tool.K @ u + result.dissipation_total
        missing.append(abs(work - total) / work)
    assert missing[1] < 0.02
    assert missing[1] < 0.6 * missing[0]


def test_contact_on_an_iterate_takes_few_iterations() -> None:
    """After the first linearisation of a step contact takes three iterations, of four that it wants.

    With fewer a step like this is cut; with more the linearisations are as many.
    """
    solver, step = pressed()
    first, *others = solver.solve(**step(0.005, 0.005)).newton
    assert first.contact > 3
    assert max(iteration.contact for iteration in others) == 3
    assert len(others) <= 6


def test_solve_and_history_take_the_same() -> None:
    """A load step may be given to either, with interference and motion; a guess changes no answer."""
    solver = billet(0.5, 6)
    down = {"motion": {"platen": (0, -0.002)}}
    one = solver.solve(**down)
    (other,) = solver.history([down])
    assert np.array_equal(one.u, other.u)
    (guessed,) = solver.history([down], guess=one)
    assert_allclose(guessed.u, one.u, atol=1e-8 * np.abs(one.u).max())


def test_solids_that_yield_under_friction() -> None:
    """In space, where directions of friction turn: as quick as in the plane."""
    ends = [(0.0, 1.0, 3, 2), (1.0, 1.5, 4, 1)]
    bases = []
    for low, high, n, m in ends:
        side = np.linspace(0, 1, n + 1)
        mesh = fem.MeshHex.init_tensor(side, side, np.linspace(low, high, m + 1))
        bases.append(fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2))
    foot = bases[0].get_dofs(lambda x: x[2] < 1e-9)
    head = bases[1].get_dofs(lambda x: x[2] > 1.5 - 1e-9)
    move = bases[1].zeros()
    move[head.all("u^3")], move[head.all("u^1")] = -0.01, 0.004
    billet = sc.NonlinearBody(bases[0], hardening(), D=foot, name="billet")
    tool = sc.Body(bases[1], sc.Elastic(2 * E, NU), D=head, x=move, name="tool")
    sides = [body.surface(lambda x: np.abs(x[2] - 1) < 1e-9) for body in (billet, tool)]
    contact = sc.Contact(*sides, friction=sc.Coulomb(0.2))
    for result in sc.ContactSolver([billet, tool], [contact]).history([0.5, 1.0]):
        assert len(result.newton) <= 8
        assert result.certificate.worst < 1e-9


def test_a_callback_ends_the_loop() -> None:
    """A StopIteration ends the solve where it stands, as with linear bodies."""
    seen: list[sc.loops.Record] = []

    def impatient(record: sc.loops.Record) -> None:
        seen.append(record)
        if len(seen) == 2:
            raise StopIteration

    solver, step = pressed()
    result = solver.solve(**step(0.005, 0.005), callback=impatient, throw=False)
    assert not result.converged
    assert "stopped by the callback" in result.message
    assert len(seen) == 2


def test_a_body_that_nothing_holds_is_named() -> None:
    """A billet that is pushed along a smooth floor has no equilibrium, linear or not."""
    basis = rectangle(0, 1, 0, 1, 2, 2)
    load = {"top": (0.1, -1.0)}
    block = sc.NonlinearBody(basis, sc.J2(1000.0, 0.3, 2.0), f=load, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    with pytest.raises(sc.errors.NoEquilibrium, match="translation along x"):
        sc.ContactSolver(block, sc.Contact(block.surface("bottom"), floor)).solve()


def test_wear_is_refused() -> None:
    """What wears off is not solved together with bodies that are not linear."""
    solver, _ = pressed()
    billet, tool = solver.system.bodies
    assert isinstance(billet, sc.Body) and isinstance(tool, sc.Body)
    contact = sc.Contact(
        billet.surface("top"),
        tool.surface("bottom"),
        friction=sc.Coulomb(0.2),
        wear=sc.conditions.Archard(1e-6),
    )
    with pytest.raises(sc.errors.InputError, match="wear"):
        sc.ContactSolver([billet, tool], [contact]).solve()


def test_a_column_that_buckles() -> None:
    """Rubber pressed beyond its buckling load: tangents are not positive definite on the way, and pass.

    Euler's load of a column of width b and height L that both ends hold upright strains it by
    (pi b / L)^2 / 3: 3.7 % of this one, which is pressed by 7 %, and gives way to the side.
    """
    basis = rectangle(-0.5, 0.5, 0, 9.5, 2, 19)
    rubber = sc.materials.NeoHooke.of(1.0, 0.3)
    push = basis.zeros()
    push[basis.get_dofs(lambda x: abs(x[1] - 4.75) < 0.3).all("u^1")] = 1e-5
    column = sc.NonlinearBody(basis, rubber, f=push, D="bottom", name="column")
    plate = rectangle(-2, 2, 9.5, 10.5, 4, 1)
    head = sc.Body(plate, sc.Elastic(1000.0, 0.3), D="top", name="head")
    foot = sc.Contact(column.surface("top"), head.surface("bottom"), tied=True)
    steps = [{"x": {"head": {"top": (0.0, -0.05 * k)}}} for k in range(1, 15)]
    solver = sc.ContactSolver([column, head], [foot])
    forces, aside = [], []
    for result in solver.history(steps):
        forces.append(-result.reaction("head")[1])
        aside.append(result.displacement("column")[basis.get_dofs("right").all("u^1")].max())
        assert result.certificate.equilibrium < 1e-9
    assert aside[-1] > 1.0  # half of a width and more
    assert max(forces) < 1.25 * forces[6]  # of a straight column twice that


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")
@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_a_load_that_is_taken_off_altogether(sliding: str) -> None:
    """In the end nothing acts: round-off is that of what the step began with, and no force is left."""
    basis = rectangle(0, 1, 0, 1, 8, 4)
    block = sc.NonlinearBody(basis, sc.materials.NeoHooke.of(1000.0, 0.3), D="bottom", name="block")
    shape = sc.RigidCylinder((0.5, 2.0), 1.0)
    roller = sc.RigidBody(shape, force=(0, -1), D=("x", "rotation"), name="roller")
    contact = sc.Contact(block.surface("top"), roller, sliding=sliding)
    loads = [{"f": {"roller": {"y": y}}} for y in (-1.0, -0.1, 0.0)]
    with pytest.warns(sc.ContactWarning, match="'roller' is indifferent"):
        pressed, _, free = sc.ContactSolver([block, roller], [contact]).history(loads)
    assert_allclose(free.u, 0.0, atol=1e-12 * np.abs(pressed.u).max())
    assert len(free.newton) <= 5


@pytest.mark.parametrize("angle", [np.pi / 6, pytest.param(np.pi / 2, marks=pytest.mark.slow)])
def test_a_pair_that_is_turned_as_a_whole(angle: float) -> None:
    """Pressed, then turned by its supports while it stays pressed: forces turn with it, to 1e-8.

    The tool yields when it is pressed; turned, all internal variables stay as they are.
    """
    low, high = rectangle(0, 1, 0, 1, 5, 5), rectangle(-0.25, 1.15, 1, 1.5, 8, 3)
    rubber = sc.NonlinearBody(low, sc.materials.NeoHooke.of(1.0, 0.3), D="bottom", name="rubber")
    metal = sc.J2(40.0, 0.3, 0.1, kinematic=4.0, finite_strain=True)
    tool = sc.NonlinearBody(high, metal, D="top", name="tool")
    contact = sc.Contact(rubber.surface("top"), tool.surface("bottom"), sliding="finite")

    def at(turn: float) -> dict[str, Any]:
        c, s = np.cos(turn), np.sin(turn)
        places = {}
        for body, shift in ((rubber, (0.0, 0.0)), (tool, (0.05, -0.15))):
            p, places[body.name] = body.basis.mesh.p, np.zeros(body.n)
            there = np.array([[c, -s], [s, c]]) @ (p + np.array(shift)[:, None])
            places[body.name][body.basis.nodal_dofs] = there - p
        return {"x": places}

    settled = sc.Options(placement_tolerance=1e-11)
    solver = sc.ContactSolver([rubber, tool], [contact], options=settled)
    turns = np.linspace(0, angle, round(angle / (np.pi / 18)) + 1)
    pressed, *_, last = solver.history([at(turn) for turn in turns])
    c, s = np.cos(angle), np.sin(angle)
    expected = np.array([[c, -s], [s, c]]) @ pressed.force
    assert_allclose(last.force, expected, rtol=0, atol=1e-8 * np.linalg.norm(expected))
    strain, before = (r.state["tool"]["equivalent_plastic_strain"] for r in (last, pressed))
    assert before.max() > 0.003
    assert_allclose(strain, before, rtol=0, atol=1e-9)


def test_a_corner_that_alternates_between_two_faces_is_named() -> None:
    """A square die that is pushed along without friction: the rubber beside it rises over its corner.

    Forces are in equilibrium on each of two pairings, and lead to the other one.
    """
    slab = sc.NonlinearBody(
        rectangle(-2, 2, -2, 0, 16, 8), sc.materials.NeoHooke.of(1.0, 0.3), D="bottom"
    )
    die = sc.Body(rectangle(0.1, 1.1, 0, 1, 4, 4), sc.Elastic(1e4, 0.3), D="top", name="die")
    contact = sc.Contact(die.surface("bottom"), slab.surface("top"), sliding="finite")
    solver = sc.ContactSolver([slab, die], [contact], options=sc.Options(max_cuts=0))
    steps = [{"x": {"die": {"top": way}}} for way in ((0.0, -0.1), (0.0, -0.18), (0.05, -0.18))]
    with pytest.raises(sc.errors.NotConverged, match=r"meets another partner.*sharp corners") as error:
        list(solver.history(steps))
    assert len(error.value.results) == 2


@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_a_hook_that_falls_off_an_edge_is_told_which(mu: float) -> None:
    """A snap hook on a rigid catch, whose last edge stands at x = 22.5: behind it nothing is near."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 20, 21), np.linspace(-1, 1, 5))
    mesh = mesh.restrict(mesh.elements_satisfying(lambda x: (x[1] > 0) | (x[0] > 17)))
    x, below = mesh.p[0], np.maximum(-mesh.p[1], 0.0)
    ramp = 17 + 0.4 * below + (x - 17) / 3 * (3 - 1.4 * below)
    mesh = mesh.morphed(lambda p: np.where(below > 0, ramp, x), lambda p: p[1]).with_boundaries(
        {"root": lambda x: x[0] == 0, "hook": lambda x: (x[1] <= 0) & (x[0] > 16)}
    )
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    thin = sc.materials.SaintVenantKirchhoff(2000.0, 0.3)
    beam = sc.NonlinearBody(basis, thin, D="root", name="beam", mean_dilatation=False)
    catch = sc.RigidPolyline([(20.5, 0), (20.5, -6), (22.5, -6), (22.5, 0)], closed=True)
    law = sc.Coulomb(mu) if mu else None
    contact = sc.Contact(beam.surface("hook"), catch, friction=law, sliding="finite", name="snap")
    ways = [{"x": {"beam": {"root": (w, 0.0)}}} for w in (0, 0.5, 1.0, 1.5, 2.0, 2.5, 2.75, 3.0)]
    solver = sc.ContactSolver(beam, contact, options=sc.Options(max_cuts=3))
    with pytest.raises(
        sc.errors.NotConverged, match=r"point \d of contact 'snap'.*sharp corners"
    ) as error:
        list(solver.history(ways))
    assert "limit point" not in str(error.value)


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()])
def test_a_straight_column_under_friction(linear: Any) -> None:
    """Nothing pushes it aside: beyond its buckling load it stays straight, as the warning says."""
    column = sc.NonlinearBody(
        rectangle(-0.5, 0.5, 0, 9.5, 2, 19), sc.materials.NeoHooke.of(1.0, 0.3), D="bottom"
    )
    head = sc.Body(rectangle(-2, 2, 9.5, 10.5, 4, 1), sc.Elastic(1e3, 0.3), D="top", name="head")
    faces = column.surface("top"), head.surface("bottom")
    solver = sc.ContactSolver(
        [column, head], [sc.Contact(*faces, friction=sc.Coulomb(0.3))], linear=linear
    )
    with pytest.warns(sc.ContactWarning, match="not stable"):
        *_, last = solver.history([{"x": {"head": {"top": (0.0, -d)}}} for d in (0.2, 0.4, 0.55)])
    assert abs(last.force[0]) < 1e-8 * abs(last.force[1])
    assert last.certificate.worst < 1e-9
    assert len(last.newton) <= 3


def gasket(along: float) -> FromFunction:
    """A layer of thickness one: pressures over closures from a table, and hardly stiff in shear."""
    closures, pressures = np.array([(0.0, 0.0), (0.01, 2.0), (0.02, 10.0), (0.03, 40.0)]).T

    def law(H: Any, state: Any) -> Any:
        strain, one = 0.5 * (H + H.swapaxes(0, 1)), np.eye(len(H))
        shear = along * (np.einsum("ik,jl", one, one) + np.einsum("il,jk", one, one))
        tangent = np.broadcast_to(shear[..., None, None], (*shear.shape, *H.shape[2:])).copy()
        stress, closure = 2.0 * along * strain, -strain[1, 1]
        piece = np.clip(np.searchsorted(closures, closure) - 1, 0, 2)
        tangent[1, 1, 1, 1] = (np.diff(pressures) / np.diff(closures))[piece]
        stress[1, 1] = -pressures[piece] - tangent[1, 1, 1, 1] * (closure - closures[piece])
        return stress, tangent, {}

    return FromFunction(law, {})


def closed_gasket(along: float, nx: int = 5) -> sc.answers.ContactResult:
    """The gasket between two steel blocks that match it nowhere, pressed in four steps."""
    steel = sc.Elastic(1000.0, 0.0)
    low = sc.Body(rectangle(0, 10, -11, -1, 4, 2), steel, D="bottom", name="low")
    layer = rectangle(0, 10, -1, 0, nx, 1)
    middle = sc.NonlinearBody(layer, gasket(along), D={"left": "x"}, name="gasket")
    load = {"top": (0.0, -6.0)}
    up = sc.Body(rectangle(0, 10, 0, 10, 6, 2), steel, load, D={"left": "x"}, name="up")
    pairs = [
        sc.Contact(middle.surface("bottom"), low.surface("top"), name="below"),
        sc.Contact(up.surface("bottom"), middle.surface("top"), name="above"),
    ]
    *_, last = sc.ContactSolver([low, middle, up], pairs).history([0.25, 0.5, 0.75, 1.0])
    return last


@pytest.mark.parametrize("along", [1e-2, 1e-3, 1e-4])
def test_a_gasket_that_hardly_resists_shear(along: float) -> None:
    """Its flutter between the blocks is a million times softer than these: p = 6 closes it by .015."""
    result = closed_gasket(along)
    bodies = {body.name: body for body in result.system.bodies}
    top = result.displacement("up")[bodies["up"].basis.get_dofs("top").nodal["u^2"]]
    assert_allclose(top, -0.015 - 2 * 6.0 * 10 / 1000.0, rtol=1e-7)
    assert_allclose(result["above"].pressure, 6.0, rtol=1e-6)


def test_a_layer_that_does_not_resist_shear_is_no_limit_point() -> None:
    """By 1e-9 of the blocks: forces come to balance, and do not tell where its nodes are."""
    with pytest.raises(sc.errors.NotConverged, match="nearly singular") as failed:
        closed_gasket(1e-6)
    assert "limit point" not in str(failed.value)


def on_foundation(stiffness: float) -> sc.ContactSolver:
    """A block on a layer of height 1 that carries p = 400 g**2 beside a linear part, g its closure."""

    def law(H, state):
        g, stress, tangent = -H[1, 1], np.zeros_like(H), np.zeros((2, 2, *H.shape))
        stress[1, 1] = -400 * g * np.abs(g) - stiffness * g
        tangent[1, 1, 1, 1] = 800 * np.abs(g) + stiffness
        return stress, tangent, state

    low, high = rectangle(0, 1, 0, 1, 4, 1), rectangle(0, 1, 1, 2, 4, 4)
    held = [{"bottom": "y"}, low.nodal_dofs[0]]
    layer = sc.NonlinearBody(low, FromFunction(law), D=held, name="layer")
    block = sc.Body(high, sc.Elastic(1e5, NU), D={"left": "x"}, f={"top": 2.0}, name="block")
    return sc.ContactSolver([block, layer], sc.Contact(layer.surface("top"), block.surface("bottom")))


def test_a_material_without_stiffness_in_its_initial_state_is_named() -> None:
    """Newton's method has no tangent to begin with, and no state to show; a small one is enough.

    Sentences on a last state, and on the share of the step that was borne, are left out.
    """
    with pytest.raises(sc.errors.NotConverged) as failed:
        on_foundation(0.0).solve()
    assert str(failed.value) == (
        "The loop 'newton' did not converge. Body 'layer' has no stiffness in its initial state, where "
        "Newton's method begins, at 5 free DOFs, the first at (0, 1): add some to the stress and "
        "the tangent of its material, or hold them by D. "
        "The steps before this one are in `.results` of this exception."
    )
    assert failed.value.result is None and failed.value.results == ()
    assert_allclose(on_foundation(0.1).solve().pressure, 2.0, rtol=1e-9)


def test_a_step_says_how_far_what_yields_is_strained():
    """Under a punch pressures stay while the block gives way: no load tells its strain.

    The body need not become a NonlinearBody, which it is.
    """
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 4, 17), np.linspace(-2, 0, 9)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    held = {"left": "x", "bottom": ("x", "y"), "right": "x"}
    block = sc.NonlinearBody(basis, sc.J2(1000.0, 0.3, 1.0), D=held, name="block")
    punch = sc.RigidPolyline([(-1, 0), (1, 0), (1, 2), (-1, 2)], closed=True, name="punch")
    solver = sc.ContactSolver(block, sc.Contact(block.surface("top"), punch, name="foot"))
    last, said = None, []
    for depth in (0.01, 0.02, 0.08, 0.16):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            last = solver.solve(motion={"punch": (0, -depth)}, start=last)
        said.append(any(LARGE in str(w.message) for w in caught))
    assert said == [False, False, True, False]  # once, at the first that is beyond a tenth
