"""A judge from outside: random finite element scenes, answers measured without the library's operators.

    OPENBLAS_NUM_THREADS=1 python benchmarks/judge.py --scenes 2000 --seed 0 --workers 2 --write
    OPENBLAS_NUM_THREADS=1 python benchmarks/judge.py --only 17

Two to four bodies, random in shape, elements, stiffness, contacts, friction and load steps
(`judge_scenes`). Each answer is checked in equilibrium, balance, friction and overlap (`judge_checks`),
and compared with the same scene in another order, by another route, with the other method and on a
finer mesh. A refusal is held against statics (`judge_statics`).
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
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from judge_checks import Answer, Court, Finding, Told
from judge_scenes import GIVEN, Scene, Way, build, make, scene
from judge_statics import feasible

import skfem_contact as sc

HERE = Path(__file__).parent
STORED = HERE / "results" / "judge.json"
PAGE = HERE.parent / "docs" / "checks" / "judge.md"
BEGIN, END = "<!-- judge table: begin -->", "<!-- judge table: end -->"
KINDS = (
    "right",
    "warned",
    "refused with reason",
    "refused on the edge",
    "refused though feasible",
    "not judged",
    "WRONG",
)
#: Other orders of bodies and contacts are the same equations: the same answer but for round-off.
SAME = 1e-8
METHODS = 0.25  # of a force: what the two methods may differ by on a finer mesh
MOST = 0.75  # of a force: no error of a mesh with four facets or more is larger
EVERY = 4  # scene is compared with the other method and finer meshes, which costs as much as all else
LONGEST = 40.0  # CPU seconds for a scene and its comparisons: a hundred times what one takes
REFUSALS = (sc.errors.NoEquilibrium, sc.errors.NotConverged)


class TooLong(BaseException):
    """A scene has taken more than `LONGEST`; no library's `except` may swallow it."""


def _too_long(*_: Any) -> None:
    raise TooLong


@dataclass(frozen=True)
class Verdict:
    """What became of one scene."""

    seed: int
    scene: str
    kind: str
    words: tuple[str, ...]
    seconds: float
    steps: int
    permuted: str = ""


@dataclass(frozen=True, eq=False)
class Run:
    """The answers of a scene along one way, and what stopped it."""

    answers: list[Answer]
    error: Exception | None


def run(s: Scene, made: dict[str, Any], way: Way = GIVEN, report: bool = False) -> Run:
    """Hand a scene to the library and read what it reports."""
    answers: list[Answer] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            solver, steps = build(s, made, way)
            history = solver.history(steps)
            for result in history:
                answers.append(read(s, result, report, caught[:]))
    except Exception as error:
        return Run(answers, error)
    return Run(answers, None)


#: What a report says of other answers.
OTHERS = ("may have other answers", "may have several answers", "at least two other answers")


def read(s: Scene, result: Any, report: bool, caught: list[Any]) -> Answer:
    """What a user reads off a result, and in its report."""
    u = {b.name: np.array(result.displacement(b.name)) for b in s.bodies}
    contacts = {}
    for spec in s.contacts:
        v = result[spec.name]
        contacts[spec.name] = Told(
            np.array(v.points),
            np.array(v.forces),
            np.array(v.normal_force),
            np.array(v.tangential_force),
            np.array(v.status),
            np.array(v.gap),
            np.array(v.force),
            float(v.dissipation),
            np.array(v.action),
        )
    several = report and any(words in result.report() for words in OTHERS)
    warned = tuple(
        f"{w.category.__name__}: {w.message}" for w in caught if issubclass(w.category, Warning)
    )
    return Answer(u, contacts, result.message, warned, several)


def judge(seed: int | Scene, longest: float = LONGEST) -> Verdict:
    """The verdict on a scene, or on that of a number, within so many CPU seconds."""
    start = time.process_time()
    s = scene(seed) if isinstance(seed, int) else seed
    signal.signal(signal.SIGPROF, _too_long)
    signal.setitimer(signal.ITIMER_PROF, longest)
    try:
        kind, words, permuted, steps = _judge(s)
    except TooLong:
        kind, words, permuted, steps = "not judged", [f"stopped after {longest} s"], "", 0
    except Exception:
        kind, words, permuted, steps = "WRONG", [f"the judge fails: {traceback.format_exc()}"], "", 0
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return Verdict(s.seed, s.kind, kind, tuple(words), time.process_time() - start, steps, permuted)


