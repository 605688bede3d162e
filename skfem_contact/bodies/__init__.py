"""What the user gives: bodies with their stiffness and loads, and the surfaces that may touch.

* `inputs`, `selection`: matrices, vectors, sets of DOFs and facets as users pass them, checked;
* `body`, `system`: one body, and several under one numbering;
* `surface`, `facets`, `normals`, `projection`: a boundary, its facets, normals, closest points.
"""
