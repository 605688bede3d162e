"""Bodies condensed over MPI ranks: factors and answers are those of one process.

What needs PETSc runs by `mpirun`; which route is taken, and what is said of it, is tested without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import petsc_condensed
import pytest
from petsc_scenes import blocks, moves
from test_petsc import ALL, FEW, assert_said, assert_serial, mpirun, needs_petsc

import skfem_contact as sc

SCRIPT = Path(petsc_condensed.__file__)

# -- without PETSc ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Condensing(sc.linalg.Direct):
    """A backend that condenses bodies, as `PETSc("direct")` does."""

    condenses = True


@pytest.mark.parametrize("most, usual", [(3e9, "auto"), (0, "iterated")])
def test_a_backend_that_condenses_takes_the_routes_of_the_default(most: float, usual: str) -> None:
    """Condensed, or iterated beyond the limit in bytes: the same answers to the last bit."""
    bodies, contact = blocks(2, "mortar", "small", 10)
    results = []
    for linear in (Condensing(), usual):
        solver = sc.ContactSolver(
            bodies, contact, linear=linear, options=sc.Options(max_dense_bytes=most)
        )
        results.append(solver.solve(x=moves(bodies[1])[1]["x"]))
    found, expected = results
    assert np.array_equal(found.u, expected.u) and np.array_equal(found.traction, expected.traction)


def test_what_is_said_of_such_a_backend() -> None:
    """Its name, sizes of the contact problem, and why; the size of its factors it does not know."""
    bodies, contact = blocks(2, "mortar", "small", 10)
    said = []
    for most in (3e9, 0):
        options = sc.Options(max_dense_bytes=most)
        solver = sc.ContactSolver(bodies, contact, linear=Condensing(), options=options)
        said.append(str(solver).splitlines()[0])
        with pytest.raises(
            sc.errors.InputError, match="how large that will be it does not say in advance"
        ):
            solver.sizes()
    assert "condensed: 240 DOFs -> 34 contact DOFs" in said[0]
    assert "factors by Condensing(method='auto'), at most 11.1 kB of dense matrices" in said[0]
    assert said[0].endswith("max_dense_bytes allows 3 GB")
    assert "iterated: 240 DOFs" in said[1] and "factors by Condensing(method='auto'); forces" in said[1]
    assert said[1].endswith("because dense matrices would take 11.1 kB: max_dense_bytes allows 0 B")


def test_backends_that_factorise_no_bodies_say_so() -> None:
    """Asked for factors of a body they refuse in words."""
    (lower, _), _ = blocks(2, "mortar", "small", 10)
    with pytest.raises(
        sc.errors.InputError, match="AMG factorises no bodies: contact is on all of their DOFs"
    ):
        sc.linalg.AMG().condensed(lower, lower.K, np.arange(lower.n), np.arange(3))


# -- by mpirun --------------------------------------------------------------------------------


def stored(tmp_path: Path, count: int, what: str, *words: str) -> dict[str, float]:
    """What the script stores."""
    done = mpirun(count, what, tmp_path / "found.npz", *words, script=SCRIPT)
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        return {name: float(found[name]) for name in found.files}


@needs_petsc
@pytest.mark.parametrize("count", [2, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 3))])
def test_factors_are_those_of_one_process(tmp_path: Path, count: int) -> None:
    """S, loads, displacements and responses; few and many kept, K here and on ranks, springs added.

    Each once with the complement that MUMPS leaves, and once by solves in blocks.
    """
    found = stored(tmp_path, count, "factors")
    assert len(found) == 240
    # round-off of two factorisations of matrices with conditions of some hundreds
    assert max(found.values()) < 1e-12, max(found, key=found.__getitem__)


@needs_petsc
@pytest.mark.parametrize(
    "count, words",
    [
        (2, FEW),
        (2, ("assembled", *FEW)),
        *(
            pytest.param(n, (*way, *ALL), marks=pytest.mark.slow)
            for n in (1, 2, 4)
            for way in ((), ("assembled",))
        ),
    ],
)
def test_answers_are_the_serial_ones(tmp_path: Path, count: int, words: tuple[str, ...]) -> None:
    """2-D and 3-D, mortar and node, small and finite sliding; all is given back."""
    done = mpirun(count, "answers", tmp_path / "found.npz", "direct", *words)
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert_serial(found, [word for word in words if word in ALL])
        assert found["most"] == 1
        assert found["left"] == found["rows"] == 0


@needs_petsc
@pytest.mark.parametrize(
    "count, words",
    [
        (2, ("2-D_node_small",)),
        *(pytest.param(n, ("assembled", *ALL), marks=pytest.mark.slow) for n in (1, 2, 4)),
    ],
)
def test_answers_beyond_the_limit_in_bytes(tmp_path: Path, count: int, words: tuple[str, ...]) -> None:
    """No dense matrix at all: forces are iterated through the factors of all ranks."""
    done = mpirun(count, "answers", tmp_path / "found.npz", "direct", "iterated", *words)
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert_serial(found, [word for word in words if word in ALL])
        assert found["left"] == found["rows"] == 0


@needs_petsc
@pytest.mark.parametrize("more", [(), pytest.param(("all",), marks=pytest.mark.slow)])
def test_other_bodies_and_loops(tmp_path: Path, more: tuple[str, ...]) -> None:
    """Free and rigid bodies, one without contact, added springs, dependent rows; all loops."""
    found = stored(tmp_path, 2, "others", *more)
    assert len(found) == (33 if more else 18)
    # the loops' tolerance of forces is 1e-10; the tool hangs on its contact
    assert max(found.values()) < 1e-9, max(found, key=found.__getitem__)


@needs_petsc
def test_an_increment_costs_no_solves(tmp_path: Path) -> None:
    """Of 51 increments, only a direction of the loads is new; interiors are recovered in blocks."""
    found = stored(tmp_path, 2, "history")
    assert found["increments"] == 51
    assert found["away"] < 1e-10
    assert found["solves"] <= 3  # two motions of the upper block, and what the lower one has
    # the lower block, 51 results in two blocks; the upper one, what each of its 48 DOFs moves
    assert found["recovery"] == 3 and found["columns"] == 51 + 48


@needs_petsc
def test_what_is_said_and_refused(tmp_path: Path) -> None:
    """Routes by name and reason; what is not positive definite; memory that MUMPS did not get."""
    done = mpirun(2, "said", tmp_path / "said.txt", script=SCRIPT)
    assert not done.returncode, done.stderr
    words = [
        "condensed: 240 DOFs -> 34 contact DOFs -> 18 gaps and slips of 9 points; factors by PETSc(",
        "forces by GMRES, because dense matrices would take 15.8 kB",
        "forces by GMRES through the factors of the bodies, because dense matrices would take",
        "InputError: PETSc(method='direct'",
        "SingularMatrix: The stiffness left at DOF",
        "SingularMatrix: The stiffness left at DOF",
        "InputError: AMG factorises no bodies",
        "LinearSolveError: PETSc, preonly + cholesky: ",
    ]
    assert_said(tmp_path / "said.txt", words)


@needs_petsc
@pytest.mark.parametrize(
    "options",
    [
        ("-sc_pc_type", "lu", "-sc_pc_factor_mat_solver_type", "superlu_dist"),
        pytest.param(("-sc_pc_type", "gamg", "-sc_ksp_type", "cg"), marks=pytest.mark.slow),
    ],
    ids=["superlu", "multigrid"],
)
def test_other_packages(tmp_path: Path, options: tuple[str, ...]) -> None:
    """SuperLU_DIST has contact eliminated from all DOFs; what iterates condenses as well, slowly."""
    done = mpirun(2, "answers", tmp_path / "found.npz", "direct", "2-D_mortar_small", *options)
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert_serial(found, ["2-D_mortar_small"])


@needs_petsc
@pytest.mark.slow
def test_all_dofs_by_factors_is_an_option(tmp_path: Path) -> None:
    """Contact eliminated from all DOFs, and each matrix factorised: MUMPS as the preconditioner."""
    options = "-sc_pc_type", "lu", "-sc_pc_factor_mat_solver_type", "mumps"
    done = mpirun(2, "answers", tmp_path / "found.npz", *FEW, *options)
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert_serial(found, FEW)
        assert found["most"] <= 2


@needs_petsc
def test_a_rank_that_fails_ends_all_with_its_message(tmp_path: Path) -> None:
    """In the middle of a condensation, in which all take part."""
    done = mpirun(2, "broken", tmp_path / "none", script=SCRIPT)
    assert done.returncode
    assert "rank 1 of 2 failed, and all end with it" in done.stderr
    assert "MemoryError: no room for what follows contact" in done.stderr


@needs_petsc
@pytest.mark.slow
def test_a_history_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    """A rank is killed; on other ranks, condensed anew, it ends as the one that was left alone."""
    alone, killed = tmp_path / "alone", tmp_path / "killed"
    for folder in (alone, killed):
        folder.mkdir()
    assert mpirun(1, "history", alone, "alone").returncode == 0
    assert mpirun(2, "history", killed, "killed", "direct").returncode
    # steps need no solve: some more may be done until the others end
    done = int((killed / "done").read_text())
    assert 3 <= done < 12
    resumed = mpirun(3, "history", killed, "resumed", "direct")
    assert f"begun at {done}" in resumed.stdout, resumed.stderr
    with np.load(alone / "answer.npz") as expected, np.load(killed / "answer.npz") as found:
        for name in ("u", "slip"):
            assert np.abs(found[name] - expected[name]).max() < 1e-10 * np.abs(expected[name]).max()
