"""The gallery: every example has its place, and a thumbnail that is made for its size."""

from __future__ import annotations

import re
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
NAMES = sorted(path.stem for path in (ROOT / "examples").glob("*.py"))


@pytest.fixture(scope="module")
def gallery() -> dict[str, Any]:
    """What the pages build the gallery with."""
    pytest.importorskip("PIL")
    return run_path(str(ROOT / "docs/.theme/gallery.py"))


def test_every_example_has_a_place(gallery: dict[str, Any]) -> None:
    """The order names all examples; three of the first four are solids."""
    assert not set(NAMES) - set(gallery["PARTS"])
    first = sorted((ROOT / "examples").glob("*.py"), key=gallery["Order"]())[:4]
    solids = [path.stem for path in first if "MeshHex" in path.read_text(encoding="utf-8")]
    assert solids == ["stl_brake", "ball_joint", "gear_pair"]


SOLID = re.compile(r"MeshHex|MeshTet")


@pytest.mark.parametrize("folder", ["examples", "docs/recipes"])
def test_half_are_solids(folder: str) -> None:
    """At least half of the gallery and of the recipes compute bodies of three dimensions."""
    names = {path.stem for path in (ROOT / folder).glob("*.*") if path.suffix in {".py", ".md"}}
    names -= {"README", "index"}
    solids = {"leaking_flange"} if folder == "examples" else set()  # its tetrahedra are in a file
    for name in names - {"gmsh"}:  # the recipe names MeshTet, and reads a plane mesh
        (path,) = (ROOT / folder).glob(f"{name}.*")
        solids |= {name} if SOLID.search(path.read_text(encoding="utf-8")) else set()
    assert 2 * len(solids) >= len(names), sorted(names - solids)


def test_thumbnails_are_small_and_show_a_part(gallery: dict[str, Any], tmp_path: Path) -> None:
    """At most 400 by 280 pixels and 40 kB, of a part that is within the picture."""
    from PIL import Image

    for name, (left, top, right, bottom) in gallery["PARTS"].items():
        assert 0 <= left < right <= 1 and 0 <= top < bottom <= 1, name
    pictures = [ROOT / f"docs/images/{name}.png" for name in NAMES]
    pictures = [picture for picture in pictures if picture.exists()]
    assert len(pictures) > 20
    for picture in pictures[::4]:  # a few of all kinds
        gallery["thumbnail"](picture, tmp_path / picture.name)
    gallery["with_few_colours"](tmp_path)
    for file in tmp_path.glob("*.png"):
        with Image.open(file) as image:
            wide, high = image.size
        assert wide <= 400 and high <= 280 and max(wide / 400, high / 280) > 0.99, file.stem
        assert file.stat().st_size < 40_000, file.stem


def test_thumbnails_cut_through_nothing(gallery: dict[str, Any]) -> None:
    """Their edges run through empty paper: a picture that is drawn anew may have moved its words."""
    from PIL import Image

    for name, part in gallery["PARTS"].items():
        with Image.open(ROOT / f"docs/images/{name}.png") as image:
            paper = np.asarray(image.convert("L")) > 245
        high, wide = paper.shape
        left, top, right, bottom = (round(x * n) for x, n in zip(part, (wide, high) * 2, strict=True))
        shown = paper[top:bottom, left:right]
        cut = {
            "left": left > 0 and not shown[:, 0].all(),
            "top": top > 0 and not shown[0].all(),
            "right": right < wide and not shown[:, -1].all(),
            "bottom": bottom < high and not shown[-1].all(),
        }
        assert not any(cut.values()), (name, cut)
