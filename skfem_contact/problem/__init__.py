"""The contact problem: bodies reduced to gaps, slips and forces of the points.

* `seam`: the contact problem as load steps and loops see it, what they ask and are told;
* `points`: the problem on gaps and slips, `zone`: on those that may carry a force;
* `substructure`: a body condensed onto its contact DOFs; `condensed`: all bodies, and what is left of
  them on gaps and slips;
* `forces`, `iterated`: the same without dense matrices, for very many points, and without factors, for
  very large bodies;
* `full`: on displacements of all DOFs, for any linear solver;
* `springs`: those that points are seen through where their rows depend on each other, and what each
  point resists by itself;
* `choice`, `model`: which of these ways is taken; the problem on one pairing, made from the bodies;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.records import entrances

__getattr__, __dir__ = entrances(
    __name__,
    (),
    {
        "choice": "Choice",
        "condensed": "Condensed PointProblem delassus_compliance",
        "full": "FullProblem FullSystem SparseSpace",
        "iterated": "IteratedBodies IteratedProblem MultigridBodies MultigridProblem",
        "points": "PointSpace",
        "seam": "Conditions Load PosedOn Resistance Response Workspace",
        "springs": "independent least_friction",
        "substructure": "Substructure",
        "zone": "Compliance Zone Zones definite_inverse",
    },
)
