"""The contact problem: bodies reduced to gaps, slips and forces of the points.

* `seam`: the contact problem as load steps and loops see it; `response`: what they ask and are told;
* `points`: the problem on gaps and slips; `sparse`, `displacements`: on displacements;
* `substructure`, `parts`: a body condensed onto its contact DOFs, and each of a system;
* `contact_dofs`, `condensed`: the problem on contact DOFs, and on gaps and slips; `delassus`: the dense
  matrix of these, and its size;
* `whole`, `held`, `layer`, `forces`, `iterated`: the same without dense matrices, for very many points;
* `multigrid`: without factors, for very large bodies;
* `full`: all DOFs, for any linear solver;
* `resistance`: what each point resists by itself; `series`: the problem with springs in series;
* `choice`, `model`: which of these ways is taken; the problem on one pairing, made from the bodies;
* `thresholds`: numbers, and where they come from.
"""
