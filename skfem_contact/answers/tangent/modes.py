r"""Vibration about a state of contact: its modes, and how friction damps them.

*Modes* are those of an assembly that is pressed together, or slides. Small vibrations leave the
statuses of all points as they are: closed gaps stay closed, and what sticks sticks, by the spring of
its law where that has one. With ``u = T u_r`` under these constraints

    T'KT u_r = omega^2 T'MT u_r.

Where points slide on steadily, friction follows the pressure of the vibration: its forces do no work on
virtual displacements W that go with ``B_n - mu d B_t`` in the place of ``B_n``, and the pencil
``W'KT, W'MT`` is not symmetric. Two of its modes may meet at some friction, and one of them grow:
squeal.

The lowest modes are those nearest to a shift below zero, at which the stiffness of free bodies too has
a factor. It is of the size of the first eigenvalues: the ratio of the diagonals of K and M is that of
the highest ones, and over the number of DOFs it is used.

*Damping* and frequency against amplitude are those of quasi-static modal analysis. Friction resists a
vibration as it resists slow motion, and a lightly damped structure vibrates in the shape of its mode.
So the mode is not followed in time: its own inertia forces are put on by load steps,

    f = f_0 + F r,    w = r'(u - u_0),    r = M phi / phi' M phi,    m = phi' M phi,

with the largest component of ``phi`` one, so that w is the displacement there. F grows up to a peak and
goes on as in a vibration at equal times, ``F cos(theta)``, in cycles until the loop of (w, F) closes. A
linear structure has ``F = m omega^2 w``. So the peaks give the frequency, and the area of the loop
the energy that a cycle loses:

    omega^2 = F / m w,    D = F int w sin(theta) dtheta,    zeta = D / (2 pi F w).

Friction may lose more than D: where a preload settles, its energy is lost as well, and damps nothing.
By Masing's rule each branch of a loop is the curve of first loading, twice as large. It holds where
normal forces do not change.

Lacayo and Allen, Mechanical Systems and Signal Processing 118 (2019); Festjens, Chevallier and Dion,
International Journal of Mechanical Sciences 75 (2013).
"""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import indent
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig
from scipy.sparse import block_diag, csc_matrix, csr_matrix
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs, eigsh

from skfem_contact.answers.answer import Answer, answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.tangent.tangent import Tangent, left_free
from skfem_contact.arguments import NamesAttributes, check_kind, numbers, shown, whole_number
from skfem_contact.arrays import Array
from skfem_contact.assemblies.joints import aligned
from skfem_contact.bodies.system import System
from skfem_contact.conditions.rows import tangential_matrix
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.errors import InputError, SingularMatrix, warn
from skfem_contact.linalg.dense_factors import single_threaded
from skfem_contact.linalg.direct import Direct
from skfem_contact.records import copied, dataclass

# A loop is closed if its ends are nearer than this part of its width: so much of its area has no
# meaning, two digits of a damping that meshes and friction coefficients tell to one.
CLOSED = 0.01

SLIPPING = "stuck", "free", "steady"
MASSLESS = (
    "modes were not found: the mass matrix is singular on what is free to move, or not positive. "
    "Give mass to all of the bodies, Body(..., mass=density), or ask for fewer modes."
)


