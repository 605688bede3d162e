"""Materials at single points: closed forms of paths, derivatives, invariance, and what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose

import skfem_contact as sc
from skfem_contact.materials import (
    J2,
    Elastic,
    FromFelupe,
    FromFunction,
    MooneyRivlin,
    NeoHooke,
    SaintVenantKirchhoff,
)

E, NU, Y = 210e3, 0.3, 300.0
MU, BULK = E / (2 * (1 + NU)), E / (3 * (1 - 2 * NU))
TABLE = [(250.0, 0.0), (300.0, 0.002), (320.0, 0.02)]
METALS = {
    "elastic": Elastic(E, NU),
    "perfect": J2(E, NU, Y),
    "table": J2(E, NU, TABLE, kinematic=E / 30),
    "function": J2(E, NU, lambda p: (Y + 80 * (1 - np.exp(-90 * p)), 7200 * np.exp(-90 * p))),
}
RUBBERS = {
    "NeoHooke": NeoHooke.of(1.0, 0.3),
    "MooneyRivlin": MooneyRivlin(0.3, 0.2, bulk=7.0),
    "SaintVenantKirchhoff": SaintVenantKirchhoff(1.0, 0.3),
}
LARGE = {"large": J2(E, NU, TABLE, kinematic=E / 30, finite_strain=True)}
random = np.random.default_rng(26)


def point(*rows):
    """One displacement gradient as a batch."""
    return np.array(rows, dtype=float)[:, :, None, None]


def stress_of(material, path, state=None):
    """Stress and internal variables at the end of a path of displacement gradients."""
    state = material.initial_state(*path[0].shape[2:]) if state is None else state
    for H in path:
        stress, _, state = material(H, state)
    return stress, state


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", [*METALS, *RUBBERS, *LARGE])
def test_tangent_is_the_derivative_of_stress(name, d):
    """Central differences at random gradients, after a step that has yielded."""
    material = {**METALS, **RUBBERS, **LARGE}[name]
    size = 4e-3 if name in METALS else 0.3
    first, H = size * random.uniform(-1, 1, (2, d, d, 3, 2))
    state = material(first, material.initial_state(3, 2))[2]
    _, A, _ = material(H, state)
    step = 1e-6 * size
    for k, l in np.ndindex(d, d):
        change = np.zeros_like(H)
        change[k, l] = step
        found = (material(H + change, state)[0] - material(H - change, state)[0]) / (2 * step)
        # the third derivative times step^2, and round-off over step
        expected = np.broadcast_to(A[:, :, k, l], (d, d, 3, 2))
        assert_allclose(found[:d, :d], expected, rtol=1e-6, atol=3e-8 * abs(A).max())


def deviatoric(e):
    """Uniaxial deviatoric strain: ``3 mu e`` is the elastic stress of a bar that keeps its volume."""
    return point((e, 0, 0), (0, -e / 2, 0), (0, 0, -e / 2))


def uniaxial(material, path):
    """Stress of a bar along a path of axial strains without change of volume, in closed form.

    Linear isotropic and kinematic hardening; one-dimensional, step by step from corner to corner.
    """
    ep, p, found = 0.0, 0.0, []
    for e in path:
        H, C = material["isotropic"], material["kinematic"]
        trial = 3 * MU * (e - ep) - C * ep
        flow = max(abs(trial) - (Y + H * p), 0.0) / (3 * MU + C + H)
        ep, p = ep + np.sign(trial) * flow, p + flow
        found.append(3 * MU * (e - ep))
    return found


@pytest.mark.parametrize("hardening", [(0.0, 0.0), (E / 40, 0.0), (0.0, E / 40), (E / 60, E / 80)])
def test_cyclic_tension_with_hardening(hardening):
    """Bauschinger's effect and isotropic growth over a cycle, against the one-dimensional solution."""
    H, C = hardening
    material = J2(E, NU, [(Y, 0.0), (Y + H, 1.0)], kinematic=C)
    corners = np.array([0.004, -0.004, 0.006, 0.0])
    exact = uniaxial({"isotropic": H, "kinematic": C}, corners)
    for count in (1, 7):  # straight paths: backward Euler is exact, in any number of steps
        strains = np.concatenate(
            [np.linspace(a, b, count + 1)[1:] for a, b in zip([0, *corners[:-1]], corners, strict=True)]
        )
        state, found = material.initial_state(1, 1), []
        for e in strains:
            stress, _, state = material(deviatoric(e), state)
            found.append(1.5 * stress[0, 0, 0, 0])
        assert_allclose(found[count - 1 :: count], exact, rtol=1e-12)
    assert float(np.abs(np.trace(state["plastic_strain"])).max()) < 1e-15


