"""The contact problem: bodies reduced to gaps, slips and forces of the points.

* `spaces`: what a loop asks and is told; the problem on displacements;
* `points`: the problem on gaps and slips;
* `substructure`, `condensed`: bodies condensed onto their contact DOFs;
* `full`: all DOFs, for any linear solver;
* `placement`, `model`: the problem on one pairing, made from the bodies.
"""
