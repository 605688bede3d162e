"""Newton's method on one body without contact: for tests of its equations alone."""

from __future__ import annotations

import numpy as np
import skfem as fem


def newton(body, x, state=None, u=None, most=12, tolerance=1e-12):
    """Displacements, internal variables and residuals of a body that is held at D by values x.

    Residuals are relative to the largest internal force; held values arrive in the first step.
    """
    u = np.zeros(body.n) if u is None else u.copy()
    held = np.isin(np.arange(body.n), body.D)
    step, residuals = np.where(held, x - u, 0.0), []
    for _ in range(most):
        K, internal, new = body.linearize(u, state)
        r = body.f - internal
        size = np.abs(internal).max()
        residuals.append(np.abs(r[~held]).max() / size if size else 1.0)
        if len(residuals) > 1 and residuals[-1] < tolerance:
            break
        u = u + fem.solve(*fem.condense(K, r, D=body.D, x=step))
        step = 0 * step
    return u, new, residuals