@dataclass(frozen=True, eq=False, repr=False)
class Modes(NamesAttributes):
    """Modes of vibration about a state of contact, of `ContactSolver.modes`; the lowest first.

    Attributes
    ----------
    frequency : ndarray, shape (k,)
        Over full turns, zero for rigid motions [1/time].
    growth : ndarray, shape (k,)
        A mode grows as ``exp(growth t)``: zero, but where points slide on or bodies buckle [1/time].
    shapes : ndarray, shape (k, n)
        Displacements of all bodies, with ``u' M u = 1``. Where modes grow, points move out of phase:
        complex, with one as the largest component.
    slipping : str
        What slipping points do.
    system : System
        The bodies.

    Examples
    --------
    A square that floats has three rigid motions:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> basis = fem.Basis(
    ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
    ... )
    >>> block = sc.Body(basis, sc.Elastic(1.0, 0.3, density=1.0), name="block")
    >>> far = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, -1), (0, 1)))
    >>> solver = sc.ContactSolver(block, far)
    >>> modes = solver.modes(solver.solve(), 4)
    >>> modes.frequency.round(3).tolist(), modes.shapes.shape
    ([0.0, 0.0, 0.0, 0.413], (4, 50))
    """

    frequency: Array
    growth: Array
    shapes: NDArray[Any]
    slipping: str
    system: System

    def displacement(self, i: int, body: Any) -> NDArray[Any]:
        """The shape of one mode at the DOFs of one body, (n_body,)."""
        return np.asarray(self.shapes[i, self.system.slice(body)])

    def __repr__(self) -> str:
        lines = [f"{len(self.frequency)} modes, slipping points {self.slipping}"]
        for i, (frequency, growth) in enumerate(zip(self.frequency, self.growth, strict=True)):
            lines.append(f"  {i:3d}  {frequency:.6g}" + (f", grows by {growth:.4g}" if growth else ""))
        return "\n".join(lines)


def modes(answer: Answer, stiffness: Sequence[csr_matrix], n: int, slipping: str) -> Modes:
    """See `ContactSolver.modes`; `stiffness` is that of each body."""
    if slipping not in SLIPPING:
        raise InputError(f"slipping={shown(slipping)}; slipping points may be {', '.join(SLIPPING)}")
    if not answer.converged:
        raise InputError(f"this result did not converge ({answer.message}): no state to vibrate in")
    system, M = answer.system, mass(answer.system)
    K = csr_matrix(block_diag(stiffness, format="csr"))
    closed, interface = answer.local.status != OPEN, answer.model.interface
    stick = closed & (interface.frictional | interface.tied)
    if slipping != "stuck":
        stick &= answer.local.status == STICK
    spring = np.zeros(len(stick))
    for part, own in interface.laws:  # of joints that give; those of a loop are none
        G = 0.0 if own.law.stiffness in (None, np.inf) else own.law.stiffness
        spring[part] = np.where((stick & interface.frictional)[part], G, 0.0)
    stick &= spring == 0
    if np.any(spring):
        K = K + tangential_matrix(answer.kin.B_t, spring[:, None, None] * np.eye(answer.kin.tangents))
    slope = Tangent(answer).slope if slipping == "steady" else 0.0
    trial = left_free(answer, closed, stick)
    test = left_free(answer, closed, stick, slope) if np.any(slope) else trial
    count = len(trial.independent)
    whole_number(n, "n", 1, count)  # of what is free to move
    rims = None if answer.placed is None else answer.placed.rims
    symmetric, K = test is trial and rims is None, K if rims is None else K - rims
    K_r, M_r = test.T.T @ K @ trial.T, test.T.T @ M @ trial.T
    heavy = M_r.diagonal().sum()
    if not heavy > 0:
        raise InputError(MASSLESS)
    shift = float(K_r.diagonal().sum() / heavy) / count
    points = np.concatenate([body.dof_points for body in system.bodies])[trial.independent]
    try:
        with single_threaded:
            squares, found = _nearest(K_r, M_r, shift, n, points if symmetric else None)
    except (ArpackError, SingularMatrix) as error:
        raise InputError(f"{MASSLESS} ({error})") from None
    # rigid motions are found to round-off of the shift
    squares = np.where(np.abs(squares) <= SOLVED * shift, 0.0, squares)
    turns, least = np.sqrt(-squares.astype(complex)), SOLVED * np.sqrt(shift)  # as exp(turns t)
    turns = np.where(turns.imag < 0, -turns, turns)
    order = np.lexsort((-turns.real, np.round(turns.imag / least)))[:n]
    whole, turns = np.asarray(trial.T @ found[:, order]).T, turns[order]
    growth = np.where(np.abs(turns.real) > least, turns.real, 0.0)
    return Modes(np.abs(turns.imag) / (2 * np.pi), growth, _sized(whole, M, system), slipping, system)


