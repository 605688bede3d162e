"""A judge from outside in 3-D: random scenes of solids, measured without the library's operators.

    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_solids.py --scenes 500 --write
    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_solids.py --only 17

Two to four bodies of `solid_scenes`, two to four load steps. Each answer is checked in equilibrium,
balance, friction and overlap (`solid_checks`), against an own solution where there is no friction
(`solid_oracle`), and compared with the same scene in another order, direction, numbering, by another
route and another loop (two of these, drawn by the scene's number).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from solid_checks import Answer, Court, Told
from solid_oracle import against_oracle
from solid_scenes import GIVEN, Scene, Way, build, make, scene, turned

import skfem_contact as sc

HERE = Path(__file__).parent
STORED = HERE / "results" / "judge_solids.json"
PAGE = HERE.parent / "docs" / "judge.md"
BEGIN, END = "<!-- solids table: begin -->", "<!-- solids table: end -->"
KINDS = ("right", "warned", "refused with reason", "not converged", "not open yet", "WRONG")
SAME = 1e-7  # of the largest force: round-off, times what contrasts of 1e6 and springs make of it


@dataclass(frozen=True)
class Verdict:
    """What became of one scene."""

    seed: int
    kind: str
    words: tuple[str, ...]
    seconds: float
    steps: int
    dofs: int


@dataclass(frozen=True, eq=False)
class Run:
    """The answers of a scene along one way, and what stopped it."""

    answers: list[Answer]
    error: Exception | None
    warned: tuple[str, ...]


def run(s: Scene, way: Way = GIVEN, made: Any = None) -> Run:
    """Hand a scene to the library and read what it reports, in the scene's own directions."""
    t = turned(s, way.turn)
    made = make(t, way.shuffle) if made is None else made
    answers: list[Answer] = []
    error = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            solver, steps = build(t, made, way)
            for result in solver.history(steps):
                answers.append(read(s, result))
        except Exception as e:
            error = e
    return Run(answers, error, tuple(sorted({str(w.message) for w in caught})))


def read(s: Scene, result: Any) -> Answer:
    """What a user reads off a result."""
    contacts = {}
    for spec in s.contacts:
        v = result[spec.name]
        contacts[spec.name] = Told(
            *(
                np.array(a)
                for a in (v.points, v.forces, v.normal, v.normal_force, v.area, v.gap, v.status)
            ),
            np.array(v.force),
            np.array(v.moment()),
            float(v.dissipation),
        )
    return Answer({b.name: np.array(result.displacement(b.name)) for b in s.bodies}, contacts)


def judge(given: int | Scene, friction: bool = True) -> Verdict:
    """The verdict on a scene, or on that of a number."""
    start = time.process_time()
    s = scene(given, friction) if isinstance(given, int) else given
    steps = dofs = 0
    try:
        made = make(s)
        dofs = sum(int(m.basis.N) for m in made.values())
        first = run(s, made=made)
        steps = len(first.answers)
        kind, words = weigh(s, made, first)
    except Exception:
        kind, words = "WRONG", [f"the judge fails: {traceback.format_exc()}"]
    return Verdict(s.seed, kind, tuple(words), time.process_time() - start, steps, dofs)


def weigh(s: Scene, made: Any, first: Run) -> tuple[str, list[str]]:
    """All that is asked of a run."""
    words = []
    kind = "warned" if first.warned else "right"
    if first.error is not None:
        text = f"step {len(first.answers)}: {type(first.error).__name__}: {str(first.error)[:300]}"
        kind = "refused with reason"
        if "not implemented yet" in text:
            kind = "not open yet"
        elif isinstance(first.error, sc.NotConverged) or "is not shown" in text:
            kind = "not converged"
        elif not isinstance(first.error, sc.ContactError):
            kind = "WRONG"
        words.append(text)
    if not first.answers:
        return kind, words
    findings = Court(s, made).examine(first.answers)
    excused = bool(first.warned)
    hard = [f for f in findings if not (f.geometric and excused)]
    words += [f"{f.check}, step {f.step}: {f.words}" for f in findings]
    words += (off := against_oracle(s, made, first.answers))
    words += (apart := compare(s, made, first))
    if hard or off or apart:
        kind = "WRONG"
    return kind, [*words, *first.warned]


def ways(s: Scene) -> dict[str, Way]:
    """Other ways to the same answer."""
    n, m = len(s.bodies), len(s.contacts)
    rng = np.random.default_rng([s.seed, 3])
    out = {
        "order": Way(tuple(range(n))[::-1], tuple(int(i) for i in rng.permutation(m)), shuffle=0),
        "numbering": Way(shuffle=1),
        "turned": Way(turn=1),
        "Direct()": Way(linear="direct"),
        "loop direct": Way(loop="direct"),
    }
    names = rng.permutation(list(out))[:2]
    return {str(name): out[str(name)] for name in names}


