"""Uniform and rigid-body problems of friction, exact on every mesh."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skfem_contact.arguments import not_negative, positive
from skfem_contact.errors import InputError


@dataclass(frozen=True, eq=False)
class UniformShear:
    """State of stacked blocks under uniform compression and shear.

    Attributes
    ----------
    p : float
        Contact pressure [stress].
    tau : float
        Shear traction in the direction of the prescribed motion [stress].
    slip : float
        Relative tangential displacement of the surfaces, ``tau/k_t`` included [length].
    plastic_slip : float
        The part of the slip that stays, ``slip - tau/k_t``: history for the next state [length].
    status : str
        "open", "stick" or "slip".

    Examples
    --------
    >>> state = uniform_shear(1e-3, 3e-3, [(1.0, 1.0)], mu=0.5)
    >>> print(f"{state.status} {state.tau / state.p:.2f}")
    slip 0.50
    """

    p: float
    tau: float
    slip: float
    plastic_slip: float
    status: str


def uniform_shear(
    d: float,
    U: float,
    layers: Sequence[tuple[float, float]],
    mu: float,
    *,
    tau_max: float = math.inf,
    k_t: float = math.inf,
    plastic_slip: float = 0.0,
) -> UniformShear:
    r"""Blocks with nu = 0 on one another, pressed by `d` and sheared by `U` with friction between.

    ``p = d/Σ(H/E)``, ``tau = min(U/(Σ H/G + 1/k_t), μ p, tau_max)``, ``slip = U - tau Σ H/G`` with
    ``G = E/2``.

    Parameters
    ----------
    d, U : float
        Prescribed compression (negative: lifted off) and shearing motion [length].
    layers : sequence of (H, E)
        Height and modulus of each block; one block on a rigid base, or two.
    mu : float
        Coefficient of friction.
    tau_max : float
        Cap of the traction [stress].
    k_t : float
        Tangential stiffness per area [stress/length]; infinite is exact stick.
    plastic_slip : float
        That of the state before, for loading paths [length].

    Examples
    --------
    >>> blocks = [(1.0, 1.0), (1.0, 0.7)]
    >>> state = uniform_shear(1e-3, 3e-3, blocks, mu=0.5)
    >>> print(f"{state.p:.10e} {state.tau:.10e} {state.slip:.6f} {state.status}")
    4.1176470588e-04 2.0588235294e-04 0.002000 slip
    >>> capped = uniform_shear(1e-3, 3e-3, blocks, mu=0.5, tau_max=1e-4)
    >>> print(f"{capped.slip:.14f}")
    0.00251428571429

    Back to zero, it sticks the other way:

    >>> back = uniform_shear(1e-3, 2.5e-3, blocks, mu=0.5, plastic_slip=state.plastic_slip)
    >>> print(f"{back.tau:.6e} {back.status}")
    1.029412e-04 stick
    """
    not_negative(mu=mu, tau_max=tau_max)
    positive(k_t=k_t)
    for H, E in layers:
        positive(H=H, E=E)
    shear_compliance = sum(2 * H / E for H, E in layers)
    if d < 0:
        return UniformShear(0.0, 0.0, U, U, "open")
    p = d / sum(H / E for H, E in layers)
    trial = (U - plastic_slip) / (shear_compliance + 1 / k_t)
    bound = min(mu * p, tau_max)
    if abs(trial) <= bound:
        return UniformShear(p, trial, U - trial * shear_compliance, plastic_slip, "stick")
    tau = math.copysign(bound, trial)
    slip = U - tau * shear_compliance
    return UniformShear(p, tau, slip, slip - tau / k_t, "slip")


def friction_cone_turn(start: float, travel: float, steps: int | None = None) -> float:
    r"""Angle between traction and motion after a sliding block has been turned [rad].

    A block slides with its traction at the angle `start` to the new direction of motion, along
    which it is then driven. Continuous: ``tan(θ/2) = tan(θ0/2) exp(-travel)``; with backward Euler
    the traction is projected to the circle after each step.

    Parameters
    ----------
    start : float
        Angle at first, in ``[0, π)`` [rad].
    travel : float
        Motion ``G dU/(H μ p)``, dimensionless.
    steps : int, optional
        Equal steps of backward Euler; None for the continuous law.

    Examples
    --------
    >>> import math
    >>> continuous = math.degrees(friction_cone_turn(math.pi / 2, 1.0))
    >>> discrete = [math.degrees(friction_cone_turn(math.pi / 2, 1.0, n)) for n in (1, 2, 5, 10)]
    >>> print(f"{continuous:.5f}", [round(angle, 5) for angle in discrete])
    40.39506 [45.0, 43.3582, 41.80918, 41.14853]
    """
    if not 0 <= start < math.pi:
        raise InputError(f"start = {start} must lie in [0, pi) (radians).")
    not_negative(travel=travel)
    if steps is None:
        return 2 * math.atan(math.tan(start / 2) * math.exp(-travel))
    if steps < 1:
        raise InputError(f"steps = {steps} must be at least 1.")
    along, across = math.cos(start), math.sin(start)
    for _ in range(steps):
        along += travel / steps
        length = math.hypot(along, across)
        along, across = along / length, across / length
    return math.atan2(across, along)


def sliding_wedge_force(mu: float, slope: float, *, uphill: bool = True) -> float:
    """Horizontal force over weight that slides a wedge along a slope (NAFEMS CGS-4).

    ``(t + μ)/(1 - μ t)`` up, ``(μ - t)/(1 + μ t)`` down the slope; ``t = tan`` of its angle.

    Examples
    --------
    >>> print([round(sliding_wedge_force(mu, 0.1), 6) for mu in (0.0, 0.1, 0.2, 0.3)])
    [0.1, 0.20202, 0.306122, 0.412371]
    >>> round(sliding_wedge_force(0.3, 0.1, uphill=False), 6)
    0.194175
    """
    not_negative(mu=mu)
    if not uphill:
        return (mu - slope) / (1 + mu * slope)
    if mu * slope >= 1:
        raise InputError(f"mu * slope = {mu * slope} >= 1: the wedge locks under any force.")
    return (slope + mu) / (1 - mu * slope)


@dataclass(frozen=True, eq=False)
class InclinedBlock:
    """Block on a rough incline, held by a horizontal force into the slope.

    Attributes
    ----------
    W, angle, mu, force : float
        Weight [force], angle [rad], coefficient of friction, horizontal force.
    N, T : float
        Normal force, and friction force up the slope that equilibrium asks for [force].

    Examples
    --------
    >>> import math
    >>> block = inclined_block(100.0, math.radians(20), mu=0.3)
    >>> print(block.slides, f"{block.pressure_offset(10.0):.4f}", block.tips(width=40.0, height=10.0))
    True 1.8199 False
    """

    W: float
    angle: float
    mu: float
    force: float
    N: float
    T: float

    @property
    def slides(self) -> bool:
        """No equilibrium exists, ``|T| > μ N``."""
        return abs(self.T) > self.mu * self.N

    @property
    def least_force(self) -> float:
        """Horizontal force ``W tan(angle - atan μ)`` below which the block slides down."""
        return self.W * math.tan(self.angle - math.atan(self.mu))

    def tips(self, width: float, height: float) -> bool:
        """The weight alone tips the block over its lower edge, ``tan > width/height``."""
        return math.tan(self.angle) > width / height

    def pressure_offset(self, height: float) -> float:
        """Distance of the resultant pressure downhill of the middle, by the weight alone."""
        return height / 2 * math.tan(self.angle)


def inclined_block(W: float, angle: float, mu: float, force: float = 0.0) -> InclinedBlock:
    """Forces on a block of weight `W` on an incline (Beer & Johnston 8.2; ANSYS VM29).

    ``N = W cos + F sin``, ``T = W sin - F cos``.

    Examples
    --------
    >>> import math
    >>> block = inclined_block(100.0, math.radians(20), mu=0.3)
    >>> print(f"{block.least_force:.5f} {block.slides}")
    5.76729 True
    >>> held = inclined_block(100.0, math.radians(20), mu=0.3, force=5.7674)
    >>> print(f"{held.N:.3f} {held.T:.3f} {held.slides}")
    95.942 28.782 False
    """
    positive(W=W)
    not_negative(mu=mu)
    c, s = math.cos(angle), math.sin(angle)
    return InclinedBlock(W, angle, mu, force, W * c + force * s, W * s - force * c)


def corner_pressures(dx: float, dy: float, E: float, nu: float) -> tuple[float, float]:
    """Pressures on two smooth rigid walls of a right-angled corner, plane strain [stress].

    A block is squeezed by the strains `dx` and `dy` into the corner:
    ``p_x = (λ+2G) dx + λ dy``, ``p_y = (λ+2G) dy + λ dx``.

    Examples
    --------
    >>> print("{:.4e} {:.8e}".format(*corner_pressures(1e-3, 2e-3, 1.0, 0.3)))
    2.5000e-03 3.26923077e-03
    """
    positive(E=E)
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    return (lam + 2 * G) * dx + lam * dy, (lam + 2 * G) * dy + lam * dx


def stacked_blocks_normal_forces(weights: Sequence[float]) -> list[float]:
    """Normal force under each block of a stack, the top one first [force].

    Block ``m`` (from the top, equal weights w) pulled out slips at ``μ ((m-1) + m) w``.

    Examples
    --------
    >>> stacked_blocks_normal_forces([1.0, 1.0, 2.0])
    [1.0, 2.0, 4.0]
    """
    total, forces = 0.0, []
    for weight in weights:
        total += weight
        forces.append(total)
    return forces


def taper_force(angle: float, mu: float, *, pull_out: bool = False) -> float:
    """Axial force over the normal force N on one flank of a sliding wedge or taper.

    Push-in ``2 (sin + μ cos)``, pull-out ``2 (μ cos - sin)``; a negative pull-out force means
    the wedge is not self-locking (``tan(angle) > μ``).

    Parameters
    ----------
    angle : float
        Half angle of the wedge [rad].

    Examples
    --------
    >>> import math
    >>> a = math.radians(5)
    >>> print(f"{taper_force(a, 0.15):.6f} {taper_force(a, 0.15, pull_out=True):.6f}")
    0.473170 0.124547
    """
    not_negative(mu=mu)
    s, friction = math.sin(angle), mu * math.cos(angle)
    return 2 * (friction - s) if pull_out else 2 * (friction + s)


def capstan_ratio(mu: float, wrap: float, thickness: float = 0.0) -> float:
    r"""Ratio of the tensions of a belt slipping on a rigid drum.

    Thin belt ``exp(μ wrap)`` (Euler). A belt of finite thickness carries a shear force, because
    friction acts on its face and tension in its middle: ``exp(λ wrap)`` with the positive root of
    ``(μ t/2R) λ² + (1 + t/2R) λ - μ = 0``. (Moments about the drum axis:
    ``T' (R + t/2) = μ p R²``; forces along the radius: ``p R = T - V'``, ``V = μ p R - T'``.)

    Parameters
    ----------
    mu, wrap : float
        Coefficient of friction, angle of wrap [rad].
    thickness : float
        Thickness of the belt over the radius of the drum, t/R.

    Examples
    --------
    >>> import math
    >>> print([round(capstan_ratio(0.3, math.pi / 2, t), 5) for t in (0, 0.05, 0.02, 0.01)])
    [1.60198, 1.58212, 1.59387, 1.59789]
    """
    not_negative(mu=mu, thickness=thickness)
    half = thickness / 2
    # the root written so that the thin belt is its plain limit, not 0/0
    rate = 2 * mu / (1 + half + math.sqrt((1 + half) ** 2 + 4 * mu**2 * half))
    return math.exp(rate * wrap)
