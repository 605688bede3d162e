"""What speed costs and what accuracy costs: error over CPU time on four problems, all settings.

    python benchmarks/trade.py            measures, stores results/trade.json, draws, writes the tables
    python benchmarks/trade.py --draw     draws what is stored and writes it into the docs
    python benchmarks/trade.py --quick    one round on coarse meshes, in seconds; prints only
    python benchmarks/trade.py --only linear   one axis of all problems beside the base; prints only

The problems are those of `problems.py`. Of each, one setting is the base; a row changes one thing
about it, and a front goes through mesh, elements and method. A time is the CPU time of the whole script
a user would write: meshes, assembly, pairing, condensation, loop, displacements. All settings take
turns, `ROUNDS` times, and the median counts; what takes longer than `LONG` seconds is run once.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy starts its threads

import json
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from problems import Answer, Setting, hertz, mindlin, raous, sliding

import skfem_contact as sc
from skfem_contact.answers.answer import answer_of

STORED = Path(__file__).parent / "results" / "trade.json"
ROUNDS, LONG, KINDS = 3, 2.0, ("P1", "Q1", "P2", "Q2")
QUICK, COARSE = ("method", "loop", "presets"), 4.5  # axes and mesh of --quick
Labelled = list[tuple[str, dict[str, Any]]]
Axes = dict[str, Labelled]


@dataclass(frozen=True)
class Problem:
    """One problem: its script, the base setting, and what is varied.

    Attributes
    ----------
    title, measure : str
        What it is, and what its error is.
    solve : callable
    base : Setting
    meshes : tuple of float
        `Setting.points` of the front.
    methods : tuple of str
        Those that differ.
    axes : dict
        By axis, labels and what they change about the base.
    """

    title: str
    measure: str
    solve: Callable[[Setting], Answer]
    base: Setting
    meshes: tuple[float, ...]
    methods: tuple[str, ...]
    axes: Axes


def among(name: str, *values: Any) -> Labelled:
    """Values of one setting, labelled by themselves."""
    return [(f"{v:g}" if isinstance(v, float) else str(v), {name: v}) for v in values]


def option(name: str, *values: float, **others: Any) -> Labelled:
    """Values of one of the `Options`."""
    also = "".join(f", {value}" for value in others.values())
    return [(f"{v:.0e}{also}", {"options": sc.Options(**{name: v}), **others}) for v in values]


PRESETS: Labelled = [
    ("fast", {"options": sc.Options.fast()}),
    ("balanced", {"options": sc.Options.balanced()}),
    ("accurate", {"options": sc.Options.accurate()}),
]
ALL_LINEAR = among("linear", "Direct()", "AMG()")
STIFFNESSES = among("G", 1.0, 1e2, 1e4, 1e6, 1e8)
FRICTIONAL: Axes = {
    "loop": among("loop", "direct", "fictitious"),
    "G over E": STIFFNESSES,
    "tolerance": option("tolerance", 1e-2, 1e-4, 1e-6, 1e-13)
    + option("tolerance", 1e-2, 1e-4, 1e-6, loop="fictitious")
    + option("tolerance", 1e-2, 1e-4, 1e-6, loop="direct"),
    "increments": among("increments", 5, 20),
    "linear": ALL_LINEAR,
    "presets": PRESETS,
}
NODE: Axes = {"method": among("method", "node")}
FOLLOW: Axes = {"sliding": among("sliding", "finite")}
PROBLEMS = {
    "hertz": Problem(
        "Hertz",
        "L2 error of the pressure against the closed form",
        hertz,
        Setting(),
        (8.5, 16.5, 32.5, 48.5),
        ("node", "mortar"),
        {
            **NODE,
            "loop": FRICTIONAL["loop"],
            "tolerance": option("tolerance", 1e-2, 1e-6, 1e-13),
            **FOLLOW,
            "linear": ALL_LINEAR,
            "presets": PRESETS,
        },
    ),
    "mindlin": Problem(
        "Cattaneo-Mindlin",
        "L2 error of the friction against the closed form",
        mindlin,
        Setting(),
        (8.5, 16.5, 32.5),
        ("node", "mortar"),
        {**NODE, **FRICTIONAL, **FOLLOW},
    ),
    "raous": Problem(
        "Raous' block",
        "rms error of the slip at five points against another program's finest mesh",
        raous,
        Setting(points=32),
        (8, 16, 32, 64),
        ("mortar",),
        {**NODE, **FRICTIONAL, **FOLLOW},
    ),
    "sliding": Problem(
        "Sliding history",
        "L2 error of pressure and friction against the closed forms, rms of three states",
        sliding,
        Setting(points=8.5, sliding="finite", increments=16),
        (4.5, 8.5, 16.5),
        ("node", "mortar"),
        {
            **NODE,
            "secondary": among("secondary", "block"),
            "sliding": [
                ("small", {"sliding": "small"}),
                ("small, block", {"sliding": "small", "secondary": "block"}),
            ],
            "placement_tolerance": option("placement_tolerance", 1e-1, 1e-2, 1e-3, 1e-5, 1e-6, 1e-8),
            "max_travel": [
                (f"{v:g}", {"options": sc.Options(max_travel=v)}) for v in (0.05, 0.1, np.inf)
            ],
            "increments": [
                *among("increments", 2, 4, 8, 32, 64),
                ("2, max_travel inf", {"increments": 2, "options": sc.Options(max_travel=np.inf)}),
            ],
            "loop": FRICTIONAL["loop"],
            "G over E": among("G", 1.0, 1e4, 1e8),
            "tolerance": option("tolerance", 1e-4, 1e-13)
            + option("tolerance", 1e-4, loop="fictitious"),
            "linear": among("linear", "Direct()"),
            "presets": PRESETS,
        },
    ),
}


# -- measuring ----------------------------------------------------------------------------------


def rows_of(problem: Problem, quick: bool = False) -> list[tuple[str, str, Setting]]:
    """Axis, label and setting of every row; the base is the first."""
    base = problem.base
    if quick:
        base = replace(base, points=COARSE, increments=min(base.increments, 4))
    rows = [("base", "", base)]
    for kind in ("Q1",) if quick else KINDS:
        for method in problem.methods:
            for points in (COARSE,) if quick else problem.meshes:
                setting = replace(base, kind=kind, method=method, points=points)
                rows.append(("front", f"{kind}, {method}, {points:g}", setting))
    for axis, values in problem.axes.items():
        if axis in QUICK or not quick:
            shown = values[:1] if quick and axis != "presets" else values
            rows += [(axis, label, replace(base, **changes)) for label, changes in shown]
    return rows


class Measured:
    """What has been measured of one setting of a problem."""

    def __init__(self, problem: Problem, setting: Setting) -> None:
        self.problem, self.setting = problem, setting
        self.seconds: list[float] = []
        self.found: dict[str, Any] = {}
        self.forces: np.ndarray | None = None

    def run(self) -> None:
        """Run the script once more, unless it takes long or has failed."""
        if "failed" in self.found or (self.seconds and self.seconds[0] > LONG):
            return
        start = time.process_time()
        try:
            answer = self.problem.solve(self.setting)
        except sc.ContactError as error:
            self.found = {"failed": f"{type(error).__name__}: {str(error).splitlines()[0][:200]}"}
            return
        self.seconds.append(time.process_time() - start)
        if not self.found:
            last = answer.results[-1]
            self.forces = answer.forces()
            self.found = {
                "error": answer.error(),
                "dofs": last.system.n,
                "iterations": sum(r.iterations for r in answer.results),
                "worst": last.certificate.worst,
                "placement": max(answer_of(r).mismatch for r in answer.results),
            }

    def compared(self, base: Measured) -> dict[str, Any]:
        """All numbers, with their ratios to the base."""
        if "failed" in self.found:
            return dict(self.found)
        median = float(np.median(self.seconds))
        same = self.setting.kind == base.setting.kind and self.setting.points == base.setting.points
        same = same and self.setting.secondary == base.setting.secondary
        assert self.forces is not None and base.forces is not None  # neither has failed
        return {
            **self.found,
            "seconds": self.seconds,
            "median": median,
            "time ratio": median / float(np.median(base.seconds)),
            "error ratio": self.found["error"] / base.found["error"],
            "moved": float(np.abs(self.forces - base.forces).max()) if same else None,
        }


def measure(quick: bool = False, only: str | None = None) -> dict[str, Any]:
    """Times and errors of all settings of all problems, or of one axis and the base."""
    wanted = {name: rows_of(problem, quick) for name, problem in PROBLEMS.items()}
    if only is not None:
        wanted = {
            name: [row for row in rows if row[0] in ("base", only)] for name, rows in wanted.items()
        }
    pool: dict[tuple[str, Setting], Measured] = {}
    for name, rows in wanted.items():
        for _, _, setting in rows:
            pool.setdefault((name, setting), Measured(PROBLEMS[name], setting))
    begin = time.process_time()
    for _round in range(1 if quick else ROUNDS):
        for number, ((name, _), measured) in enumerate(pool.items()):
            measured.run()
            if not quick and number % 12 == 0:  # the base of all ratios is measured more often
                pool[name, wanted[name][0][2]].run()
            if not quick:
                print(f"\r{name} {time.process_time() - begin:.0f} s  ", end="", flush=True)
    return {
        "machine": f"{platform.machine()}, Python {platform.python_version()}, one BLAS thread",
        "rounds": 1 if quick else ROUNDS,
        "cpu seconds": time.process_time() - begin,
        "problems": {
            name: {
                "title": PROBLEMS[name].title,
                "measure": PROBLEMS[name].measure,
                "rows": [
                    {"axis": axis, "label": label, "setting": words(setting)}
                    | pool[name, setting].compared(pool[name, rows[0][2]])
                    for axis, label, setting in rows
                ],
            }
            for name, rows in wanted.items()
        },
    }


def words(setting: Setting) -> dict[str, Any]:
    """A setting for JSON; of the options what is not the default."""
    out = {f.name: getattr(setting, f.name) for f in fields(setting) if f.name != "options"}
    usual = vars(sc.Options())
    changed = {k: v for k, v in vars(setting.options).items() if v != usual[k]}
    return out | {"options": {k: str(v) if v == np.inf else v for k, v in changed.items()}}


def main() -> None:
    """Measure, store, print, draw."""
    from trade_tables import show, write

    if "--quick" in sys.argv:
        show(measure(quick=True))
        return
    if "--only" in sys.argv:
        show(measure(only=sys.argv[sys.argv.index("--only") + 1]))
        return
    if "--draw" not in sys.argv:
        STORED.parent.mkdir(exist_ok=True)
        STORED.write_text(json.dumps(measure(), indent=1) + "\n", encoding="utf-8")
    from trade_plot import draw

    stored = json.loads(STORED.read_text(encoding="utf-8"))
    show(stored)
    write(stored)
    draw(stored)


if __name__ == "__main__":
    main()
