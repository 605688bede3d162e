"""Where contact slides far: every attempt is solved again on the pairing of its own answer.

That is a fixed point, which secants reach in half the rounds of repetition. A step in which a point
slid too far is refused, with the distance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.state import OPEN
from skfem_contact.digits import SOLVED
from skfem_contact.history.load_step import Attempt, LoadStep
from skfem_contact.history.stepper import Stepper
from skfem_contact.history.thresholds import EDGE, FAR, PLAIN
from skfem_contact.linalg.krylov import Anderson
from skfem_contact.loops.step import Record


def attempted(by: Stepper, step: LoadStep, start: str) -> Attempt:
    """One attempt at a load step; where contact slides far, on the pairing of its own answer."""
    model, options = by.model, by.options
    geometry, case = model.geometry, step.target
    if not geometry.follows:
        return by.attempt(step, step.workspace.borrowed(model.problem_on(None, None)), start)
    at = step.state.surface + step.share * step.state.trend
    u = geometry.predicted(at, case)
    problem = model.problem_on(geometry.at(u, case), u)
    trace: tuple[Record, ...] = ()
    secant, lost = Anderson(), np.zeros(len(geometry.finite), dtype=bool)
    for number in range(options.max_placements):
        attempt = by.attempt(step, problem, start)
        trace += attempt.outcome.trace
        outcome = replace(attempt.outcome, trace=trace)
        attempt = replace(attempt, outcome=outcome)
        if not attempt.good:
            return attempt
        attempt = _travelled(by, attempt, 1.0 if number else FAR)
        if attempt.failure:
            return attempt
        there = attempt.local.surface
        plain = number < PLAIN
        at = there if plain else secant.next(at, there)
        u = geometry.spread(at)
        next_kin = without_points(geometry.at(u, case, problem.kin), lost)
        if number >= EDGE:
            lost = lost | (problem.kin.paired & ~next_kin.paired)
        mismatch = geometry.mismatch(problem.kin, next_kin, attempt.local, by.barred)
        limit = options.placement_tolerance
        if number + 1 == options.max_placements:
            limit = max(limit, options.tolerance)  # forces that a loop knows so far move points as far
        if mismatch <= limit:
            # so far only the next pairing is alike: what counts is that of the answer itself
            own = next_kin
            if not plain:
                own = geometry.at(geometry.spread(there), case, next_kin)
                own = without_points(own, lost)
                mismatch = geometry.mismatch(problem.kin, own, attempt.local, by.barred)
            if mismatch <= limit:
                return _settled(by, attempt, own, mismatch)
        start, step = "warm", replace(step, known=attempt.state)
        problem = model.problem_on(next_kin, u)
    point = geometry.least_settled(problem.kin, next_kin, attempt.local)
    words = f"the pairing did not settle in {options.max_placements} rounds ({mismatch:.1e}): "
    words += model.interface.point_words(point, next_kin.points[point])
    words += " meets another partner in every round"
    return replace(attempt, mismatch=mismatch, failure=words, culprit=point)


def _settled(by: Stepper, attempt: Attempt, own: Kinematics, mismatch: float) -> Attempt:
    """The attempt whose pairing is that of its own answer, with the gaps of that."""
    local = attempt.local
    gap = np.where(by.model.geometry.finite & (local.status == OPEN), own.gap0, local.gap)
    # an obstacle takes its points along without another condition, and forces act where they are now
    attempt = replace(attempt, mismatch=mismatch, local=replace(local, gap=gap), own_action=own.action)
    return _travelled(by, attempt, 1.0)


def _travelled(by: Stepper, attempt: Attempt, limit: float) -> Attempt:
    """Measure how far points slid, over what is allowed; refuse what is beyond a limit."""
    geometry, interface = by.model.geometry, by.model.interface
    last, new = attempt.start, attempt.local
    closed = (new.status != OPEN) & (last.status != OPEN) & geometry.finite
    slid = np.linalg.norm(attempt.problem.kin.slip_along(new.slip - last.slip), axis=1)
    travel, culprit = 0.0, -1
    for contact, part in zip(interface.contacts, interface.point_slices, strict=True):
        way = np.where(closed[part], slid[part], 0.0)
        share = np.max(way) / (by.options.max_travel * np.mean(contact.secondary.lengths))
        if not share <= travel:  # a NaN as well
            travel, culprit = float(share), part.start + int(np.argmax(way))
    if travel > max(limit, 1.0 + SOLVED):
        words = interface.point_words(culprit, attempt.problem.kin.points[culprit])
        words += f" slid {travel:.3g} times as far as max_travel allows"
        return replace(attempt, failure=words, travel=travel, culprit=culprit)
    return replace(attempt, travel=travel)


def without_points(kin: Kinematics, lost: NDArray[np.bool_]) -> Kinematics:
    """The pairing with some points open for good."""
    if not lost.any():
        return kin
    return replace(kin, paired=kin.paired & ~lost, gap0=np.where(lost, np.inf, kin.gap0))
