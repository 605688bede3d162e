"""Nodal stresses against closed forms of homogeneous and linear states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from skfem.models.poisson import laplace

import skfem_contact as sc

E, NU = 200.0, 0.3


def body(mesh: Any, element: Any) -> sc.Body:
    return sc.Body(fem.Basis(mesh, fem.ElementVector(element)), linear_elasticity(), name="body")


def displaced(target: sc.Body, *functions: Any) -> np.ndarray:
    """Nodal values of a displacement given by one function of position per component."""
    x = target.dof_points.T
    return np.choose(target.dof_component, [f(x) + 0 * x[0] for f in functions])


@pytest.mark.parametrize(
    ("plane", "strain", "expected"),
    [
        # tension along x, free to contract: the stress is E times the strain
        ("stress", (0.01, -NU * 0.01), (E * 0.01, 0.0, 0.0)),
        # the same with both other directions held: the constrained modulus, and nu/(1-nu) of it
        (
            "strain",
            (0.01, 0.0),
            tuple(
                E * 0.01 / ((1 + NU) * (1 - 2 * NU)) * np.array([1 - NU, NU, NU]),
            ),
        ),
        # equal strains in r and in the hoop, free along z: equal stresses of E/(1-nu) per strain
        (
            "axisymmetric",
            (0.01, -2 * NU / (1 - NU) * 0.01),
            (E * 0.01 / (1 - NU), 0.0, E * 0.01 / (1 - NU)),
        ),
    ],
)
@pytest.mark.parametrize("element", [fem.ElementTriP1(), fem.ElementTriP2()])
def test_homogeneous_states(
    plane: Any, strain: tuple[float, float], expected: tuple[float, ...], element: Any
) -> None:
    """Uniform strains give the stresses of Hooke's law at every node."""
    disk = body(fem.MeshTri().refined(2), element)
    u = displaced(disk, lambda x: strain[0] * x[0], lambda x: strain[1] * x[1])
    stress = sc.nodal_stress(disk, u, E=E, nu=NU, plane=plane)
    # round-off of a projection
    want = np.broadcast_to(np.diag(expected), stress.shape)
    assert_allclose(stress, want, rtol=0, atol=1e-10 * max(expected))
    a, b, c = expected
    mises = np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2))
    assert_allclose(sc.von_mises(disk, u, E=E, nu=NU, plane=plane), mises, rtol=1e-9)


def test_a_measure_tells_an_axisymmetric_body() -> None:
    """Von Mises stress of a disc under pressure is the pressure, 9 % less if taken for plane strain."""
    basis = fem.Basis(
        fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=4
    )
    disc = sc.Body(basis, sc.Elastic(E, NU), D="bottom", measure=lambda x: 2 * np.pi * x[0])
    u = displaced(disc, lambda x: NU * 0.01 * x[0], lambda x: -0.01 * x[1])
    assert_allclose(sc.von_mises(disc, u, E=E, nu=NU), 0.01 * E, rtol=1e-10)


def test_shear() -> None:
    """In pure shear von Mises is the square root of three times the shear stress."""
    plate = body(fem.MeshQuad().refined(1), fem.ElementQuadS2())
    u = displaced(plate, lambda x: 0.01 * x[1], lambda x: 0.0 * x[0])
    tau = E / (2 * (1 + NU)) * 0.01
    assert_allclose(sc.von_mises(plate, u, E=E, nu=NU), np.sqrt(3) * tau, rtol=1e-10)


def test_solid_in_tension() -> None:
    """A brick pulled along z and free to contract carries E times the strain, along z only."""
    brick = body(fem.MeshHex().refined(1), fem.ElementHex1())
    u = displaced(
        brick, lambda x: -NU * 0.01 * x[0], lambda x: -NU * 0.01 * x[1], lambda x: 0.01 * x[2]
    )
    stress = sc.nodal_stress(brick, u, E=E, nu=NU)
    want = np.broadcast_to(np.diag([0.0, 0.0, 2.0]), stress.shape)
    assert_allclose(stress, want, rtol=0, atol=2 * 1e-10)


def test_bending_is_exact_on_quadratic_elements() -> None:
    """A quadratic displacement has linear stresses, which the projection keeps: -E y / R."""
    beam = body(fem.MeshTri().refined(2), fem.ElementTriP2())
    R = 50.0
    u = displaced(
        beam,
        lambda x: -x[0] * x[1] / R,
        lambda x: (x[0] ** 2 + NU * x[1] ** 2) / (2 * R),
    )
    stress = sc.nodal_stress(beam, u, E=E, nu=NU, plane="stress")
    y = fem.Basis(beam.basis.mesh, fem.ElementTriP2()).doflocs[1]
    assert_allclose(stress[:, 0, 0], -E * y / R, rtol=0, atol=E / R * 1e-9)
    assert_allclose(stress[:, 1, 1], 0.0, atol=E / R * 1e-9)


