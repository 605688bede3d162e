"""Random whole problems through the solver, judged by trying every pattern of the contact points.

    OPENBLAS_NUM_THREADS=1 python benchmarks/fuzz.py --problems 10000 --seed 0

Geometry, angle, contrast of the stiffnesses, friction, loads, gaps, interference, support, moving
obstacles, meshes that match or not, caps and cohesion, loops and linear routes are drawn at random;
every problem is a history of up to three steps. An answer counts as right if it satisfies the
conditions of contact and friction, checked here with dense matrices, and as wrong otherwise. A
refusal counts as missed if some pattern would have been a solution, and not just on the edge.
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
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "verification"))

from enumeration import Problem, all_solutions, distance
from random_problems import random_scene

import skfem_contact as sc

HERE = Path(__file__).parent
SAME = 1e-7  # an answer and an enumerated solution, with contrasts of up to 1e8 between the bodies
RESIDUAL = 1e-4  # what is left of the conditions, over the largest force: more is wrong
DIGITS = 1e-7  # and more than this is inaccurate
MU = (0.0, 1e-6, 0.1, 0.3, 0.6, 1.0, 2.0, 5.0)
EDGE = 1e-9  # solutions as near as this to breaking an inequality may be refused
KINDS = (
    "right",
    "right, not enumerated",
    "right, after cuts",
    "right, few digits",
    "refused",
    "refused, on the edge",
    "missed",
    "missed without pivoting",
    "wrong",
    "crashed",
)


@dataclass(eq=False)
class Drawn:
    """One problem: the solver, its arrays, its steps, and what was drawn, in words."""

    solver: sc.ContactSolver
    problem: Problem
    points: np.ndarray  # the paired points
    steps: list[dict[str, Any]]
    words: dict[str, Any]


def draw(seed: int) -> Drawn:
    """The problem of a number."""
    rng = np.random.default_rng([seed, 77])
    mu = float(rng.choice(MU))
    large = rng.random() < 0.03
    floating = bool(rng.random() < 0.2)
    most = 9 if large else int(rng.choice([2, 3, 4, 5], p=[0.3, 0.4, 0.25, 0.05]))
    scene = random_scene(seed, mu, most, floating)
    scales = 10.0 ** rng.uniform(-4, 4, len(scene.bodies)) if rng.random() < 0.6 else np.ones(2)
    bodies = [
        sc.Body(b.basis, b.K * s, D=b.D, name=b.name)
        for b, s in zip(scene.bodies, scales, strict=False)
    ]
    secondary, primary = scene.surfaces
    secondary = bodies[0].surface(secondary.mesh_facets)
    if len(bodies) == 2:
        primary = bodies[1].surface(primary.mesh_facets)
    G = float(rng.choice([np.inf, np.inf, 3.0 * scales[0]]))
    law, caps = _law(rng, mu, G, scales[0])
    words = {
        "points": len(scene.order),
        "bodies": len(bodies),
        "floating": floating,
        "mu": mu,
        "scales": [float(s) for s in scales[: len(bodies)]],
        "G": G,
        "method": str(rng.choice(["mortar", "node"])),
        "loop": str(rng.choice(["newton", "direct"], p=[0.8, 0.2])),
        "linear": str(rng.choice(["auto", "sparse"], p=[0.85, 0.15])),
        "cuts": int(rng.choice([0, 6])),
        "law": {k: float(v) for k, v in caps.items()},
    }
    contact = sc.Contact(
        secondary, primary, friction=law, gap=scene.gap, method=words["method"], name="joint"
    )
    solver = sc.ContactSolver(
        bodies,
        contact,
        loop=words["loop"],
        linear=sc.Direct() if words["linear"] == "sparse" else "auto",
        options=sc.Options(max_cuts=words["cuts"]),
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
        mu,
        G,
        np.zeros(len(points)),
        np.zeros(len(points)),
        caps.get("cohesion", 0.0) * area,
        cap,
    )
    steps = [_step(rng, scene, unit, not scene.solver("newton").contacts[0].rigid) for _ in range(3)]
    return Drawn(solver, problem, points, steps[: int(rng.integers(2, 4))], words)


def _law(rng: Any, mu: float, G: float, scale: float) -> tuple[sc.Coulomb, dict[str, float]]:
    caps = {}
    if rng.random() < 0.2:
        caps["tau_max"] = scale * 10 ** rng.uniform(-4, -1)
    if rng.random() < 0.2:
        caps["cohesion"] = scale * 10 ** rng.uniform(-5, -2)
    return sc.Coulomb(mu, stiffness=G, **caps), caps


def _step(rng: Any, scene: Any, unit: np.ndarray, soft: bool) -> dict[str, Any]:
    """A load step, as the solver takes it; the loads of the scene in other shares."""
    f, x = scene.loads[int(rng.integers(2))]
    # without load, or pulled off, a floating body has no place of its own
    shares = [0.0, 1.0, -1.0, 3.0] if len(scene.problem.D) else [1.0, 1.0, 3.0]
    step = {"f": unit * f * rng.choice(shares), "x": x * rng.choice([0.0, 1.0, 1.0, 2.0])}
    if rng.random() < 0.2:
        step["interference"] = {"joint": float(0.02 * rng.standard_normal())}
    if not soft and rng.random() < 0.3:
        step["motion"] = {"joint": 0.02 * rng.standard_normal(2)}
    return step


def residual(p: Problem, u: np.ndarray, lam: np.ndarray, tau: np.ndarray, slip: np.ndarray) -> float:
    """Largest violation of equilibrium, Signorini and Coulomb, over the largest force."""
    free = np.setdiff1d(np.arange(len(u)), p.D)
    balance = p.K @ u - p.f - p.B_n.T @ lam + p.B_t.T @ tau
    parts = [np.abs(p.K) @ np.abs(u), np.abs(p.f), np.abs(lam), np.abs(tau)]
    force = max(float(np.max(part, initial=0.0)) for part in parts) or 1.0
    touched = np.abs(p.B_n).sum(axis=0)[free] > 0
    stiff = np.median(np.diag(p.K)[free][touched]) if touched.any() else 1.0
    gap = p.gap0 + p.B_n @ u
    plastic = slip - p.slip_before
    if np.isfinite(p.G):
        plastic = plastic - (tau - p.tau_before) / p.G
    length = float(max(np.abs(u).max(), np.abs(gap[np.isfinite(gap)]).max(initial=0.0)))
    none = (np.abs(lam) <= 1e-12 * force) & (np.abs(tau) <= 1e-12 * force)  # open, perhaps just
    open_ = none | (stiff * gap > 1e-9 * stiff * length) & (np.abs(lam) <= 1e-12 * force)
    room = np.where(open_, 0.0, np.minimum(p.mu * lam + p.cohesion, p.cap) - np.abs(tau))
    moves = np.where(open_, 0.0, stiff * plastic)
    errors = [
        np.abs(balance[free]) / force,
        np.minimum(lam / force, gap / (length or 1.0)),
        np.minimum(0.0, room) / force,
        np.minimum(np.maximum(room, 0.0) / force, np.abs(moves) / (stiff * length or 1.0)),
        np.minimum(0.0, np.sign(tau) * moves) / (stiff * length or 1.0) * (np.abs(tau) > 1e-9 * force),
        np.where(open_, tau, 0.0) / force,
        (u - p.x)[p.D] / (length or 1.0),
    ]
    return max(float(np.max(np.abs(e), initial=0.0)) for e in errors)


def judge(seed: int, show: bool = False) -> list[tuple[str, str]]:
    """What happened in every step of a problem: a kind of `KINDS`, and words."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", sc.ContactWarning)
        return _judge(seed, show)


