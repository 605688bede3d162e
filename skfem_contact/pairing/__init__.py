"""The pairing: points of one surface on the facets of another, in the plane and in space.

* `search`: which facets can meet a point;
* `projection`: closest points of facets, and what leads along a surface from edges and corners;
* `closest`, `node`: closest points of surfaces, and node-to-segment contact;
* `corners`: convex corners of curves, what they meet, and the rows of that;
* `mortar`: dual mortar contact: the rows, their normals and gaps, in steps:
  `segmentation` finds the pieces on which facet meets facet, and integrates over them
  (`cells`: plane parts of facets; `clipping`: polygons, and intervals of curves);
  `dual`: the dual basis of multipliers, and what supports change of it;
* `smooth`: smooth boundaries of facets, and what they change of rows;
* `diagnosis`: what looks wrong with a pairing, in sentences.
"""

from skfem_contact.records import entrances

__getattr__, __dir__ = entrances(
    __name__,
    (),
    {
        "clipping": "Polygons clip nearest_parts several_sheets signed_areas",
        "closest": "closest_facets",
        "corners": "corner_contacts Corners unselected_sides",
        "diagnosis": "diagnose",
        "dual": "DualBasis dual_basis node_rows",
        "mortar": "dual_mortar least_gaps",
        "node": "gap_vectors node_to_segment Pairing whole_shares",
        "projection": "interpolated_normals project rim_points",
        "segmentation": "segment",
        "search": "FacetTree closest_candidates",
    },
)