def mass(system: System) -> csr_matrix:
    """Of all bodies, (n, n), in the numbering of the system."""
    mass = [getattr(body, "mass", None) for body in system.bodies]
    bare = [name for name, own in zip(system.names, mass, strict=True) if own is None]
    if bare:
        words = f"no mass is given of {', '.join(map(repr, bare))}: give Body(..., mass=), a density,"
        raise InputError(f"{words} form or matrix; RigidBody(..., mass=(m, m, J)), or a held obstacle.")
    return csr_matrix(block_diag([*map(system.scaled, system.bodies, mass)], format="csr"))


def _nearest(
    K: csr_matrix, M: csr_matrix, shift: float, n: int, points: Array | None
) -> tuple[Array, Array]:
    """Eigenvalues and vectors nearest to the shift: by ARPACK, or of the few DOFs that have a mass.

    Of a symmetric pencil, whose DOFs are at `points`; or of any, and one more then, as conjugates come
    in pairs.

    Raises
    ------
    InputError
        The mass is singular, or not positive.
    """
    factor = Direct().factorize(csc_matrix(K + shift * M), points=points, spd=points is not None)
    heavy = np.flatnonzero(abs(M).sum(axis=0))
    draw, size = np.random.default_rng(0).standard_normal, K.shape[0]
    if len(heavy) <= max(20, 2 * n + 2):  # what ARPACK takes as its own space
        moved = factor.solve(M[:, heavy].toarray())
        found, vectors = eig(moved[heavy])
        some = np.argsort(-np.abs(found))[: n + 1]
        some = some[np.abs(found[some]) > COMPUTED * np.abs(found[some[0]])]
        squares, vectors = 1.0 / found[some] - shift, moved @ (vectors[:, some] / found[some])
    elif points is not None:
        squares, vectors, many = np.zeros(0), np.zeros((size, 0)), n

        def others(b: Array) -> Array:
            return np.asarray(factor.solve(b) - vectors @ (vectors.T @ b / (squares + shift)))

        inverse = LinearOperator(K.shape, others, dtype=float)
        while many:
            # vectors to these digits, of which frequencies have twice as many
            found, own = eigsh(K, many, M, -shift, OPinv=inverse, v0=draw(size), tol=COMPUTED)
            squares, vectors = np.append(squares, found), np.hstack([vectors, own])
            # of several modes of one frequency a start has a part of one: another start finds others;
            # squares have twice the digits of vectors, few say whether one is left
            rough = SOLVED**0.25
            least, _ = eigsh(K, 1, M, -shift, OPinv=inverse, v0=draw(size), ncv=4, tol=rough)
            many = int(least[0] < np.sort(squares)[n - 1] - SOLVED * shift)
    else:
        operator = LinearOperator(K.shape, lambda v: factor.solve(M @ v), dtype=float)
        found, vectors = eigs(operator, n + 1, v0=draw(size))
        squares = 1.0 / found - shift
    # a singular mass makes vectors that solve nothing
    resisted, moved = (np.einsum("ij,ij->j", vectors.conj(), A @ vectors) for A in (K, M))
    with np.errstate(invalid="ignore"):
        left = np.abs(resisted - squares * moved)
        good = left <= SOLVED * (np.abs(resisted) + shift * np.abs(moved))
    if len(squares) < n or not np.all(good & (moved.real > 0)):
        raise InputError(MASSLESS)
    return squares, vectors


def _sized(shapes: NDArray[Any], M: csr_matrix, system: System) -> NDArray[Any]:
    """Shapes of a unit modal mass where they are real; with one as the largest component else."""
    shapes = shapes / np.take_along_axis(shapes, np.argmax(np.abs(shapes), axis=1)[:, None], axis=1)
    if not np.any(np.abs(shapes.imag) > SOLVED):
        shapes = shapes.real
        shapes = shapes / np.sqrt(np.einsum("ij,ji->i", shapes, M @ shapes.T))[:, None]
    return np.asarray(shapes / system.units)


# -- damping --------------------------------------------------------------------------------------


