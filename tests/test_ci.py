"""What `.ci/run` stands on: which warnings are errors, the README's commands, other Pythons."""

from __future__ import annotations

import doctest
import importlib.util
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import skfem_contact as sc

ROOT = Path(__file__).parents[1]


# ---------------------------------------------------------------------------------- warnings

SCENES = """
import warnings

import numpy as np

from skfem_contact import ContactWarning


def warn(text):
    warnings.warn(text, ContactWarning)


def test_contact():
    warn("this project's own")


def test_numbers():
    np.divide(1.0, np.zeros(1))


def test_deprecated():
    warnings.warn("another package's", DeprecationWarning)


def test_coming():
    warnings.warn("another package's", FutureWarning)


def test_caught():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warn("expected")
"""

# as pytest-benchmark beside xdist: warns before the first test is collected
PLUGIN = """
import warnings


def pytest_configure(config):
    warnings.warn("this plugin does nothing here", UserWarning)
"""


def outcomes(folder: Path, addopts: str, *more: str) -> tuple[dict[str, str], str]:
    """How the tests above end under the settings of pyproject.toml, and all that pytest said."""
    scenes = folder / "test_scenes.py"
    scenes.write_text(SCENES, encoding="utf-8")
    (folder / "noisy.py").write_text(PLUGIN, encoding="utf-8")
    path = os.pathsep.join([str(folder), str(ROOT), os.environ.get("PYTHONPATH", "")])
    settings = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(folder), "-p", "no:cacheprovider"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-rA", *settings, *more, str(scenes)],
        env={**os.environ, "PYTEST_ADDOPTS": addopts, "PYTHONPATH": path},
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    found = re.findall(r"^(PASSED|FAILED) \S*::test_(\w+)", done.stdout, re.MULTILINE)
    return {name: outcome.lower() for outcome, name in found}, done.stdout + done.stderr


def test_warnings_of_other_packages_fail_nobody(tmp_path: Path) -> None:
    """Its own warnings and those of numbers are errors; a deprecation or a noisy plugin is printed."""
    found, said = outcomes(tmp_path, "", "-p", "noisy")
    passed = dict.fromkeys(("deprecated", "coming", "caught"), "passed")
    assert found == {"contact": "failed", "numbers": "failed", **passed}, said
    assert "another package's" in said and "this plugin does nothing here" in said


def test_warnings_of_other_packages_fail_in_ci(tmp_path: Path) -> None:
    """With what `.ci/run` and the workflow tell pytest all warnings are errors, unless expected."""
    script = (ROOT / ".ci/run").read_text(encoding="utf-8")
    strict = re.search(r'^export PYTEST_ADDOPTS="(.+)"$', script, re.MULTILINE)[1]
    workflow = (ROOT / ".github/workflows/tests.yml").read_text(encoding="utf-8")
    assert re.search(r"^ +PYTEST_ADDOPTS: (.+?) +#", workflow, re.MULTILINE)[1] == strict
    found, said = outcomes(tmp_path, strict)
    failed = dict.fromkeys(("contact", "numbers", "deprecated", "coming"), "failed")
    assert found == {**failed, "caught": "passed"}, said


def test_warnings_here_are_errors() -> None:
    """The settings hold in this run too, in every process of xdist."""
    with pytest.raises(sc.ContactWarning, match="own"):
        warnings.warn("this project's own", sc.ContactWarning, stacklevel=1)
    with pytest.raises(RuntimeWarning, match="divide by zero"):
        np.divide(1.0, np.zeros(1))


# ------------------------------------------------------------------------ the README's commands


def blocks(name: str) -> list[str]:
    """Those that are marked as bash."""
    text = (ROOT / name).read_text(encoding="utf-8")
    return re.findall(r"^```bash\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def test_commands_of_the_readme_need_no_shell_before_them() -> None:
    """The first makes the environment, the second enters it; `.ci/run` gives each a new shell."""
    install, test = blocks("README.md")[:2]
    enter = ". .venv/bin/activate"
    assert install.startswith(f"python3 -m venv .venv && {enter}\n")
    assert test.startswith(f"{enter} && ") and "pytest" in test
    assert enter in blocks("CONTRIBUTING.md")[0]


# ----------------------------------------------------------------------------- other Pythons


@pytest.fixture(scope="module")
def pythons() -> ModuleType:
    """The script `.ci/pythons.py`."""
    spec = importlib.util.spec_from_file_location("pythons", ROOT / ".ci/pythons.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def executable(folder: Path, name: str, lines: str) -> None:
    """A script of the shell under the name of a Python."""
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(f"#!/bin/sh\n{lines}\n", encoding="utf-8")
    path.chmod(0o755)


@pytest.mark.skipif(os.name == "nt", reason="the names on PATH are scripts of the shell")
def test_only_what_runs_is_a_python(pythons: ModuleType, tmp_path: Path) -> None:
    """Names that fail, say nothing or do not start are passed over; the first that runs counts."""
    shims, real, later = (tmp_path / name for name in ("shims", "real", "later"))
    executable(shims, "python3.10", "echo 'pyenv: python3.10: command not found' >&2; exit 127")
    executable(shims, "python3.12", "exit 0")  # a prerelease, or another implementation
    executable(shims, "python3-config", "echo 3 9 /no/python")
    executable(real, "python3.10", "echo 3 10 '/with a space/python3.10'")
    executable(later, "python3", "echo 3 10 /later/python3")
    (later / "python3.13").write_text("not executable", encoding="utf-8")
    found = pythons.found([shims, real, real, later, tmp_path / "missing"])
    assert found == {(3, 10): "/with a space/python3.10"}


def test_examples_in_the_docstrings(pythons: ModuleType) -> None:
    """The script lies outside of what pytest collects."""
    done = doctest.testmod(pythons)
    assert done.attempted and not done.failed


def test_the_python_that_runs_this_is_found(pythons: ModuleType) -> None:
    """By its own word, where it can make environments and is no prerelease."""
    answer = pythons.said(sys.executable, "-I", "-c", pythons.PROBE)
    if not answer:
        pytest.skip("this Python makes no environments")
    assert answer.split(maxsplit=2)[:2] == [str(n) for n in sys.version_info[:2]]


@pytest.mark.parametrize(
    ("here", "own", "expected"),
    [
        ([10, 11, 12, 13], 11, [10, 13]),
        ([10, 11, 12, 13], 13, [10, 12]),  # its own is not repeated
        ([9, 11, 12], 11, [12]),  # 3.9 is not promised
        ([11, 15], 11, []),
        ([], 11, []),
    ],
)
def test_oldest_and_newest(pythons: ModuleType, here: list[int], own: int, expected: list[int]) -> None:
    """Of the versions that pyproject.toml promises."""
    allowed = pythons.promised((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    chosen = pythons.chosen([(3, minor) for minor in here], (3, own), allowed)
    assert [minor for _, minor in chosen] == expected


def test_pyenv_is_asked(pythons: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders of its versions come after those of PATH."""
    (tmp_path / "versions/3.10.13/bin").mkdir(parents=True)
    monkeypatch.setenv("PATH", os.pathsep.join(["/a", "/b"]))
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path))
    assert list(pythons.folders()) == [Path("/a"), Path("/b"), tmp_path / "versions/3.10.13/bin"]
