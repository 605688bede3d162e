"""Scenes that are their own mirror image, with contact forces that are not unique: do these agree?

    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_mirror.py --scenes 200 --seed 0
    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_mirror.py --only 17
    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_mirror.py --scenes 100 --routes

Random scenes of five kinds: a tool prescribed on its contact surface, one to four times as fine as the
block that it presses, in the plane and in space; a block wedged into a channel with friction on all
sides, in the plane and in space; a block over two foundations that touch. Pressures are compared with
their mirror image, with those of meshes numbered at random, of contacts and bodies in another order,
and with those of all DOFs; with ``--routes`` with those of all DOFs and of forces that are iterated.
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

KINDS = ("tool", "solid tool", "channel", "solid channel", "foundations")
#: Share of the largest pressure by which pressures may differ: without friction, and with it.
SAME, SAME_WITH_FRICTION = 1e-8, 1e-6


@dataclass(frozen=True)
class Scene:
    """What a scene is made of; lengths over the width of the block.

    Attributes
    ----------
    kind : one of `KINDS`
    n : int
        Facets across the block.
    fineness : int
        Facets of the tool over one of the block.
    width : float
        Of the tool.
    mu : float
    method : "mortar" or "node"
    tool_first : bool
        Whether the tool's surface is the secondary one.
    depth, squeeze : float
        Approach, and overlap with either wall of a channel.
    modulus : float
        Of tool and foundations over that of the block.
    """

    kind: str
    n: int
    fineness: int
    width: float
    mu: float
    method: str
    tool_first: bool
    depth: float
    squeeze: float
    modulus: float

    @property
    def tolerance(self) -> float:
        return SAME_WITH_FRICTION if self.mu else SAME


@dataclass(frozen=True)
class Way:
    """How it is solved: numbering of nodes (0 as meshed), order of contacts and bodies, route."""

    seed: int = 0
    turned: bool = False
    route: str = "condensed"


WAYS = {
    "numbering": Way(seed=1),
    "another numbering": Way(seed=2),
    "order": Way(turned=True),
    "all DOFs": Way(route="full"),
}
ROUTES = {"all DOFs": Way(route="full"), "iterated": Way(route="iterated")}
# No memory for the dense contact problem: forces are iterated.
BY_ROUTE: dict[str, dict[str, Any]] = {
    "condensed": {},
    "full": {"linear": sc.linalg.Direct()},
    "iterated": {"options": sc.Options(max_dense_bytes=0)},
}


def scene(seed: int) -> Scene:
    """A random scene."""
    rng = np.random.default_rng(seed)
    kind = KINDS[rng.integers(len(KINDS))]
    solid = "solid" in kind
    return Scene(
        kind=kind,
        n=int(rng.integers(2, 6 if solid else 13)),
        fineness=int(rng.integers(1, 3 if solid else 5)),
        width=float(rng.choice([0.5, 1.0])) if kind == "tool" else 1.0,
        mu=float(rng.choice([0.0, 0.1, 0.3, 0.6])),
        method="node" if rng.random() < 0.4 and kind != "foundations" else "mortar",
        tool_first=bool(rng.random() < 0.8),
        depth=float(10 ** rng.uniform(-4, -2)),
        squeeze=float(10 ** rng.uniform(-4, -2.5)),
        modulus=float(10 ** rng.uniform(-1, 2)),
    )


def build(s: Scene, way: Way) -> sc.ContactSolver:
    """The solver of a scene."""
    made = {"tool": _tool, "channel": _channel, "foundations": _foundations}
    bodies, contacts = made[s.kind.split()[-1]](s, way)
    step = -1 if way.turned else 1
    return sc.ContactSolver(bodies[::step], contacts[::step], **BY_ROUTE[way.route])


def _tool(s: Scene, way: Way) -> tuple[list[sc.Body], list[sc.Contact]]:
    across = 2 if "solid" in s.kind else 1
    low = _block(way, *across * [_even(0, 1, s.n)], _even(-0.5, 0, 3))
    sides = (1 - s.width) / 2
    count = max(2, round(s.n * s.fineness * s.width))
    up = _block(way, *across * [_even(sides, 1 - sides, count)], _even(0, 0.2, 2))
    block = _body(low, "block", D="bottom")
    tool = _body(up, "tool", s.modulus, D="bottom", move=-s.depth)
    pair = tool.surface("bottom"), block.surface("top")
    pair = pair if s.tool_first else pair[::-1]
    return [block, tool], [sc.Contact(*pair, friction=_law(s), method=s.method, name="tool")]


def _channel(s: Scene, way: Way) -> tuple[list[sc.Body], list[sc.Contact]]:
    across = [_even(0, 1, s.n), _even(0, 1, max(2, s.n // 2))][: 2 if "solid" in s.kind else 1]
    basis = _block(way, *across, _even(0, 0.7, max(2, s.n // 2)))
    up = np.eye(basis.mesh.dim())[-1]
    # but for its edges, whose gaps to the walls supports would make
    x = basis.mesh.p[0]
    inner = (basis.mesh.p[-1] == basis.mesh.p[-1].max()) & (x > 1e-9) & (x < 1 - 1e-9)
    body = _body(basis, "block", D=basis.nodal_dofs[:, inner].ravel(), move=-s.depth)
    walls = {"left": (0.0, 1.0), "right": (1.0, -1.0)}
    contacts = [
        sc.Contact(
            body.surface(side),
            sc.RigidPlane(x * np.eye(len(up))[0], n * np.eye(len(up))[0], name=side),
            friction=_law(s),
            interference=s.squeeze,
            name=side,
        )
        for side, (x, n) in walls.items()
    ]
    floor = sc.RigidPlane(0 * up, up, name="floor")
    seat = sc.Contact(body.surface("bottom"), floor, friction=_law(s), name="floor")
    return [body], [*contacts, seat]


def _foundations(s: Scene, way: Way) -> tuple[list[sc.Body], list[sc.Contact]]:
    n = s.n + s.n % 2
    body = _body(_block(way, _even(0, 1, n), _even(0, 0.5, 3)), "block", D="top", move=-s.depth)
    bodies, contacts = [body], []
    for name, (a, b) in {"left": (-0.5, 0.5), "right": (0.5, 1.5)}.items():
        basis = _block(way, _even(a, b, n * s.fineness), _even(-0.5, 0, 3))
        bodies.append(_body(basis, name, s.modulus, D="bottom"))
        half = (lambda x: (x[1] < 1e-9) & (x[0] < 0.5)) if name == "left" else _right_half
        pair = body.surface(half, name=f"onto {name}"), bodies[-1].surface("top")
        contacts.append(sc.Contact(*pair, friction=_law(s), method=s.method, name=name))
    return bodies, contacts


def _right_half(x: np.ndarray) -> np.ndarray:
    return (x[1] < 1e-9) & (x[0] > 0.5)


def _law(s: Scene) -> sc.Coulomb | None:
    return sc.Coulomb(s.mu) if s.mu else None


def _even(a: float, b: float, n: int) -> np.ndarray:
    return np.linspace(a, b, n + 1)


def _block(way: Way, *axes: np.ndarray) -> fem.Basis:
    """A block of quadrilaterals or hexahedra with sides by name, its nodes numbered as asked."""
    solid = len(axes) == 3
    mesh = (fem.MeshHex if solid else fem.MeshQuad).init_tensor(*axes)
    if way.seed:
        rng = np.random.default_rng(way.seed)
        order = rng.permutation(mesh.p.shape[1])
        place = np.argsort(order)
        mesh = type(mesh)(mesh.p[:, order], place[mesh.t][:, rng.permutation(mesh.t.shape[1])])
    names = {"left": (0, 0), "right": (0, -1), "bottom": (-1, 0), "top": (-1, -1)}
    sides = {
        name: lambda x, k=k, at=axes[k][end]: np.abs(x[k] - at) < 1e-9
        for name, (k, end) in names.items()
    }
    element = fem.ElementHex1() if solid else fem.ElementQuad1()
    return fem.Basis(mesh.with_boundaries(sides), fem.ElementVector(element), intorder=3)


def _body(
    basis: fem.Basis, name: str, modulus: float = 1.0, D: Any = "bottom", move: float = 0.0
) -> sc.Body:
    x = np.zeros(basis.N)
    x[basis.nodal_dofs[-1]] = move
    return sc.Body(basis, linear_elasticity(*lame_parameters(modulus, 0.3)), D=D, x=x, name=name)


def pressures(solver: sc.ContactSolver) -> tuple[dict[str, np.ndarray], sc.answers.ContactResult]:
    """Pressure and traction of each contact in the order of places, (m, 1 + d); and the result."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.ContactWarning)
        result = solver.solve()
    found = {}
    for values in result:
        order = np.lexsort(np.round(values.points, 9).T)
        found[values.name] = np.column_stack([values.pressure, values.traction])[order]
        found[f"places of {values.name}"] = values.points[order]
    return found, result


