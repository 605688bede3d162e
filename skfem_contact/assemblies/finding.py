r"""`find_contacts`: which boundaries of an assembly may touch, as contacts that can be looked through.

**Lines of sight**: every facet looks along its normal, outwards for what it may touch and inwards for
what it overlaps. Of all that a line of sight meets the nearest counts, whatever it is: what stands
behind something else, or behind the body's own material, is no partner. A partner looks back,
`OPPOSITE`.

Facets are chords of curved boundaries. How far the smooth boundary stands out at a place is known by
the normals n_k at the nodes x_k (half of the height of the tangents, exact on parabolas)::

    b(x) = 1/2 sum_k N_k (x_k - x) . n_k            gap = distance - b(x) - b(y)

so a shank in a bore of equal radius has no gap, however coarse the two meshes are.

**Pairs**: from these come pairs of patches, the side that is to be the secondary one, names, and what
was near and not taken.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cached_property
from itertools import combinations, compress
from typing import Any, NamedTuple

import numpy as np

from skfem_contact.arguments import check_kind, number
from skfem_contact.arrays import Array, Index, Mask, across, dot, ragged, sizes, unit
from skfem_contact.assemblies.joints import Table
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.facet_kinds import node_positions
from skfem_contact.bodies.selection import pieces as pieces_of
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
from skfem_contact.pairing.search import FacetTree, Nodes
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

# A pair that covers less of both patches, and on one of them the rim alone, is a sliver.
SLIVER = 0.05

# Nodes of one body that are asked whether they lie in another: overlaps of bodies that are misplaced
# hold more than a few per cent of the nodes in the box of both.
ASKED = 200

# Least cosine between a normal and the opposite of the other: half a right angle, beyond which two
# surfaces stand beside each other rather than opposite.
OPPOSITE = float(np.cos(np.pi / 4))

# Where a facet is asked beside its middle: this part of the way to its corners and the middles of its
# edges. There themselves lines of sight run along edges, and would find what lies beside.
TOWARDS_RIM = 0.85

# Which part of the chord heights of two facets a gap may be wrong by: a ball comes nearer between the
# places that are asked by .2 of a facet off, .16 of the height; at rims half of a height is missing.
UNSURE = 0.25

# What is farther apart than `within`, but not than this times it, is told as near and not taken.
NEARLY = 2.0


class Sights(NamedTuple):
    """Places on facets that look along normals.

    Attributes
    ----------
    at, normal : ndarray, shape (n, d)
    bulge : ndarray, shape (n,)
        How far the smooth boundary stands out of the facet there [length].
    of : ndarray of int, shape (n,)
        Facets, by the numbers of all boundaries.
    """

    at: Array
    normal: Array
    bulge: Array
    of: Index


class Boundaries:
    """The boundaries of all bodies: their facets one after the other, and the patches these make.

    A patch is what hangs together without a corner (`ContactSurface.sharp_edges`).

    Attributes
    ----------
    surfaces : list of ContactSurface
        The whole boundary of each body.
    first : ndarray of int, shape (number of bodies + 1,)
        Numbers of the facets with which they begin.
    body, piece, patch : ndarray of int, shape (nf,)
        Of each facet: the body, the connected part of the mesh, and the patch.
    rim : ndarray of bool, shape (nf,)
        Facets on the rim of their patch.
    lower, upper : ndarray, shape (nf, d)
        Boxes around the nodes of facets.
    low, high : ndarray, shape (number of bodies, d)
        Boxes around bodies.
    middles : Sights
        From the middle of each facet.
    """

    def __init__(self, bodies: Sequence[Body]) -> None:
        self.surfaces = [body.surface(None, name="boundary") for body in bodies]
        counts = [len(surface.facets) for surface in self.surfaces]
        self.first = np.concatenate([[0], np.cumsum(counts)])
        self.body = np.repeat(np.arange(len(counts)), counts)
        pieces, patches, rims, boxes = [], [], [], []
        for body, surface in zip(bodies, self.surfaces, strict=True):
            smooth = (surface.twins >= 0) & ~surface.sharp_edges
            joined = np.array([np.nonzero(smooth)[0], surface.neighbours[smooth]])
            patches.append(pieces_of(joined, len(smooth)))
            piece = pieces_of(surface.facets.T, len(surface.points))[surface.facets[:, 0]]
            if piece.any():  # around a hollow, or of another part
                mesh = body.basis.mesh
                piece = pieces_of(mesh.t, mesh.nvertices)[mesh.facets[0, surface.mesh_facets]]
            pieces.append(piece)
            rims.append(~smooth.all(axis=1))
            x = node_positions(surface.points, surface.facets)
            boxes.append((x.min(axis=1), x.max(axis=1)))
        self.piece, self.patch, self.rim = _apart(pieces), _apart(patches), np.concatenate(rims)
        self.lower, self.upper = map(np.concatenate, zip(*boxes, strict=True))
        self.low = np.minimum.reduceat(self.lower, self.first[:-1])
        self.high = np.maximum.reduceat(self.upper, self.first[:-1])
        self.middles = self.sights(self.body >= 0, rim=False)

    def by_surface(self, which: Mask) -> list[Index]:
        """Facets by their places in each surface, from a mask over all, (nf,)."""
        return [*map(np.flatnonzero, np.split(which, self.first[1:-1]))]

    def sights(self, which: Mask, rim: bool) -> Sights:
        """From the middles of some facets, or from places near their rim."""
        columns: list[tuple[Array, ...]] = []
        for surface, facets, first in zip(
            self.surfaces, self.by_surface(which), self.first, strict=False
        ):
            kind, d, xi = surface.kind, surface.dim, surface.kind.middle[None]
            if rim:
                ends = kind.locations[: kind.corners]
                edges = [(ends + np.roll(ends, 1, axis=0)) / 2] if d == 3 else []
                xi = xi + TOWARDS_RIM * (np.concatenate([ends, *edges]) - xi)
            N, dN = kind.shapes(xi)
            nodes = node_positions(surface.points, surface.facets[facets])
            at = np.einsum("qk,fkd->fqd", N, nodes)
            normal = unit(across(np.einsum("qki,fkd->fqid", dN, nodes)))
            bulge = np.zeros(len(facets) * len(xi))
            if not kind.quadratic:  # facets with middle nodes are the boundary themselves
                away = nodes[:, None] - at[:, :, None]
                smooth = _smooth_normals(surface, facets)
                bulge = 0.5 * np.einsum("qk,fqkd,fkd->fq", N, away, smooth).ravel()
            of = np.repeat(facets + first, len(xi))
            columns.append((at.reshape(-1, d), normal.reshape(-1, d), bulge, of))
        return Sights(*map(np.concatenate, zip(*columns, strict=True)))

    def near_others(self, reach: float) -> Mask:
        """Facets with a node in the box of another body, `reach` larger, (nf,)."""
        near = np.zeros(len(self.body), dtype=bool)
        low, high = self.low - reach, self.high + reach
        for i, mine in enumerate(map(slice, self.first[:-1], self.first[1:])):
            close = np.all((self.high[i] >= low) & (self.low[i] <= high), axis=1)
            # parts of one body may touch as well: then all of it is asked
            close[i] = np.ptp(self.piece[mine]) > 0
            for k in np.flatnonzero(close):
                inside = (self.upper[mine] >= low[k]) & (self.lower[mine] <= high[k])
                near[mine] |= np.all(inside, axis=1)
        return near


class Pieces:
    """Lines or triangles between the nodes of facets near others, (nf,), and a tree over these facets.

    Attributes
    ----------
    corners : ndarray, shape (n, d, d)
    normals : ndarray, shape (n, d, d)
        Of the smooth boundary at the corners.
    area : ndarray, shape (n, d)
        Their own outward normals, as long as their size.
    dual : ndarray, shape (n, d-1, d)
        ``dual @ (x - x_0)`` are the last barycentric coordinates of x.
    of : ndarray of int, shape (n,)
        The facets that they are parts of, by the numbers of all boundaries.
    first, count : ndarray of int, shape (facets of the tree,)
        The pieces of each facet of the tree.
    tree : FacetTree
    """

    def __init__(self, bounds: Boundaries, near: Mask) -> None:
        found: list[tuple[Array, ...]] = []
        for surface, some in zip(bounds.surfaces, bounds.by_surface(near), strict=True):
            kind, d, facets = surface.kind, surface.dim, surface.facets[some]
            pieces = np.array(kind.parts) if kind.dim == 1 else kind.cut
            corners = surface.points.take(facets[:, pieces], axis=0).reshape(-1, d, d)
            normals = _smooth_normals(surface, some).take(pieces, axis=1).reshape(-1, d, d)
            found.append((corners, normals, np.full(len(some), len(pieces))))
        self.corners, self.normals, self.count = map(np.concatenate, zip(*found, strict=True))
        edges = self.corners[:, 1:] - self.corners[:, :1]
        self.area = across(edges)
        self.dual = np.linalg.solve(edges @ edges.transpose(0, 2, 1), edges)
        self.of = np.repeat(np.flatnonzero(near), self.count)
        self.first = np.cumsum(self.count) - self.count
        self.tree = FacetTree.over(bounds.lower[near], bounds.upper[near])


def _apart(parts: list[Index]) -> Index:
    """Numbers of pieces of each surface, no two of them alike."""
    starts = np.cumsum([0, *(part.max() + 1 for part in parts)])
    return np.concatenate([part + start for part, start in zip(parts, starts, strict=False)])


def _smooth_normals(surface: ContactSurface, facets: Any) -> Array:
    """Normals of the smooth boundary at the nodes of facets, (n, k, d); their own beside a kink."""
    averaged = surface.facet_node_normals[facets]
    if not surface.kinks.any():
        return averaged
    kinked = surface.kinks[surface.facets[facets]] > 0
    own = surface.facet_normals[facets][:, None]
    return np.where(kinked[..., None], own, averaged)


class Views(NamedTuple):
    """What facets see: the nearest facet of all along each line of sight, where it looks back.

    Attributes
    ----------
    facet, seen : ndarray of int, shape (n,)
        By the numbers of all boundaries.
    gap : ndarray, shape (n,)
        Between the smooth boundaries; negative where they overlap [length].
    slack : ndarray, shape (n,)
        By how much the gap may be wrong [length].
    """

    facet: Index
    seen: Index
    gap: Array
    slack: Array


def look(bounds: Boundaries, within: float) -> Views:
    """Return what the facets of all bodies see of others, up to `NEARLY` times a distance both ways."""
    # distances of chords are larger than those of the boundary
    reach = NEARLY * within + 2 * float(np.abs(bounds.middles.bulge).max())
    near = bounds.near_others(reach)
    if not near.any():
        return Views(*(np.zeros(0, dtype=np.intp),) * 2, *(np.zeros(0),) * 2)
    pieces = Pieces(bounds, near)
    at, normal, bulge, of = bounds.middles
    some = Sights(at[near], normal[near], bulge[near], of[near])
    middles = _seen(bounds, some, pieces, reach)
    # where the middle sees nothing near, other places may
    near[middles.facet[np.abs(middles.gap) <= within]] = False
    others = _seen(bounds, bounds.sights(near, rim=True), pieces, reach)
    both: Any = zip(middles, others, strict=True)
    return Views(*map(np.concatenate, both))


def _seen(bounds: Boundaries, sights: Sights, pieces: Pieces, reach: float) -> Views:
    """Return what is nearest along each line of sight, either way."""
    scale = COMPUTED * max(float(np.abs(bounds.lower).max()), float(np.abs(bounds.upper).max()))

    def met(item: Index, nodes: Nodes) -> Mask:
        away = nodes.centre - sights.at.take(item, axis=0)
        normal = sights.normal.take(item, axis=0)
        along = dot(away, normal)
        aside = dot(away, away) - along**2
        limit = nodes.radius
        return np.asarray((np.abs(along) <= reach + limit) & (aside <= limit**2))

    found: list[tuple[Any, ...]] = [(np.zeros(0, dtype=np.intp),) * 2 + (np.zeros(0),) * 3]
    for item, facet in pieces.tree.descend(len(sights.of), met):
        count = pieces.count[facet]
        piece = ragged(pieces.first[facet], count)
        found.append(_crossings(sights, pieces, np.repeat(item, count), piece, reach))
    item, piece, distance, bulge, facing = (np.concatenate(c) for c in zip(*found, strict=True))
    mine, other = sights.of[item], pieces.of[piece]
    partner = (facing > OPPOSITE) & (bounds.piece[mine] != bounds.piece[other])
    far = np.where(np.abs(distance) <= scale, 0.0, np.abs(distance))

    def nearest(some: Index, *keys: Array) -> Index:
        order = some[np.lexsort((*(key[some] for key in keys), item[some]))]
        return np.asarray(order[np.append(True, np.diff(item[order]) > 0)[: len(order)]])

    # of what is equally near a partner comes first
    ways = distance >= -scale, distance <= scale
    ends = np.concatenate([nearest(np.flatnonzero(way), ~partner, far) for way in ways])
    # outward and inward: the nearer one
    best = nearest(ends[partner[ends]], np.abs(distance))
    own = sights.bulge[item[best]]
    slack = UNSURE * (np.abs(own) + np.abs(bulge[best])) + scale
    return Views(mine[best], other[best], distance[best] - own - bulge[best], slack)


def _crossings(
    sights: Sights, pieces: Pieces, item: Index, piece: Index, reach: float
) -> tuple[Any, ...]:
    """Lines of sight and the pieces that they cross, with distance, bulge and how these face."""
    apart = sights.of[item] != pieces.of[piece]
    item, piece = item[apart], piece[apart]
    # `take` gathers rows in a fraction of the time of an index
    at, normal = (part.take(item, axis=0) for part in (sights.at, sights.normal))
    tables = pieces.area, pieces.corners, pieces.dual
    area, corners, dual = (part.take(piece, axis=0) for part in tables)
    across_it = dot(area, normal)
    there = np.abs(across_it) > GIVEN * sizes(area)
    distance = dot(area, corners[:, 0] - at) / np.where(there, across_it, 1.0)
    place = at + distance[:, None] * normal
    rest = np.einsum("nij,nj->ni", dual, place - corners[:, 0])
    shape = np.column_stack([1 - rest.sum(axis=1), rest])
    there &= (shape.min(axis=1) >= -GIVEN) & (np.abs(distance) <= reach)
    some = np.flatnonzero(there)
    away = corners[some] - place[some][:, None]
    bulge = 0.5 * np.einsum("nk,nkd,nkd->n", shape[some], away, pieces.normals[piece[some]])
    facing = -across_it[some] / sizes(area[some])
    return item[some], piece[some], distance[some], bulge, facing


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
