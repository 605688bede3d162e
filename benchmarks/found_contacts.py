"""Pairs that `sc.find_contacts` finds on assemblies, beside lists that were written by hand.

    python benchmarks/found_contacts.py [--only NAME ...] [--write]

Every assembly is drawn and meshed by Gmsh, body by body, so that no two meshes match, and read by
`sc.read_bodies`. The lists say which two bodies touch, and by how many smooth patches. The last two
rows are large, of scikit-fem's meshes. "missed" and "too many" are counted over patches; times are CPU
seconds of one thread for `find_contacts` alone.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import skfem as fem
from run import write_into
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc

RESULTS = Path(__file__).parent / "results"
PAGE = Path(__file__).parents[1] / "docs" / "checks" / "performance.md"
MARKS = "<!-- found contacts table: begin -->", "<!-- found contacts table: end -->"
Lists = dict[tuple[str, str], int]
STEEL = linear_elasticity(1.0, 1.0)


@dataclass(frozen=True)
class Assembly:
    """What is drawn, how large its elements are, how near is near, and what touches."""

    draw: Callable[[Any], dict[str, int]]
    size: float
    within: float
    touch: Lists
    order: int = 1


def tube(occ: Any, x: tuple, length: float, outer: float, inner: float = 0.0, axis: int = 2) -> int:
    """A cylinder from a place along an axis, with a bore."""
    way = [length * (k == axis) for k in range(3)]
    solid = occ.addCylinder(*x, *way, outer)
    if inner:
        return without(occ, solid, occ.addCylinder(*x, *way, inner))
    return solid


def without(occ: Any, solid: int, *holes: int) -> int:
    """A solid without some others."""
    return occ.cut([(3, solid)], [(3, hole) for hole in holes])[0][0][1]


def fused(occ: Any, *solids: int) -> int:
    """One solid made of some."""
    return occ.fuse([(3, solids[0])], [(3, s) for s in solids[1:]])[0][0][1]


def prism(occ: Any, outline: list[tuple[float, float]], height: float, z: float = 0.0) -> int:
    """An outline in the plane, pulled along z."""
    points = [occ.addPoint(x, y, z) for x, y in outline]
    lines = [occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    return next(tag for dim, tag in occ.extrude([(2, face)], 0, 0, height) if dim == 3)


def hexagon(radius: float) -> list[tuple[float, float]]:
    """The corners of a hexagon round the origin."""
    return [(radius * np.cos(a), radius * np.sin(a)) for a in np.arange(6) * np.pi / 3]


def blocks(occ: Any) -> dict[str, int]:
    """Two blocks, one on the other, askew."""
    upper = occ.addBox(2, 3, 5, 6, 6, 4)
    occ.rotate([(3, upper)], 5, 6, 0, 0, 0, 1, 0.3)
    return {"lower": occ.addBox(0, 0, 0, 10, 12, 5), "upper": upper}


def table(occ: Any) -> dict[str, int]:
    """A plate on four legs."""
    legs = {
        f"leg {i}{j}": tube(occ, (2 + 16 * i, 2 + 16 * j, 0), 10, 1.5) for i in (0, 1) for j in (0, 1)
    }
    return {"plate": occ.addBox(0, 0, 10, 20, 20, 1.5), **legs}


def bored(radius: float) -> Callable[[Any], dict[str, int]]:
    """A shaft of radius 5 through a block with a bore; both are longer than the other somewhere."""

    def draw(occ: Any) -> dict[str, int]:
        block = without(occ, occ.addBox(-10, -10, 0, 20, 20, 12), tube(occ, (0, 0, -1), 14, radius))
        return {"block": block, "shaft": tube(occ, (0, 0, -4), 20, 5.0)}

    return draw


def socket(occ: Any) -> dict[str, int]:
    """A ball in half a socket."""
    cup = without(occ, occ.addBox(-8, -8, -8, 16, 16, 8), occ.addSphere(0, 0, 0, 5))
    return {"cup": cup, "ball": occ.addSphere(0, 0, 0, 5)}


def ball(occ: Any) -> dict[str, int]:
    """A ball just above a plate."""
    return {"plate": occ.addBox(-8, -8, -2, 16, 16, 2), "ball": occ.addSphere(0, 0, 6.005, 6)}


def washers(occ: Any) -> dict[str, int]:
    """A bolt with three washers under its head, whose bores leave room."""
    rings = {f"washer {i}": tube(occ, (0, 0, -1.0 * (i + 1)), 1.0, 6, 3.5) for i in range(3)}
    return {"bolt": fused(occ, tube(occ, (0, 0, -12), 12, 3), prism(occ, hexagon(5.5), 4)), **rings}


def lap(occ: Any) -> dict[str, int]:
    """A bolted lap joint: two plates, two washers, a bolt and its nut; the thread is a cylinder."""
    plates = {
        name: without(occ, occ.addBox(x, -10, z, 30, 20, 4), tube(occ, (0, 0, z - 1), 6, 4.5))
        for name, x, z in (("upper", -22, 0), ("lower", -8, -4))
    }
    bolt = fused(occ, tube(occ, (0, 0, -14), 19.5, 4), prism(occ, hexagon(7), 5, 5.5))
    nut = without(occ, prism(occ, hexagon(7), 6, -11.5), tube(occ, (0, 0, -12), 8, 4))
    rings = {
        "top washer": tube(occ, (0, 0, 4), 1.5, 8, 4.3),
        "low washer": tube(occ, (0, 0, -5.5), 1.5, 8, 4.3),
    }
    return {**plates, "bolt": bolt, "nut": nut, **rings}


def dovetail(occ: Any) -> dict[str, int]:
    """A blade root in a disc: two flanks of 60 degrees and the bottom."""
    root = [(-4, 0), (4, 0), (2, 2 * np.sqrt(3)), (-2, 2 * np.sqrt(3))]
    slot = prism(occ, root, 22, -1)
    blade = fused(occ, prism(occ, root, 20), occ.addBox(-2, 3, 0, 4, 10, 20))
    disc = without(occ, occ.addBox(-10, -5, 0, 20, 5 + 2 * np.sqrt(3), 20), slot)
    return {"disc": disc, "blade": blade}


def wedge(occ: Any) -> dict[str, int]:
    """A wedge of 10 degrees between two blocks."""
    rise = 20 * np.tan(np.radians(10))
    return {
        "base": occ.addBox(-2, -4, 0, 24, 4, 10),
        "wedge": prism(occ, [(0, 0), (20, 0), (20, 2 + rise), (0, 2)], 10),
        "block": prism(occ, [(2, 2 + rise / 10), (18, 2 + 0.9 * rise), (18, 12), (2, 12)], 10),
    }


def sleeves(occ: Any) -> dict[str, int]:
    """Three tubes pressed into each other, too large by 0.02."""
    return {
        "inner": tube(occ, (0, 0, 0), 15, 6.02, 4),
        "middle": tube(occ, (0, 0, 0), 15, 9.02, 6),
        "outer": tube(occ, (0, 0, 0), 15, 14, 9),
    }


def clevis(occ: Any) -> dict[str, int]:
    """A pin through two cheeks and a lug."""
    parts = {}
    for name, z, t in (("left", 0, 4), ("lug", 4, 8), ("right", 12, 4)):
        plate = occ.addBox(-9, -9, z, 18, 30, t)
        parts[name] = without(occ, plate, tube(occ, (0, 0, z - 1), t + 2, 5))
    return {**parts, "pin": tube(occ, (0, 0, -2), 20, 5)}


def key(occ: Any) -> dict[str, int]:
    """A shaft, a hub, and a key, which has room above."""
    shaft = without(occ, tube(occ, (0, 0, 0), 20, 10), occ.addBox(-2, 7, -1, 4, 5, 22))
    hub = without(occ, tube(occ, (0, 0, 0), 20, 18, 10), occ.addBox(-2, 5, -1, 4, 7.5, 22))
    return {"shaft": shaft, "hub": hub, "key": occ.addBox(-2, 7, 0, 4, 5, 20)}


def taper(occ: Any) -> dict[str, int]:
    """A cone in its seat."""
    block = without(occ, occ.addBox(-12, -12, 0, 24, 24, 15), occ.addCone(0, 0, 0, 0, 0, 15, 4, 7))
    return {"block": block, "cone": occ.addCone(0, 0, 3, 0, 0, 15, 4.6, 7.6)}


def nut(occ: Any) -> dict[str, int]:
    """A hexagon in a hexagonal socket, which is 0.02 wider."""
    ring = without(occ, tube(occ, (0, 0, 0), 8, 12), prism(occ, hexagon(7 + 0.04 / np.sqrt(3)), 10, -1))
    return {"socket": ring, "hexagon": prism(occ, hexagon(7), 10)}


def balls(occ: Any) -> dict[str, int]:
    """Four balls, each touching the three others."""
    corners = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    return {
        f"ball {i}": occ.addSphere(*(5 / np.sqrt(2) * np.array(x)), 5) for i, x in enumerate(corners)
    }


def bearing(occ: Any) -> dict[str, int]:
    """Eight rollers between two rings."""
    turn = np.arange(8) * np.pi / 4
    rollers = {
        f"roller {i}": tube(occ, (14 * np.cos(a), 14 * np.sin(a), 1), 6, 4) for i, a in enumerate(turn)
    }
    return {
        "inner": tube(occ, (0, 0, 0), 8, 10, 6),
        "outer": tube(occ, (0, 0, 0), 8, 22, 18),
        **rollers,
    }


def stepped(occ: Any) -> dict[str, int]:
    """A stepped shaft in a stepped hub."""
    shaft = fused(occ, tube(occ, (0, 0, 0), 10, 4), tube(occ, (0, 0, 10), 12, 7))
    hole = fused(occ, tube(occ, (0, 0, -1), 11, 4), tube(occ, (0, 0, 10), 11, 7))
    return {"hub": without(occ, tube(occ, (0, 0, 0), 18, 13), hole), "shaft": shaft}


def leaves(occ: Any) -> dict[str, int]:
    """Three leaves of a spring, each a sector of a tube."""
    parts = {}
    for i in range(3):
        ring = tube(occ, (0, 0, 0), 8, 42 - 2 * i, 40 - 2 * i)
        sector = prism(occ, [(0, 0), (-30 + 5 * i, 60), (30 - 5 * i, 60)], 10, -1)
        parts[f"leaf {i}"] = occ.intersect([(3, ring)], [(3, sector)])[0][0][1]
    return parts


def gasket(occ: Any) -> dict[str, int]:
    """Two flanges with a gasket thinner than the distance that counts as near."""
    return {
        "lower": tube(occ, (0, 0, -6), 6, 20, 8),
        "gasket": tube(occ, (0, 0, 0), 0.5, 16, 10),
        "upper": tube(occ, (0, 0, 0.5), 6, 20, 8),
    }


def rail(occ: Any) -> dict[str, int]:
    """A carriage on a T-shaped rail: on top, beside and under the head, along the web."""
    rail_ = fused(occ, occ.addBox(-3, 0, 0, 6, 6, 30), occ.addBox(-6, 6, 0, 12, 4, 30))
    hole = fused(occ, occ.addBox(-3, 1, -1, 6, 6, 32), occ.addBox(-6, 6, -1, 12, 4, 32))
    carriage = without(occ, occ.addBox(-10, 2, 5, 20, 12, 15), hole)
    return {"rail": rail_, "carriage": carriage}


ASSEMBLIES = {
    "blocks": Assembly(blocks, 1.5, 0.01, {("lower", "upper"): 1}),
    "table": Assembly(table, 2.0, 0.01, {("plate", f"leg {i}{j}"): 1 for i in (0, 1) for j in (0, 1)}),
    "shaft, no gap": Assembly(bored(5.0), 2.5, 0.01, {("block", "shaft"): 1}),
    "shaft, gap .05": Assembly(bored(5.05), 2.5, 0.1, {("block", "shaft"): 1}),
    "shaft, gap .2": Assembly(bored(5.2), 2.5, 0.1, {}),
    "socket": Assembly(socket, 1.5, 0.02, {("cup", "ball"): 1}),
    "ball on plate": Assembly(ball, 1.2, 0.02, {("plate", "ball"): 1}),
    "washers": Assembly(
        washers, 1.5, 0.05,
        {("bolt", "washer 0"): 1, ("washer 0", "washer 1"): 1, ("washer 1", "washer 2"): 1},
    ),
    "lap joint": Assembly(
        lap, 2.0, 0.1,
        {
            ("upper", "lower"): 1, ("upper", "top washer"): 1, ("lower", "low washer"): 1,
            ("bolt", "top washer"): 1, ("nut", "low washer"): 1, ("bolt", "nut"): 1,
        },
    ),
    "dovetail": Assembly(dovetail, 1.5, 0.02, {("disc", "blade"): 3}),
    "wedge": Assembly(wedge, 1.5, 0.02, {("base", "wedge"): 1, ("wedge", "block"): 1}),
    "sleeves": Assembly(sleeves, 2.0, 0.05, {("inner", "middle"): 1, ("middle", "outer"): 1}),
    "clevis": Assembly(
        clevis, 2.5, 0.02,
        {
            ("left", "lug"): 1, ("lug", "right"): 1, ("left", "pin"): 1, ("lug", "pin"): 1,
            ("right", "pin"): 1,
        },
    ),
    "key": Assembly(key, 2.0, 0.02, {("shaft", "hub"): 1, ("shaft", "key"): 3, ("hub", "key"): 2}),
    "taper": Assembly(taper, 2.0, 0.02, {("block", "cone"): 1}),
    "hexagon": Assembly(nut, 1.5, 0.03, {("socket", "hexagon"): 6}),
    "balls": Assembly(
        balls, 1.2, 0.02, {(f"ball {i}", f"ball {j}"): 1 for j in range(4) for i in range(j)}
    ),
    "bearing": Assembly(
        bearing, 1.5, 0.02, {(ring, f"roller {i}"): 1 for ring in ("inner", "outer") for i in range(8)}
    ),
    "stepped shaft": Assembly(stepped, 2.0, 0.02, {("hub", "shaft"): 3}),
    "stepped shaft, 2nd order": Assembly(stepped, 4.0, 0.02, {("hub", "shaft"): 3}, order=2),
    "leaf spring": Assembly(leaves, 2.0, 0.02, {("leaf 0", "leaf 1"): 1, ("leaf 1", "leaf 2"): 1}),
    "gasket": Assembly(gasket, 2.0, 2.0, {("lower", "gasket"): 1, ("gasket", "upper"): 1}),
    "rail": Assembly(rail, 2.0, 0.02, {("rail", "carriage"): 7}),
}  # fmt: skip


def bodies_of(assembly: Assembly) -> Any:
    """The bodies of an assembly, drawn and meshed one by one by Gmsh, from one file."""
    import gmsh  # of the extras `dev` and `step`

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        parts = assembly.draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        for name, tag in parts.items():
            gmsh.model.addPhysicalGroup(3, [tag], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", assembly.size)
        gmsh.option.setNumber("Mesh.ElementOrder", assembly.order)
        gmsh.model.mesh.generate(3)
        with tempfile.TemporaryDirectory() as folder:
            gmsh.write(f"{folder}/assembly.msh")
            return sc.read_bodies(f"{folder}/assembly.msh", STEEL)
    finally:
        gmsh.finalize()


def cube(x: Any, n: int, name: str) -> sc.Body:
    """A cube of side one."""
    mesh = fem.MeshHex.init_tensor(*(np.linspace(c, c + 1, n + 1) for c in x))
    return sc.Body.from_mesh(mesh, fem.ElementVector(fem.ElementHex1()), STEEL, name=name)


def sphere(x: Any, n: int, name: str) -> sc.Body:
    """A ball of diameter one: the outer cells of a cube, moved onto shells."""
    grid = np.linspace(-1, 1, n + 1)
    mesh = fem.MeshHex.init_tensor(grid, grid, grid)
    mesh = mesh.restrict(lambda y: np.abs(y).max(axis=0) > 1 - 3.0 / n)
    p = mesh.p
    # equal angles, so that facets are alike
    p = np.tan(np.pi / 4 * p) * np.abs(p).max(axis=0) / np.abs(np.tan(np.pi / 4 * p)).max(axis=0)
    p = 0.5 * p * np.abs(p).max(axis=0) / np.sqrt((p**2).sum(axis=0)) + np.asarray(x)[:, None]
    return sc.Body.from_mesh(
        fem.MeshHex(p, mesh.t), fem.ElementVector(fem.ElementHex1()), STEEL, name=name
    )


def large(shape: Callable[..., sc.Body], n: int) -> tuple[list[sc.Body], Lists]:
    """Fifty bodies in a grid of 5, 5 and 2, and what touches."""
    places = [(i, j, k) for i in range(5) for j in range(5) for k in range(2)]
    bodies = [shape(np.array(x), n + sum(x) % 2, str(x)) for x in places]
    touch = {
        (str(a), str(b)): 1 for j, b in enumerate(places) for a in places[:j]
        if sum(abs(p - q) for p, q in zip(a, b, strict=True)) == 1
    }  # fmt: skip
    return bodies, touch


def judged(name: str, bodies: Any, within: float, touch: Lists) -> dict[str, Any]:
    """One row: what was found beside the list."""
    begin = time.process_time()
    pairs = sc.find_contacts(bodies, within=within)
    seconds = time.process_time() - begin

    def count(found: Any) -> Counter[tuple[str, ...]]:
        sides = [(p.contact.secondary.body.name, p.contact.primary.body.name) for p in found]
        return Counter(tuple(sorted(both)) for both in sides)

    wanted = Counter({tuple(sorted(both)): many for both, many in touch.items()})
    found = count(pairs.found)
    return {
        "name": name,
        "bodies": len(bodies),
        "facets": sum(len(body.basis.mesh.boundary_facets()) for body in bodies),
        "pairs": sum(wanted.values()),
        "missed": sum((wanted - found).values()),
        "too many": sum((found - wanted).values()),
        "slivers": sum(p.remark == "sliver" for p in pairs.found),
        "seconds": round(seconds, 3),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as a table of a page."""
    heads = ("name", "bodies", "facets", "pairs", "missed", "too many", "seconds")
    lines = ["| assembly | " + " | ".join(heads[1:]) + " |", "|" + "---|" * len(heads)]
    lines += ["| " + " | ".join(f"{row[head]}" for head in heads) + " |" for row in rows]
    return "\n".join(lines)


def main() -> None:
    """The rows, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--write", action="store_true", help="store results/found_contacts.json")
    chosen = parser.parse_args()
    rows = []
    for name, assembly in ASSEMBLIES.items():
        if not chosen.only or name in chosen.only:
            rows.append(judged(name, bodies_of(assembly), assembly.within, assembly.touch))
            print(rows[-1], flush=True)
    for name, shape, n in (("50 cubes", cube, 25), ("50 balls", sphere, 25)):
        if not chosen.only or name in chosen.only:
            bodies, touch = large(shape, n)
            rows.append(judged(name, bodies, 0.001, touch))
            print(rows[-1], flush=True)
    print({key: sum(row[key] for row in rows) for key in ("pairs", "missed", "too many")})
    if chosen.write:
        RESULTS.joinpath("found_contacts.json").write_text(json.dumps(rows, indent=1) + "\n")
        write_into(PAGE, table(rows), MARKS)


if __name__ == "__main__":
    main()