def mirrored(found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The same seen in a mirror at ``x = 1/2``."""
    other = {"left": "right", "right": "left"}
    out = {}
    for name in found:
        if name.startswith("places"):
            continue
        twin = other.get(name, name)
        points = found[f"places of {twin}"].copy()
        points[:, 0] = 1 - points[:, 0]
        out[name] = found[twin][np.lexsort(np.round(points, 9).T)] * 1.0
        out[name][:, 1] *= -1
    return out


def differences(
    s: Scene, ways: dict[str, Way] = WAYS
) -> tuple[dict[str, float], sc.answers.ContactResult, float]:
    """Largest difference by comparison, over the largest pressure; the result; its CPU seconds."""
    start = time.process_time()
    found, result = pressures(build(s, Way()))
    spent = time.process_time() - start
    others = {"mirror": mirrored(found)}
    others |= {name: pressures(build(s, way))[0] for name, way in ways.items()}
    names = [name for name in found if not name.startswith("places")]
    largest = max(np.abs(found[name]).max() for name in names)
    apart = {
        what: max(np.abs(found[name] - other[name]).max() for name in names) / largest
        for what, other in others.items()
    }
    return apart, result, spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int)
    parser.add_argument("--routes", action="store_true", help="compare the linear routes alone")
    given = parser.parse_args()
    seeds = range(given.seed, given.seed + given.scenes) if given.only is None else [given.only]
    counts = dict.fromkeys(("right", "WRONG", "refused"), 0)
    worst, several, total = {False: 0.0, True: 0.0}, 0, 0.0
    for seed in seeds:
        s = scene(seed)
        try:
            apart, result, spent = differences(s, ROUTES if given.routes else WAYS)
        except (sc.ContactError, np.linalg.LinAlgError) as error:
            counts["refused"] += 1
            print(seed, s, type(error).__name__, str(error)[:200])
            continue
        total, several = total + spent, several + bool(result.undetermined)
        worst[s.mu > 0] = max(worst[s.mu > 0], *apart.values())
        good = max(apart.values()) <= s.tolerance and result.certificate.worst <= 1e-8
        counts["right" if good else "WRONG"] += 1
        if not good or given.only is not None:
            told = ", ".join(f"{name} {value:.1e}" for name, value in apart.items())
            print(seed, s, f"{told}; certificate {result.certificate.worst:.1e}")
    print(
        f"{counts}; forces not unique in {several}; largest difference without friction "
        f"{worst[False]:.1e}, with {worst[True]:.1e}; {total:.1f} CPU s"
    )


if __name__ == "__main__":
    main()
