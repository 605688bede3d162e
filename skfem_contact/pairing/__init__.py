"""What meets what: the points of one surface on the facets of another.

* `search`, `vectors`: which facets can meet a point, or along its normal; vectors in the plane;
* `closest`, `node`, `corners`: node-to-segment contact, convex corners included;
* `segmentation`, `dual`, `mortar`, `supports`, `smooth`, `kinks`: dual mortar contact;
* `faces`: the same in 3-D;
* `facing`, `frames`: normals of both sides, and the frames of small sliding;
* `diagnosis`: what looks wrong with a pairing, in sentences;
* `faces`: the same for faces of solids;
* `thresholds`: numbers, and where they come from.
"""