def test_shear_after_tension():
    """Prandtl and Reuss: at yield in tension, sheared: tau = Y/sqrt(3) tanh(sqrt(3) mu gamma / Y)."""
    material, shear = J2(E, NU, Y), 3 * Y / E
    start = Y / (3 * MU)
    errors = []
    for count in (100, 200, 400):
        path = [deviatoric(start)] + [
            deviatoric(start) + point((0, g, 0), (0, 0, 0), (0, 0, 0))
            for g in np.linspace(0, shear, count + 1)[1:]
        ]
        stress, _ = stress_of(material, path)
        turn = np.sqrt(3) * MU * shear / Y
        exact = np.array([Y / np.cosh(turn), Y / np.sqrt(3) * np.tanh(turn)])
        errors.append(np.array([1.5 * stress[0, 0, 0, 0], stress[0, 1, 0, 0]]) / exact - 1)
    errors = np.array(errors)
    assert np.abs(errors[-1]).max() < 5e-3
    # backward Euler is of first order: two of them and extrapolation take it away
    assert_allclose(errors[1:] / errors[:-1], 0.5, atol=0.02)
    assert np.abs(2 * errors[2] - errors[1]).max() < 5e-5


def test_hardening_by_table_and_by_function_agree():
    """A bilinear law as rows, and as a function that Newton's method inverts."""
    rows = J2(E, NU, [(Y, 0.0), (Y + 500.0 * 2, 2.0)])
    law = J2(E, NU, lambda p: (Y + 500.0 * p, np.full_like(p, 500.0)))
    H = 0.01 * random.uniform(-1, 1, (3, 3, 20, 2))
    by_rows, by_law = (m(H, m.initial_state(20, 2)) for m in (rows, law))
    for one, other in zip(by_rows[:2], by_law[:2], strict=True):
        assert_allclose(one, other, rtol=1e-11, atol=1e-11 * abs(one).max())
    state = by_rows[2]
    assert_allclose(rows.energy(H, state), law.energy(H, state), rtol=1e-12)


def test_hardening_by_a_power_has_no_slope_where_it_begins():
    """Y = 250 + 500 p^0.2: stress is on the curve, and 3 mu times the elastic strain."""
    law = J2(E, NU, lambda p: (250 + 500 * p**0.2, 100 * p**-0.8))
    for e in (1.3e-3, 0.01, 0.3):
        stress, state = stress_of(law, [deviatoric(e)])
        p = state["equivalent_plastic_strain"]
        assert p.item() > 0
        assert_allclose(1.5 * stress[0, 0], 250 + 500 * p**0.2, rtol=1e-9)
        assert_allclose(1.5 * stress[0, 0], 3 * MU * (e - p), rtol=1e-9)


def test_yield_stress_is_met_beyond_corners_of_the_table():
    """A step over several rows ends on the table, and after the last row the stress is constant."""
    material = J2(E, NU, TABLE)
    for e in (0.0025, 0.012, 0.1):
        stress, state = stress_of(material, [deviatoric(e)])
        p = state["equivalent_plastic_strain"]
        strain, yields = zip(*[(b, a) for a, b in TABLE], strict=True)
        assert_allclose(1.5 * stress[0, 0], np.interp(p, strain, yields), rtol=1e-12)
        assert_allclose(1.5 * stress[0, 0], 3 * MU * (e - p), rtol=1e-10)


