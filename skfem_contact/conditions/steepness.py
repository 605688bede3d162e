"""Coefficients of friction beyond those of materials, in words that show whether they are meant."""

from __future__ import annotations

import numpy as np

from skfem_contact.conditions.friction import Coulomb, FrictionLaw
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.thresholds import STEEP


def steep_words(law: FrictionLaw | None) -> str:
    """How far off the normal friction holds, where the coefficient is larger than materials have.

    Such a coefficient may stand for points that hardly ever slip, or be an angle in degrees, or per
    cent. That is not told by its value, so nothing is warned of; what is said is true of all three,
    and shows which it is.

    >>> steep_words(Coulomb(30)), steep_words(Coulomb(0.5))
    ('up to 88.1 degrees off the normal (mu = 30)', '')
    """
    if not isinstance(law, Coulomb | OrthotropicCoulomb):
        return ""
    mu = float(np.max(np.asarray(law.mu), initial=0.0))
    if mu < STEEP:
        return ""
    return f"up to {np.degrees(np.arctan(mu)):.3g} degrees off the normal (mu = {mu:.6g})"
