"""Times the pairing of large surfaces of solids beside one assembly of their bodies.

    python benchmarks/pairing.py [--quick] [--only NAME ...] [--beside CHECKOUT] [--write]

Two square plates of one layer of elements lie on each other, the upper one turned, so that its faces
cut those of the lower one into polygons of three to eight corners. As in `run.py`, every measurement is
a process of its own with one BLAS thread, and the times are CPU seconds, medians of three (with 100 000
points, where the assembly of a million DOFs takes two minutes, of one). With `--beside` the library of
another checkout pairs in turn with this one, and the ratios are printed.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from importlib import import_module
from statistics import median
from typing import Any

import numpy as np
import skfem as fem
from run import (
    HERE,
    RESULTS,
    Clock,
    answer,
    command_line,
    listed,
    machine,
    measure,
    middle,
    stored,
    write_into,
)
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.conditions.discretisation import pair

HEIGHT, ANGLE = 0.1, 0.1  # of a plate of side 1; between the plates [rad]
OVERHANG = 1.3  # side of the upper plate
BULGE = 0.05  # of the contact faces, where they are curved
MARKS = "<!-- pairing table: begin -->", "<!-- pairing table: end -->"
ELEMENTS: dict[str, tuple[Any, Any]] = {
    "Q1": (fem.MeshHex1, fem.ElementHex1),
    "Q2": (fem.MeshHex2, fem.ElementHex2),
    "P1": (fem.MeshTet1, fem.ElementTetP1),
    "P2": (fem.MeshTet2, fem.ElementTetP2),
}


@dataclass(frozen=True)
class Case:
    """One row: elements along the sides of the lower (secondary) and the upper plate."""

    name: str
    kind: str
    method: str
    lower: int
    upper: int
    curved: bool = False
    rounds: int = 3


# The numbers of elements are those that make 10 000 cut pairs, or 100 000 points.
CASES = [
    Case("Q1, cut", "Q1", "mortar", 60, 52),
    Case("Q1, curved, cut", "Q1", "mortar", 60, 52, curved=True),
    Case("P1, cut", "P1", "mortar", 36, 32),
    Case("P2, curved, cut", "P2", "mortar", 18, 16, curved=True),
    Case("Q2, curved, cut", "Q2", "mortar", 30, 26, curved=True),
    Case("P1, curved, cut", "P1", "mortar", 36, 32, curved=True),
    Case("Q2, curved, nodes", "Q2", "node", 30, 26, curved=True),
    Case("P2, curved, nodes", "P2", "node", 30, 26, curved=True),
    Case("P1, curved, nodes", "P1", "node", 60, 52, curved=True),
    Case("Q1, nodes", "Q1", "node", 316, 280, rounds=1),
    Case("Q1, curved, nodes", "Q1", "node", 316, 280, curved=True, rounds=1),
]
QUICK = Case("quick", "Q1", "mortar", 6, 5, curved=True)


def body(case: Case, upper: bool) -> sc.Body:
    """A plate; the upper one turned about the vertical axis, and larger: it covers the lower one."""
    mesh_type, element = ELEMENTS[case.kind]
    count, side = (case.upper, OVERHANG) if upper else (case.lower, 1.0)
    across = np.linspace(-side / 2, side / 2, count + 1)
    z = np.array([0.0, HEIGHT]) if upper else np.array([-HEIGHT, 0.0])
    straight = fem.MeshHex.init_tensor(across, across, z)
    straight = straight.to_meshtet() if case.kind.startswith("P") else straight
    mesh = mesh_type.from_mesh(straight) if case.kind.endswith("2") else straight
    mesh = mesh.with_boundaries(
        {"bottom": lambda x: np.isclose(x[2], z[0]), "top": lambda x: np.isclose(x[2], z[1])}
    )
    mesh = replace(mesh, doflocs=placed(mesh.doflocs, upper, case.curved))
    basis = fem.Basis(mesh, fem.ElementVector(element()), intorder=2)
    name, held = ("upper", "top") if upper else ("lower", "bottom")
    return sc.Body(basis, linear_elasticity(), D=held, name=name)


def placed(p: np.ndarray, upper: bool, curved: bool) -> np.ndarray:
    """Nodes (3, n), turned and lifted into a dome."""
    x, y, z = p
    c, s = np.cos(upper * ANGLE), np.sin(upper * ANGLE)
    x, y = c * x - s * y, s * x + c * y
    return np.array([x, y, z + curved * BULGE * np.cos(np.pi * x) * np.cos(np.pi * y)])


def pairing(case: Case) -> dict[str, Any]:
    """Assembly, surfaces and pairing of one case, and how much was paired."""
    clock = Clock()
    lower, upper = clock("assembly", lambda: (body(case, False), body(case, True)))
    surfaces = clock("surfaces", lambda: (lower.surface("top"), upper.surface("bottom")))
    contact = sc.Contact(*surfaces, method=case.method)
    found = clock("pairing", lambda: pair(contact))
    pieces = cut_pairs(surfaces) if case.method == "mortar" else 0
    sums = [np.asarray(W.sum(axis=1)) for W in (found.secondary_weights, found.primary_weights)]
    return {
        **clock.stages,
        "dofs": lower.n + upper.n,
        "points": len(found.gap),
        "paired": int(found.paired.sum()),
        "pieces": pieces,
        "gap": float(np.abs(found.gap[found.paired]).max()),
        "translation": float(np.abs(sums[0] - sums[1]).max()),  # gaps made by moving all alike
    }


def cut_pairs(surfaces: tuple[Any, Any]) -> int:
    """The number of polygons that faces of both sides have in common."""
    try:
        from skfem_contact.pairing.segmentation import Segmentation, segment  # noqa: F401
    except ImportError:  # with `--beside`: earlier versions have that of faces elsewhere
        segment = import_module("skfem_contact.pairing.face_segmentation").segment
    return len(segment(*surfaces).e)


def worker(name: str) -> dict[str, Any]:
    """The measurement of a case by its name, warmed up: imports are not what is measured."""
    known = {case.name: case for case in [*CASES, QUICK]}
    pairing(replace(QUICK, method=known[name].method, kind=known[name].kind))
    return pairing(known[name])


COLUMNS = {
    "surfaces": lambda r: r["case"],
    "DOFs": lambda r: f"{r['dofs']:,}",
    "points": lambda r: f"{r['points']:,}",
    "cut pairs": lambda r: f"{r['pieces']:,}" if r["pieces"] else "-",
    "assembly, s": lambda r: f"{r['assembly']:.2f}",
    "pairing, s": lambda r: f"{r['surfaces'] + r['pairing']:.2f}",
    "pairing / assembly": lambda r: f"{(r['surfaces'] + r['pairing']) / r['assembly']:.2f}",
    "largest gap": lambda r: f"{r['gap']:.0e}",
}


def table(rows: list[dict[str, Any]]) -> str:
    """The table in Markdown."""
    return listed(rows, COLUMNS)


def compared(name: str, here: list[dict[str, Any]], there: list[dict[str, Any]]) -> str:
    """Times of surfaces and pairing over those of the other checkout, medians and smallest."""
    failed = [run["failed"] for run in [*here, *there] if "failed" in run]
    if failed:
        return f"{name}: not compared, {failed[0]}"
    ours, theirs = ([run["surfaces"] + run["pairing"] for run in runs] for runs in (here, there))
    shares = median(ours) / median(theirs), min(ours) / min(theirs)
    return f"{name}: {shares[0]:.2f} (smallest {shares[1]:.2f}) of the other checkout's"


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--beside", metavar="CHECKOUT", help="measure its library in turn with this")
    args = parser.parse_args()
    if args.worker:
        answer(lambda: worker(args.worker[1]))
        return
    chosen = [QUICK] if args.quick else [c for c in CASES if args.only is None or c.name in args.only]
    path = RESULTS / ("pairing_quick.json" if args.quick else "pairing.json")
    rows = stored(path)
    for case in chosen:
        runs, others = [], []
        for _ in range(case.rounds):
            runs.append(measure("pairing", case, script=__file__))
            if args.beside:
                others.append(measure("pairing", case, args.beside, script=__file__))
        good = [r for r in runs if "failed" not in r]
        rows[case.name] = {"case": case.name} | (middle(good) if good else runs[-1])
        rows[case.name] |= {"machine": machine()}
        path.write_text(json.dumps({"rows": list(rows.values())}, indent=1) + "\n", encoding="utf-8")
        print(table([rows[case.name]]).splitlines()[-1], flush=True)
        if args.beside:
            print(compared(case.name, runs, others), flush=True)
    known = [case.name for case in (CASES if not args.quick else [QUICK])]
    record = [rows[name] for name in known if name in rows]
    print(table(record))
    if args.write:
        write_into(HERE.parent / "docs" / "checks" / "performance.md", table(record), MARKS)


if __name__ == "__main__":
    main()
