"""Public problems of Coulomb friction between rigid bodies: our Newton beside nonsmooth Gauss-Seidel.

    OPENBLAS_NUM_THREADS=1 python benchmarks/friction_problems.py FOLDER
    OPENBLAS_NUM_THREADS=1 python benchmarks/friction_problems.py FOLDER --only Capsules

FOLDER holds the text files of ``numerics/src/FrictionContact/test/data`` in the sources of siconos
(none of them is part of this project): for each a compliance W, mostly singular, as rigid bodies touch
at more points than they have motions, free velocities q and coefficients mu. Asked for are forces r,
``u = W r + q``, with

    0 <= u_n  _|_  r_n >= 0,   |r_t| <= mu r_n,   r_t = -mu r_n u_t / |u_t|  where it slips.

The error is that of siconos, ``|r - P(r - (u + mu |u_t| n))| / |q|`` with the projection P onto the
cones. Files of other problems (``GFC``: with bodies; sparse ones) are left out, and counted. Without
``--only`` what was measured is stored in ``results/friction_problems.json``, and the table of the
performance profile is written into docs/developers.md.
"""

from __future__ import annotations

import argparse
import json
import time
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from gauss_seidel import gauss_seidel
from numpy.typing import NDArray
from run import write_into
from scipy.linalg import LinAlgError
from scipy.sparse import block_array, csr_matrix

import skfem_contact as sc
from skfem_contact.conditions.friction import CheckedLaw
from skfem_contact.conditions.friction_rule import FrictionRule
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.state import OPEN, STICK, LocalState
from skfem_contact.errors import SingularMatrix
from skfem_contact.loops.driver import LOOPS, Outcome, drive
from skfem_contact.loops.multipliers import Collision
from skfem_contact.loops.pulled import after
from skfem_contact.loops.starts import proximal
from skfem_contact.loops.step import Guess, Step
from skfem_contact.problem.points import Conditions, Load, PointSpace, Resistance, Response
from skfem_contact.problem.seam import GIVE
from skfem_contact.problem.zone import Compliance, Zones

Array = NDArray[np.float64]
MARKS = "<!-- friction problems: begin -->", "<!-- friction problems: end -->"
STORED = Path(__file__).parent / "results" / "friction_problems.json"

# An answer, in the measure of siconos; CPU seconds that Gauss-Seidel may take; how many times the time
# of the quicker one the profile looks at.
GOAL, PATIENCE, TIMES = 1e-8, 60.0, (1, 2, 5, 10, 100, 1000)

LABELS = {"newton": "Newton", "gauss_seidel": "nonsmooth Gauss-Seidel"}

# Answers that one matrix may take, see `newton`: each leaves a thousandth.
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class Problem:
    """One file: W (m d, m d), sparse, q (m, d) and mu (m,)."""

    name: str
    W: csr_matrix
    q: Array
    mu: Array

    @cached_property
    def odd(self) -> csr_matrix:
        """What takes W from being symmetric."""
        return csr_matrix(0.5 * (self.W - self.W.T))

    def error(self, r: Array) -> float:
        """Of forces (m, d), in the measure of siconos."""
        u = self.q + (self.W @ r.ravel()).reshape(r.shape)
        asked = r - u
        asked[:, 0] -= self.mu * np.linalg.norm(u[:, 1:], axis=1)
        return float(np.linalg.norm(r - cones(asked, self.mu)) / np.linalg.norm(self.q))


def cones(r: Array, mu: Array) -> Array:
    """The nearest forces (m, d) within the friction cones."""
    n, t = r[:, 0], np.linalg.norm(r[:, 1:], axis=1)
    normal = np.where(t <= mu * n, n, np.where(mu * t <= -n, 0.0, (n + mu * t) / (1 + mu**2)))
    share = np.minimum(mu * normal / np.where(t > 0, t, 1.0), 1.0)
    return np.column_stack([normal, r[:, 1:] * share[:, None]])


def read(path: Path) -> Problem | None:
    """The problem of a file; None where it holds another kind of problem, or a sparse one."""
    try:
        numbers = [float(word) for word in path.read_text(encoding="latin-1").split()]
    except ValueError:
        return None
    d, m, storage = (int(n) for n in numbers[:3])
    if path.name.startswith(("GFC", "gfc")) or d not in (2, 3) or storage not in (0, 1):
        return None
    at = iter(numbers[3:])

    def some(count: int) -> Array:
        return np.array([next(at) for _ in range(count)])

    n = [int(next(at)), int(next(at))]
    assert n == [d * m, d * m]
    if storage == 0:
        some(2)
        W = csr_matrix(some(n[0] ** 2).reshape(n))
    else:
        count, rows, columns = (int(next(at)) for _ in range(3))
        some(rows + columns)
        filled, stored = int(next(at)), int(next(at))
        begins, column = some(filled).astype(int), some(stored).astype(int)
        none = csr_matrix((d, d))
        grid: list[list[Any]] = [[none] * columns for _ in range(rows)]
        assert stored == count
        for row in range(rows):
            for k in range(begins[row], begins[row + 1]):
                assert int(next(at)) == k
                grid[row][column[k]] = csr_matrix(some(d * d).reshape(d, d).T)
        W = csr_matrix(block_array(grid))
    return Problem(path.stem, W, some(d * m).reshape(m, d), some(m))


