"""The discretisation error of tractions, estimated from the answer alone.

* `sources`: what is estimated;
* `surface`, `faces`: from the surface, curves or faces of solids;
* `body`: from the bodies behind it;
* `estimate`: all together, with advice.
"""
