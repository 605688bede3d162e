"""The answer linearised: what its derivatives follow from.

* `tangent`: which points are open, stuck and slipping, with the derivatives of their friction, and how
  far each is from a change; `changes`: what an answer may be differentiated by, and what that changes;
* `rates`: from changes to derivatives of an answer, backwards from an answer to changes, and to one
  side, where points are about to change; `derivatives`: of results and histories, as users see them;
* `modes`: vibration about an answer, and its damping by load steps along the forces of a mode.
"""