def _judge(s: Scene) -> tuple[str, list[str], str, int]:
    made = make(s)
    court = Court(s, made)
    first = run(s, made)
    findings, blind = examine(court, first)
    words = [f"{f.check}, step {f.step}: {f.words}" for f in findings]
    warned = sorted({w for a in first.answers for w in a.warned})
    permuted = ""
    kind = "right"
    if first.error is not None:
        kind, why = refusal(court, first)
        words.append(why)
    elif warned:
        kind = "warned"
    if blind and kind == "right":
        kind = "not judged"
        words.append("forces are below the round-off of rigid motions")
    excused = [f for f in findings if excuses(first.answers, f)]
    wrong = len(findings) > len(excused) or kind == "WRONG"
    if first.answers:
        off = compare_orders(court, first)
        permuted = off
        if off.startswith("differ"):
            wrong = True
        elif off.startswith("refused") and first.error is None:
            kind = "refused though feasible"
        if off.startswith(("differ", "refused")):
            words.append(f"order: {off}")
        for why in compare_routes(court, first):
            wrong = True
            words.append(why)
        same_method = {c.method for c in s.contacts if c.primary} and first.error is None
        if same_method and not warned and not s.finite and s.seed % EVERY == 0:
            for why in compare_methods(court, first):
                wrong = True
                words.append(why)
    words += warned
    return ("WRONG" if wrong else kind), words, permuted, len(first.answers)


def examine(court: Court, found: Run) -> tuple[list[Finding], bool]:
    """All findings on the answers of a run, and whether round-off hides what they would be."""
    findings: list[Finding] = []
    blind = False
    before = None
    for k, answer in enumerate(found.answers):
        forces = court.forces(k, answer)
        blind |= court.blind(forces)
        findings += court.equilibrium(k, answer, forces)
        findings += court.rest(k, answer, forces)
        findings += court.balance(k, answer, forces)
        findings += court.friction(k, answer, before, forces)
        findings += court.overlap(k, answer, forces)
        before = answer
    loaded = any(drive.kind == "f" for drive in court.scene.drives)
    if court.faint > court.most and not loaded:  # no force in all steps that is not round-off
        findings = [f for f in findings if f.geometric]
    return findings, blind


BOTH = ("overlap", "force across a gap")
#: What a warning is about, by words of it, and the findings that follow from that.
ABOUT = (
    ("small sliding, which keeps", BOTH),  # partners and gaps of the undeformed bodies
    ("Prescribed displacements win", ("overlap",)),
    ("overlap", ("overlap",)),
    ("beyond the end", ("force across a gap",)),
    ("is strained by", BOTH),  # deformed boundaries are those of linear bodies
    ("has turned by", BOTH),
)


def excuses(answers: list[Answer], finding: Finding) -> bool:
    """Whether the user was told of a finding, in this step or before it in the history."""
    if not finding.geometric:
        return False
    contact = finding.words.partition(":")[0]
    for text in (w for a in answers[: finding.step + 1] for w in a.warned):
        named = re.findall(r"[Cc]ontact '([^']*)'", text)
        if named and contact not in named:
            continue
        if any(words in text and finding.check in checks for words, checks in ABOUT):
            return True
    return False


def refusal(court: Court, found: Run) -> tuple[str, str]:
    """Whether a refusal is in order."""
    error, step = found.error, len(found.answers)
    what = f"step {step}: {type(error).__name__}: {str(error)[:300]}"
    if not isinstance(error, REFUSALS):
        if isinstance(error, sc.ContactError):
            return "refused with reason", what
        return "WRONG", f"raw exception, {what}"
    s = court.scene
    obstacles = {}
    for spec in s.contacts:
        if spec.primary is None:
            still = {b.name: np.zeros(court.made[b.name].basis.N) for b in s.bodies}
            blank = Answer(still, {}, "")
            obstacles[spec.name] = court._near(spec, blank, False).normal
    args = (s, court.made, court.lines, s.steps[step], obstacles)
    rests = feasible(*args)
    if rests is None:
        return "refused with reason", f"{what} (statics not decided)"
    if rests:
        told = "Only strains drive it" in str(error)
        if s.finite and told and not feasible(*args, pushed=True):
            return "refused on the edge", what
        return "refused though feasible", what
    return "refused with reason", what


def travelled(answers: list[Answer], k: int) -> float:
    """The largest displacement up to step k.

    A step that takes back what those before it did leaves displacements that are round-off of theirs:
    where nothing presses any more, where nothing is prescribed but zero, or where a gap opens again.
    """
    return max(float(np.abs(u).max()) for a in answers[: k + 1] for u in a.u.values())


