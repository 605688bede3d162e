"""Faces of solids: what meets what in 3-D.

* `joints`: sharp edges, corners, and what leads along a surface there;
* `search`: which faces can hold the closest point to a node;
* `control`: rows of quadratic faces whose nodal forces have no sign; `rollers`: tangents at supports;
* `projection`, `closest`, `node`: closest points of faces and of surfaces, node-to-face contact;
* `unseen`: corners of triangles that stand between the nodes of the secondary;
* `edges`: sharp edges, and where those of two solids cross;
* `distance`: how far points are from a surface, and on which side;
* `cells`, `clipping`, `candidates`, `layers`: plane parts of faces, and what two have in common;
* `meeting`, `segmentation`: polygons of an interface, and points on both of its sides.
"""
