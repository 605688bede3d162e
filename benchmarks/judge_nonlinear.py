"""A judge of bodies that are not linear: random scenes, and where the energy of each goes.

    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_nonlinear.py --scenes 200 --write
    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_nonlinear.py --only 17

Each scene follows from its number: a block of steel that yields or of rubber, under an elastic tool,
one that yields itself, a rigid plane or a rigid cylinder, which is moved or, where it has a stiffness,
pressed by forces; without friction, or by Coulomb or Tresca; down, about, and back the way it came.

* *step*: the work of the forces at the end of a step is that of all internal forces, of friction and
  of gaps that close under pressure, 1e-8. It is an identity of the step, however long it is.
* *way*: by the trapezoidal rule the work put in is what bodies store, and what plastic flow and
  friction take. This is true of short steps: what is missing falls with the step. Where nothing is
  lost, the work of coming back is that of going, *back*, 1e-8.
* *seen*: bodies in the other order, turned by 90 and by 30 degrees, in other units: forces, 1e-8.
* *cut*: a step that fails changes nothing of what it began from, and the next is as if it had not been.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import time
import traceback
import warnings
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import skfem as fem

import skfem_contact as sc

HERE = Path(__file__).parent
STORED = HERE / "results" / "judge_nonlinear.json"
PAGE = HERE.parent / "docs" / "checks" / "judge.md"
BEGIN, END = "<!-- nonlinear table: begin -->", "<!-- nonlinear table: end -->"
SAME = 1e-8  # of the largest force, or energy: round-off, and the tolerance of equilibrium
#: What is missing to the balance of a way, of the energy that was put in, with steps of a third: of
#: first order it is a third of that of whole steps, where points do not change in one of them alone.
FALLS = 0.5
E, NU, YIELD = 210e3, 0.3, 300.0
MATERIALS = "hardening", "kinematic", "neo-Hooke", "ideal", "Mooney-Rivlin"
TOOLS = "elastic", "like the block", "plane", "cylinder", "pressed"
LAWS = "none", "Coulomb", "Tresca"


@dataclass(frozen=True)
class Seen:
    """How a scene is put down."""

    angle: float = 0.0
    length: float = 1.0
    stress: float = 1.0
    flipped: bool = False


GIVEN = Seen()
OTHERS = Seen(np.pi / 2, flipped=True), Seen(np.pi / 6, 1e-3, 1e6)


@dataclass(frozen=True)
class Scene:
    """A scene in numbers; `way` has a row (down, along) for each load step."""

    seed: int
    material: str
    tool: str
    law: str
    share: float
    numbers: tuple[float, float, float, float]
    way: np.ndarray

    @property
    def kind(self) -> str:
        return f"{self.material}, {self.tool}, friction {self.law}"


def scene(seed: int) -> Scene:
    """The scene of a number."""
    rng = np.random.default_rng([seed, 26])
    material, tool, law = MATERIALS[seed % 5], TOOLS[seed // 5 % 5], LAWS[seed // 25 % 3]
    numbers = tuple(rng.uniform(*ends) for ends in ((0.1, 5), (500, 5000), (500, 5000), (0.1, 0.45)))
    steps = np.column_stack([rng.uniform(0.5e-3, 3e-3, 3), rng.uniform(-2e-3, 2e-3, 3)])
    steps[0, 1] = 0.0
    if tool == "cylinder":
        steps[:, 0] *= 2
    if material in ("neo-Hooke", "Mooney-Rivlin"):
        steps *= 20
    way = steps.cumsum(axis=0)
    share = rng.uniform(0.05, 0.5)
    if tool == "pressed":  # tractions over what the block bears, up to its limit
        way[:, 0] *= rng.uniform(0.7, 1.12) / way[-1, 0] / 1.4
        way[:, 1] = rng.uniform(-0.5, 0.5, 3) * min(share, 0.2) * way[:, 0]
    back = way[1::-1].copy()
    if law == "Tresca":  # what opens would lose friction all at once: about, but not up
        back[:, 0] = way[2, 0]
    way = np.concatenate([way, back])
    return Scene(seed, material, tool, law, share, numbers, way)


def material(s: Scene, stress: float) -> Any:
    harder, kinematic, modulus, nu = s.numbers
    if s.material == "hardening":
        return sc.J2(E * stress, NU, [[YIELD * stress, 0.0], [YIELD * stress * (1 + harder), 1.0]])
    if s.material == "kinematic":
        return sc.J2(E * stress, NU, YIELD * stress, kinematic=kinematic * stress)
    if s.material == "ideal":
        return sc.J2(E * stress, NU, YIELD * stress)
    if s.material == "neo-Hooke":
        return sc.materials.NeoHooke.of(modulus * stress, nu)
    return sc.materials.MooneyRivlin(
        modulus * stress / 8, modulus * stress / 20, bulk=3 * modulus * stress
    )


def bears(s: Scene) -> float:
    """A stress that the block bears."""
    return YIELD if s.material in ("hardening", "kinematic", "ideal") else 0.1 * s.numbers[2]


class Built:
    """A scene as the library has it.

    Attributes
    ----------
    block : NonlinearBody
    tool : Body or None
        None is a rigid one.
    solver : ContactSolver
    """

    def __init__(self, s: Scene, seen: Seen = GIVEN, **options: Any) -> None:
        self.scene, self.seen = s, seen
        c, sn = np.cos(seen.angle), np.sin(seen.angle)
        self.turn = np.array([[c, -sn], [sn, c]])
        self.block = self._body("block", (0, 1, 5), (0, 1, 5), material(s, seen.stress), "bottom")
        self.tool, other = None, None
        if s.tool in ("plane", "cylinder"):
            if s.tool == "plane":
                other = sc.RigidPlane(self._at(0, 1), tuple(self.turn @ (0, -1)), name="tool")
            else:
                other = sc.RigidCylinder(self._at(0.5, 5.0), 4.0 * seen.length, name="tool")
        else:
            law = material(s, seen.stress) if s.tool == "like the block" else None
            self.tool = self._body("tool", (-0.25, 1.15, 7), (1, 1.5, 2), law, self.loaded)
            other = self.tool.surface("bottom")
        bound = 0.3 * bears(s) * seen.stress
        friction = {"Coulomb": sc.Coulomb(s.share), "Tresca": sc.Tresca(bound)}.get(s.law)
        tied = s.tool == "pressed" and friction is None  # nothing else would hold the tool
        contact = sc.Contact(
            self.block.surface("top"), other, friction=friction, tied=tied, name="contact"
        )
        bodies = [self.block] if self.tool is None else [self.block, self.tool]
        given = sc.Options(**options) if options else None
        self.solver = sc.ContactSolver(bodies[:: -1 if seen.flipped else 1], [contact], options=given)

    @property
    def loaded(self) -> str | None:
        """The boundary where the tool is held; None where it is pressed."""
        return None if self.scene.tool == "pressed" else "top"

    def _at(self, x: float, y: float) -> tuple[float, ...]:
        return tuple(self.seen.length * (self.turn @ (x, y)))

    def _body(self, name: str, x: Any, y: Any, law: Any, held: str | None) -> Any:
        lines = [np.linspace(low, high, n + 1) for low, high, n in (x, y)]
        mesh = fem.MeshQuad.init_tensor(*lines).with_defaults()
        p = self.seen.length * (self.turn @ mesh.p)
        mesh = fem.MeshQuad(p, mesh.t, _boundaries=mesh.boundaries)
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
        if law is not None:
            return sc.NonlinearBody(basis, law, D=held, name=name)
        return sc.Body(basis, sc.Elastic(E * self.seen.stress, NU), D=held, name=name)

    def step(self, place: np.ndarray) -> dict[str, Any]:
        """The load step that leads to a place of the way."""
        given = tuple(map(float, self.given(place)))
        if self.tool is None:
            return {"motion": {"tool": given}}
        return {"f" if self.loaded is None else "x": {"tool": {"top": given}}}

    def given(self, place: np.ndarray) -> np.ndarray:
        """What is prescribed at a place: a traction on the tool, or how far it has moved, (2,)."""
        size = bears(self.scene) * self.seen.stress if self.loaded is None else self.seen.length
        return size * (self.turn @ (place[1], -place[0]))

    def history(self, way: np.ndarray) -> list[sc.answers.ContactResult]:
        return list(self.solver.history([self.step(place) for place in way]))

    def driven(
        self, result: sc.answers.ContactResult, place: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The forces on what is driven, and how far it has moved; their product is work."""
        if self.tool is None:
            return result.force, self.given(place)
        if self.loaded is not None:
            return result.reaction("tool"), self.given(place)
        top, u = self.tool.basis.boundary("top"), result.displacement("tool")
        mean = fem.Functional(lambda w: w["u"]).assemble(top, u=top.interpolate(u))
        return self.given(place), np.asarray(mean)


