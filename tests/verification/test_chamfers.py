"""Blocks with chamfers on a flat: a kink in a straight side is no curve.

Multipliers of mortar contact reach over the kink. Where they are negative over the chamfer, which is
open by the size of a facet, the weighted gap was an overlap: forces up to 18 times too large, with a
certificate at round-off. And the normal at the kink is that of the flat, not a mean with the chamfer's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scenes import elastic
from unlike_meshes import KINDS, named_sides

import skfem_contact as sc
from skfem_contact.bodies import kind_of, kink_angles, twin_edges

# contact ends within a facet of the lower block, this part of the width; .3 to 6 % are measured
EDGE = 0.07
ANGLES = [5, 15, 30, 44.9, 60, 80]


def bases(degrees, kind, facets):
    """A block, flat for |x| < 1 and chamfered out to 1.5, on a wider one."""
    flat, chamfer = np.linspace(-1, 1, 13), 1 + np.linspace(0, 0.4, facets + 1)[1:]
    upper = fem.MeshQuad.init_tensor(
        np.concatenate([-chamfer[::-1], flat, chamfer]), np.linspace(0, 2, 9)
    )
    lower = fem.MeshQuad.init_tensor(np.linspace(-3, 3, 44), np.linspace(-2, 0, 9))
    out = []
    for mesh, tilt in ((upper, np.tan(np.radians(degrees))), (lower, 0.0)):
        mesh = named_sides(mesh.to_meshtri() if kind.startswith("P") else mesh)
        p = mesh.p.copy()
        lift = tilt * np.maximum(np.abs(p[0]) - 1, 0)
        p[1] += lift * (1 - p[1] / 2)
        element = fem.ElementVector(KINDS[kind]())
        out.append(fem.Basis(replace(mesh, doflocs=p), element, intorder=4))
    return out


def pressed(degrees, method="mortar", swap=False, *, kind="Q1", facets=3, mu=0.0, sliding="small"):
    """The block pushed down by 1e-3."""
    block, flat = bases(degrees, kind, facets)
    x = np.zeros(block.N)
    x[block.get_dofs("top").all("u^2")] = -1e-3
    bodies = [
        sc.Body(block, elastic(1.0, 0.3), D="top", x=x, name="block"),
        sc.Body(flat, elastic(1.0, 0.3), D="bottom", name="flat"),
    ]
    pair = bodies[0].surface("bottom"), bodies[1].surface("top")
    law = sc.Coulomb(mu) if mu else None
    contact = sc.Contact(*pair[:: -1 if swap else 1], method=method, sliding=sliding, friction=law)
    return sc.ContactSolver(bodies, contact).solve()


@pytest.mark.every_value
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("degrees", ANGLES)
def test_mortar_presses_as_node_to_segment_does(degrees, swap):
    """The same force, whichever side is secondary; it acts along the flat's normal."""
    mortar, node = (pressed(degrees, method, swap) for method in ("mortar", "node"))
    assert_allclose(mortar.force[1], node.force[1], rtol=EDGE)
    for result in (mortar, node):
        closed = result.normal_force > 0
        assert_allclose(result.normal[closed, 0], 0.0, atol=1e-12)
        assert np.abs(result.points[closed, 0]).max() < 1.2


@pytest.mark.every_value
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize(
    "settings",
    [{"kind": "P1"}, {"kind": "S2"}, {"facets": 1}, {"mu": 0.3}, {"sliding": "finite"}],
    ids=str,
)
def test_other_elements_chamfers_and_settings(settings, swap):
    """The same for quadratic elements, chamfers of one facet, friction and finite sliding."""
    mortar, node = (pressed(30, method, swap, **settings) for method in ("mortar", "node"))
    assert_allclose(mortar.force[1], node.force[1], rtol=EDGE)


def turning(angles, start=0.0):
    """Kinks of a chain of facets of length 1 that turn by `angles` [degrees]."""
    direction = np.radians(start + np.cumsum([0.0, *angles]))
    steps = np.stack([np.cos(direction), np.sin(direction)], axis=1)
    points = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    n = len(steps)
    facets = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
    return np.degrees(kink_angles(points, facets, kind_of(2, 2), twin_edges(facets)))


def test_curves_have_no_kinks():
    """Arcs, spirals, and the arc of a fillet; but where it begins, known by half its turns."""
    assert not turning([15] * 5).any()
    assert not turning([4, 6, 9, 14, 20]).any()
    assert not turning([15, -15, 15]).any()
    assert_allclose(turning([0, 0, 15, 0]), [0, 0, 0, 15, 0, 0], atol=1e-6)
    fillet = turning([0, 5, 10, 10, 5, 0])
    assert_allclose(fillet, [0, 0, 5, 0, 0, 5, 0, 0], atol=1e-6)
