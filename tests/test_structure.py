"""The packages stand in the order of the theory: each imports only from those above it."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path

import pytest
import skfem as fem
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem.models.elasticity import linear_elasticity

import skfem_contact

ROOT = Path(skfem_contact.__file__).parent
LISTED = re.findall(
    r"`(\w+)`", skfem_contact.__doc__.split("each imports only from those above it:")[1]
)
COMMON = (
    "errors",
    "arguments",
    "arrays",
    "digits",
    "records",
    "trees",
)
ORDER = [name for name in LISTED if name not in (*COMMON, "reference")]
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in ROOT.rglob("*.py")
    if path.name != "__init__.py"
)

PRESETS = ("fast", "balanced", "accurate")  # of `Options`, whose numbers are their documentation


@cache
def parsed(name):
    """Syntax tree of a module."""
    return ast.parse(ROOT.joinpath(*name.split(".")).with_suffix(".py").read_text())


@cache
def imports(name):
    """Modules of this library that one imports, wherever: on top, in functions, for types."""
    found = set()
    for node in ast.walk(parsed(name)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("skfem_contact"):
            inside = node.module.removeprefix("skfem_contact").removeprefix(".")
            named = {".".join(filter(None, (inside, alias.name))) for alias in node.names}
            here = {inside} if inside in MODULES else named & set(MODULES)
            assert here, f"{name} imports from {node.module}, which is not a module of this library"
            found |= here
    return found


def test_every_package_is_listed_once():
    """The list of packages in the docstring is complete and has none that do not exist."""
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {"reference"}
    assert sorted(ORDER) == sorted(packages)
    assert sorted(COMMON) == sorted(path.stem for path in ROOT.glob("*.py") if path.stem != "__init__")


@pytest.mark.parametrize("package", ORDER)
def test_packages_import_only_from_those_above(package):
    """No package depends on one that comes later, not in a function and not for a type."""
    above = {*COMMON, *ORDER[: ORDER.index(package) + 1]}
    for name in MODULES:
        if name.split(".")[0] == package:
            assert {other.split(".")[0] for other in imports(name)} <= above, name


def test_nothing_imports_the_solvers_over_ranks():
    """PETSc plugs in as a backend: neither does a module name it, nor does a solve load it."""
    users = {name: imports(name) for name in MODULES if not name.startswith("petsc.")}
    assert [name for name, used in users.items() if any(m.startswith("petsc.") for m in used)] == []
    program = """
import sys
import skfem as fem
import skfem_contact as sc
from skfem.models.elasticity import linear_elasticity

mesh = fem.MeshQuad().refined(2).with_defaults()
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.0, -0.01)}, name="block")
foot = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)))
print(sc.ContactSolver(block, foot).solve().certificate.worst < 1e-9)
print([name for name in sys.modules if name.startswith(("skfem_contact.petsc", "petsc4py", "mpi4py"))])
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["True", "[]"]


@pytest.mark.parametrize("name", COMMON)
def test_what_all_packages_use_needs_none_of_them(name):
    """Errors and checks of arguments stand below all packages."""
    assert imports(name) <= set(COMMON)


def test_no_circle_of_modules():
    """Modules that import each other, in functions or for types alone, would be one module."""
    number = {name: i for i, name in enumerate(MODULES)}
    arrows = [(number[a], number[b]) for a in MODULES for b in imports(a)]
    rows, columns = zip(*arrows, strict=True)
    graph = coo_array(([1] * len(arrows), (rows, columns)), shape=(len(MODULES),) * 2)
    _, circle = connected_components(graph, connection="strong")
    together = {c: [m for m in MODULES if circle[number[m]] == c] for c in set(circle)}
    assert [names for names in together.values() if len(names) > 1] == []


@pytest.mark.parametrize(
    "package", sorted(p.parent for p in ROOT.rglob("*/__init__.py")), ids=lambda p: p.name
)
def test_a_package_says_what_is_in_it(package):
    """The docstring of each package names all its modules and packages, and nothing else."""
    if package.name == "reference":
        return
    text = ast.get_docstring(ast.parse((package / "__init__.py").read_text()))
    inside = {path.stem for path in package.glob("*.py")} - {"__init__"}
    inside |= {path.parent.name for path in package.glob("*/__init__.py")}
    assert set(re.findall(r"`(\w+)`", text)) == inside


def test_closed_forms_depend_on_nothing():
    """The closed forms are independent of what they are compared with."""
    for name in MODULES:
        if name.startswith("reference."):
            used = {other.split(".")[0] for other in imports(name)}
            assert used <= {"reference", "arguments", "errors"}


@pytest.mark.parametrize("name", [m for m in MODULES if m.split(".")[0] not in ("output", "reference")])
def test_small_numbers_have_a_name_and_a_source(name):
    """Tolerances stand at the top of a module, where it is said what they are."""
    inside = [part for part in ast.walk(parsed(name)) if isinstance(part, ast.FunctionDef)]
    numbers = [
        node.value
        for part in inside
        if part.name not in PRESETS
        for node in ast.walk(part)
        if isinstance(node, ast.Constant) and isinstance(node.value, float)
    ]
    assert not [value for value in numbers if 0 < abs(value) < 1e-2], name


def test_what_takes_long_to_import_waits_until_it_is_used():
    """Half of the import was SciPy's trees; `trees` has them, and others ask it for one."""
    late = ("scipy.spatial", "scipy.optimize", "scipy.special", "scipy.interpolate", "scipy.integrate")
    for name in MODULES:
        for node in parsed(name).body:  # on top, not in functions
            found = node.module if isinstance(node, ast.ImportFrom) else None
            assert not str(found).startswith(late), f"{name}: import it where it is used"


