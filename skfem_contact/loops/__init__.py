"""The nonlinear iterations: which points are open, stick and slip.

* `step`: what loops are given and return;
* `complementarity`: how points change, where supports prescribe slips too, and how far a state is off;
* `tangent`: the linear conditions of an iteration, and the points that hold a body in it;
* `active_set`: the three loops, each by its name and limits, and how far they go at a time;
* `multipliers`: springs that lose their strain, where forces are not unique;
* `driver`: what counts, logs and stops them;
* `starts`, `lemke`, `pulled`: where iterations begin, and what is carried at most;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "active_set": "BlockPivoting LOOPS direct fictitious newton",
        "complementarity": "disagreement friction_of_prescribed_slip law_residual left_over propose "
        "violations",
        "driver": "Stagnation drive",
        "pulled": "At",
        "starts": "admissible as_guess natural_state possible_starts starting_values",
        "step": "Guess Step",
        "tangent": "linear_conditions stabilise",
    },
)
