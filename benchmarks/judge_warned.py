"""Are warnings of overlaps true? The judges' scenes, measured without the library's search.

    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_warned.py --scenes 60 --seed 0
    OPENBLAS_NUM_THREADS=1 python benchmarks/judge_warned.py --scenes 60 --seed 0 --plane

Each warning of two deformed bodies that overlap names a place, a depth, what chords explain and what
the bodies take up. By winding numbers of the deformed boundaries, made of the corners of all boundary
facets, the place has to lie in that body in one step at least, and by the distance from its facets it
has to lie deeper than half of the bound (corners alone stand for curved facets, in the plane middles
as well). Prints how many scenes have a warning that is not confirmed, which may be a tenth at most.
"""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import judge
import judge_scenes
from judge_solids import make, run, scene
from solid_checks import closest

NUMBER = r"(-?[\d.]+\d(?:e[+-]?\d+)?|0)"
WORDS = re.compile(
    rf"overlap by up to {NUMBER}, at \(([^()]*)\), where '\w+/\w+' lies in the "
    rf"body of '(\w+)/\w+', .*?where chords explain {NUMBER} and the bodies take up {NUMBER}",
    re.DOTALL,
)
BOUND = 0.35  # of what the bodies take up, as docs/validity.md has it


def deformed(made: Any, u: np.ndarray) -> np.ndarray:
    """Triangles (t, 3, 3) of the boundary by its corners, counter-clockwise seen from outside.

    In the plane pieces (t, 2, 2), by the middles of facets as well where they are nodes.
    """
    mesh, dofs = made.basis.mesh, made.basis.nodal_dofs
    if len(dofs) == 2:
        return _pieces(made.basis, u)
    x = (mesh.p[:, : dofs.shape[1]] + u[dofs]).T
    facets = mesh.boundary_facets()
    corners = x[mesh.facets[:, facets].T]
    middle = x[mesh.t[:, mesh.f2t[0, facets]]].mean(axis=0)
    if corners.shape[1] == 4:  # round the middle; nodes of facets may be in any order
        centre = corners.mean(axis=1, keepdims=True)
        away = corners - centre
        across = np.cross(away[:, 0], away[:, 1])
        angle = np.arctan2(
            np.einsum("fcd,fd->fc", np.cross(away[:, :1], away), across),
            np.einsum("fcd,fd->fc", away, away[:, 0]) * np.linalg.norm(across, axis=1)[:, None],
        )
        ring = np.take_along_axis(corners, np.argsort(angle, axis=1)[..., None], axis=1)
        parts = [np.broadcast_to(centre, ring.shape), ring, np.roll(ring, -1, axis=1)]
        corners, middle = np.stack(parts, axis=2).reshape(-1, 3, 3), np.repeat(middle, 4, axis=0)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.sum(normal * (corners[:, 0] - middle), axis=1) < 0
    corners[inward] = corners[inward][:, [0, 2, 1]]
    return corners


def _pieces(basis: Any, u: np.ndarray) -> np.ndarray:
    mesh, dofs, between = basis.mesh, basis.nodal_dofs, basis.facet_dofs
    facets = mesh.boundary_facets()
    x = basis.doflocs[:, dofs[0]].T + u[dofs].T
    start, end = x[mesh.facets[:, facets]]
    inner = x[mesh.t[:3, mesh.f2t[0, facets]]].mean(axis=0)
    away, along = start - inner, end - start
    wrong = away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0] < 0
    start[wrong], end[wrong] = end[wrong].copy(), start[wrong].copy()
    if not len(between):
        return np.stack([start, end], axis=1)
    middle = basis.doflocs[:, between[0, facets]].T + u[between[:, facets]].T
    return np.concatenate([np.stack([start, middle], axis=1), np.stack([middle, end], axis=1)])


def winding(point: np.ndarray, triangles: np.ndarray) -> float:
    """One inside, zero outside: the solid angles of A. van Oosterom and J. Strackee (1983)."""
    if triangles.shape[2] == 2:
        a, b = np.moveaxis(triangles - point, 1, 0)
        angle = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1))
        return float(np.sum(angle) / (2 * np.pi))
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    one, two, three = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.sum(a * np.cross(b, c), axis=1)
    rest = (
        one * two * three + np.sum(a * b, 1) * three + np.sum(b * c, 1) * one + np.sum(c * a, 1) * two
    )
    return float(np.sum(np.arctan2(volume, rest)) / (2 * np.pi))


def depth(point: np.ndarray, triangles: np.ndarray) -> float:
    """How deep a point lies in a closed boundary; zero outside."""
    if winding(point, triangles) < 0.5:
        return 0.0
    if len(point) == 2:
        start, along = triangles[:, 0], triangles[:, 1] - triangles[:, 0]
        part = np.sum((point - start) * along, axis=1) / np.sum(along**2, axis=1)
        foot = start + np.clip(part, 0.0, 1.0)[:, None] * along
        return float(np.linalg.norm(foot - point, axis=1).min())
    share = closest(point[None], *np.moveaxis(triangles, 1, 0))[0]
    return float(np.linalg.norm(np.einsum("tk,tkd->td", share, triangles) - point, axis=1).min())


def solved(seed: int, plane: bool) -> tuple[Any, Any, tuple[str, ...]]:
    """The bodies of a scene, its answers, and what was warned of."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if plane:
            flat = judge_scenes.scene(seed)
            bodies = judge_scenes.make(flat)
            answers = judge.run(flat, bodies).answers
            return bodies, answers, tuple(sorted({text for a in answers for text in a.warned}))
        s = scene(seed, True, False)
        made = make(s)
        found = run(s, made=made)
    return made, found.answers, found.warned


def verdict(seed: int, plane: bool = False) -> tuple[bool, int, list[str]]:
    """Whether a scene is warned of, of how many overlaps, and those that are not confirmed."""
    made, answers, warned = solved(seed, plane)
    wrong, overlaps = [], 0
    for text in warned:
        told = WORDS.search(text)
        if told is None:
            continue
        overlaps += 1
        place, body = np.array([float(v) for v in told[2].split(",")]), told[3]
        bound = float(told[4]) + BOUND * float(told[5])
        deepest = max(depth(place, deformed(made[body], a.u[body])) for a in answers)
        if deepest <= 0.5 * bound:
            wrong.append(f"{deepest:.3g} where {told[1]} is said: {text[:120]}")
    return bool(warned), overlaps, wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0, help="number of the first scene")
    parser.add_argument("--plane", action="store_true", help="the scenes of judge.py")
    args = parser.parse_args()
    warned = overlapping = unconfirmed = 0
    for seed in range(args.seed, args.seed + args.scenes):
        told, overlaps, wrong = verdict(seed, args.plane)
        warned, overlapping = warned + told, overlapping + bool(overlaps)
        unconfirmed += bool(wrong)
        for words in wrong:
            print(f"{seed}: {words}", flush=True)
    print(
        f"{args.scenes} scenes, {warned} warned, {overlapping} of an overlap, "
        f"of which {unconfirmed} are not confirmed"
    )


if __name__ == "__main__":
    main()
