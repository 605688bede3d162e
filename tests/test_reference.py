"""The closed forms, each against a formulation that shares nothing with it.

Quadrature of tractions, finite integral transforms, linear solves of boundary conditions, the
complex step. Tolerances are those of the quadrature unless a comment says more.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm

from skfem_contact import reference as ref
from skfem_contact.errors import InputError

E_STAR = 109890.10989
LINE = ref.hertz_line(1000.0, 100.0, E_STAR)
POINT = ref.hertz_point(500.0, 25.0, 10989.0)
QUARTIC = ref.quartic_line(3.0, 0.2, 50.0)


def line_integral(function, a, breaks=()):
    """Integral over ``-a < x < a`` of an even function with root-like ends: ``x = a sin t``."""
    angles = sorted(math.asin(min(b / a, 1.0)) for b in breaks)
    edges = [0.0, *angles, math.pi / 2]
    total = 0.0
    for low, high in pairwise(edges):
        part = quad(lambda t: float(function(a * math.sin(t))) * a * math.cos(t), low, high)
        total += part[0]
    return 2 * total


def disc_integral(function, a, breaks=()):
    """Integral over the disc ``r < a``."""
    return math.pi * line_integral(lambda r: function(r) * abs(r), a, breaks)


# --- Hertz ----------------------------------------------------------------------------------


def test_hertz_pressures_carry_their_load():
    """The integral of each pressure is the load."""
    assert math.isclose(line_integral(LINE.pressure, LINE.a), LINE.P, rel_tol=1e-9)
    assert math.isclose(disc_integral(POINT.pressure, POINT.a), POINT.P, rel_tol=1e-9)
    assert math.isclose(line_integral(QUARTIC.pressure, QUARTIC.a), QUARTIC.P, rel_tol=1e-9)


def surface_slope(pressure, a, E_star, x, n=4000):
    """Slope ``2/(π E*) PV∫ p/(x-s) ds`` towards the load, by Chebyshev points of the second kind.

    With ``p = sqrt(1-s²) f`` and x at a zero of ``T_{n+1}`` Gauss' rule is exact for
    polynomials f.
    """
    k = np.arange(1, n + 1)
    s = np.cos(k * np.pi / (n + 1))
    weights = np.pi / (n + 1) * np.sin(k * np.pi / (n + 1)) ** 2
    m = round((n + 1) * math.acos(x / a) / math.pi - 0.5)
    x = math.cos((2 * m + 1) * math.pi / (2 * (n + 1)))
    f = pressure(a * s) / np.sqrt(1 - s**2)
    return a * x, 2 / (math.pi * E_star) * np.sum(weights * f / (x - s))


@pytest.mark.parametrize(
    ("contact", "slope"),
    [
        (LINE, lambda x: x / LINE.R),
        (QUARTIC, lambda x: 4 * QUARTIC.C * x**3),
    ],
    ids=["parabola", "quartic"],
)
def test_pressure_presses_the_surface_into_the_profile(contact, slope):
    """Under its pressure the half plane takes the shape of the indenter."""
    for share in (0.1, 0.45, 0.9):
        x, found = surface_slope(contact.pressure, contact.a, contact.E_star, share * contact.a)
        assert math.isclose(found, slope(x), rel_tol=1e-9)


def test_point_pressure_presses_the_surface_into_the_sphere():
    """Potential of the Hertz pressure: middle a²/R deep, edge a²/(2R)."""
    a, E_star = POINT.a, POINT.E_star
    # middle: every ring contributes 2π p dr / (π E*)
    middle = line_integral(POINT.pressure, a) / E_star
    assert math.isclose(middle, POINT.approach, rel_tol=1e-9)
    # edge: chords through the edge point, (1/πE*) ∫ dφ ∫ p ds, with p on a chord a semi-ellipse
    # of height p0 cos φ and half length a cos φ
    edge = quad(lambda phi: POINT.p0 * a * math.pi / 2 * math.cos(phi) ** 2, -math.pi / 2, math.pi / 2)
    assert math.isclose(edge[0] / (math.pi * E_star), a**2 / (2 * POINT.R), rel_tol=1e-9)


def log_potential(traction, a, E_star, x, breaks=()):
    """``-(2/πE*) ∫ traction ln|x-s| ds`` over ``|s| < a``, split where it is not smooth."""
    edges = sorted({-a, a, *(b for c in (x, *breaks) for b in (-c, c) if abs(c) < a)})

    def integrand(t):
        s = a * math.sin(t)
        return float(traction(s)) * a * math.cos(t) * math.log(max(abs(x - s), 1e-300))

    parts = (quad(integrand, *map(math.asin, np.divide(e, a)), limit=200)[0] for e in pairwise(edges))
    return -2 / (math.pi * E_star) * sum(parts)


def test_hertz_line_surface_displacement_is_the_logarithmic_potential():
    """Inside and outside, that of the pressure, relative to the middle."""
    middle = log_potential(LINE.pressure, LINE.a, LINE.E_star, 0.0)
    for x in (0.3, 0.95, 1.1, 2.0, 40.0):
        found = float(LINE.surface_displacement(x * LINE.a))
        expected = log_potential(LINE.pressure, LINE.a, LINE.E_star, x * LINE.a) - middle
        assert math.isclose(found, expected, rel_tol=1e-7)
    far = LINE.P / (math.pi * E_STAR) * (2 * math.log(2 * 100.0) + 1)
    # the asymptote errs by (a/L)²
    assert math.isclose(LINE.approach(100 * LINE.a), far, rel_tol=1e-4)


def test_stresses_on_the_axis_are_those_of_flamants_forces():
    """Superposition of point forces gives the principal stresses, their largest difference
    and the shortening."""
    E, nu = 200e3, 0.3

    def flamant(z):
        def sum_of(power):
            return line_integral(
                lambda s: float(LINE.pressure(s)) * s**power / (s**2 + z**2) ** 2, LINE.a
            )

        return -2 * z / math.pi * sum_of(2), -2 * z**3 / math.pi * sum_of(0)

    for z in (0.3, 0.8, 3.0):
        np.testing.assert_allclose(LINE.axis_stresses(z * LINE.a), flamant(z * LINE.a), rtol=1e-8)
    z = np.linspace(0.5, 1.0, 50001) * LINE.a
    sx, sz = LINE.axis_stresses(z)
    shear = (sx - sz) / 2
    assert math.isclose(shear.max(), LINE.max_shear, rel_tol=1e-8)
    # a maximum is flat: its place is known to the root of its value only
    assert math.isclose(z[shear.argmax()], LINE.max_shear_depth, rel_tol=1e-4)
    assert math.isclose(LINE.max_shear / LINE.p0, 0.3003, abs_tol=5e-5)

    depth = 7 * LINE.a

    def strain(z):
        sx, sz = LINE.axis_stresses(z)
        return float(((1 - nu**2) * sz - nu * (1 + nu) * sx) / E)

    assert math.isclose(LINE.compression(depth, E, nu), -quad(strain, 0, depth)[0], rel_tol=1e-9)
    far = 1e4 * LINE.a
    johnson = LINE.P * (1 - nu**2) / (math.pi * E) * (2 * math.log(2e4) - nu / (1 - nu))
    assert math.isclose(LINE.compression(far, E, nu), johnson, rel_tol=1e-7)
    assert ref.hertz_line(0.0, 1.0, 1.0).compression(1.0, E, nu) == 0


def test_published_hertz_numbers():
    """ANSYS VM191 and the numbers of the field for steel cylinders."""
    E_star = ref.effective_modulus(30000, 0.25, 29120, 0.3)
    vm191 = ref.hertz_line(3200.0, 1 / (1 / 10 + 1 / 13), E_star)
    assert math.isclose(vm191.a, 1.20, rel_tol=5e-4)  # the target is printed with three digits
    assert math.isclose(POINT.P, 4 / 3 * POINT.E_star * math.sqrt(POINT.R) * POINT.approach**1.5)


def test_layer_coefficients_meet_the_tabulated_far_end():
    """The Fourier integral gives the coefficients found with finite elements on wide blocks."""
    for base, nu, expected in (
        ("fixed", 0.0, 0.731),
        ("fixed", 0.3, 0.912),
        ("roller", 0.2, 0.663),
    ):
        # printed with three digits
        assert math.isclose(ref.block_coefficient(base, nu), expected, abs_tol=6e-4)
        assert math.isclose(ref.block_coefficient(base, nu, 5.0), expected, abs_tol=6e-4)
    for width, expected in ((1.0, 0.983), (1.5, 0.926), (2.0, 0.913)):
        assert math.isclose(ref.block_coefficient("fixed", 0.3, width), expected, abs_tol=1e-3)
    for width, expected in ((1.0, 0.701), (1.5, 0.728), (2.0, 0.734)):
        assert math.isclose(ref.block_coefficient("fixed", 0.0, width), expected, abs_tol=1e-3)
    for width, expected in ((1.0, 0.561), (1.5, 0.664), (2.0, 0.669)):
        assert math.isclose(ref.block_coefficient("roller", 0.3, width), expected, abs_tol=1e-3)


def test_block_coefficient_is_the_far_field_of_a_layer():
    """A layer on a smooth base, solved in Fourier series by its four boundary conditions."""
    nu, E = 0.25, 1.0
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

    def compliance(xi, base):
        # u_x = U(y) sin kx, u_y = V(y) cos kx, k H = xi, y down from the surface: the state
        # (U, V, s_xy, s_yy) obeys a linear equation with constant coefficients
        k = xi
        M = np.array(
            [
                [0, k, 1 / G, 0],
                [-lam * k / (lam + 2 * G), 0, 0, 1 / (lam + 2 * G)],
                [(lam + 2 * G - lam**2 / (lam + 2 * G)) * k**2, 0, 0, lam * k / (lam + 2 * G)],
                [0, 0, -k, 0],
            ]
        )
        T = expm(M)  # from the surface to the base
        fixed = T[[0, 1]] if base == "fixed" else T[[2, 1]]
        # surface: s_xy = 0, s_yy = -1 (pressed); unknown U, V
        _, V = np.linalg.solve(fixed[:, :2], -fixed[:, 2:] @ [0.0, -1.0])
        return V * E / (1 - nu**2) * k / 2  # over that of the half plane

    for base in ("fixed", "roller"):
        nodes, weights = np.polynomial.legendre.leggauss(40)
        xi = 6 * (nodes + 1)
        layer = 6 * sum(w * x * (1 - compliance(x, base)) for x, w in zip(xi, weights, strict=True))
        # beyond xi = 12 the integrand is below 1e-8
        assert math.isclose(ref.block_coefficient(base, nu), 2 / math.pi * layer, rel_tol=1e-6)


def test_finite_block_lowers_the_half_width():
    """The correction is ``(1 + C π/4 (a0/H)²)**-0.5`` in a and its inverse in p0."""
    E, nu, H = 200e3, 0.3, 10.0
    E_star = ref.effective_modulus(E, nu)
    plain = ref.hertz_line(1000.0, 100.0, E_star)
    added = ref.block_curvature(1000.0, H, E, nu, width=2.0)
    block = ref.hertz_line(1000.0, 100.0, E_star, added_curvature=added)
    factor = (1 + ref.block_coefficient("fixed", nu, 2.0) * math.pi / 4 * (plain.a / H) ** 2) ** -0.5
    assert math.isclose(block.a / plain.a, factor, rel_tol=1e-12)
    assert math.isclose(block.p0 / plain.p0, 1 / factor, rel_tol=1e-12)


# --- partial slip ---------------------------------------------------------------------------


@pytest.mark.every_value
@pytest.mark.parametrize("contact", [LINE, POINT, QUARTIC], ids=["line", "point", "quartic"])
@pytest.mark.parametrize(
    "path", [(0.5,), (0.8, 0.3), (0.8, -0.8), (0.9, -0.5, 0.4, 0.1), (1.0, 0.0), (-0.6, 0.2)]
)
def test_partial_slip_carries_the_force_within_the_cone(contact, path):
    """At every point of a nested path: resultant Q, |q| <= mu p, and q = ±mu p outside c."""
    mu = 0.4
    loads = [x * mu * contact.P for x in path]
    state = ref.cattaneo_mindlin(contact, mu, loads[-1], after=tuple(loads[:-1]))
    breaks = [state._reduced(k).a for k in range(len(path))]
    integral = disc_integral if contact is POINT else line_integral
    total = integral(state.traction, contact.a, breaks)
    assert math.isclose(total, loads[-1], rel_tol=1e-7, abs_tol=1e-8 * mu * contact.P)
    x = np.linspace(0, contact.a, 2001)
    bound = mu * contact.pressure(x)
    assert np.all(np.abs(state.traction(x)) <= bound + 1e-12 * bound.max())
    outside = x > state.c * (1 + 1e-9)
    direction = np.sign(np.diff([0.0, *loads])[-1])
    np.testing.assert_allclose(
        state.traction(x)[outside], direction * bound[outside], rtol=0, atol=1e-12 * bound.max()
    )


@pytest.mark.parametrize(("contact", "exponent"), [(LINE, 1 / 2), (POINT, 1 / 3), (QUARTIC, 1 / 4)])
def test_stick_zone_shrinks_by_the_root_of_the_profile(contact, exponent):
    """First loading c/a = (1-x)^n, reversal (1 - dQ/2muP)^n."""
    mu, full = 0.3, 0.3 * contact.P
    for x in (0.25, 0.5, 0.75):
        state = ref.cattaneo_mindlin(contact, mu, x * full)
        assert math.isclose(state.c / contact.a, (1 - x) ** exponent, rel_tol=1e-12)
        back = ref.cattaneo_mindlin(contact, mu, (0.9 - x) * full, after=(0.9 * full,))
        assert math.isclose(back.c / contact.a, (1 - x / 2) ** exponent, rel_tol=1e-12)


def test_cattaneo_traction_is_the_formula_of_1938():
    """The superposition of two Hertz pressures is Cattaneo's traction."""
    x = np.linspace(-1, 1, 41) * LINE.a
    state = ref.cattaneo_mindlin(LINE, 0.2, 0.75 * 0.2 * LINE.P)
    inner = np.sqrt(np.maximum(1 - (x / state.c) ** 2, 0))
    expected = 0.2 * LINE.p0 * (np.sqrt(1 - (x / LINE.a) ** 2) - 0.5 * inner)
    np.testing.assert_allclose(state.traction(x), expected, rtol=0, atol=1e-12 * LINE.p0)


