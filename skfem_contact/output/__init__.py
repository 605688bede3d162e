"""Pictures, files and stresses.

* `nodes`: nodes and cells of bodies; `projection`, `stress`: derivatives and stresses at the nodes;
* `units`, `wanted`: words and fields that users ask for;
* `marching`, `tools`: rigid obstacles as lines and triangles;
* `vtu`, `grids`, `vtk`: files for ParaView;
* `view`, `drawing`, `draw_tools`: what stands where in a picture;
* `plot_bodies`, `plot_contacts`, `plot_histories`, `solids` (in 3-D): pictures with matplotlib;
* `scene`: pictures in space with PyVista;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "drawing": "arc_length",
        "solids": "draw_contact",
        "tools": "Tool",
    },
)
