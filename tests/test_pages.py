"""The code of the README and of the pages runs from top to bottom, and prints what the pages say.

A page may have its code in two forms. Blocks of ``python`` without prompts are run in the order in
which they stand, all in one namespace; a block of ``output`` is what the block above it prints. Blocks
with the prompt ``>>>`` are doctests, which pytest runs by itself.

Where reports have new words, ``REWRITE_PAGES=1 pytest tests/test_pages.py`` puts what is printed into
the pages, and the pictures that they draw into docs/images. Read what it has changed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import pytest
from sybil import Example, Sybil
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.markdown import CodeBlockParser, SkipParser

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    ROOT / "PACKAGE.md",
    *sorted(p for p in DOCS.rglob("*.md") if DOCS / "gallery" not in p.parents),
]
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
DIGITS = 1e-5  # reports print six digits, of which another BLAS may turn the last one
REWRITE = bool(os.environ.get("REWRITE_PAGES"))
SECONDS = re.compile(NUMBER.pattern + r"(?= s\b)")  # times differ in every run
NOISE = 1e-9  # what the certificate calls round-off: its digits are those of the machine

run_python = PythonEvaluator()


def run(example: Example) -> None:
    """Runs a block, and keeps what it prints for the block of output below."""
    if example.parsed.startswith(">>>"):
        return
    printed = StringIO()
    with redirect_stdout(printed):
        run_python(example)
    example.namespace["printed"] = printed.getvalue()


def same_number(said: str, found: str) -> bool:
    """Two numbers agree to the digits above, or both are noise."""
    a, b = float(said), float(found)
    return abs(a - b) <= max(DIGITS * max(abs(a), abs(b)), NOISE)


def compare(example: Example) -> str | None:
    """What is wrong with a block of output: nothing, if all words and numbers are those printed."""
    said, found = (
        SECONDS.sub("#", text) for text in (str(example.parsed), example.namespace["printed"])
    )
    texts = [" ".join(NUMBER.sub("#", text).split()) for text in (said, found)]
    numbers = [NUMBER.findall(text) for text in (said, found)]
    if texts[0] != texts[1] or not all(map(same_number, *numbers)):
        return f"The page says\n{said}\nand the code prints\n{found}"
    return None


def renew(example: Example) -> None:
    """Keeps what is to stand in the place of a block of output that no longer agrees."""
    if compare(example):
        block = f"```output\n{example.namespace['printed'].strip(chr(10)).rstrip()}\n```"
        example.namespace.setdefault("new", []).append((example.start, example.end, block))


def rewrite(page: Path, new: list[tuple[int, int, str]], folder: Path) -> None:
    """Puts new blocks of output into a page, the last one first, and its pictures into docs."""
    text = page.read_text(encoding="utf-8")
    for start, end, block in reversed(new):
        tail = text[end:]
        text = text[:start] + block + ("" if tail.startswith("\n") else "\n") + tail
    page.write_text(text, encoding="utf-8")
    for picture in folder.glob("*.png"):
        if (DOCS / "images" / picture.name).exists():
            shutil.copy(picture, DOCS / "images")


DOCUMENTS = Sybil(
    parsers=[
        CodeBlockParser("python", run),
        CodeBlockParser("output", renew if REWRITE else compare),
        SkipParser(),
    ],
    patterns=["*.md"],
)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_page(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One page, in a folder of its own for the files that it writes."""
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    for mesh in ("pin_in_lug.msh", "die_set.msh"):
        shutil.copy(ROOT / "examples/meshes" / mesh, tmp_path)
    document = DOCUMENTS.parse(page)
    for example in document.examples():
        example.evaluate()
    if REWRITE:
        rewrite(page, document.namespace.get("new", []), tmp_path)
    from matplotlib import pyplot

    pyplot.close("all")


def test_parameter_study(tmp_path: Path) -> None:
    """The script that has to be a file, since it starts processes, prints what the loop prints."""
    page = (ROOT / "docs/recipes/parameter_study.md").read_text(encoding="utf-8")
    model, study = (
        next(
            block for block in re.findall(r"^```python\n(.*?)^```$", page, re.S | re.M) if has in block
        )
        for has in ("def build", "ProcessPoolExecutor")
    )
    (tmp_path / "model.py").write_text(model, encoding="utf-8")
    (tmp_path / "study.py").write_text(study, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "study.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert run.stdout == re.search(r"^```output\n(.*?)^```$", page, re.S | re.M)[1]


@pytest.mark.parametrize(
    ("said", "found", "agree"),
    [
        ("force 252.621", "force 252.622", True),
        ("force 252.621", "force 252.7", False),
        ("equilibrium 1.1e-16", "equilibrium 3e-15", True),
        ("equilibrium 1.1e-16", "equilibrium 3e-8", False),
        ("loop 0.0259 s", "loop 0.31 s", True),
        ("5 slip", "6 slip", False),
        ("5 slip", "5 stick", False),
        ("a 1", "a 1 2", False),
    ],
)
def test_what_agrees(said: str, found: str, agree: bool) -> None:
    """Words and numbers count, not the digits of round-off."""
    block = SimpleNamespace(parsed=said, namespace={"printed": found})
    assert (compare(block) is None) == agree
