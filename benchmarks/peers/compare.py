"""Runs this library beside its peers: the same meshes, elements, material and motion, one judge.

    python benchmarks/peers/compare.py [--only CASE ...] [--peers NAME ...] [--rounds N] [--write]

Each job is a process of its own on one thread, and those of a case are interleaved. CPU seconds are
those of the whole process, with what it imports and reads; the least of the rounds. Each peer writes
only its displacements. What they are worth is found here, alike for all, from the forces `K u` of
scikit-fem's stiffness: those in the interior say whether elements and material are the same; those of
the contact, over the areas of its nodes, are pressure and friction. *Overlap* is how deep the deepest
node of the upper face is in the other one.

How each peer is installed stands at the head of its script. `PEER_PYTHON` is the interpreter of those
from the Python index, `GETFEM_PYTHON` that of GetFEM. One that is not there is a row that says so.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np
import skfem as fem
from scipy.interpolate import RegularGridInterpolator
from skfem.models.elasticity import lame_parameters, linear_elasticity

sys.path.insert(0, str(Path(__file__).parents[1]))
from ours import KINDS
from run import RESULTS, THREADS, machine, stored, write_into
from scene import CASES, HALF, HIGH, NU, Body, E, R, Scene, scene

from skfem_contact.reference import block_curvature, cattaneo_mindlin, effective_modulus, hertz_line

HERE = Path(__file__).parent
LIMIT = 1800  # seconds of a job
PYTHON = os.environ.get("PEER_PYTHON", sys.executable)
MARKS = "<!-- peers table: begin -->", "<!-- peers table: end -->"


@dataclass(frozen=True)
class Peer:
    """How a peer is run, and how the names of its cases begin."""

    name: str
    script: str
    kinds: tuple[str, ...]
    python: str = PYTHON
    given: tuple[tuple[str, str], ...] = ()


PEERS = [
    Peer("skfem_contact", "ours.py", ("press", "rub", "rigid"), sys.executable),
    Peer("Kratos, multigrid", "kratos.py", ("press",)),
    Peer("Kratos", "kratos.py", ("rub",)),
    Peer("CalculiX, mortar", "calculix.py", ("press", "rub"), sys.executable),
    Peer(
        "CalculiX, penalty",
        "calculix.py",
        ("press", "rub"),
        sys.executable,
        (("CCX_CONTACT", "PENALTY"),),
    ),
    Peer(
        "GetFEM",
        "getfem_bricks.py",
        ("press", "rub"),
        os.environ.get("GETFEM_PYTHON", "/usr/bin/python3"),
    ),
    Peer("FElupe, penalty", "felupe_plane.py", ("rigid",)),
    Peer("SfePy, penalty", "sfepy_contact.py", ("press",)),
]
COMPARED = ("press 6k", "press 24k", "rub 7k", "rigid 7k")
FINE = {"press": "press 92k", "rigid": "rigid 66k"}  # whose answer by this library is the measure


# -- the judge ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Verdict:
    """What displacements are worth."""

    force: np.ndarray  # of the contact on the upper body
    traction: np.ndarray  # (nodes of the face, dim)
    points: np.ndarray
    residual: float  # in the interior, over the force
    overlap: float  # the deepest, over the approach


def face_areas(body: Body) -> np.ndarray:
    """What of the contact face belongs to each of its nodes; the face is a grid."""
    area = np.ones(1)
    for axis in body.grid:
        steps = np.diff(axis)
        area = np.multiply.outer(area, (np.append(steps, 0) + np.append(0, steps)) / 2)
    return area.ravel()


def residual(body: Body, dim: int, u: np.ndarray) -> np.ndarray:
    """`K u` by scikit-fem, as forces of nodes."""
    mesh_type, element, order = KINDS[dim]
    mesh = mesh_type(body.points.T.copy(), body.cells[:, order].T.copy())
    basis = fem.Basis(mesh, fem.ElementVector(element()), intorder=2)
    K = linear_elasticity(*lame_parameters(E, NU)).assemble(basis)
    return (K @ u.ravel()).reshape(-1, dim)


def judged(case: Scene, u: np.ndarray) -> Verdict:
    """The forces that displacements need, and the overlap that they leave."""
    parts = np.split(u, [case.first(1)] if len(case.bodies) > 1 else [])
    unbalanced = []
    for body, part in zip(case.bodies, parts, strict=True):
        r = residual(body, case.dim, part)
        free = np.setdiff1d(np.arange(len(r)), np.append(body.held, body.face))
        unbalanced.append(np.linalg.norm(r[free]))
    upper, on = case.bodies[-1], np.unique(case.bodies[-1].face)
    forces = r[on]
    at = upper.points[on]
    below: Any = 0.0
    if len(parts) > 1:
        lower = case.bodies[0]
        top = parts[0][np.unique(lower.face), -1].reshape([len(axis) for axis in lower.grid])
        below = RegularGridInterpolator(lower.grid, top)(at[:, :-1])
    gap = at[:, -1] + parts[-1][on, -1] - below
    return Verdict(
        force=forces.sum(0),
        traction=forces / face_areas(upper)[:, None],
        points=at,
        residual=float(np.hypot.reduce(unbalanced) / np.linalg.norm(forces)),
        overlap=float(max(-gap.min(), 0.0) / abs(case.motion[-1][-1])),
    )


def errors(name: str, verdict: Verdict, fine: Verdict | None) -> dict[str, float]:
    """Of the force and the pressure: to a fine mesh, or to Hertz, Cattaneo and Mindlin."""
    if fine is None:
        return line_errors(scene(name), verdict)
    grid = np.unique(fine.points[:, 0].round(12))
    exact = RegularGridInterpolator((grid, grid), fine.traction[:, -1].reshape(len(grid), -1))
    p, wanted = verdict.traction[:, -1], exact(verdict.points[:, :-1])
    return {
        "force": float(verdict.force[-1] / fine.force[-1] - 1),
        "pressure": float(np.linalg.norm(p - wanted) / np.linalg.norm(wanted)),
        "largest": float(p.max() / fine.traction[:, -1].max() - 1),
    }


def line_errors(case: Scene, verdict: Verdict) -> dict[str, float]:
    """L2 errors of pressure and friction for the forces that were found."""
    body, x = case.bodies[-1], verdict.points[:, 0]
    Q, P = -verdict.force[0], verdict.force[1]
    added = 2 * block_curvature(P, HIGH, E, NU, base="fixed", width=HALF / HIGH)
    hertz = hertz_line(P, R, effective_modulus(E, NU, E, NU), added_curvature=added)
    weight = np.sqrt(face_areas(body))
    out = {"force": float("nan"), "P": float(P), "Q": float(Q)}
    exact = hertz.pressure(x)
    out["pressure"] = float(
        np.linalg.norm(weight * (verdict.traction[:, 1] - exact)) / np.linalg.norm(weight * exact)
    )
    out["largest"] = float(verdict.traction[:, 1].max() / exact.max() - 1)
    if abs(Q) <= case.mu * P:
        q = cattaneo_mindlin(hertz, case.mu, float(Q)).traction(x)
        out["friction"] = float(
            np.linalg.norm(weight * (-verdict.traction[:, 0] - q)) / np.linalg.norm(weight * q)
        )
    return out


# -- the runner --------------------------------------------------------------------------------


def job(peer: Peer, name: str, folder: str) -> dict[str, Any]:
    """A peer on a case, in a process of its own; a failure is an answer too."""
    out = Path(folder) / "answer"
    for old in Path(folder).glob("answer*"):
        old.unlink()
    environment = os.environ | dict.fromkeys(THREADS, "1") | dict(peer.given)
    if peer.python != sys.executable:
        environment.pop("PYTHONPATH", None)
    else:
        environment["PYTHONPATH"] = str(HERE.parents[1])
    log = Path(folder) / "log"
    with log.open("w") as to:
        begin = time.monotonic()
        process = subprocess.Popen(
            [peer.python, str(HERE / peer.script), name, str(out)],
            stdout=to,
            stderr=to,
            env=environment,
            cwd=folder,
            start_new_session=True,
        )
        late = Timer(LIMIT, os.killpg, (process.pid, signal.SIGKILL))  # with ccx that it runs
        late.start()
        _, status, used = os.wait4(process.pid, 0)
        late.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        wall = time.monotonic() - begin
    if wall > LIMIT:
        return {"failed": f"not done in {LIMIT} s"}
    if process.returncode or not out.with_suffix(".npy").exists():
        said = log.read_text(errors="replace").strip().splitlines()
        return {"failed": said[-1] if said else f"ended with {process.returncode}"}
    done = {"seconds": used.ru_utime + used.ru_stime, "wall": wall}
    return (
        done
        | json.loads(out.with_suffix(".json").read_text())
        | {"u": np.load(out.with_suffix(".npy"))}
    )


def measured(name: str, peers: list[Peer], rounds: int) -> list[dict[str, Any]]:
    """All peers on a case, in turn."""
    kind = name.split()[0]
    chosen = [peer for peer in peers if name.startswith(peer.kinds)]
    done: dict[str, list[dict[str, Any]]] = {peer.name: [] for peer in chosen}
    case = scene(name)
    with tempfile.TemporaryDirectory() as folder:
        fine = None
        if kind in FINE:
            found = job(PEERS[0], FINE[kind], folder)
            if "failed" in found:
                sys.exit(f"no measure, {FINE[kind]} failed: {found['failed']}")
            fine = judged(scene(FINE[kind]), found["u"])
        for _ in range(rounds):
            for peer in chosen:
                done[peer.name].append(job(peer, name, folder))
                last = done[peer.name][-1]
                print(
                    f"  {name:10s} {peer.name:20s} {last.get('failed') or round(last['seconds'], 2)}",
                    flush=True,
                )
    rows = []
    for peer in chosen:
        good = [run for run in done[peer.name] if "failed" not in run]
        row: dict[str, Any] = {
            "case": f"{name}, {peer.name}",
            "dofs": case.size * case.dim,
            "rounds": rounds,
        }
        if good:
            best = min(good, key=lambda run: run["seconds"])
            verdict = judged(case, best.pop("u"))
            row |= best | {
                "errors": errors(name, verdict, fine),
                "largest wall": max(g["wall"] for g in good),
            }
            row |= {
                "residual": verdict.residual,
                "overlap": verdict.overlap,
                "forces": verdict.force.tolist(),
            }
        else:
            row |= done[peer.name][-1]
        rows.append(row | {"machine": machine()})
    return rows


def percent(value: float | None) -> str:
    return "-" if value is None or np.isnan(value) else f"{100 * value:.2f} %"


HEADS = (
    *("case", "DOFs", "code", "version", "CPU, s", "memory, MB", "iterations"),
    *("force", "pressure", "its largest", "friction", "residual", "overlap"),
)


def line(cells: Iterable[str]) -> str:
    """A row of a table in Markdown."""
    return "| " + " | ".join(cells) + " |"


def table(rows: list[dict[str, Any]]) -> str:
    """The table in Markdown."""
    lines = [line(HEADS), "|" + " --- |" * len(HEADS)]
    for row in rows:
        case, code = row["case"].split(", ", 1)
        cells = [case, f"{row['dofs']:,}", code]
        if "failed" in row:
            lines.append(line([*cells, f"failed: {row['failed']}"]) + " |" * (len(HEADS) - 4))
            continue
        off = row["errors"]
        cells += [
            row["version"],
            f"{row['seconds']:.2f}",
            f"{row['memory']:.0f}",
            str(row["iterations"]),
        ]
        cells += [percent(off.get(key)) for key in ("force", "pressure", "largest", "friction")]
        lines.append(line([*cells, f"{row['residual']:.0e}", percent(row["overlap"])]))
    return "\n".join(lines)


LEFT_OUT = ("CalculiX, penalty", "FElupe, penalty")  # what short tables leave out
HEADS_OF_CASES = {"press 24k": "press, 24 420 DOFs", "rub 7k": "friction, 20 steps, 6588 DOFs"}
SHORT = ("docs/cost.md", "paper.md")  # pages with a short table


def short(rows: list[dict[str, Any]]) -> str:
    """A table of seconds and errors of the pressure: a row a code, a column a case."""
    found = {row["case"]: row for row in rows if "failed" not in row}
    lines = [line(["", *HEADS_OF_CASES.values()]), "|" + " --- |" * (1 + len(HEADS_OF_CASES))]
    for code in dict.fromkeys(peer.name.removesuffix(", multigrid") for peer in PEERS):
        if code in LEFT_OUT:
            continue
        cells = []
        for name in HEADS_OF_CASES:
            row = found.get(f"{name}, {code}") or found.get(f"{name}, {code}, multigrid")
            cells.append(
                f"{row['seconds']:.1f} ({100 * row['errors']['pressure']:.1f} %)" if row else "-"
            )
        lines.append(line([code, *cells]))
    return "\n".join(lines).replace("|  |", "| |")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--only", nargs="*", default=COMPARED, choices=CASES, help="cases; none: write alone"
    )
    parser.add_argument("--peers", nargs="*", help="names of peers; the rows of others stay")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--write", action="store_true", help="put the table into the documents")
    args = parser.parse_args()
    path = RESULTS / "peers.json"
    rows = stored(path)
    peers = [peer for peer in PEERS if args.peers is None or peer.name in args.peers]
    order = [f"{case}, {peer.name}" for case in CASES for peer in PEERS]
    record = [rows[key] for key in order if key in rows]
    for name in args.only:
        rows |= {row["case"]: row for row in measured(name, peers, args.rounds)}
        record = [rows[key] for key in order if key in rows]
        path.write_text(json.dumps({"rows": record}, indent=1) + "\n", encoding="utf-8")
    print(table(record))
    if args.write:
        root = HERE.parents[1]
        write_into(root / "docs" / "checks" / "performance.md", table(record), MARKS)
        for page in SHORT:
            write_into(root / page, short(record), MARKS)


if __name__ == "__main__":
    main()
