"""The discretisation error of tractions, estimated from the answer alone.

* `sources`: what is estimated;
* `misfit`, `surface`, `faces`, `second_order`: from the surface, curves or faces of solids;
* `body`: from the bodies behind it; `chords`: from what straight facets make of curves;
* `estimate`: all together, with advice.
"""