@dataclass(eq=False, repr=False)
class Damping(NamesAttributes):
    """Frequency and damping of a mode against amplitude, of `ContactSolver.damping`.

    A displacement is that of the component that moves most in the mode, and a force what does its work
    there: areas of loops are energies.

    Attributes
    ----------
    linear : float
        Frequency of the mode itself [1/time].
    amplitude : ndarray, shape (k,)
        Half of the way from peak to peak [length].
    frequency : ndarray, shape (k,)
        By the secant of the loop, over full turns [1/time].
    energy : ndarray, shape (k,)
        Lost in a cycle, the area of the loop [energy].
    damping : ndarray, shape (k,)
        Share of critical damping, ``energy / (2 pi force amplitude)``.
    masing : ndarray, shape (k,)
        Area of the loop that Masing's rule makes of the first loading [energy].
    dissipation : ndarray, shape (k,)
        What friction has lost in that cycle, summed over load steps [energy].
    cycles : ndarray of int, shape (k,)
        Until the loop closed.
    closed : ndarray of bool, shape (k,)
        Whether it did.
    loops, first : list of ndarray, shape (2 n + 1, 2) and (n + 1, 2)
        Displacements and forces: the last cycle, from peak to peak, and the first loading.
    bolts : dict of ndarray, shape (k,)
        By name how the force of a bolt has changed, from the result to the end of the cycles [force].

    Examples
    --------
    Without friction the loop is a line:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    >>> block = sc.Body(basis, sc.Elastic(1.0, 0.3, density=1.0), f={"top": 0.01}, name="block")
    >>> foot = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), tied=True)
    >>> solver = sc.ContactSolver(block, foot)
    >>> result = solver.solve()
    >>> print(solver.damping(result, solver.modes(result, 2), [1e-3, 2e-3]))
    damping of a mode of frequency 0.111944
      amplitude  frequency  damping  energy  by Masing  friction lost  cycles
          0.001   0.111944        0       0          0              0       1
          0.002   0.111944        0       0          0              0       1
    """

    linear: float
    amplitude: Array
    frequency: Array
    energy: Array
    damping: Array
    masing: Array
    dissipation: Array
    cycles: NDArray[np.intp]
    closed: NDArray[np.bool_]
    loops: list[Array]
    first: list[Array]
    bolts: dict[str, Array]

    def masing_loop(self, i: int) -> Array:
        """The loop that Masing's rule makes of the first loading of one amplitude, (2 n + 1, 2)."""
        w = self.first[i][:, 0]
        down = w[-1] - 2 * w
        return np.column_stack([np.append(down, -down[1:]), self.loops[i][:, 1]])

    def __repr__(self) -> str:
        columns = {"amplitude": self.amplitude, "frequency": self.frequency, "damping": self.damping}
        columns |= {"energy": self.energy, "by Masing": self.masing, "friction lost": self.dissipation}
        words = {name: [f"{value:.6g}" for value in own] for name, own in columns.items()}
        ends = zip(self.cycles, self.closed, strict=True)
        words["cycles"] = [f"{count}" + " (open)" * (not done) for count, done in ends]
        changes = self.bolts.items()
        words |= {f"force of {name}": [f"{value:+.6g}" for value in own] for name, own in changes}
        table = aligned([list(words), *zip(*words.values(), strict=True)], [False] * len(words))
        return f"damping of a mode of frequency {self.linear:.6g}\n{indent(table, '  ')}"


