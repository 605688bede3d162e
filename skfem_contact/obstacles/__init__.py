"""Rigid obstacles: they are paired and they move, as they are told or by their loads.

* `obstacle`, `motion`: what every obstacle does, how its motions are written, turns in space included;
* `shapes`, `level_set`: planes, cylinders, spheres; a function of position;
* `faceted`: what is made of straight facets; `polyline`, an outline of edges, and `triangles`, a
  surface of them, from a file; `bends`: their flats, along the bends beside them;
* `rigid_body`: an obstacle with the DOFs of its motion, one of the bodies.
"""
