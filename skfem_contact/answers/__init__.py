"""What an answer is and what can be said of it.

* `answer`: all numbers of a load step, for the modules of this library; `fields`, `contours`,
  `values`: those of each contact; `reaction`: forces of supports;
* `certificate`: how well the discrete equations hold; `uniqueness`: whether there are other answers,
  by the `pieces` of the equation, and by a proof that there is only `one_answer`, or other forces;
* `validity`: whether the model holds; `error`: how far the mesh may be off;
* `result`, `by_contact`: all of it as users see it, by contacts, and of the one there may be;
* `contact_report`, `report`: all of it printed;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "answer": "answer_of",
        "contours": "contour",
        "error.faces": "Net",
        "fields": "Segments closed_area edge_positions find_edges interpolate",
        "one_answer": "Form unique_up_to",
        "pieces": "critical_friction orientation turning_springs",
        "validity.chords": "bends sagittas tool_sagittas",
        "validity.deformed_boundaries": "Boundary boundary",
        "validity.obstacle_overlaps": "pierced",
        "validity.strain": "strains",
        "validity.support": "Support",
        "validity.track": "Rim Track curvatures node_lengths",
        "validity.unseen": "crossings sharp_edges_of unseen_overlaps",
        "validity.words": "facet_words",
    },
)
