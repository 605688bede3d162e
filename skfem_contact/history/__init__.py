"""The way through loads: steps, cuts, states, results.

* `read`: the user's step as loads, and results of a history that ended early;
* `load_step`: from where to where, one attempt, how far it has come, what friction took, and the
  displacements when asked for;
* `stepper`, `stepping`: one attempt; with the pairing and the wear of its own answer, and in
  smaller steps;
* `nonlinear`: the same for bodies that are not linear, linearised at every iterate, its linear problems
  to all their digits, and what is to be said of its answers;
* `neutral_equilibrium`, `equilibrium`: bodies whose place nothing decides; the answer of a
  step, or that it is refused (its words: `conditions.motions`);
* `solve_step`: from a load case to a result;
* `checkpoint`: states on disk;
* `solver`: what a solver is made of, other solvers that are made of it, and load steps: what users
  hold; `dry_run`: what it says before it solves, and while;
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.answers.tangent.derivatives import Gradient as Gradient
    from skfem_contact.answers.tangent.derivatives import Jacobian as Jacobian
    from skfem_contact.answers.tangent.modes import Damping as Damping
    from skfem_contact.history.checkpoint import SavedState as SavedState

__all__ = ["Damping", "Gradient", "Jacobian", "SavedState"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "checkpoint": "SavedState",
        ".answers.tangent.modes": "Damping",
        ".answers.tangent.derivatives": "Gradient Jacobian",
        "load_step": "recover_all",
        "neutral_equilibrium": "nearest",
        "stepping": "Bisection grown",
    },
)
