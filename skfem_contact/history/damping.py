r"""Frequency and damping of a mode against its amplitude: quasi-static modal analysis.

Friction resists a vibration as it resists slow motion, and a lightly damped structure vibrates in the
shape of its mode. So the mode is not followed in time: its own inertia forces are put on by load steps,

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

from textwrap import indent
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.tangent.modes import Modes, mass
from skfem_contact.arguments import check_kind, numbers, shown, whole_number
from skfem_contact.arrays import Array
from skfem_contact.assemblies.joints import aligned
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError, warn
from skfem_contact.history.load_step import recover_all
from skfem_contact.records import dataclass
from skfem_contact.sealed import copied

# A loop is closed if its ends are nearer than this part of its width: so much of its area has no
# meaning, two digits of a damping that meshes and friction coefficients tell to one.
CLOSED = 0.01


@dataclass(eq=False, repr=False)
class Damping:
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
    solver: Any,
    result: ContactResult,
    modes: Modes,
    amplitudes: ArrayLike,
    i: int,
    steps: int,
    cycles: int,
) -> Damping:
    """See `ContactSolver.damping`."""
    asked = _checked(modes, amplitudes, i, result)
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
    tight = {name: [own[-1].bolts[name].force for own in last] for name in result.bolts}
    bolts = {name: np.array(own) - result.bolts[name].force for name, own in tight.items()}
    ends = energy, ratio, masing, lost, np.array(count), np.array(closed)
    return Damping(linear, amplitude, frequency, *ends, loops, first, bolts)


def _checked(modes: Modes, amplitudes: ArrayLike, i: int, result: ContactResult) -> Array:
    check_kind(result, ContactResult, "result", "give one of solve() or history()")
    check_kind(modes, Modes, "modes", "give what modes(result) found")
    whole_number(i, "mode", 0, len(modes.frequency) - 1)
    if modes.shapes.shape[1] != answer_of(result).system.n:
        raise InputError("modes are those of other bodies: give modes of this result")
    if np.iscomplexobj(modes.shapes[i]) or modes.growth[i] or not modes.frequency[i]:
        raise InputError(
            f"mode {i} is a rigid motion, grows, or is complex: it has no force that brings it back. "
            "Take another one; of slipping='stuck' or 'free' none is complex."
        )
    asked = np.atleast_1d(numbers(amplitudes, "amplitudes", "give a list of lengths"))
    if asked.ndim != 1 or not len(asked) or not np.all(np.isfinite(asked) & (asked > 0)):
        raise InputError(f"amplitudes = {shown(amplitudes)}; give a list of lengths above zero")
    return asked


def _cycled(
    solver: Any, start: ContactResult, row: Array, peak: float, steps: int, cycles: int
) -> tuple[Array, Array, int, bool, list[ContactResult]]:
    """Loop, first loading, cycles, whether they closed, and the results of the last one."""
    angles, case = np.pi / steps * np.arange(2 * steps + 1), solver._begin(answer_of(start))
    # a vector named in a step would take the place of pressures that follow the boundary
    case = copied(case, scale=(None, case.scale[1]), factor=None, bolts=None)

    def under(forces: Array, begin: ContactResult, w: float) -> tuple[Array, list[ContactResult]]:
        loads = [copied(case, f=case.f + force * row) for force in forces[1:]]
        results = list(solver.history(loads, start=begin))
        recover_all([answer_of(result) for result in results])
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
