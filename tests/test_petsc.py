"""`PETSc()`: what each rank holds, answers on 1, 2 and 4 ranks, and what happens where a rank fails.

Tests that need PETSc run scripts by `mpirun`; without petsc4py, mpi4py and `mpirun` they are skipped.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import petsc_scenes
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose
from test_linear import body, modes_of

import skfem_contact as sc
from skfem_contact.petsc import Layout, bisected, command_line, directions, together
from skfem_contact.petsc.ranks import ranks

MISSING = [name for name in ("petsc4py", "mpi4py") if find_spec(name) is None]
MISSING += [] if shutil.which("mpirun") else ["mpirun"]
needs_petsc = pytest.mark.skipif(
    bool(MISSING), reason=f"needs {', '.join(MISSING)}, see docs/petsc.md; .ci/petsc installs them"
)
SCRIPT = Path(petsc_scenes.__file__)


# -- without PETSc ----------------------------------------------------------------------------


def test_asking_for_it_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where petsc4py is missing, the message has the commands, and nothing else is touched."""
    monkeypatch.setitem(sys.modules, "petsc4py", None)
    ranks.cache_clear()
    with pytest.raises(
        sc.errors.InputError, match=r"apt-get install python3-petsc4py python3-mpi4py.*PETSC_DIR"
    ):
        sc.petsc.PETSc()


@pytest.mark.parametrize(
    "given, words",
    [
        ({"method": "amg"}, r"known are 'iterative' and 'direct'"),
        ({"tol": 0.0}, r"tol of PETSc is 0.0; give a share of the load"),
        ({"max_iterations": 0}, r"max_iterations of PETSc is 0"),
        ({"options": "-pc_type hypre"}, r"give a dict such as \{'pc_type': 'hypre'\}"),
        ({"options": {"pc_type": ["hypre"]}}, r"names are strings, values plain"),
        ({"tolerance": 1e-8}, r"write tol"),
    ],
    ids=str,
)
def test_settings_are_checked_before_anything_is_started(given: dict, words: str) -> None:
    """Mistakes are told in words, with or without PETSc."""
    with pytest.raises(sc.errors.InputError, match=words):
        sc.petsc.PETSc(**given)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
@pytest.mark.parametrize("dim", [2, 3])
def test_rows_of_all_ranks_are_the_matrix(dim: int, count: int) -> None:
    """All pieces together are the matrix, with nodes whole, and ranks have as much as each other."""
    K, points = body(dim, cells=8 if dim == 2 else 4)
    some = np.delete(np.arange(K.shape[0]), [1, 5, 6])  # a node with one component, one with none
    K, points, modes = K[some][:, some], points[some], modes_of(points)[some]
    layout = Layout.of(K.shape[0], points, modes, count)
    whole = sp.vstack(list(layout.matrices(K))).tocsr()
    assert layout.block == dim and layout.size % dim == 0
    assert abs(whole[layout.slot][:, layout.slot] - K).max() == 0.0
    gone = np.setdiff1d(np.arange(layout.size), layout.slot)
    assert (whole[gone].indices == gone).all()  # nothing but their diagonal entries
    assert np.all(layout.starts % dim == 0)
    assert np.ptp(np.diff(layout.starts)) <= dim * 2
    b = np.random.default_rng(0).standard_normal(K.shape[0])
    assert (np.concatenate(list(layout.vectors(b)))[layout.slot] == b).all()


def test_ranks_hold_compact_regions() -> None:
    """Of a square of 32 x 32 points each of four ranks has a quarter, not a strip."""
    points = np.stack(np.meshgrid(np.arange(32.0), np.arange(32.0)), axis=-1).reshape(-1, 2)
    part = bisected(points, 4)
    for number in range(4):
        assert np.ptp(points[part == number], axis=0).tolist() == [15.0, 15.0]


def test_motions_of_two_bodies_are_put_together() -> None:
    """Two bodies have three columns in the plane, which span the motions of each of them."""
    one, two = (modes_of(body(2, cells=3)[1] + shift) for shift in (0.0, 5.0))
    modes = np.block([[one, np.zeros_like(two)], [np.zeros_like(one), two]])
    assert (together(modes) == np.vstack([one, two])).all()
    Q = directions(modes)
    assert_allclose(Q.T @ Q, np.eye(3), atol=1e-14)
    for own, part in ((one, Q[: len(one)]), (two, Q[len(one) :])):
        assert np.linalg.matrix_rank(np.hstack([own, part]), tol=1e-10) == 3
    # of DOFs along one axis alone only one motion is left
    assert directions(np.ones((4, 3)) * [1.0, 0.0, 2.0]).shape == (4, 1)


