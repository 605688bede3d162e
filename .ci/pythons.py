"""Prints the oldest and the newest Python beside the one that runs this.

Each has a line, ``3.10 /path/of/python``. Looked at are python3, python3.10, ... in the folders of PATH
and what pyenv has. A name counts if it starts a released CPython that can make virtual environments, of
a version that pyproject.toml promises: pyenv has names on PATH that only say which version to choose.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

Version = tuple[int, int]

NAME = re.compile(r"python3(\.\d+)?(\.exe)?")
SECONDS = 20  # that a Python may take to say its version
PROBE = """
import ensurepip, platform, sys, sysconfig, venv
if platform.python_implementation() == "CPython" and sys.version_info.releaselevel == "final":
    if not sysconfig.get_config_var("Py_GIL_DISABLED"):  # few packages have wheels without the lock
        print(*sys.version_info[:2], sys.executable)
"""


def promised(pyproject: str) -> set[Version]:
    """Versions among the classifiers.

    >>> sorted(promised('"Python :: 3", "Python :: 3.10", "Python :: 3.9"'))
    [(3, 9), (3, 10)]
    """
    return {(3, int(minor)) for minor in re.findall(r"Python :: 3\.(\d+)", pyproject)}


def said(*command: str) -> str:
    """What a command prints, nothing where it fails or does not exist."""
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def folders() -> Iterator[Path]:
    """Those of PATH, and those of pyenv's versions."""
    yield from map(Path, filter(None, os.environ.get("PATH", "").split(os.pathsep)))
    if root := os.environ.get("PYENV_ROOT") or said("pyenv", "root"):
        yield from sorted(Path(root).glob("versions/*/bin"))


def found(where: Iterable[Path]) -> dict[Version, str]:
    """The first Python of every version that runs, by its own word."""
    pythons: dict[Version, str] = {}
    for folder in dict.fromkeys(where):
        for path in sorted(folder.glob("python3*")):
            if NAME.fullmatch(path.name) and (answer := said(str(path), "-I", "-c", PROBE)):
                major, minor, executable = answer.split(maxsplit=2)
                pythons.setdefault((int(major), int(minor)), executable)
    return pythons


def chosen(versions: Iterable[Version], own: Version, allowed: set[Version]) -> list[Version]:
    """The oldest and the newest of the others; one where they are the same.

    >>> chosen([(3, 8), (3, 10), (3, 11), (3, 12), (3, 13)], (3, 11), {(3, n) for n in range(10, 14)})
    [(3, 10), (3, 13)]
    """
    others = sorted(set(versions) & allowed - {own})
    return others[:1] + others[1:][-1:]


if __name__ == "__main__":
    pyproject = Path(__file__).resolve().parents[1] / "pyproject.toml"
    pythons = found(folders())
    allowed = promised(pyproject.read_text(encoding="utf-8"))
    for major, minor in chosen(pythons, sys.version_info[:2], allowed):
        print(f"{major}.{minor} {pythons[major, minor]}")
