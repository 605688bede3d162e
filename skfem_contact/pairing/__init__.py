"""What meets what: the points of one surface on the facets of another.

* `search`, `vectors`: which facets can meet a point, or along its normal; vectors in the plane;
* `closest`, `node`, `seams`: node-to-segment contact;
* `vertices`, `corners`, `corner_rows`: convex corners, what they meet, and the rows of that;
* `segmentation`, `dual`, `mortar`, `mortar_rows`, `supports`, `kinks`: dual mortar contact;
* `smooth`, `bulges`: smooth boundaries of facets, and what they change of rows;
* `facing`, `frames`, `compliances`: normals of both sides, and the frames of small sliding;
* `diagnosis`: what looks wrong with a pairing, in sentences;
* `faces`: the same for faces of solids;
* `thresholds`: numbers, and where they come from.
"""
