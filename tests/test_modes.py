"""Vibration about a state of contact: closed forms, whole bodies, and matrices made otherwise."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import skfem as fem
from bolted import clamped, parts
from numpy.testing import assert_allclose
from rectangles import rectangle
from scipy.linalg import eigh
from scipy.sparse import csr_matrix
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

STEEL = sc.Elastic(1.0, 0.3, density=2.0)
LENGTH = 4.0


def bar(x0, x1, cells, material=STEEL, height=(0.0, 1.0), **settings):
    """A plane bar, one of whose ends is held as a rule."""
    basis = rectangle(np.linspace(x0, x1, cells + 1), np.linspace(*height, 5))
    return sc.Body(basis, material, **settings)


def apart(body):
    """A contact far away, for bodies that touch nothing."""
    return sc.Contact(body.surface("bottom"), sc.RigidPlane((0, -9), (0, 1), name="floor"), name="far")


def alone(body, n):
    """Modes of one body."""
    solver = sc.ContactSolver(body, apart(body))
    return solver.modes(solver.solve(), n)


def frequencies(K, M, n):
    """Of two matrices, by LAPACK."""
    K, M = (A.toarray() if hasattr(A, "toarray") else A for A in (K, M))
    squares = eigh(K, M, eigvals_only=True, subset_by_index=[0, n - 1])
    return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)


def test_glued_halves_are_the_whole():
    """With matching meshes to 1e-10, rigid motions of what floats included."""
    for D in ("left", None):
        halves = bar(0, 2, 8, D=D, name="a"), bar(2, LENGTH, 8, name="b")
        glue = sc.Contact(halves[1].surface("left"), halves[0].surface("right"), tied=True)
        whole, solver = bar(0, LENGTH, 16, D=D, name="whole"), sc.ContactSolver(halves, glue)
        found, wanted = solver.modes(solver.solve(), 6), alone(whole, 6)
        assert_allclose(found.frequency, wanted.frequency, rtol=1e-10)
        assert np.count_nonzero(found.frequency == 0) == (0 if D else 3)
        assert not found.growth.any()


def test_frictionless_halves_are_one_half_on_rollers_or_free():
    """Mirrored halves: pressures that vibrate hold one half like a wall, or there are none."""
    width = bar(0, 1, 5, D="left", name="free"), bar(0, 1, 5, D="left", name="held")
    halves = width[0], bar(1, 2, 5, D="right", x={"right": (-0.01, 0.0)}, name="other")
    joint = sc.Contact(halves[1].surface("left"), halves[0].surface("right"), method="node")
    solver = sc.ContactSolver(halves, joint)
    found = solver.modes(solver.solve(), 8).frequency
    K, M = width[1].K, width[1].mass
    free = np.setdiff1d(np.arange(width[1].n), width[1].D)
    rolling = np.setdiff1d(free, width[1].basis.get_dofs("right").all("u^1"))
    both = [frequencies(K[I][:, I], M[I][:, I], 8) for I in (free, rolling)]
    assert_allclose(found, np.sort(np.concatenate(both))[:8], rtol=1e-10)


def test_two_pressed_rods_sound_as_one():
    """``c k / 2 L`` between two walls, to the order h^2 of the elements."""
    errors = []
    for cells in (10, 20):
        rods = []
        for k, name in enumerate(("one", "two")):
            rod = bar(2 * k, 2 * k + 2, cells, sc.Elastic(1.0, 0.0, density=2.0), name=name)
            side = rod.basis.get_dofs("left" if k == 0 else "right").all()
            D = np.union1d(side, rod.basis.get_dofs(elements=True).all("u^2"))
            x = np.zeros(rod.n)
            x[np.intersect1d(side, rod.basis.get_dofs(elements=True).all("u^1"))] = -0.01 * k
            rods.append(sc.Body(rod.basis, rod.K, D=D, x=x, mass=rod.mass, name=name))
        joint = sc.Contact(rods[1].surface("left"), rods[0].surface("right"))
        solver = sc.ContactSolver(rods, joint)
        wanted = np.sqrt(1 / 2.0) * np.arange(1, 4) / (2 * LENGTH)
        found = solver.modes(solver.solve(), 20).frequency
        nearest = [found[np.argmin(np.abs(found - f))] for f in wanted]
        errors.append(np.abs(np.array(nearest) / wanted - 1))
    assert errors[1].max() < 1e-2
    assert_allclose(errors[0] / errors[1], 4.0, rtol=0.1)


def pressed(mu=0.2, push=0.008, **settings):
    """A block on another one, partly open, slipping at its edges."""
    low = bar(0, 4, 9, D="bottom", height=(-1.0, 0.0), name="low")
    up = bar(1, 3, 7, D="top", x={"top": (push, -0.02)}, name="up")
    joint = sc.Contact(
        up.surface("bottom"),
        low.surface("top"),
        friction=sc.Coulomb(mu),
        gap=lambda x: 0.02 * (x[0] - 2) ** 2,
        name="joint",
        **settings,
    )
    solver = sc.ContactSolver([low, up], joint)
    return solver, solver.solve()


def by_null_space(solver, status, slipping, n):
    """Frequencies by rows of the constraints and LAPACK, without an elimination; and the mass."""
    system, kin = solver.system, solver.kin
    M = np.zeros((system.n, system.n))
    for body in system.bodies:
        M[system.slice(body), system.slice(body)] = body.mass.toarray()
    held = np.repeat(status == 1 if slipping == "free" else status > 0, kin.tangents)
    rows = [kin.B_n[status > 0].toarray(), kin.B_t[held].toarray(), np.eye(system.n)[system.D]]
    _, s, V = np.linalg.svd(np.concatenate(rows))
    Z = V[np.count_nonzero(s > 1e-10) :].T  # a basis of all that the constraints leave free
    return frequencies(Z.T @ system.K @ Z, Z.T @ M @ Z, n), M


@pytest.mark.parametrize("slipping", ["stuck", "free"])
def test_modes_are_those_of_reduced_matrices(slipping):
    """Ten modes to 1e-8, with a unit mass, and the fewer points move the higher."""
    solver, result = pressed()
    assert set(result.status) == {0, 1, 2}
    found = solver.modes(result, 10, slipping=slipping)
    wanted, M = by_null_space(solver, result.status, slipping, 10)
    assert_allclose(found.frequency, wanted, rtol=1e-8)
    assert_allclose(found.shapes @ M @ found.shapes.T, np.eye(10), atol=1e-8)
    assert np.all(found.frequency <= solver.modes(result, 10).frequency * (1 + 1e-12))


@pytest.mark.parametrize(
    "cells, pressed, n", [(1, True, 4), (2, True, 4), (2, False, 11), (4, False, 12)]
)
def test_modes_of_one_frequency_are_all_found(cells, pressed, n):
    """Cubes, free and between a wall and a plane without friction, by scikit-fem and LAPACK."""
    x = np.linspace(-0.5, 0.5, cells + 1)
    mesh = fem.MeshHex.init_tensor(x, x, x).with_boundaries(
        {"bottom": lambda x: x[2] == -0.5, "top": lambda x: x[2] == 0.5}
    )
    basis = fem.Basis(mesh, fem.ElementVector((fem.ElementHex2 if cells == 1 else fem.ElementHex1)()))
    cube = sc.Body(basis, STEEL, D="top" if pressed else None, name="cube")
    plane = sc.RigidPlane((0, 0, -0.5 if pressed else -9), (0, 0, 1))
    foot = sc.Contact(cube.surface("bottom"), plane, interference=1e-3 * pressed)
    solver = sc.ContactSolver(cube, foot)
    found = solver.modes(solver.solve(), n).frequency
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    M = fem.BilinearForm(lambda u, v, w: 2.0 * dot(u, v)).assemble(basis)
    held = np.append(basis.get_dofs("top").all(), basis.get_dofs("bottom").all("u^3"))
    free = np.setdiff1d(np.arange(basis.N), held if pressed else [])
    wanted = frequencies(K[free][:, free], M[free][:, free], n)
    assert_allclose(found, wanted, rtol=1e-8, atol=1e-6 * wanted[-1])


def test_joints_that_give_are_springs():
    """A stiff block on soft points that stick: ``G`` of each, and the mass; load steps agree."""
    G = 0.01
    block = bar(0, 1, 4, sc.Elastic(1e4, 0.3, density=2.0), f={"top": (0.0, -0.1)}, name="block")
    foot = sc.Contact(
        block.surface("bottom"),
        sc.RigidPlane((0, 0), (0, 1)),
        friction=sc.Coulomb(0.5, stiffness=G),
    )
    solver = sc.ContactSolver(block, foot)
    result = solver.solve()
    modes = solver.modes(result, 1)
    assert modes.frequency[0] == pytest.approx(np.sqrt(5 * G / 2.0) / (2 * np.pi), rel=1e-4)
    assert solver.damping(result, modes, 1e-3).frequency[0] == pytest.approx(modes.frequency[0])


def test_bolts_are_locked():
    """A tightened bolt vibrates as it is, without the section that slid while it was tightened."""
    steel = sc.Elastic(210e3, 0.3, density=7.85e-9)
    solver = clamped(parts(fem.MeshHex), form=steel)
    [tight] = solver.history([{"bolt": {"M": {"force": 8e3}}}])
    assert 0 < np.count_nonzero(np.concatenate([v.status for v in tight])) < solver.kin.m
    found = solver.modes(tight, 5, slipping="free")
    wanted = by_null_space(solver, np.concatenate([v.status for v in tight]), "free", 5)
    assert_allclose(found.frequency, wanted[0], rtol=1e-8)


def model(mu):
    """One node that slides on a floor, a second that is free along it: two DOFs."""
    basis = fem.Basis(fem.MeshQuad().with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    at = {
        (x, y): np.flatnonzero(((x, y) == basis.mesh.p.T).all(axis=1))[0]
        for x in (0, 1)
        for y in (0, 1)
    }
    x, y, q = (*basis.nodal_dofs[:, at[0, 0]], basis.nodal_dofs[0, at[0, 1]])
    K = np.diag(np.full(8, 9.0))
    K[x, x], K[q, q], K[x, q], K[y, q], K[q, y] = 1.2, 0.8, 0.1, 30 / 13, 30 / 13
    K[q, x] = K[x, q]
    f = np.zeros(8)
    f[y], f[x] = -1e-3, -3e-3
    D = np.setdiff1d(np.arange(8), [x, y, q])
    up = np.zeros(8)
    up[basis.nodal_dofs[1, at[1, 0]]] = 1e-3  # the other node of the surface is held, and open
    body = sc.Body(basis, csr_matrix(K), f, D=D, x=up, mass=np.eye(8))
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    foot = sc.Contact(
        body.surface("bottom"), floor, friction=sc.Coulomb(mu), method="node", name="foot"
    )
    solver = sc.ContactSolver(body, foot)
    result = solver.solve()
    assert sorted(result.status) == [0, 2]
    return solver.modes(result, 2, slipping="steady")


def test_two_modes_lock_in_where_the_closed_form_says():
    """Two DOFs: ``(a - d)^2 / 4 + b^2 = mu k b`` at mu = .2166667, from where on one mode grows."""
    critical = 13 / 60  # ((1.2 - .8)^2 / 4 + .1^2) / (30 / 13 * .1)
    for mu in (critical - 1e-6, critical + 1e-6):
        found = model(mu)
        grows = found.growth.max() > 1e-5
        assert grows == (mu > critical)
    above = model(0.3)
    lost = np.sqrt(0.3 * 30 / 13 * 0.1 - 0.05)  # of (1 +- i lost) = - s^2
    turns = np.sqrt(-(1.0 - 1j * lost))
    assert_allclose(above.growth, [abs(turns.real), -abs(turns.real)], rtol=1e-10)
    assert_allclose(above.frequency, abs(turns.imag) / (2 * np.pi), rtol=1e-10)
    assert "grows by" in str(above) and np.iscomplexobj(above.shapes)


def test_sliding_without_friction_is_free():
    """Steady sliding as friction falls: the modes of free points; and beyond ARPACK those of LAPACK."""
    solver, result = pressed(mu=1e-9, push=0.02)
    assert set(result.status) == {0, 2}
    steady, free = (solver.modes(result, 5, slipping=how) for how in ("steady", "free"))
    assert_allclose(steady.frequency, free.frequency, rtol=1e-7)


def test_units_and_travel_do_not_change_modes():
    """In other units of mass and length; of a result and bodies that were pickled."""
    solver, result = pressed()
    wanted = solver.modes(result, 4).frequency
    heavy = sc.Elastic(1.0, 0.3, density=2e12)
    assert_allclose(alone(bar(0, 4, 8, heavy), 6).frequency, 1e-6 * alone(bar(0, 4, 8), 6).frequency)
    again, same = pickle.loads(pickle.dumps((solver, result)))
    assert_allclose(again.modes(same, 4).frequency, wanted, rtol=1e-10)


@pytest.mark.parametrize("height", [1.0, 1.5])
def test_rigid_bodies_have_a_mass(height):
    """A column with a rigid head: rows of its motion by hand; its springs alone; other units."""
    column = bar(0, 1, 5, D="bottom", height=(0.0, 1.0), name="column")
    mass = np.array([[3.0, 0.0, -0.3], [0.0, 3.0, 0.6], [-0.3, 0.6, 0.4]])
    about, springs = np.array([0.5, height]), np.array([0.2, 0.5, 0.1])
    found = []
    for unit in (1.0, 1e3):  # of length; rotations stay
        x = np.outer((1, 1, unit), (1, 1, unit))
        down = sc.RigidPlane((0.5 * unit, unit), (0, -1), name="head")
        given = {"about": unit * about, "K": springs * np.diag(x)}
        head = sc.RigidBody(down, mass=mass * x, **given)
        big = fem.Basis(column.basis.mesh.scaled(unit), column.basis.elem, intorder=2)
        own = sc.Body(big, column.K, D="bottom", mass=column.mass, name="column")
        solver = sc.ContactSolver([own, head], sc.Contact(own.surface("top"), head, tied=True))
        modes = solver.modes(solver.solve(), 5)
        found.append(modes.frequency)
        assert modes.displacement(0, "head").shape == (3,)
    top = column.basis.get_dofs("top")
    T = np.zeros((column.n + 3, column.n + 3))
    T[: column.n, : column.n] = np.eye(column.n)
    T[column.n :, column.n :] = np.eye(3)
    for k in range(2):
        dofs = top.all(f"u^{k + 1}")
        arm = column.dof_points[dofs] - about
        T[dofs, dofs] = 0.0
        T[dofs, column.n + k] = 1.0
        T[dofs, -1] = (-arm[:, 1], arm[:, 0])[k]
    free = np.setdiff1d(np.arange(column.n + 3), np.concatenate([column.D, top.all()]))
    T = T[:, free]
    K, M = (
        np.block([[A.toarray(), np.zeros((column.n, 3))], [np.zeros((3, column.n)), B]])
        for A, B in ((column.K, np.diag(springs)), (column.mass, mass))
    )
    wanted = frequencies(T.T @ K @ T, T.T @ M @ T, 5)
    for frequency in found:
        assert_allclose(frequency, wanted, rtol=1e-9)
    with pytest.raises(sc.errors.InputError, match="masses are >= 0"):
        sc.RigidBody(down, mass=(1.0, -1.0, 1.0), **given)
    bare = sc.RigidBody(down, name="bare", **given)
    solver = sc.ContactSolver([own, bare], sc.Contact(own.surface("top"), bare, tied=True))
    with pytest.raises(sc.errors.InputError, match=r"mass=\(m, m, J\)"):
        solver.modes(solver.solve(), 2)


def test_densities_forms_and_matrices_are_one_mass():
    """What is given as a density, a form or a matrix, with a thickness; a scalar body too."""
    basis = rectangle(np.linspace(0, 2, 5), np.linspace(0, 1, 3))
    form = fem.BilinearForm(lambda u, v, w: 6.0 * np.sum(np.asarray(u) * np.asarray(v), axis=0))
    made = [
        sc.Body(basis, STEEL, measure=lambda x: 3.0 + 0 * x[0], mass=2.0).mass,
        sc.Body(basis, STEEL, measure=lambda x: 3.0 + 0 * x[0]).mass,
        sc.Body(basis, STEEL, mass=form).mass,
        sc.Body(basis, STEEL, mass=form.assemble(basis)).mass,
        sc.Body.from_mesh(basis.mesh, basis.elem, STEEL, mass=6.0, intorder=2).mass,
        sc.NonlinearBody(basis, STEEL, mass=6.0).mass,
    ]
    for mass in made:
        assert_allclose(mass.toarray(), made[0].toarray(), atol=1e-14)
        assert mass.sum() == pytest.approx(6.0 * 2 * 2, rel=1e-12)  # twice, by components
    assert sc.Body(basis, sc.Elastic(1.0, 0.3)).mass is None


def test_shapes_are_drawn_and_written(tmp_path):
    """As displacements in the place of those of the result."""
    meshio = pytest.importorskip("meshio")
    solver, result = pressed()
    found = solver.modes(result, 2)
    shape = 0.1 * found.shapes[1] / np.abs(found.shapes[1]).max()
    path, _ = sc.write(tmp_path / "mode.vtu", result, u=shape)
    written = meshio.read(path).point_data["displacement"][:, :2]
    assert np.abs(written).max() == pytest.approx(0.1)
    assert found.displacement(1, "up").shape == (result.system.bodies[1].n,)
    ax = sc.plot_deformed(result, 1.0, u=shape)
    assert ax.get_title()
    assert np.abs(result.u).max() != pytest.approx(0.1)
    with pytest.raises(sc.errors.InputError, match=r"u has shape \(3,\)"):
        sc.plot_deformed(result, u=np.ones(3))


@pytest.mark.parametrize("D, known", [("left", 4), (None, 6)])
def test_points_with_a_mass_on_springs(D, known):
    """Bodies without a mass are their springs: as many modes as masses have, by LAPACK."""
    plain = bar(0, 4, 16, D=D)
    mass = np.zeros(plain.n)
    mass[plain.basis.nodal_dofs[:, [-1, -20, -38][: known // 2]]] = 3.0
    body = bar(0, 4, 16, D=D, mass=csr_matrix(np.diag(mass)))
    free = np.setdiff1d(np.arange(body.n), body.D)
    K, M = (A.toarray()[np.ix_(free, free)] for A in (body.K, body.mass))
    shift = 1e-3  # masses that are zero have modes of the inverse alone
    inverse = eigh(M, K + shift * M, eigvals_only=True)[::-1][:known]
    wanted = np.sqrt(np.maximum(1 / inverse - shift, 0.0)) / (2 * np.pi)
    for n in (1, known):
        assert_allclose(alone(body, n).frequency, wanted[:n], rtol=1e-9, atol=1e-7)
    with pytest.raises(sc.errors.InputError, match="singular on what is free to move"):
        alone(body, known + 1)
    if D is not None:  # a mass that moves one way only
        ones = np.outer(np.ones(20), np.ones(20))
        small = bar(0, 1, 1, D=D, mass=csr_matrix(ones))
        free = np.setdiff1d(np.arange(small.n), small.D)
        gives = np.linalg.inv(small.K.toarray()[np.ix_(free, free)]).sum()
        assert alone(small, 1).frequency[0] == pytest.approx(1 / np.sqrt(gives) / (2 * np.pi), rel=1e-9)
    else:  # one mass does not resist a turn about it
        body = bar(0, 4, 16, mass=csr_matrix(np.diag(mass * (np.arange(body.n) > body.n - 3))))
        with pytest.raises(sc.errors.InputError, match="singular on what is free to move"):
            alone(body, 1)


@pytest.mark.parametrize("n", [1, 3, 40])
def test_masses_that_move_nothing_are_refused(n):
    """A mass of rank one, none at all, one at supports alone, and a negative one."""
    plain = bar(0, 1, 4, D="left")
    ones, held = np.ones(plain.n), np.zeros(plain.n)
    held[plain.D] = 1.0
    for mass in (np.outer(ones, ones), 0.0 * np.eye(plain.n), np.diag(held), -np.eye(plain.n)):
        body = bar(0, 1, 4, D="left", mass=csr_matrix(mass))
        with pytest.raises(sc.errors.InputError, match="singular on what is free to move"):
            alone(body, n)


def test_wrong_questions_are_refused():
    """Masses and numbers that are missing or make no sense."""
    solver, result = pressed()
    bare, own = bar(0, 4, 8, sc.Elastic(1.0, 0.3), name="bare"), bar(0, 4, 8)
    other = sc.ContactSolver(own, apart(own)).solve()
    cases = {
        r"slipping='away'; slipping points may be stuck": lambda: solver.modes(result, slipping="away"),
        "n is 0": lambda: solver.modes(result, 0),
        "n is 10000; give a whole number from 1 to": lambda: solver.modes(result, 10**4),
        "is a state of": lambda: solver.modes(other),
        "no mass is given of 'bare'": lambda: alone(bare, 2),
        "by volume is positive": lambda: bar(0, 1, 2, mass=-1.0).mass,
        "give the mass by volume": lambda: bar(0, 1, 2, mass="heavy").mass,
    }
    for words, ask in cases.items():
        with pytest.raises(sc.errors.InputError, match=words):
            ask()


@pytest.mark.parametrize("hardening", [[(1.0, 0.0), (2.0, 0.1)], lambda p: (1 + 9 * p, 9 + 0 * p)])
def test_what_has_yielded_vibrates_as_it_was(hardening):
    """To and fro without flowing again: the frequencies of before, whatever the step came through."""
    basis = rectangle(np.linspace(0, 10, 21), np.linspace(0, 1, 3))
    metal = sc.J2(1000.0, 0.3, hardening)
    band = sc.NonlinearBody(basis, metal, D=["left", {"right": "y"}], mass=1.0, name="band")
    solver = sc.ContactSolver(band, apart(band))
    steps = [{"x": {"band": {"right": (None, -down)}}} for down in (0.01, 0.2, 0.4)]
    before, _, after = (solver.modes(result, 4).frequency for result in solver.history(steps))
    assert_allclose(after, before, rtol=1e-9)


def test_a_stretched_band_sounds_higher():
    """Modes of a body that is not linear are those of its tangent at the answer, stresses included."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 4, 17), np.linspace(0, 0.25, 3)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad2()))
    rubber = sc.materials.NeoHooke(shear=1.0, bulk=5.0)
    band = sc.NonlinearBody(basis, rubber, D=["left", "right"], mass=1.0, name="band")
    floor = sc.RigidPlane((0, -1), (0, 1), name="floor")
    contact = sc.Contact(band.surface("bottom"), floor)
    solver = sc.ContactSolver(band, contact)
    first = []
    for stretch in (0.0, 0.4):
        result = solver.solve(x={"band": {"right": (stretch, 0.0)}})
        found = solver.modes(result, 3)
        free = np.setdiff1d(np.arange(band.n), band.D)
        K = band.linearize(result.u, band.initial_state).K[free][:, free].toarray()
        squares = eigh(K, band.mass[free][:, free].toarray(), eigvals_only=True)[:3]
        np.testing.assert_allclose(found.frequency, np.sqrt(squares) / (2 * np.pi), rtol=1e-8)
        first.append(found.frequency[0])
    assert first[1] > 1.5 * first[0]
