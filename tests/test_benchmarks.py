"""The benchmarks' problems have the answers they are measured against, and their tables say so."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import internals
import numpy as np
import pytest


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The modules of the benchmark, which is no package."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    import run

    yield run
    for name in ("run", "cases"):
        sys.modules.pop(name)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["Q1", "P2"])
def test_history_and_routes(run: Any, kind: str) -> None:
    """50 increments end at Hertz, Cattaneo and Mindlin; without condensation the answer is the same."""
    scene = run.Scene(run.Case("small", 8000, kind=kind))
    measured = run.history(scene)
    assert measured["increments"] == 50
    # 5 (Q1) or 2 (P2) elements per half width: their edge of contact is off by half an element
    assert max(measured["errors"].values()) < 0.1
    assert run.sparse(scene)["difference"] < 1e-9


def test_table_names_what_failed(run: Any) -> None:
    """A case that failed is a row with its reason."""
    failed = {"failed": "MemoryError"}
    text = run.table([{"case": "large", "history": failed, "own": failed, "plain": failed}])
    assert "| large | failed: MemoryError |" in text


def test_two_checkouts_are_compared_by_medians_and_smallest_times(run: Any) -> None:
    """2 s and 4 s in the middle, 1.5 s and 2 s at the least; what failed is named."""
    here = {"loop": 2.0, "loop spread": [1.5, 9.0], "total": 3.0}
    there = {"loop": 4.0, "loop spread": [2.0, 5.0], "total": 3.0}
    words = run.compared({"case": "Q1", "history": here, "beside": there})
    assert words.startswith("Q1: loop 0.50 (smallest 0.75), total 1.00 (smallest 1.00)")
    assert run.compared({"case": "Q1", "history": here, "beside": {"failed": ""}}) == "Q1: not compared"


ROOT = Path(__file__).parents[1]
TRADE = ("trade", "trade_tables", "trade_plot", "problems")


@pytest.fixture(scope="module")
def modules() -> Any:
    """The modules of benchmarks/trade.py."""
    root = Path(__file__).parents[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(root / "tests" / "verification"))
        patch.syspath_prepend(str(root / "benchmarks"))
        yield {name: import_module(name) for name in TRADE}
        for name in TRADE:
            sys.modules.pop(name)


@pytest.fixture(scope="module")
def trade(modules: Any) -> Any:
    """The modules of benchmarks/trade.py, and what its quick mode measures."""
    return modules, modules["trade"].measure(quick=True)


@pytest.mark.slow
def test_trade_errs_as_the_mesh_lets_it(trade: Any) -> None:
    """On 4.5 elements per half width all four answers are right to what such a mesh resolves."""
    measured = trade[1]["problems"]
    base = {name: problem["rows"][0] for name, problem in measured.items()}
    assert not [r for p in measured.values() for r in p["rows"] if "failed" in r]
    # of order h/a = 0.22, measured an eighth of it (Hertz) to a quarter (friction), Raous' smoother
    assert base["hertz"]["error"] < 0.05
    assert base["mindlin"]["error"] < 0.1
    assert base["raous"]["error"] < 0.01
    assert base["sliding"]["error"] < 0.05


@pytest.mark.slow
def test_trade_compares_with_the_base(trade: Any) -> None:
    """Ratios are to the base; only what changes the equations changes the answer."""
    for problem in trade[1]["problems"].values():
        rows = {(r["axis"], r["label"]): r for r in problem["rows"]}
        assert rows["base", ""]["time ratio"] == rows["base", ""]["error ratio"] == 1.0
        assert rows["presets", "balanced"]["error"] == rows["base", ""]["error"]
        # what the presets change is below what the mesh resolves
        assert all(abs(rows["presets", p]["error ratio"] - 1) < 0.02 for p in ("fast", "accurate"))
        # finite stiffness of sticking points, 1e3 times K's diagonal, in the loop `direct`
        assert rows["loop", "direct"]["moved"] < 2e-3
    hertz = {(r["axis"], r["label"]): r for r in trade[1]["problems"]["hertz"]["rows"]}
    assert hertz["method", "node"]["moved"] > 1e-3


@pytest.mark.slow
def test_trade_goes_wrong_without_following_the_die(modules: Any) -> None:
    """On the pairing of the start, with the block as secondary, the die presses where it began."""
    base = modules["trade"].PROBLEMS["sliding"].base
    left = replace(base, points=4.5, increments=4, sliding="small", secondary="block")
    with pytest.warns(UserWarning, match="press where they began.* sliding='finite'"):
        # measured .9: nearly all of it is wrong; with finite sliding 1 to 3 %
        assert modules["problems"].sliding(left).error() > 0.8
    assert modules["problems"].sliding(replace(left, sliding="finite")).error() < 0.1


def test_values_along_quadratic_facets(modules: Any) -> None:
    """Between the nodes of quadratic facets a parabola is met exactly, of linear ones its chord."""
    along, x = modules["problems"].along, np.linspace(0, 1, 9)
    points = np.array([0.0, 0.1, 0.25, 0.6, 1.0])
    # round-off of numbers up to one
    assert along(points, x, x**2, 2) == pytest.approx(points**2, abs=1e-14)
    assert along(points, x, x**2, 1)[1] > points[1] ** 2 + 1e-4


@pytest.mark.slow
def test_trade_tables_and_pictures(trade: Any, tmp_path: Path) -> None:
    """Every row is in a table; the front gets better as it gets slower; pictures are drawn."""
    modules, measured = trade
    tables = modules["trade_tables"]
    for problem in measured["problems"].values():
        best = tables.front(problem["rows"])
        assert (np.diff([r["median"] for r in best]) >= 0).all()
        assert (np.diff([r["error"] for r in best]) < 0).all()
        listed = tables.price_list(problem).splitlines()
        assert len(listed) == 2 + sum(r["axis"] != "front" for r in problem["rows"])
    for picture in modules["trade_plot"].draw(measured, tmp_path):
        assert picture.stat().st_size > 10_000


def test_a_failed_setting_is_a_row(modules: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """What cannot be solved is in the table with its reason."""
    problem = modules["trade"].PROBLEMS["raous"]
    few = replace(problem.base, points=4, options=replace(problem.base.options, max_iterations=1))
    # newton may find this coarse block at once from its start; fictitious forces never do alone
    internals.replace(monkeypatch, "loops.STARTS", ("warm", "cold"))
    few = replace(few, loop="fictitious", options=replace(few.options, max_cuts=0))
    base, failed = (modules["trade"].Measured(problem, s) for s in (problem.base, few))
    failed.run()
    row = {"axis": "options", "label": "one iteration", **failed.compared(base)}
    assert "NotConverged" in modules["trade_tables"].price_list({"rows": [row]})


def test_the_pages_show_what_is_stored(modules: Any) -> None:
    """The tables in docs/checks/trade.md and docs/checks/methods.md are those of results/trade.json."""
    tables = modules["trade_tables"]
    stored = json.loads(modules["trade"].STORED.read_text(encoding="utf-8"))
    for page, wanted in tables.tables(stored).items():
        text = (tables.DOCS / page).read_text(encoding="utf-8")
        assert {name: tables.marked(text, name) for name in wanted} == wanted
        assert len(re.findall("<!-- trade, .*: begin -->", text)) == len(wanted)


def marked(page: str, name: str) -> str:
    """The table between two marks of a page of the documentation."""
    text = (Path(__file__).parents[1] / "docs" / page).read_text(encoding="utf-8")
    return text.split(f"<!-- {name} table: begin -->\n")[1].split(f"\n<!-- {name} table: end -->")[0]


Table = Callable[[Any, Any], str]
STORED: list[tuple[str, str, str, Table]] = [  # page, module, stored run, the table of it
    ("docs/checks/performance.md", "run", "history", lambda run, found: run.table(found["rows"])),
    ("README.md", "run", "history", lambda run, found: run.table(found["rows"], run.SHORT)),
    ("paper.md", "run", "history", lambda run, found: run.table(found["rows"], run.SHORTEST)),
    ("docs/checks/performance.md", "solids", "solids", lambda run, found: run.table(found["rows"])),
    (
        "docs/checks/performance.md",
        "whole_jobs",
        "whole_jobs",
        lambda run, found: run.table(found["rows"]),
    ),
    ("docs/checks/performance.md", "pairing", "pairing", lambda run, found: run.table(found["rows"])),
    ("docs/checks/performance.md", "iterations", "iterations", lambda run, found: run.table(found)),
    ("docs/checks/performance.md", "sliding", "sliding", lambda run, found: run.table(found)),
    ("docs/checks/audit.md", "audit", "audit", lambda run, found: run.table(found["rows"])),
    (
        "docs/checks/performance.md",
        "found_contacts",
        "found_contacts",
        lambda run, found: run.table(found),
    ),
    ("docs/checks/audit.md", "audit", "audit", lambda run, found: run.imports_table(found["imports"])),
    (
        "docs/checks/effectivity.md",
        "effectivity_table",
        "effectivity",
        lambda run, found: run.table(found["rows"]),
    ),
    (
        "docs/checks/effectivity.md",
        "effectivity_table",
        "effectivity_solids",
        lambda run, found: run.table(found),
    ),
]


@pytest.mark.parametrize(("page", "module", "name", "table"), STORED)
def test_tables_are_those_of_the_stored_runs(
    page: str, module: str, name: str, table: Table, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a page shows of a benchmark is what this benchmark has stored."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    found = json.loads((ROOT / "benchmarks" / "results" / f"{name}.json").read_text(encoding="utf-8"))
    text = (ROOT / page).read_text(encoding="utf-8")
    assert f"\n{table(import_module(module), found)}\n" in text


def test_modules_of_tests_and_benchmarks_have_names_of_their_own() -> None:
    """They are no packages: of two modules with one name only the first could be imported."""
    found = [*(ROOT / "tests").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")]
    names = [path.stem for path in found if path.stem != "conftest"]
    assert sorted(names) == sorted(set(names))


def test_tables_of_extremes_are_those_of_the_stored_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page shows what the runs stored, and these have no wrong answer."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    import extremes
    import fuzz

    rows = json.loads(extremes.STORED.read_text(encoding="utf-8"))["rows"]
    assert marked("checks/extremes.md", "extremes") == extremes.table(rows)
    assert sum(row["wrong"] for row in rows.values()) == 0
    runs = [json.loads(path.read_text(encoding="utf-8")) for path in fuzz.STORED]
    assert marked("checks/extremes.md", "fuzz") == fuzz.table(runs)
    assert sum(run["kinds"]["wrong"] + run["kinds"]["crashed"] for run in runs) == 0


@pytest.fixture
def solids(run: Any) -> Any:
    """The benchmark of solids."""
    import solids

    yield solids
    sys.modules.pop("solids")


def test_solids_agree_on_all_routes(solids: Any) -> None:
    """The smallest case: equilibrium and friction hold in the end, and the three routes agree."""
    scene = solids.Scene(solids.QUICK)
    measured = solids.history(scene)
    assert len(measured["iterations"]) == 10
    assert min(measured["open, stick, slip"]) > 5
    assert measured["certificate"] < 1e-9
    apart = solids.routes(scene)
    assert apart["iterated apart"] < 1e-10
    assert (
        apart["multigrid apart"] < 1e-8
    )  # it iterates to 1e-10 of the load, most of which moves the punch


def test_table_of_solids_names_what_failed_and_what_is_not_run(solids: Any) -> None:
    """A history that failed is a row with its reason; a linear solve that is not run is no number."""
    failed = {"failed": "more than 3600 s"}
    row = {"case": "large", "history": failed, "own": failed}
    assert "| large | failed: more than 3600 s |" in solids.table([row])
    assert solids.of_plain(row, "total") == "not run"
    assert solids.of_plain(row | {"plain": failed}, "total") == "more than 3600 s"


@pytest.mark.parametrize("method", ["mortar", "node"])
def test_plates_that_fit_are_paired_whole(run: Any, method: str) -> None:
    """Every point of the lower plate has a partner, which makes no gap where all moves alike."""
    import pairing

    measured = pairing.pairing(replace(pairing.QUICK, method=method))
    assert measured["paired"] == measured["points"] == 49
    assert measured["translation"] < 1e-14  # round-off of sums of some ten weights of one
    height = pairing.BULGE * np.pi**2 / 8 * (1 / 6**2 + (pairing.OVERHANG / 5) ** 2)
    assert 0 < measured["gap"] < 2 * height  # sagittas along two axes, of both sides
    assert (measured["pieces"] > 36) == (method == "mortar")
    failed = pairing.table([{"case": "large", "failed": "MemoryError"}])
    assert "| large | failed: MemoryError |" in failed


def test_whole_jobs_are_done_in_processes_of_their_own(run: Any) -> None:
    """The quick ones beside the same library: near their closed forms, and the same answers."""
    import whole_jobs

    for job in whole_jobs.QUICK:
        row = whole_jobs.run(job, beside=str(ROOT))
        assert "failed" not in row["history"] and row["apart"] == (
            None if job.kind == "import" else 0.0
        )
        # 8 elements per fine half width: its edge is located within one; else round-off
        assert (row["history"].get("error") or 0.0) < (0.05 if "Hertz" in job.name else 1e-9)
        assert (
            sum(row["history"].get(part, 0.0) for part in whole_jobs.PARTS)
            <= row["history"]["job"] + 1e-6
        )
    failed = {"case": "large", "history": {"failed": "MemoryError"}}
    assert "| large | failed: MemoryError |" in whole_jobs.table([failed])


@pytest.fixture
def peers(run: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The driver of the peers; modules of its folder are imported by their names alone."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks" / "peers"))
    import compare

    yield compare
    for name in ("compare", "ours", "scene"):
        sys.modules.pop(name)


def test_peers_are_judged_by_their_displacements(peers: Any) -> None:
    """Forces balance in the interior; a node that is moved, and a punch that sinks in, are seen."""
    small = import_module("scene").press(4, 3, 2)
    u, said = import_module("ours").solve(small)
    verdict = peers.judged(small, u)
    assert said["iterations"] > 0 and verdict.residual < 1e-12
    assert verdict.traction[:, -1].min() > -1e-12
    inside = np.flatnonzero(np.isclose(small.bodies[0].points[:, 2], -0.25))[12]
    assert peers.judged(small, u + 1e-6 * (np.arange(len(u)) == inside)[:, None]).residual > 1e-4
    upper = np.arange(len(u))[:, None] >= small.first(1)
    sunk = peers.judged(small, u - 1e-3 * upper)
    # nodes are in the facets of the other face, which are coarse: mortar holds their mean apart
    assert verdict.overlap > 0 and sunk.overlap == pytest.approx(verdict.overlap + 0.2)  # of 5e-3
    assert peers.errors("press 6k", verdict, verdict)["pressure"] < 1e-9


def test_table_of_peers_is_that_of_the_stored_run(peers: Any) -> None:
    """Details in docs/checks/performance.md; a peer that is not there is a row that says so."""
    rows = json.loads((peers.RESULTS / "peers.json").read_text(encoding="utf-8"))["rows"]
    assert marked("checks/performance.md", "peers") == peers.table(rows)
    for page in peers.SHORT:
        assert marked(f"../{page}", "peers") == peers.short(rows)
    absent = {"case": "press 6k, GetFEM", "dofs": 6090, "failed": "no module getfem"}
    assert "GetFEM | failed: no module getfem |" in peers.table([absent])


def test_peers_that_do_not_end_are_ended(
    peers: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Their row says so."""
    script = tmp_path / "asleep.py"
    script.write_text("import time\nprint('begins', flush=True)\ntime.sleep(60)\n", encoding="utf-8")
    monkeypatch.setattr(peers, "LIMIT", 0.2)
    asleep = peers.Peer("asleep", str(script), ("press",), sys.executable)
    assert peers.job(asleep, "press 6k", str(tmp_path)) == {"failed": "not done in 0.2 s"}


