"""What engineers call things leads to the page that says how to do it, or that it is not possible."""

from __future__ import annotations

import ast
import json
import os
import re
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
WORDS = json.loads((DOCS / ".theme" / "search_words.json").read_text(encoding="utf-8"))
BUILT = os.environ.get("SEARCH_INDEX")  # search/search_index.json of the pages, built by mkdocs
WANTED = {  # of two pages the first that there is
    "hyperelastic": ["nonlinear.md"],
    "large strain": ["nonlinear.md"],
    "pretension": ["bolts.md"],
    "calibrate": ["recipes/calibration.md"],
    "self contact": ["limits.md"],
    "periodic": ["limits.md"],
    "export vtk": ["pictures.md"],
    "gear": ["gallery/gear_pair.md", "dictionary.md"],
    "shrink fit": ["recipes/press_fit.md"],
    "gasket": ["gallery/leaking_flange.md"],
    "thermal": ["recipes/thermal_shrink.md"],
    "tie": ["guide.md"],
    "penalty": ["dictionary.md"],
    "STL": ["gallery/stl_brake.md", "guide.md"],
    "wear": ["recipes/wear.md"],
    "squeal": ["modes.md"],
    "contact pair": ["dictionary.md"],
    "clearance": ["dictionary.md"],
    "interference fit": ["recipes/press_fit.md"],
    "plasticity": ["nonlinear.md"],
    "rigid body": ["guide.md"],
    "finite sliding": ["sliding.md"],
    "restart": ["recipes/restart.md"],
    "STEP": ["assemblies.md"],
    "bearing": ["recipes/pin.md"],
    "rocking": ["recipes/pin.md"],
    "general contact": ["limits.md", "assemblies.md", "dictionary.md"],
    "hard contact": ["dictionary.md"],
    "stabilisation": ["dictionary.md"],
    "soft contact": ["recipes/springs.md", "dictionary.md"],
    "compression only": ["recipes/springs.md"],
    "substructure": ["dictionary.md"],
    "torque capacity": ["recipes/press_fit.md"],
    "symmetric supports": ["guide.md"],
    "plane of symmetry": ["guide.md"],
}


class Section(NamedTuple):
    """What the search knows of a part of a page."""

    page: str
    title: str
    text: str
    tags: str


def sections_of_the_sources() -> list[Section]:
    """The parts of all pages and examples, as they are written."""
    texts = {path.relative_to(DOCS).as_posix(): path.read_text(encoding="utf-8") for path in pages()}
    for path in (ROOT / "examples").glob("*.py"):
        said = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        texts[f"gallery/{path.stem}.md"] = f"# {said}"
    found = []
    for page, text in texts.items():
        plain = re.sub(r"^```.*?^```$", "", text, flags=re.S | re.M)
        for part in re.split(r"^#+ ", plain, flags=re.M)[1:]:
            title, _, body = part.partition("\n")
            found.append(Section(page, title, body, " ".join(WORDS.get(page, []))))
    return found


def pages() -> list[Path]:
    """All pages that are not made of something else."""
    return [path for path in DOCS.rglob("*.md") if "gallery" not in path.parts]


def sections_of_the_index() -> list[Section]:
    """Those of the index that mkdocs has built."""
    return [
        Section(
            re.sub(r"\.html.*", ".md", entry["location"]),
            entry["title"],
            entry["text"],
            " ".join(entry.get("tags", [])),
        )
        for entry in json.loads(Path(str(BUILT)).read_text(encoding="utf-8"))["docs"]
    ]


def first_page(sections: list[Section], query: str) -> str:
    """The page that the theme shows first: it ranks words in tags before titles, these before text."""

    def score(section: Section) -> float:
        total = 0.0
        for words, weight in ((section.tags, 1e6), (section.title, 1e3), (section.text, 1.0)):
            found = re.findall(r"\w+", words.lower())
            hits = [sum(word.startswith(term) for word in found) for term in query.lower().split()]
            total += weight * sum(n / (n + 1) for n in hits)
        return total

    return max(sections, key=score).page


def wrong(sections: list[Section]) -> dict[str, str]:
    """What the search shows first where it should be another page."""
    there = {section.page for section in sections}
    shown = {query: first_page(sections, query) for query in WANTED}
    return {q: page for q, page in shown.items() if page != next(w for w in WANTED[q] if w in there)}


def test_words_of_the_trade_find_their_page() -> None:
    """The first page that the search shows is the one that answers."""
    assert not wrong(sections_of_the_sources())


@pytest.mark.skipif(not BUILT, reason="mkdocs build writes the index, SEARCH_INDEX says where it is")
def test_the_built_index_finds_them_too() -> None:
    """The tags and the pages of the reference are in the index that readers search."""
    assert not wrong(sections_of_the_index())


def test_pages_with_words_of_the_trade_exist() -> None:
    """No list of words belongs to a page that was renamed; the gallery makes its pages later."""
    found = {path.relative_to(DOCS).as_posix() for path in pages()}
    assert {page for page in WORDS if not page.startswith("gallery/")} <= found


def test_what_is_not_possible_is_said() -> None:
    """Limits names what engineers look for in vain, in words of their own."""
    text = (DOCS / "limits.md").read_text(encoding="utf-8").split("## Sliding")[0].lower()
    for words in ("self contact", "general contact", "periodic", "dynamics", "damage", "shells"):
        assert words in text
