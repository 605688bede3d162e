"""From what facets see to pairs of surfaces: their facets, their names, and which side is secondary."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.assemblies.facing import Boundaries, Views
from skfem_contact.assemblies.thresholds import ASKED, NEARLY, SLIVER
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface, surface_on
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.pairing.closest import signed_distances
from skfem_contact.pairing.thresholds import FINER, STIFFER
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class Side:
    """One side of a pair: the facets of a boundary that see the other side, or are seen.

    Parameters
    ----------
    bounds : Boundaries
    facets : ndarray of int
        By their numbers among all boundaries; all of one patch.

    Attributes
    ----------
    whole : ContactSurface
        The boundary of the body.
    body : Body
    core : ndarray of int
        The facets, by their places in `whole`.
    patch : ndarray of bool
        All facets of the patch that these belong to.
    on_rim : bool
        Whether all of the core is on the rim of the patch.
    area, patch_area : float
        Of the core, and of the whole patch [area].
    size : float
        Of a facet in the middle of all by size [length].
    points : ndarray
        The nodes of the core.
    """

    def __init__(self, bounds: Boundaries, facets: Index) -> None:
        i = bounds.body[facets[0]]
        first, last = bounds.first[i], bounds.first[i + 1]
        whole = self.whole = bounds.surfaces[i]
        core = self.core = facets - first
        self.body, self.name = whole.body, whole.body.name or "body 1"
        self.patch = bounds.patch[first:last] == bounds.patch[facets[0]]
        self.on_rim = bool(bounds.rim[facets].all())
        self.area = float(whole.facet_areas[core].sum())
        self.patch_area = float(whole.facet_areas[self.patch].sum())
        self.size = float(np.median(whole.lengths[core]))
        self.points = whole.points[np.unique(whole.facets[core])]

    @cached_property
    def within(self) -> tuple[str, Mask]:
        """The smallest boundary of the mesh that holds all of the core, by its name and facets.

        Where none does it is all facets, and the name is where the middle of the core is.
        """
        whole, found = self.whole, []
        for name, numbers in (self.body.basis.mesh.boundaries or {}).items():
            there = np.isin(whole.mesh_facets, np.asarray(numbers))
            if there[self.core].all() and not name.startswith("gmsh:"):
                found.append((name, there))
        if found:
            return min(found, key=lambda one: int(one[1].sum()))
        area = whole.facet_areas[self.core]
        centre = area @ whole.points[whole.facets[self.core]].mean(axis=1) / area.sum()
        # three digits of the size of the body
        digits = 3 - int(np.floor(np.log10(np.ptp(whole.points, axis=0).max())))
        return "at " + written(np.round(centre, digits) + 0.0), np.full(len(self.patch), True)

    def surface(self) -> ContactSurface:
        """The core and the facets next to it on its patch, within the boundary that names it."""
        near = np.zeros(len(self.whole.points), dtype=bool)
        near[self.whole.facets[self.core]] = True
        name, there = self.within
        there = there & near[self.whole.facets].any(axis=1) & self.patch
        # the whole boundary has been checked
        return surface_on(self.body, self.whole.mesh_facets[there], name)


@dataclass(frozen=True, eq=False)
class Draft:
    """A pair of patches that face each other, the one of the body that was given first ahead.

    Attributes
    ----------
    sides : tuple of two Side
    gaps : ndarray, shape (n,)
        All that was seen between them, as far as it is taken [length].
    uncertain : bool
        Whether all gaps are too large, by less than what chords leave unknown.
    """

    sides: tuple[Side, Side]
    gaps: Array
    uncertain: bool

    @property
    def remark(self) -> str:
        """Return what a user should know of it, in a word or two."""
        covered = max(side.area / side.patch_area for side in self.sides)
        if covered < SLIVER and any(side.on_rim for side in self.sides):
            return "sliver"
        # half of the nodes of one side are nodes of the other, too
        one, other = sorted((side.points for side in self.sides), key=len)
        near = Tree(other).distances(one) <= GIVEN * min(side.size for side in self.sides)
        matching = 2 * np.count_nonzero(near) > len(one)
        return "uncertain" if self.uncertain else "matching meshes" if matching else ""

    def secondary(self) -> tuple[int, str]:
        """Return which side is the better secondary one, and why."""
        one, other = self.sides
        for why, ratio, least in (
            ("finer", one.size / other.size, FINER),
            ("softer", _softness(one.body, other.body), 1 / STIFFER),
            ("smaller", one.patch_area / other.patch_area, FINER),
        ):
            if not least <= ratio <= 1 / least:
                return int(ratio > 1), why
        return 0, "first"


def _softness(one: Body, other: Body) -> float:
    """Shear modulus of one body over that of another, 1 where it is not known."""
    same = one.form is not None and one.form is other.form
    moduli = [] if same else [body.moduli for body in (one, other)]
    shears = [float(m.shear.mean()) for m in moduli if m is not None]
    return shears[0] / shears[1] if len(shears) == 2 and min(shears) > 0 else 1.0


def drafts(bounds: Boundaries, views: Views, within: float) -> tuple[list[Draft], list[str]]:
    """Return the pairs of patches that are near enough, and what is said of the others.

    Parameters
    ----------
    bounds : Boundaries
    views : Views
        Up to a larger distance.
    within : float
        The largest gap, and the deepest overlap [length].
    """
    mine, other = bounds.patch[views.facet], bounds.patch[views.seen]
    low, high = np.minimum(mine, other), np.maximum(mine, other)
    _, group = np.unique(low * (1 + high.max(initial=0)) + high, return_inverse=True)
    order = np.argsort(group, kind="stable")
    stops = np.flatnonzero(np.diff(group[order])) + 1
    found, missed = [], []
    for rows in np.split(order, stops) if len(order) else []:
        gap, slack = views.gap[rows], views.slack[rows]
        near = np.abs(gap) <= within + slack
        some = rows[near] if near.any() else rows
        ends = np.concatenate([views.facet[some], views.seen[some]])
        ahead = np.concatenate([mine[some] == low[some[0]], other[some] == low[some[0]]])
        sides = Side(bounds, np.unique(ends[ahead])), Side(bounds, np.unique(ends[~ahead]))
        if near.any():
            scale = COMPUTED * max(float(np.abs(side.whole.points).max()) for side in sides)
            gaps = np.where(np.abs(gap[near]) <= scale, 0.0, gap[near])
            found.append(Draft(sides, gaps, bool(np.all(np.abs(gaps) > within + scale))))
            continue
        least = float(gap[np.argmin(np.abs(gap))])
        if abs(least) > NEARLY * within:
            continue
        both = " and ".join(f"{side.name}/{side.within[0]}" for side in sides)
        apart = f"overlap by {-least:.3g}" if least < 0 else f"{least:.3g} apart"
        missed.append(f"{both}: {apart}, within is {within:.3g}")
    found.sort(key=lambda draft: [bounds.surfaces.index(side.whole) for side in draft.sides])
    return found, missed


def names_of(pairs: Sequence[Draft]) -> list[str]:
    """Names of pairs: after their bodies, and where these have several pairs after places on the first.

    Which side is secondary has no part in it: that may change with the mesh.
    """
    names = [" - ".join(side.name for side in pair.sides) for pair in pairs]
    places = [[side.within[0] for side in pair.sides] for pair in pairs]
    for more in ([p[0] for p in places], [f"to {p[1]}" for p in places], range(len(pairs))):
        count = Counter(names)
        names = [f"{n}, {m}" if count[n] > 1 else n for n, m in zip(names, more, strict=True)]
    return names


def strange_bodies(bounds: Boundaries, within: float) -> list[str]:
    """Sentences on bodies that are there twice, and on those that overlap more than a pair may."""
    lines = []
    for (i, one), (j, other) in combinations(enumerate(bounds.surfaces), 2):
        low, high = np.maximum(*bounds.low[[i, j]]), np.minimum(*bounds.high[[i, j]])
        if np.any(high - low <= within):
            continue
        both = f"{one.body.name!r} and {other.body.name!r}"
        same = len(one.points) == len(other.points)
        if same and Tree(one.points).distances(other.points).max() <= GIVEN * one.lengths.min():
            lines.append(f"{both} are the same mesh at the same place: leave one of them out")
            continue
        chords = sum(float(np.abs(bounds.middles.bulge[bounds.body == k]).max()) for k in (i, j))
        depths = [_depth(*pair, low, high) for pair in ((one, other), (other, one))]
        depth, at = max(depths, key=lambda found: found[0])
        if depth > within + chords:
            lines.append(f"{both} overlap by {depth:.3g} at {written(at)}: check their positions")
    return lines


def _depth(one: ContactSurface, other: ContactSurface, low: Array, high: Array) -> tuple[float, Array]:
    """How deep nodes of one boundary are in another, and where; some of those in a box are asked."""
    inside = np.flatnonzero(np.all((one.points >= low) & (one.points <= high), axis=1))
    if not len(inside):
        return 0.0, low
    some = one.points[inside[:: max(len(inside) // ASKED, 1)]]
    distance = signed_distances(other, some)
    deepest = int(np.argmin(distance))
    return -float(distance[deepest]), some[deepest]