def test_rotation_is_free_of_stress() -> None:
    """A small rigid rotation has no stress."""
    plate = body(fem.MeshTri(), fem.ElementTriP1())
    u = displaced(plate, lambda x: -0.01 * x[1], lambda x: 0.01 * x[0])
    assert_allclose(sc.von_mises(plate, u, E=E, nu=NU), 0.0, atol=E * 0.01 * 1e-12)


def test_what_has_no_stress_is_refused() -> None:
    """Unknown planes, displacements of all bodies together, and scalar fields are named."""
    plate = body(fem.MeshTri(), fem.ElementTriP1())
    with pytest.raises(sc.errors.InputError, match="plane = 'bent'"):
        sc.von_mises(plate, np.zeros(8), E=E, nu=NU, plane="bent")  # type: ignore[arg-type]
    with pytest.raises(sc.errors.InputError, match=r"result\.displacement\(body\)"):
        sc.von_mises(plate, np.zeros(16), E=E, nu=NU)
    heat = sc.Body(fem.Basis(fem.MeshTri(), fem.ElementTriP1()), laplace, name="heat")
    with pytest.raises(sc.errors.InputError, match="scalar problem"):
        sc.von_mises(heat, np.zeros(4), E=E, nu=NU)


SOLIDS_TOO = [
    (fem.MeshTri, fem.ElementTriP1()),
    (fem.MeshTri, fem.ElementTriP2()),
    (fem.MeshQuad, fem.ElementQuad1()),
    (fem.MeshQuad, fem.ElementQuadS2()),
    (fem.MeshQuad, fem.ElementQuad2()),
    (fem.MeshTet, fem.ElementTetP1()),
    (fem.MeshTet, fem.ElementTetP2()),
    (fem.MeshHex, fem.ElementHex1()),
    (fem.MeshHex, fem.ElementHexS2()),
]


@pytest.mark.parametrize(("mesh", "element"), SOLIDS_TOO)
def test_projection_is_that_of_scikit_fem(mesh: Any, element: Any) -> None:
    """Any displacement, on bent cells: each component is what `CellBasis.project` makes of it."""
    grid = mesh().refined(1)
    x = grid.p
    bent = 0.05 * np.sin(7 * x + np.roll(x, 1, axis=0)) + x * (1 + 2 * x[:1])
    some = body(type(grid)(bent, grid.t), element)
    u = np.random.default_rng(3).normal(size=some.n)
    stress = sc.nodal_stress(some, u, E=E, nu=NU)
    gradient = np.asarray(some.basis.interpolate(u).grad)
    d = some.dim
    trace = sum(gradient[i, i] for i in range(d))
    scalar = some.basis.with_element(element)
    for i in range(d):
        for j in range(d):
            shear = E / (2 * (1 + NU)) * (gradient[i, j] + gradient[j, i])
            direct = E * NU / ((1 + NU) * (1 - 2 * NU)) * trace if i == j else 0.0
            expected = scalar.project(shear + direct)
            # a direct solver and an iteration to round-off, on a mass matrix of condition 1e3 at most
            assert_allclose(stress[:, i, j], expected, atol=1e-10 * np.abs(expected).max())


def test_matrices_are_assembled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first stress of a body assembles three matrices, later ones and its twins none."""
    calls = []
    assemble = fem.BilinearForm.assemble

    def counted(self: Any, *args: Any, **kwargs: Any) -> Any:
        calls.append(self)
        return assemble(self, *args, **kwargs)

    plate = body(fem.MeshTri().refined(2), fem.ElementTriP1())
    monkeypatch.setattr("skfem.assembly.form.bilinear_form.BilinearForm.assemble", counted)
    u = displaced(plate, lambda x: 0.01 * x[0], lambda x: 0.0 * x[0])
    first = sc.von_mises(plate, u, E=E, nu=NU)
    assert len(calls) == 3
    twin = sc.Body(plate.basis, plate.K, D=[0], name="twin")
    assert_allclose(sc.von_mises(twin, 2 * u, E=E, nu=NU), 2 * first)
    assert len(calls) == 3
    sc.nodal_stress(plate, u, E=E, nu=NU, plane="axisymmetric")
    assert len(calls) == 4


def test_few_integration_points_are_enough(recwarn: pytest.WarningsRecorder) -> None:
    """One point to a triangle leaves the mass matrix singular; stresses are found nevertheless."""
    mesh, element = fem.MeshTri().refined(2), fem.ElementVector(fem.ElementTriP1())
    middle = np.array([[1 / 3], [1 / 3]]), np.array([0.5])
    few, many = (
        sc.Body(fem.Basis(mesh, element, **points), linear_elasticity(), name="plate")
        for points in ({"quadrature": middle}, {"intorder": 4})
    )
    u = np.random.default_rng(0).normal(size=few.n)
    found, expected = (sc.nodal_stress(plate, u, E=E, nu=NU) for plate in (few, many))
    assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
