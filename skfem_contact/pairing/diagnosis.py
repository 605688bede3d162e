"""Signs that something is wrong with a pairing, in sentences."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arrays import angle_between
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.search import FACING
from skfem_contact.trees import Tree

# Facets this much smaller, and bodies this much stiffer, than those of the other side make the choice
# of the secondary worth a line.
FINER, STIFFER = 0.75, 3.0

# Normals of two surfaces that are all closer together than this [rad] would have to turn towards each
# other by half a radian before any of them faced another; bodies are linear, and turn by 0.1 at most.
ALIKE = float(np.pi / 3)

# What becomes of points without a partner: for good, and where pairings are made anew.
NEVER = 'They can never touch (outside="open"). '
LATER = (
    'Where they are at the start they can not touch (outside="open"); as bodies move they are paired '
    'anew (sliding="finite"). '
)


def diagnose(
    pairing: Pairing,
    secondary: ContactSurface,
    primary: Any,
    method: str = "node",
    follows: bool = False,
) -> list[str]:
    """Say in sentences what looks wrong with a pairing; an empty list if nothing does.

    Parameters
    ----------
    pairing : Pairing
    secondary : ContactSurface
    primary : ContactSurface or rigid obstacle
    method : {"node", "mortar"}
        Mortar holds the nodes of both sides: no side need be the finer one.
    follows : bool
        Whether points are paired anew where bodies go: what has no partner now may find one then.

    Returns
    -------
    list of str
        Points beyond the end of the primary surface, points without any partner, surfaces that
        face the same way, a primary surface finer than the secondary one.
    """
    lines = []
    lonely = pairing.miss > 0  # a node that handed its multiplier on has a partner
    beyond = lonely & np.isfinite(pairing.miss)
    lost = lonely & ~beyond
    m = len(pairing.paired)
    if beyond.any():
        lines.append(_say_beyond(pairing, secondary, primary, beyond, method, follows))
    if not pairing.paired.any():
        lines.append(
            f"None of the {m} points of surface {secondary.label!r} finds a partner on "
            f"{primary.label!r}" + _say_why(secondary, primary)
        )
    elif lost.any():
        worst = int(np.flatnonzero(lost)[0])
        lines.append(
            f"{np.count_nonzero(lost)} of {m} points of surface {secondary.label!r} find nothing "
            f"of {primary.label!r} that faces them within reach; the first is point {worst} at "
            f"{written(secondary.points[worst])}. {LATER if follows else NEVER}Fine where "
            "the surface curves away; else enlarge `reach`, or the primary surface."
        )
    if not isinstance(primary, ContactSurface) and pairing.paired.any():
        facing = np.einsum("md,md->m", pairing.normal, secondary.normals)[pairing.paired]
        if np.all(np.abs(facing) < FACING):
            lines.append(
                f"All points of surface {secondary.label!r} stand edgewise to {primary.label!r}: their "
                f"normals are at right angles to its own, {written(pairing.normal[0])}. Usually "
                "another side of the body was meant, or another normal of the obstacle."
            )
    if isinstance(primary, ContactSurface) and pairing.paired.any() and method == "node":
        coarse, fine = _facet_sizes(pairing, secondary, primary)
        if fine < FINER * coarse:
            lines.append(
                f"The primary surface {primary.label!r} is finer than the secondary one, "
                f"{secondary.label!r}: facets of {fine:.3g} against {coarse:.3g}. Nodes of the "
                "primary surface between those of the secondary one are not held; swap secondary "
                "and primary, "
                'or use method="mortar".'
            )
    return lines


def say_stiffer(pairing: Pairing, secondary: ContactSurface, primary: Any, method: str) -> list[str]:
    """Say that the secondary side is much the stiffer one, where nothing speaks against a swap.

    Node by node the finer side is the better secondary, whatever the stiffness: advice to swap two
    sides is never followed by advice to swap them back.
    """
    if not isinstance(primary, ContactSurface) or not pairing.paired.any():
        return []
    mine, met = _facet_sizes(pairing, secondary, primary)
    ratio = _stiffness(secondary) / _stiffness(primary)
    if ratio <= STIFFER or (method == "node" and mine < FINER * met):
        return []
    return [
        f"the secondary side is {ratio:.3g} times stiffer than the primary (by the diagonal of K at "
        "the surface); the softer side is the better secondary: swap secondary and primary"
    ]


def _stiffness(surface: ContactSurface) -> float:
    return float(np.median(surface.body.K.diagonal()[surface.dofs]))


def _swap_is_good(pairing: Pairing, secondary: ContactSurface, primary: Any, method: str) -> bool:
    """Return whether the two sides could be swapped without the advice to swap them back."""
    if not isinstance(primary, ContactSurface) or not pairing.paired.any():
        return isinstance(primary, ContactSurface)
    mine, met = _facet_sizes(pairing, secondary, primary)
    if method == "node" and (mine < FINER * met or met < FINER * mine):
        return bool(met < mine)
    return _stiffness(primary) <= STIFFER * _stiffness(secondary)


def say_wrong_side(pairing: Pairing, secondary: ContactSurface, primary: Any) -> str:
    """Say that all points look away from a rigid obstacle; empty if that is not so.

    A plane takes every point, whichever way it looks. If all look along its normal, the body lies
    where the plane is solid: a small gap is then taken for a small overlap, and pressing the body on
    would lift it off, so that nothing later shows the mistake.
    """
    facing = np.einsum("md,md->m", pairing.normal, secondary.normals)
    if not pairing.paired.any() or np.any(facing[pairing.paired] < FACING):
        return ""
    return (
        f"All {np.count_nonzero(pairing.paired)} points of surface {secondary.label!r} that "
        f"{primary.label!r} takes look away from it: both have the normal "
        f"{written(pairing.normal[int(np.argmax(pairing.paired))])}. The normal of an obstacle points "
        "out of it, towards the body; reverse it, or take the other side of the body."
    )


def look_alike(secondary: ContactSurface, primary: Any) -> bool:
    """Return whether all of one side looks where the other does, so that no slide makes them meet."""
    if not isinstance(primary, ContactSurface):
        return False  # obstacles may turn
    means = [side.facet_normals.mean(axis=0) for side in (secondary, primary)]
    lengths = [float(np.linalg.norm(mean)) for mean in means]
    if min(lengths) < np.cos(ALIKE):
        return False  # they look everywhere: the normals of a whole outline cancel
    axes = [mean / length for mean, length in zip(means, lengths, strict=True)]
    spread = [
        float(angle_between(side.facet_normals, axis).max())
        for side, axis in zip((secondary, primary), axes, strict=True)
    ]
    return float(angle_between(*axes)) + sum(spread) < ALIKE


def _say_beyond(
    pairing: Pairing,
    secondary: ContactSurface,
    primary: Any,
    beyond: np.ndarray,
    method: str,
    follows: bool,
) -> str:
    worst = int(np.argmax(np.where(beyond, pairing.miss, -1.0)))
    miss = pairing.miss[worst]
    facets = ""
    if isinstance(primary, ContactSurface):
        facets = f" ({miss / primary.lengths[pairing.facet[worst]]:.2g} facet lengths)"
    return (
        f"{np.count_nonzero(beyond)} of {len(beyond)} points of surface {secondary.label!r} "
        f"project outside surface {primary.label!r}; the farthest, point {worst} at "
        f"{written(secondary.points[worst])}, misses by {miss:.3g}{facets}. "
        + (LATER if follows else NEVER)
        + f"If they should{' from the start' if follows else ''}: the primary surface may be too short"
        + (
            ", or the two are swapped; enlarge it, or swap secondary and primary."
            if _swap_is_good(pairing, secondary, primary, method)
            else "; enlarge it."
        )
    )


def _say_why(secondary: ContactSurface, primary: Any) -> str:
    if not isinstance(primary, ContactSurface):
        if getattr(primary, "outline", None) is not None and secondary.dim == 2:
            return "; see its position, and which way round its points run: it is solid on their left."
        return "; see its position, the side it is on, `hollow`, and `reach`."
    middle = primary.points[primary.facets].mean(axis=1)
    facet = np.asarray(Tree(middle).query(secondary.points)[1])
    nearest = float(np.min(Tree(np.vstack([middle, primary.points])).distances(secondary.points)))
    facing = np.einsum("md,md->m", secondary.normals, primary.facet_normals[facet])
    height = np.einsum("md,md->m", secondary.points - middle[facet], primary.facet_normals[facet])
    usually = "Usually one or both are on the wrong side of their body: check the two `where`."
    if np.median(facing) >= -FACING:
        how = "face the same way" if np.median(facing) > FACING else "do not face each other"
        return (
            f": the two {how} (normals {written(secondary.normals[0])} and "
            f"{written(primary.facet_normals[facet[0]])} where they are close). {usually}"
        )
    if np.median(height) < 0:
        two = secondary.body is not primary.body
        overlap = " Or the two meshes overlap: check their positions." if two else ""
        return (
            ": the two look away from each other. The points lie behind the primary surface, on the "
            f"side of its body, {nearest:.3g} away at least; overlaps are looked for up to `reach`, by "
            f"default half the diagonal of the smaller surface. {usually}"
        ) + overlap
    return (
        f": the closest point is {nearest:.3g} away. Check the units and positions of the "
        "two meshes, and `reach`."
    )


def _facet_sizes(
    pairing: Pairing, secondary: ContactSurface, primary: ContactSurface
) -> tuple[float, float]:
    """Median lengths of the secondary facets with a partner, and of the primary ones they meet."""
    both = pairing.paired[secondary.facets[:, :2]].all(axis=1)
    mine = secondary.lengths[both] if both.any() else secondary.lengths
    met = primary.lengths[pairing.facet[pairing.paired]]
    return float(np.median(mine)), float(np.median(met))
