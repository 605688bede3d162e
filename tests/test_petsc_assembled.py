"""Bodies assembled rank by rank: rows, products, ``T'KT`` and answers are those of whole matrices.

What needs PETSc runs by `mpirun`; what one rank does is tested without it.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any

import internals
import numpy as np
import petsc_assembled
import petsc_scenes
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from petsc_scenes import blocks, elastic, mesh_of, some_elements
from quick_elasticity import linear_elasticity as quick_elasticity
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve
from skfem.generic_utils import OrientedBoundary
from skfem.models.elasticity import linear_elasticity
from test_petsc import ALL, FEW, assert_said, assert_serial, mpirun, needs_petsc

import skfem_contact as sc
from skfem_contact.answers import answer_of, strains
from skfem_contact.petsc import (
    StackedStiffness,
    assembled,
    collected,
    directions,
    numbering,
    orthonormal,
)
from skfem_contact.petsc.ranks import Ranks

_order = internals.beside(StackedStiffness, "_order")
_on_piece, _pieces = (internals.beside(numbering, name) for name in ("_on_piece", "_pieces"))

SCRIPT = Path(petsc_assembled.__file__)

# -- without PETSc, on one rank ---------------------------------------------------------------


@pytest.fixture
def alone() -> Ranks:
    """One rank, whose messages to all others come back to itself."""
    same = {name: lambda x: x for name in ("allreduce", "alltoall")}
    first = SimpleNamespace(
        rank=0, size=1, gather=lambda x: [x], scatter=lambda x: x[0], Dup=None, **same
    )
    return Ranks(SimpleNamespace(Error=RuntimeError), None, first)


def test_rows_and_products_are_those_of_the_matrix(alone: Ranks) -> None:
    """By pieces of the mesh and by elements of one's own, with springs and without."""
    (lower, upper), _ = blocks(3, "mortar", "small", 5)
    pieces = assembled(alone, elastic, lower.basis)
    given = collected(alone, partial(some_elements, 3, 5))
    for K, A in ((pieces, lower.K), (given, upper.K)):
        assert max(petsc_assembled.single(K, A).values()) < 1e-14
        spring = csr_matrix((np.ones(1), ([0], [0])), shape=K.shape)
        assert max(petsc_assembled.single(K + spring, csr_matrix(A + spring)).values()) < 1e-14


