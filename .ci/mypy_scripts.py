"""Types of what users copy: mypy over the examples, the code of the pages and the scripts of the tests.

As of a user's own script, outside of the checkout and without its settings: mypy sees the package as
it is installed. Usage: ``python .ci/mypy_scripts.py FOLDER``; it makes the folder, for the pages.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: scikit-fem has no types; bodies of functions are checked though their arguments have no types.
OPTIONS = (
    "--config-file=",
    "--ignore-missing-imports",
    "--follow-imports=silent",
    "--check-untyped-defs",
    "--warn-unused-ignores",
)
#: An error: types that are not found, as behind the import hooks of some installs, hide all others.
PROBE = (
    "import skfem_contact as sc\n\nsc.RigidPlane((0, 0), (0, 1), name=1)  # type: ignore[arg-type]\n"
)


def code(page: str) -> str:
    """The blocks of Python of a page, each line where it stands there; the other lines are empty.

    >>> code("Press it:\\n```python\\npress()\\n```\\nIt is pressed.")
    '\\n\\npress()\\n\\n\\n'
    """
    lines, inside = [], False
    for line in page.splitlines():
        fence = line.startswith("```")
        inside = line == "```python" if fence else inside
        lines.append(line if inside and not fence else "")
    return "\n".join(lines) + "\n"


def scripts(folder: Path) -> list[Path]:
    """The scripts, and what is written into the folder: a probe, and the code of each page."""
    found = [*(ROOT / "examples").rglob("*.py"), *(ROOT / "tests/scenes").glob("*.py")]
    found.append(folder / "probe.py")
    found[-1].write_text(PROBE, encoding="utf-8")
    pages = [*ROOT.glob("*.md"), *(p for p in ROOT.glob("docs/**/*.md") if "gallery" not in p.parts)]
    for page in sorted(pages):
        text = code(page.read_text(encoding="utf-8"))
        if text.strip():
            name = "_".join(page.relative_to(ROOT).with_suffix("").parts)
            found.append(folder / f"page_{name}.py")
            found[-1].write_text(text, encoding="utf-8")
    return found


if __name__ == "__main__":
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True)
    listed = scripts(folder)
    command = [sys.executable, "-m", "mypy", *OPTIONS, f"--cache-dir={folder / 'cache'}"]
    print(f"{len(listed)} scripts", flush=True)
    sys.exit(subprocess.run([*command, *map(str, listed)], cwd=folder).returncode)
