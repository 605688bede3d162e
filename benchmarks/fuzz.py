"""Random whole problems through the solver, judged by trying every pattern of the contact points.

    OPENBLAS_NUM_THREADS=1 python benchmarks/fuzz.py --problems 10000 --seed 0 --jobs 2
    OPENBLAS_NUM_THREADS=1 python benchmarks/fuzz.py --problems 2000 --points 7 40 --jobs 2

Geometry, angle, contrast of the stiffnesses, friction, loads, gaps, interference, support, moving
obstacles, meshes that match or not, caps and cohesion, loops and linear routes are drawn at random;
every problem is a history of up to three steps. An answer counts as right if it satisfies the
conditions of contact and friction, checked here with dense matrices, and as wrong otherwise. With up
to six points all patterns are tried: a refusal counts as missed if one of them would have been a
solution, and not just on the edge. With more points (`--points`) the refusal of a held body counts
as missed, as it has an answer to every load, and that of a floating one as in order where statics
knows none: where no forces within the friction cones balance the load (linear programming).
`--only N` shows one problem.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "verification"))
sys.path.append(str(Path(__file__).parents[1] / "tests"))

from enumeration import Problem, all_solutions, distance
from random_problems import random_scene

import skfem_contact as sc
from skfem_contact.answers.answer import answer_of

HERE = Path(__file__).parent
STORED = [HERE / "results" / name for name in ("fuzz.json", "fuzz_large.json")]
PAGE = HERE.parent / "docs" / "checks" / "extremes.md"
BEGIN, END = "<!-- fuzz table: begin -->", "<!-- fuzz table: end -->"
SAME = 1e-7  # an answer and an enumerated solution, with contrasts of up to 1e8 between the bodies
RESIDUAL = 1e-4  # what is left of the conditions, over the largest force: more is wrong
DIGITS = 1e-7  # and more than this is inaccurate
MU = (0.0, 1e-6, 0.1, 0.3, 0.6, 1.0, 2.0, 5.0)
# Without load, or pulled off, a floating body has no place of its own.
HELD_SHARES, FLOATING_SHARES = [0.0, 1.0, -1.0, 3.0], [1.0, 1.0, 3.0]
MOST_ENUMERATED = 6  # points for which all patterns are tried
ROUND_OFF = (
    1e-8  # of the terms of K u are no scale: their own last digits, 1e-16, are below DIGITS of it
)
EDGE = 1e-9  # solutions as near as this to breaking an inequality may be refused
KINDS = (
    "right",
    "right, not enumerated",
    "right, after cuts",
    "right, few digits",
    "refused",
    "refused, on the edge",
    "refused, though statics would allow it",
    "missed",
    "wrong",
    "crashed",
)


@dataclass(eq=False)
class Drawn:
    """One problem: the solver, its arrays, its steps, and what was drawn."""

    solver: sc.ContactSolver
    problem: Problem
    points: np.ndarray  # the paired points
    steps: list[dict[str, Any]]
    choice: Choice


@dataclass(frozen=True)
class StepChoice:
    """What a load step takes of the loads of the scene, and what it adds."""

    load: int  # which of the two
    force: float  # in this share
    displacement: float
    interference: float | None = None
    motion: tuple[float, float] | None = None  # of a rigid obstacle


@dataclass(frozen=True)
class Choice:
    """One problem in numbers that can be drawn one by one."""

    seed: int  # of the geometry, supports, gaps and loads
    mu: float
    most: int  # points
    floating: bool
    scales: tuple[float, ...]  # of the stiffnesses of the bodies, as many as there are at least
    G: float  # over the scale of the secondary body
    caps: dict[str, float]  # the same
    method: str
    loop: str
    linear: str
    cuts: int
    steps: tuple[StepChoice, ...]
    fewest: int = 1

    @property
    def scene(self) -> Any:
        """Bodies, surfaces and loads."""
        return random_scene(self.seed, self.mu, self.most, self.floating, self.fewest)


def choose(seed: int, points: tuple[int, int] | None = None) -> Choice:
    """The problem of a number; with a range of points, one of so many."""
    rng = np.random.default_rng([seed, 77])
    mu = float(rng.choice(MU))
    large = rng.random() < 0.03
    floating = bool(rng.random() < 0.2)
    most = 9 if large else int(rng.choice([2, 3, 4, 5], p=[0.3, 0.4, 0.25, 0.05]))
    fewest, most = points or (1, most)
    scene = random_scene(seed, mu, most, floating, fewest)
    scales = 10.0 ** rng.uniform(-4, 4, len(scene.bodies)) if rng.random() < 0.6 else np.ones(2)
    G = float(rng.choice([np.inf, np.inf, 3.0]))
    caps = {}
    if rng.random() < 0.2:
        caps["tau_max"] = float(10 ** rng.uniform(-4, -1))
    if rng.random() < 0.2:
        caps["cohesion"] = float(10 ** rng.uniform(-5, -2))
    method = str(rng.choice(["mortar", "node"]))
    loop = str(rng.choice(["newton", "direct"], p=[0.8, 0.2]))
    linear = str(rng.choice(["auto", "sparse"], p=[0.85, 0.15]))
    cuts = int(rng.choice([0, 6]))
    rigid = len(scene.bodies) == 1
    steps = [_step(rng, len(scene.problem.D) > 0, rigid) for _ in range(3)]
    steps = steps[: int(rng.integers(2, 4))]
    return Choice(
        seed,
        mu,
        most,
        floating,
        tuple(float(s) for s in scales[: len(scene.bodies)]),
        G,
        caps,
        method,
        loop,
        linear,
        cuts,
        tuple(steps),
        fewest,
    )


def _step(rng: Any, held: bool, rigid: bool) -> StepChoice:
    load = int(rng.integers(2))
    force = float(rng.choice(HELD_SHARES if held else FLOATING_SHARES))
    displacement = float(rng.choice([0.0, 1.0, 1.0, 2.0]))
    interference = motion = None
    if rng.random() < 0.2:
        interference = float(0.02 * rng.standard_normal())
    if rigid and rng.random() < 0.3:
        motion = tuple(float(v) for v in 0.02 * rng.standard_normal(2))
    return StepChoice(load, force, displacement, interference, motion)


def build(choice: Choice) -> Drawn:
    """The solver of a problem, and the same problem as dense arrays."""
    scene, scales = choice.scene, choice.scales
    bodies = [
        sc.Body(b.basis, b.K * s, D=b.D, name=b.name)
        for b, s in zip(scene.bodies, scales, strict=False)
    ]
    secondary, primary = scene.surfaces
    secondary = bodies[0].surface(secondary.mesh_facets)
    if len(bodies) == 2:
        primary = bodies[1].surface(primary.mesh_facets)
    G = choice.G * scales[0]
    caps = {name: scales[0] * value for name, value in choice.caps.items()}
    law = sc.Coulomb(choice.mu, stiffness=G, **caps)
    contact = sc.Contact(
        secondary, primary, friction=law, gap=scene.gap, method=choice.method, name="joint"
    )
    solver = sc.ContactSolver(
        bodies,
        contact,
        loop=choice.loop,
        linear=sc.linalg.Direct() if choice.linear == "sparse" else "auto",
        options=sc.Options(max_cuts=choice.cuts),
    )
    kin = solver.kin
    points = np.flatnonzero(kin.paired)
    n, ends = solver.system.n, np.cumsum([0, *(b.n for b in bodies)])
    K, unit = np.zeros((n, n)), np.ones(n)
    for b, s, start, stop in zip(bodies, scales, ends[:-1], ends[1:], strict=False):
        K[start:stop, start:stop] = b.K.toarray()
        unit[start:stop] = s
    area = kin.area[points]
    cap = caps.get("tau_max", np.inf) * np.ones_like(area) * (area if "tau_max" in caps else 1.0)
    problem = Problem(
        K,
        np.zeros(n),
        scene.problem.D,
        np.zeros(n),
        kin.B_n.toarray()[points],
        kin.B_t.toarray()[points],
        kin.gap0[points],
        choice.mu,
        G,
        np.zeros(len(points)),
        np.zeros(len(points)),
        caps.get("cohesion", 0.0) * area,
        cap,
    )
    steps = []
    for step in choice.steps:
        f, x = scene.loads[step.load]
        load = {"f": unit * f * step.force, "x": x * step.displacement}
        if step.interference is not None:
            load["interference"] = {"joint": step.interference}
        if step.motion is not None:
            load["motion"] = {"joint": np.array(step.motion)}
        steps.append(load)
    return Drawn(solver, problem, points, steps, choice)


def _scale(size: float) -> float:
    """What to divide by: one, where there is nothing, or nothing that has digits."""
    return size if size > np.finfo(float).tiny else 1.0


def scales(
    p: Problem, u: np.ndarray, lam: np.ndarray, tau: np.ndarray, slip: np.ndarray
) -> tuple[float, float, float]:
    """What forces and lengths of an answer are measured by, and a stiffness of the contact points.

    Forces that act; not the terms that cancel in K u, which in a stiff body are any multiple of them
    and would hide what is wrong. Only where nothing acts their last digits are the scale, and those of
    the step's own motion, where a load is taken back. Of lengths too.
    """
    free = np.setdiff1d(np.arange(len(u)), p.D)
    touched = np.abs(p.B_n).sum(axis=0)[free] > 0
    stiff = np.median(np.diag(p.K)[free][touched]) if touched.any() else 1.0
    digits = ROUND_OFF * np.abs(slip - p.slip_before)
    gap = p.gap0 + p.B_n @ u
    terms = [ROUND_OFF * (np.abs(p.K) @ np.abs(u)), stiff * digits]
    forces = [np.abs(p.K @ u), np.abs(p.f), np.abs(lam), np.abs(tau), *terms]
    moves = [np.abs(u), np.abs(gap[np.isfinite(gap)]), digits]
    force, length = (
        max(float(np.max(part, initial=0.0)) for part in parts) for parts in (forces, moves)
    )
    return force, length, stiff


def residual(p: Problem, u: np.ndarray, lam: np.ndarray, tau: np.ndarray, slip: np.ndarray) -> float:
    """Largest violation of equilibrium, Signorini and Coulomb, over the largest force."""
    free = np.setdiff1d(np.arange(len(u)), p.D)
    balance = p.K @ u - p.f - p.B_n.T @ lam + p.B_t.T @ tau
    force, length, stiff = scales(p, u, lam, tau, slip)
    gap = p.gap0 + p.B_n @ u
    plastic = slip - p.slip_before
    if np.isfinite(p.G):
        plastic = plastic - (tau - p.tau_before) / p.G
    none = (np.abs(lam) <= 1e-12 * force) & (np.abs(tau) <= 1e-12 * force)  # open, perhaps just
    open_ = none | (stiff * gap > 1e-9 * stiff * length) & (np.abs(lam) <= 1e-12 * force)
    room = np.where(open_, 0.0, np.minimum(p.mu * lam + p.cohesion, p.cap) - np.abs(tau))
    moves = np.where(open_, 0.0, stiff * plastic)
    force, length, moved = _scale(force), _scale(length), _scale(stiff * _scale(length))
    errors = [
        np.abs(balance[free]) / force,
        np.minimum(lam / force, gap / length),
        np.minimum(0.0, room) / force,
        np.minimum(np.maximum(room, 0.0) / force, np.abs(moves) / moved),
        np.minimum(0.0, np.sign(tau) * moves) / moved * (np.abs(tau) > 1e-9 * force),
        np.where(open_, tau, 0.0) / force,
        (u - p.x)[p.D] / length,
    ]
    return max(float(np.max(np.abs(e), initial=0.0)) for e in errors)


def judge(
    problem: int | Choice, show: bool = False, points: tuple[int, int] | None = None
) -> list[tuple[str, str]]:
    """What happened in every step of a problem, or of its number: a kind of `KINDS`, and words."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", sc.ContactWarning)
        try:
            choice = choose(problem, points) if isinstance(problem, int) else problem
            return _judge(build(choice), show)
        except Exception:
            return [("crashed", f"{problem}: {traceback.format_exc()}")]


