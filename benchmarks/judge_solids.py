"""A judge from outside in 3-D: random scenes of solids, measured without the library's operators.

    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_solids.py --scenes 500 --write
    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_solids.py --seed 500 --scenes 100 --write
    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_solids.py --only 17

The second line adds scenes to a stored run. Two to four bodies of `solid_scenes`, two to four load
steps. Each answer is checked in equilibrium, balance, friction and overlap (`solid_checks`), against
an own solution where there is no friction (`solid_oracle`), and compared with the same scene in
another order, direction, numbering, by another route and another loop (two of these, drawn by the
scene's number).
"""

from __future__ import annotations

import argparse
import json
import re
import signal
import sys
import time
import traceback
import warnings
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from solid_checks import Answer, Court, Finding, Told
from solid_friction import rubbing
from solid_oracle import against_oracle
from solid_scenes import GIVEN, Scene, Way, build, law, make, scene, turned
from solid_statics import feasible

import skfem_contact as sc

HERE = Path(__file__).parent
STORED = HERE / "results" / "judge_solids.json"
PAGE = HERE.parent / "docs" / "checks" / "judge.md"
BEGIN, END = "<!-- solids table: begin -->", "<!-- solids table: end -->"
KINDS = (
    "right",
    "warned",
    "several answers",
    "refused with reason",
    "refused though feasible",
    "not judged",
    "WRONG",
)
REFUSALS = (sc.errors.NoEquilibrium, sc.errors.NotConverged, sc.errors.SingularMatrix)
SAME = 1e-7  # of the largest force: round-off, times what contrasts of 1e6 and springs make of it
METHODS = 0.5  # of a force: what mortar and node to face may differ by on meshes of 1 to 4 faces a side
EVERY = 6  # scene is solved by both methods
RISE = 1e3  # friction over the normal force, in place of friction that jumps
LONGEST = 60.0  # CPU seconds for a scene and its comparisons
SEVERAL = 1.0  # a coefficient from which several answers are no surprise, each of them judged


class TooLong(BaseException):
    """A scene has taken more than `LONGEST`; no library's `except` may swallow it."""


def _too_long(*_: Any) -> None:
    raise TooLong


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
    return Answer(
        {b.name: np.array(result.displacement(b.name)) for b in s.bodies},
        contacts,
        result.message,
        {name: tuple(np.array(v) for v in result.motion(name)) for name, _ in s.rigid},
        bool(result.indifferent),
    )


def judge(given: int | Scene, friction: bool = True, grain: bool = False) -> Verdict:
    """The verdict on a scene, or on that of a number."""
    start = time.process_time()
    s = scene(given, friction, grain) if isinstance(given, int) else given
    steps = dofs = 0
    signal.signal(signal.SIGPROF, _too_long)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        made = make(s)
        dofs = sum(int(m.basis.N) for m in made.values())
        first = run(s, made=made)
        steps = len(first.answers)
        kind, words = weigh(s, made, first)
    except TooLong:
        kind, words = "not judged", [f"stopped after {LONGEST} s"]
    except Exception:
        kind, words = "WRONG", [f"the judge fails: {traceback.format_exc()}"]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return Verdict(s.seed, kind, tuple(words), time.process_time() - start, steps, dofs)


def examine(court: Court, answers: list[Answer]) -> list[Finding]:
    """All findings on the answers of a history."""
    out: list[Finding] = []
    before = None
    for k, a in enumerate(answers):
        R, noise = court.felt(k, a)
        out += court.examine(k, a, before, R, noise)
        for c in court.s.contacts:
            out += rubbing(court, k, a, before, c, R, noise)
        before = a
    return out


def weigh(s: Scene, made: Any, first: Run) -> tuple[str, list[str]]:
    """All that is asked of a run."""
    words = []
    kind = "warned" if first.warned else "right"
    court = Court(s, made)
    if first.error is not None:
        kind, why = refusal(court, first)
        words.append(why)
    if not first.answers:
        return kind, words
    findings = examine(court, first.answers)
    hard = [f for f in findings if not excuses(first.warned, f)]
    words += [f"{f.check}, step {f.step}: {f.words}" for f in findings]
    words += (off := against_oracle(s, made, first.answers))
    apart = compare(court, first)
    words += [text for _, text in apart]
    kinds = [name for name, _ in apart]
    if hard or off or "WRONG" in kinds:
        kind = "WRONG"
    elif kinds:
        kind = kinds[0]
    return kind, [*words, *first.warned]


def excuses(warned: tuple[str, ...], finding: Finding) -> bool:
    """Whether the user was told that a contact's gaps are not those of the deformed bodies."""
    if not finding.geometric:
        return False
    name = finding.words.partition(":")[0]
    about = [re.findall(r"[Cc]ontact '([^']*)'", text) for text in warned]
    return any(name in names or not names for names in about)


