"""The printed report of a result."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from skfem_contact.answers.error.sources import percent
from skfem_contact.answers.uniqueness import MOST_ROWS
from skfem_contact.conditions.state import STATUS

if TYPE_CHECKING:
    from skfem_contact.answers.result import ContactResult
    from skfem_contact.answers.values import ContactValues

# Energy that the balance of a step misses, over the energy lost, from which on it is said: the loss of
# the README's scene, pressed and released, is then wrong by a third of that.
COARSE = 0.05


def report(result: ContactResult) -> str:
    """The report of a result: what touches, what slips, what force flows, and how well it is known."""
    lines = [f"Contact result: {result.message}"]
    if result.factor is not None:
        lines[0] += f" (load factor {result.factor:g})"
    for values in result.values:
        lines += ["", *_contact_lines(result, values)]
    if result.rotations:
        turned = ", ".join(f"{name} {angle:.2g} rad" for name, angle in result.rotations.items())
        lines += ["", f"rotation of the contact surfaces (linear bodies follow to 0.1): {turned}"]
    lines += ["", *result.indifferent] if result.indifferent else []
    lines += ["", *validity_lines(result)]
    lines += ["", *other_answers] if (other_answers := _uniqueness_lines(result)) else []
    lines += ["", "Certificate (dimensionless; round-off where everything holds)"]
    certificate = result.certificate
    lines += str(certificate).splitlines()
    seconds = ", ".join(f"{k} {v:.3g} s" for k, v in result.timings.items())
    lines += ["", f"{result.iterations} iterations; {seconds}"]
    return "\n".join(lines)


def validity_lines(result: ContactResult) -> list[str]:
    """Whether the model holds at the answer, and what to change where it does not."""
    validity = result.validity
    lines = [f"Validity of the model: {'holds' if validity.holds else 'DOES NOT HOLD'}"]
    lines += str(validity).splitlines()
    for text in validity.problems.values():
        lines += [f"  ! {textwrap.fill(text, 96, subsequent_indent='    ')}"]
    return lines


def _contact_lines(result: ContactResult, values: ContactValues) -> list[str]:
    contact = result.contacts[result.names.index(values.name)]
    count = [int(np.sum(values.status == k)) for k in range(3)]
    lines = [f"{values.name}: {contact.label}"]
    if contact.tied:
        lines.append(f"  {count[1]} points tied, {count[0]} without partner")
    elif contact.friction is None:
        lines.append(f"  frictionless: {count[1] + count[2]} points closed, {count[0]} open")
    else:
        lines.append(f"  {type(contact.friction).__name__}: " + _counts(count))
    lines.append(f"  force on the secondary   {_vector(values.force)}")
    lines.append(f"  contact area             {values.contact_area:.6g}")
    if np.any(values.status != 0):
        # glue pulls as well as it presses
        size = np.linalg.norm(values.traction, axis=1) if contact.tied else values.pressure
        what, peak = "traction" if contact.tied else "pressure", int(np.argmax(size))
        where = _vector(values.points[peak])
        lines.append(f"  {f'largest {what}':<24s} {size[peak]:.6g} at {where}")
    if contact.friction is not None:
        size = np.linalg.norm(values.tangential_force, axis=1)
        lines.append(f"  largest slip             {np.max(np.abs(values.slip), initial=0.0):.6g}")
        lines.append(f"  friction force / normal  {_share(size.sum(), values.normal_force.sum())}")
        lines.append(
            f"  energy lost by friction  {values.dissipation:.6g} in this step, "
            f"{values.dissipation_total:.6g} in all"
        )
        if abs(values.energy_residual) > COARSE * values.dissipation:
            lines.append(
                f"  energy balance misses    {values.energy_residual:.3g} in this step: it is coarse, "
                "smaller ones tell the loss better"
            )
    if values.points.shape[1] == 2 and np.any(values.status != 0):
        lines += _error_lines(values)
    open_gaps = values.gap[(values.status == 0) & np.isfinite(values.gap)]
    if len(open_gaps):
        lines.append(f"  smallest open gap        {open_gaps.min():.6g}")
    return lines


def _error_lines(values: ContactValues) -> list[str]:
    error = values.error_estimate
    found = f"pressure {percent(error.pressure.total)}"
    if values.friction_stress.any():
        found += f", with friction {percent(error.traction.total)}"
    lines = [f"  estimated error          {found} in L2"]
    return lines + [f"    {line}" for line in textwrap.wrap(error.advice, 92)]


def _counts(count: list[int]) -> str:
    return ", ".join(f"{n} {name}" for n, name in zip(count, STATUS, strict=True))


def _vector(v: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in v) + ")"


def _share(part: float, whole: float) -> str:
    return f"{part / whole:.4f}" if whole > 0 else "-"


def _uniqueness_lines(result: ContactResult) -> list[str]:
    """What a report says of other answers: nothing where none are to be feared."""
    if result.kin.tangents != 1 or not any(contact.friction for contact in result.contacts):
        return []
    if not 0 < result.recover.unknowns <= MOST_ROWS:
        return []
    known = result.uniqueness
    if known is None:
        return []
    end = ["this is the one found from the state before"]
    if known.index < 0 and known.held:
        return ["this load has at least two other answers (the index of this one is -1);", *end]
    if not known.may_be_several.any():
        return []
    over = np.where(known.may_be_several, known.friction / known.critical_friction, 0.0)
    i = int(np.argmax(over))
    place = ", ".join(f"{x:.6g}" for x in result.kin.points[i])
    mu, critical = known.friction[i], known.critical_friction[i]
    return [
        f"with mu = {mu:.3g} above {critical:.2f} at ({place}) the load may have several answers;",
        *end,
    ]
