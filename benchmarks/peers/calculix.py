"""The cases of `compare.py` by CalculiX: mortar (`TYPE=MORTAR`), or surface to surface by penalty.

    apt install calculix-ccx        (or a build of ccx; `CCX=/path/to/ccx`)
    python calculix.py CASE FILE    (`CCX_CONTACT=PENALTY`: the penalty method)

The clock runs for ccx alone: the deck is written before. Debian's build solves by SPOOLES; one with
PaStiX or PARDISO would be faster. Plane strain is one layer of C3D8 with uz = 0, as ccx itself makes
of CPE4. Dynamics and large sliding are not compared. A rigid plane is a meshed body for it.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scene import NU, E, Scene, run

# Slopes over E, of pressure over overlap and of friction over slip, for lengths of 1 [1 / length]. Its
# manual says 5 to 50 for penalty; at 50 `press` sinks in by 2.9 % of the approach. Mortar takes any.
SLOPES = {"MORTAR": (1e5, 1e4), "PENALTY": (1e3, 1e2)}


def thick(scene: Scene) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Nodes, elements and elements by body, in space: a plane scene gets a layer of thickness 1."""
    points = np.concatenate([body.points for body in scene.bodies])
    parts = [body.cells + scene.first(i) for i, body in enumerate(scene.bodies)]
    if scene.dim == 2:
        n = scene.size
        points = np.concatenate([np.column_stack([points, np.full(n, z)]) for z in (0.0, 1.0)])
        parts = [np.column_stack([cells, cells + n]) for cells in parts]
    return points, np.concatenate(parts), parts


def lines(rows: Any) -> str:
    return "\n".join(", ".join(map(str, row)) for row in rows) + "\n"


def names(ids: np.ndarray) -> str:
    """Numbers of a set, sixteen a line."""
    return lines(ids[i : i + 16] for i in range(0, len(ids), 16))


# faces of C3D8 by their local nodes, as the manual numbers them
FACES = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]


def surface(name: str, cells: np.ndarray, on: np.ndarray, first: int) -> str:
    """The faces of elements all of whose nodes are on a surface."""
    marked = np.isin(cells, on)
    rows = []
    for i, face in enumerate(FACES):
        rows += [(1 + first + e, f"S{i + 1}") for e in np.flatnonzero(marked[:, face].all(axis=1))]
    return f"*SURFACE, NAME={name}, TYPE=ELEMENT\n" + lines(rows)


def deck(scene: Scene, kind: str) -> str:
    """The input file."""
    points, cells, parts = thick(scene)
    copies = len(points) // scene.size
    out = "*NODE, NSET=ALL\n"
    # of a number ccx reads twenty characters and no more
    out += lines((1 + i, *(f"{x:.12e}" for x in p)) for i, p in enumerate(points.tolist()))
    out += "*ELEMENT, TYPE=C3D8, ELSET=SOLID\n"
    out += lines((1 + i, *c) for i, c in enumerate((cells + 1).tolist()))
    out += f"*MATERIAL, NAME=M\n*ELASTIC\n{E}, {NU}\n*SOLID SECTION, ELSET=SOLID, MATERIAL=M\n"
    for i, body in enumerate(scene.bodies):
        shift = scene.first(i) + np.arange(copies)[:, None] * scene.size
        held, face = ((ids + shift).ravel() for ids in (body.held, np.unique(body.face)))
        out += f"*NSET, NSET=HELD{i}\n" + names(held + 1)
        out += surface(f"FACE{i}", parts[i], face, sum(len(p) for p in parts[:i]))
    overlap, slip = SLOPES[kind]
    method = "MORTAR" if kind == "MORTAR" else "SURFACE TO SURFACE"
    out += f"*CONTACT PAIR, INTERACTION=I, TYPE={method}\nFACE1, FACE0\n*SURFACE INTERACTION, NAME=I\n"
    out += f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{overlap * E}\n"
    if scene.mu:
        out += f"*FRICTION\n{scene.mu}, {slip * E}\n"
    out += "*BOUNDARY\nHELD0, 1, 3\n" + ("ALL, 3, 3\n" if scene.dim == 2 else "")
    for at in scene.motion:
        out += "*STEP, INC=1000\n*STATIC\n1., 1.\n*BOUNDARY\n"
        out += lines(("HELD1", j + 1, j + 1, f"{value:.12e}") for j, value in enumerate(at))
        out += "*NODE PRINT, NSET=ALL, FREQUENCY=1000000\nU\n*END STEP\n"
    return out


def solve(scene: Scene) -> tuple[np.ndarray, dict[str, Any]]:
    """The displacements of the last step."""
    kind, ccx = os.environ.get("CCX_CONTACT", "MORTAR"), os.environ.get("CCX", "ccx")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "job.inp").write_text(deck(scene, kind), encoding="ascii")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([ccx, "job"], cwd=folder, capture_output=True, text=True, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode or "Job finished" not in done.stdout:
            sys.exit("\n".join(done.stdout.splitlines()[-12:]))
        printed = (Path(folder) / "job.dat").read_text(encoding="ascii").split("displacements")[-1]
        status = (Path(folder) / "job.sta").read_text(encoding="ascii").splitlines()
    rows = [line.split() for line in printed.splitlines()[1:] if len(line.split()) == 4]
    u = np.array(rows, dtype=float)[:, 1:][: scene.size, : scene.dim]
    version = subprocess.run([ccx, "-v"], capture_output=True, text=True, check=False).stdout.split()[
        -1
    ]
    counts = [line.split() for line in status if line.split()[:1] != [] and line.split()[0].isdigit()]
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    said = {"version": version, "iterations": sum(int(c[3]) for c in counts)}
    return u, said | {"seconds": spent, "memory": after.ru_maxrss / 1024}


if __name__ == "__main__":
    run(solve)
