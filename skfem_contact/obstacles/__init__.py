"""Rigid obstacles: they have no DOFs, they are paired and they move.

* `obstacle`, `motion`: what every obstacle does, and how its motions are written;
* `shapes`, `level_set`: planes, cylinders, spheres, and a function of position.
"""
