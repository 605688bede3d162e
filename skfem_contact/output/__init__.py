"""Pictures, files and stresses.

* `stress`: stresses and other fields at the nodes, and units;
* `tools`: rigid obstacles as lines and triangles;
* `vtk`: files for ParaView;
* `drawing`: what stands where in a picture, and what all pictures have;
* `solids`: what is drawn in space, by PyVista or by matplotlib;
* `plot_bodies`, `plot_contacts`, `plot_histories`: pictures with matplotlib, and bodies in a window of
  PyVista.
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.output.plot_bodies import scene as scene
    from skfem_contact.output.plot_contacts import plot_joints as plot_joints
    from skfem_contact.output.plot_contacts import plot_pairs as plot_pairs
    from skfem_contact.output.plot_histories import plot_damping as plot_damping
    from skfem_contact.output.plot_histories import plot_force as plot_force
    from skfem_contact.output.stress import nodal_field as nodal_field

__all__ = ["nodal_field", "plot_damping", "plot_force", "plot_joints", "plot_pairs", "scene"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "drawing": "arc_length",
        "plot_bodies": "scene",
        "plot_contacts": "draw_contact plot_joints plot_pairs",
        "plot_histories": "plot_damping plot_force",
        "stress": "nodal_field",
        "tools": "Tool outline",
    },
)