def difference(court: Court, k: int, one: Answer, two: Answer, moved: float) -> float:
    """Largest difference of forces, over the largest, and of displacements, over `moved`.

    What is round-off is left out: of forces, and of displacements what these do to the bodies. Where
    round-off hides the forces of both they are not compared: a wedge that friction hardly fails to hold
    carries the round-off of its balance, divided by the slight angle that it slides for.
    """
    off = 0.0
    size = max(float(np.abs(t.forces).sum(axis=0).max()) for t in one.contacts.values())
    forces = court.forces(k, one)
    hidden = court.blind(forces) and court.blind(court.forces(k, two))
    noise = np.inf if hidden else sum(forces.noise.values())
    for name, told in one.contacts.items():
        apart = float(np.abs(told.force - two.contacts[name].force).max()) - noise
        if apart > 0:
            off = max(off, apart / max(size, court.most * 1e-6))
    agree = off <= SAME
    apart = max(
        float(np.abs(court.strained(name, u - two.u[name], moved) if agree else u - two.u[name]).max())
        for name, u in one.u.items()
    )
    if moved > 0 and apart > SAME * moved:
        apart -= court.felt(forces)
    return max(off, apart / moved) if moved > 0 else off


def same_of(court: Court, one: Answer, two: Answer, same: float) -> float:
    """To what two answers have to agree: with finite sliding, after other rounds, to its tolerance.

    The pairing of a step is iterated to `placement_tolerance`; two that took other ways to it are as
    far from each other as that.
    """
    rounds = court.scene.finite and one.message != two.message
    return max(same, court.placement) if rounds else same


def elsewhere(court: Court, k: int, one: Answer, two: Answer, same: float) -> bool:
    """Whether forces agree and the user is told that the place of a body is indifferent."""
    told = any("The place of body" in w for a in (one, two) for w in a.warned)
    return told and difference(court, k, one, replace(two, u=one.u), 0.0) <= same


def may_be_several(one: Answer, two: Answer) -> bool:
    """Whether one user is told that another facet may carry, the other one that or that none does."""
    several, none = "There may be several answers, one for each facet", "The place of body"
    told = [[any(words in w for w in a.warned) for words in (several, none)] for a in (one, two)]
    return any(facets for facets, _ in told) and all(any(both) for both in told)


def another(court: Court, way: Way, other: Run, k: int, one: Answer, two: Answer) -> bool:
    """Whether the user is told that there may be others, and the judge's own checks know both as right.

    A disc between blocks may be squeezed or stand beside, loose; what cohesion presses on may touch
    or not, as each of the two reports says.
    """
    findings, _ = examine(court, Run(other.answers[: k + 1], None))
    if not all(excuses(other.answers, f) for f in findings):
        return False
    if any("The place of body" in w for a in (one, two) for w in a.warned):
        return True
    told = (run(court.scene, court.made, w, report=True).answers[k] for w in (GIVEN, way))
    return all(answer.several for answer in told)


def compare_orders(court: Court, first: Run) -> str:
    """The same scene with bodies and contacts in another order."""
    s, made = court.scene, court.made
    rng = np.random.default_rng([s.seed, 3])
    n, m = len(s.bodies), len(s.contacts)
    bodies = tuple(int(i) for i in (range(n)[::-1] if n == 2 else rng.permutation(n)))
    contacts = tuple(int(i) for i in (range(m)[::-1] if m == 2 else rng.permutation(m)))
    way = Way(bodies, contacts)
    second = run(s, made, way)
    pairs = list(zip(first.answers, second.answers, strict=False))
    off = [difference(court, k, a, b, travelled(first.answers, k)) for k, (a, b) in enumerate(pairs)]
    first_off = next(
        (k for k, value in enumerate(off) if value > same_of(court, *pairs[k], SAME)), None
    )
    if first_off is not None and elsewhere(court, first_off, *pairs[first_off], SAME):
        # all that follows depends on where the body was left, a later refusal too
        return f"several answers are reported: a place that is indifferent, step {first_off}"
    if first_off is not None and may_be_several(*pairs[first_off]):
        return f"several answers are reported: facets longer than the contact, step {first_off}"
    # whatever a refusal is called: that there is no equilibrium, or that none was found
    same = type(first.error) is type(second.error)
    same |= isinstance(first.error, REFUSALS) and isinstance(second.error, REFUSALS)
    if not same or len(first.answers) != len(second.answers):
        # an answer that only the one order finds is no other answer: the other one is a refusal
        error = second.error if second.error is not None else first.error
        alone = first_off is None and None in (first.error, second.error)
        open_ = isinstance(error, sc.errors.NotConverged) or "is not shown" in str(error)
        kind = "refused in one of them" if alone and open_ else "differ"
        return (
            f"{kind}: {len(first.answers)} steps, {type(first.error).__name__} against "
            f"{len(second.answers)} steps, {type(second.error).__name__} "
            f"({str(second.error or first.error)[:200]})"
        )
    worst = int(np.argmax(off))
    if first_off is None:
        return "agree"
    if another(court, way, second, first_off, *pairs[first_off]):
        return f"several answers are reported, {off[worst]:.1e} in step {worst}"
    said = " and ".join(repr(r.answers[worst].message) for r in (first, second))
    return f"differ by {off[worst]:.1e} in step {worst}; messages {said}"


