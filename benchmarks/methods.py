"""Node-to-segment against mortar: the tables of docs/methods.md, on meshes that do not match.

    python benchmarks/methods.py

The scenes are those of the verification tests.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "verification"))

from test_mortar_hertz import hertz, pressure_error
from test_tied import Waves, errors
from unlike_meshes import UnlikeBlocks

from skfem_contact.kinematics import pair


def hertz_table() -> None:
    """L2 error of the Hertz pressure, at equal numbers of nodes per half width."""
    print("| elements | nodes per half width | DOFs | node: error | s | mortar: error | s |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for kind, points in (
        ("Q1", (8.5, 16.5, 32.5, 48.5)),
        ("P1", (8.5, 16.5, 32.5, 48.5)),
        ("Q2", (4.25, 8.25, 16.25, 24.25)),
        ("P2", (4.25, 8.25, 16.25, 24.25)),
    ):
        for n in points:
            cells = []
            for method in ("node", "mortar"):
                start = time.perf_counter()
                result, exact = hertz(n, method, kind, 4 / 3)
                seconds = time.perf_counter() - start
                cells += [f"{100 * pressure_error(result, exact):.2f} %", f"{seconds:.1f}"]
            per_width = n * (2 if kind in ("Q2", "P2") else 1)
            print(f"| {kind} | {per_width} | {result.system.n} | " + " | ".join(cells) + " |")


def tied_table() -> None:
    """Errors of a glued elastic solution and their orders."""
    print("| elements | method | displacement, 1/h = 32 | order | strain | order |")
    print("| --- | --- | --- | --- | --- | --- |")
    for kind in ("P1", "Q1", "P2", "Q2", "S2"):
        for method in ("node", "mortar"):
            e = np.array([errors(Waves, kind, n, method) for n in (16, 32)])
            order = np.log2(e[0] / e[1])
            print(
                f"| {kind} | {method} | {e[1, 0]:.1e} | {order[0]:.1f} "
                f"| {e[1, 1]:.1e} | {order[1]:.1f} |"
            )


def pairing_table() -> None:
    """Seconds to pair the two surfaces, the only work that differs."""
    print("| points | node: s | mortar: s |")
    print("| --- | --- | --- |")
    for n in (30, 300, 1000):
        row = []
        for method in ("node", "mortar"):
            blocks = UnlikeBlocks(1 / n, None, method=method, depth=2 / n)
            start = time.perf_counter()
            pairing = pair(blocks.contact)
            row.append(f"{time.perf_counter() - start:.3f}")
        print(f"| {len(pairing.gap)} | " + " | ".join(row) + " |")


if __name__ == "__main__":
    for table in (pairing_table, hertz_table, tied_table):
        print(f"\n{table.__doc__}\n")
        table()
