"""The error estimate of solids against the true error, over closed forms in space.

    python benchmarks/effectivity_solids.py [--write]

True error: L2 norm, over the faces of contact, of the traction interpolated between the nodes less
the exact one, over the norm of the exact one. Effectivity: estimated over true error.

Stores benchmarks/results/effectivity_solids.json; with --write the table goes into
docs/checks/effectivity.md.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy starts its threads

import numpy as np

HERE = Path(__file__).parent
sys.path += [str(HERE.parent / "tests"), str(HERE.parent / "tests" / "verification")]

import test_curved_linear_faces as curved  # noqa: E402
import test_curved_solids as balls  # noqa: E402
import test_gates_solids as gates  # noqa: E402
from effectivity_table import SOLIDS, write  # noqa: E402
from sheared_solids import sheared_pair  # noqa: E402
from solid_meshes import at, cube, elastic, octant_shell, onto_octant  # noqa: E402

import skfem_contact as sc  # noqa: E402
from skfem_contact.reference import cattaneo_mindlin, hertz_point, lame_rings  # noqa: E402

Array = np.ndarray
Exact = Callable[[Array], Array]
STORED = HERE / "results" / "effectivity_solids.json"


def true_errors(result: Any, pressure: Exact, friction: Exact) -> tuple[float, float]:
    """Relative L2 errors of the pressure, and of the traction; `friction` (k, 3) up to its sign."""
    values = result.values[0]
    surface, kind = values.surface, values.surface.kind
    at, weight = kind.quadrature(12)
    N, dN = kind.shapes(at)
    nodes = surface.points[surface.facets]
    along = np.einsum("qai,fad->fqid", dN, nodes)
    area = np.linalg.norm(np.cross(along[:, :, 0], along[:, :, 1]), axis=2) * weight
    # faces with a node whose force goes into a support have no traction to compare
    area = area * ~surface.held.all(axis=1)[surface.facets].any(axis=1)[:, None]
    x = np.einsum("qa,fad->fqd", N, nodes)

    def between(nodal: Array) -> Array:
        return np.einsum("qa,fa...->fq...", N, nodal[surface.facets])

    over = np.where(values.area > 0, values.area, 1.0)[:, None]
    p, q = between(values.pressure), between(values.tangential_force_vector / over)
    exact_p = pressure(x.reshape(-1, 3)).reshape(p.shape)
    exact_q = friction(x.reshape(-1, 3)).reshape(q.shape)
    exact_q = exact_q * (np.sign(np.sum(area[..., None] * q * exact_q)) or 1.0)
    lost, size = np.sum(area * (p - exact_p) ** 2), np.sum(area * exact_p**2)
    more = np.sum(area[..., None] * (q - exact_q) ** 2), np.sum(area[..., None] * exact_q**2)
    return float(np.sqrt(lost / size)), float(np.sqrt((lost + more[0]) / (size + more[1])))


def radius(x: Array) -> Array:
    return np.hypot(x[:, 0], x[:, 1])


def along_x(size: Exact) -> Exact:
    return lambda x: size(x)[:, None] * np.array([1.0, 0.0, 0.0])


def none(x: Array) -> Array:
    return np.zeros_like(x)


Case = tuple[Any, Exact, Exact]


def hertz(case: str, across: int, ratio: float, cells: str = "quad4") -> Case:
    E, R, a = (1000.0, 8.0, 1.0096) if case == "H2" else (2e4, 25.0, 2.5)
    F, result = gates.hertz_in_half_spaces(cells, across, ratio, R, E, a, case == "H3")
    exact = hertz_point(F, R, E / 0.91 / (1 if case == "H2" else 2))
    return result, lambda x: exact.pressure(radius(x)), none


def capped(across: int, share: float) -> Case:
    mu = 0.3
    cap = share * mu * hertz_point(2.9e-2, 50.0, 1 / 0.91).p0
    solver = gates.block_under_ball(across, sc.Coulomb(mu, tau_max=cap))
    steps = [{"motion": {"joint": (way, 0, -gates.DOWN)}} for way in (0.0, 0.02)]
    *_, result = solver.history(steps)
    exact = hertz_point(-result.force[2], 50.0, 1 / 0.91)
    friction = along_x(lambda x: np.minimum(mu * exact.pressure(radius(x)), cap))
    return result, lambda x: exact.pressure(radius(x)), friction


def spun(across: int) -> Case:
    mu = 0.3
    solver = gates.block_under_ball(across, sc.Coulomb(mu))
    turns = [((0, 0, -gates.DOWN), (0, 0, angle), (0, 0, 50.0)) for angle in (0.0, 0.02, 0.04)]
    *_, result = solver.history([{"motion": {"joint": turn}} for turn in turns])
    exact = hertz_point(-result.force[2], 50.0, 1 / 0.91)

    def friction(x: Array) -> Array:
        r = radius(x)
        way = np.column_stack([-x[:, 1], x[:, 0], 0 * r]) / np.maximum(r, 1e-12)[:, None]
        return mu * exact.pressure(r)[:, None] * way

    return result, lambda x: exact.pressure(radius(x)), friction


def mindlin(across: int, push: float) -> Case:
    mu, R = 0.4, 100.0
    (high, _), solver = gates.half_blocks(across, mu, R)
    top = np.flatnonzero(np.isclose(high.dof_points[:, 2], 6.0))
    steps = []
    for part in np.linspace(0, 1, 5):
        x = np.zeros(high.n)
        x[top[high.dof_component[top] == 0]] = part * push
        x[top[high.dof_component[top] == 2]] = -0.0095
        steps.append({"x": {"high": x}})
    *_, result = solver.history(steps)
    P = 2 * result.force[2]
    exact = hertz_point(P, R, 1 / (2 * 0.91))
    law = cattaneo_mindlin(exact, mu, 2 * abs(result.force[0]))
    return result, lambda x: exact.pressure(radius(x)), along_x(lambda x: law.traction(radius(x)))


def patch(kind: str, n: tuple[int, int]) -> Case:
    solver, load = sheared_pair(kind, n, "node", sc.Coulomb(0.5))
    soft = 1 / 0.7 + 1
    p, tau = 1e-3 / soft, 1e-4 / soft
    result = solver.solve(**load((2e-4, 0), 1e-3, np.array([tau, 0.0])))
    return result, lambda x: p + 0 * x[:, 0], along_x(lambda x: tau + 0 * x[:, 0])


def ring(kind: str | None, n: tuple[int, int], swap: bool, method: str = "mortar") -> Case:
    """A shaft in a hub, quarters of rings, with an interference of 1e-3 of the radius."""
    shaft = curved.ring(3, 10.0, 20.02, n[0], curved.STEEL, "shaft", kind)
    hub = curved.ring(3, 20.0, 35.0, n[1], curved.ALUMINIUM, "hub", kind)
    sides = curved.on_radius(shaft, 20.02), curved.on_radius(hub, 20.0)
    contact = sc.Contact(*(sides[::-1] if swap else sides), method=method)
    result = sc.ContactSolver([shaft, hub], contact).solve()
    p = lame_rings(10, 20, 35, curved.STEEL, curved.ALUMINIUM, interference=0.02).pressure
    return result, lambda x: p + 0 * x[:, 0], none


def hollow(kind: str, n: int, layers: int, method: str, E: float = 1.0) -> Case:
    """Octants of two hollow balls with an interference, meshes that match."""
    nu, interference, held = 0.3, 1e-3, balls.THREE
    core = elastic(octant_shell(kind, n, layers, 0.5, 1.0), kind, "core", nu=nu, held=held)
    hull = elastic(octant_shell(kind, n, layers, 1.0, 2.0), kind, "hull", E=E, nu=nu, held=held)
    both = balls.compliance(1.0, 2.0, E, nu, True) + balls.compliance(0.5, 1.0, 1.0, nu, False)
    sides = [
        b.surface(lambda x: np.abs(np.linalg.norm(x, axis=0) - 1) < 0.02, nodes=True)
        for b in (hull, core)
    ]
    contact = sc.Contact(*sides, method=method, interference=interference)
    result = sc.ContactSolver([core, hull], contact).solve()
    return result, lambda x: interference / both + 0 * x[:, 0], none


def ball(kind: str, n: int, down: float, R: float = 8.0, E: float = 1000.0) -> Case:
    """Half a ball pressed on a plane by its equator; Hertz by the force that is found."""
    mesh, equator = cube(kind, n, lambda x: R * onto_octant(x)), at(2, 0.0)
    rollers = (at(0, 0.0), (0,)), (at(1, 0.0), (1,))
    body = elastic(
        mesh, kind, "ball", E=E, held=((equator, (2,)), *rollers), push=(equator, (0, 0, down))
    )
    facets = mesh.boundary_facets()
    far = np.linalg.norm(mesh.p[:, mesh.facets[:, facets]], axis=0) > (1 - 1e-9) * R
    plane = sc.RigidPlane((0, 0, R), (0, 0, -1), name="plane")
    contact = sc.Contact(body.surface(facets[far.all(axis=0)]), plane)
    with warnings.catch_warnings():  # a few nodes to the contact
        warnings.simplefilter("ignore", sc.ContactWarning)
        result = sc.ContactSolver(body, contact).solve()
    exact = hertz_point(4 * abs(result.force[2]), R, E / 0.91)
    return result, lambda x: exact.pressure(radius(x)), none


NAMES = {"quad4": "8-node", "quad8": "20-node", "quad9": "27-node", "tri3": "4-node", "tri6": "10-node"}


WAYS = {"node": "node by node", "mortar": "mortar"}
WHAT = {"H2": "rigid sphere", "H3": "two spheres"}


def curves() -> Iterator[tuple[str, Callable[[], Case]]]:
    """Balls, rings, and faces of second order."""
    for n in ((12, 16), (24, 32)):
        yield f"Press fit of rings, 8-node, {n[0]} on {n[1]}", lambda n=n: ring(None, n, False)
    yield "Press fit of rings, 8-node, 16 on 12", lambda: ring(None, (12, 16), True)
    yield (
        "Press fit of rings, 8-node, node by node, 12 on 16",
        lambda: ring(None, (12, 16), False, "node"),
    )
    for kind in ("hex20", "hex27"):
        words = f"Press fit of rings, {kind[3:]}-node"
        yield f"{words}, 5 on 7", lambda k=kind: ring(k, (5, 7), False)
        yield f"{words}, 7 on 5", lambda k=kind: ring(k, (5, 7), True)
        yield f"{words}, 10 on 14", lambda k=kind: ring(k, (10, 14), False)
    for kind, n, layers in (
        ("tri3", 4, 3),
        ("quad4", 8, 6),
        ("tri6", 2, 2),
        ("quad8", 2, 2),
        ("quad9", 2, 2),
    ):
        for method in ("node", "mortar"):
            if kind in ("tri3", "quad4") and method == "mortar":
                continue
            words = f"Press fit of hollow balls, {NAMES[kind]}, {WAYS[method]}"
            yield words, lambda a=(kind, n, layers, method): hollow(*a)
    for case, kind, across in (
        ("H2", "quad9", 2),
        ("H2", "quad9", 3),
        ("H2", "quad8", 3),
        ("H3", "quad8", 3),
    ):
        yield (
            f"{case} {WHAT[case]}, {NAMES[kind]}, {across} per radius",
            lambda a=(case, across, 1.5, kind): hertz(*a),
        )
    for kind, n in (("quad4", 14), ("quad9", 5), ("quad9", 7)):
        yield (
            f"Ball on a plane, {NAMES[kind]}, {n} faces to 45 degrees",
            lambda a=(kind, n): ball(*a, 0.12),
        )


def problems() -> Iterator[tuple[str, Callable[[], Case]]]:
    """All of them."""
    for case, what in (("H2", "rigid sphere"), ("H3", "two spheres")):
        for across in (3, 4, 6):
            name = f"{case} {what}, hexahedra, {across} per radius"
            yield name, lambda a=(case, across, 1.5): hertz(*a)
    yield "H2 rigid sphere, hexahedra, 10 per radius", lambda: hertz("H2", 10, 1.5)
    for across in (4, 6):
        name = f"H2 rigid sphere, tetrahedra, {across} per radius"
        yield name, lambda n=across: hertz("H2", n, 1.6, "tri3")
    for across, share in ((5, 0.25), (5, 0.75), (8, 0.75), (5, 5.0)):
        words = f"capped at {share} mu p0" if share < 1 else "not capped"
        yield f"H8 sliding, {words}, {across} per radius", lambda a=(across, share): capped(*a)
    yield "Spinning ball, 5 per radius", lambda: spun(5)
    for across, push in ((4, 0.0042), (6, 0.0042), (6, 0.002)):
        words = f"H6 Mindlin, pushed by {push}, {across} per radius"
        yield words, lambda a=(across, push): mindlin(*a)
    for kind, n in (("quad4", (12, 8)), ("tri3", (12, 8)), ("quad4", (8, 12)), ("quad4", (8, 5))):
        cells = "hexahedra" if kind == "quad4" else "tetrahedra"
        yield f"P1 patch test, node by node, {cells}, {n[0]} on {n[1]}", lambda a=(kind, n): patch(*a)
    yield from curves()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="put the table into the documents")
    args, rows = parser.parse_args(), []
    for name, make in problems():
        result, pressure, friction = make()
        true = true_errors(result, pressure, friction)
        estimate = result.values[0].error_estimate
        found = estimate.pressure.total, estimate.traction.total
        ratio = [f / t for f, t in zip(found, true, strict=True)]
        rows.append({"problem": name, "true": true, "estimated": found, "effectivity": ratio})
        print(f"{name:60s} {ratio[0]:5.2f} {ratio[1]:5.2f}  {estimate}", flush=True)
    STORED.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    if args.write:
        write(rows, SOLIDS)


if __name__ == "__main__":
    main()