def _judge(drawn: Drawn, show: bool) -> list[tuple[str, str]]:
    out: list[tuple[str, str]] = []
    p, before, points = drawn.problem, None, drawn.points
    shift = np.zeros(2)
    over = 0.0
    for number, step in enumerate(drawn.steps):
        shift = step.get("motion", {}).get("joint", shift)
        over = step.get("interference", {}).get("joint", over)
        kin = drawn.solver.kin
        gap0 = drawn.problem.gap0 - over - kin.normal[points] @ shift
        moved = kin.tangent[points, 0] @ shift  # slip by the obstacle alone, backwards
        p = replace(p, f=step["f"], x=np.where(np.isin(np.arange(len(p.x)), p.D), step["x"], 0.0))
        p = replace(p, gap0=gap0)
        same = replace(p, slip_before=p.slip_before + moved)
        known = all_solutions(same) if len(points) <= MOST_ENUMERATED else None
        name = f"{drawn.choice} step {number}, {len(points)} points"
        try:
            result = next(drawn.solver.history([step], start=before))
        except (sc.errors.NotConverged, sc.errors.NoEquilibrium) as error:
            out.append(_refusal(error, known, same, name))
            break
        lam = result.normal_force[points]
        tau = -result.tangential_force[points, 0]
        slip = p.B_t @ result.u
        cut = ", step cut" in result.message
        # after cuts the start of the last substep is not known here
        left = 0.0 if cut else residual(same, result.u, lam, tau, slip)
        worst = max(left, result.certificate.worst)
        least = scales(same, result.u, lam, tau, slip)[:2]
        off = [distance(s, result.u, lam, tau, least) for s in known or []]
        near = min(off, default=np.inf)
        words = (
            f"{name}: residual {left:.1e}, certificate {worst:.1e}, off {near:.1e}, {len(off)} known"
        )
        if show:
            print(words, result, f"lam {lam} tau {tau} slip {slip - same.slip_before}", sep="\n")
        # G times a slip: the slip has eps of the displacements, so eps times G over K is lost (X2)
        softest = np.diag(p.K)[np.diag(p.K) > 0].min()
        lost = 1e-15 * p.G / softest if np.isfinite(p.G) else 0.0
        if worst > max(RESIDUAL, lost):
            out.append(("wrong", words))
            break
        kind = "right, after cuts" if cut else "right"
        if known is not None and not cut and near > SAME:
            kind = "right, not enumerated"
        if worst > DIGITS:
            kind = "right, few digits"
        out.append((kind, words))
        if known is not None and not cut and foretold_wrongly(result, known):
            out.append(("wrong", f"{words}, {result.uniqueness}"))
        state = answer_of(result).local
        p = replace(
            p,
            slip_before=state.slip[points, 0],
            tau_before=state.tangential_force[points, 0],
        )
        before = result
    return out


