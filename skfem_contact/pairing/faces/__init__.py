"""Faces of solids: what meets what in 3-D.

* `cells`, `clipping`, `candidates`, `layers`: plane parts of faces, and what two have in common;
* `meeting`, `segmentation`: pieces of an interface, and points on both of its sides;
* `dual`, `supports`, `mortar`: multipliers, what supports leave of them, and the rows.
"""