def lost(built: Built, result: sc.answers.ContactResult) -> tuple[float, float]:
    """What bodies store, and what plastic flow and friction have taken until then."""
    stored, gone = 0.0, float(result.dissipation_total)
    for body in built.solver.system.bodies:
        u = result.displacement(body)
        if body.nonlinear:
            own = body.energy(u, result.state[body.name])
            stored, gone = stored + own[0], gone + own[1]
        else:
            stored += 0.5 * float(u @ (body.K @ u))
    return stored, gone


def examine(s: Scene) -> tuple[list[str], dict[str, float]]:
    """All that is wrong with the answers to a scene, and what was measured."""
    built = Built(s)
    results = built.history(s.way)
    wrong, measured = [], {}

    def holds(what: str, value: float, bound: float) -> None:
        measured[what] = max(float(value), measured.get(what, 0.0))
        if not value <= bound:
            wrong.append(f"{what}: {value:.2g}, allowed {bound:.2g}")

    holds("certificate", max(result.certificate.worst for result in results), SAME)
    holds("step", steps_missing(built, results), SAME)
    missing = []
    for parts in (1, 3, 9):  # where errors of whole steps cancel each other, by ninths
        if parts == 9 and missing[1] <= max(FALLS * missing[0], SAME):
            break
        fine = built if parts == 1 else Built(s)
        found = results if parts == 1 else fine.history(between(s.way, parts))
        off, back = ways_missing(fine, found, between(s.way, parts))
        missing.append(off)
        if back is not None:
            holds("back", back, SAME)
    measured["way"], measured["way, thirds"] = missing[:2]
    holds("way falls", missing[-1], max(FALLS * max(missing[:-1]), SAME))
    largest = max(np.linalg.norm(result.force) for result in results)
    for seen in OTHERS:
        other = Built(s, seen)
        for one, two in zip(results, other.history(s.way), strict=True):
            force = other.turn.T @ two.force / (seen.length * seen.stress)
            holds("seen", np.linalg.norm(force - one.force) / largest, SAME)
    holds("cut", cut_changes(s, results), SAME)
    return wrong, measured


