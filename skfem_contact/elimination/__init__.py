"""Constraints by elimination: ``C u = b`` becomes ``u = T u_r + c``.

* `pivoting`, `constraint`: from rows to T, those of contacts too, and what solvers of scikit-fem take.
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.elimination.constraint import AffineConstraint as AffineConstraint
    from skfem_contact.elimination.constraint import ConstraintRows as ConstraintRows
    from skfem_contact.elimination.constraint import condense as condense
    from skfem_contact.elimination.constraint import contact_rows as contact_rows
    from skfem_contact.elimination.constraint import eliminate as eliminate

__all__ = ["AffineConstraint", "ConstraintRows", "condense", "contact_rows", "eliminate"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "constraint": "AffineConstraint eliminate condense ConstraintRows contact_rows",
        "pivoting": "find_pivots",
    },
)
