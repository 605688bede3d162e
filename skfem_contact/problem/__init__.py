"""The contact problem: bodies reduced to gaps, slips and forces of the points.

* `seam`: the contact problem as load steps and loops see it; `response`: what they ask and are told;
* `points`: the problem on gaps and slips; `sparse`, `displacements`: on displacements;
* `substructure`, `condensed`: bodies condensed onto their contact DOFs; `delassus`: the dense matrix of
  their gaps and slips, and its size;
* `whole`, `held`, `layer`, `forces`, `iterated`: the same without dense matrices, for very many points;
* `multigrid`: without factors, for very large bodies;
* `full`: all DOFs, for any linear solver;
* `resistance`: what each point resists by itself; `series`: the problem with springs in series;
* `model`: the problem on one pairing, made from the bodies;
* `thresholds`: numbers, and where they come from.
"""
