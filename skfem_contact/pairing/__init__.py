"""What meets what: the points of one surface on the facets of another.

* `search`, `vectors`: which facets can meet a point, or along its normal; vectors in the plane;
* `closest`, `node`, `seams`: node-to-segment contact;
* `vertices`, `corners`, `corner_rows`: convex corners, what they meet, and the rows of that;
* `mortar`: dual mortar contact of curves and of faces, in steps:
  `segmentation`, `pieces`, `moments`: intervals of curves, what meets on a piece, integrals over them;
  `dual`, `supports`: multipliers, and what supports change of them;
  `mortar_rows`, `kinks`: the rows, and their gaps over kinks;
* `smooth`, `bulges`: smooth boundaries of facets, and what they change of rows;
* `facing`, `frames`, `compliances`: normals of both sides, and the frames of small sliding;
* `diagnosis`: what looks wrong with a pairing, in sentences;
* `faces`: what is different for faces of solids;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "compliances": "plane_moduli",
        "corners": "corner_contacts unselected_sides",
        "diagnosis": "diagnose",
        "dual": "DualBasis dual_basis node_rows positive_functions",
        "faces.clipping": "Polygons clip signed_areas",
        "faces.closest": "closest_faces",
        "faces.edges": "Edges crossings sharp_edges_of",
        "faces.joints": "rim_points",
        "faces.layers": "nearest_parts several_sheets",
        "faces.node": "node_to_face",
        "faces.projection": "interpolated_normals project",
        "faces.rollers": "along_supports",
        "faces.search": "FaceTree closest_candidates",
        "faces.segmentation": "segment",
        "faces.unseen": "unseen_overlaps",
        "kinks": "least_gaps",
        "moments": "whole_shares",
        "mortar": "dual_mortar",
        "node": "gap_vectors node_to_segment",
        "vertices": "Corners",
    },
)
