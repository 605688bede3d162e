"""The printed reports: `print(result)`, and `print(solver)` as a dry run before anything is solved."""

from __future__ import annotations

import textwrap
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from skfem_contact.estimate import percent
from skfem_contact.pairing_diagnosis import diagnose, say_stiffer
from skfem_contact.states import STATUS
from skfem_contact.uniqueness import words

if TYPE_CHECKING:
    from skfem_contact.contact import Contact
    from skfem_contact.contact_values import ContactValues
    from skfem_contact.friction import FrictionLaw
    from skfem_contact.result import ContactResult
    from skfem_contact.solver import ContactSolver

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
    lines += ["", *other_answers] if (other_answers := words(result)) else []
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


def dry_run(solver: ContactSolver) -> str:
    """What a solver models and what it leaves out, before anything is solved."""
    system = solver.system
    lines = [f"Contact solver: loop '{solver.loop}', {_linear_words(solver)}", ""]
    for body, name in zip(system.bodies, system.names, strict=True):
        lines.append(
            f"body {name}: {body.n} DOFs, {len(body.D)} prescribed, "
            f"{type(body.basis.mesh).__name__}, {body.basis.mesh.nelements} elements"
        )
    lines.append(_free_words(solver))
    for contact, name, pairing in zip(
        solver.contacts, solver.names, solver.geometry.pairings, strict=True
    ):
        part = solver.interface.parts[solver.names.index(name)]
        lines += ["", f"{name}: {contact.label}"]
        lines.append(f"  {_model_words(contact)}")
        lines += [f"  {line}" for line in _gap_words(solver, part)]
        sides = pairing, contact.secondary, contact.primary, contact.method
        lines += [f"  {line}" for line in (*diagnose(*sides), *say_stiffer(*sides))]
    return "\n".join(lines)


def _linear_words(solver: ContactSolver) -> str:
    kin = solver.kin
    points = int(kin.paired.sum())
    rows = points + kin.tangents * int((solver.interface.slipping & kin.paired).sum())
    dofs = len(np.setdiff1d(solver.linear_model.touched(), solver.system.D))
    if solver.linear_model.condensed:
        dense = 8e-6 * (2 * dofs**2 + 3 * rows**2)
        factors = 1e-6 * sum(size.memory for size in solver.sizes().values())
        return (
            f"condensed: {solver.system.n} DOFs -> {dofs} contact DOFs -> {rows} gaps and slips "
            f"of {points} points; {factors:.3g} MB for the factors, {dense:.3g} MB of dense matrices"
        )
    why = (
        "as chosen"
        if not isinstance(solver.linear, str)
        else (f"because {dofs} contact DOFs exceed max_candidates = {solver.options.max_candidates}")
    )
    backend = solver.linear_model.backend
    return f"linear solver {backend!r} on all {solver.system.n} DOFs in every iteration, {why}"


def _free_words(solver: ContactSolver) -> str:
    motions = solver.linear_model.motions
    if motions.k == 0:
        return "no rigid motion is free: supports alone hold all bodies"
    words = [motions.describe(column) for column in np.eye(motions.k)]
    listed = "; ".join(f"{' and '.join(bodies)}: {motion}" for bodies, motion in words)
    return f"free without contact and friction: {listed}"


def _model_words(contact: Contact) -> str:
    if contact.tied:
        return f"tied ({contact.method}): gaps and slips are zero, also in tension"
    method = "node by node" if contact.rigid else contact.method
    law = "frictionless: nothing tangential is modelled"
    if contact.friction is not None:
        law = f"friction {_law_words(contact.friction)}"
    return f"method {method}; {law}"


def _law_words(law: FrictionLaw) -> str:
    """A law with the parameters that are not its defaults."""
    given = []
    for f in fields(law):
        value = getattr(law, f.name)
        if value is not f.default and not (np.ndim(value) == 0 and value == f.default):
            given.append(f"{f.name}={value!r}" if np.ndim(value) == 0 else f"{f.name} by point")
    return f"{type(law).__name__}({', '.join(given)})"


def _gap_words(solver: ContactSolver, part: slice) -> list[str]:
    gap = solver.kin.gap0[part][solver.kin.paired[part]]
    total = part.stop - part.start
    lines = [f"{len(gap)} of {total} points have a partner"]
    if len(gap):
        touching = int(np.sum(gap == 0.0))
        widest, deepest = max(gap.max(), 0.0), max(-gap.min(), 0.0) + 0.0
        lines.append(
            f"initial gaps: {int(np.sum(gap > 0))} open (largest {widest:.6g}), "
            f"{touching} closed, {int(np.sum(gap < 0))} overlap (deepest {deepest:.6g})"
        )
    return lines