@pytest.mark.parametrize("name", [n for n in METALS if n != "elastic"])
def test_energy_of_a_closed_path(name):
    """Work around a closed path of strain is what is stored and dissipated, by the step's order."""
    material = METALS[name]
    turn = np.linspace(0, 2 * np.pi, 801)
    errors = []
    for every in (4, 2):
        at = turn[::every]
        path = 3e-3 * np.array(
            [[1 - np.cos(at), np.sin(at), 0 * at], [0 * at, np.cos(at) - 1, 0 * at], 3 * [0 * at]]
        )
        state, before, work = material.initial_state(1, 1), np.zeros((3, 3)), 0.0
        for i in range(1, path.shape[2]):
            stress, _, state = material(path[:, :, i, None, None], state)
            now = stress[:, :, 0, 0]
            work += np.sum(0.5 * (now + before) * (path[:, :, i] - path[:, :, i - 1]))
            before = now
        stored, lost = material.energy(path[:, :, -1, None, None], state)
        errors.append(float((stored + lost).item() / work - 1))
        assert lost.item() > 0.5 * work
    assert abs(errors[1]) < 2e-3
    assert abs(errors[1]) < 0.6 * abs(errors[0])


def test_metal_in_simple_shear_and_drawn_out():
    """Hencky: tau = 2 mu b / cosh b at a shear of 2 sinh b; a bar of any length is on its curve."""
    b = np.array([[1e-9, 1e-3, 0.3, 1.2]])
    shear = np.zeros((2, 2, 1, 4))
    shear[0, 1] = 2 * np.sinh(b)
    rigid = J2(E, NU, 1e9, finite_strain=True)
    P = rigid(shear, rigid.initial_state(1, 4))[0]
    assert_allclose(P[0, 1], 2 * MU * b / np.cosh(b), rtol=1e-12)  # det F = 1, and F^-T has no 0, 0
    metal = LARGE["large"]
    for e in (0.01, 0.5, 1.5):  # without change of volume
        stretch = point((np.expm1(e), 0, 0), (0, np.expm1(-e / 2), 0), (0, 0, np.expm1(-e / 2)))
        stress, state = stress_of(metal, [stretch])
        p = state["equivalent_plastic_strain"].item()
        assert_allclose(1.5 * stress[0, 0] * np.exp(e), 3 * MU * (e - p), rtol=1e-9)
        assert_allclose(3 * MU * (e - p), metal.yields(np.array(p))[0] + E / 30 * p, rtol=1e-9)


def test_metal_at_large_strains_turns_with_the_body():
    """After yield: P(Q F) = Q P(F), and the same internal variables; without yield, P = dW/dF."""
    metal = LARGE["large"]
    first, H = 0.3 * random.uniform(-1, 1, (2, 3, 3, 4, 2))
    state = metal(first, metal.initial_state(4, 2))[2]
    Q, _ = np.linalg.qr(random.normal(size=(3, 3)))
    one = np.eye(3)[:, :, None, None]
    turned = np.einsum("im,mj...->ij...", Q * np.linalg.det(Q), H + one) - one
    P, _, new = metal(H, state)
    Pt, _, same = metal(turned, state)
    assert_allclose(
        Pt, np.einsum("im,mj...->ij...", Q * np.linalg.det(Q), P), atol=1e-10 * abs(P).max()
    )
    for key, value in new.items():
        assert_allclose(same[key], value, atol=1e-13)
    rigid, change = J2(E, NU, 1e9, finite_strain=True), 1e-6 * random.uniform(-1, 1, H.shape)
    state = rigid.initial_state(4, 2)
    found = rigid.energy(H + change, state)[0] - rigid.energy(H - change, state)[0]
    expected = 2 * np.einsum("ij...,ij...->...", rigid(H, state)[0], change)
    assert_allclose(found, expected, atol=1e-7 * abs(expected).max())


