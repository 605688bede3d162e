"""The nonlinear iterations: which points are open, stick and slip.

* `step`: what loops are given and return, and the points that hold a body in it;
* `active_set`: how points change, where supports prescribe slips too, how far a state is off, how far
  to go at a time, and the linear conditions of an iteration;
* `multipliers`: springs that lose their strain, where forces are not unique;
* `driver`: the loops, and what counts, logs and stops them;
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
        "active_set": "Projection friction_of_prescribed_slip linear_conditions",
        "driver": "LOOPS Stagnation direct drive fictitious newton",
        "multipliers": "least_friction",
        "pulled": "At",
        "starts": "admissible as_guess natural_state possible_starts starting_values",
        "step": "Guess Record Step stabilise",
    },
)
