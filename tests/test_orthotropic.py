"""Friction with a material direction: what it takes, what it refuses, and where it has to arrive."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scipy.sparse import csr_matrix

sys.path.insert(0, str(Path(__file__).parent))
from solid_meshes import at, cube, elastic

import skfem_contact as sc
from skfem_contact.conditions import combinations, combined_rows, duals

FLOOR = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
LAW = sc.conditions.OrthotropicCoulomb((0.1, 0.3), (1, 2, 0))
STEPS = ((0, 0, -0.01), (0.004, 0.002, -0.01))


def moved(solver, shifts=STEPS):
    """Load steps that move the top."""
    (body,) = solver.system.bodies
    return [{"x": {"block": np.asarray(s)[body.dof_component] * top(body)}} for s in shifts]


def top(body):
    return np.isin(np.arange(body.n), body.D)


def solver(law=LAW, **settings):
    block = elastic(cube("quad4", 2), "quad4", "block", held=((at(2, 1.0), (0, 1, 2)),))
    return sc.ContactSolver(block, on_floor(block, law, **settings))


def on_floor(block, law, **settings):
    return sc.Contact(block.surface(at(2, 0.0)), FLOOR, friction=law, name="foot", **settings)


@pytest.mark.parametrize(
    "make, words",
    [
        (
            lambda: sc.conditions.OrthotropicCoulomb(0.3, (1, 0, 0)),
            r"mu has shape \(\); give the coefficients",
        ),
        (lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.2, 0.3), (1, 0, 0)), r"mu has shape \(3,\)"),
        (
            lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.0), (1, 0, 0)),
            "has to be positive and finite",
        ),
        (
            lambda: sc.conditions.OrthotropicCoulomb((0.1, -0.1), (1, 0, 0)),
            "has to be positive and finite",
        ),
        (
            lambda: sc.conditions.OrthotropicCoulomb((0.1, np.nan), (1, 0, 0)),
            "has to be positive and finite",
        ),
        (
            lambda: sc.conditions.OrthotropicCoulomb((1e-4, 0.3), (1, 0, 0)),
            "more than 1000 times the other",
        ),
        (lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.3), (1, 0)), r"direction has shape \(2,\)"),
        (lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.3), (0, 0, 0)), "not finite, or zero"),
        (lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.3), (1, np.inf, 0)), "not finite, or zero"),
        (lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.3), "x"), "direction is 'x'"),
        (
            lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.3), (1, 0, 0), tau_max=2.0),
            "has to be a pair of str",
        ),
        (
            lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.3), (1, 0, 0), (1.0, 2.0)),
            r"as in \(1, 3\)",
        ),
        (
            lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.3), (1, 0, 0), cohesion=(-1.0, -3.0)),
            "have to be >= 0",
        ),
        (
            lambda: sc.conditions.OrthotropicCoulomb((0.1, 0.3), (1, 0, 0), stiffness=-1.0),
            "is not positive",
        ),
        (lambda: sc.conditions.OrthotropicCoulomb(mu1=0.1, mu2=0.3), r"write mu=\(mu1, mu2\)"),
        (
            lambda: solver(sc.conditions.OrthotropicCoulomb((0.1, 0.3), (0.0, 1e-3, 1))),
            "is normal to the surface",
        ),
        (
            lambda: solver(sc.conditions.OrthotropicCoulomb(np.full((4, 2), 0.1), (1, 0, 0))),
            "has 9 points",
        ),
        (lambda: solver(sc.conditions.OrthotropicCoulomb((0.1, 0.3), np.ones((4, 3)))), "has 9 points"),
        (
            lambda: solver(sc.conditions.OrthotropicCoulomb((0.1, 0.3), lambda x: x[:2])),
            r"shape \(2, 9\)",
        ),
        (
            lambda: solver(
                sc.conditions.OrthotropicCoulomb((0.1, 0.3), lambda x: (x - 0.5) * [[1], [1], [0]])
            ),
            r"zero, at \(0.5, 0.5, 0\). Let the function return any direction",
        ),
    ],
)
def test_what_is_refused(make, words):
    """In words, before anything is solved."""
    with pytest.raises(sc.errors.InputError, match=words):
        make()


def test_not_in_the_plane_nor_for_a_scalar_field():
    """Where there are no two tangents."""
    mesh = fem.MeshQuad().refined(1).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    plate = sc.Body(basis, csr_matrix(np.eye(basis.N)), name="plate")
    with pytest.raises(sc.errors.InputError, match="one only in the plane: give Coulomb"):
        sc.Contact(plate.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=LAW)
    hot = fem.Basis(cube("quad4", 1), fem.ElementHex1())
    body = sc.Body(hot, csr_matrix(np.eye(hot.N)), name="hot")
    with pytest.raises(sc.errors.InputError, match="none of a scalar field"):
        sc.Contact(body.surface(at(2, 0.0)), body.surface(at(2, 1.0)), friction=LAW)


def test_the_law_by_itself():
    """It prints as it was written, and its bound is that along the rougher axis."""
    law = sc.conditions.OrthotropicCoulomb(
        (0.3, 0.1), (0, 1, 0), tau_max=(6.0, 2.0), cohesion=(0.3, 0.1)
    )
    assert repr(LAW) == "OrthotropicCoulomb(mu=(0.1, 0.3), direction=(1, 2, 0))"
    force, one = np.array([1.0, 100.0]), np.ones(2)
    assert_allclose(law.limit(force, one, np.zeros((2, 2))), [0.6, 6.0], rtol=1e-15)
    assert_allclose(law.slope(force, one, np.zeros((2, 2))), [0.3, 0.0], rtol=1e-15)
    assert LAW.is_linear and not law.is_linear
    assert "OrthotropicCoulomb(mu=(0.1, 0.3), direction=(1, 2, 0))" in str(solver())


def test_the_direction_may_have_any_length():
    """Also one whose square is zero, or infinite."""
    known = solver().geometry.kin.axes
    for length in (1e-200, 2.0**-600, 1e200):
        law = sc.conditions.OrthotropicCoulomb((0.1, 0.3), length * np.array([1.0, 2.0, 0.0]))
        assert_allclose(solver(law).geometry.kin.axes, known, rtol=0, atol=1e-15)


def test_axes_make_a_circle_of_the_ellipse():
    """Whichever tangent is held: it is a multiple of one axis, and duals give vectors back."""
    rng = np.random.default_rng(3)
    frames = np.linalg.qr(rng.standard_normal((20, 3, 3)))[0].transpose(0, 2, 1)
    frames *= np.linalg.det(frames)[:, None, None]
    normal, tangent, angle = frames[:, 2], frames[:, :2], rng.uniform(0, 7, 20)[:, None]
    first = np.cos(angle) * tangent[:, 0] + np.sin(angle) * tangent[:, 1]
    grain = np.stack([first, np.cross(normal, first)], axis=1)
    ratios = rng.uniform(0.01, 1.0, (20, 2))
    held = np.arange(20) % 2 == 0
    A = combinations(grain, ratios, tangent, held)
    axes = A @ tangent
    s = rng.standard_normal((20, 2))
    vectors = np.einsum("mk,mkd->md", s, tangent)
    scaled = np.einsum("mkd,md->mk", axes, vectors)
    ellipse = ratios * np.einsum("mkd,md->mk", grain, vectors)
    assert_allclose(np.sum(scaled**2, axis=1), np.sum(ellipse**2, axis=1), rtol=1e-12)
    back = np.einsum("mk,mkd->md", scaled, duals(axes, normal))
    assert_allclose(back, vectors, rtol=0, atol=1e-12 * 100)  # over the smallest ratio
    assert not A[held, 0, 1].any() and not A[~held, 1, 0].any()
    rows = csr_matrix(tangent.reshape(40, 3))
    assert_allclose(combined_rows(A, rows).toarray(), axes.reshape(40, 3), rtol=0, atol=1e-15)


def test_with_friction_shares_the_bodies():
    """From one law to the other and back, as if each solver had been made anew."""
    plain = solver(sc.Coulomb(0.2))
    pressed, *_ = plain.history(moved(plain))
    ours = plain.with_friction(LAW)
    assert ours.model is plain.model and "OrthotropicCoulomb" in str(ours)
    for twin, law in ((ours, LAW), (ours.with_friction(sc.Coulomb(0.2)), sc.Coulomb(0.2))):
        for start in (None, pressed):
            own = solver(law)
            one, two = (list(s.history(moved(s), start=start))[-1] for s in (twin, own))
            assert_allclose(one.u, two.u, rtol=0, atol=1e-15)
            assert_allclose(one.slip_vector, two.slip_vector, rtol=0, atol=1e-14)
    assert plain.contacts[0].friction.mu == 0.2


@pytest.mark.parametrize("sliding", [pytest.param("small", marks=pytest.mark.slow), "finite"])
def test_pickled_saved_and_gone_on_with(sliding, tmp_path):
    """A history in two parts, through a file and through pickle; functions are asked before."""
    law = sc.conditions.OrthotropicCoulomb(
        (0.1, 0.3), lambda x: np.array([1 + 0 * x[0], x[0], 0 * x[0]])
    )
    one = solver(law, sliding=sliding)
    first, second = one.history(moved(one))
    one.save_state(tmp_path / "state.npz", first)
    other = pickle.loads(pickle.dumps(one))
    for start in (other.load_state(tmp_path / "state.npz"), pickle.loads(pickle.dumps(first))):
        (last,) = other.history(moved(other)[1:], start=start)
        assert_allclose(last.u, second.u, rtol=0, atol=1e-12)
        assert_allclose(last.slip_vector, second.slip_vector, rtol=0, atol=1e-12)
    again = pickle.loads(pickle.dumps(second))
    assert again.report() == second.report() and again.certificate.worst < 1e-8
    assert_allclose(again.traction, second.traction, rtol=0, atol=1e-15)


def test_the_law_may_be_pickled_without_its_function():
    """A lambda stays behind, and says so when it is missed."""
    law = pickle.loads(pickle.dumps(sc.conditions.OrthotropicCoulomb((0.1, 0.3), lambda x: x)))
    with pytest.raises(
        sc.errors.InputError, match="direction of OrthotropicCoulomb is a function that was"
    ):
        solver(law)


def test_what_is_said_of_an_answer(tmp_path):
    """Report, validity, pictures and files: forces and slips themselves, not scaled ones."""
    ours = solver()
    *_, result = ours.history(moved(ours))
    values = result["foot"]
    assert "OrthotropicCoulomb: 0 open" in str(values) and result.validity is not None
    assert_allclose(values.integrate(values.traction), values.force, atol=1e-15)
    along = np.array([1, 2, 0]) / np.sqrt(5)
    assert_allclose(values.tangent[:, 0], np.tile(along, (9, 1)), atol=1e-15)
    assert_allclose(values.slip[:, 0], values.slip_vector @ along, atol=1e-15)
    balance = result.reaction("block") + values.force
    assert_allclose(balance, 0.0, atol=1e-12)
    sc.write(tmp_path / "a.vtu", result)
    sc.plot_contact(result)