def _refusal(
    error: sc.errors.NotConverged | sc.errors.NoEquilibrium,
    known: list[Any] | None,
    p: Problem,
    name: str,
) -> tuple[str, str]:
    """Whether a refusal is in order, and words."""
    what = type(error).__name__
    if len(str(error)) < 60 or (error.result is not None and error.result.converged):
        return "crashed", f"{name}: unclear {what}: {error}"
    if known is None:  # held bodies have an answer to every load, whatever the friction
        if len(p.D) > 0:
            return "missed", f"{name}: {what}"
        feasible = balanced(p)
        kind = "refused, though statics would allow it" if feasible else "refused"
        return kind, f"{name}: {what}"
    best = max((s.margin for s in known), default=-np.inf)
    kind = "missed" if best > EDGE else "refused, on the edge" if known else "refused"
    return kind, f"{name}: {what}, {len(known)} known, margin {best:.1e}"


def balanced(p: Problem) -> bool:
    """Whether any forces within the friction cones balance the load of bodies that nothing holds."""
    free = null_space(p.K)
    m = len(p.B_n)
    bound = np.hstack([-p.mu * np.eye(m), np.eye(m)]), np.hstack([-p.mu * np.eye(m), -np.eye(m)])
    cap = np.broadcast_to(p.cap, m)
    balance = np.hstack([free.T @ p.B_n.T, -free.T @ p.B_t.T])
    size = _scale(float(np.abs(p.f).max()))
    found = linprog(
        np.zeros(2 * m),
        A_ub=np.vstack(bound),
        b_ub=np.tile(np.broadcast_to(p.cohesion, m), 2) / size,
        A_eq=balance,
        b_eq=-free.T @ p.f / size,
        bounds=[(0, None)] * m + [(-c, c) for c in cap / size],
    )
    return bool(found.status == 0)


