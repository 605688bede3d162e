"""Contact that goes over a convex corner: no overlap that is neither refused nor warned of."""

from __future__ import annotations

import numpy as np
import pytest
from corner_scenes import overlap, path, scene


@pytest.mark.parametrize("shape", ["disc", "square"])
def test_an_open_point_lies_in_no_body(shape):
    """A body that is brought from elsewhere in one step is in contact: no open point overlaps.

    The pairing of a step is first that of where the last one tends to, here far beyond, where nothing
    meets; the answer on it, seen from its own pairing, overlaps by all of the push.
    """
    solver, put = scene(secondary="block", method="mortar", shape=shape)
    places = path("straight")[:3]
    far = (np.array([-2.0, 1.5]), 0.0)
    away, *results = solver.history([put(*place) for place in (far, *places)])
    assert away.normal_force.max() == 0
    assert all(r.normal_force.max() > 0 for r in results)
    # mortar holds weighted gaps: between the points what the chords of 0.1 explain is left
    assert max(overlap(r) for r in results) < 0.0025
