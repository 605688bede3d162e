"""The contact problem: bodies reduced to gaps, slips and forces of the points.

* `seam`: the contact problem as load steps and loops see it; `response`: what they ask and are told;
* `points`: the problem on gaps and slips; `sparse`: on displacements;
* `substructure`, `parts`: a body condensed onto its contact DOFs, and each of a system;
* `contact_dofs`, `condensed`: the problem on contact DOFs, and on gaps and slips; `delassus`: the dense
  matrix of these, and its size;
* `whole`, `held`, `layer`, `forces`, `iterated`: the same without dense matrices, for very many points;
* `multigrid`: without factors, for very large bodies;
* `full`: all DOFs, for any linear solver;
* `resistance`: what each point resists by itself; `series`: the problem with springs in series;
* `springs`: those that points are seen through where their rows depend on each other;
* `machine`: the problem under a load that is pulled through a spring;
* `choice`, `model`: which of these ways is taken; the problem on one pairing, made from the bodies;
* `workspace`: what one solve remembers of it, apart from what others do at the same time;
* `thresholds`: numbers, and where they come from.
"""
