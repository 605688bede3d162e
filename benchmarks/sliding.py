"""Dragging at 100 000 DOFs: 200 increments of finite sliding against one linear solve.

A block is pressed onto a longer one and dragged over 40 of its facets, in 200 increments; both are
meshes of Q1 elements with some 100 000 DOFs together. The yardstick is one linear solve of the same
two meshes glued where they stand (``tied=True``), with the best of this library's own backends, and
with ``skfem.solve`` (SuperLU) on the same matrix.

Run ``OPENBLAS_NUM_THREADS=1 python benchmarks/sliding.py [increments] [dofs]``. With 200 increments it
stores results/sliding.json and writes a table of docs/checks/performance.md.
"""

from __future__ import annotations

import itertools
import json
import platform
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import skfem as fem
from run import write_into
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.answers.answer import answer_of

ELEMENT = fem.ElementVector(fem.ElementQuad1())
E, MU, PRESS = 1e3, 0.3, 1e-3
STORED = Path(__file__).parent / "results" / "sliding.json"
MARKS = "<!-- sliding table: begin -->", "<!-- sliding table: end -->"
METHODS = {"node": "node by node", "mortar": "mortar"}
PRESETS = {
    "balanced": ("", sc.Options.balanced()),
    "fast": (", `Options.fast()`", sc.Options.fast()),
    "placement_tolerance 1e-6": (
        ", `Options(placement_tolerance=1e-6)`",
        sc.Options(placement_tolerance=1e-6),
    ),
    "accurate": (", `Options.accurate()`", sc.Options.accurate()),
}


def bodies(dofs: float) -> tuple[sc.Body, sc.Body, float]:
    """A block (1 x 1) on a track (3 x 1), and the facet length of the block."""
    n = round(np.sqrt(dofs / 8))
    elastic = linear_elasticity(*lame_parameters(E, 0.3))

    def rectangle(x: np.ndarray, y: np.ndarray) -> fem.Basis:
        return fem.Basis(fem.MeshQuad.init_tensor(x, y).with_defaults(), ELEMENT, intorder=2)

    upper = rectangle(np.linspace(0.5, 1.5, n + 1), np.linspace(0, 1, n + 1))
    # not the same spacing: nodes meet facets anywhere
    lower = rectangle(np.linspace(0, 3, round(2.9 * n) + 1), np.linspace(-1, 0, n + 1))
    held = upper.get_dofs("top")
    move, press = np.zeros((2, upper.N))
    move[held.nodal["u^1"]], press[held.nodal["u^2"]] = 1.0, -PRESS
    block = sc.Body(upper, elastic, D=held, x=press, name="block")
    block.__dict__["drag"] = move
    track = sc.Body(lower, elastic, D="bottom", name="track")
    return block, track, 1.0 / n


def linear_solve(block: sc.Body, track: sc.Body) -> dict[str, float]:
    """Seconds of the processor for one solve of the glued bodies, without assembly, by backend."""
    system = sc.bodies.stack([block, track])
    tie = sc.Contact(block.surface("bottom"), track.surface("top"), tied=True)
    rows = sc.elimination.contact_rows(system, tie)
    seconds = {}
    for name in ("skfem.solve", "own"):
        begin = time.process_time()
        if name == "own":
            sc.ContactSolver([block, track], tie).solve().u  # noqa: B018 (recovers the interior)
        else:
            fem.solve(*sc.elimination.condense(system.K, system.f, rows=rows, D=system.D, x=system.x))
        seconds[name] = time.process_time() - begin
    return seconds


def drag(
    block: sc.Body, track: sc.Body, h: float, increments: int, method: str, options: sc.Options
) -> dict[str, float]:
    """Seconds of the processor for a whole history, set-up included, and what it did."""
    begin = time.process_time()
    contact = sc.Contact(
        block.surface("bottom"),
        track.surface("top"),
        friction=sc.Coulomb(MU),
        sliding="finite",
        method=method,
    )
    solver = sc.ContactSolver([block, track], contact, options=options)
    down = block.x
    path = np.linspace(0, 40 * h, increments + 1)[1:]
    results = list(solver.history({"x": {"block": down + s * block.__dict__["drag"]}} for s in path))
    seconds = time.process_time() - begin
    force = results[-1].force
    return {
        "seconds": seconds,
        "iterations": sum(r.iterations for r in results),
        "substeps": sum(1 + int("cut" in r.message) for r in results),
        "friction over normal force": -force[0] / force[1],
        "placement": max(answer_of(r).mismatch for r in results),
        **{f"timing {k}": v for k, v in solver.timings.items()},
    }


def table(found: dict[str, Any]) -> str:
    """The table in Markdown."""
    linear = found["linear"]
    lines = [
        "| | seconds | over `skfem.solve` | over the own solver |",
        "| --- | --- | --- | --- |",
        f"| one linear solve of the glued meshes, `skfem.solve` | {linear['skfem.solve']:.1f} | 1 | |",
        f"| the same with this library's condensation | {linear['own']:.1f} | | 1 |",
    ]
    for preset, (words, _) in PRESETS.items():
        for method, name in METHODS.items():
            run = found[f"{method}, {preset}"]
            name = f"{found['increments']} increments, {name}" if not words else name + words
            ratios = f"{run['over skfem.solve']:.1f} | {run['over own']:.1f}"
            lines.append(f"| {name} | {run['seconds']:.1f} | {ratios} |")
    return "\n".join(lines)


def main() -> None:
    increments = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    dofs = float(sys.argv[2]) if len(sys.argv) > 2 else 1e5
    block, track, h = bodies(dofs)
    print(f"{block.n + track.n} DOFs, {increments} increments")
    linear = linear_solve(block, track)
    found: dict[str, Any] = {
        "dofs": block.n + track.n,
        "increments": increments,
        "linear": linear,
        "machine": f"{platform.machine()}, Python {platform.python_version()}",
    }
    for name, seconds in linear.items():
        print(f"one linear solve, {name:12s} {seconds:8.2f} s")
    for method, preset in itertools.product(METHODS, PRESETS):
        run = drag(block, track, h, increments, method, PRESETS[preset][1])
        run |= {f"over {name}": run["seconds"] / seconds for name, seconds in linear.items()}
        name = f"{method}, {preset}"
        found[name] = run
        print(
            f"dragging, {name:32s} {run['seconds']:8.2f} s = "
            + ", ".join(f"{run['seconds'] / s:.1f} x {name}" for name, s in linear.items())
        )
        print("   ", {k: round(v, 6) for k, v in run.items()})
    if increments == 200:
        STORED.parent.mkdir(exist_ok=True)
        STORED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        write_into(
            Path(__file__).parents[1] / "docs" / "checks" / "performance.md", table(found), MARKS
        )


if __name__ == "__main__":
    main()
