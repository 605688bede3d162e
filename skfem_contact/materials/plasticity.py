r"""`J2`: metals that yield, with isotropic and linear kinematic hardening.

Von Mises' yield function of the deviatoric stress s, the back stress ``beta = 2/3 C eps_p`` and the
equivalent plastic strain p, with the flow along its normal (Prandtl and Reuss):

    ``q = sqrt(3/2) |s - beta|``,    ``q <= Y(p)``,    ``d eps_p = 3/2 dp (s - beta) / q``.

Over a step the flow has the direction of its end (backward Euler, radial return), so that p is the
root of ``q_trial = (3 mu + C) (p - p_n) + Y(p)``. See Simo and Hughes, Computational Inelasticity
(1998), boxes 3.1 and 3.2. At large strains it is the same law of logarithmic strains.
"""

from __future__ import annotations

from dataclasses import field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem.helpers import ddot

from skfem_contact.arguments import check_switch, numbers, with_known_keywords
from skfem_contact.arrays import Array
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError, MaterialError
from skfem_contact.materials.elastic import Isotropic
from skfem_contact.materials.material import (
    Split,
    State,
    deviator,
    isotropic,
    logarithmic,
    small,
    take_numbers,
    undeformed_axes,
)
from skfem_contact.records import dataclass

USAGE = "give a number, rows of stress and plastic strain, or a function"