@pytest.mark.parametrize("apart", [0.0, 1e-12, 1e-7, 3e-6, 3e-5, 1e-3])
def test_tangent_of_stretches_that_are_nearly_equal(apart):
    """Two and three equal stretches, and others beside them, under stress that no strain explains."""
    metal = LARGE["large"]
    for stretches in ([0.3, 0.3 + apart, 0.3 - 2 * apart], [0.3, 0.3 + apart, -0.4]):
        H = np.diag(stretches)[:, :, None, None]
        state = metal.initial_state(1, 1)
        state["plastic_strain"] += point((0.1, 0.2, -0.1), (0.2, -0.3, 0.05), (-0.1, 0.05, 0.2))
        change = 1e-5 * random.uniform(-1, 1, H.shape)
        found = (metal(H + change, state)[0] - metal(H - change, state)[0]) / 2
        expected = np.einsum("ijkl...,kl...->ij...", metal(H, state)[1], change)
        assert_allclose(found, expected, atol=1e-8 * abs(expected).max())


# --------------------------------------------------------------------------------------------- rubber


def test_neo_hooke_in_simple_shear_and_confined():
    """tau = mu gamma with normal stress mu gamma^2; confined P = mu (l - 1/l) + lambda ln l / l."""
    rubber = NeoHooke(shear=0.4, bulk=1.1)
    lam, g, stretch = 1.1 - 0.8 / 3, 0.7, 0.6
    P = rubber(point((0, g), (0, 0)), {})[0][:, :, 0, 0]
    F = np.array([[1, g, 0], [0, 1, 0], [0, 0, 1]])
    sigma = P @ F.T
    exact = [[0.4 * g**2, 0.4 * g, 0], [0.4 * g, 0, 0], [0, 0, 0]]
    assert_allclose(sigma, exact, atol=1e-14)
    P = rubber(point((0, 0), (0, stretch - 1)), {})[0][:, :, 0, 0]
    assert_allclose(
        P[1, 1], 0.4 * (stretch - 1 / stretch) + lam * np.log(stretch) / stretch, rtol=1e-13
    )


def test_neo_hooke_in_uniaxial_tension():
    """Where the lateral stress vanishes, axial force by area is mu (l - b^2 / l), from energy alone."""
    rubber, stretch = NeoHooke(shear=0.4, bulk=1.1), 1.8
    lam = 1.1 - 0.8 / 3
    b = 1.0  # lateral stretch: mu (b^2 - 1) + lambda ln(l b^2) = 0, by Newton's method
    for _ in range(30):
        b -= (0.4 * (b**2 - 1) + lam * np.log(stretch * b**2)) / (0.8 * b + 2 * lam / b)
    P = rubber(point((stretch - 1, 0, 0), (0, b - 1, 0), (0, 0, b - 1)), {})[0][:, :, 0, 0]
    assert_allclose(P.diagonal()[1:], 0, atol=1e-14)
    assert_allclose(P[0, 0], 0.4 * (stretch - b**2 / stretch), rtol=1e-13)


def test_mooney_rivlin_in_simple_shear():
    """Rivlin: tau = 2 (C10 + C01) gamma, s11 - s33 = 2 C10 gamma^2, s22 - s33 = -2 C01 gamma^2."""
    rubber, g = MooneyRivlin(0.3, 0.2, bulk=1e3), 0.9
    P = rubber(point((0, g), (0, 0)), {})[0][:, :, 0, 0]
    sigma = P @ np.array([[1, g, 0], [0, 1, 0], [0, 0, 1]]).T
    assert_allclose(sigma[0, 1], g, rtol=1e-13)
    assert_allclose(sigma[0, 0] - sigma[2, 2], 0.6 * g**2, rtol=1e-12)
    assert_allclose(sigma[1, 1] - sigma[2, 2], -0.4 * g**2, rtol=1e-12)


