"""What is printed of a result: a few lines, what is quickly known, or all; a table for notebooks."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.contact_report import contact_lines
from skfem_contact.answers.thresholds import FALLING, FURTHER, MOST_ROWS
from skfem_contact.answers.values import status_words
from skfem_contact.bodies.selection import written
from skfem_contact.conditions.friction_rule import CheckedLaw
from skfem_contact.conditions.state import OPEN, SLIP

if TYPE_CHECKING:
    from skfem_contact.answers.result import ContactResult
    from skfem_contact.answers.uniqueness import Uniqueness

#: What a printed result leaves to the report, and how to get it.
MORE = (
    "print(result.report()) adds the estimated error of the mesh, the validity of the model in\n"
    "numbers, and whether there are other answers."
)


def short(result: ContactResult) -> str:
    """A few lines at no cost: how it ended, and the force and status of every contact."""
    lines = [f"<ContactResult: {_headline(result)}"]
    for values in result:
        lines.append(f"  {values.name}: {status_words(values)}; force {written(values.force)}")
    return "\n".join(lines) + ">"


def summary(result: ContactResult) -> str:
    """What is known quickly: the contacts, whether the model holds, the certificate."""
    lines = _first_lines(result, estimate=False)
    lines += ["", _verdict(result), *_last_lines(result), "", MORE]
    return "\n".join(lines)


def report(result: ContactResult) -> str:
    """The report of a result: what touches, what slips, what force flows, and how well it is known."""
    lines = [*_first_lines(result, estimate=True), "", *validity_lines(result)]
    answer = result._answer
    other_answers = [*_jump_lines(answer), *_fall_lines(answer), *_uniqueness_lines(result)]
    lines += ["", *other_answers] if other_answers else []
    return "\n".join([*lines, *_last_lines(result)])


def table(result: ContactResult) -> str:
    """The headline, a row per contact and the certificate, in HTML for notebooks."""
    from html import escape  # for notebooks alone

    heads = ("contact", "points", "force on the secondary", "largest pressure", "contact area")
    rows = []
    for values in result:
        peak = np.max(values.pressure, initial=0.0)
        words = (f"{values.name}: {values.contact.label}", status_words(values), written(values.force))
        rows.append([*words, f"{peak:.6g}", f"{values.contact_area:.6g}"])
    cells = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
    head = "".join(f"<th>{name}</th>" for name in heads)
    return (
        f"<p><b>Contact result:</b> {escape(_headline(result))}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{cells}</tbody></table>"
        f"<p>{escape(_verdict(result))}; "
        f"certificate: {result.certificate.worst:.1e} at worst</p>"
    )


def validity_lines(result: ContactResult) -> list[str]:
    """Whether the model holds at the answer, and what to change where it does not."""
    validity = result.validity
    lines = [_verdict(result), *str(validity).splitlines()]
    for text in validity.problems.values():
        lines += [f"  ! {textwrap.fill(text, 96, subsequent_indent='    ')}"]
    return lines


def _headline(result: ContactResult) -> str:
    factor = "" if result.factor is None else f" (load factor {result.factor:g})"
    return result.message + factor


def _first_lines(result: ContactResult, estimate: bool) -> list[str]:
    lines = [f"Contact result: {_headline(result)}"]
    for values in result:
        lines += ["", *contact_lines(values, estimate)]
    if result.rotations:
        turned = ", ".join(f"{name} {angle:.2g} rad" for name, angle in result.rotations.items())
        lines += ["", f"rotation of the contact surfaces (linear bodies follow to 0.1): {turned}"]
    said = [*result.indifferent, *result.undetermined]
    return lines + (["", *said] if said else [])


def _last_lines(result: ContactResult) -> list[str]:
    lines = ["", "Certificate (dimensionless; round-off where everything holds)"]
    lines += str(result.certificate).splitlines()
    seconds = ", ".join(f"{k} {v:.3g} s" for k, v in result.timings.items())
    linear = result._answer.linear
    lines += ["", f"linear problems: {linear}"] if linear else [""]
    return [*lines, f"{result.iterations} iteration{'s' if result.iterations != 1 else ''}; {seconds}"]


def _verdict(result: ContactResult) -> str:
    """Whether the model holds, and what its history has warned of before, in a line."""
    validity = result.validity
    words = "Validity of the model: " + ("holds" if validity.holds else "DOES NOT HOLD")
    words += f" ({_listed(validity.problems)})" if validity.problems else ""
    before = f"; warned of before in this history: {_listed(validity.before)}"
    return words + (before if validity.before else "")


def _listed(keys: Iterable[tuple[str, str]]) -> str:
    return ", ".join(f"{kind} of {name!r}" for kind, name in sorted(keys))


def _shown(known: Uniqueness) -> str:
    """Whether there is one answer, as far as that is shown."""
    if known.only_one:
        return "this load has no other answer" + (
            ""
            if np.isinf(known.unique_up_to)
            else f": shown for friction up to {known.unique_up_to:.3g} times this"
        )
    words = "whether this load has other answers is not known"
    if known.unique_up_to > 0:
        words += f"; that it has none is shown for friction up to {known.unique_up_to:.2g} times this"
    return words


def _jump_lines(answer: Answer) -> list[str]:
    """What a report says of friction that is lost all at once where a point opens."""
    lines, slip = [], answer.local.slip - answer.local.reference
    for contact, part, name in zip(answer.contacts, answer.slices(), answer.names, strict=True):
        if contact.friction is None or contact.bilateral:
            continue
        law = CheckedLaw(contact.friction, name, contact.secondary.points)
        at_opening = law.limit(np.zeros(len(slip[part])), answer.kin.area[part], slip[part])
        state, moved = answer.local, np.linalg.norm(answer.local.slip[part], axis=1)
        # coupling makes of friction a normal force, and of slip a gap, that are hardly larger
        light = state.normal_force[part] < np.linalg.norm(state.tangential_force[part], axis=1)
        light |= (state.status[part] == OPEN) & (answer.gap[part] < moved)
        if (at_opening[light & answer.kin.paired[part]] > 0).any():
            lines += [
                f"the friction of contact {name!r} does not begin at zero: a point may be closed by",
                "it, or open, and this load may have other answers; this is the one found from before",
            ]
    return lines


def _fall_lines(answer: Answer) -> list[str]:
    """What a report says of friction that falls with the slip of points that slip."""
    lines, state = [], answer.local
    slip = state.slip - state.reference
    for contact, part, name in zip(answer.contacts, answer.slices(), answer.names, strict=True):
        if contact.friction is None:
            continue
        law = CheckedLaw(contact.friction, name, contact.secondary.points)
        here = np.maximum(state.normal_force[part], 0.0), answer.kin.area[part]
        now = law.limit(*here, slip[part])
        ahead = law.limit(*here, (1 + FURTHER) * slip[part])
        if (ahead < (1 - FURTHER * FALLING) * now)[state.status[part] == SLIP].any():
            lines += [
                f"the friction of contact {name!r} falls with the slip: where it does so faster than",
                "the bodies give way a load has several answers; other steps or loops may find others",
            ]
    return lines


def _uniqueness_lines(result: ContactResult) -> list[str]:
    """What a report says of other answers: in the plane nothing where none are to be feared."""
    answer = result._answer
    if not any(contact.friction for contact in result.contacts):
        return []
    solid = answer.kin.tangents == 2
    looked_at = 0 < answer.recover.unknowns <= MOST_ROWS
    known = result.uniqueness if looked_at else None
    if known is None:
        return ["whether this load has other answers is not looked at"] if solid else []
    end = ["this is the one found from the state before"]
    if known.index < 0 and known.held:
        return ["this load has at least two other answers (the index of this one is -1);", *end]
    if not known.may_be_several.any():
        return [_shown(known)] if solid else []
    over = np.where(known.may_be_several, known.friction / known.critical_friction, 0.0)
    i = int(np.argmax(over))
    mu, critical = known.friction[i], known.critical_friction[i]
    return [
        f"with mu = {mu:.3g} above {critical:.2f} at {written(answer.kin.points[i])} "
        "the load may have several answers;",
        *end,
    ]
