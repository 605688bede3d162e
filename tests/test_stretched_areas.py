"""Areas of contact: of deformed surfaces, of what moves with the body, of what the primary covers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.typing import ArrayLike

import skfem_contact as sc

TAU = 1e-3


@pytest.mark.parametrize("partner", ["plane", "node", "mortar"])
def test_pressure_and_friction_are_by_the_deformed_area(partner: str) -> None:
    """Under a lid that slides friction by Tresca's law is tau times the length of the face."""
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


def test_areas_that_have_not_settled_are_called_areas() -> None:
    """Rubber under a lid, stopped as soon as forces balance: partners stay, and its face is longer."""
    grid = np.linspace(0, 10, 5)
    mesh = fem.MeshQuad.init_tensor(grid, grid).with_defaults()
    rubber = sc.NonlinearBody.from_mesh(
        mesh,
        fem.ElementVector(fem.ElementQuad1()),
        sc.materials.MooneyRivlin(0.5, 0.0, bulk=1000.0),
        D=lambda b: np.concatenate([b.get_dofs("bottom").all("u^2"), b.get_dofs("left").all("u^1")]),
    )
    lid = sc.RigidPlane((0, 10), (0, -1), name="lid")
    contact = sc.Contact(rubber.surface("top"), lid, sliding="finite", name="top")
    options = sc.Options(max_travel=np.inf, max_placements=3, max_cuts=0)
    with pytest.raises(sc.errors.NotConverged) as error:
        sc.ContactSolver(rubber, contact, options=options).solve(motion={"lid": (0.0, -1.0)})
    words = str(error.value)
    assert "of contact 'top'" in words and "bears its force on another area" in words
    assert "partner" not in words and "corners" not in words


ELEMENTS = {
    "quad1": (fem.MeshQuad, fem.ElementQuad1),
    "quad2": (fem.MeshQuad, fem.ElementQuad2),
    "tri2": (fem.MeshTri, fem.ElementTriP2),
    "tet1": (fem.MeshTet, fem.ElementTetP1),
    "tet2": (fem.MeshTet, fem.ElementTetP2),
    "hex2": (fem.MeshHex, fem.ElementHex2),
}
MEASURES = {
    "plane": (None, lambda X, x: 1.0),
    "rings": (lambda x: 2 * np.pi * x[0], lambda X, x: 2 * np.pi * x[0]),
    "thick": (lambda x: 1 + x[0], lambda X, x: 1 + X[0]),
}
RUBBER = sc.materials.MooneyRivlin(0.5, 0.0, bulk=20.0)
STEEL = sc.Elastic(1e4, 0.0)
# areas are those of the pairing, so that it has to be that of the answer
SETTLED = sc.Options(max_travel=np.inf, placement_tolerance=1e-8)


def block(element: str, material: Any, *sides: ArrayLike, name: str = "block", **given: Any) -> Any:
    """A block of these nodes along each axis, whose last one goes up, held at the other end."""
    mesh_of, element_of = ELEMENTS[element]
    grid = [np.asarray(side, dtype=float) for side in sides]
    mesh = mesh_of.init_tensor(*grid)
    mesh = mesh.with_boundaries({
        "below": lambda x: x[-1] < grid[-1][0] + 1e-9,
        "above": lambda x: x[-1] > grid[-1][-1] - 1e-9,
    })  # fmt: skip
    held = "above" if name == "lid" else "below"
    D: Any = held
    if given.get("measure") is MEASURES["rings"][0]:

        def D(b: Any) -> np.ndarray:
            axis = np.flatnonzero(
                (b.doflocs[0] < 1e-9) & np.isin(np.arange(b.N), b.get_dofs().all("u^1"))
            )
            return np.union1d(b.get_dofs(held).all(), axis)

    kind = sc.Body if isinstance(material, sc.Elastic) else sc.NonlinearBody
    return kind.from_mesh(mesh, fem.ElementVector(element_of()), material, D=D, name=name, **given)