def test_slip_is_the_shift_less_the_displacement_under_the_traction():
    """The surface under the traction q moves uniformly in |x| < c and lags behind outside."""
    mu, Q = 0.5, 0.3 * LINE.P
    state = ref.cattaneo_mindlin(LINE, mu, Q)

    def moved(x):
        return log_potential(state.traction, LINE.a, LINE.E_star, x, (state.c,))

    for share in (0.2, 0.5, 0.8, 0.95):
        x = share * LINE.a
        slip = float(ref.cattaneo_mindlin_slip(LINE, mu, Q, x))
        assert (slip == 0) == (x < state.c)
        assert math.isclose(slip, moved(0.0) - moved(x), abs_tol=1e-8 * LINE.a**2 / LINE.R)
        assert float(ref.cattaneo_mindlin_slip(LINE, mu, -Q, x)) == -slip


def masing(backbone, Q0):
    """Area ``8 ∫ Q dδ - 4 Q0 δ0`` of the loop made of the twofold enlarged backbone."""
    area = quad(lambda Q: backbone(Q0) - backbone(Q), 0, Q0, epsabs=0, epsrel=1e-11)[0]
    return 8 * area - 4 * Q0 * backbone(Q0)


@pytest.mark.parametrize("x", [0.05, 0.2, 0.6, 0.95])
def test_fretting_dissipation_of_the_line_is_traction_times_slip(x):
    """Per cycle 4 ∫ mu p slip(Q0) dx, and the Masing loop of the tangential shift."""
    mu = 0.6
    Q0 = x * mu * LINE.P
    W = ref.fretting_dissipation_line(LINE, mu, Q0)
    c = ref.cattaneo_mindlin(LINE, mu, Q0).c
    work = line_integral(
        lambda s: mu * float(LINE.pressure(s)) * float(ref.cattaneo_mindlin_slip(LINE, mu, Q0, s)),
        LINE.a,
        (c,),
    )
    assert math.isclose(W, 4 * work, rel_tol=1e-7)
    # the forces act on distant points: at a distance L the loop is larger by (a/L)²; its area is
    # the small difference (x³/12) of large numbers
    loops = [masing(lambda Q, L=L: ref.tangential_shift_line(LINE, mu, Q, L), Q0) for L in (1e4, 1e6)]
    np.testing.assert_allclose(loops, W, rtol=1e-6)


