"""Answers, and what can be said of them.

* `answer`: all numbers of a load step, for the modules of this library, and forces of supports;
  `fields`, `values`: those of each contact, between its points and at them; `placed`, `newton`: where
  bodies that are not linear are and what they remember, and how their residuals fell;
* `certificate`: how well the discrete equations hold; `uniqueness`: whether there are other answers, by
  the `pieces` of the equation, or a proof that there is only one; other forces;
* `validity`: whether the model holds; `error`: how far the mesh may be off;
* `tangent`: the answer linearised, and its derivatives;
* `result`, `by_contact`: all of it as users see it, and printed; by contacts, and of the one there may
  be;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "answer": "answer_of",
        "error.net": "Net",
        "fields": "Segments closed_area contact_edge contour edge_positions find_edges interpolate",
        "pieces": "critical_friction orientation turning_springs",
        "uniqueness": "Form unique_up_to",
        "validity.chords": "bends sagittas",
        "validity.deformed_boundaries": "Boundary boundary",
        "validity.edges": "crossings sharp_edges_of",
        "validity.overlaps": "pierced",
        "validity.strain": "strains",
        "validity.support": "Support",
        "validity.track": "Rim Track curvatures node_lengths",
        "validity.words": "facet_words",
    },
)