@pytest.mark.parametrize("name", RUBBERS)
def test_stress_is_the_derivative_of_energy_and_turns_with_the_body(name):
    """P = dW/dF; objective: P(Q F) = Q P(F); no stress in a rigid rotation."""
    rubber = RUBBERS[name]
    H = 0.3 * random.uniform(-1, 1, (3, 3, 4, 2))
    P = rubber(H, {})[0]
    step = 1e-6
    for k, l in np.ndindex(3, 3):
        change = np.zeros_like(H)
        change[k, l] = step
        found = (rubber.energy(H + change, {})[0] - rubber.energy(H - change, {})[0]) / (2 * step)
        assert_allclose(found, P[k, l], atol=1e-8 * abs(P).max())
    Q, _ = np.linalg.qr(random.normal(size=(3, 3)))
    Q *= np.linalg.det(Q)
    one = np.eye(3)[:, :, None, None]
    turned = np.einsum("im,mj...->ij...", Q, H + one) - one
    assert_allclose(rubber(turned, {})[0], np.einsum("im,mj...->ij...", Q, P), atol=1e-13)
    turn = point(*(Q - np.eye(3)))
    rest, energy = rubber(turn, {})[0], rubber.energy(turn, {})[0]
    assert abs(rest).max() < 1e-13 and abs(energy).max() < 1e-13


@pytest.mark.parametrize("name", RUBBERS)
def test_small_strains_are_those_of_linear_elasticity(name):
    """The tangent without displacements has the moduli that the material says."""
    rubber = RUBBERS[name]
    A = rubber(np.zeros((3, 3, 1, 1)), {})[1][..., 0, 0]
    shear = getattr(rubber, "shear", 1 / 2.6)
    bulk = getattr(rubber, "bulk", 1 / 1.2)
    expected = Elastic(
        9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)
    )
    assert_allclose(A, expected(np.zeros((3, 3, 1, 1)), {})[1][..., 0, 0], atol=1e-13)


# --------------------------------------------------------------------------------------- one's own


def felupe_j2(de, e, s, z, mu, bulk, sy, tangent):
    """Radial return with perfect plasticity, as felupe wants it: (3, 3, q, e), lists of variables."""
    assert tangent
    one = np.eye(3)[:, :, None, None]
    trial = s + 2 * mu * de + (bulk - 2 * mu / 3) * np.trace(de) * one
    dev = trial - np.trace(trial) / 3 * one
    size = np.sqrt(1.5 * np.sum(dev**2, axis=(0, 1)))
    factor = np.minimum(1.0, sy / np.where(size > 0, size, 1.0))
    A = np.zeros((3, 3, 3, 3, *size.shape))  # not used here
    stress = trial - (1 - factor) * dev
    return A, stress, [z[0] + (1 - factor) * size / (3 * mu)]


def test_felupe_signature():
    """The same path by J2, and by a function with felupe's arguments and order of axes."""
    ours = J2(E, NU, Y)
    theirs = FromFelupe(felupe_j2, statevars=((),), mu=MU, bulk=BULK, sy=Y)
    path = 0.004 * random.uniform(-1, 1, (5, 3, 3, 4, 2))
    one, state = stress_of(ours, path)
    other, variables = stress_of(theirs, path)
    assert_allclose(one, other, rtol=1e-9, atol=1e-9 * Y)
    assert_allclose(variables["statevar_1"], state["equivalent_plastic_strain"], rtol=1e-9)