def pressed(
    body: Any, lid: Any, ways: Sequence[ArrayLike], method: str = "mortar", **given: Any
) -> tuple[Any, Any]:
    """The contact after the block has been moved so, one way after the other, and its displacement."""
    rigid = isinstance(lid, sc.RigidPlane)
    other = lid if rigid else lid.surface("below")
    contact = sc.Contact(body.surface("above"), other, method=method, name="top", **given)
    solver = sc.ContactSolver([body] if rigid else [body, lid], contact, options=SETTLED)
    *_, last = solver.history([{"x": {body: {"below": tuple(way)}}} for way in ways])
    return last["top"], last.displacement(body)


def area_by_nanson(body: Any, u: np.ndarray, measure: Callable[..., Any]) -> float:
    """Deformed area of the upper side by ``da = J |F^-T N| dA``; the measure by places X and x."""
    on = fem.FacetBasis(body.basis.mesh, body.basis.elem, facets=body.basis.mesh.boundaries["above"],
                        intorder=9)  # fmt: skip
    field, X = on.interpolate(u), np.asarray(on.global_coordinates())
    F = np.moveaxis(np.eye(body.dim)[:, :, None, None] + np.asarray(field.grad), (0, 1), (2, 3))
    normal = np.linalg.solve(
        np.swapaxes(F, 2, 3), np.moveaxis(np.asarray(on.normals), 0, -1)[..., None]
    )
    grown = np.linalg.det(F) * np.linalg.norm(normal[..., 0], axis=-1)
    return float(np.sum(grown * measure(X, X + np.asarray(field)) * on.dx))


@pytest.mark.parametrize("partner, method", [("plane", "node"), ("lid", "node"), ("lid", "mortar")])
@pytest.mark.parametrize(
    "element, measure",
    [
        ("quad1", "rings"),
        ("quad2", "plane"),
        ("quad2", "rings"),
        ("quad2", "thick"),
        ("tri2", "plane"),
        ("tet2", "plane"),
        ("hex2", "plane"),
    ],
)
def test_areas_are_those_of_the_deformed_surface(
    element: str, measure: str, partner: str, method: str
) -> None:
    """Bonded below the face bulges, is curved, and may end on the axis; by all methods it is one."""
    weight, expected = MEASURES[measure]
    d = 3 if element[:3] in ("tet", "hex") else 2
    rubber = block(element, RUBBER, *[np.linspace(0, 2, 3)] * d, measure=weight)
    up = np.eye(d)[-1]
    lid: Any = sc.RigidPlane(2 * up, -up, name="lid")
    if partner == "lid":
        wide = np.linspace(-2, 4, 6)
        flat = "quad1" if d == 2 else "tet1"
        if measure == "rings":
            wide = np.linspace(0, 4, 5)
        rings = weight if measure == "rings" else None
        lid = block(flat, STEEL, *[wide] * (d - 1), [2, 3], name="lid", measure=rings)
    values, u = pressed(rubber, lid, [0.3 * up, 0.6 * up], method, sliding="finite")
    assert np.all(values.status != 0)
    area = area_by_nanson(rubber, u, expected)
    assert area > 1.1 * rubber.surface("above").area.sum()
    # the node on the axis shows none, and has as much as second-order facets are curved there
    idle = measure == "rings" and element == "quad2"
    np.testing.assert_allclose(values.area.sum(), area, rtol=1e-4 if idle else 1e-6)
    np.testing.assert_allclose(values.contact_area, area, rtol=1e-6)
    np.testing.assert_allclose(values.pressure @ values.area, values.normal_force.sum(), rtol=1e-12)


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_contact_on_the_axis_has_the_area_up_to_its_edge(method: str) -> None:
    """The node on the axis has no area: contact of a flat end up to a radius is a disc all the same."""
    rubber = block("quad2", RUBBER, np.linspace(0, 2, 5), [0, 1, 2], measure=MEASURES["rings"][0])
    top = rubber.surface("above")
    ball = sc.RigidCylinder((0.0, 12.0), 10.0, name="ball")
    contact = sc.Contact(top, ball, method=method, sliding="finite", name="top")
    last = sc.ContactSolver([rubber], contact).solve(x={rubber: {"below": (0.0, 0.05)}})
    values, moved = last["top"], top.moved(last.displacement(rubber))
    radius = moved.points[:, 0]
    closed, opened = radius[values.status != 0].max(), radius[values.status == 0].min()
    assert np.pi * closed**2 * 0.8 < values.contact_area < np.pi * opened**2 * 1.01


