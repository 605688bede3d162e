"""The named numbers of the library, each doubled and halved: which test notices it?

    python benchmarks/named_numbers.py --reach [FILE ...]   which tests reach functions with numbers
    python benchmarks/named_numbers.py [--only NAME ...] [--tests FILE ...]    double and halve
    python benchmarks/named_numbers.py --missing            only what no test is known to notice yet
    python benchmarks/named_numbers.py --write              docs/checks/numbers.md from what is stored

A number is a name in capitals to which a module assigns a number (or several of them). It is replaced
in every module that has it, and what modules compute from it when they are imported is computed anew.
Tests run in a fork of a process that has imported the library, until one fails or the time is up:
those of some files, or of all files in turn those that reach the number and else the least.
Stores `benchmarks/results/named_numbers.json`; which tests reach a function is kept in a file of the
system's temporary directory, as it is large and soon made again. Needs `os.fork`.
"""

from __future__ import annotations

import argparse
import ast
import gc
import importlib
import json
import os
import signal
import sys
import tempfile
import time
import types
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PACKAGE = "skfem_contact"
STORED = ROOT / "benchmarks" / "results" / "named_numbers.json"
REACHED = Path(tempfile.gettempdir()) / "skfem_contact_reached"
FACTORS = {"doubled": 2.0, "halved": 0.5}
Function = tuple[str, int, str]  # file, first line, name


@dataclass
class Number:
    """A named number: where it stands, the comment above it, and the functions that use it."""

    module: str
    name: str
    value: str
    reason: str
    users: set[Function] = field(default_factory=set)

    @property
    def key(self) -> str:
        """The package, or the module beside packages, and the name."""
        parts = self.module.split(".")
        return f"{parts[1]}.{self.name}"


# What decides nothing in the answer: how much is worked on or kept at a time, what is drawn and said,
# and constants of formulas and of other programs, of what has no bound, and of what no mesh has.
TIME = {
    *("FEW_PAIRS", "NEWTON_STEPS", "LEAF", "MOST_TWINS", "MOST_DIRECTIONS", "KEPT_BESIDE", "PER_ROWS"),
    *("FACTORS_2D", "FACTORS_3D", "SPARE", "FEWEST", "FEW_MODES", "FEW", "petsc.LATER"),
    *("ASKED", "LAYERS", "problem.SHARE", "problem.SURPLUS", "petsc.SURPLUS", "petsc.AGAIN"),
    *("PER_BYTE", "CUBES_PER_ENTRY", "CYCLES", "ROUGHLY", "problem.STIFFER", "MOST_POINTS"),
    "WORTH_IMPORT",
}
# Where a search begins, how it goes on and when it is given up. The equations judge what it ends at, so
# that another number finds the same, sooner or later, or more often or less.
SEARCH = {
    *("SHARES", "SHIFTS", "CONTACT_ITERATIONS", "PLAIN", "DECREASE", "HALVINGS", "NEWTON_ITERATIONS"),
    *("WEAK_SPRINGS", "SOFTEST", "EASED", "NEAR", "MOST_IN_SERIES", "TOO_SOFT", "RISES", "MOST_MOVES"),
    *("MOST_PRODUCTS", "GIVE", "BULGE", "LEAST_CURVATURE", "history.WEAK", "FIRM"),
}
WORDS = {
    "assemblies.PALE",
    "assemblies.LINE",
    "assemblies.STRONG",
    "NAMED",
    "NOT_NAMED",
    "MISSED_AFTER",
    "pairing.FINER",
    "pairing.STIFFER",
    "MOST_ROWS",
    "elimination.SHOWN",
}
CONSTANTS = {
    "SOLUTION",
    "ELIMINATED",
    "FORMAT",
    "GAUSS",
    "NONE",
    "NO_ROW",
    "MIRRORED",
    "WIDTHS",
    "ROUNDING",
    "BEYOND",
    "BETWEEN",
    "HEIGHTS",
}


