"""Pictures, files and stresses.

* `stress`: stresses at the nodes; `fields`: fields over the nodes, and units;
* `tools`: rigid obstacles as lines and triangles;
* `grids`, `vtk`: files for ParaView;
* `view`, `drawing`: what stands where in a picture, and what all pictures have;
* `plot_bodies`, `plot_contacts`, `plot_pairs`, `plot_histories`, `solids`: pictures with matplotlib;
* `scene`: pictures in space with PyVista.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "drawing": "arc_length",
        "solids": "draw_contact",
        "tools": "Tool outline",
    },
)
