"""The discretisation error of tractions, estimated from the answer alone.

* `sources`: what is estimated;
* `misfit`, `surface`: from the surface; `body`: from the bodies behind it;
* `estimate`: all together, with advice.
"""