def use(number: Number) -> str:
    """What a number is for: it decides, or it is one of time, of a search, of words, or a constant."""
    mine = {number.name, number.key}
    if mine & CONSTANTS:
        return "constant"
    if mine & TIME or number.name.endswith("AT_ONCE"):
        return "time and memory"
    if mine & SEARCH:
        return "search"
    if mine & WORDS or number.key.startswith("output."):
        return "words and pictures"
    return "decides"


# -- what there is --------------------------------------------------------------------------------


def is_number(node: ast.expr) -> bool:
    """Whether an expression is a number, arithmetic of numbers, or a tuple of these."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return is_number(node.operand)
    if isinstance(node, ast.BinOp):
        return is_number(node.left) and is_number(node.right)
    if isinstance(node, ast.Tuple):
        return all(is_number(entry) and not isinstance(entry, ast.Tuple) for entry in node.elts)
    return isinstance(node, ast.Call) and any(map(is_number, node.args))


def assigned(tree: ast.Module) -> Iterator[tuple[str, ast.expr, int]]:
    """Names in capitals, what they stand for, and the line, of a module's assignments."""
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and node.value:
            pairs = [(node.target, node.value)]
        elif isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
            several = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
            pairs = list(zip(target.elts, value.elts, strict=True)) if several else [(target, value)]  # type: ignore
        else:
            continue
        for name, expression in pairs:
            if isinstance(name, ast.Name) and name.id.isupper():
                yield name.id, expression, node.lineno


def comment_above(lines: list[str], number: int) -> str:
    """The comment that ends above a line, or stands at its end."""
    above: list[str] = []
    at = number - 2
    while at >= 0 and lines[at].startswith("#") and not lines[at].startswith("# --"):
        above.insert(0, lines[at].lstrip("#: "))
        at -= 1
    _, mark, beside = lines[number - 1].partition("  # ")
    return " ".join([*above, *([beside] if mark else [])])


def functions(code: types.CodeType) -> Iterator[types.CodeType]:
    """All functions in the code of a module, inner ones as well."""
    for part in code.co_consts:
        if isinstance(part, types.CodeType):
            yield part
            yield from functions(part)


def named_numbers(used: bool = True) -> list[Number]:
    """All of them, with the functions that use them by their name where that is asked for."""
    found: dict[tuple[str, str], Number] = {}
    sources = {
        file: file.read_text(encoding="utf-8") for file in sorted((ROOT / PACKAGE).rglob("*.py"))
    }
    for file, source in sources.items():
        module = ".".join(file.relative_to(ROOT).with_suffix("").parts)
        for name, expression, line in assigned(ast.parse(source)):
            if is_number(expression):
                reason = comment_above(source.splitlines(), line)
                found[module, name] = Number(module, name, ast.unparse(expression), reason)
    for file, source in sources.items() if used else ():
        module = ".".join(file.relative_to(ROOT).with_suffix("").parts)
        known = imported(ast.parse(source)) | {n: (module, n) for m, n in found if m == module}
        code = compile(source, str(file), "exec")
        for function in functions(code):
            for name in function.co_names:
                owner = found.get(known.get(name, ("", name)))
                if owner:
                    owner.users.add(
                        (str(file.relative_to(ROOT)), function.co_firstlineno, function.co_name)
                    )
    return list(found.values())