def test_fretting_dissipation_has_no_seam_and_the_known_ends():
    """Series and formula agree where they meet; x -> 1 gives 2/π."""
    h = ref.hertz_line(1.0, 1.0, 1.0)
    below, above = (ref.fretting_dissipation_line(h, 1.0, x) for x in (0.1 * (1 - 1e-9), 0.1))
    assert math.isclose(below, above, rel_tol=1e-8)
    assert math.isclose(ref.fretting_dissipation_line(h, 1.0, 1e-7), 4 / math.pi / 6e21, rel_tol=1e-6)
    assert math.isclose(ref.fretting_dissipation_line(h, 1.0, 1.0), 2 / math.pi, rel_tol=1e-12)


@pytest.mark.parametrize("x", [0.02, 0.0999, 0.1, 0.5, 0.9, 1.0])
def test_mindlin_dissipation_is_the_masing_loop(x):
    """The published loop of two spheres is the doubled backbone."""
    mu, S = 0.3, ref.mindlin_compliance(4000.0, 0.3, 9000.0, 0.2)
    Q0 = x * mu * POINT.P
    W = ref.mindlin_dissipation(POINT, mu, Q0, S)
    # the loop is x²/27 of the terms it is the difference of
    expected = masing(lambda Q: ref.mindlin_shift(POINT, mu, Q, S), Q0)
    assert math.isclose(W, expected, rel_tol=1e-6)
    # the initial slope is S/(8 a)
    assert math.isclose(ref.mindlin_shift(POINT, mu, 1e-9, S), S / (8 * POINT.a) * 1e-9, rel_tol=1e-6)


def test_mindlin_initial_compliance_is_a_uniform_shift_of_the_circle():
    """Traction Q/(2πa sqrt(a²-r²)) moves the middle by S Q/(8a): Cerruti's solution integrated."""
    a, G, nu, Q = 2.0, 3.0, 0.3, 1.0
    # u_x = (1/2πG) ∫ q [(1-ν)/r + ν x²/r³] dA; mean of x²/r² over the angle is 1/2
    q = lambda r: Q / (2 * math.pi * a * math.sqrt(a**2 - r**2))  # noqa: E731
    radial = quad(lambda t: q(a * math.sin(t)) * a * math.cos(t), 0, math.pi / 2)[0]
    middle = 2 * math.pi * radial * ((1 - nu) + nu / 2) / (2 * math.pi * G)
    contact = ref.HertzPoint(1.0, 1.0, 1.0, a)
    S = ref.mindlin_compliance(G, nu)
    assert math.isclose(ref.mindlin_shift(contact, 1e9, Q, S), middle, rel_tol=1e-7)


@pytest.mark.parametrize("s", [0.0, 0.25, 0.5, 0.75, 1.0, 2.0])
def test_capped_sliding_force_is_the_integral_of_the_capped_traction(s):
    """Line and point; the cap holds exactly up to the stated radius."""
    mu = 0.7
    for contact, integral in ((LINE, line_integral), (POINT, disc_integral)):
        state = ref.capped_sliding(contact, mu, s * mu * contact.p0)
        found = integral(state.traction, contact.a, (state.capped,))
        assert math.isclose(state.Q, found, rel_tol=1e-8, abs_tol=1e-12)
        edge = mu * float(contact.pressure(state.capped))
        assert math.isclose(edge, min(s, 1.0) * mu * contact.p0, rel_tol=1e-7, abs_tol=1e-3)


