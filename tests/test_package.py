"""What is published agrees with itself: one version, one list of dependencies, one description."""

from __future__ import annotations

import ast
import inspect
import json
import re
import sys
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np
import pytest

import skfem_contact as sc

ROOT = Path(__file__).parents[1]


def text(name: str) -> str:
    """A file of the repository."""
    return (ROOT / name).read_text(encoding="utf-8")


def project() -> dict:
    """The table of the project in pyproject.toml, by the standard library where it can."""
    if sys.version_info < (3, 11):
        pytest.skip("tomllib came with Python 3.11")
    import tomllib

    return tomllib.loads(text("pyproject.toml"))


@pytest.mark.parametrize(
    ("file", "pattern"),
    [
        ("CITATION.cff", r"^version: (.+)$"),
        ("codemeta.json", r'"version": "(.+)"'),
        ("recipe/meta.yaml", r'{% set version = "(.+)" %}'),
        ("CHANGELOG.md", r"^## \[(\d.+?)\]"),
    ],
)
def test_one_version_everywhere(file: str, pattern: str) -> None:
    """Other files cannot import the version, so they are held to it; the changelog by its newest."""
    assert re.search(pattern, text(file), re.MULTILINE).group(1) == sc.__version__


def test_version_is_read_without_importing() -> None:
    """The build reads the version from the source, a plain string; pyproject.toml has no other."""
    tree = ast.parse(text("skfem_contact/__init__.py"))
    found = [
        n.value for n in tree.body if isinstance(n, ast.Assign) and n.targets[0].id == "__version__"
    ]
    assert ast.literal_eval(found[0]) == sc.__version__
    table = project()
    assert "version" not in table["project"]
    assert table["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "skfem_contact.__version__"}


CONVERTING = [
    sc.conditions.Archard,
    sc.Coulomb,
    sc.RigidCylinder,
    sc.RigidPlane,
    sc.RigidPolyline,
    sc.RigidSphere,
    sc.RigidSurface,
    sc.Tresca,
]


@pytest.mark.parametrize("kind", CONVERTING)
def test_constructors_take_the_fields(kind: type) -> None:
    """Classes with a constructor of their own, for its types, take what a dataclass would take."""
    assert not kind.__dataclass_params__.init
    by_position = sorted(fields(kind), key=lambda f: bool(f.kw_only))
    wanted = {f.name: (bool(f.kw_only), f.default) for f in by_position}
    empty = inspect.Parameter.empty
    found = {
        p.name: (p.kind is p.KEYWORD_ONLY, MISSING if p.default is empty else p.default)
        for p in inspect.signature(kind).parameters.values()
    }
    assert list(found.items()) == list(wanted.items())


def test_lists_are_kept_as_arrays() -> None:
    """What is read is what the types say, whatever went in; numbers stay numbers."""
    for read in (sc.Coulomb([0.1, 0.2]).mu, sc.Tresca((1, 2)).tau_max, sc.conditions.Archard([1, 2]).k):
        assert isinstance(read, np.ndarray) and read.dtype == float and not read.flags.writeable
    assert sc.Coulomb(0.3, cohesion=[0, 1]).cohesion.tolist() == [0.0, 1.0]
    assert isinstance(sc.Coulomb(0.3).mu, float)


def test_an_editable_install_is_a_path() -> None:
    """With ``package-dir`` setuptools writes a path, which type checkers follow, and no import hook.

    `.ci/mypy_scripts.py` checks that the types are found.
    """
    assert project()["tool"]["setuptools"]["package-dir"] == {"": "."}


def bounds(requirements: list[str]) -> dict[str, str]:
    """Lower bounds by name."""
    pairs = [re.match(r"([\w.-]+)>=([\d.]+)", line) for line in requirements]
    return {match[1]: match[2] for match in pairs if match}


def test_tested_versions_are_the_lower_bounds() -> None:
    """`.ci/lowest.txt` pins exactly what pyproject.toml allows as the oldest."""
    table = project()["project"]
    extras = table["optional-dependencies"]
    allowed = bounds(table["dependencies"] + extras["plot"] + extras["progress"])
    pins = dict(re.findall(r"^([\w-]+)==([\d.]+)$", text(".ci/lowest.txt"), re.MULTILINE))
    for name, oldest in allowed.items():
        assert (pins[name] + ".").startswith(oldest + "."), name


def test_recipe_and_metadata_have_the_same_dependencies() -> None:
    """The conda recipe and codemeta.json list what pyproject.toml lists."""
    required = project()["project"]["dependencies"]
    recipe = re.findall(r"^ {4}- ([\w-]+) >=([\d.]+)$", text("recipe/meta.yaml").split("run:")[1], re.M)
    assert {name: oldest for name, oldest in recipe if name != "python"} == bounds(required)
    assert json.loads(text("codemeta.json"))["softwareRequirements"] == list(bounds(required))


def test_classifiers_and_matrix_name_the_same_versions() -> None:
    """The versions of Python that are promised are those that are tested."""
    table = project()["project"]
    promised = re.findall(r"Python :: (3\.\d+)", "\n".join(table["classifiers"]))
    tested = re.search(r"python: \[(.+)\]", text(".github/workflows/tests.yml")).group(1)
    assert promised == re.findall(r"3\.\d+", tested)
    assert table["requires-python"] == f">={promised[0]}"


def test_paper_cites_what_its_bibliography_has() -> None:
    """Every citation has an entry, and every entry is cited."""
    cited = set(re.findall(r"@(\w+)", text("paper.md").split("---", 2)[2]))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", text("paper.bib"), re.MULTILINE))


def test_one_description_everywhere() -> None:
    """What the package is, in one sentence, wherever it is listed."""
    description = project()["project"]["description"]
    assert json.loads(text("codemeta.json"))["description"] == description
    assert re.search(r"summary: (.+)", text("recipe/meta.yaml")).group(1) == description
    assert " ".join(text("CITATION.cff").split("abstract: >-")[1].split()).startswith(description)


@pytest.mark.parametrize("name", ["docs", "publish", "tests"])
def test_workflows_name_no_host_and_write_where_they_have_to(name: str) -> None:
    """Hosts are those that the tools know; only the upload has a secret, a token."""
    flow = text(f".github/workflows/{name}.yml")
    assert "://" not in flow
    assert flow.count("secrets.") == (1 if name == "publish" else 0)
    assert "permissions:\n  contents: read\n" in flow
    written = set(re.findall(r"^ {6}([\w-]+): write", flow, re.MULTILINE))
    assert written == {"docs": {"pages", "id-token"}, "publish": set(), "tests": set()}[name]


def test_a_tag_is_compared_with_the_version() -> None:
    """The command of the workflow finds the version that the package has."""
    pattern = re.search(r"sed -n 's/(.+)/\\1/p' (\S+)\)", text(".github/workflows/publish.yml"))
    expression = pattern.group(1).replace("\\(", "(").replace("\\)", ")")
    assert re.search(expression, text(pattern.group(2)), re.MULTILINE).group(1) == sc.__version__


def test_description_of_the_package_needs_no_other_file() -> None:
    """An index of packages shows it alone: links and pictures go to addresses, or there are none."""
    description = text(project()["project"]["readme"])
    targets = re.findall(r"\]\(([^)]+)\)|(?:src|href)=\"([^\"]+)\"", description)
    assert all((a or b).startswith(("https://", "#")) for a, b in targets)


def test_paper_is_short() -> None:
    """A thousand words, without the head and the references."""
    body = text("paper.md").split("---", 2)[2].split("# References")[0]
    assert len(body.split()) <= 1000
