"""Rubber squeezed by half: its face doubles; pressures and friction by stress are by its area now."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem

import skfem_contact as sc

TAU = 1e-3


@pytest.mark.parametrize("partner", ["plane", "node", "mortar"])
def test_pressure_and_friction_are_by_the_deformed_area(partner: str) -> None:
    """A lid comes down and slides: by Tresca's law friction is tau times the length of the face."""
    grid = np.linspace(0, 10, 5)
    mesh = fem.MeshQuad.init_tensor(grid, grid).with_defaults()
    rubber = sc.NonlinearBody.from_mesh(
        mesh,
        fem.ElementVector(fem.ElementQuad1()),
        sc.materials.MooneyRivlin(0.5, 0.0, bulk=1000.0),
        D=lambda b: np.concatenate([b.get_dofs("bottom").all("u^2"), b.get_dofs("left").all("u^1")]),
        name="rubber",
    )
    lid, solids = sc.RigidPlane((0, 10), (0, -1), name="lid"), [rubber]
    if partner != "plane":
        wide = fem.MeshQuad.init_tensor(
            np.linspace(-30, 40, 15), np.array([10.0, 12.0])
        ).with_defaults()
        lid = sc.Body.from_mesh(
            wide, fem.ElementVector(fem.ElementQuad1()), sc.Elastic(1e6, 0.0), name="lid",
            D=lambda b: b.get_dofs().all(),
        ).surface("bottom")  # fmt: skip
        solids.append(lid.body)

    def placed(x: float, y: float) -> dict[str, object]:
        sides = ("top", "bottom", "left", "right")
        if partner == "plane":
            return {"motion": {"lid": (x, y)}}
        return {"x": {"lid": dict.fromkeys(sides, (x, y))}}

    contact = sc.Contact(
        rubber.surface("top"), lid, sliding="finite", friction=sc.Tresca(TAU),
        method="mortar" if partner == "plane" else partner, name="top",
    )  # fmt: skip
    solver = sc.ContactSolver(solids, contact, options=sc.Options(max_travel=np.inf))
    steps = [placed(0.0, -d) for d in (1.0, 2.0, 3.0, 4.0, 5.0)] + [
        placed(s, -5.0) for s in (6.0, 12.0)
    ]
    *_, last = solver.history(steps)
    top = rubber.surface("top").moved(last.displacement("rubber"))
    width = top.facet_areas.sum()
    assert width > 19  # 10 of the mesh
    values = last["top"]
    assert np.all(values.status == 2)
    # areas are those of the pairing: to `placement_tolerance`
    np.testing.assert_allclose(values.area.sum(), width, rtol=1e-4)
    np.testing.assert_allclose(values.contact_area, width, rtol=1e-4)
    np.testing.assert_allclose(abs(values.force[0]), TAU * width, rtol=1e-4)
    np.testing.assert_allclose(values.pressure @ values.area, abs(values.force[1]), rtol=1e-9)