def test_torsion_capacities_are_moments_of_the_pressure():
    """Sphere and annulus: ∫ mu p r dA."""
    found = disc_integral(lambda r: 0.3 * POINT.pressure(r) * abs(r), POINT.a)
    assert math.isclose(ref.sphere_torsion_capacity(POINT, 0.3), found, rel_tol=1e-9)
    p = 2.0 / (math.pi * 3)
    found = 2 * math.pi * 0.3 * p * quad(lambda r: r**2, 1, 2)[0]
    assert math.isclose(ref.annulus_torsion_capacity(2.0, 0.3, 1, 2), found, rel_tol=1e-12)


# --- punches --------------------------------------------------------------------------------


def test_punch_pressures_carry_their_load():
    """Plane, round and bonded punch."""
    a, P = 1.7, 3.0
    total = line_integral(lambda x: ref.flat_punch_pressure(x, P, a), a * (1 - 1e-15))
    assert math.isclose(total, P, rel_tol=1e-6)
    total = disc_integral(lambda x: ref.round_punch_pressure(x, P, a), a * (1 - 1e-15))
    assert math.isclose(total, P, rel_tol=1e-6)
    # depth of the middle of the round punch: (1/πE*) ∫ p dA/r
    depth = (
        math.pi
        * line_integral(lambda r: ref.round_punch_pressure(r, P, a), a * (1 - 1e-15))
        / (math.pi * 5.0)
    )
    assert math.isclose(ref.round_punch_load(depth, a, 5.0), P, rel_tol=1e-6)
    assert ref.flat_punch_pressure([-2.0, 2.0], P, a).tolist() == [0, 0]


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_bonded_punch_leaves_the_surface_flat_and_unstrained(nu):
    """Both integral equations of the half plane hold under the bonded punch (E = 1):
    ``u_x' = -b p - k PV∫ q/(x-s)``, ``u_y' = -k PV∫ p/(x-s) + b q`` vanish."""
    punch = ref.bonded_flat_punch(2.0, 1.0, nu)
    b, k = (1 - 2 * nu) * (1 + nu), 2 * (1 - nu**2) / math.pi
    # s = tanh t makes p ds smooth; principal value by symmetry in t about the point
    step = 0.01
    t = np.arange(-18, 18, step) + step / 2
    for m in (0, 30, 100):
        t0 = m * step  # midway between two nodes: the midpoint rule is a principal value there
        s, x = np.tanh(t), math.tanh(t0)
        phase, amplitude = 2 * punch.exponent * t, punch.scale * punch.P / math.pi
        p_ds, q_ds = (amplitude * f(phase) / np.cosh(t) * step for f in (np.cos, np.sin))
        pv_p, pv_q = np.sum(p_ds / (x - s)), np.sum(q_ds / (x - s))
        p, q = float(punch.pressure(x)), float(punch.shear(x))
        scale = b * p + punch.P
        assert abs(b * p + k * pv_q) < 1e-6 * scale
        assert abs(k * pv_p - b * q) < 1e-6 * scale
        if m == 0:
            assert math.isclose(np.sum(p_ds), punch.P, rel_tol=1e-6)
    assert float(punch.shear(0.5)) >= 0


def test_stick_ratio_closes_the_integral_equation_in_the_plane():
    """At the right c the stick traction is bounded at c: the consistency condition
    ``β ∫ p/sqrt(c²-x²) = (2μ/π) ∫∫ s p(s)/((s²-x²) sqrt(c²-x²))`` of the singular equation."""
    for mu, nu in ((0.2, 0.3), (0.5, 0.0)):
        c, beta = ref.stick_ratio_plane(mu, nu), ref.dundurs_beta_rigid(nu)
        # K(c) by the arithmetic-geometric mean
        one, two = 1.0, math.sqrt(1 - c**2)
        while one - two > 1e-15:
            one, two = (one + two) / 2, math.sqrt(one * two)
        left = beta * math.pi / one
        # inner integral over the stick zone, x = c sin u, with the midpoint rule (periodic, exact)
        u = (np.arange(20000) + 0.5) / 20000 * math.pi - math.pi / 2

        def inner(s, u=u, c=c):
            return math.pi * float(np.mean(1 / (s**2 - (c * np.sin(u)) ** 2)))

        # s² = c² + (1-c²) w²... s = sqrt(c² cos²v + sin²v): ds/sqrt(1-s²) = ... dv
        def outer(v, c=c):
            s = math.sqrt((c * math.cos(v)) ** 2 + math.sin(v) ** 2)
            ds = (1 - c**2) * math.sin(v) * math.cos(v) / s
            return 2 * s * inner(s) / (math.sqrt(1 - c**2) * math.cos(v)) * ds

        right = mu / math.pi * quad(outer, 0, math.pi / 2, epsrel=1e-6)[0]
        # the midpoint rule loses digits where s comes near the stick zone
        assert math.isclose(left, right, rel_tol=1e-3)


def test_stick_ratio_closes_the_abel_transform_of_the_round_punch():
    """The transform ``t ∫ q/sqrt(s²-t²) ds`` of the slip traction meets ``β ∫ r p/sqrt(t²-r²) dr``
    of the stick condition at t = c, by quadrature."""
    for mu, nu in ((0.3, 0.0), (0.1, 0.3), (0.3, 0.3)):
        c, beta = ref.stick_ratio_axisymmetric(mu, nu), ref.dundurs_beta_rigid(nu)

        def hold(u, c=c):
            return c * math.sin(u) / math.sqrt(1 - (c * math.sin(u)) ** 2)

        stick = beta * quad(hold, 0, math.pi / 2)[0]

        def slip(v, c=c):
            # s² = c² cos²v + sin²v: ds/(sqrt(1-s²) sqrt(s²-c²)) = dv/s
            return 1 / math.sqrt((c * math.cos(v)) ** 2 + math.sin(v) ** 2)

        assert math.isclose(stick, mu * c * quad(slip, 0, math.pi / 2)[0], rel_tol=1e-8)


