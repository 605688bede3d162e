"""Constraints by elimination: ``C u = b`` becomes ``u = T u_r + c``.

* `pivoting`, `constraint`, `eliminate`: from rows to T;
* `condense`: the rows of contacts, and what solvers of scikit-fem take;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "pivoting": "find_pivots",
    },
)