def test_two_checkouts_pair_in_turn(run: Any) -> None:
    """3 s and 6 s in the middle, 2 s and 5 s at the least; what failed is named."""
    import pairing

    here = [{"surfaces": 1.0, "pairing": seconds} for seconds in (1.0, 2.0, 8.0)]
    there = [{"surfaces": 1.0, "pairing": seconds} for seconds in (4.0, 5.0, 6.0)]
    assert pairing.compared("P1", here, there).startswith("P1: 0.50 (smallest 0.40)")
    assert "not compared, no" in pairing.compared("P1", here, [{"failed": "no"}])


def test_reports_are_timed_with_the_uniqueness_of_their_answers(run: Any, solids: Any) -> None:
    """The smallest cases, in the plane and in space; each is a row of the table."""
    import report

    rows = [report.measured(case) for case in report.QUICK]
    assert all(row["unique"] and row["ratio"] > 0 for row in rows)
    assert report.table(rows).count("quick") == 2


def test_newton_does_not_wait_for_multigrid(solids: Any) -> None:
    """Loads met to 1e-10 leave forces less exact than Newton asks: it came no further, 117 times."""
    scene = solids.Scene(solids.Case("some", 12, 10, 6, linear="AMG"))
    results = list(scene.solver().history(scene.path[3:6]))
    assert max(result.iterations for result in results) <= 6