def between(way: np.ndarray, parts: int) -> np.ndarray:
    """A way in so many parts of each step."""
    known = np.concatenate([np.zeros((1, 2)), way])
    at = np.arange(1, parts * len(way) + 1) / parts
    return np.column_stack([np.interp(at, np.arange(len(known)), known[:, i]) for i in range(2)])


def steps_missing(built: Built, results: list[sc.answers.ContactResult]) -> float:
    """The largest difference of works with the forces of a step's end, over the largest energy."""
    off, most, before, place_before = 0.0, 0.0, None, None
    for place, result in zip(built.scene.way, results, strict=True):
        force, moved = built.driven(result, place)
        inner = 0.0
        for body in built.solver.system.bodies:
            u = result.displacement(body)
            was = np.zeros(len(u)) if before is None else before.displacement(body)
            state = None if before is None or not body.nonlinear else before.state[body.name]
            inner += float(body.linearize(u, state).internal @ (u - was))
        was = 0.0 if before is None else built.driven(before, place_before)[1]
        work = float(force @ (moved - was))
        most = max(most, abs(work), abs(inner))
        known = before is not None or built.scene.tool != "cylinder"
        if known and "cut" not in result.message:
            told = result["contact"]
            closing = 0.0 if before is None else float(told.normal_force @ before["contact"].gap)
            slip = told.slip if before is None else told.slip - before["contact"].slip
            rubbed = -float(np.sum(told.tangential_force * slip))
            off = max(off, abs(work - inner - rubbed - closing))
        before, place_before = result, place
    return off / most


def ways_missing(
    built: Built, results: list[sc.answers.ContactResult], way: np.ndarray
) -> tuple[float, float | None]:
    """What is missing to the balance of a way, over the largest energy; and to that of a way back."""
    works, stores, losses, force, moved = [0.0], [0.0], [0.0], np.zeros(2), np.zeros(2)
    for place, result in zip(way, results, strict=True):
        now, there = built.driven(result, place)
        mean = 0.5 * (now + force)
        works.append(works[-1] + float(mean @ (there - moved)))
        force, moved = now, there
        stored, gone = lost(built, result)
        stores.append(stored)
        losses.append(gone)
    work, store, loss = np.array(works), np.array(stores), np.array(losses)
    most = np.max(np.abs(store) + loss)
    first = len(way) // len(built.scene.way)  # at the end of the first step, and of the last one
    back = None
    if np.array_equal(way[-1], way[first - 1]) and loss[-1] - loss[first] <= 1e-14 * most:
        back = max(abs(work[-1] - work[first]), abs(store[-1] - store[first])) / most
    return float(np.max(np.abs(work - store - loss)) / most), back


