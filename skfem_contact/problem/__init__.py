"""The contact problem: bodies reduced to gaps, slips and forces of the points.

* `points`: what an iteration asks of the points and is told, and the dense problem that answers it;
* `seam`: the contact problem as load steps and loops see it, and what each point resists by itself;
* `zone`: the problem on gaps and slips, of the points that may carry a force;
* `substructure`: a body condensed onto its contact DOFs; `condensed`: all bodies, and if that pays;
* `forces`, `iterated`: the same without dense matrices, for very many points, and without factors, for
  very large bodies;
* `full`: on displacements of all DOFs, for any linear solver;
* `model`: the problem on one pairing, made from the bodies by one of these ways.
"""

from skfem_contact.records import entrances

__getattr__, __dir__ = entrances(
    __name__,
    (),
    {
        "condensed": "Condensed delassus_compliance Choice",
        "full": "FullProblem FullSystem SparseSpace",
        "iterated": "IteratedBodies IteratedProblem MultigridBodies MultigridProblem",
        "points": "Conditions Load PointSpace Resistance Response",
        "seam": "PosedOn Workspace independent",
        "substructure": "Substructure",
        "zone": "Compliance PointProblem Zone Zones",
    },
)
