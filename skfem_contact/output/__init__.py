"""Pictures, files and stresses.

* `stress`: nodal stresses; `vtk`: files for ParaView;
* `drawing`, `plot_bodies`, `plot_contacts`, `solids` (in 3-D): pictures with matplotlib;
* `thresholds`: numbers, and where they come from.
"""
