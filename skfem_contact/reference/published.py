"""Published numerical benchmarks, as data with their sources."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RaousBlock:
    """Block pressed on a rigid plane and pushed sideways, proportionally (Raous, GRECO).

    Half of a block, 40 mm x 40 mm in plane strain, lies on the rigid plane y = 0. The face x = 0
    is a plane of symmetry (u_x = 0), a pressure acts on the face x = 40 mm and another on the top.
    SI units.

    Attributes
    ----------
    side, E, nu, mu : float
        Side of the half block, modulus, Poisson's ratio, coefficient of friction.
    lateral_pressure, top_pressure : float
        Loads.
    points : tuple of float
        Abscissas on the contact line of the points A, B, C, D, E.
    published : tuple of float
        Their size of u_x, mean of the codes of the benchmark, tolerance 5 % (Raous; Feijóo,
        Barbosa & Zouain; printed in Code_Aster SSNV128).
    code_aster : tuple of float
        Code_Aster SSNV209a, linear quadrilaterals.
    converged : tuple of float
        64 x 64 eight-node elements, an independent solver with nodal contact. The
        abscissas of B to E were identified by matching this solution with the published values.
    normal_force, friction_force : float
        Resultants per metre of thickness; the first is exact, the second converged (the node on
        the plane of symmetry left out).
    stick_end, contact_end : float
        Abscissas where slip and separation begin, to about one element of 0.6 mm.

    Examples
    --------
    >>> RAOUS.normal_force == RAOUS.top_pressure * RAOUS.side
    True
    """

    side: float = 0.04
    E: float = 1.3e11
    nu: float = 0.2
    mu: float = 1.0
    lateral_pressure: float = 15e7
    top_pressure: float = 5e7
    points: tuple[float, ...] = (0.04, 0.03875, 0.035, 0.0325, 0.02875)
    published: tuple[float, ...] = (2.86e-5, 2.72e-5, 2.28e-5, 1.98e-5, 1.5e-5)
    code_aster: tuple[float, ...] = (2.84594e-5, 2.70792e-5, 2.27403e-5, 1.97271e-5, 1.53642e-5)
    converged: tuple[float, ...] = (2.86018e-5, 2.72245e-5, 2.28676e-5, 1.98072e-5, 1.54137e-5)
    normal_force: float = 2.0e6
    friction_force: float = 1.40536e6
    stick_end: float = 0.0103
    contact_end: float = 0.0368


RAOUS = RaousBlock()
