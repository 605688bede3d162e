"""Times the assembly of bodies, of every element, beside scikit-fem's on the same mesh.

    python benchmarks/assembly.py [--quick] [--only NAME ...] [--write]

As in `run.py`, every measurement is a process of its own with one BLAS thread, and the times are CPU
seconds, medians of three. "difference" is the largest entry of the difference of the two stiffnesses,
over the largest entry. The mesh is shaken: no two elements are alike.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
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

MARKS = "<!-- assembly table: begin -->", "<!-- assembly table: end -->"
SHAKE = 0.1  # of the side of an element
LAME = 1.3, 0.7
ELEMENTS: dict[str, tuple[Any, Any, int]] = {  # and the degree that the element needs
    "hex8": (fem.MeshHex, fem.ElementHex1, 2),
    "hex20": (fem.MeshHex, fem.ElementHexS2, 4),
    "hex27": (fem.MeshHex, fem.ElementHex2, 4),
    "tet4": (fem.MeshTet, fem.ElementTetP1, 2),
    "tet10": (fem.MeshTet, fem.ElementTetP2, 2),
    "quad4": (fem.MeshQuad, fem.ElementQuad1, 2),
    "quad8": (fem.MeshQuad, fem.ElementQuadS2, 4),
    "quad9": (fem.MeshQuad, fem.ElementQuad2, 4),
    "tri3": (fem.MeshTri, fem.ElementTriP1, 2),
    "tri6": (fem.MeshTri, fem.ElementTriP2, 2),
}


@dataclass(frozen=True)
class Case:
    """One row: element, and elements along a side."""

    name: str
    kind: str
    count: int
    rounds: int = 3


# Some 90 000 DOFs, then some 30 000 of each element.
CASES = [
    Case("hex8, large", "hex8", 30),
    Case("hex8", "hex8", 20),
    Case("hex20", "hex20", 12),
    Case("hex27", "hex27", 10),
    Case("tet4", "tet4", 20),
    Case("tet10", "tet10", 10),
    Case("quad4", "quad4", 122),
    Case("quad8", "quad8", 70),
    Case("quad9", "quad9", 60),
    Case("tri3", "tri3", 122),
    Case("tri6", "tri6", 60),
]
QUICK = Case("quick", "hex8", 3)


def mesh_of(case: Case) -> Any:
    """A shaken square or cube; made anew for each measurement, since meshes remember their edges."""
    kind, element, _ = ELEMENTS[case.kind]
    mesh = kind.init_tensor(*[np.linspace(0, 1, case.count + 1)] * element().dim)
    shaken = np.random.default_rng(0).uniform(-SHAKE, SHAKE, mesh.p.shape) / case.count
    return kind(mesh.p + shaken, mesh.t)


def from_mesh(case: Case) -> dict[str, Any]:
    """A body without a basis."""
    clock, form = Clock(), linear_elasticity(*LAME)
    element, mesh = fem.ElementVector(ELEMENTS[case.kind][1]()), mesh_of(case)
    made = clock("from mesh", lambda: sc.Body.from_mesh(mesh, element, form))
    plain = form.assemble(fem.Basis(mesh, element, quadrature=made.basis.quadrature))
    return clock.stages | {"difference from mesh": float(abs(made.K - plain).max() / abs(plain).max())}


def from_basis(case: Case) -> dict[str, Any]:
    """A basis, and on it scikit-fem's assembly and a body."""
    clock, form = Clock(), linear_elasticity(*LAME)
    _, kind, degree = ELEMENTS[case.kind]
    element, mesh = fem.ElementVector(kind()), mesh_of(case)
    basis = clock("basis", lambda: fem.Basis(mesh, element, intorder=degree))
    plain = clock("assemble", lambda: form.assemble(basis))
    body = clock("body", lambda: sc.Body(basis, form))
    difference = float(abs(body.K - plain).max() / abs(plain).max())
    return clock.stages | {"dofs": body.n, "difference": difference}


WAYS = {"from mesh": from_mesh, "from basis": from_basis}


def worker(way: str, name: str) -> dict[str, Any]:
    """The measurement of a case by its name, warmed up: imports are not what is measured."""
    known = {case.name: case for case in [*CASES, QUICK]}
    WAYS[way](QUICK)
    return WAYS[way](known[name])


def run(case: Case) -> dict[str, Any]:
    """Medians of both ways, each in processes of its own: what comes first finds no memory in use."""
    row: dict[str, Any] = {"case": case.name}
    done = [[measure(way, case, script=__file__) for way in WAYS] for _ in range(case.rounds)]
    for runs in zip(*done, strict=True):
        good = [r for r in runs if "failed" not in r]
        row |= middle(good) if good else runs[-1]
    return row


COLUMNS = {
    "element": lambda r: r["case"],
    "DOFs": lambda r: f"{r['dofs']:,}",
    "`Basis`, s": lambda r: f"{r['basis']:.3f}",
    "`form.assemble`, s": lambda r: f"{r['assemble']:.3f}",
    "`Body(basis, form)`, s": lambda r: f"{r['body']:.3f}",
    "`Body.from_mesh`, s": lambda r: f"{r['from mesh']:.3f}",
    "`Body` / `assemble`": lambda r: f"{r['body'] / r['assemble']:.2f}",
    "`from_mesh` / both": lambda r: f"{r['from mesh'] / (r['basis'] + r['assemble']):.2f}",
    "difference": lambda r: f"{max(r['difference'], r['difference from mesh']):.0e}",
}


def main() -> None:
    args = command_line(__doc__).parse_args()
    if args.worker:
        answer(lambda: worker(*args.worker))
        return
    chosen = [QUICK] if args.quick else [c for c in CASES if args.only is None or c.name in args.only]
    path = RESULTS / ("assembly_quick.json" if args.quick else "assembly.json")
    rows = stored(path)
    for case in chosen:
        rows[case.name] = run(case) | {"machine": machine()}
        path.write_text(json.dumps({"rows": list(rows.values())}, indent=1) + "\n", encoding="utf-8")
        print(listed([rows[case.name]], COLUMNS).splitlines()[-1], flush=True)
    known = [case.name for case in (CASES if not args.quick else [QUICK])]
    record = listed([rows[name] for name in known if name in rows], COLUMNS)
    print(record)
    if args.write:
        write_into(HERE.parent / "docs" / "checks" / "performance.md", record, MARKS)


if __name__ == "__main__":
    main()
