"""Is the model valid at the answer? Small sliding, small rotations, no overlaps that nobody looked for.

* `validity`: the values that steps and `assess` measure, and what is beyond its bound, in words;
* `deformed_boundaries`: signed distances between deformed boundaries, seen from outside; `edges`: of
  solids, that cross; `overlaps`: where steps look for them, and what obstacles hide;
* `track`: where points are led by their slip, how the other side curves and where it ends; `chords`:
  facets that are too long for what presses on a curve;
* `support`: how bodies move as a whole, and how far they give under contact; `strain`: how far they are
  strained, and elements that can not keep their volume; `turned`: what turns leave out;
* `watch`, with a `contact_watch` per contact: looks after every step for what these may find; `assess`:
  the measures, and the verdict of steps and of `validity`.
"""