def refusal(court: Court, found: Run) -> tuple[str, str]:
    """Whether a refusal is in order."""
    error, k = found.error, len(found.answers)
    text = f"step {k}: {type(error).__name__}: {str(error)[:400]}"
    if not isinstance(error, sc.ContactError):
        return "WRONG", f"raw exception, {text}"
    if not isinstance(error, REFUSALS):
        return "refused with reason", text
    if court.s.jumps and stateless(court, k):
        return (
            "refused with reason",
            f"{text} (a bound that begins at zero has an answer, this one none)",
        )
    rests = feasible(court, k)
    if rests:
        return "refused though feasible", text
    return "refused with reason", text if rests is False else f"{text} (statics not decided)"


def stateless(court: Court, k: int) -> bool:
    """Whether friction that jumps has no state in a step where friction that rises steeply has one.

    The answer with the latter is one with the former unless points slip under a part of its bound.
    """
    s = replace(court.s, rise=RISE)
    answers = run(s, made=court.made).answers
    if len(answers) <= k:
        return False
    for c in s.contacts:
        told, full = answers[k].contacts[c.name], law(court.s, c)
        if full is None:
            continue
        bound = full.limit(told.normal_force, told.area, np.zeros((len(told.area), 2)))
        short = (told.status == 2) & (RISE * told.normal_force < (1 - SAME) * bound)
        if short.any():
            return True
    return False


def ways(s: Scene) -> dict[str, Way]:
    """Other ways to the same answer."""
    n, m = len(s.bodies), len(s.contacts)
    rng = np.random.default_rng([s.seed, 3])
    out = {
        "order": Way(tuple(range(n))[::-1], tuple(int(i) for i in rng.permutation(m)), shuffle=0),
        "numbering": Way(shuffle=1),
        "turned": Way(turn=1),
        "Direct()": Way(linear="direct"),
    }
    rubs = [c for c in s.contacts if c.friction]
    if not rubs:
        out["loop direct"] = Way(loop="direct")
    else:
        out |= {"proximal": Way(start="proximal"), "iterated": Way(linear="iterated")}
    if rubs and all(c.G is not None for c in rubs):  # the other loops stick with a stiffness
        out |= {"loop direct": Way(loop="direct"), "loop fictitious": Way(loop="fictitious")}
    if "loop fictitious" in out and s.seed % 3:  # thousands of iterations
        del out["loop fictitious"]
    count = 1 if s.seed % 2 or s.finite else 2
    names = [name for name in ("loop direct", "loop fictitious") if rubs and name in out]
    names = [*names, *(str(name) for name in rng.permutation(list(out)) if name not in names)][:count]
    return {name: out[name] for name in names}


def compare(court: Court, first: Run) -> list[tuple[str, str]]:
    """The same scene on other ways: what that makes of it, and why."""
    s, made, out = court.s, court.made, []
    for name, way in ways(s).items():
        second = run(s, way, None if way.turn or way.shuffle else made)
        out += [(kind, f"{name}: {text}") for kind, text in against(court, first, second, way)]
    linear = {c.method for c in s.contacts if c.primary and not c.tied}
    if s.seed % EVERY == 0 and linear and not first.warned and first.error is None:
        out += [("WRONG", text) for text in compare_methods(s, made, first)]
    return out


def against(court: Court, first: Run, second: Run, way: Way) -> list[tuple[str, str]]:
    """How a run is another one."""
    s = court.s
    T = turned(s, way.turn).R @ s.R.T
    if way.start and second.error is not None:
        return []  # it was kept from the ways that would have found the answer
    refused = [isinstance(r.error, REFUSALS) for r in (first, second)]
    both = type(first.error) is type(second.error) or all(refused)
    if not both or len(first.answers) != len(second.answers):
        text = (
            f"{len(first.answers)} steps, {first.error!r:.250} against "
            f"{len(second.answers)}, {second.error!r:.250}"
        )
        ends = [r.error is None or one for r, one in zip((first, second), refused, strict=True)]
        found = examine(court, second.answers) if not second.warned and not way.turn else []
        alone = all(ends) and not [f for f in found if not f.geometric]
        return [("refused though feasible" if alone else "WRONG", text)]
    most = max(float(np.abs(t.forces).sum()) for a in first.answers for t in a.contacts.values())
    most = max([most, *(court.least(a) for a in first.answers)])
    same = SAME + court.settled * 10
    for k, (a, b) in enumerate(zip(first.answers, second.answers, strict=True)):
        if a.cut or b.cut:
            break  # friction follows the way through the step
        off = {
            group: float(
                np.abs(sum(a.contacts[n].force - b.contacts[n].force @ T for n in group)).max()
            )
            for group in court.groups
        }
        worst = max(off, key=lambda n: off[n])
        if off[worst] > same * most:
            text = f"step {k}: {'+'.join(worst)} differs by {off[worst] / most:.1e} of the forces"
            told = {answer.message for answer in (a, b)}
            several = (s.mu >= SEVERAL or s.jumps) and not way.turn
            right = not [f for f in examine(court, second.answers) if not f.geometric]
            if several and right and reported(s, way, k) and reported(s, GIVEN, k):
                return [("several answers", f"{text}; {told}")]
            return [("WRONG", f"{text}; {told}")]
    if bool(first.warned) != bool(second.warned) and not s.finite:
        return [("WRONG", f"warned {len(first.warned)} times against {len(second.warned)}")]
    return []