def compare_routes(court: Court, first: Run) -> list[str]:
    """The sparse route, and the loop `direct` where the stiffness of sticking is given."""
    s, made = court.scene, court.made
    ways = [("Direct()", Way(linear="direct"), 1e-6)]
    if all(c.friction is None or c.G is not None for c in s.contacts):
        ways.append(("loop direct", Way(loop="direct"), 1e-6))
    out = []
    for name, way, same in ways:
        other = run(s, made, way)
        if other.error is not None and not isinstance(other.error, REFUSALS):
            out.append(f"{name}: raw {type(other.error).__name__}: {str(other.error)[:200]}")
        for k, (a, b) in enumerate(zip(first.answers, other.answers, strict=False)):
            off = difference(court, k, a, b, travelled(first.answers, k))
            same = same_of(court, a, b, same)
            if off > same and (elsewhere(court, k, a, b, same) or another(court, way, other, k, a, b)):
                break  # told, and all that follows depends on it
            if a.cut != b.cut:
                break  # friction depends on the way: one took the step in one, the other in two
            if off > same:
                out.append(f"{name} differs by {off:.1e} in step {k}")
                break
    return out


def compare_methods(court: Court, first: Run) -> list[str]:
    """Mortar and node to segment on a finer mesh, where both have to come nearer to the truth.

    Resultants may differ by twice what both moved by when all facets were halved, which is their error
    where it is of first order, and by `METHODS` of the force: node by node a resultant between meshes
    that do not match is off by up to 16 % (docs/checks/extremes.md, X10). Never by most of the force. A
    held node that the other body presses on alone is a point: one method stops at it, one has no
    multiplier there, and both near the truth with the logarithm of the facets only, from either side.
    That tells nothing about either.
    """
    s = court.scene
    fine = make(s, 2)
    runs = {}
    for method in ("mortar", "node"):
        coarse = run(s, court.made, Way(method=method))
        runs[method] = (coarse, run(s, fine, Way(method=method)))
    for k in range(min(len(r.answers) for pair in runs.values() for r in pair)):
        answers = {m: [r.answers[k] for r in pair] for m, pair in runs.items()}
        if any(a.warned for pair in answers.values() for a in pair):
            return []
        whole = max(float(np.abs(t.force).max()) for t in answers["node"][1].contacts.values())
        for name in (c.name for c in s.contacts if not court.held_alone(c)):
            force = {m: [a.contacts[name].force for a in pair] for m, pair in answers.items()}
            moved = sum(float(np.abs(c - f).max()) for c, f in force.values())
            off = float(np.abs(force["mortar"][1] - force["node"][1]).max())
            size = max(float(np.abs(f).max()) for _, f in force.values())
            if off > min(2 * moved + METHODS * size, MOST * size) and off > 0.05 * whole:
                words = ", ".join(f"{m} {c.tolist()} then {f.tolist()}" for m, (c, f) in force.items())
                return [
                    f"methods, step {k}: {name}: forces on the mesh, then on halved facets: {words}"
                ]
    return []