def compare(s: Scene, made: Any, first: Run) -> list[str]:
    """The same scene on other ways."""
    out = []
    for name, way in ways(s).items():
        second = run(s, way)
        T = turned(s, way.turn).R @ s.R.T
        if type(first.error) is not type(second.error) or len(first.answers) != len(second.answers):
            out.append(
                f"{name}: {len(first.answers)} steps, {first.error!r:.150} against "
                f"{len(second.answers)}, {second.error!r:.150}"
            )
            continue
        court = Court(s, made)
        most = max(float(np.abs(t.forces).sum()) for a in first.answers for t in a.contacts.values())
        most = max([most, *(court.least(a) for a in first.answers)])
        for k, (a, b) in enumerate(zip(first.answers, second.answers, strict=True)):
            off = {
                n: float(np.abs(t.force - b.contacts[n].force @ T).max()) for n, t in a.contacts.items()
            }
            worst = max(off, key=lambda n: off[n])
            if off[worst] > SAME * most:
                out.append(
                    f"{name}: step {k}: {worst} differs by {off[worst] / most:.1e} of the forces"
                )
                break
        if bool(first.warned) != bool(second.warned):
            out.append(f"{name}: warned {len(first.warned)} times against {len(second.warned)}")
    return out


def describe(s: Scene) -> str:
    """A scene in words."""
    lines = [f"scene {s.seed}: size {s.size:.3g}, unit {s.unit:.3g}, drive {s.drive}, turn {s.turn}"]
    lines += [f"  {b}" for b in s.bodies]
    lines += [f"  {c}" for c in s.contacts]
    return "\n".join([*lines, f"  steps {s.steps}"])


def table(stored: dict[str, Any]) -> str:
    """A stored run as it stands in the documentation."""
    lines = ["| | scenes |", "| --- | --- |", f"| judged | {stored['scenes']:,} |"]
    lines += [f"| {kind} | {n:,} |" for kind, n in stored["kinds"].items() if n or kind == "WRONG"]
    if "judged again" in stored:
        lines.append(f"| of these judged again after mending | {stored['judged again']:,} |")
    return "\n".join([*lines, f"| load steps | {stored['steps']:,} |"])


def write_page() -> None:
    """Put the table of the stored run into the documentation."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    PAGE.write_text(f"{before}{BEGIN}\n{table(stored)}\n{END}{after}", encoding="utf-8")


def again() -> None:
    """Judge once more what the stored run calls WRONG, after library or judge have been mended."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    for i, known in enumerate(stored["noted"]):
        if known["kind"] != "WRONG":
            continue
        new = judge(known["seed"], stored["friction"])
        print(f"{new.seed}: {new.kind}: {' | '.join(new.words)[:300]}", flush=True)
        stored["kinds"]["WRONG"] -= 1
        stored["kinds"][new.kind] += 1
        stored["noted"][i] = asdict(new)
        stored["judged again"] = stored.get("judged again", 0) + 1
    stored["noted"] = [v for v in stored["noted"] if v["kind"] not in ("right", "refused with reason")]
    store(stored)


def store(stored: dict[str, Any]) -> None:
    """Store a run, and put it into the documentation."""
    STORED.write_text(json.dumps(stored, indent=1, default=int) + "\n", encoding="utf-8")
    write_page()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0, help="number of the first scene")
    parser.add_argument("--smooth", action="store_true", help="without friction")
    parser.add_argument("--only", type=int, help="show one scene")
    parser.add_argument(
        "--again", action="store_true", help="the scenes that the stored run calls WRONG"
    )
    parser.add_argument("--write", action="store_true", help="store the run, and put it into the docs")
    options = parser.parse_args()
    if options.only is not None:
        print(describe(scene(options.only, not options.smooth)))
        print(judge(options.only, not options.smooth))
        return
    if options.again:
        again()
        return
    verdicts = []
    for seed in range(options.seed, options.seed + options.scenes):
        verdicts.append(v := judge(seed, not options.smooth))
        if v.kind in ("WRONG", "not converged"):
            print(f"{v.seed}: {v.kind}: {' | '.join(v.words)[:900]}", flush=True)
    stored = {
        "scenes": len(verdicts),
        "seed": options.seed,
        "friction": not options.smooth,
        "kinds": {kind: sum(v.kind == kind for v in verdicts) for kind in KINDS},
        "steps": sum(v.steps for v in verdicts),
        "seconds": round(sum(v.seconds for v in verdicts)),
        "version": sc.__version__,
        "noted": [asdict(v) for v in verdicts if v.kind not in ("right", "refused with reason")],
    }
    print({k: v for k, v in stored.items() if k != "noted"})
    if options.write:
        store(stored)


if __name__ == "__main__":
    main()
