"""Is the model valid at the answer? Small sliding, small rotations, no overlaps that nobody looked for.

* `validity`: the values that steps and `assess` measure, their bounds, and what is beyond, in words;
* `deformed_boundaries`: signed distances between deformed boundaries, seen from outside, their edges
  and rims; `overlaps`: what lies in the other body by these, where steps look, what obstacles hide;
* `track`: what each contact knows: where points are led by their slip, where the other side ends;
  `chords`: facets that are too long for what presses on a curve;
* `support`: how bodies move and turn as a whole, what turns leave out, and how far they give under
  contact; `strain`: how far they are strained, and elements that can not keep their volume;
* `assess`: the look at every step for what these may find, the measures, and the verdict of steps and
  of `result.validity`.
"""