def imported(tree: ast.Module) -> dict[str, tuple[str, str]]:
    """What the names that are imported from modules of the library stand for there."""
    return {
        alias.asname or alias.name: (node.module or "", alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(PACKAGE)
        for alias in node.names
    }


# -- which tests reach a function -----------------------------------------------------------------


class Reach:
    """A plugin of pytest that notes the functions with numbers that each test reaches, and its time."""

    def __init__(self, wanted: set[Function], seconds: float) -> None:
        # by file and line, as lambdas and comprehensions have one name
        self.wanted = {
            (str(ROOT / file), line, name): f"{file}:{line}:{name}" for file, line, name in wanted
        }
        self.tests: dict[str, tuple[float, list[str]]] = {}
        self.until = time.process_time() + seconds

    def pytest_runtest_protocol(self, item: Any, nextitem: Any) -> Any:
        """Runs a test with all its fixtures, and looks at which functions begin."""
        from _pytest.runner import runtestprotocol

        if time.process_time() > self.until:
            return True
        reached: set[str] = set()
        wanted = self.wanted

        def calls(frame: types.FrameType, event: str, argument: Any) -> None:
            code = frame.f_code
            at = wanted.get((code.co_filename, code.co_firstlineno, code.co_name))
            if at:
                reached.add(at)

        start = time.process_time()
        sys.settrace(calls)
        try:
            runtestprotocol(item, nextitem=nextitem, log=False)
        finally:
            sys.settrace(None)
        self.tests[item.nodeid] = (round(time.process_time() - start, 4), sorted(reached))
        return True


def reach(files: list[str], seconds: float) -> None:
    """Runs test files, each in a fork with a limit, and stores what their tests reach."""
    import pytest

    import_all()
    wanted = set().union(*(number.users for number in named_numbers()))
    REACHED.mkdir(exist_ok=True)
    for file in files:
        kept = REACHED / (file.replace("/", "+") + ".json")
        if kept.exists():
            continue
        kept.touch()
        pid = os.fork()
        if pid == 0:
            quiet()
            plugin = Reach(wanted, seconds)
            pytest.main(
                [
                    file,
                    "-q",
                    "-p",
                    "no:cacheprovider",
                    "-p",
                    "no:faulthandler",
                    "-W",
                    "ignore::pytest.PytestAssertRewriteWarning",
                ],
                plugins=[plugin],
            )
            kept.write_text(json.dumps(plugin.tests), encoding="utf-8")
            os._exit(0)
        os.waitpid(pid, 0)


def import_all() -> None:
    """Everything that tests import, so that forks begin at once."""
    sys.path.insert(0, str(ROOT / "tests"))
    sys.path.insert(0, str(ROOT))
    for extra in ("hypothesis", "matplotlib.pyplot", "pyamg", "meshio", "threadpoolctl"):
        importlib.import_module(extra)
    for file in sorted((ROOT / PACKAGE).rglob("*.py")):
        parts = file.relative_to(ROOT).with_suffix("").parts
        if "petsc" not in parts:
            importlib.import_module(".".join(parts).removesuffix(".__init__"))


def quiet() -> None:
    """Nothing that a fork writes is seen."""
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)


# -- doubled and halved ---------------------------------------------------------------------------


def changed(expression: str, value: Any, factor: float) -> Any:
    """Another value: of `1 - x` it is x that changes; of several, all; and whole ones stay whole."""
    if isinstance(value, tuple):
        return tuple(changed("", entry, factor) for entry in value)
    if isinstance(value, int):
        return int(value * factor)
    if expression.startswith(("1 - ", "1.0 - ")):
        return 1.0 - factor * (1.0 - value)
    return value * factor


def replace(number: Number, factor: float) -> None:
    """The other value in all modules that have the number, tests included, and what follows from it."""
    old = vars(sys.modules[number.module])[number.name]
    put(number.module, number.name, changed(number.value, old, factor))


def put(home: str, name: str, value: Any) -> None:
    """A value in all modules that have what a name stands for; then what modules compute from it."""
    old = vars(sys.modules[home])[name]
    for at, module in list(sys.modules.items()):
        if vars(module).get(name) is old and (at == home or name in from_there(module, home)):
            setattr(module, name, value)
            if at.startswith(PACKAGE):
                source = Path(module.__file__ or "").read_text(encoding="utf-8")
                for other, expression, _ in assigned(ast.parse(source)):
                    used = {node.id for node in ast.walk(expression) if isinstance(node, ast.Name)}
                    if name in used and is_number(expression):
                        put(at, other, eval(ast.unparse(expression), vars(module)))


def from_there(module: types.ModuleType, home: str) -> set[str]:
    """The names that a module imports from another one."""
    file = getattr(module, "__file__", None) or ""
    if not file.startswith(str(ROOT)):
        return set()
    known = imported(ast.parse(Path(file).read_text(encoding="utf-8")))
    return {name for name, (where, _) in known.items() if where == home}


