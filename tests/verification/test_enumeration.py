"""The solver against all solutions of small random problems, found by trying every pattern."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pytest
from enumeration import all_solutions, distance
from random_problems import random_scene

import skfem_contact as sc

MU = (0.1, 0.3, 0.5, 1.0, 2.0, 5.0)

# Displacements, normal and friction forces agree to this part of the largest of each.
# Condensation of the bodies and the eigenvalues of the oracle lose up to five digits of sixteen to
# the condition of blocks ten times longer than wide.
SAME = 1e-8


@dataclass
class Tally:
    """What happened; every entry names the seed, mu and step, so that it can be run alone."""

    steps: int = 0
    several: int = 0
    wrong: list = field(default_factory=list)
    not_found: list = field(default_factory=list)
    refused: list = field(default_factory=list)


# Random loads may push a point past the end of the other block: the discrete problem is judged.
# a few elements of any Poisson's ratio up to .48: discrete conditions, whether they slide or lock
pytestmark = [
    pytest.mark.filterwarnings(f"ignore:.*{what}:skfem_contact.ContactWarning")
    for what in ("small sliding", "locks")
]


@cache
def tally(loop: str, G: float, first: int, count: int, most: int = 4, floating: bool = False) -> Tally:
    """Two load steps of every random problem, each in one step and checked on its own.

    The second step starts from the friction state of the first, which for the enumeration is the
    enumerated solution itself.
    """
    out = Tally()
    for seed in range(first, first + count):
        mu = MU[seed % len(MU)]
        scene = random_scene(seed, mu, most, floating)
        solver, start, before = scene.solver(loop, G), None, None
        order = scene.order
        for number, (f, x) in enumerate(scene.loads):
            known = all_solutions(scene.step(number, G, before))
            name = f"seed {seed}, mu {mu}, step {number}, {len(order)} points, {len(known)} known"
            out.steps += 1
            out.several += len(known) > 1
            try:
                result = solver.solve(f, x, start=start)
            except (sc.errors.NotConverged, sc.errors.NoEquilibrium) as error:
                # a loop that may fail has to say so, and hand over its last state
                assert error.result is None or not error.result.converged
                (out.not_found if known else out.refused).append(name)
                break
            forces = result.normal_force[order], -result.tangential_force[order, 0]
            off = [distance(solution, result.u, *forces) for solution in known]
            if not known or min(off) > SAME:
                out.wrong.append(f"{name}: off by {off}, certificate {result.certificate.worst}")
                break
            start, before = result, known[int(np.argmin(off))]
    return out


# Tangential stiffness of a point; E is 0.1 to 10. The loop `fictitious` needs a soft one.
EXACT, ELASTIC, SOFT = np.inf, 3.0, 0.3
CASES = [("newton", EXACT), ("newton", ELASTIC), ("direct", EXACT), ("direct", ELASTIC)]
# The slow test below has thousands. With exact sticking 30 are too few: a wrong sign of the slip that
# Lemke's algorithm starts from went unnoticed.
COUNT = {("newton", EXACT): 60, ("fictitious", SOFT): 15}
FEW = 30


@pytest.mark.parametrize(("loop", "G"), [*CASES, ("fictitious", SOFT)])
def test_enumeration_every_accepted_answer_is_a_solution(loop: str, G: float) -> None:
    """An answer that the solver accepts satisfies equilibrium, Signorini and Coulomb exactly."""
    seen = tally(loop, G, 0, COUNT.get((loop, G), FEW))
    assert seen.wrong == []
    assert seen.steps > len(seen.not_found)  # otherwise nothing was accepted


@pytest.mark.parametrize(("loop", "G"), CASES)
def test_enumeration_what_exists_is_found(loop: str, G: float) -> None:
    """A held body has an equilibrium for every friction coefficient, and the solver finds one."""
    seen = tally(loop, G, 0, COUNT.get((loop, G), FEW))
    assert seen.refused == []  # none of these problems is without a solution
    assert seen.not_found == []


def test_enumeration_floating_bodies() -> None:
    """A body on friction alone: found where an equilibrium exists, refused where there is none."""
    seen = tally("newton", EXACT, 0, 60, 4, floating=True)
    assert seen.wrong == []
    assert seen.not_found == []
    assert len(seen.refused) > 10  # the loads are chosen so that both happen


@pytest.mark.slow
@pytest.mark.parametrize(("loop", "G"), CASES)
def test_enumeration_many_problems_with_up_to_six_points(loop: str, G: float) -> None:
    """The same over some thousand steps, with enough points for several solutions to occur."""
    seen = tally(loop, G, 1000, 600, 6)
    assert seen.wrong == []
    assert seen.not_found == []
    assert seen.refused == []
    assert seen.several > 0  # with mu = 2 or 5, now and then