def test_stick_ratios_agree_with_the_table_and_reach_both_ends():
    """Printed values; nothing sticks without friction, all for infinite friction or nu = 0.5."""
    table = {(0.0, 0.3): 0.2857, (0.2, 0.3): 0.5201, (0.4, 0.1): 0.2857, (0.4, 0.2): 0.8315}
    for (nu, mu), value in table.items():
        assert math.isclose(ref.stick_ratio_plane(mu, nu), value, abs_tol=6e-5)
    assert math.isclose(ref.stick_ratio_axisymmetric(0.3, 0.0), 0.6268, abs_tol=6e-5)
    # one more equation solver: the nome, k = (θ2/θ3)² with q = exp(-π β/μ)
    nome = math.exp(-math.pi * ref.dundurs_beta_rigid(0.1) / 0.25)
    n = np.arange(30)
    theta2, theta3 = 2 * np.sum(nome ** ((n + 0.5) ** 2)), 2 * np.sum(nome ** (n**2.0)) - 1
    assert math.isclose(ref.stick_ratio_plane(0.25, 0.1), (theta2 / theta3) ** 2, rel_tol=1e-10)
    for ratio in (ref.stick_ratio_plane, ref.stick_ratio_axisymmetric):
        assert ratio(0.0, 0.3) == 0
        assert ratio(1e-3, 0.5) == 1
        assert ratio(1e6, 0.3) == 1
        assert 0 <= ratio(1e-3, 0.3) < 0.01


# --- rings ----------------------------------------------------------------------------------


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("Ri", [0.4, 0.0])
def test_lame_rings_solve_the_boundary_conditions(plane, Ri):
    """Unknown constants of ``u = A r + B/r`` in both rings, by a direct linear solve."""
    Rc, Ro, d, p_in, p_out = 1.1, 2.3, 1e-3, 7.0 if Ri else 0.0, 5.0
    materials = ((2000.0, 0.2), (9000.0, 0.35))

    def lame(E, nu):
        lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
        return (lam if plane == "strain" else 2 * lam * G / (lam + 2 * G)), G

    (l1, G1), (l2, G2) = (lame(*m) for m in materials)

    def stress(lam, G, r):
        return np.array([2 * (lam + G), -2 * G / r**2])

    rows, zero = [], np.zeros(2)
    if Ri:
        rows.append((np.r_[stress(l1, G1, Ri), zero], -p_in))
    else:
        rows.append((np.array([0, 1.0, 0, 0]), 0.0))
    rows.append((np.r_[stress(l1, G1, Rc), -stress(l2, G2, Rc)], 0.0))
    rows.append((np.array([-Rc, -1 / Rc, Rc, 1 / Rc]), d))
    rows.append((np.r_[zero, stress(l2, G2, Ro)], -p_out))
    A1, B1, A2, B2 = np.linalg.solve(*map(np.array, zip(*rows, strict=True)))
    p = -stress(l2, G2, Rc) @ [A2, B2]

    rings = ref.lame_rings(
        Ri, Rc, Ro, *materials, interference=d, p_inner=p_in, p_outer=p_out, plane=plane
    )
    assert math.isclose(rings.pressure, p, rel_tol=1e-10)
    r = np.linspace(max(Ri, 0.1), Rc, 5)
    np.testing.assert_allclose(rings.inner.displacement(r), A1 * r + B1 / r, rtol=0, atol=1e-12)
    r = np.linspace(Rc, Ro, 5)
    np.testing.assert_allclose(rings.outer.displacement(r), A2 * r + B2 / r, rtol=0, atol=1e-12)
    # σ_θ = λ (u' + u/r) + 2G u/r
    hoop = l2 * 2 * A2 + 2 * G2 * (A2 + B2 / r**2)
    np.testing.assert_allclose(rings.outer.hoop_stress(r), hoop, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rings.outer.radial_stress([Rc, Ro]), [-p, -p_out], rtol=0, atol=1e-9)


def test_rings_with_a_clearance_stay_apart():
    """Below closing pressure there is no contact, and the gap is what the rim pressure leaves."""
    rings = ref.lame_rings(0.5, 1.0, 2.0, (1e3, 0.3), (1e3, 0.3), interference=-0.01, p_outer=1.0)
    assert rings.pressure == 0
    assert 0 < rings.gap < 0.01
    closed = 0.01 + float(rings.outer.displacement(1.0)) - float(rings.inner.displacement(1.0))
    assert math.isclose(rings.gap, closed, rel_tol=1e-12)
    rigid = ref.lame_rings(0.0, 1.0, 2.0, (math.inf, 0.3), (1e3, 0.3), interference=0.01)
    assert math.isclose(float(rigid.outer.displacement(1.0)), 0.01, rel_tol=1e-12)
    solid = ref.lame_rings(0.0, 1.0, 2.0, (1e3, 0.3), (1e3, 0.3), interference=0.01)
    assert float(solid.inner.displacement(0.0)) == 0
    assert math.isclose(float(solid.inner.radial_stress(0.0)), -solid.pressure)


def test_interference_fit_numbers():
    """Rim displacements of the fit and its torque."""
    steel = (200e3, 0.3)
    fit = ref.lame_rings(1.0, 2.0, 3.0, steel, steel, interference=2e-3)
    assert math.isclose(float(fit.inner.displacement(1.0)), -6.25e-4, rel_tol=1e-9)
    assert math.isclose(float(fit.outer.displacement(3.0)), 1.125e-3, rel_tol=1e-9)
    T = ref.torque_capacity(0.15, fit.pressure, 2.0)
    # work of the shear stress: dθ = T/(2π G r³) dr, two materials
    twist = (
        T
        / (2 * math.pi)
        * (quad(lambda r: r**-3 / 70.0, 1, 2)[0] + quad(lambda r: r**-3 / 90.0, 2, 3)[0])
    )
    assert math.isclose(ref.ring_twist(T, 1.0, 2.0, 3.0, 70.0, 90.0), twist, rel_tol=1e-10)


def test_persson_pressure_balances_the_load_and_vanishes_at_the_edge():
    """Resultant along the load is Q for every arc."""
    for b in (0.05, 0.4, 0.9, 1.5):
        eps = 2 * math.atan(b)
        vertical = quad(
            lambda t, e=eps: float(ref.persson_pressure(e * math.sin(t), e, 3.0, 2.0))
            * 2.0 * math.cos(e * math.sin(t)) * e * math.cos(t),
            -math.pi / 2, math.pi / 2,
        )[0]  # fmt: skip
        assert math.isclose(vertical, 3.0, rel_tol=1e-8)
        assert float(ref.persson_pressure(eps, eps, 3.0, 2.0)) == 0
        assert math.isclose(ref.persson_half_angle(ref.persson_load_number(eps)), eps, rel_tol=1e-10)


