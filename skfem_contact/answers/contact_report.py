"""What is printed of one contact: its part of the report of a result."""

from __future__ import annotations

import textwrap

import numpy as np

from skfem_contact.answers.error.sources import percent
from skfem_contact.answers.thresholds import COARSE
from skfem_contact.answers.values import ContactValues, status_words
from skfem_contact.bodies.selection import written
from skfem_contact.conditions.friction_rule import steep_words
from skfem_contact.conditions.state import OPEN


def contact_lines(values: ContactValues, estimate: bool) -> list[str]:
    """The lines of one contact; `estimate`: also its estimated error, which takes a moment."""
    contact = values.contact
    lines = [f"{values.name}: {contact.label}", f"  {status_words(values)}"]
    lines.append(f"  force on the secondary   {written(values.force)}")
    lines.append(f"  contact area             {values.contact_area:.6g}")
    if np.any(values.status != OPEN):
        # glue pulls as well as it presses
        size = np.linalg.norm(values.traction, axis=1) if contact.tied else values.pressure
        what, peak = "traction" if contact.tied else "pressure", int(np.argmax(size))
        where = written(values.points[peak])
        if size[peak] > 0 or contact.separation:
            lines.append(f"  {f'largest {what}':<24s} {size[peak]:.6g} at {where}")
        lines += _tension_lines(values)
    if contact.friction is not None:
        lines += _friction_lines(values)
    if values.worn_volume:
        deepest = int(np.argmax(values.wear_depth))
        where = f"{values.wear_depth[deepest]:.6g} deep at {written(values.points[deepest])}"
        lines.append(f"  worn off                 {values.worn_volume:.6g}, {where}")
    if estimate and np.any(values.status != OPEN):
        lines += _error_lines(values)
    open_gaps = values.gap[(values.status == OPEN) & np.isfinite(values.gap)]
    if len(open_gaps):
        lines.append(f"  smallest open gap        {open_gaps.min():.6g}")
    return lines


def _tension_lines(values: ContactValues) -> list[str]:
    """The largest tension of contact without separation, where there is any."""
    lowest = int(np.argmin(values.pressure))
    if values.contact.tied or values.contact.separation or values.pressure[lowest] >= 0:
        return []
    where = written(values.points[lowest])
    return [f"  largest tension          {-values.pressure[lowest]:.6g} at {where}"]


def _friction_lines(values: ContactValues) -> list[str]:
    size = np.linalg.norm(values.tangential_force, axis=1)
    lines = [
        f"  largest slip             {np.max(np.linalg.norm(values.slip, axis=1), initial=0.0):.6g}",
    ]
    if values.contact.separation:  # else the normal forces may cancel
        lines.append(f"  friction force / normal  {_share(size.sum(), values.normal_force.sum())}")
    if steep := steep_words(values.contact.friction):
        lines.append(f"  friction holds           {steep}")
    lines += [
        f"  energy lost by friction  {values.dissipation:.6g} in this step, "
        f"{values.dissipation_total:.6g} in all",
    ]
    if abs(values.energy_residual) > COARSE * values.dissipation:
        lines.append(
            f"  energy balance misses    {values.energy_residual:.3g} in this step: it is coarse, "
            "smaller ones tell the loss better"
        )
    return lines


def _error_lines(values: ContactValues) -> list[str]:
    error = values.error_estimate
    found = error.words
    if found.startswith("pressure"):
        found = f"pressure {percent(error.pressure.total)}"
        if values.friction_stress.any():
            found += f", with friction {percent(error.traction.total)}"
        found += " in L2"
    lines = [f"  estimated error          {found}"]
    return lines + [f"    {line}" for line in textwrap.wrap(error.advice, 92)]


def _share(part: float, whole: float) -> str:
    return f"{part / whole:.4f}" if whole > 0 else "-"
