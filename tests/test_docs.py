"""The pages of the documentation name what exists, and leave out nothing that is public."""

from __future__ import annotations

import importlib
import inspect
import re
from functools import reduce
from pathlib import Path
from typing import Any

import pytest

import skfem_contact as sc

WORDS_OF_THE_SITE = 25_000  # what a user can be asked to read: some three hours
DOCS = Path(__file__).parents[1] / "docs"
ROOT = Path(sc.__file__).parent
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in ROOT.rglob("*.py")
    if path.name != "__init__.py"
}


PUBLIC = {
    name: getattr(place, name)
    for place in (sc, *(getattr(sc, name) for name in sc.__all__ if name != "reference"))
    if inspect.ismodule(place)
    for name in place.__all__
    if not inspect.ismodule(getattr(place, name))
}


THEORY = "theory.md", "checks/theory.md"  # the user's, and that of those who check the library


def code_names(page: str) -> list[tuple[str, str]]:
    """Code spans ``package.module.name`` of a page, by the package where there is no such module."""
    spans = re.findall(r"`([a-z_]+(?:\.\w+)+)`", (DOCS / page).read_text(encoding="utf-8"))
    places = MODULES | {module.split(".")[0] for module in MODULES if "." in module}
    found = set()
    for span in spans:
        module = max((m for m in places if f"{span}.".startswith(m + ".")), key=len, default="")
        if module:
            found.add((module, span[len(module) + 1 :]))
    return sorted(found)


@pytest.mark.parametrize(
    ("module", "name"), sorted({names for page in THEORY for names in code_names(page)})
)
def test_function_beside_an_equation_exists(module: str, name: str) -> None:
    """Every function that stands beside an equation of the theory is there under that name."""
    place = importlib.import_module(f"skfem_contact.{module}")
    assert reduce(getattr, name.split("."), place) if name else place


def test_names_beside_a_file_exist() -> None:
    """What the page on extending names right beside a file is defined in that file."""
    page = (DOCS / "extending.md").read_text(encoding="utf-8")
    found = re.findall(r"`(\w+)` (?:of|in) `(skfem_contact/[\w/]+\.py)`", page)
    for name, path in found:
        assert re.search(
            rf"^(?:def |class )?{name}\b", (DOCS.parent / path).read_text(), re.MULTILINE
        ), name
    assert len(found) >= 3


def test_theory_names_functions() -> None:
    """The names above are found, so that their test can not pass on an empty list."""
    assert len(code_names("checks/theory.md")) > 40


def test_reference_is_complete() -> None:
    """Every public name has its entry in the reference."""
    pages = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "reference").glob("*.md"))
    entries = set(re.findall(r"^::: skfem_contact\.(?:\w+\.)*(\w+)$", pages, flags=re.MULTILINE))
    assert set(PUBLIC) <= entries, sorted(set(PUBLIC) - entries)


def test_files_that_pages_name_exist() -> None:
    """Scripts, tests and modules named in the pages are in the repository."""
    pattern = r"`((?:examples|tests|benchmarks|skfem_contact)/[\w/]+\.\w+)`"
    for page in DOCS.rglob("*.md"):
        for path in re.findall(pattern, page.read_text(encoding="utf-8")):
            assert (DOCS.parent / path).exists(), f"{page.name}: {path}"


def test_names_that_pages_write_exist() -> None:
    """What stands in the text as `sc.name` can be written so; the gallery is made of the examples."""
    for page in (p for p in DOCS.rglob("*.md") if DOCS / "gallery" not in p.parents):
        for path in re.findall(r"`sc\.(\w+(?:\.\w+)*)", page.read_text(encoding="utf-8")):
            assert reduce(getattr, path.split("."), sc), f"{page.name}: sc.{path}"


CLOSED_FORMS = {name: getattr(sc.reference, name) for name in sc.reference.__all__}


@pytest.mark.parametrize(
    ("name", "thing"), sorted((PUBLIC | {k: v for k, v in CLOSED_FORMS.items() if callable(v)}).items())
)
def test_every_public_name_has_an_example(name: str, thing: Any) -> None:
    """The docstring of a public class or function has an example, which runs as a doctest."""
    assert ">>> " in (thing.__doc__ or ""), name


#: What a script calls: of these the methods too.
OF_SCRIPTS = sc.ContactSolver, sc.answers.ContactResult, sc.answers.ContactValues, sc.Elastic


def test_methods_of_scripts_have_examples() -> None:
    """Every method of the classes that scripts call is shown in an example of the reference."""
    documented = list(PUBLIC.values())
    for thing in PUBLIC.values():
        documented += vars(thing).values() if inspect.isclass(thing) else ()
    lines = [line for thing in documented for line in (inspect.getdoc(thing) or "").splitlines()]
    shown = "".join(line for line in lines if line.startswith((">>>", "...")))
    lacking = [
        f"{owner.__name__}.{name}"
        for owner in OF_SCRIPTS
        for name, thing in vars(owner).items()
        if name[0] != "_" and inspect.isfunction(thing) and f".{name}(" not in shown
    ]
    assert not lacking


#: Words that begin a fragment: what a thing is, in the place of a sentence.
FRAGMENT = re.compile(r"(What|Whether|Those|That|How|Where|Which|Of|From|By|In|If|When|For)\b")


def test_public_docstrings_open_with_a_sentence() -> None:
    """The first line of public names, methods and attributes is understood without the code."""
    found = []
    for name, thing in PUBLIC.items():
        inside = vars(thing) if inspect.isclass(thing) else {}
        known = {f"{name}.{k}": getattr(v, "func", v) for k, v in inside.items() if k[0] != "_"}
        for key, value in {name: thing, **known}.items():
            words = inspect.getdoc(value) if callable(value) or isinstance(value, property) else None
            found += [key] if words and FRAGMENT.match(words) else []
    assert not found


def test_the_users_site_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that users read, code included; what only checks the library is in docs/checks."""
    monkeypatch.syspath_prepend(str(DOCS.parent / "benchmarks"))
    pages = importlib.import_module("reading").user_pages()
    words = {page: len((DOCS / page).read_text(encoding="utf-8").split()) for page in pages}
    assert {"guide.md", "recipes/index.md"} < set(words)
    assert sum(words.values()) <= WORDS_OF_THE_SITE, words