@pytest.mark.parametrize("b", [0.3, 0.6, None])
def test_persson_pin_solves_the_contact_of_disc_and_hole(b):
    """Michell's series of the disc and of the hole, closed on the contact arc: under Persson's
    pressure the gap is constant but for a rigid translation, and opens outside."""
    eps = 2 * math.atan(b) if b else ref.persson_half_angle(0.0)
    nu, E, Q, R, N = 0.3, 1.0, 1.0, 1.0, 4096
    E1, G, kappa = E / (1 - nu**2), E / (2 * (1 + nu)), 3 - 4 * nu
    theta = np.arange(N) * 2 * np.pi / N
    theta = np.where(theta > np.pi, theta - 2 * np.pi, theta)
    p = np.where(np.abs(theta) < eps, ref.persson_pressure(theta, eps, Q, R), 0.0)
    coefficients = np.fft.rfft(p) / N
    n = np.arange(len(coefficients), dtype=float)
    n[:2] = 2  # the first two are put in by hand
    disc = -(n * (n + 1) / (n - 1) + kappa - n - 1) / (2 * (n + 1)) / (2 * G)
    hole = (kappa + n - 1 - n * (n - 1) / (n + 1)) / (2 * (n - 1)) / (2 * G)
    compliance = hole - disc
    compliance[0] = 1 / (2 * G) + (kappa - 1) / (4 * G)
    compliance[1] = 0.0  # a translation
    opening = np.fft.irfft(compliance * coefficients * N, N)
    gap = opening + ref.persson_load_number(eps) * Q / E1
    inside = np.abs(theta) < 0.95 * eps
    basis = np.cos(theta)
    shift = np.sum(gap[inside] * basis[inside]) / np.sum(basis[inside] ** 2)
    rest = gap - shift * basis
    # 4096 points on a pressure with square-root ends: error (2π/N)^1.5 times a few
    assert np.max(np.abs(rest[inside])) < 1e-3 * Q / E1
    assert np.all(rest[np.abs(theta) > 1.05 * eps] > 0)


def test_perfect_fit_angle():
    """The angle independent of load."""
    assert math.isclose(math.degrees(ref.persson_half_angle(0.0)), 84.8279, abs_tol=5e-5)
    with pytest.raises(InputError, match="touch all around"):
        ref.persson_half_angle(-0.7)


# --- friction problems ----------------------------------------------------------------------


def test_uniform_shear_follows_a_loading_path():
    """Slip, reverse stick, reverse slip, lift-off and renewed contact of one block."""
    H, E, mu, d = 1.0, 1.0, 0.3, 1e-2
    G, p = E / 2, 1e-2
    block = [(H, E)]
    slid = ref.uniform_shear(d, 0.01, block, mu)
    assert slid.status == "slip"
    assert math.isclose(slid.tau, mu * p)
    s = slid.plastic_slip
    assert math.isclose(s, 0.01 - mu * p * H / G)
    # reverse slip sets in after the motion 2 mu p H/G
    start = 0.01 - 2 * mu * p * H / G
    stuck = ref.uniform_shear(d, start + 1e-9, block, mu, plastic_slip=s)
    reverse = ref.uniform_shear(d, start - 1e-9, block, mu, plastic_slip=s)
    assert (stuck.status, reverse.status) == ("stick", "slip")
    assert math.isclose(reverse.tau, -mu * p)
    # at U = 0: tau = -min(s G/H, mu p)
    home = ref.uniform_shear(d, 0.0, block, mu, plastic_slip=s)
    assert math.isclose(home.tau, -min(s * G / H, mu * p))
    lifted = ref.uniform_shear(-d, 1.0, block, mu, plastic_slip=s)
    assert (lifted.status, lifted.tau, lifted.p) == ("open", 0, 0)
    again = ref.uniform_shear(d, 1.0, block, mu, plastic_slip=lifted.plastic_slip)
    assert (again.status, again.tau) == ("stick", 0)


def test_uniform_shear_with_tangential_stiffness():
    """Springs in series."""
    expected = (7.999999e-11, 7.987220e-7, 4.705882e-4, 4.999969e-4, 5.0e-4)
    for kappa, tau in zip((1e-8, 1e-4, 1, 1e4, 1e12), expected, strict=True):
        state = ref.uniform_shear(1e-2, 1e-3, [(1.0, 1.0)], 0.3, k_t=kappa * 8)
        assert math.isclose(state.tau, tau, rel_tol=2e-7)
        assert math.isclose(state.slip, state.tau / (8 * kappa), rel_tol=1e-6, abs_tol=1e-15)
        assert state.plastic_slip == 0


def test_friction_cone_turn_integrates_the_flow_rule():
    """The discrete law tends to the continuous one, first order in the step."""
    exact = ref.friction_cone_turn(1.2, 0.8)
    errors = [ref.friction_cone_turn(1.2, 0.8, n) - exact for n in (100, 200, 400)]
    np.testing.assert_allclose(np.divide(errors[:2], errors[1:]), 2, rtol=0.02)
    # dθ = -sin θ d(travel)
    slope = (ref.friction_cone_turn(1.2, 0.8 + 1e-6) - exact) / 1e-6
    assert math.isclose(slope, -math.sin(exact), rel_tol=1e-5)
    assert math.isclose(
        math.degrees(ref.friction_cone_turn(math.pi / 2, 1.0, 100)), 40.47505, abs_tol=6e-6
    )


def test_rigid_body_forces_are_in_equilibrium():
    """Wedge, incline and taper, by solving two equations of statics for (N, F)."""
    mu, slope = 0.27, 0.18
    angle = math.atan(slope)
    c, s = math.cos(angle), math.sin(angle)
    for uphill, sign in ((True, 1), (False, -1)):
        # along x and y: normal (-s, c), friction against the motion
        normal, friction = np.array([-s, c]), -sign * mu * np.array([c, s])
        columns = np.column_stack([normal + friction, [sign * 1.0, 0.0]])
        N, F = np.linalg.solve(columns, [0.0, 1.0])
        assert N > 0
        assert math.isclose(ref.sliding_wedge_force(mu, slope, uphill=uphill), F, rel_tol=1e-12)
    block = ref.inclined_block(100.0, 0.4, 0.3)
    held = ref.inclined_block(100.0, 0.4, 0.3, block.least_force)
    assert math.isclose(held.T, 0.3 * held.N, rel_tol=1e-12)
    assert math.isclose(math.hypot(held.N, held.T), math.hypot(100.0, block.least_force))
    assert ref.inclined_block(1.0, 1.001 * math.atan(0.3), 0.3).slides
    assert not ref.inclined_block(1.0, 0.999 * math.atan(0.3), 0.3).slides
    # tips when the resultant leaves the base
    for width in (0.99, 1.01):
        leaves = block.pressure_offset(2.0) > width * math.tan(0.4)
        assert block.tips(2 * width * math.tan(0.4), 2.0) == leaves
    assert ref.taper_force(math.atan(0.3), 0.3, pull_out=True) == pytest.approx(0, abs=1e-15)
    x = ref.corner_pressures(1e-3, 2e-3, 5.0, 0.25)
    # Hooke's law the other way: strain from stresses, plane strain
    strain = np.array([[1 - 0.0625, -0.25 * 1.25], [-0.25 * 1.25, 1 - 0.0625]]) / 5.0 @ x
    np.testing.assert_allclose(strain, [1e-3, 2e-3], rtol=1e-12)