@with_known_keywords(
    hardening="write kinematic, or a table as yield_stress", sigma_y="write yield_stress"
)
@dataclass(frozen=True, eq=False)
class J2(Split, Isotropic):
    """Von Mises plasticity with isotropic and linear kinematic hardening.

    Plane strain, axisymmetric, solid. On elements of first order the change of volume is the mean of
    the element, see `NonlinearBody`: plastic flow keeps the volume, and they would lock.

    Parameters
    ----------
    E, nu : float
        Young's modulus [stress] and Poisson's ratio.
    yield_stress : float, or array_like, shape (k, 2), or callable
        True stress in uniaxial tension: one number without isotropic hardening; a table with rows of
        stress and equivalent plastic strain, from plastic strain 0 on, as under Abaqus' ``*PLASTIC``:
        straight between the rows, constant after the last; or a function of an array of plastic strains
        that returns stress and slope, ``lambda p: (250 + 900 * p, 900 + 0 * p)``.
    kinematic : float, optional
        Slope C of the back stress over plastic strain in uniaxial tension [stress].
    finite_strain : bool, optional
        Whether strains and turns may be of any size: the law is then one of logarithmic strains, and
        yield stresses are those of Kirchhoff's stress, which is Cauchy's where volume is kept. Without
        it strains are small, up to some 5 %.

    Raises
    ------
    InputError
        No moduli; a table that does not begin at plastic strain 0 or whose strains do not increase, or
        that falls faster than 3 mu + C, where equilibrium at a point is not unique.

    Notes
    -----
    Internal variables: ``plastic_strain`` (3, 3, e, q) and ``equivalent_plastic_strain`` (e, q). At
    large strains the first is logarithmic, in the axes of the undeformed body (Miehe, Apel and
    Lambrecht 2002).

    Examples
    --------
    >>> import skfem_contact as sc
    >>> steel = sc.J2(210e3, 0.3, [(250, 0), (300, 0.01), (350, 0.05)])
    >>> steel.yields(np.array([0.0, 0.005, 1.0]))[0].tolist()
    [250.0, 275.0, 350.0]
    >>> shear = np.zeros((3, 3, 1, 1))
    >>> shear[0, 1] = 0.005
    >>> stress, _, state = steel(shear, steel.initial_state(1, 1))
    >>> stress[0, 1].round(1).tolist(), state["equivalent_plastic_strain"].round(5).tolist()
    ([[149.6]], [[0.00182]])
    """

    yield_stress: Any
    kinematic: float = field(default=0.0, kw_only=True)
    finite_strain: bool = field(default=False, kw_only=True)

    mean_dilatation = True
    initial = MappingProxyType({"plastic_strain": np.zeros((3, 3)), "equivalent_plastic_strain": 0.0})

    def __post_init__(self) -> None:
        super().__post_init__()
        take_numbers(self, kinematic="give a slope of stress over plastic strain, >= 0")
        check_switch(self.finite_strain, "finite_strain")
        if self.kinematic < 0.0:
            raise InputError(f"kinematic = {self.kinematic} is no slope of hardening; it is >= 0")
        if callable(self.yield_stress):
            return
        vars(self)["yield_stress"] = _table(self.yield_stress)
        if (np.diff(self._reach(self.yield_stress)) <= 0).any():
            raise InputError(
                "the table of yield stresses falls faster than 3 mu + C = "
                f"{self._stiff:.4g}: stress is not unique at a strain. Look for a row out of place"
            )

    @property
    def _stiff(self) -> float:
        """By which the trial stress falls with plastic strain, ``3 mu + C``."""
        return 3.0 * self.shear + self.kinematic

    def _reach(self, table: Array) -> Array:
        return self._stiff * table[:, 1] + table[:, 0]

    def yields(self, p: Array) -> tuple[Array, Array]:
        """Yield stress and its slope at equivalent plastic strains."""
        if callable(self.yield_stress):
            with np.errstate(divide="ignore"):  # powers of p have no slope where they begin
                stress, slope = self.yield_stress(p)
            return np.asarray(stress, dtype=float), np.asarray(slope, dtype=float)
        Y, at = self.yield_stress.T
        slopes = np.append(np.diff(Y) / np.diff(at), 0.0)
        return np.interp(p, at, Y), slopes[np.searchsorted(at, p, side="right") - 1]

    def isochoric(self, H: Array, state: State) -> tuple[Array, Array, State]:
        return logarithmic(self._flow, H, state) if self.finite_strain else self._flow(H, state)

    def _flow(self, H: Array, state: State) -> tuple[Array, Array, State]:
        """The deviator of the stress at small strains, its derivative, and internal variables."""
        d, mu = len(H), self.shear
        old, p = state["plastic_strain"], state["equivalent_plastic_strain"]
        xi = 2.0 * mu * deviator(small(H)) - (2.0 * mu + self.kinematic / 1.5) * old
        q = np.sqrt(1.5 * ddot(xi, xi))
        dp = np.zeros_like(q)
        grows = np.zeros_like(q)  # share of q that p takes in further loading
        Y, reach = self.yields(p)[0], q + self._stiff * p
        flows = q - Y > COMPUTED * reach  # a step that begins where one has flowed is elastic at first
        if flows.any():
            new = self._plastic_strain(reach[flows], p[flows])
            dp[flows] = new - p[flows]
            grows[flows] = 3.0 * mu / (self._stiff + self.yields(new)[1])
        over = 1.0 / np.where(flows, q, 1.0)
        n = 1.5 * over * xi  # d eps_p / dp
        strain = old + dp * n
        stress = xi + self.kinematic / 1.5 * old - 2.0 * mu * dp * n
        kept = 1.0 - 3.0 * mu * dp * over
        tangent = np.multiply.outer(isotropic(0.0, mu, d), kept)
        m = n[:d, :d] * np.sqrt((grows - 1.0 + kept).clip(0.0) * 4.0 / 3.0 * mu)
        tangent -= np.einsum("ij...,kl...->ijkl...", m, m)
        return stress, tangent, {"plastic_strain": strain, "equivalent_plastic_strain": p + dp}

    def _plastic_strain(self, reach: Array, p: Array) -> Array:
        """Solve ``(3 mu + C) p + Y(p) = reach``, from plastic strains before the step."""
        if not callable(self.yield_stress):
            known = self._reach(self.yield_stress)  # increases: its inverse is as straight in parts
            beyond = np.maximum(reach - known[-1], 0.0) / self._stiff
            return np.maximum(np.interp(reach, known, self.yield_stress[:, 1]) + beyond, p)
        low, high = p, reach / self._stiff  # yield stresses are positive
        for _ in range(np.finfo(float).nmant + 1):  # halving alone has all digits then
            Y, slope = self.yields(p)
            short = reach - self._stiff * p - Y
            if np.all(np.abs(short) <= COMPUTED * reach):
                return p
            low, high = np.where(short > 0, p, low), np.where(short > 0, high, p)
            newton = p + short / (self._stiff + slope)
            inside = (newton > low) & (newton < high)
            p = np.where(inside, newton, 0.5 * (low + high))
        raise MaterialError("no plastic strain was found for the yield stress that is a function")

    def volumetric(self, growth: Array) -> tuple[Array, Array, Array]:
        k = self.bulk
        if not self.finite_strain:
            return 0.5 * k * growth**2, k * growth, np.full_like(growth, k)
        log, J = np.log1p(growth), 1.0 + growth
        return 0.5 * k * log**2, k * log / J, k * (1.0 - log) / J**2

    def energy(self, H: Array, state: State) -> tuple[Array, Array]:
        plastic = state["plastic_strain"]
        elastic = (undeformed_axes(H) if self.finite_strain else small(H)) - plastic
        stored = 0.5 * ddot(self.hooke(elastic), elastic) + self.kinematic / 3.0 * ddot(
            plastic, plastic
        )
        return stored, self._work(state["equivalent_plastic_strain"])

    def _work(self, p: Array) -> Array:
        """Work that isotropic hardening takes until p, the integral of Y; of functions by Gauss."""
        if callable(self.yield_stress):
            points = zip(*np.polynomial.legendre.leggauss(8), strict=True)
            return np.sum(
                [0.5 * w * p * self.yields(0.5 * (1.0 + x) * p)[0] for x, w in points], axis=0
            )
        Y, at = self.yield_stress.T
        row = np.searchsorted(at, p, side="right") - 1
        until = np.append(0.0, np.cumsum(0.5 * (Y[1:] + Y[:-1]) * np.diff(at)))
        return until[row] + 0.5 * (Y[row] + np.interp(p, at, Y)) * (p - at[row])


def _table(values: ArrayLike) -> Array:
    """Rows of yield stress and plastic strain, of a number or a table."""
    table = numbers(values, "yield_stress", USAGE)
    if table.ndim == 0:
        table = np.array([[float(table), 0.0]])
    if table.ndim != 2 or table.shape[1] != 2 or not len(table):
        raise InputError(f"yield_stress has shape {table.shape}: {USAGE}")
    if not np.isfinite(table).all() or not (table[:, 0] > 0).all():
        raise InputError("yield stresses are finite and > 0; rows are (stress, plastic strain)")
    if table[0, 1] != 0 or not (np.diff(table[:, 1]) > 0).all():
        raise InputError(
            f"plastic strains of yield_stress are {table[:, 1].tolist()}: they begin at 0 and "
            "increase. Rows are (stress, plastic strain); total strains have to be less stress / E"
        )
    return table
