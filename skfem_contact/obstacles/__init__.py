"""Rigid obstacles: they are paired and they move, as they are told or by their loads.

* `obstacle`: what every obstacle does, and what is made of straight facets; how motions are written,
  turns in space included;
* `shapes`: planes, cylinders, spheres; a function of position;
* `faceted`: an outline of edges; a surface of triangles, from a file; their flats, along the bends
  beside them;
* `rigid_body`: an obstacle with the DOFs of its motion, one of the bodies.
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.obstacles.shapes import LevelSet as LevelSet

__all__ = ["LevelSet"]

__getattr__, __dir__ = entrances(
    __name__, __all__, {"obstacle": "Obstacle read_motion rotation_matrix spin", "shapes": "LevelSet"}
)