class Seen:
    """Such a problem as the loops see it, where rows depend on each other through springs.

    Parameters
    ----------
    problem : Problem
    """

    def __init__(self, problem: Problem) -> None:
        m, d = problem.q.shape
        W, rows = (problem.W - problem.odd).toarray(), np.arange(m * d).reshape(m, d)
        self._places = normal, tangential = rows[:, 0], rows[:, 1:]
        self.springs: Array | None = None
        self._give, self._zones = np.zeros(m * d), Zones(Compliance(W, normal, tangential, m * d))
        try:
            self._zones.whole()
        except LinAlgError:
            give = GIVE * np.diag(W)[normal].mean()
            self.springs = np.full(m, give)
            self._give_way(np.full(m * d, give))
        blocks = np.diagonal(W.reshape(m, d, m, d), axis1=0, axis2=2).transpose(2, 0, 1)
        softest = np.linalg.eigvalsh(blocks[:, 1:, 1:])[:, -1]
        self.resistance = Resistance(1.0 / blocks[:, 0, 0], 1.0 / softest)

    def _give_way(self, give: Array) -> None:
        """See all rows through springs of these compliances, and no others."""
        self._zones = Zones(self._zones.compliance.with_springs(give - self._give))
        self._give = give

    @property
    def points(self) -> PointSpace | None:
        """The dense problem of all points; None where they are seen through springs."""
        return self._zones.whole().space if self.springs is None else None

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        return self._zones.solve(conditions, load)

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs have no strain."""
        p = np.column_stack([normal_force, -tangential_force]).ravel()
        return replace(load, moved=load.moved - self._give * p)

    def in_series(self, C: Resistance) -> Seen:
        """The same problem with springs of the stiffness C in series with its points."""
        new, (m, t) = copy(self), self._places[1].shape
        new.springs = None
        soft = [1.0 / C.normal[:, None], np.broadcast_to(1.0 / C.tangential[:, None], (m, t))]
        new._give_way(np.column_stack(soft).ravel())
        return new


@dataclass(frozen=True)
class Places:
    """Contact points of which no more is known than where they are: no bodies, whose DOFs they move."""

    points: Array
    B_n: Any = None
    tangential: Any = None

    def __post_init__(self) -> None:
        m, d = self.points.shape
        object.__setattr__(self, "B_n", csr_matrix((m, 1)))
        object.__setattr__(self, "tangential", lambda: csr_matrix((m * (d - 1), 1)))

    @property
    def B_t(self) -> csr_matrix:
        """No DOF moves them."""
        return self.tangential()

    @property
    def tangents(self) -> int:
        """Along which friction acts."""
        return self.points.shape[1] - 1


def step_of(problem: Problem, seen: Seen, q: Array) -> tuple[Step, Guess]:
    """The load step of a problem with free velocities q, and the cold guess."""
    (m, d), none = q.shape, np.zeros(len(q), dtype=bool)
    load = Load(np.zeros(0), q[:, 0], q[:, 1:], np.zeros(0), (), np.zeros(m * d))
    zero, slip = np.zeros(m), np.zeros((m, d - 1))
    last = LocalState(none.astype(int), slip, slip, zero, slip, zero, zero + 1, *[zero] * 5)
    points = np.zeros((m, d))
    points[0] = np.abs(problem.q).max()  # the size of what gaps and slips are compared with
    kin = Places(points)
    law = CheckedLaw(sc.Coulomb(problem.mu), "contact", points)
    step = Step(
        problem=seen,
        load=load,
        motions=RigidMotions(np.zeros((1, 0)), kin, SimpleNamespace(n=1, D=none.nonzero()[0])),
        paired=~none,
        tied=none,
        bilateral=none,
        friction=FrictionRule(((slice(0, m), law),), zero + 1, slip),
        frictional=~none,
        stiffness=np.full(m, np.inf),
        last=last,
        rank=np.arange(m),
        resistance=seen.resistance if d == 3 else None,
    )
    status = np.where(q[:, 0] <= 0, STICK, OPEN)
    return step, Guess(status, slip, zero, slip, slip)


def newton(problem: Problem) -> tuple[Array, float, str]:
    """Forces (m, d), CPU time, and where the answer was found from.

    Some matrices are symmetric to three digits only; what takes W from being so is a change of q, from
    one answer to the next.
    """
    begin, seen = time.process_time(), Seen(problem)
    r, way, guess = np.zeros(problem.q.shape), "", None
    for _ in range(ROUNDS):
        q = problem.q + (problem.odd @ r.ravel()).reshape(r.shape)
        step, cold = step_of(problem, seen, q)
        found, start = solved(step, guess or cold)
        way = way or start
        if found is None:
            break
        there = found.iterate.response
        r = np.column_stack([there.normal_force, -there.tangential_force])
        if not found.converged or problem.error(r) <= GOAL:
            break  # else the same with another q
        guess = replace(after(step, found), near=True)
    return r, time.process_time() - begin, way


def solved(step: Step, guess: Guess) -> tuple[Outcome | None, str]:
    """The end of a loop, and its start, or why there is none; "none" where it has no answer."""
    loop, tolerance = LOOPS["newton"], sc.Options().tolerance
    try:
        found = drive(loop.iterates, step, guess, tolerance, loop.most, None, loop.patience)
        if found.converged:
            return found, "cold"
        found = proximal(step, guess, tolerance)[1]
    except (SingularMatrix, Collision) as error:
        return None, type(error).__name__
    return found, "proximal" if found.converged else "none"


def measured(problem: Problem, beside: bool) -> dict[str, Any]:
    """Errors and CPU times of one problem."""
    r, seconds, way = newton(problem)
    row = {"problem": problem.name, "contacts": len(problem.mu), "space": problem.q.shape[1] == 3}
    row |= {"rank": int(np.linalg.matrix_rank(problem.W.toarray())), "from": way}
    row["newton"] = {"error": problem.error(r), "seconds": seconds}
    if beside:
        r, seconds = gauss_seidel(problem.W, problem.q, problem.mu, problem.error, GOAL, PATIENCE)
        row["gauss_seidel"] = {"error": problem.error(r), "seconds": seconds}
    return row


def summary(rows: list[dict[str, Any]]) -> str:
    """The performance profile (Dolan and Moré, 2002) as a table in Markdown."""
    seconds = {name: [_seconds(row, name) for row in rows] for name in LABELS}
    best = np.min(list(seconds.values()), axis=0)
    lines = [
        "| | answered | " + " | ".join(f"within {t} times the best" for t in TIMES) + " | CPU seconds |"
    ]
    lines[0] = lines[0].replace("within 1 times the best", "quickest")
    lines.append("|" + " --- |" * (len(TIMES) + 3))
    for name, label in LABELS.items():
        own = np.array(seconds[name])
        found = np.isfinite(own)
        within = [np.count_nonzero(found & (own <= t * best)) for t in TIMES]
        both = np.sum([row[name]["seconds"] for row in rows])
        solved = np.sum(
            [row[name]["seconds"] for row, some in zip(rows, np.isfinite(best), strict=True) if some]
        )
        cells = [
            label,
            f"{found.sum()} of {len(rows)}",
            *within,
            f"{both:.1f}; {solved:.1f} without those that neither answers",
        ]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def _seconds(row: dict[str, Any], name: str) -> float:
    """CPU time of an answer; infinite where there is none."""
    return row[name]["seconds"] if row[name]["error"] <= GOAL else np.inf


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="problems whose names contain this; stores nothing")
    parser.add_argument("--alone", action="store_true", help="without Gauss-Seidel; stores nothing")
    asked = parser.parse_args()
    rows = []
    for path in sorted(asked.folder.iterdir()):
        problem = read(path) if path.suffix == ".dat" and asked.only in path.name else None
        if problem is None:
            continue
        row = measured(problem, not asked.alone)
        rows.append(row)
        words = [f"{row['problem']:32s} {row['contacts']:4d} {row['rank']:5d} {row['from']:10s}"]
        for name in LABELS:
            if name in row:
                words.append(f"{row[name]['error']:9.1e} {row[name]['seconds']:7.2f} s")
        print("  ".join(words), flush=True)
    if asked.alone:
        right = sum(row["newton"]["error"] <= GOAL for row in rows)
        seconds = sum(row["newton"]["seconds"] for row in rows)
        print(f"{right} of {len(rows)}, {seconds:.1f} s CPU")
        return
    print(summary(rows))
    if not asked.only:
        STORED.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
        write_into(Path(__file__).parents[1] / "docs" / "developers.md", summary(rows), MARKS)


if __name__ == "__main__":
    main()