def cut_changes(s: Scene, results: list[sc.answers.ContactResult]) -> float:
    """What a step that fails changes of the answer to the one that is taken after it."""
    before, step = results[0], Built(s).step(s.way[1])
    known = {name: np.array(value) for name, value in before.state["block"].items()}
    with contextlib.suppress(sc.errors.NotConverged, sc.errors.NoEquilibrium):
        Built(s, max_placements=1, max_cuts=0).solver.solve(**step, start=before)
    if not all(np.array_equal(before.state["block"][name], known[name]) for name in known):
        return np.inf
    again = Built(s).solver.solve(**step, start=before)
    return float(np.max(np.abs(again.u - results[1].u)) / np.max(np.abs(results[1].u)))


@dataclass(frozen=True)
class Verdict:
    """What became of one scene."""

    seed: int
    scene: str
    kind: str
    words: tuple[str, ...]
    measured: dict[str, float]
    seconds: float


def judge(seed: int) -> Verdict:
    start, s = time.process_time(), scene(seed)
    words: list[str] = []
    measured: dict[str, float] = {}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            words, measured = examine(s)
            kind = "WRONG" if words else "right"
        except (sc.errors.NotConverged, sc.errors.NoEquilibrium) as error:
            kind, words = "refused", [f"{type(error).__name__}: {str(error)[:300]}"]
        except Exception:
            kind, words = "WRONG", [traceback.format_exc()[-400:]]
    if kind == "right" and caught:
        kind = "warned"
    words += sorted({str(w.message)[:150] for w in caught})
    return Verdict(seed, s.kind, kind, tuple(words), measured, time.process_time() - start)


def table(verdicts: list[dict[str, Any]]) -> str:
    """The page's table."""
    kinds = Counter(v["kind"] for v in verdicts)
    rows = [("scenes", f"{len(verdicts):,}")]
    rows += [(kind, f"{kinds[kind]:,}") for kind in ("right", "warned", "refused", "WRONG")]
    names = {name: None for v in verdicts for name in v["measured"]}
    for name in names:
        values = [v["measured"][name] for v in verdicts if name in v["measured"]]
        rows.append((f"largest: {name}, of {len(values)}", f"{max(values):.1e}"))
    return "\n".join(["| | |", "| --- | --- |", *(f"| {a} | {b} |" for a, b in rows)])


def write(verdicts: list[dict[str, Any]]) -> None:
    """Store the verdicts, beside those of other scenes, and the table on its page."""
    known = {v["seed"]: v for v in json.loads(STORED.read_text())} if STORED.exists() else {}
    known.update((v["seed"], v) for v in json.loads(json.dumps(verdicts)))
    verdicts = [known[seed] for seed in sorted(known)]
    STORED.write_text(json.dumps(verdicts, indent=1) + "\n")
    page = PAGE.read_text()
    head, _, rest = page.partition(BEGIN)
    PAGE.write_text(f"{head}{BEGIN}\n{table(verdicts)}\n{END}{rest.partition(END)[2]}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="of the first scene")
    parser.add_argument("--only", type=int, nargs="*", help="these scenes, in words")
    parser.add_argument("--write", action="store_true", help="store the table")
    given = parser.parse_args()
    seeds = given.only or range(given.seed, given.seed + given.scenes)
    verdicts = []
    for seed in seeds:
        verdicts.append(verdict := judge(seed))
        if given.only or verdict.kind in ("WRONG", "refused"):
            print(verdict.seed, verdict.scene, verdict.kind, f"{verdict.seconds:.1f} s", flush=True)
            print(*(f"   {words}" for words in verdict.words), sep="\n")
            print("  ", {k: f"{v:.1e}" for k, v in verdict.measured.items()})
        if given.write:
            write([asdict(verdict)])
    print(table([asdict(verdict) for verdict in verdicts]), sum(v.seconds for v in verdicts))


if __name__ == "__main__":
    main()