def test_the_way_of_a_load_step_is_as_it_is_told():
    """The modules that the docstring of the package lists call each other, in its order."""
    told = re.findall(r"^    (\w+/\w+) ", skfem_contact.__doc__, re.M)
    way = [str(ROOT / f"{name}.py") for name in told]
    mesh = fem.MeshHex().refined(1).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    move = {"top": (0.002, -0.01, 0.0)}
    block = skfem_contact.Body(basis, linear_elasticity(), D="top", x=move, name="block")
    floor, rough = skfem_contact.RigidPlane((0, 0, 0), (0, 1, 0)), skfem_contact.Coulomb(0.3)
    solver = skfem_contact.ContactSolver(
        block, skfem_contact.Contact(block.surface("bottom"), floor, friction=rough)
    )
    passed = set()

    def called(frame, event, _):
        if event == "call" and frame.f_code.co_filename == way[-1]:
            outer = []
            while frame is not None:
                outer.append(frame.f_code.co_filename)
                frame = frame.f_back
            passed.add(tuple(dict.fromkeys(name for name in reversed(outer) if name in way)))

    before = sys.getprofile()
    sys.setprofile(called)
    try:
        solver.solve()
    finally:
        sys.setprofile(before)
    assert tuple(way) in passed


def test_a_plain_scene_imports_what_it_needs():
    """A first solution and its print wait for nothing that other jobs need; garbage is looked for."""
    program = """
import gc
import sys
import skfem as fem
from skfem.models.elasticity import linear_elasticity

gc.collect()
looked = []
gc.callbacks.append(lambda phase, info: looked.append(phase))
import skfem_contact as sc
gc.callbacks.clear()

mesh = fem.MeshQuad().refined(2).with_defaults()
upper = sc.Body.from_mesh(
    mesh.translated((0.0, 1.0)), fem.ElementVector(fem.ElementQuad1()), linear_elasticity(),
    D="top", x={"top": (0.0, -0.01)}, name="upper",
)
lower = sc.Body.from_mesh(
    mesh, fem.ElementVector(fem.ElementQuad1()), linear_elasticity(), D="bottom", name="lower"
)
contact = sc.Contact(upper.surface("bottom"), lower.surface("top"), friction=sc.Coulomb(0.3))
result = sc.ContactSolver([upper, lower], [contact]).solve()
print(len(str(result)) > 100, gc.isenabled(), *looked)
print(*[name.removeprefix("skfem_contact.") for name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    said, loaded = done.stdout.splitlines()
    assert said == "True True"
    needless = {
        "answers.estimate",
        "answers.uniqueness",
        "elimination.constraint",
        "history.checkpoint",
        "history.dry_run",
        "history.neutral_equilibrium",
        "linalg.amg",
        "loops.lemke",
        "obstacles.shapes",
        "obstacles.faceted",
        "output",
        "problem.iterated",
        "problem.full",
        "reference",
        "scipy.optimize",
        "scipy.spatial",
    }
    assert not needless & set(loaded.split())


# ------------------------------------------------------------------------- what tests take from inside

MOST_PLACES = 20  # inside the library, from which tests import
TESTS = sorted(Path(__file__).parent.rglob("*.py"))
LIBRARY = "skfem_contact."


def listed():
    """The places inside the library that docs/entrances.md has, and what tests may take there."""
    page = (Path(__file__).parents[1] / "docs" / "entrances.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `skfem_contact\.([\w.]+)` \|.*\| (.*) \|$", page, re.M)
    return {place: set(re.findall(r"`(\w+)`", names)) for place, names in rows}


def public(place):
    """The names that a package or module says are public."""
    return getattr(import_module(place), "__all__", ())


@cache
def taken():
    """The places inside the library and the names that tests import from there."""
    found = {}
    for path in TESTS:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                pairs = [(alias.name, None) for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                pairs = [(node.module, alias.name) for alias in node.names]
            else:
                continue
            for place, name in pairs:
                if place.startswith(LIBRARY) and name not in public(place):
                    inside = place.removeprefix(LIBRARY)
                    whole = f"{inside}.{name}" in MODULES  # the module itself is a place
                    found.setdefault(f"{inside}.{name}" if whole else inside, set()).add(name)
    return found


def handed_out(package):
    """The names that a package has for tests and extensions, by module."""
    tree = ast.parse((ROOT.joinpath(*package.split(".")) / "__init__.py").read_text(encoding="utf-8"))
    calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and len(n.args) == 3]
    return {
        module: names.split()
        for call in calls
        for module, names in ast.literal_eval(call.args[2]).items()
    }


def test_tests_import_from_few_places_inside_the_library():
    """A test of behaviour uses public names; every other place is listed with its reason."""
    assert len(listed()) <= MOST_PLACES
    assert taken() == listed()


def test_tests_name_no_module_in_a_string():
    """What is replaced for a test is found by package and name, by `internals`."""
    for path in TESTS:
        assert (
            'setattr("skfem_contact' not in path.read_text(encoding="utf-8")
            or path.name == Path(__file__).name
        )


@pytest.mark.parametrize("package", sorted(p for p in listed() if p not in MODULES))
def test_a_package_hands_out_what_is_listed(package):
    """Each name once, from the module that defines it, and none that no test takes."""
    names = [name for inside in handed_out(package).values() for name in inside]
    assert sorted({*names} - {*public(LIBRARY + package)}) == sorted(listed()[package])
    assert len(names) == len({*names})
    for module, inside in handed_out(package).items():
        # a public name may stand in another package: ".answers.tangent.derivatives" of `history`
        body = parsed(resolve_name(f".{module}", LIBRARY + package).removeprefix(LIBRARY)).body
        defined = {getattr(n, "name", None) for n in body}
        defined |= {t.id for n in body for t in ast.walk(n) if isinstance(t, ast.Name)}
        assert set(inside) <= defined, module
