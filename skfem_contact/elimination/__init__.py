"""Constraints by elimination: ``C u = b`` becomes ``u = T u_r + c``.

* `inputs`, `pivoting`, `constraint`, `eliminate`: from rows to T;
* `condense`: for `skfem.solve`;
* `rows`: the rows of contacts, for scripts that solve for themselves;
* `thresholds`: numbers, and where they come from.
"""
