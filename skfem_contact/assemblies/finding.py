"""`find_contacts`: which boundaries of an assembly may touch, as contacts that can be looked through.

What faces what comes from `facing`. Here it is put together: pairs of patches, the side that is to be
the secondary one, names, and what was near and not taken.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cached_property
from itertools import combinations, compress
from typing import Any

import numpy as np

from skfem_contact.arguments import check_kind, number
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.assemblies.facing import NEARLY, Boundaries, Views, look
from skfem_contact.assemblies.joints import Table
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface, surface_on
from skfem_contact.bodies.system import stack
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.errors import InputError
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.pairing.closest import signed_distances
from skfem_contact.pairing.diagnosis import FINER, STIFFER
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

# A pair that covers less of both patches, and on one of them the rim alone, is a sliver.
SLIVER = 0.05

# Nodes of one body that are asked whether they lie in another: overlaps of bodies that are misplaced
# hold more than a few per cent of the nodes in the box of both.
ASKED = 200


@dataclass(frozen=True, eq=False)
class FoundContact:
    """One pair that was found, and what is known of it.

    Attributes
    ----------
    contact : Contact
    gap : tuple of float
        The least, the middle and the largest gap that was seen, < 0 where bodies overlap [length].
    area : float
        Of the facets that see the other side, of the smaller side [area].
    why : str
        Why the secondary side is the secondary one.
    remark : str
        "sliver": little of either patch, and at the rim of one, so that it is probably no pair;
        "uncertain": all gaps are larger than `within`, by less than chord heights leave open; "matching
        meshes": most nodes of one side are nodes of the other; or nothing.

    Examples
    --------
    Two squares, 0.1 apart:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> element, mesh = fem.ElementVector(fem.ElementQuad1()), fem.MeshQuad().refined(1).with_defaults()
    >>> low = sc.Body.from_mesh(mesh, element, linear_elasticity(), name="low")
    >>> high = sc.Body.from_mesh(mesh.translated((0, 1.1)), element, linear_elasticity(), name="high")
    >>> pair = sc.find_contacts([low, high], within=0.2).found[0]
    >>> [round(gap, 12) for gap in pair.gap], round(pair.area, 12), pair.why, pair.contact.primary.name
    ([0.1, 0.1, 0.1], 1.0, 'first', 'bottom')
    """

    contact: Contact
    gap: tuple[float, ...]
    area: float
    why: str
    remark: str


class FoundContacts(Table[Contact]):
    """Contacts that `find_contacts` has found: a sequence of `Contact`, by number or by name.

    ``print(pairs)`` shows them as a table, `plot_pairs` as a picture. It does not change: `drop`,
    `keep` and `change` return another one.

    Attributes
    ----------
    found : tuple of FoundContact
        Gaps, areas and reasons.
    names : tuple of str
    not_taken : tuple of str
        What was near and was not taken, and why; and bodies that overlap or repeat.

    Examples
    --------
    Three squares on each other:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> element, mesh = fem.ElementVector(fem.ElementQuad1()), fem.MeshQuad().refined(1)
    >>> bodies = [
    ...     sc.Body.from_mesh(mesh.translated((0, i)), element, linear_elasticity(), name=f"square {i}")
    ...     for i in range(3)
    ... ]
    >>> pairs = sc.find_contacts(bodies, within=0.1)
    >>> pairs.names, pairs.drop("square 0").names
    (('square 0 - square 1', 'square 1 - square 2'), ('square 1 - square 2',))
    >>> [contact.tied for contact in pairs.change("* - square 2", tied=True)]
    [False, True]
    """

    def __init__(self, found: Sequence[FoundContact], not_taken: Sequence[str]) -> None:
        rows = []
        for pair in found:
            contact, (least, _, most) = pair.contact, pair.gap
            sides = contact.secondary.label, contact.primary.label
            remarks = "; ".join(filter(None, [pair.remark, "tied" if contact.tied else ""]))
            area, gap = float(f"{pair.area:.4g}"), f"{least:.3g} .. {most:.3g}"
            rows.append((str(contact.name), *sides, area, gap, pair.why, remarks))
        heads = ("", "secondary", "primary", "area", "gap", "secondary because", "")
        super().__init__(heads, rows, [pair.contact for pair in found], "contacts")
        self.found, self.not_taken = tuple(found), tuple(not_taken)

    def _chosen(self, which: Sequence[str | Callable[[FoundContact], bool]]) -> Mask:
        """Whether each pair is meant: by its name, the name of a body, its remark, or a function."""
        chosen = np.zeros(len(self), dtype=bool)
        for one in which:
            mine = np.array([_means(one, pair) for pair in self.found], dtype=bool)
            if not (mine.any() or callable(one) or one in ("sliver", "uncertain", "matching meshes")):
                self.index_of(one)  # says which names there are
            chosen |= mine
        return chosen

    def drop(self, *which: str | Callable[[FoundContact], bool]) -> FoundContacts:
        """Return the list without some of its pairs.

        Parameters
        ----------
        *which : str or callable
            The name of a pair, a pattern of names such as ``"washer*"``, the name of a body, a remark
            (``"sliver"``), or a function of a `FoundContact`.

        Raises
        ------
        InputError
            If there is nothing of that name.
        """
        return FoundContacts([*compress(self.found, ~self._chosen(which))], self.not_taken)

    def keep(self, *which: str | Callable[[FoundContact], bool]) -> FoundContacts:
        """Return the list with some of its pairs alone, see `drop`."""
        return FoundContacts([*compress(self.found, self._chosen(which))], self.not_taken)

    def change(self, *which: str | Callable[[FoundContact], bool], **settings: Any) -> FoundContacts:
        """Return the list with other settings of some pairs, or of all: ``change("nut*", tied=True)``.

        Parameters
        ----------
        *which : str or callable
            See `drop`; all if not given.
        **settings
            Of `Contact`. ``tied=True`` takes the friction away, which glue has not.
        """
        if settings.get("tied"):
            settings = {"friction": None, **settings}
        chosen = self._chosen(which or (lambda pair: True,))
        changed = [
            replace(pair, contact=replace(pair.contact, **settings)) if mine else pair
            for pair, mine in zip(self.found, chosen, strict=True)
        ]
        return FoundContacts(changed, self.not_taken)

    def __repr__(self) -> str:
        return f"<FoundContacts: {len(self)} pairs, {len(self.not_taken)} not taken>"

    def __str__(self) -> str:
        missed = ["\n\nnear, and not taken:", *self.not_taken] if self.not_taken else [""]
        return super().__str__() + "\n  ".join(missed)


def _means(one: Any, pair: FoundContact) -> bool:
    if callable(one):
        return bool(one(pair))
    check_kind(one, str, "which pairs", "give a name, a pattern, 'sliver', or a function of a pair")
    names = [pair.contact.name, pair.contact.secondary.body.name, pair.contact.primary.body.name]  # type: ignore[union-attr]
    return one == pair.remark or any(fnmatchcase(str(name), one) for name in names)


def find_contacts(
    bodies: Sequence[Body | RigidBody],
    *,
    within: float,
    friction: FrictionLaw | Callable[[str, str], FrictionLaw | None] | None = None,
    tied: bool | Callable[[str, str], bool] = False,
    **settings: Any,
) -> FoundContacts:
    """Find the pairs of surfaces of an assembly that may touch.

    Two smooth patches are a pair where they face each other, with nothing in between, and the gap or
    the overlap is `within` a length somewhere. A patch ends where it turns by 45 degrees or more. The
    gap is that of the smooth boundaries: chord heights of coarse meshes are taken off.

    Parameters
    ----------
    bodies : sequence of Body
        With names. Rigid bodies are passed over: contacts with them are written by hand.
    within : float
        The largest gap, and the deepest overlap, of what is to be a pair [length].
    friction : FrictionLaw or callable, optional
        For all pairs, or a function of the names of two bodies.
    tied : bool or callable
        Whether pairs are glued; or a function of the names of two bodies.
    **settings
        More of `Contact`, for all pairs: ``adjust``, ``sliding``, ``method``, ...

    Returns
    -------
    FoundContacts
        A sequence of `Contact`: pass it to `ContactSolver` as it is.

    Raises
    ------
    InputError
        Bodies of different dimension, names given twice, a length that is none.

    Notes
    -----
    The surfaces of a pair are the facets that see each other, and those next to them on the primary
    side. They are named after boundaries of the mesh that hold them, or after their place. The
    secondary side is the finer one (facets less than 0.75 times as large), else the softer one (three
    times), else the smaller one, else that of the body named first. Parts of one body are pairs only if
    they do not hang together.

    Examples
    --------
    A plate on two blocks:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> def box(name, x0, x1, y0, y1):
    ...     mesh = fem.MeshQuad.init_tensor(np.linspace(x0, x1, 5), np.linspace(y0, y1, 3))
    ...     basis = fem.Basis(mesh.with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2)
    ...     return sc.Body(basis, linear_elasticity(), name=name)
    >>> blocks = [box("left", 0, 2, 0, 1), box("right", 8, 10, 0, 1)]
    >>> pairs = sc.find_contacts([*blocks, box("plate", 0, 10, 1, 2)], within=0.01)
    >>> print(pairs)
                  secondary  primary       area  gap     secondary because
    left - plate  left/top   plate/bottom  2     0 .. 0  finer
    right - plate  right/top  plate/bottom  2     0 .. 0  finer
    >>> pairs["left - plate"].secondary.label
    'left/top'
    """
    system = stack(bodies)
    unnamed = [name for name, body in zip(system.names, system.bodies, strict=True) if not body.name]
    if unnamed and len(system.bodies) > 1:
        words = "have no name, and pairs are named after bodies: give each its name"
        raise InputError(f"{', '.join(unnamed)} {words}, Body(..., name='plate')")
    length = number(within, "within", "give the largest gap of a pair, in units of the mesh")
    if not 0 < length < np.inf:
        raise InputError(f"within = {within} has to be a length > 0: the largest gap of a pair")
    bounds = Boundaries(list(system.solids.values()))
    pairs, missed = drafts(bounds, look(bounds, length), length)
    found = []
    for draft, name in zip(pairs, names_of(pairs), strict=True):
        first, why = draft.secondary()
        both = [side.name for side in draft.sides]
        glued = tied(*both) if callable(tied) else tied
        law = friction(*both) if callable(friction) else friction
        surfaces = [side.surface() for side in draft.sides]
        contact = Contact(
            surfaces[first], surfaces[1 - first],
            friction=None if glued else law, tied=bool(glued), name=name, **settings,
        )  # fmt: skip
        gap = tuple(float(f(draft.gaps)) for f in (np.min, np.median, np.max))
        area = min(side.area for side in draft.sides)
        found.append(FoundContact(contact, gap, area, why, draft.remark))
    rigid = [name for name in system.names if name not in system.solids]
    told = [f"{n!r} is rigid: write Contact(surface, {n!r}) for what it touches" for n in rigid]
    return FoundContacts(found, [*told, *strange_bodies(bounds, NEARLY * length), *missed])


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