def test_tables_of_condensed_ranks_are_those_of_the_stored_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The page on PETSc shows what the runs stored; answers are those of one process."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    import ranks_condensed

    runs = json.loads(ranks_condensed.STORED.read_text(encoding="utf-8"))
    found = ranks_condensed.tables(runs)
    assert {name: marked("checks/petsc.md", name) for name in found} == found
    assert max(run["ways"]["condensed"]["away"] for run in runs) < 1e-9


def test_tables_of_ranks_are_those_of_the_stored_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page on PETSc shows what the runs stored; iterations hardly depend on the number of ranks."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    import ranks

    runs = json.loads(ranks.STORED.read_text(encoding="utf-8"))
    shown = {name: marked("checks/petsc.md", name) for name in ("measured", "plan")}
    assert shown == ranks.tables(runs)
    for size in {run["elements"] for run in runs}:
        first = [run["solves"][0]["iterations"] for run in runs if run["elements"] == size]
        assert max(first) <= min(40, 1.2 * min(first))


@pytest.fixture
def friction(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The modules of benchmarks/friction_problems.py."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    names = ("friction_problems", "gauss_seidel", "run", "cases")
    yield import_module("friction_problems")
    for name in names:
        sys.modules.pop(name, None)


def stacked_blocks(points: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Compliance of rank 6 of so many points on one rigid block, and free velocities, (m, 3)."""
    rng = np.random.default_rng(seed)
    H = np.zeros((6, 3 * points))
    arms = rng.standard_normal((points, 3))
    for i, r in enumerate(arms):
        H[:3, 3 * i : 3 * i + 3] = np.eye(3)
        H[3:, 3 * i : 3 * i + 3] = [[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]]
    return H.T @ H, (H.T @ [-1.0, 0.2, 0.1, 0.05, 0.1, -0.1]).reshape(points, 3)


@pytest.mark.parametrize("blocks", [False, True])
def test_a_file_of_friction_is_read_and_solved(friction: Any, blocks: bool, tmp_path: Path) -> None:
    """Six motions on eight points: forces are not unique, and both ways find some."""
    W, q = stacked_blocks(8, 0)
    if blocks:
        head = ["3 8 1", "24 24", "64 8 8", *[" ".join(str(3 * i + 3) for i in range(8))] * 2]
        head += ["9 64", " ".join(str(8 * i) for i in range(9)), " ".join(map(str, [*range(8)] * 8))]
        body = [
            f"{8 * i + j} "
            + " ".join(map(repr, W[3 * i : 3 * i + 3, 3 * j : 3 * j + 3].T.ravel().tolist()))
            for i in range(8)
            for j in range(8)
        ]
    else:
        head, body = ["3 8 0", "24 24", "24 24"], [" ".join(map(repr, W.ravel().tolist()))]
    tail = [" ".join(map(repr, q.ravel().tolist())), " ".join(["0.3"] * 8)]
    path = tmp_path / "stack.dat"
    path.write_text("\n".join([*head, *body, *tail]), encoding="utf-8")
    problem = friction.read(path)
    np.testing.assert_array_equal(problem.W.toarray(), W)
    r, _, way = friction.newton(problem)
    assert way in ("cold", "proximal") and problem.error(r) < 1e-10
    left = 1e-10 * r[:, 0].max()  # the loop ends at this share of the largest force
    assert np.all(np.linalg.norm(r[:, 1:], axis=1) <= 0.3 * r[:, 0] + left) and left > 0
    other, _ = friction.gauss_seidel(problem.W, q, problem.mu, problem.error, 1e-6, 20.0)
    assert problem.error(other) <= 1e-6
    # what forces do to the block is the same, whatever they are
    np.testing.assert_allclose(W @ other.ravel(), W @ r.ravel(), atol=1e-3 * np.abs(q).max())


def test_forces_that_are_none_are_told(friction: Any) -> None:
    """Two points that press freely by themselves: the error of no force is what they overlap by."""
    from scipy.sparse import identity

    q = np.array([[-3.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    problem = friction.Problem("two", identity(6, format="csr"), q, np.array([0.5, 0.5]))
    assert problem.error(np.zeros((2, 3))) == pytest.approx(3 / 5)
    assert problem.error(np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])) == 0.0


def grains(seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Four rigid bodies that touch at twelve points in the plane: W, q and mu."""
    rng = np.random.default_rng(seed)
    bodies, points = 4, 12
    H = np.zeros((3 * bodies, 2 * points))
    for i in range(points):
        pair, angle = rng.choice(bodies, 2, replace=False), rng.uniform(0, 2 * np.pi)
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        for body, sign in zip(pair, (1, -1), strict=True):
            x, y = rng.standard_normal(2)
            for k, (a, b) in enumerate(axes):
                H[3 * body : 3 * body + 3, 2 * i + k] += sign * np.array([a, b, x * b - y * a])
    q = (H.T @ rng.standard_normal(3 * bodies)).reshape(points, 2)
    return H.T @ H, q, float(rng.choice([0.5, 1.0, 2.0]))


@pytest.mark.parametrize("seed", [9, 26, 40, 51])
def test_the_proximal_point_answers_in_the_plane(friction: Any, seed: int) -> None:
    """Of 400 such problems Newton answers two thirds, and this the others but one; if springs began at
    rest under no forces in the end, more would be missed, these among them."""
    from scipy.sparse import csr_matrix

    W, q, mu = grains(seed)
    problem = friction.Problem("grains", csr_matrix(W), q, np.full(len(q), mu))
    r, _, way = friction.newton(problem)
    assert way == "proximal" and problem.error(r) < 1e-9