def _judge(seed: int, show: bool) -> list[tuple[str, str]]:
    out: list[tuple[str, str]] = []
    try:
        drawn = draw(seed)
        p, before = drawn.problem, None
        shift = np.zeros(2)
        over = 0.0
        for number, step in enumerate(drawn.steps):
            shift = step.get("motion", {}).get("joint", shift)
            over = step.get("interference", {}).get("joint", over)
            kin = drawn.solver.kin
            gap0 = drawn.problem.gap0 - over - kin.normal[drawn.points] @ shift
            moved = kin.tangent[drawn.points, 0] @ shift  # slip by the obstacle alone, backwards
            p = replace(p, f=step["f"], x=np.where(np.isin(np.arange(len(p.x)), p.D), step["x"], 0.0))
            p = replace(p, gap0=gap0)
            same = replace(p, slip_before=p.slip_before + moved)
            known = all_solutions(same) if len(drawn.points) <= 5 else None
            name = f"seed {seed} step {number} {drawn.words}"
            try:
                result = next(drawn.solver.history([step], start=before))
            except (sc.NotConverged, sc.NoEquilibrium) as error:
                kind = type(error).__name__
                if len(str(error)) < 60 or (error.result is not None and error.result.converged):
                    out.append(("crashed", f"{name}: unclear {kind}: {error}"))
                best = max((s.margin for s in known or []), default=-np.inf)
                word = f"{name}: {kind}, {len(known or [])} known, margin {best:.1e}"
                kind = "missed" if best > EDGE else "refused, on the edge" if known else "refused"
                if kind == "missed" and drawn.words["linear"] == "sparse":
                    kind = "missed without pivoting"  # the complete method needs the dense matrix
                out.append((kind, word))
                break
            lam = result.normal_force[drawn.points]
            tau = -result.tangential_force[drawn.points, 0]
            slip = p.B_t @ result.u
            cut = ", step cut" in result.message
            # after cuts the start of the last substep is not known here
            left = 0.0 if cut else residual(same, result.u, lam, tau, slip)
            worst = max(left, result.certificate.worst)
            off = [distance(s, result.u, lam, tau) for s in known or []]
            near = min(off, default=np.inf)
            if show:
                print(
                    name, result.message, f"residual {left:.1e} certificate\n{result.certificate}", off
                )
                print("lam", lam, "tau", tau, "slip", slip - same.slip_before)
            if worst > RESIDUAL:
                out.append(
                    ("wrong", f"{name}: residual {left:.1e}, certificate {worst:.1e}, off {near:.1e}")
                )
                break
            kind = "right, after cuts" if cut else "right"
            if known is not None and not cut and near > SAME:
                kind = "right, not enumerated"
            if worst > DIGITS:
                kind = "right, few digits"
            out.append((kind, f"{name}: residual {left:.1e}, off {near:.1e}, {len(off)} known"))
            state = result.state
            p = replace(
                p,
                slip_before=state.slip[drawn.points, 0],
                tau_before=state.tangential_force[drawn.points, 0],
            )
            before = result
    except Exception:
        out.append(("crashed", f"seed {seed}: {traceback.format_exc()}"))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--problems", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="number of the first problem")
    parser.add_argument("--seconds", type=float, default=np.inf, help="stop after this time")
    parser.add_argument("--only", type=int, help="show one problem")
    parser.add_argument("--out", type=Path, default=HERE / "results" / "fuzz.json")
    options = parser.parse_args()
    if options.only is not None:
        for kind, words in judge(options.only, show=True):
            print(f"{kind}: {words}")
        return
    start, count, noted = time.perf_counter(), Counter(), []
    done = 0
    for seed in range(options.seed, options.seed + options.problems):
        for kind, words in judge(seed):
            count[kind] += 1
            if kind in (*KINDS[6:], KINDS[1], KINDS[3]):
                noted.append(f"{kind}: {words}")
        done += 1
        if time.perf_counter() - start > options.seconds:
            break
        if done % 500 == 0 or done == options.problems:
            _save(options, done, count, noted, start)
    _save(options, done, count, noted, start)


def _save(options: Any, done: int, count: Counter, noted: list[str], start: float) -> None:
    summary = {
        "problems": done,
        "seed": options.seed,
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
