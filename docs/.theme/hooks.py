"""What the build of the pages does beside its plugins.

Formulas become MathML, which browsers draw without scripts; the version comes from the package; search
works from the disk, and finds pages by what engineers call things (search_words.json); and the examples
get the form that the gallery wants: titles, and their picture.
"""

from __future__ import annotations

import ast
import html
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.plugins import event_priority

sys.path.insert(0, str(Path(__file__).parent))
from gallery import Order, thumbnail, with_few_colours

ROOT = Path(__file__).parents[2]
PREPARED = ROOT / "out" / "gallery"  # not under version control
SEARCH_WORDS = json.loads(Path(__file__).with_name("search_words.json").read_text(encoding="utf-8"))
FORMULA = re.compile(r'<(span|div) class="arithmatex">(.*?)</\1>', re.DOTALL)
#: Two arguments of one type that one sentence describes, and the dash before no description at all.
ALIKE = re.compile(
    r'</code></b>((?:(?!</?li\b).)+</li>)\s*<li class="doc-section-item field-body">'
    r"\s*((?:<b><code>\w+</code></b>(?:, )?)+)\1",
    re.DOTALL,
)
NOTHING_SAID = re.compile(r'–\s*<div class="doc-md-description">\s*</div>')


@event_priority(100)  # before the gallery reads its examples
def on_config(config: Any) -> Any:
    """The version, the script for the search, and the examples."""
    tree = ast.parse((ROOT / "skfem_contact/__init__.py").read_text(encoding="utf-8"))
    (version,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == "__version__"
    )
    config.extra["version"] = ast.literal_eval(version)
    # the plugin `offline` would load this script over the network
    config.extra["polyfills"] = ["assets/javascripts/iframe-worker-shim.js"]
    if "gallery" in config.plugins:
        prepare_examples(Path(config.docs_dir))
        settings = config.plugins["gallery"].config
        settings["examples_dirs"], settings["within_subsection_order"] = [PREPARED], Order
    return config


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The words of the trade that lead to a page: the search ranks tags before titles and text."""
    if page.file.src_uri in SEARCH_WORDS:
        page.meta["tags"] = SEARCH_WORDS[page.file.src_uri]
    return markdown


def prepare_examples(docs: Path) -> None:
    """Writes all examples anew for the gallery; what has not changed keeps its time."""
    PREPARED.mkdir(parents=True, exist_ok=True)
    shutil.copy(ROOT / "examples/README.md", PREPARED)
    names = {path.name for path in (ROOT / "examples").glob("*.py")}
    for old in PREPARED.glob("*.py"):
        if old.name not in names:
            old.unlink()
    for name in names:
        text = for_gallery(ROOT / "examples" / name, docs)
        if not (PREPARED / name).exists() or (PREPARED / name).read_text(encoding="utf-8") != text:
            (PREPARED / name).write_text(text, encoding="utf-8")


def for_gallery(path: Path, docs: Path) -> str:
    """An example with a title, its picture, and headings in front of its parts."""
    text = path.read_text(encoding="utf-8")
    quotes, first, rest = re.match(r'(r?""")(.*?)\n(.*)', text, re.DOTALL).groups()
    picture = f"images/{path.stem}.png"
    shown = f"\n![{first}](../{picture})\n" if (docs / picture).exists() else ""
    film = f"images/{path.stem}.gif"
    moving = f"\n![The same, moving](../{film})\n" if (docs / film).exists() else ""
    body = re.sub(
        r"^# %% +(.)(.*)$", lambda m: f"# %%\n# ## {m[1].upper()}{m[2]}", rest, flags=re.MULTILINE
    )
    small, end = f"gallery/parts/{path.stem}.png", ""
    if shown:
        thumbnail(docs / picture, docs / small)
        end = f"\n# mkdocs_gallery_thumbnail_path = '{small}'\n"
    return f"{quotes}# {first.split(':')[0].rstrip('.')}\n\n{first}\n{shown}{moving}{body}{end}"


def mathml(match: re.Match[str]) -> str:
    r"""A formula between ``\(`` and ``\)``, or ``\[`` and ``\]``."""
    tex = html.unescape(match[2]).strip()[2:-2].strip()
    tex = tex.replace("{aligned}", "{align*}")  # the converter knows that one only
    return convert(tex, display="block" if match[1] == "div" else "inline")


def on_page_content(content: str, /, *, page: Any, config: Any, **kwargs: Any) -> str:
    """Formulas, also of docstrings; the version; links of the gallery to files; arguments alike."""
    if page.file.src_uri == "gallery/index.md":
        content = re.sub(r'(<a class="reference internal" href="\w+)"', r'\1.html"', content)
    found = 1
    while found:  # the reference would say the same sentence of each of them
        content, found = ALIKE.subn(r"</code></b>, \2\1", content)
    content = NOTHING_SAID.sub("", content)
    return FORMULA.sub(mathml, content).replace("{{version}}", config.extra["version"])


def on_post_build(config: Any) -> None:
    """Small thumbnails; and what is downloaded is the example itself, not what was made of it."""
    for path in (ROOT / "examples").glob("*.py"):
        shutil.copy(path, Path(config.site_dir) / "gallery" / path.name)
    with_few_colours(Path(config.site_dir) / "gallery/images/thumb")
    shutil.rmtree(Path(config.site_dir) / "gallery/parts")  # the thumbnails were made of them