def reported(s: Scene, way: Way, k: int) -> bool:
    """Whether the report of a step says that there may be other answers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solver, steps = build(s, make(s, way.shuffle), way)
        *_, result = solver.history(steps[: k + 1])
        text = result.report()
    told = ["may have other answers", "may have several answers", "at least two other answers"]
    if s.mu >= SEVERAL:  # which large coefficients have several is not known of all contacts
        told.append("whether this load has other answers is not")
    return any(words in text for words in told)


def compare_methods(s: Scene, made: Any, first: Run) -> list[str]:
    """Mortar and node to face: resultants are alike up to a part of the largest force."""
    runs = {m: run(s, Way(method=m), made) for m in ("mortar", "node")}
    one, two = runs.values()
    if one.error or two.error or one.warned or two.warned:
        return []
    all_ = [t for found in (one, two) for a in found.answers for t in a.contacts.values()]
    most = max(float(np.abs(t.force).max()) for t in all_)
    for k, (a, b) in enumerate(zip(one.answers, two.answers, strict=True)):
        for name, told in a.contacts.items():
            off = float(np.abs(told.force - b.contacts[name].force).max())
            if off > METHODS * most:
                return [f"methods, step {k}: {name}: {told.force} against {b.contacts[name].force}"]
    return []


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
        stored["kinds"][known["kind"]] -= 1
        stored["kinds"][new.kind] = stored["kinds"].get(new.kind, 0) + 1
        stored["noted"][i] = asdict(new)
        stored["judged again"] = stored.get("judged again", 0) + 1
    stored["noted"] = [v for v in stored["noted"] if v["kind"] not in ("right", "refused with reason")]
    store(stored)


def store(stored: dict[str, Any]) -> None:
    """Store a run, and put it into the documentation."""
    STORED.write_text(json.dumps(stored, indent=1, default=int) + "\n", encoding="utf-8")
    write_page()


def joined(new: dict[str, Any]) -> dict[str, Any]:
    """A run with the stored one before it, where it begins with the scene after the last one there."""
    if not new["seed"]:
        return new
    stored: dict[str, Any] = json.loads(STORED.read_text(encoding="utf-8"))
    if stored["seed"] + stored["scenes"] != new["seed"] or stored["friction"] != new["friction"]:
        raise SystemExit(f"stored are {stored['scenes']} scenes from {stored['seed']} on")
    kinds = {kind: stored["kinds"].get(kind, 0) + n for kind, n in new["kinds"].items()}
    sums = {name: stored[name] + new[name] for name in ("scenes", "steps", "seconds", "noted")}
    return {**stored, **sums, "kinds": kinds, "version": new["version"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0, help="number of the first scene")
    parser.add_argument("--smooth", action="store_true", help="without friction")
    parser.add_argument("--grain", action="store_true", help="friction with a direction")
    parser.add_argument("--only", type=int, help="show one scene")
    parser.add_argument(
        "--again",
        action="store_true",
        help="the scenes that the stored run calls WRONG",
    )
    parser.add_argument("--verbose", action="store_true", help="a line for every scene")
    parser.add_argument("--write", action="store_true", help="store the run, and put it into the docs")
    options = parser.parse_args()
    if options.grain and options.write:
        parser.error("what is stored are scenes without grain")
    if options.only is not None:
        print(describe(scene(options.only, not options.smooth, options.grain)))
        print(judge(options.only, not options.smooth, options.grain))
        return
    if options.again:
        again()
        return
    verdicts: list[Verdict] = []
    for seed in range(options.seed, options.seed + options.scenes):
        verdicts.append(v := judge(seed, not options.smooth, options.grain))
        if options.verbose:
            print(f"{v.seed} {v.kind} {v.seconds:.1f} s", flush=True)
        if v.kind in ("WRONG", "refused though feasible", "several answers"):
            print(f"{v.seed}: {v.kind}: {' | '.join(v.words)[:900]}", flush=True)
        first = options.seed == 0  # what is joined to a stored run is written once
        if options.write and ((first and len(verdicts) % 20 == 0) or len(verdicts) == options.scenes):
            store(joined(summary(options, verdicts)))
    print({k: v for k, v in summary(options, verdicts).items() if k != "noted"})


def summary(options: Any, verdicts: list[Verdict]) -> dict[str, Any]:
    """Counts, and every scene that is not simply right."""
    return {
        "scenes": len(verdicts),
        "seed": options.seed,
        "friction": not options.smooth,
        "kinds": {kind: sum(v.kind == kind for v in verdicts) for kind in KINDS},
        "steps": sum(v.steps for v in verdicts),
        "seconds": round(sum(v.seconds for v in verdicts)),
        "version": sc.__version__,
        "noted": [asdict(v) for v in verdicts if v.kind not in ("right", "refused with reason")],
    }


if __name__ == "__main__":
    main()
