"""The discretisation error of tractions, estimated from the answer alone.

* `surface`: from the surface, by what the values around each node tell;
* `estimate`: from the bodies behind it, and all together, with advice.
"""
