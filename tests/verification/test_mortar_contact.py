"""Meshes that do not match: patch test (P1), extreme ratios of meshes (X10), joints (X20), overhangs
(X21), a saddle-point solution, and M1 with quadratic elements.

Blocks are sheared and turned, so that the interface lies at any angle. The exact state is a uniform
stress: the ends of the two blocks move as it does, their sides carry its traction.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import skfem as fem
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scenes import elastic
from scipy.sparse import bmat, vstack
from scipy.sparse.linalg import spsolve
from skfem.helpers import ddot, sym_grad
from unlike_meshes import QUADRATIC, rectangle

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.reference import ManufacturedSlip

KINDS = ["P1", "Q1", "P2", "Q2", "S2"]
EXACT = 1e-10
E, NU, MU = 1.0, 0.3, 0.5


@st.composite
def nodes_of_a_line(draw):
    """Nodes of [0, 1], no facet shorter than a twentieth of the mean."""
    sizes = np.array(draw(st.lists(st.floats(0.05, 1.0), min_size=1, max_size=6)))
    return np.append(0.0, np.cumsum(sizes)) / sizes.sum()


def tilted_block(kind, x, y, slope, angle):
    """Basis on a block sheared (y += slope x) and turned."""
    basis = rectangle(kind, x, y)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    p = basis.mesh.p.copy()
    p[1] += slope * p[0]
    mesh = type(basis.mesh)(turn @ p, basis.mesh.t).with_boundaries(basis.mesh.boundaries)
    return fem.Basis(mesh, basis.elem, intorder=4)


def uniform_stress(slope, angle, pressure, shear):
    """Stress with this pressure and shear on the interface, and some along it; the normal."""
    direction = angle + np.arctan(slope)
    n, t = np.array([-np.sin(direction), np.cos(direction)]), None
    t = np.array([-n[1], n[0]])
    stress = -pressure * np.outer(n, n) + shear * (np.outer(n, t) + np.outer(t, n))
    return stress + 0.4 * pressure * np.outer(t, t), n


def body_under(basis, stress, end, name, scale=1.0):
    """A block that is in the uniform stress if its contact surface carries it."""
    strain = (1 + NU) / E * (stress - NU * np.trace(stress) * np.eye(2))  # plane strain
    form = fem.LinearForm(lambda v, w: np.einsum("ij,j...,i...", stress, w.n, v))
    f = sum(
        form.assemble(fem.FacetBasis(basis.mesh, basis.elem, facets=side, intorder=4))
        for side in ("left", "right")
    )
    x = np.zeros(basis.N)
    for k in range(2):
        of = np.concatenate([a[k::2].ravel() for a in (basis.nodal_dofs, basis.facet_dofs)])
        interior = basis.dofs.interior_dofs
        of = np.concatenate([of, interior[k::2].ravel()]) if interior.size else of
        x[of] = strain[k] @ basis.doflocs[:, of]
    return sc.Body(basis, elastic(E, NU), f=f, D=end, x=x, name=name), x


def patch(kind, x_low, x_top, *, slope=0.0, angle=0.0, shear=0.0, law=None, method="mortar"):
    """Solve the patch test; the result and its largest errors of pressure, shear and displacement."""
    pressure = 0.01
    stress, n = uniform_stress(slope, angle, pressure, shear * pressure)
    kinds = kind if isinstance(kind, tuple) else (kind, kind)
    low, u_low = body_under(
        tilted_block(kinds[0], x_low, [-1, 0], slope, angle), stress, "bottom", "low"
    )
    top, u_top = body_under(tilted_block(kinds[1], x_top, [0, 1], slope, angle), stress, "top", "top")
    contact = sc.Contact(top.surface("bottom"), low.surface("top"), friction=law, method=method)
    result = sc.ContactSolver([low, top], [contact]).solve()
    exact = np.concatenate([u_low, u_top])
    return result, {
        "traction": np.abs(result.traction + stress @ n).max() / pressure,
        "displacement": np.abs(result.u - exact).max() / np.abs(exact).max(),
    }


ANY_MESHES = {
    "lines": st.tuples(nodes_of_a_line(), nodes_of_a_line()),
    "slope": st.floats(-0.6, 0.6),
    "angle": st.floats(0, 6.3),
}


@pytest.mark.every_value
@pytest.mark.parametrize("friction", [None, MU], ids=["smooth", "sticking"])
@pytest.mark.parametrize("kind", KINDS)
@given(**ANY_MESHES)
@settings(max_examples=4, deadline=None)
def test_P1_mortar_passes_whatever_the_meshes(kind, friction, lines, slope, angle):
    """Uniform pressure, and with friction uniform shear, cross any meshes at any angle."""
    passes(kind, friction, lines, slope, angle)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [None, MU], ids=["smooth", "sticking"])
@pytest.mark.parametrize("kind", KINDS)
@given(**ANY_MESHES)
@settings(max_examples=30, deadline=None)
def test_P1_mortar_passes_many_meshes(kind, friction, lines, slope, angle):
    """The same over more of them."""
    passes(kind, friction, lines, slope, angle)


def passes(kind, friction, lines, slope, angle):
    """Check the patch test of one pair of meshes, and that all slides just above the limit."""
    law = None if friction is None else sc.Coulomb(friction)
    shear = 0.0 if friction is None else 0.6 * friction
    result, error = patch(kind, *lines, slope=slope, angle=angle, shear=shear, law=law)
    # round-off, times the ratio of the lengths of facets (up to 20) to some power
    assert error["traction"] < EXACT
    assert error["displacement"] < EXACT
    assert (result.status == (2 if law is None else 1)).all()
    assert result.certificate.worst < EXACT
    if law is None:
        return
    # one hundredth above the limit all points slide together: the ends hold the block
    sliding, _ = patch(
        kind, *lines, slope=slope, angle=angle, shear=shear, law=sc.Coulomb(0.99 * shear)
    )
    ratio = np.linalg.norm(sliding.tangential_force, axis=1) / sliding.normal_force
    assert ratio.max() <= 0.99 * shear * (1 + EXACT)


@pytest.mark.parametrize("kinds", [("P1", "Q2"), ("P2", "Q1"), ("Q2", "P1"), ("S2", "P2")])
def test_P1_linear_meets_quadratic(kinds):
    """Blocks of different elements pass the patch test on either side."""
    _, error = patch(kinds, [0, 0.3, 1], [0, 0.2, 0.45, 1], slope=0.3, shear=0.2, law=sc.Coulomb(MU))
    assert max(error.values()) < EXACT


@pytest.mark.every_value
@pytest.mark.parametrize(
    ("kind", "finer", "coarser"),
    # measured errors of the pressure, node-to-segment, secondary finer and coarser
    [
        ("P1", 0.071, 0.12),
        ("Q1", 0.068, 0.11),
        ("P2", 0.015, 0.23),
        ("Q2", 0.014, 0.23),
        ("S2", 0.014, 0.24),
    ],
)
@pytest.mark.parametrize("law", [None, sc.Coulomb(MU)], ids=["smooth", "sticking"])
def test_P1_three_edges_against_five(kind, finer, coarser, law):
    """Where mortar is exact, node-to-segment errs, and on quadratics much more on the coarser side."""
    lines = np.linspace(0, 1, 4), np.linspace(0, 1, 6)
    shear = 0.0 if law is None else 0.2
    for (x_low, x_top), known in ((lines, finer), (lines[::-1], coarser)):
        error = {
            m: patch(kind, x_low, x_top, shear=shear, law=law, method=m)[1] for m in ("mortar", "node")
        }
        assert max(error["mortar"].values()) < EXACT
        assert_allclose(error["node"]["traction"], known, rtol=0.1)


# -- X10, X20, X21 ---------------------------------------------------------------------------------


def towards(h):
    """Heights from 0 to 1, elements of size h at 0."""
    y = h * np.cumsum(2.0 ** np.arange(60))
    y = np.append(0.0, y[y < 0.6])
    return np.append(y, 1.0)


@pytest.mark.every_value
@pytest.mark.parametrize("fine", ["secondary", "primary"])
@pytest.mark.parametrize("kind", KINDS)
# three nodes that press on a hundred turn the elements below them by more than their strain allows
@pytest.mark.filterwarnings("ignore:.*arge displacements:skfem_contact.errors.ContactWarning")
def test_X10_hundred_to_one(kind, fine):
    """A hundred facets on one: the uniform state is exact by mortar; forces are by node-to-segment."""
    one, many = np.array([0.0, 1.0]), np.linspace(0, 1, 101)
    lines = (one, many) if fine == "secondary" else (many, one)
    heights = [towards(x[1]) for x in lines]
    stress, n = uniform_stress(0.0, 0.0, 0.01, 0.0)
    for method in ("mortar", "node"):
        bodies, exact = [], []
        for x, y, name in zip(lines, (-heights[0][::-1], heights[1]), ("low", "top"), strict=True):
            end = "bottom" if name == "low" else "top"
            body, u = body_under(rectangle(kind, x, y), stress, end, name)
            bodies.append(body)
            exact.append(u)
        contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"), method=method)
        result = sc.ContactSolver(bodies, [contact]).solve()
        u = np.concatenate(exact)
        if method == "mortar":
            # forces of .01 / 100 out of stiffnesses of order 1 and displacements of .01: 100 times
            # round-off in the traction, and more by the number of digits that quadratics lose
            assert_allclose(
                result.traction,
                np.tile(-stress @ n, (answer_of(result).kin.m, 1)),
                rtol=0,
                atol=1e-2 * EXACT,
            )
            assert_allclose(result.u, u, rtol=0, atol=EXACT * 0.01)
            continue
        assert result.certificate.worst < EXACT
        if fine == "secondary":  # the coarse nodes of the primary sink in between, but no node does
            assert np.abs(result.u - u).max() < 0.06 * 0.01
        assert result.certificate.penetration < 1e-12


@pytest.mark.every_value
@pytest.mark.parametrize("kind", ["P1", "Q1", "Q2"])
@pytest.mark.parametrize("method", ["node", "mortar"])
def test_X20_node_on_a_joint(kind, method):
    """A secondary node that passes a joint of the primary by round-off changes nothing."""

    def solve(shift):
        low = rectangle(kind, [0, 0.25, 0.5, 1], [-1, -0.5, 0])
        top = rectangle(kind, [0, 0.5 + shift, 0.8, 1], [0, 0.5, 1])
        upper = sc.Body(top, elastic(E, NU), D="top", x=pressed(top), name="top")
        lower = sc.Body(low, elastic(E, NU), D="bottom", name="low")
        contact = sc.Contact(
            upper.surface("bottom"), lower.surface("top"), friction=sc.Coulomb(0.3), method=method
        )
        result = sc.ContactSolver([lower, upper], [contact]).solve()
        # each row is a partition: what leaves one surface arrives on the other
        assert_allclose(answer_of(result).kin.B_n @ np.ones(result.system.n), 0.0, atol=1e-12)
        return result.forces

    def pressed(basis):
        x = np.zeros(basis.N)
        down = basis.get_dofs("top").all("u^2")
        x[down] = -0.01 * (1 + basis.doflocs[0, down])
        return x

    there = solve(0.0)
    for shift in (1e-12, -1e-12, 1e-8, -1e-8):
        # the solution itself moves by about the shift, 1e-8 at most
        assert_allclose(solve(shift), there, rtol=0, atol=1e-6 * np.abs(there).max())


@pytest.mark.every_value
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("end", [0.6, 0.63, 0.79, 0.99])
def test_X21_no_force_beyond_the_end(kind, method, end):
    """Where the primary ends, contact does: the whole load passes, and none of it beyond the end."""
    low = rectangle(kind, np.linspace(0, end, 4), [-1, -0.5, 0])
    top = rectangle(kind, np.linspace(0, 1, 6), [0, 0.5, 1])
    P = 0.01
    facets = fem.FacetBasis(top.mesh, top.elem, facets="top")
    f = fem.LinearForm(lambda v, w: -P * np.maximum(1 - w.x[0] / end, 0) * v[1]).assemble(facets)
    still = top.get_dofs("left").all("u^1")
    upper = sc.Body(top, elastic(E, NU), f=f, D=still, name="top")
    lower = sc.Body(low, elastic(E, NU), D="bottom", name="low")
    contact = sc.Contact(upper.surface("bottom"), lower.surface("top"), method=method)
    result = sc.ContactSolver([lower, upper], [contact]).solve()
    assert_allclose(result.force, [0.0, -f.sum()], rtol=0, atol=EXACT * P)
    # a facet cut by the end has nodes beyond it, which carry part of what acts on the rest of it
    beyond = end + (0.2 if method == "mortar" else 1e-6)
    assert_allclose(result.normal_force[result.points[:, 0] > beyond], 0.0, atol=0)
    forces = lower.K @ result.displacement("low")
    surface = lower.surface("top")
    received = forces[surface.dofs[:, 1]]
    assert_allclose(received.sum(), f.sum(), rtol=EXACT)
    # merged rows act on two nodes: the moment is that which the other surface feels
    assert_allclose(result.moment(), -surface.points[:, 0] @ received, rtol=0, atol=EXACT * P)
    assert result.certificate.worst < EXACT


@pytest.mark.parametrize(("kind", "method"), [("P2", "mortar"), ("Q2", "mortar"), ("Q2", "node")])
def test_P1_on_the_axis_of_symmetry(kind, method):
    """Where a quadratic node has no area, pressure and area are right all the same."""
    p = 0.01

    def ring(x):
        return 2 * np.pi * x[0]

    @fem.BilinearForm
    def form(u, v, w):  # E = 1, nu = 0
        eu, ev = sym_grad(u), sym_grad(v)
        return ring(w.x) * (ddot(eu, ev) + u[0] * v[0] / w.x[0] ** 2)

    low = rectangle(kind, [0, 0.5, 1] if method == "mortar" else [0, 0.3, 1], [-1, 0])
    top = rectangle(kind, [0, 0.3, 1], [0, 1])
    bodies = []
    for basis, end in ((low, "bottom"), (top, "top")):
        x = np.zeros(basis.N)
        down = basis.get_dofs(end).all("u^2")
        x[down] = -p * basis.doflocs[1, down]
        D = np.concatenate([down, basis.get_dofs("left").all("u^1")])
        bodies.append(sc.Body(basis, form, D=D, x=x, measure=ring, name=end))
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"), method=method)
    result = sc.ContactSolver(bodies, [contact]).solve()
    assert_allclose(result.pressure, p, rtol=1e-9)
    assert (result.status == 2).all()
    assert_allclose(result.area.sum(), np.pi, rtol=1e-12)
    assert_allclose(result.integrate(result.pressure), np.pi * p, rtol=1e-9)
    assert_allclose(result.contact_area, np.pi, rtol=1e-12)


# -- the saddle point ------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [None, sc.Coulomb(0.2)], ids=["smooth", "friction"])
@pytest.mark.parametrize("kind", ["P1", "Q2"])
def test_elimination_equals_saddle_point(kind, law):
    """Eliminating normal (and sticking) DOFs is solving the mortar system with multipliers."""
    low = rectangle(kind, np.linspace(-1, 2, 8), np.linspace(-2, 0, 4))
    top = rectangle(kind, np.linspace(0, 1, 6), np.linspace(0, 1, 4))
    x = np.zeros(top.N)
    x[top.get_dofs("top").all("u^2")] = -0.02
    x[top.get_dofs("top").all("u^1")] = 0.004
    upper = sc.Body(top, elastic(1.0, 0.3), D="top", x=x, name="top")
    lower = sc.Body(low, elastic(3.0, 0.2), D="bottom", name="low")
    contact = sc.Contact(upper.surface("bottom"), lower.surface("top"), friction=law, method="mortar")
    result = sc.ContactSolver([lower, upper], [contact]).solve()
    system, kin = result.system, answer_of(result).kin
    rows = [kin.B_n[result.status != 0]]
    forces = [result.normal_force[result.status != 0]]
    slipping = np.zeros(system.n)
    if law is not None:
        stick = result.status == 1
        assert stick.any() and (result.status == 2).any()
        rows.append(kin.B_t[stick])
        forces.append(result.tangential_force[stick, 0])
        slipping = kin.B_t[~stick].T @ result.tangential_force[~stick, 0]
    C = vstack(rows).tocsc()
    free = np.setdiff1d(np.arange(system.n), system.D)
    K = system.K[free][:, free]
    f = (system.f + slipping - system.K @ system.x)[free]
    saddle = bmat([[K, -C[:, free].T], [C[:, free], None]]).tocsc()
    solution = spsolve(saddle, np.concatenate([f, -C @ system.x]))
    u = system.x.copy()
    u[free] += solution[: len(free)]
    assert_allclose(result.u, u, rtol=0, atol=1e-11 * 0.02)
    force = np.concatenate(forces)
    # forces are stiffness (up to 3 times some units) times displacements of .02
    assert_allclose(solution[len(free) :], force, rtol=0, atol=1e-11 * np.abs(force).max())
    if law is None:
        held = sc.elimination.contact_rows(system, contact, closed=result.status != 0)
        other = fem.solve(
            *sc.elimination.condense(system.K, system.f, rows=held, D=system.D, x=system.x)
        )
        assert_allclose(other, u, rtol=0, atol=1e-11 * 0.02)


# -- linear pressure, and M1 -----------------------------------------------------------------------


@pytest.mark.parametrize("kind", QUADRATIC)
def test_linear_pressure_between_quadratic_blocks(kind):
    """Bending across meshes that do not match: quadratic blocks carry the linear pressure exactly."""
    basis = [
        rectangle(kind, [0, 0.35, 0.5, 1], [-1, 0]),
        rectangle(kind, [0, 0.2, 0.6, 0.7, 1], [0, 1]),
    ]
    p = lambda x: 0.01 * (1 + 2 * x)  # noqa: E731
    bodies = []
    for b, name, end in zip(basis, ("low", "top"), ("bottom", "top"), strict=True):
        # nu = 0, E = 1: bending by u_y = -p(x) y, u_x = p'(x) y²/2, which is zero at the interface
        work = fem.LinearForm(lambda v, w: -p(w.x[0]) * w.n[1] * v[1])
        f = work.assemble(fem.FacetBasis(b.mesh, b.elem, facets=end, intorder=4))
        at = b.get_dofs(end)
        D = np.append(at.all("u^2"), b.get_dofs("left").all("u^1")[:1]) if name == "low" else None
        x = np.zeros(b.N)
        down = at.all("u^2")
        x[down] = -p(b.doflocs[0, down]) * b.doflocs[1, down]
        if name == "top":
            D = b.get_dofs("left").all("u^1")[:1]
            x[:] = 0.0
        held = D[np.isin(D, b.get_dofs("left").all("u^1"))][:1]
        x[held] = 0.01 * b.doflocs[1, held] ** 2
        bodies.append(sc.Body(b, elastic(1.0, 0.0), f=f, D=D, x=x, name=name))
    for method, exact in (("mortar", True), ("node", False)):
        contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"), method=method)
        result = sc.ContactSolver(bodies, [contact]).solve()
        error = np.abs(result.pressure / p(result.points[:, 0]) - 1).max()
        assert error < EXACT if exact else error > 1e-3


UPPER, LOWER = ManufacturedSlip(), ManufacturedSlip(E=0.6, nu=0.2, c=0.0)


def square(exact, kind, n, y, name, free):
    """A unit square that carries the exact body force, and the exact motion on three sides."""
    basis = rectangle(kind, np.linspace(0, 1, n + 1), y)
    force = fem.LinearForm(lambda v, w: np.einsum("i...,i...", exact.body_force(w.x), v))
    f = force.assemble(fem.Basis(basis.mesh, basis.elem, intorder=8))
    D = np.unique(
        np.concatenate([basis.get_dofs(s).all() for s in {"left", "right", "bottom", "top"} - {free}])
    )
    body = sc.Body(basis, elastic(exact.E, exact.nu), f=f, D=D, x=true_motion(exact, basis), name=name)
    return body


def true_motion(exact, basis):
    x = np.zeros(basis.N)
    body = sc.Body(basis, elastic(1.0, 0.3))
    at = np.arange(basis.N)
    x[:] = exact.displacement(basis.doflocs)[body.dof_component, at]
    return x


@lru_cache
def made(kind, n, method):
    """The answer to the manufactured problem."""
    top = square(UPPER, kind, n, np.linspace(0, 1, n + 1), "top", "bottom")
    bodies, primary = [top], sc.RigidPlane((0, 0), (0, 1))
    if method != "plane":
        k = n if method == "matching" else round(0.75 * n)
        low = square(LOWER, kind, k, np.linspace(-1, 0, k + 1), "low", "top")
        bodies, primary = [top, low], low.surface("top")
    contact = sc.Contact(
        top.surface("bottom"),
        primary,
        friction=sc.Coulomb(UPPER.mu),
        method="node" if method == "node" else "mortar",
    )
    return sc.ContactSolver(bodies, [contact]).solve()


@lru_cache
def manufactured(kind, n, method):
    """Its error of displacement, and those of the tractions."""
    result, error = made(kind, n, method), 0.0
    for body, exact in zip(result.system.bodies, (UPPER, LOWER), strict=False):
        true = true_motion(exact, body.basis)
        found = np.linalg.norm(result.displacement(body.name) - true) / np.linalg.norm(true)
        error = max(error, found)
    inner = np.argsort(result.points[:, 0])[3:-3]
    x = result.points[inner, 0]
    scale = UPPER.p0
    return error, {
        "pressure": np.abs(result.pressure[inner] - UPPER.pressure([x])).max() / scale,
        "friction": np.abs(-result.traction[inner, 0] - UPPER.traction([x])).max() / scale,
    }


@pytest.mark.parametrize(
    ("kind", "method", "meshes", "least", "order"),
    [
        # the gate for quadrilaterals is 3e-4 at n = 32 on the plane; the lower squares have 3/4 of
        # the elements, whose own error is (4/3)² as large
        ("P1", "mortar", (16, 32, 64), 6e-4, 1.85),
        pytest.param("Q1", "mortar", (16, 32, 64), 5e-4, 1.85, marks=pytest.mark.slow),
        pytest.param("P2", "plane", (8, 16, 32), 2e-5, 3.5, marks=pytest.mark.slow),
        ("P2", "mortar", (8, 16, 32), 2.2e-5, 3.4),
        pytest.param("Q2", "plane", (8, 16, 32), 7e-6, 3.0, marks=pytest.mark.slow),
        pytest.param("Q2", "matching", (8, 16, 32), 8e-6, 3.0, marks=pytest.mark.slow),
        ("Q2", "mortar", (8, 16, 32), 1e-5, 3.4),
        ("S2", "plane", (8, 16, 32), 6e-6, 2.7),
        pytest.param("S2", "mortar", (8, 16, 32), 9e-6, 3.1, marks=pytest.mark.slow),
    ],
)
def test_M1_orders(kind, method, meshes, least, order):
    """Stick, slip and Dirichlet corners: displacements of order 2, with quadratic elements 3.

    Errors at the nodes of quadratic elements fall faster than those in between, by up to h⁴.
    """
    errors = [manufactured(kind, n, method)[0] for n in meshes]
    assert errors[1] <= least
    assert np.log2(errors[0] / errors[-1]) / 2 >= order
    assert np.log2(errors[1] / errors[2]) >= order - 0.1
    # stick ends within a facet: pressure and friction have a kink there, .3 to 1 percent at n = 32
    tractions = manufactured(kind, 32, method)[1]
    assert max(tractions.values()) < 0.01


@pytest.mark.parametrize(
    ("kind", "order"), [pytest.param("P2", 1.4, marks=pytest.mark.slow), ("Q2", 1.4)]
)
def test_M1_node_to_segment_keeps_quadratic_elements_from_their_order(kind, order):
    """On meshes that do not match, node-to-segment spends what quadratic elements gain."""
    errors = [manufactured(kind, n, "node")[0] for n in (8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > order).all() and (orders < 2.0).all()
    assert errors[-1] > 30 * manufactured(kind, 32, "mortar")[0]
    # the pressure does not converge at all
    assert manufactured(kind, 32, "node")[1]["pressure"] > 0.04
