"""Words of the pages, and how hard they are to read.

    python benchmarks/reading.py             every page of the user's site
    python benchmarks/reading.py COMMIT      beside the same pages at that commit

Words are those of `wc -w`, code included. The grade is that of J. P. Kincaid and others (1975),
"Derivation of new readability formulas": the years at school that a text asks for. Code, tables,
headings and pictures are left out of it, and a name of code is one word of one syllable.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
OTHER_READERS = (  # pages and folders for those who develop or check the library
    "checks/",
    "gallery/",
    "developers.md",
    "extending.md",
    "entrances.md",
    "reference/inside.md",
)


def user_pages() -> list[str]:
    """The pages of the user's site, as paths in docs."""
    pages = sorted(path.relative_to(ROOT / "docs").as_posix() for path in ROOT.glob("docs/**/*.md"))
    return [page for page in pages if not page.startswith(OTHER_READERS)]


def sentences(page: str) -> list[list[str]]:
    """The words of each sentence of the prose of a page."""
    page = re.sub(r"^```.*?^```$|<!--.*?-->|!\[[^\]]*\]\([^)]*\)", "", page, flags=re.S | re.M)
    page = re.sub(r"^(?:\||#|\$\$|:::| {4}).*$", "\n", page, flags=re.M)
    page = re.sub(r"`[^`\n]+`|\$[^$]+\$", "name", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", page))
    blocks = re.split(r"\n\s*\n|\n\s*(?:[-*]|\d+\.) ", page)
    found = [re.findall(r"\w[\w'.-]*", s) for b in blocks for s in re.split(r"[.!?](?=\W|$)", b)]
    return [words for words in found if words]


def syllables(word: str) -> int:
    """Groups of vowels, of which a silent e at the end is none."""
    heard = re.sub(r"(?<!l)e$|(?<![lcgsxz])es$|(?<=[^td])ed$", "", word.lower())
    return max(1, len(re.findall("[aeiouy]+", heard)))


def grade(page: str) -> float:
    """The grade of Flesch and Kincaid of the prose of a page; NaN where it has none."""
    found = sentences(page)
    words = [word for sentence in found for word in sentence]
    if not words:
        return math.nan
    per_word = sum(map(syllables, words)) / len(words)
    return 0.39 * len(words) / len(found) + 11.8 * per_word - 15.59


def page_at(commit: str, page: str) -> str:
    """A page as it was at a commit; nothing where it was not there."""
    asked = ["git", "show", f"{commit}:docs/{page}"]
    return subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=False).stdout


def main(commit: str | None = None) -> None:
    """Print words and grade of every page, and the words of all."""
    total = [0, 0]
    for page in user_pages():
        texts = [(ROOT / "docs" / page).read_text(encoding="utf-8")]
        texts = ([page_at(commit, page)] if commit else []) + texts
        counts = [len(text.split()) for text in texts]
        total = [a + b for a, b in zip(total, (counts[0], counts[-1]), strict=True)]
        print(f"{page:32s}", *(f"{n:6d} {grade(t):5.1f}" for n, t in zip(counts, texts, strict=True)))
    print(f"{'words in all':32s}", *(f"{n:6d}      " for n in (total if commit else total[1:])))


if __name__ == "__main__":
    main(*sys.argv[1:2])
