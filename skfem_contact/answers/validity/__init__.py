"""Is the model valid at the answer? Small sliding, small rotations, no overlaps that nobody looked for.

* `watched`, `watch`, `contact_watch`: what every step measures, and suspects; `words`: in sentences;
* `drift`: how far small sliding has been left; `track`, `curve_track`, `face_track` (in 3-D): where
  points are led by their slip; `ends`, `curvature`: where surfaces end, how they curve;
* `strain`, `rotation`, `support`: how far bodies are strained and turn, and what supports say of it;
* `locking`: elements that can not keep their volume;
* `give`: how far the sides of a contact give under its forces;
* `solids`: the same at obstacles in 3-D;
* `chords`, `face_chords` (in 3-D), `tool_chords`: facets that are too long for what presses on a curve;
* `flats`: normals that lean on flats of obstacles made of few triangles;
* `behind`: surfaces that begin in the solid of their obstacle, and touch nothing;
* `overlap`, `hull` (in 3-D), `meeting`, `skin`, `intrusion`: deformed boundaries against each other;
* `standing`, `flanks`, `lookout`: vertices and edges of solids that overlap where no row sees it, and
  what runs into sides that are in no contact;
* `assess`: the measures, and the verdict of steps and of `validity`, which has the numbers.
"""