@pytest.mark.parametrize("thickness", [0.0, 0.02, 0.05, 1.0])
def test_capstan_rate_satisfies_the_equilibrium_of_the_curved_beam(thickness):
    """With T = exp(λφ) all three equations of equilibrium hold (drum radius 1)."""
    mu, R, Rm = 0.3, 1.0, 1.0 + thickness / 2
    rate = math.log(ref.capstan_ratio(mu, 1.0, thickness))
    p = rate * Rm / (mu * R**2)  # moments about the drum axis: T' Rm = mu p R²
    V = mu * p * R - rate  # along the belt: T' + V = mu p R
    assert math.isclose(p * R, 1 - rate * V, rel_tol=1e-12)  # along the radius: p R = T - V'
    # the moment in the belt stays: M' = 0 = V Rm - mu p R t/2
    assert math.isclose(V * Rm, mu * p * R * thickness / 2, rel_tol=1e-9, abs_tol=1e-15)


def test_capstan_numbers_for_half_a_turn():
    """Printed values."""
    found = [ref.capstan_ratio(0.3, math.pi, t) for t in (0, 0.05, 0.02, 0.01)]
    np.testing.assert_allclose(found, [2.56633, 2.50310, 2.54041, 2.55326], rtol=0, atol=6e-6)


# --- slip damping ---------------------------------------------------------------------------


def test_layered_cantilever_is_two_beams_with_friction_on_their_faces():
    """Slip: each beam integrates w'' = M/EI with the end shear and the couple tau h/2; the loop is
    Masing's; onset where the shear stress of the solid beam reaches tau."""
    L, h, E, tau = 20.0, 1.0, 1e5, 0.3
    beams = ref.layered_cantilever(L, h, E, 0.3, 1.0)
    F = 1.1
    # tip deflection ∫ M x dx/EI, x from the tip
    EI = E * h**3 / 12
    moment = lambda x: (F / 2) * x - tau * h / 2 * x  # noqa: E731
    assert math.isclose(beams.tip(F), quad(lambda x: moment(x) * x / EI, 0, L)[0], rel_tol=1e-10)
    assert math.isclose(1.5 * beams.slip_force / (2 * h), tau)
    loop = masing(beams.tip, F)
    assert math.isclose(beams.dissipation(F), loop, rel_tol=1e-6)
    assert beams.dissipation(beams.slip_force) == 0
    assert math.isclose(beams.tip(-F), -beams.tip(F))
    just = beams.slip_force * (1 + 1e-12)
    assert math.isclose(beams.tip(just), just / beams.stiffness, rel_tol=1e-10)
    assert math.isclose(ref.layered_cantilever(L, h, E, 0.3, 1.0, 0.1).tau, 0.1)


def test_bar_between_planes_is_an_integral_of_strain():
    """Strain falls linearly from F/(E h) over the slip length; the loop is Masing's."""
    bar = ref.bar_between_planes(0.5, 100.0, 0.4, 2.0)
    F = 3.0
    length = bar.slip_length(F)
    stretch = quad(lambda x: (F - bar.tau * x) / (100.0 * 0.5), 0, length)[0]
    assert math.isclose(bar.pull(F), stretch, rel_tol=1e-12)
    assert math.isclose(bar.pull(0.0, turned_at=F), stretch / 2, rel_tol=1e-12)
    assert math.isclose(bar.pull(-F, turned_at=F), -stretch, rel_tol=1e-12)
    assert math.isclose(bar.dissipation(F), masing(bar.pull, F), rel_tol=1e-9)


# --- manufactured solution ------------------------------------------------------------------

MMS = ref.ManufacturedSlip(E=2.5, nu=0.28, mu=0.35, x0=0.37, c=0.05, p0=0.02)


def complex_step(function, x, axis, h=1e-30):
    """Derivative along `axis` to round-off."""
    z = x.astype(complex)
    z[axis] += 1j * h
    return np.imag(function(z)) / h


def test_manufactured_stress_and_body_force_by_the_complex_step():
    """Hooke's law and equilibrium hold at random points, stick and slip side alike."""
    x = np.random.default_rng(3).random((2, 200))
    grad = np.stack([complex_step(MMS.displacement, x, j) for j in range(2)], axis=1)
    strain = (grad + grad.swapaxes(0, 1)) / 2
    E, nu = MMS.E, MMS.nu
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    trace = strain[0, 0] + strain[1, 1]
    stress = 2 * G * strain + lam * trace * np.eye(2)[:, :, None]
    np.testing.assert_allclose(MMS.stress(x), stress, rtol=0, atol=1e-14)
    divergence = sum(complex_step(lambda z, j=j: MMS.stress(z)[:, j], x, j) for j in range(2))
    np.testing.assert_allclose(MMS.body_force(x), -divergence, rtol=0, atol=1e-13)


def test_manufactured_surface_obeys_signorini_and_coulomb():
    """On y = 0: closed, pressure p > 0, |t| <= mu p, slip only at the limit and against t."""
    x = np.array([np.linspace(0, 1, 301), np.zeros(301)])
    stress, u = MMS.stress(x), MMS.displacement(x)
    np.testing.assert_array_equal(u[1], 0)
    np.testing.assert_allclose(-stress[1, 1], MMS.pressure(x), rtol=0, atol=1e-15)
    np.testing.assert_allclose(stress[0, 1], MMS.traction(x), rtol=0, atol=1e-15)
    assert np.all(MMS.pressure(x) > 0)
    limit = MMS.mu * MMS.pressure(x)
    slipping = x[0] > MMS.x0
    assert np.all(MMS.traction(x)[~slipping] <= limit[~slipping] * (1 + 1e-14))
    assert np.all(MMS.traction(x) > 0)
    np.testing.assert_allclose(MMS.traction(x)[slipping], limit[slipping], rtol=1e-14)
    assert np.all(u[0][slipping] > 0)
    np.testing.assert_array_equal(u[0][~slipping], 0)
    np.testing.assert_array_equal(u[0], MMS.slip(x))


def test_manufactured_resultants_by_quadrature():
    """Normal and friction force, and the energy lost under proportional load."""

    def integral(function):
        parts = ((0, MMS.x0), (MMS.x0, 1))
        return sum(quad(lambda x: float(function(np.array([x, 0.0]))), *part)[0] for part in parts)

    assert math.isclose(MMS.normal_force, integral(MMS.pressure), rel_tol=1e-12)
    assert math.isclose(MMS.friction_force, integral(MMS.traction), rel_tol=1e-12)
    lost = integral(lambda x: MMS.traction(x) * MMS.slip(x)) / 2
    assert math.isclose(MMS.dissipation, lost, rel_tol=1e-12)