def test_the_command_line_is_read_for_options_of_this_library_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A script may have arguments of its own."""
    words = [
        "script.py",
        "out",
        "-n",
        "5",
        "-sc_ksp_rtol",
        "1e-3",
        "--sc_ksp_monitor",
        "-v",
        "-sc_x",
        "-1",
    ]
    monkeypatch.setattr(sys, "argv", words)
    assert command_line() == ["script.py", *words[4:6], "-sc_ksp_monitor", *words[8:]]


# -- by mpirun --------------------------------------------------------------------------------


def mpirun(count: int, *words: object, script: Path = SCRIPT) -> subprocess.CompletedProcess:
    """Run the script of the scenes, or another one, on some ranks."""
    # the cores are shared, and rank 0 may be root in a container
    settings = {
        "OMPI_MCA_mpi_yield_when_idle": "1",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = ["mpirun", "--oversubscribe", "-n", str(count), sys.executable, str(script)]
    return subprocess.run(
        [*command, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=900,
        env={**os.environ, **settings, "PYTHONPATH": str(Path(sc.__file__).parents[1])},
    )


@cache
def serial(*scenes: str) -> dict[str, np.ndarray]:
    """The answers of the default route, without PETSc."""
    return petsc_scenes.answers("auto", scenes)


def assert_serial(found: Mapping[str, np.ndarray], scenes: Sequence[str]) -> None:
    """Displacements, pressures and tractions of all steps are those of the default route."""
    for name, expected in serial(*scenes).items():
        if name.endswith("worst"):  # of the certificate: forces that are left over the largest
            assert found[name] < 1e-8, name
            continue
        # residuals are below 1e-12 of the loads, times conditions of some hundreds
        assert np.abs(found[name] - expected).max() < 1e-9 * np.abs(expected).max(), name


def assert_said(path: Path, words: Sequence[str]) -> None:
    """Each line of a file has the words expected of it."""
    said = path.read_text().split("\n")
    assert len(said) == len(words)
    for line, expected in zip(said, words, strict=True):
        assert expected in line


FEW, ALL = ("2-D_mortar_small", "3-D_node_small"), tuple(petsc_scenes.SCENES)


@needs_petsc
@pytest.mark.parametrize(
    "count, scenes", [(2, FEW), *(pytest.param(n, ALL, marks=pytest.mark.slow) for n in (1, 2, 4))]
)
def test_answers_are_the_serial_ones(tmp_path: Path, count: int, scenes: tuple[str, ...]) -> None:
    """2-D and 3-D, mortar and node, small and finite sliding; pressed, slid, reversed."""
    done = mpirun(count, "answers", tmp_path / "found.npz", *scenes)
    assert not done.returncode, done.stderr
    assert f"on {count} ranks" in done.stdout and done.stdout.count("solves") == 1
    with np.load(tmp_path / "found.npz") as found:
        assert_serial(found, scenes)
        assert found["most"] <= 40
        assert (
            found["held"] <= 8
        )  # matrices of hundreds: those that nobody asks for any more are given back


@needs_petsc
@pytest.mark.slow
def test_factors_give_the_serial_answers(tmp_path: Path) -> None:
    """MUMPS, where it is there, or what else factorises on two ranks."""
    done = mpirun(2, "answers", tmp_path / "found.npz", "direct")
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert_serial(found, ALL)


@needs_petsc
def test_a_killed_rank_ends_all_and_the_history_goes_on(tmp_path: Path) -> None:
    """From the last checkpoint, on other ranks, to the answer of the history that was left alone."""
    alone, killed = tmp_path / "alone", tmp_path / "killed"
    for folder in (alone, killed):
        folder.mkdir()
    assert mpirun(1, "history", alone).returncode == 0
    done = mpirun(2, "history", killed, "killed")
    assert done.returncode and not (killed / "answer.npz").exists()
    assert (killed / "done").read_text() == "3"
    done = mpirun(2, "history", killed, "ended")  # the script ends MPI itself: nobody waits for ever
    assert "begun at 3" in done.stdout and not done.returncode, done.stderr
    with np.load(alone / "answer.npz") as expected, np.load(killed / "answer.npz") as found:
        for name in ("u", "slip"):
            assert np.abs(found[name] - expected[name]).max() < 1e-10 * np.abs(expected[name]).max()


@needs_petsc
@pytest.mark.parametrize(
    "fault, words",
    [
        ("broken", ["rank 1 of 2 failed, and all end with it", "no room for the rows of this rank"]),
        ("mistaken", ["KeyError: 'a mistake of the script'"]),
        ("unsolved", ["LinearSolveError: PETSc,", "It did not end within max_iterations"]),
    ],
)
def test_what_fails_ends_all_with_its_message(tmp_path: Path, fault: str, words: list[str]) -> None:
    """A serving rank, the script, a linear problem: an exit code, words, and the checkpoints."""
    done = mpirun(2, "history", tmp_path, fault)
    assert done.returncode
    assert all(part in done.stderr for part in words), done.stderr
    assert int((tmp_path / "done").read_text()) >= 3


@needs_petsc
def test_options_reach_petsc(tmp_path: Path) -> None:
    """The command line wins over what the library sets; what PETSc does not know ends all in words."""
    out = tmp_path / "found.npz"
    words = "-sc_ksp_type", "bcgs", "-sc_ksp_converged_reason", "-sc_pc_typ", "hypre"
    done = mpirun(1, "history", tmp_path, *words)
    assert not done.returncode and "Linear sc_ solve converged" in done.stdout, done.stderr
    assert "PETSc has not looked for -sc_pc_typ: a name is misspelt" in done.stderr
    for count, said in ((1, "LinearSolveError: PETSc says"), (2, "failed, and all end with it")):
        done = mpirun(count, "answers", out, *FEW, "-sc_pc_type", "nonsense")
        assert done.returncode and said in done.stderr
        assert "Unable to find requested PC type nonsense" in done.stderr


@needs_petsc
def test_a_script_may_use_petsc4py_itself(tmp_path: Path) -> None:
    """It has initialised PETSc before, with another default communicator; options are heeded."""
    done = mpirun(2, "history", tmp_path, "own", "-sc_ksp_converged_reason")
    assert not done.returncode and "history of 12 steps" in done.stdout, done.stderr
    assert "Linear sc_ solve converged" in done.stdout and "not looked for" not in done.stderr