def test_a_mesh_in_many_pieces_has_the_same_stiffness(
    alone: Ranks, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Quadratic tetrahedra, whose edges have DOFs: what the pieces number is found again."""
    internals.replace(monkeypatch, "petsc.ELEMENTS_AT_ONCE", 20)
    element = fem.ElementVector(fem.ElementTetP2())
    mesh = fem.MeshTet().refined(2)
    basis = fem.Basis(mesh, element, intorder=2)
    K = assembled(alone, tetrahedra, numbering(mesh, element))
    assert abs(K[np.arange(basis.N)] - linear_elasticity().assemble(basis)).max() < 1e-13


def tetrahedra(mesh: fem.MeshTet) -> csr_matrix:
    """Stiffness of a piece."""
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTetP2()), intorder=2)
    return linear_elasticity().assemble(basis)


class Two(SimpleNamespace):
    """Two ranks one after the other, each of which makes its contribution: their sum."""

    size = 2

    def sum_of(self, function: Any, basis: Any) -> csr_matrix:
        """What the ranks have, in the numbering of the whole."""
        whole = csr_matrix((basis.N, basis.N))
        for part in _pieces(basis, self.size):
            dofs, K = _on_piece(self, function, part)
            E = csr_matrix((np.ones(len(dofs)), (dofs, np.arange(len(dofs)))), (basis.N, len(dofs)))
            whole = whole + E @ K @ E.T
        return whole


@pytest.mark.parametrize(
    "straight, curved, element",
    [
        (fem.MeshTri, fem.MeshTri2, fem.ElementTriP2()),
        (fem.MeshHex, fem.MeshHex2, fem.ElementHex2()),
    ],
)
def test_pieces_of_curved_meshes_keep_their_middle_nodes(
    straight: Any, curved: Any, element: fem.Element
) -> None:
    """A ring of quadratic edges has the stiffness that it has in one piece."""
    mesh = curved.from_mesh(straight().refined(3 if straight is fem.MeshTri else 1))
    x, y, *z = mesh.doflocs
    mesh = replace(mesh, doflocs=np.array([(1 + x) * np.cos(y), (1 + x) * np.sin(y), *z]))

    def stiffness(piece: Any) -> csr_matrix:
        return quick_elasticity().assemble(fem.Basis(piece, fem.ElementVector(element), intorder=4))

    basis = numbering(mesh, fem.ElementVector(element))
    expected = stiffness(mesh)
    assert abs(Two().sum_of(stiffness, basis) - expected).max() < 1e-13 * abs(expected).max()


def supported(mesh: Any, facets: Any) -> csr_matrix:
    """Plane elasticity, on springs along some facets that resist the stretch across them as well."""
    element = fem.ElementVector(fem.ElementQuad1())

    @fem.BilinearForm
    def springs(u: Any, v: Any, w: Any) -> Any:
        def stretch(field: Any) -> Any:
            return sum(field.grad[i, j] * w.n[i] * w.n[j] for i in (0, 1) for j in (0, 1))

        return 3 * (u[0] * v[0] + u[1] * v[1]) + stretch(u) * stretch(v)

    K = linear_elasticity().assemble(fem.Basis(mesh, element))
    at = mesh.boundaries[facets] if facets else None
    return K + springs.assemble(fem.FacetBasis(mesh, element, facets=at))


@pytest.mark.parametrize("flip", [None, False, True])
def test_named_facets_between_pieces_count_once(flip: bool | None) -> None:
    """From the side that they are seen from in the whole mesh: ranks part it at x = 1 / 2."""
    mesh = fem.MeshQuad().refined(3).with_subdomains({"left": lambda x: x[0] < 0.5})
    joint = mesh.facets_around("left", flip=bool(flip))
    inside = mesh.f2t[1, joint] >= 0
    ends = OrientedBoundary(np.asarray(joint)[inside], joint.ori[inside])
    mesh = replace(mesh, _boundaries={"joint": np.asarray(ends) if flip is None else ends})
    basis = numbering(mesh, fem.ElementVector(fem.ElementQuad1()))
    K, expected = Two().sum_of(partial(supported, facets="joint"), basis), supported(mesh, "joint")
    assert abs(K - expected).max() < 1e-13 * abs(expected).max()


@pytest.mark.parametrize("wrong", ["ends", "extent", "across"])
def test_what_is_no_sum_over_elements_is_refused(alone: Ranks, wrong: str) -> None:
    """Springs at all ends of what it is given, a modulus by its extent, gradients at inner facets."""
    mesh = fem.MeshQuad().refined(3).translated((2, 0))
    element = fem.ElementVector(fem.ElementQuad1())

    @fem.BilinearForm
    def jump(u: Any, v: Any, w: Any) -> Any:
        return u.grad[0, 0] * v.grad[0, 0]

    def stiffness(piece: Any) -> csr_matrix:
        if wrong == "ends":
            return supported(piece, None)
        K = linear_elasticity().assemble(fem.Basis(piece, element))
        if wrong == "extent":
            return K * piece.p[0].max()
        inside = np.flatnonzero(piece.f2t[1] >= 0)
        return K + (
            jump.assemble(fem.FacetBasis(piece, element, facets=inside)) if len(inside) else 0 * K
        )

    with pytest.raises(
        sc.errors.InputError, match=r"not the sum of those of each of them: off by .*boundaries"
    ):
        _on_piece(alone, stiffness, next(_pieces(fem.Basis(mesh, element), 1)))


@pytest.mark.parametrize("unlike", [False, True])
def test_the_reduced_matrix_is_that_of_the_whole_one(alone: Ranks, unlike: bool) -> None:
    """Trial and test space alike or not, supports that are held, terms that were added."""
    (lower, _), _ = blocks(2, "mortar", "small", 10)
    K = assembled(alone, elastic, lower.basis)
    A, rng, n = lower.K, np.random.default_rng(1), lower.n
    B = csr_matrix(rng.standard_normal((3, n)) * (rng.random(n) < 0.1))
    stack = StackedStiffness((lower,), [K], True) + csr_matrix(B.T @ B)
    C, f = csr_matrix(rng.standard_normal((4, n)) * (rng.random(n) < 0.1)), rng.standard_normal(n)
    trial = test = sc.elimination.eliminate(C, rng.standard_normal(4), lower.D, rng.standard_normal(n))
    if unlike:
        test = sc.elimination.eliminate(C[:, rng.permutation(n)], np.zeros(4), lower.D)
    K_r, f_r = stack.reduced(trial, f, test)
    expected, load = trial.reduce(A + B.T @ B, f, test=test)
    held = alone.held[stack.key]
    ((core, there, *change),) = K_r._pieces()
    rows = held.reduced(core, there, 7.0, petsc_assembled.csr_of(change, (n, n)))
    slot, place = K_r.layout.slot, _order(trial.independent, test.independent)
    assert_allclose(rows[slot][:, slot].toarray()[place], expected.toarray(), atol=1e-13)
    assert_allclose(f_r[place], load, atol=1e-12)
    assert_allclose(K_r.diagonal(), rows[slot][:, slot].diagonal(), atol=1e-13)
    gone = np.setdiff1d(np.arange(n), slot)
    assert (rows[gone].indices == gone).all() and (rows[gone].data == 7.0).all()
    motions = held.directions(alone.comm, there)[slot]
    assert_allclose(motions @ motions.T, _projector(directions(lower.rigid_modes[slot])), atol=1e-12)


def test_contact_is_eliminated_from_what_ranks_hold(alone: Ranks) -> None:
    """A backend is given the reduced matrix on ranks, and its answer is that of the whole matrix."""
    (lower, _), _ = blocks(2, "mortar", "small", 10)
    disc = sc.RigidCylinder((0.0, 5.0), 5.02)
    joint = sc.Contact(lower.surface("top"), disc, friction=sc.Coulomb(0.3))
    solver = sc.ContactSolver(lower, joint, linear=sc.linalg.Direct())
    result = solver.solve()
    assert set(result.status) == {0, 1, 2}
    problem, answer = solver.linear_model.problem_on(None, None), answer_of(result)
    stack = StackedStiffness((lower,), [assembled(alone, elastic, lower.basis)], True)

    def factorize(K_r: Any, **told: Any) -> Any:
        slot, held = K_r.layout.slot, alone.held[stack.key]
        ((core, there, *change),) = K_r._pieces()
        own = held.reduced(core, there, 1.0, petsc_assembled.csr_of(change, stack.shape))
        return SimpleNamespace(solve=lambda b: spsolve(own[slot][:, slot].tocsc(), b))

    load = problem.load(answer.case)
    expected = problem.solve(answer.conditions, load)
    problem.space = replace(problem.space, K=stack, backend=SimpleNamespace(factorize=factorize))
    found = problem.solve(answer.conditions, load)
    assert_allclose(found.solution, expected.solution, rtol=0, atol=1e-13)
    assert_allclose(found.normal_force, expected.normal_force, rtol=0, atol=1e-13)


def _projector(Q: np.ndarray) -> np.ndarray:
    return Q @ Q.T


def test_motions_that_follow_from_others_are_no_directions(alone: Ranks) -> None:
    """A multiple of a column, a sum of two, and a column of zeros."""
    rng = np.random.default_rng(0)
    one, two = rng.standard_normal((2, 30))
    Q = orthonormal(alone.comm, np.column_stack([one, 3 * one, 0 * one, two, one - two]))
    assert Q.shape == (30, 2)
    assert_allclose(Q.T @ Q, np.eye(2), atol=1e-15)


@pytest.mark.parametrize("dim", [2, 3])
def test_strains_on_a_basis_without_points_of_integration(dim: int) -> None:
    """They are those at the points of a rule of order 2, taken some elements at a time."""
    mesh = mesh_of(dim, 6, False)
    full = petsc_scenes.basis_of(mesh)
    bare = numbering(mesh, full.elem)
    K, u = elastic(mesh), np.random.default_rng(0).standard_normal(full.N)
    found, expected = (strains(sc.Body(basis, K), u) for basis in (bare, full))
    assert_allclose(found, expected, rtol=1e-12)


def test_threads_have_the_ranks_one_at_a_time(alone: Ranks) -> None:
    """Two commands at once would mix up their messages."""
    inside, most = [], []

    def work(own: Any, given: Any, parts: Any) -> list[Any]:
        inside.append(0)
        time.sleep(0.005)
        most.append(len(inside))
        inside.pop()
        return []

    threads = [Thread(target=alone.together, args=(work,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1, 1, 1, 1]


# -- by mpirun --------------------------------------------------------------------------------


@needs_petsc
@pytest.mark.parametrize("count", [2, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 3))])
def test_rows_on_all_ranks_are_those_of_the_matrix(tmp_path: Path, count: int) -> None:
    """Products, rows, the reduced matrix as PETSc has it; bodies on all ranks, and on one."""
    done = mpirun(count, "operators", tmp_path / "found.npz", script=SCRIPT)
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert len(found.files) == 63
        # sums of some hundred terms, in another order
        assert max(float(found[name]) for name in found.files) < 1e-13


@needs_petsc
@pytest.mark.parametrize(
    "count, scenes", [(2, FEW), *(pytest.param(n, ALL, marks=pytest.mark.slow) for n in (1, 2, 4))]
)
def test_answers_of_bodies_assembled_on_ranks(
    tmp_path: Path, count: int, scenes: tuple[str, ...]
) -> None:
    """Displacements, forces and reactions are the default's, and certified; matrices are given back."""
    done = mpirun(count, "answers", tmp_path / "found.npz", "assembled", *scenes)
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert_serial(found, scenes)
        assert found["most"] <= 40
        assert found["held"] <= 8
        assert found["rows"] == 0  # all bodies are gone, and ranks have forgotten them


@needs_petsc
@pytest.mark.slow
def test_bodies_that_contact_holds_and_tools(tmp_path: Path) -> None:
    """Free bodies, rigid ones beside those of ranks, springs in series: answers of the default."""
    done = mpirun(2, "others", tmp_path / "found.npz", script=SCRIPT)
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert len(found.files) == 15
        # residuals of 1e-12 times conditions of some hundreds; the tool hangs on its contact
        assert max(float(found[name]) for name in found.files) < 1e-9


@needs_petsc
@pytest.mark.slow
def test_factors_of_bodies_assembled_on_ranks(tmp_path: Path) -> None:
    """MUMPS, where it is there, has the same answers."""
    done = mpirun(2, "answers", tmp_path / "found.npz", "direct", "assembled")
    assert not done.returncode, done.stderr
    with np.load(tmp_path / "found.npz") as found:
        assert_serial(found, ALL)


@needs_petsc
def test_what_can_not_be_done_is_refused_in_words(tmp_path: Path) -> None:
    """Whatever needs all of K, functions without a name, matrices that do not fit; then it goes on."""
    done = mpirun(2, "refused", tmp_path / "said.txt", script=SCRIPT)
    assert not done.returncode, done.stderr
    words = [
        "there is no 'toarray' of it",
        "its columns were asked for",
        "numbers do not multiply it",
        r"it is multiplied with arrays (132,), this one is (3,)",
        "it can not be pickled or copied",
        "System.K needs all of it",
        "a factorisation, and its size, needs all of it",
        "linear = 'auto' needs it whole",
        "linear = AMG needs it whole",
        "linear = 'iterated' needs it whole",
        "K of a body has shape (108, 108), its basis has 132 DOFs",
        "K of a body is a form, and its basis has no points of integration",
        "f of a body is a form, and its basis has no points of integration",
        "can not find the function by its name",
        "assemble(function, basis): give the basis of a body",
        "rank 1 of 2: K of a piece of the mesh is a ndarray, not a sparse matrix",
        "K of a piece of the mesh has shape (90, 90), its basis has 36 DOFs",
        "1 of 3 DOFs are in no rank's matrix, the first is 1",
        "rank 1 of 2: K of this rank is not symmetric",
        "dofs that the function gave have numbers twice",
        "the function gave a NoneType, not (dofs, matrix)",
        "SingularMatrix: The stiffness left at DOF",
        "answers: True",
        "soft: True",
        "all held: 0.0",
    ]
    assert_said(tmp_path / "said.txt", words)


@needs_petsc
def test_an_assembly_that_fails_on_a_rank_ends_all(tmp_path: Path) -> None:
    """With the number of the rank, and what the function raised there."""
    done = mpirun(2, "broken", tmp_path / "none", script=SCRIPT)
    assert done.returncode
    assert "rank 1 of 2 failed, and all end with it" in done.stderr
    assert "FileNotFoundError: part_1.msh is not on this machine" in done.stderr