def test_elastic_says_stress_of_strain_and_temperature():
    """Free expansion has no stress; uniaxial stress is E times strain."""
    steel = Elastic(E, NU, expansion=12e-6)
    assert_allclose(steel.stress(12e-4 * np.eye(3), 100.0), 0, atol=1e-10)
    strain = np.diag([1e-3, -NU * 1e-3, -NU * 1e-3])
    assert_allclose(steel.stress(strain), np.diag([210.0, 0, 0]), atol=1e-11)


def test_weight_and_warmth_of_a_ring():
    """Weight is density times volume; a warmed ring that is free expands without stress."""
    measure = {"measure": lambda x: 2 * np.pi * x[0]}
    mesh = fem.MeshQuad.init_tensor(np.linspace(1, 2, 4), np.linspace(0, 1, 3)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    steel = Elastic(E, NU, density=2.0, expansion=1e-5)
    weight = steel.weight((0.0, -10.0), **measure).assemble(basis)
    assert_allclose(weight.sum(), -10 * 2.0 * np.pi * (2**2 - 1**2), rtol=1e-12)
    warm = steel.warmed(lambda x: 100.0 + 0 * x[0], **measure, axisymmetric=True)
    held = basis.get_dofs("bottom").all("u^2")
    for load in (steel.warmed(100.0), steel.warmed(100.0, **measure)):  # a body knows its own measure
        assert_allclose(
            sc.Body(basis, steel, f=load, **measure).f, warm.assemble(basis), atol=1e-12 * E
        )
    assert_allclose(sc.Body(basis, steel, f=steel.weight((0, -10.0)), **measure).f, weight, rtol=1e-12)
    for form in (steel.form(), steel.form(**measure, axisymmetric=True)):
        assert abs(sc.Body(basis, form, **measure).K - sc.Body(basis, steel, **measure).K).max() == 0.0
    for wrong in ((0.0, 0.0, -10.0), (-10.0,), -10.0, lambda x: x[0], lambda x: (x, 0)):
        with pytest.raises(sc.errors.InputError, match="in 2-D: give its components"):
            sc.Body(basis, steel, f=steel.weight(wrong), name="ring")
    spun = sc.Body(basis, steel, f=steel.weight(lambda x: (9.0 * x[0], 0)), **measure)
    assert_allclose(spun.f.sum(), 2.0 * 9.0 * 2 * np.pi * (2**3 - 1**3) / 3, rtol=1e-12)
    ring = sc.Body(basis, steel, f=warm, D=held, **measure)
    u = fem.solve(*fem.condense(ring.K, ring.f, D=ring.D))
    free = 1e-3 * basis.doflocs[ring.dof_component, np.arange(ring.n)]
    assert_allclose(u, free, atol=1e-13)
    stress = sc.NonlinearBody(basis, steel, **measure).stress(u)
    assert_allclose(
        stress, steel.stress(1e-3 * np.eye(3)[:, :, None, None]) + 0 * stress, rtol=1e-9, atol=1e-9 * E
    )


@pytest.mark.parametrize("kind", [sc.Body, sc.NonlinearBody])
def test_a_form_of_ones_own_beside_a_measure_is_warned_of_once(kind):
    """Stiffness and tractions are weighed, and the form is not: by 2 pi r here, thousands of times."""
    mesh = fem.MeshQuad().refined(1).translated((1.0, 0.0)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    own = fem.LinearForm(lambda v, w: -1e-3 * v[1])
    ring = {"measure": lambda x: 2 * np.pi * x[0], "D": "bottom", "name": "ring"}
    words = "body 'ring' has a measure .*; f is a LinearForm, which is integrated as it stands"
    with pytest.warns(sc.ContactWarning, match=words):
        kind(basis, Elastic(E, NU), f=own, **ring)
    body = kind(basis, Elastic(E, NU), f=own.assemble(basis), **ring)  # silent, as what follows
    kind(basis, Elastic(E, NU), f=own, D="bottom")
    if kind is sc.Body:
        kind(basis, Elastic(E, NU).form(), f=own, **ring)
    solver = sc.ContactSolver(body, sc.Contact(body.surface("top"), sc.RigidPlane((0, 1), (0, -1))))
    with pytest.warns(sc.ContactWarning, match=words) as said:
        list(solver.history([{"f": {"ring": own}}] * 2))
    assert len(said) == 1


@pytest.mark.parametrize("material", [METALS["table"], RUBBERS["MooneyRivlin"], METALS["elastic"]])
def test_materials_go_to_other_processes(material):
    """Pickled and back, a material answers the same."""
    H = 0.01 * random.uniform(-1, 1, (2, 2, 1, 1))
    copy = pickle.loads(pickle.dumps(material))
    state = material.initial_state(1, 1)
    assert_allclose(copy(H, state)[0], material(H, state)[0], rtol=0)


def test_temperatures_at_nodes():
    """Nine values at the nodes of a heat problem are none at the nine points of an element."""
    mesh = fem.MeshQuad().refined(1).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=4)
    heat, steel = basis.with_element(fem.ElementQuad1()), Elastic(E, 0.0, expansion=1e-5)
    T = heat.project(lambda x: 10.0 * x[0])
    with pytest.raises(sc.errors.InputError, match=r"f of body 'b': temperature .*interpolator\(T\)"):
        sc.Body(basis, steel, f=steel.warmed(T), D="left", name="b")
    by_nodes, by_place = (
        sc.Body(basis, steel, f=steel.warmed(f)).f
        for f in (heat.interpolator(T), lambda x: 10.0 * x[0])
    )
    assert_allclose(by_nodes, by_place, atol=1e-8 * abs(by_place).max())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: J2(E, NU, [(0.0, 250.0), (0.01, 300.0)]), "finite and > 0"),
        (lambda: J2(E, NU, [(250, 0.001), (300, 0.01)]), "begin at 0"),
        (lambda: J2(E, NU, [(250, 0), (300, 0.01), (310, 0.01)]), "increase"),
        (lambda: J2(E, NU, [(250, 0), (1, 1e-6)]), "not unique"),
        (lambda: J2(E, NU, [250, 300, 310]), "shape"),
        (lambda: J2(E, 0.5, 250), "no Poisson's ratio"),
        (lambda: J2(E, NU, 250, kinematic=-1), "slope"),
        (lambda: J2(E, NU, 250, finite_strain=1), "switch"),
        (lambda: Elastic(-1.0, NU), "no modulus"),
        (lambda: Elastic(E, NU, density=np.inf), "not finite"),
        (lambda: Elastic(E, NU).weight((0, -1)), r"give Elastic\(\.\.\., density="),
        (lambda: Elastic(E, NU).warmed(100.0), r"give Elastic\(\.\.\., expansion="),
        (lambda: NeoHooke(shear=0.0, bulk=1.0), "have to be > 0"),
        (lambda: MooneyRivlin(1.0, -2.0, bulk=1.0), "have to be > 0"),
        (lambda: FromFunction(3.0), "not a function"),
        (lambda: J2(E, NU, 250, hardening=1.0), "write kinematic"),
        (lambda: NeoHooke(E=1.0, nu=0.3), r"write NeoHooke.of\(E, nu\)"),
        (lambda: MooneyRivlin(1.0, bulc=1.0), "did you mean 'bulk'"),
    ],
)
def test_parameters_that_are_refused(make, message):
    """What is wrong with the parameters of a material is said where it is made."""
    with pytest.raises(sc.errors.InputError, match=message):
        make()


def test_a_law_of_hardening_that_does_not_converge_is_refused():
    """A yield stress whose slope is wrong: no plastic strain is found, and it is said."""
    law = J2(E, NU, lambda p: (Y + 1e9 * np.sin(1e9 * p), 0 * p))
    with pytest.raises(sc.errors.MaterialError, match="no plastic strain"):
        law(deviatoric(0.01), law.initial_state(1, 1))