def describe(s: Scene) -> str:
    """A scene in words."""
    lines = [f"scene {s.seed}: {s.kind}, turned by {s.angle:.3g}, size {s.size:.3g}, unit {s.unit:.3g}"]
    for b in s.bodies:
        held = ", ".join((*b.clamped, *(f"{t} in {'xy'[c]}" for t, c in b.rollers)))
        lines.append(
            f"  {b.name}: {b.shape.words}; {b.element}{', curved' if b.curved else ''}, E {b.E:.4g}, "
            f"nu {b.nu:.2f}, held: {held or 'nowhere'}"
        )
    for c in s.contacts:
        other = "/".join(c.primary) if c.primary else str(c.obstacle)
        lines.append(
            f"  {c.name}: {'/'.join(c.secondary)} on {other}, {c.method}, {c.sliding}, "
            f"{'tied' if c.tied else c.friction or 'frictionless'}, G {c.G}, "
            f"interference {c.interference:.3g}"
        )
    for d in s.drives:
        lines.append(f"  {d.kind} on {d.target}/{d.tag}: a {d.normal} + b {d.tangential}")
    steps = ", ".join(f"({a:.3g}, {b:.3g})" for a, b in s.steps)
    return "\n".join([*lines, f"  steps (a, b): {steps}"])


def table(run_: dict[str, Any]) -> str:
    """A stored run as it stands in the documentation."""
    lines = ["| | scenes |", "| --- | --- |", f"| judged | {run_['scenes']:,} |"]
    lines += [f"| {kind} | {run_['kinds'][kind]:,} |" for kind in KINDS if kind in run_["kinds"]]
    lines += [f"| in another order: {what} | {n:,} |" for what, n in run_["orders"].items()]
    if "judged again" in run_:
        lines.append(f"| of these judged again after mending | {run_['judged again']:,} |")
    return "\n".join([*lines, f"| load steps | {run_['steps']:,} |"])


def write_page() -> None:
    """Put the table of the stored run into the documentation."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}\n{table(stored)}\n{END}{after}", encoding="utf-8")


ORDERS = (
    "agree",
    "several answers are reported",
    "refused in one of them",
    "differ",
    "no step to compare",
)


def summary(options: Any, verdicts: list[Verdict]) -> dict[str, Any]:
    """Counts, and every scene that is not simply right."""
    orders = dict.fromkeys(ORDERS, 0)
    for v in verdicts:
        orders[next((n for n in ORDERS if v.permuted.startswith(n)), ORDERS[-1])] += 1
    return {
        "scenes": len(verdicts),
        "seed": options.seed,
        "kinds": {kind: sum(v.kind == kind for v in verdicts) for kind in KINDS},
        "orders": orders,
        "steps": sum(v.steps for v in verdicts),
        "seconds": round(sum(v.seconds for v in verdicts)),
        "version": sc.__version__,
        "noted": [asdict(v) for v in verdicts if v.kind not in ("right", "refused with reason")],
    }


def again(write: bool) -> None:
    """Judge once more what the stored run calls WRONG, after library or judge have been mended."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    for i, known in enumerate(stored["noted"]):
        if known["kind"] != "WRONG":
            continue
        new = judge(known["seed"])
        print(f"{new.seed} {new.scene}: {new.kind}: {' | '.join(new.words)[:300]}", flush=True)
        for kind, change in (("WRONG", -1), (new.kind, 1)):
            stored["kinds"][kind] += change
        for text, change in ((known["permuted"], -1), (new.permuted, 1)):
            stored["orders"][next((n for n in ORDERS if text.startswith(n)), ORDERS[-1])] += change
        stored["noted"][i] = asdict(new)
        stored["judged again"] = stored.get("judged again", 0) + 1
    stored["noted"] = [v for v in stored["noted"] if v["kind"] not in ("right", "refused with reason")]
    if write:
        STORED.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
        write_page()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0, help="number of the first scene")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--only", type=int, help="show one scene")
    parser.add_argument(
        "--again", action="store_true", help="the scenes that the stored run calls WRONG"
    )
    parser.add_argument("--write", action="store_true", help="store the run, and put it into the docs")
    options = parser.parse_args()
    if options.only is not None:
        print(describe(scene(options.only)))
        verdict = judge(options.only)
        print(f"{verdict.kind} ({verdict.seconds:.2f} s, orders {verdict.permuted})")
        print("\n".join(f"  {w}" for w in verdict.words))
        return
    if options.again:
        again(options.write)
        return
    verdicts: list[Verdict] = []
    with Pool(options.workers) as pool:
        seeds = range(options.seed, options.seed + options.scenes)
        for v in pool.imap(judge, seeds, chunksize=5):
            verdicts.append(v)
            if v.kind in ("WRONG", "not judged"):
                print(f"{v.seed} {v.scene}: {v.kind}: {' | '.join(v.words)[:600]}", flush=True)
    found = summary(options, verdicts)
    print({k: v for k, v in found.items() if k != "noted"})
    if options.write:
        STORED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        write_page()


if __name__ == "__main__":
    main()