# --- one element ----------------------------------------------------------------------------


def test_triangle_stiffness_is_that_of_scikit_fem():
    """The block of the contact node in the assembled matrix of one element."""
    import skfem
    from quick_elasticity import linear_elasticity
    from skfem.models.elasticity import lame_parameters

    mesh = skfem.MeshTri(np.array(ref.ONE_NODE_TRIANGLE).T.copy(), np.array([[0], [1], [2]]))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1()))
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis).toarray()
    dofs = basis.nodal_dofs[:, 0]
    np.testing.assert_allclose(
        ref.triangle_stiffness(ref.ONE_NODE_TRIANGLE, 1.0, 0.3), K[np.ix_(dofs, dofs)], rtol=1e-12
    )


@pytest.mark.parametrize(
    ("f", "mu", "expected"),
    [
        ((-1.75, -1.0), 2.0, ["open", "stick", "slip"]),
        ((-1.75, -1.0), 1.0, ["open"]),
        ((-0.9, -1.0), 1.0, ["stick"]),
        ((-1.45, -1.0), 1.4, ["slip"]),
        ((-1.999, -1.0), 2.0, ["open", "stick", "slip"]),
        ((-2.001, -1.0), 2.0, ["open"]),
    ],
)
def test_one_node_has_the_listed_equilibria(f, mu, expected):
    """Every branch found satisfies equilibrium and both laws."""
    K = ref.triangle_stiffness(ref.ONE_NODE_TRIANGLE, 1.0, 0.3)
    answers = ref.one_node_equilibria(K, f, mu)
    assert [answer.status for answer in answers] == expected
    for answer in answers:
        u, r = answer.u, answer.reaction
        np.testing.assert_allclose(K @ u, np.add(f, r), rtol=0, atol=1e-14)
        assert u[1] >= 0
        assert r[1] >= 0
        assert u[1] * r[1] == 0
        assert abs(r[0]) <= mu * r[1] * (1 + 1e-14)
        assert u[1] > 0 or u[0] * r[0] <= 0
        if answer.status == "slip":
            assert math.isclose(abs(r[0]), mu * r[1])


def test_slip_branch_numbers():
    """Printed displacements and reactions."""
    K = ref.triangle_stiffness(ref.ONE_NODE_TRIANGLE, 1.0, 0.3)
    slip = ref.one_node_equilibria(K, (-1.75, -1.0), 2.0)[2]
    np.testing.assert_allclose(slip.u, [-1.24249012, 0], rtol=0, atol=6e-9)
    np.testing.assert_allclose(slip.reaction, [1.00662984, 0.50331492], rtol=0, atol=6e-9)
    slip = ref.one_node_equilibria(K, (-1.45, -1.0), 1.4)[0]
    np.testing.assert_allclose(slip.u, [-1.29396273, 0], rtol=0, atol=6e-9)


def test_below_critical_friction_the_answer_is_one():
    """Random triangles, random loads: one equilibrium; no triangle is worse than stated."""
    rng = np.random.default_rng(11)
    worst = math.inf
    for _ in range(400):
        points = rng.standard_normal((3, 2))
        K = ref.triangle_stiffness(points, 1.0, 0.3)
        critical = ref.critical_friction(K)
        worst = min(worst, critical)
        answers = ref.one_node_equilibria(K, rng.standard_normal(2), 0.999 * critical)
        assert len(answers) == 1
    assert ref.worst_triangle_friction(0.3) <= worst < 1.01 * ref.worst_triangle_friction(0.3)
    K = ref.triangle_stiffness(ref.ONE_NODE_TRIANGLE, 1.0, 0.3)
    assert math.isclose(ref.critical_friction(K), ref.worst_triangle_friction(0.3), rel_tol=1e-9)


def test_raous_data_are_consistent():
    """The stored solution lies within the tolerance of the published one, and ordered outwards."""
    raous = ref.RAOUS
    np.testing.assert_allclose(raous.converged, raous.published, rtol=0.05)
    np.testing.assert_allclose(raous.code_aster, raous.converged, rtol=0.007)
    assert list(raous.converged) == sorted(raous.converged, reverse=True)
    assert raous.friction_force < raous.mu * raous.normal_force
    assert raous.friction_force < raous.lateral_pressure * raous.side


# --- messages -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: ref.hertz_line(-1.0, 1.0, 1.0), "P = -1.0 must be zero or positive"),
        (lambda: ref.hertz_line(1.0, 0.0, 1.0), "R = 0.0 must be positive"),
        (lambda: ref.effective_modulus(1.0, 0.6), "nu = 0.6 must lie in"),
        (lambda: ref.block_coefficient("glued"), "base = 'glued' is not known"),
        (lambda: ref.block_coefficient("fixed", 0.3, 0.5), "below 1"),
        (lambda: ref.block_coefficient("fixed", 0.45, 2.0), "tabulated for nu from 0 to 0.3"),
        (lambda: ref.cattaneo_mindlin(LINE, 0.1, 101.0), "more than mu"),
        (lambda: ref.cattaneo_mindlin(LINE, 0.1, 60.0, after=(50.0,)), "not nested"),
        (lambda: ref.cattaneo_mindlin(LINE, 0.1, -60.0, after=(50.0,)), "not nested"),
        (lambda: ref.fretting_dissipation_line(LINE, 0.1, 101.0), "more than mu"),
        (lambda: ref.annulus_torsion_capacity(1.0, 1.0, 2.0, 1.0), "must lie between"),
        (lambda: ref.lame_rings(1, 3, 2, (1, 0), (1, 0)), "must satisfy"),
        (lambda: ref.lame_rings(1, 2, 3, (1, 0), (1, 0), plane="free"), "plane = 'free'"),
        (lambda: ref.lame_rings(1, 2, 3, (math.inf, 0), (math.inf, 0)), "Both rings are rigid"),
        (lambda: ref.persson_load_number(4.0), "between 0 and pi"),
        (lambda: ref.friction_cone_turn(4.0, 1.0), "start = 4.0"),
        (lambda: ref.friction_cone_turn(1.0, 1.0, 0), "at least 1"),
        (lambda: ref.sliding_wedge_force(2.0, 0.5), "locks"),
        (lambda: ref.tangential_shift_line(LINE, 0.5, 501.0, 1e3), r"501.0 is more than mu\*P = 500"),
        (lambda: ref.bar_between_planes(1, 1, 1, 1).pull(2.0, turned_at=1.0), "outside"),
        (lambda: ref.triangle_stiffness([(0, 0), (1, 1), (2, 2)], 1.0, 0.3), "on one line"),
    ],
)
def test_impossible_input_is_named(call, match):
    """The message holds the name and the number of the argument."""
    with pytest.raises(InputError, match=match):
        call()