def damping(
    solver: Any, result: ContactResult, modes: Modes, wanted: ArrayLike, i: int, steps: int, cycles: int
) -> Damping:
    """See `ContactSolver.damping`."""
    check_kind(modes, Modes, "modes", "give what modes(result) found")
    whole_number(i, "mode", 0, len(modes.frequency) - 1)
    if modes.shapes.shape[1] != answer_of(result).system.n:
        raise InputError("modes are those of other bodies: give modes of this result")
    if np.iscomplexobj(modes.shapes[i]) or modes.growth[i] or not modes.frequency[i]:
        words = f"mode {i} is a rigid motion, grows, or is complex: it has no force that brings it back"
        raise InputError(f"{words}. Take another one; of slipping='stuck' or 'free' none is complex.")
    asked = np.atleast_1d(numbers(wanted, "amplitudes", "give a list of lengths"))
    if asked.ndim != 1 or not len(asked) or not np.all(np.isfinite(asked) & (asked > 0)):
        raise InputError(f"amplitudes = {shown(wanted)}; give a list of lengths above zero")
    whole_number(steps, "steps", 2)
    whole_number(cycles, "cycles", 1)
    system, linear = answer_of(result).system, float(modes.frequency[i])
    shape = modes.shapes[i] / np.abs(modes.shapes[i]).max()
    inertia = mass(system) @ shape
    m = float(shape @ inertia)
    peak = m * (2 * np.pi * linear) ** 2 * asked
    cycled = [_cycled(solver, result, inertia / m, force, steps, cycles) for force in peak]
    loops, first, count, closed, last = map(list, zip(*cycled, strict=True))
    if not all(closed):
        some = ", ".join(f"{w:.6g}" for w, shut in zip(asked, closed, strict=True) if not shut)
        warn(
            f"loops of the amplitudes {some} did not close in {cycles} cycles: the joint settles. "
            "Let more cycles pass, damping(..., cycles=...), or begin from a result that has been "
            "through some."
        )
    # half of the way between both peaks: loops that drift, or lie aside, have a middle of their own
    amplitude = np.array([0.5 * (loop[0, 0] - loop[steps, 0]) for loop in loops])
    sines = np.pi / steps * np.sin(np.pi / steps * np.arange(2 * steps + 1))
    energy = peak * [loop[:, 0] @ sines for loop in loops]
    masing = 2 * peak * [(w[-1, 0] - 2 * w[:, 0]) @ sines[: steps + 1] for w in first]
    energy, masing = (np.where(np.abs(e) > SOLVED * peak * amplitude, e, 0.0) for e in (energy, masing))
    frequency = np.sqrt(peak / (m * amplitude)) / (2 * np.pi)
    ratio = energy / (2 * np.pi * peak * amplitude)
    lost = np.array([sum(r.dissipation for r in own) for own in last])
    tight = [[own[-1].bolts[name].force - b.force for own in last] for name, b in result.bolts.items()]
    bolts = dict(zip(result.bolts, np.array(tight), strict=True))
    ends = energy, ratio, masing, lost, np.array(count), np.array(closed)
    return Damping(linear, amplitude, frequency, *ends, loops, first, bolts)


def _cycled(
    solver: Any, start: ContactResult, row: Array, peak: float, steps: int, cycles: int
) -> tuple[Array, Array, int, bool, list[ContactResult]]:
    """Loop, first loading, cycles, whether they closed, and the results of the last one."""
    angles, case = np.pi / steps * np.arange(2 * steps + 1), solver._answering.loads(answer_of(start))
    # a vector named in a step would take the place of pressures that follow the boundary
    case = copied(case, scale=(None, case.scale[1]), factor=None, bolts=None)

    def under(forces: Array, begin: ContactResult, w: float) -> tuple[Array, list[ContactResult]]:
        loads = [copied(case, f=case.f + force * row) for force in forces[1:]]
        results = list(solver.history(loads, start=begin))
        solver.recover(results)
        return np.array([[w, *(row @ (r.u - start.u) for r in results)], forces]).T, results

    # the loads at which Masing's branch has the angles of the loop
    first, results = under(0.5 * peak * (1 - np.cos(angles[: steps + 1])), start, 0.0)
    loop = first[-1:]
    for count in range(1, cycles + 1):  # noqa: B007 (how many there were)
        loop, results = under(peak * np.cos(angles), results[-1], loop[-1, 0])
        width = 0.5 * np.pi / steps * abs(loop[:, 0] @ np.sin(angles))
        closed = abs(loop[-1, 0] - loop[0, 0]) <= CLOSED * width + SOLVED * np.ptp(loop[:, 0])
        if closed:
            break
    return loop, first, count, bool(closed), results