@pytest.mark.parametrize("material", [RUBBER, sc.Elastic(1.0, 0.3)], ids=["rubber", "linear"])
@pytest.mark.parametrize("partner, method", [("plane", "node"), ("lid", "node"), ("lid", "mortar")])
def test_a_thickness_goes_with_the_body(partner: str, method: str, material: Any) -> None:
    """A wedge is thicker to the right: slid there by its own length, it has the friction it had."""
    weight, expected = MEASURES["thick"]
    body = block("quad2", material, np.linspace(0, 2, 5), [0, 1, 2], measure=weight)
    lid: Any = sc.RigidPlane((0, 2), (0, -1), name="lid")
    if partner == "lid":
        lid = block("quad1", STEEL, np.linspace(-3, 7, 11), [2, 3], name="lid")
    down = 0.4 if material is RUBBER else 0.02
    ways = [(0.0, 0.5 * down), (0.0, down), (2.0, down)]
    values, u = pressed(body, lid, ways, method, sliding="finite", friction=sc.Tresca(TAU))
    assert np.all(values.status == 2)
    area = area_by_nanson(body, u, expected)
    friction = np.abs(values.tangential_force).sum() / TAU
    for found in (values.area.sum(), values.contact_area, friction):
        # areas of bodies of small strains are those before them, node by node
        np.testing.assert_allclose(found, area, rtol=1e-6 if material is RUBBER else 0.01)


@pytest.mark.parametrize("element", ["quad1", "quad2", "tet1", "tet2", "hex2"])
@pytest.mark.parametrize("end", [2.5, 2.6, 2.9])
def test_what_the_primary_does_not_cover_is_not_in_contact(element: str, end: float) -> None:
    """A lid ends within facets, which mortar multipliers see in part: the area is that of the lid."""
    d = 2 if element.startswith("quad") else 3
    body = block(element, sc.Elastic(1.0, 0.3), *[np.linspace(0, 4, 5)] * (d - 1), [0, 1])
    flat = "quad1" if d == 2 else "tet1"
    lid = block(flat, STEEL, *[np.linspace(0, end, 4)] * (d - 1), [1, 2], name="lid")
    values, _ = pressed(body, lid, [np.eye(d)[-1] * 0.01])
    assert np.any(~np.isfinite(values.gap))
    np.testing.assert_allclose(values.contact_area, end ** (d - 1), rtol=1e-9)
    np.testing.assert_allclose(values.area[values.status != 0].sum(), end ** (d - 1), rtol=1e-9)


@pytest.mark.parametrize("partner", ["plane", "lid"])
def test_friction_by_undeformed_areas_is_named(partner: str) -> None:
    """Areas are the undeformed ones with small sliding; where friction is by them, a word is said."""
    lid: Any = sc.RigidPlane((0, 2), (0, -1), name="lid")
    if partner == "lid":
        lid = block("quad1", STEEL, np.linspace(-2, 4, 7), [2, 3], name="lid")
    grid = np.linspace(0, 2, 4)
    rubber, tresca = block("quad2", RUBBER, grid, grid), sc.Tresca(TAU)
    ways = [(0.0, 0.1), (0.0, 0.3), (0.0, 0.4)]
    values, u = pressed(rubber, lid, ways[:1], friction=tresca)  # by 6 %: without a word
    pressed(rubber, lid, ways, friction=sc.Coulomb(0.01))  # forces are those on any area
    with pytest.warns(sc.ContactWarning, match=r"'top' have changed their area.* by \+1\d %") as said:
        values, u = pressed(rubber, lid, ways, friction=tresca)
    assert len(said) == 1  # once in a history
    assert area_by_nanson(rubber, u, MEASURES["plane"][1]) > 2.3
    np.testing.assert_allclose([values.contact_area, values.area.sum()], 2.0)
    slips = values.status == 2
    assert slips.any()
    friction = np.abs(values.tangential_force)[slips, 0]
    np.testing.assert_allclose(friction, TAU * values.area[slips])
