"""Node-to-segment against mortar: pairing times and glued meshes, for docs/checks/methods.md.

    python benchmarks/methods.py

Hertz contact, error over time, is in trade.py.

The scenes are those of the verification tests.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "verification"))
sys.path.append(str(Path(__file__).parents[1] / "tests"))

from test_tied import Waves, errors
from unlike_meshes import UnlikeBlocks

from skfem_contact.conditions.discretisation import pair


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
    for table in (pairing_table, tied_table):
        print(f"\n{table.__doc__}\n")
        table()