def chosen(number: Number, tests: dict[str, tuple[float, list[str]]], seconds: float) -> list[str]:
    """Tests that reach the number, of each file those first that reach least, for so many seconds."""
    users = {(file, name) for file, _, name in number.users}  # lines may have moved since
    rows = defaultdict(list)
    for test, (took, reached) in tests.items():
        if any((at.split(":")[0], at.split(":")[2]) in users for at in reached):
            rows[test.partition("::")[0]].append((len(reached), took, test))
    ranked = sorted((place, *entry) for row in rows.values() for place, entry in enumerate(sorted(row)))
    found: dict[str, list[str]] = defaultdict(list)  # by file, as its tests share what they set up
    total = 0.0
    for _, _, took, test in ranked:
        if total + took <= seconds:
            total += took
            found[test.partition("::")[0]].append(test)
    return [test for row in found.values() for test in sorted(row)]


class Changes:
    """A plugin of pytest that runs for each number the tests that reach it, in forks that change it."""

    def __init__(
        self, numbers: list[Number], seconds: float, part: int, parts: int, files: list[str], known: Any
    ) -> None:
        self.files = files  # all of whose tests are asked, whatever they reach
        self.known = known  # by number, what is not asked again
        self.passing: set[str] = set()  # tests that do so in a fork without a change
        self.failed = False
        self.numbers, self.seconds = numbers[part::parts], seconds
        self.kept = REACHED / f"changes-{part}.json"
        self.tests = {
            t: v
            for f in REACHED.glob("tests+*.json")
            if f.stat().st_size
            for t, v in json.loads(f.read_text()).items()
        }

    def pytest_runtestloop(self, session: Any) -> bool:
        """All numbers in turn; what is found is stored on the way."""
        items = {item.nodeid: item for item in session.items}
        tests = {n: v for n, v in self.tests.items() if n in items and "test_threads" not in n}
        found: dict[str, Any] = json.loads(self.kept.read_text()) if self.kept.exists() else {}
        gc.collect()
        gc.freeze()  # what tests collect is then small
        for number in self.numbers:
            names = list(items) if self.files else chosen(number, tests, self.seconds)
            row = found.setdefault(number.key, dict(self.known.get(number.key, {})))
            for factor in FACTORS:
                if names and not row.get(factor):
                    row[factor] = self.noticed(number, FACTORS[factor], [items[name] for name in names])
            row["tests"] = len(names)
            self.kept.write_text(json.dumps(found, indent=1), encoding="utf-8")
        return True

    def noticed(self, number: Number, factor: float, items: list[Any]) -> str | None:
        """The first test that fails with the changed number, and passes in the same place without."""
        while failed := self.forked(number, factor, items):
            asked = [item for item in items if item.nodeid == failed]
            if not asked or failed in self.passing or not self.forked(number, 1.0, asked):
                self.passing.add(failed)
                break
            items = [item for item in items if item.nodeid != failed]
        return failed

    def forked(self, number: Number, factor: float, items: list[Any]) -> str | None:
        """The first test that fails in a fork with the changed number, "time" if none ends, or None."""
        read, write = os.pipe()
        pid = os.fork()
        if pid == 0:
            os.close(read)
            quiet()
            signal.setitimer(signal.ITIMER_PROF, 20.0 + 3 * self.seconds)
            replace(number, factor)
            os.write(write, (self.first_failure(items) or "").encode())
            os._exit(0)
        os.close(write)
        with os.fdopen(read) as answer:
            failed = answer.read()
        _, status = os.waitpid(pid, 0)
        return failed or ("time" if status else None)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Notes that a test of this process failed."""
        self.failed |= report.failed

    def first_failure(self, items: list[Any]) -> str | None:
        """The first of some tests that fails, with the filters of warnings that it asks for."""
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.ihook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.failed:
                return str(item.nodeid)
        return None


def change(
    numbers: list[Number], seconds: float, part: int, parts: int, files: list[str], known: Any
) -> None:
    """Collects all tests once, and changes numbers in forks."""
    import pytest

    import_all()
    plugin = Changes(numbers, seconds, part, parts, files, known)
    files = files or sorted({test.partition("::")[0] for test in plugin.tests})
    pytest.main(
        [*files, "-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"],
        plugins=[plugin],
    )


# -- the list -------------------------------------------------------------------------------------


def stored() -> dict[str, Any]:
    """What is known of each number."""
    return dict(json.loads(STORED.read_text(encoding="utf-8"))) if STORED.exists() else {}


def store() -> None:
    """Puts what all processes found into the file of the repository, and drops names that are gone."""
    known = {number.key for number in named_numbers(used=False)}
    found = stored()
    for part in sorted(REACHED.glob("changes-*.json")):
        for key, row in json.loads(part.read_text(encoding="utf-8")).items():
            found[key] = {**found.get(key, {}), **{k: v for k, v in row.items() if v is not None}}
    found = {key: found[key] for key in sorted(known & set(found))}
    STORED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def noticed(row: dict[str, Any] | None) -> str:
    """The words of the list about who notices a change."""
    if not row or not row.get("tests"):
        return "not asked"
    told = []
    for factor in FACTORS:
        test = str(row.get(factor) or "none")
        told.append("no end" if test == "time" else test.removeprefix("tests/").partition("[")[0])
    return told[0] if told[0] == told[1] else f"{told[0]}; {told[1]}"


def page() -> str:
    """The page of developers with all numbers."""
    known = stored()
    rows = defaultdict(list)
    for number in sorted(named_numbers(used=False), key=lambda n: (n.key.partition(".")[0], n.name)):
        row, of = known.get(number.key, {}), use(number)
        told = of == "decides" or (of == "search" and any(map(row.get, FACTORS)))
        who = noticed(row) if told else f"({of})"
        cells = (number.name, number.value, number.reason, who)
        line = " | ".join(cell.replace("|", "\\|").replace("*", "\\*") for cell in cells)
        rows[number.key.partition(".")[0]].append(f"| {line} |")
    found = [HEAD]
    for package, lines in rows.items():
        head = ["| name | value | reason | test that fails: doubled; halved |", "|---|---|---|---|"]
        found += [f"## {package}", "\n".join([*head, *lines])]
    return "\n\n".join(found) + "\n"


HEAD = """# Named numbers

