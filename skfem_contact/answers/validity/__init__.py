"""Is the model valid at the answer? Small sliding, small rotations, no overlaps that nobody looked for.

* `watched`, `watch`: what every step measures and warns of;
* `drift`, `face_track` (in 3-D), `rotation`, `support`: how far small sliding and linear bodies have
  been left;
* `give`: how far the sides of a contact give under its forces;
* `solids`: the same at obstacles in 3-D;
* `chords`, `face_chords` (in 3-D): facets that are too long for what presses on a curve;
* `overlap`, `hull` (in 3-D), `meeting`, `skin`, `intrusion`: deformed boundaries against each other;
* `standing`, `flanks`, `lookout`: vertices and edges of solids that overlap where no row sees it, and
  what runs into sides that are in no contact;
* `validity`: all of it, on request.
"""
