"""The discretisation error of tractions, estimated from the answer alone.

* `sources`: what is estimated;
* `net`, `surface`: from the surface, by what the values around each node tell;
* `body`: from the bodies behind it;
* `estimate`: all together, with advice.
"""