Every name of the library to which a module assigns a number, with the comment above it. A number that
decides is doubled and halved by `benchmarks/named_numbers.py`: the last column has the first of the
tests asked that fails then, and passes without. "none" means that none of those asked does, "not asked"
that it has not been tried. Numbers that trade time for memory, those of words and pictures, constants,
and those of searches whose end is judged by the equations (where they begin, how they go on, when they
are given up) decide nothing in the answer. This page is made by
`python benchmarks/named_numbers.py --write`."""


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--reach", nargs="*")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--only", nargs="*", help="package.NAME, or package")
    parser.add_argument("--missing", action="store_true", help="directions that no test notices")
    parser.add_argument("--tests", nargs="*", default=[], help="files of tests to ask, and no others")
    parser.add_argument("--part", type=int, nargs=2, default=(0, 1), help="which of how many processes")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    if given.write:
        store()
        (ROOT / "docs" / "checks" / "numbers.md").write_text(page(), encoding="utf-8")
    elif given.reach is not None:
        reach(
            given.reach
            or [str(f.relative_to(ROOT)) for f in sorted((ROOT / "tests").rglob("test_*.py"))],
            given.seconds,
        )
    else:
        every = [number for number in named_numbers() if use(number) == "decides"]
        order = given.only or ["all"]
        some = [n for w in order for n in every if w in ("all", n.key, n.key.partition(".")[0])]
        known = stored() if given.missing else {}
        some = [n for n in some if not all(known.get(n.key, {}).get(f) for f in FACTORS)]
        change(some, given.seconds, given.part[0], given.part[1], given.tests, known)