def foretold_wrongly(result: Any, known: list[Any]) -> bool:
    """Whether an answer of index -1 is the only one, all of them being clear of their edges."""
    said = result.uniqueness
    if said is None or not said.held or said.index >= 0:
        return False
    return len(known) < 3 and min((s.margin for s in known), default=0.0) > 1e-6


def table(runs: list[dict[str, Any]]) -> str:
    """Stored runs side by side, as they stand in the documentation."""
    heads = [
        "2 to 9 points" if r["points"] is None else "{} to {} points".format(*r["points"]) for r in runs
    ]
    lines = ["| | " + " | ".join(heads) + " |", "| --- |" + " --- |" * len(runs)]
    for what in ("problems", "steps"):
        lines.append(f"| {what} | " + " | ".join(f"{r[what]:,}" for r in runs) + " |")
    for kind in KINDS:
        lines.append(f"| {kind} | " + " | ".join(f"{r['kinds'].get(kind, 0):,}" for r in runs) + " |")
    return "\n".join(lines)


def write_page() -> None:
    """Put the table of the stored runs into the documentation."""
    runs = [json.loads(path.read_text(encoding="utf-8")) for path in STORED]
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}\n{table(runs)}\n{END}{after}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--problems", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="number of the first problem")
    parser.add_argument("--points", type=int, nargs=2, help="least and most contact points")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--write", action="store_true", help="only put what is stored into the docs")
    parser.add_argument("--seconds", type=float, default=np.inf, help="stop after this time")
    parser.add_argument("--only", type=int, help="show one problem")
    parser.add_argument("--out", type=Path, help="by default results/fuzz.json or fuzz_large.json")
    options = parser.parse_args()
    if options.write:
        write_page()
        return
    points = None if options.points is None else tuple(options.points)
    if options.out is None:
        options.out = STORED[points is not None]
    if options.only is not None:
        for kind, words in judge(options.only, show=True, points=points):
            print(f"{kind}: {words}")
        return
    start, count, noted = time.perf_counter(), Counter(), []
    done = 0
    seeds = range(options.seed, options.seed + options.problems)
    with Pool(options.jobs) as pool:
        for found in pool.imap(partial(judge, points=points), seeds, chunksize=10):
            for kind, words in found:
                count[kind] += 1
                if kind in (*KINDS[6:], KINDS[1], KINDS[3]):
                    noted.append(f"{kind}: {words}")
            done += 1
            if time.perf_counter() - start > options.seconds:
                break
            if done % 500 == 0:
                _save(options, done, count, noted, start)
    _save(options, done, count, noted, start)


def _save(options: Any, done: int, count: Counter, noted: list[str], start: float) -> None:
    summary = {
        "problems": done,
        "seed": options.seed,
        "points": options.points,
        "steps": sum(count.values()),
        "kinds": {kind: count[kind] for kind in KINDS},
        "seconds": round(time.perf_counter() - start),
        "version": sc.__version__,
        "noted": noted,
    }
    options.out.parent.mkdir(exist_ok=True)
    options.out.write_text(json.dumps(summary, indent=1) + "\n")
    print(done, dict(count), flush=True)


if __name__ == "__main__":
    main()
