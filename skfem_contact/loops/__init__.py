"""The nonlinear iterations: which points are open, stick and slip.

* `step`: what loops are given and return, how points change, where supports prescribe slips too, how
  far a state is off, and how far to go at a time;
* `active_set`: the loops, the linear conditions of an iteration, and the points that hold a body in it;
* `multipliers`: springs that lose their strain, where forces are not unique;
* `driver`: the loops by name and limits, and what counts, logs and stops them;
* `starts`, `lemke`, `pulled`: where iterations begin, and what is carried at most;
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.loops.step import Record as Record

__all__ = ["Record"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "active_set": "direct fictitious linear_conditions newton stabilise",
        "driver": "LOOPS Stagnation drive",
        "pulled": "At",
        "starts": "admissible as_guess natural_state possible_starts starting_values",
        "step": "Guess Projection Record Step friction_of_prescribed_slip",
    },
)
