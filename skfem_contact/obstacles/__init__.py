"""Rigid obstacles: they have no DOFs, they are paired and they move.

* `obstacle`: what every obstacle does;
* `shapes`, `level_set`: planes, cylinders, spheres, and a function of position.
"""
