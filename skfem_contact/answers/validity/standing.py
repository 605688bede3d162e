r"""Where solids overlap and no row of the contact sees it: vertices and edges, after every step.

Conditions hold at the nodes of the secondary, or in the mean over its faces. A vertex of the primary
that stands in the middle of a face of the secondary, as the tip of a dome does or the corner of a box,
lies between the nodes, and a vertex of either side may leave the mean open. Two edges that cross each
other meet between the nodes of both. Both are looked for on the deformed surfaces:

* nodes of each side under faces of the other, by the closest point of the face;
* sharp edges of both sides that cross (`pairing.faces.edges`).

Who looks when, and what is too deep, is in `lookout`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.facets import area_vectors
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.faces.projection import project
from skfem_contact.pairing.thresholds import COINCIDENT
from skfem_contact.pairing.vectors import dot
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Standing:
    """The deepest overlap that no row sees.

    Attributes
    ----------
    count : int
        Vertices, or pairs of edges.
    depth : float
        Of the deepest [length].
    place : ndarray, shape (3,)
        Where it is [length].
    what : str
        "primary" or "secondary", whose vertices they are; "edges" that cross, or "touch"; "flank of
        primary" or "flank of secondary", a side that is in no contact; "unknown", nodes that may be in
        faces of the other side.
    across : ndarray, shape (3,), or None
        Unit vector across two edges.
    """

    count: int
    depth: float
    place: Array
    what: str
    across: Array | None = None

    def words(self, secondary: str, primary: str, method: str) -> str:
        """What was found, and what to change."""
        at, deep = written(self.place), f"{self.depth:.3g}"
        if self.what == "edges":
            return (
                f"{self.count} edges of {secondary!r} and {primary!r} cross inside each other, by up "
                f"to {deep} at {at}: no condition holds where edges meet between their nodes, and "
                "nothing presses there. Refine both sides at the edges, so that nodes come close to "
                "where they cross, or round the edges off by faces that turn by less than 45 degrees."
            )
        if self.what == "touch":
            return (
                f"edges of {secondary!r} and {primary!r} meet at {at}, where forces act along normals "
                "of faces and not across both edges: their size and direction are wrong. Round the "
                "edges off by faces that turn by less than 45 degrees, or take method='mortar'."
            )
        if self.what.startswith("flank"):
            own, other = secondary, primary
            if self.what.endswith("secondary"):
                own, other = other, own
            return (
                f"{self.count} nodes of {own!r} are in the body of {other!r}, behind sides of it that "
                f"do not belong to the contact, the deepest, at {at}, by {deep}: nothing holds them "
                "there. Take these sides into the surface, or make a second contact with them."
            )
        mean = "in the mean over faces" if method == "mortar" else "at the nodes of the secondary"
        own, other = (primary, secondary) if self.what == "primary" else (secondary, primary)
        way = "Refine the larger faces"
        if self.what == "primary":
            way = "Swap the two, so that these are nodes of the secondary, or refine the larger faces"
        elif method == "mortar":
            way += ", or take method='node', which holds each of them"
        return (
            f"{self.count} vertices of {own!r} stand in faces of {other!r}, the deepest, at {at}, by "
            f"{deep}: conditions hold {mean}, where this is not seen. {way}."
        )


class Nearby:
    """Nodes of one surface near the faces of another; searched again where they have moved.

    Parameters
    ----------
    other : ContactSurface
        With the faces.
    """

    def __init__(self, other: ContactSurface) -> None:
        self.corners = other.facets[:, : other.kind.corners]
        self.facets = other.facets
        x = other.points[other.facets]
        middle = x[:, : other.kind.corners].mean(axis=1, keepdims=True)
        # to the corners, and so much more that a node below one of them is found
        self.reach = 1.5 * np.linalg.norm(x - middle, axis=2).max(axis=1)
        self.slack = 0.1 * float(self.reach.min())
        # where both surfaces were, and which nodes were near which faces there
        self._found: tuple[Array, Array, Index, Index] | None = None

    def around(self, other: Array, own: Array) -> tuple[Index, Index]:
        """Pairs (node, face) of nodes near faces, by the places of all nodes of both, (m, 3)."""
        found = self._found
        if found is None or max(_farthest(other, found[0]), _farthest(own, found[1])) > self.slack:
            found = self._found = other, own, *self._search(other, own)
        return found[2:]

    def under(self, other: Array, own: Array, least: float) -> tuple[Index, Index]:
        """Those of the pairs `around` whose node is deeper than `least` under the plane of the face.

        What is curved or warped stands off its plane by a part of its size.
        """
        node, face = self.around(other, own)
        x = other[self.facets]
        middle = x[:, : self.corners.shape[1]].mean(axis=1)
        across = area_vectors(other[self.corners])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        highest = dot(x - middle[:, None], across[:, None]).max(axis=1)
        away = own[node] - middle[face]
        under = dot(away, across[face]) < highest[face] - least
        node, face = node[under], face[under]
        reached = np.linalg.norm(away[under], axis=1) <= self.reach[face]
        return node[reached], face[reached]

    def __getstate__(self) -> dict[str, object]:
        return {**vars(self), "_found": None}  # it is found again

    def _search(self, other: Array, own: Array) -> tuple[Index, Index]:
        x = other[self.facets]
        middle, reach = x[:, : self.corners.shape[1]].mean(axis=1), self.reach + 2 * self.slack
        low, high = middle.min(axis=0) - reach.max(), middle.max(axis=0) + reach.max()
        near = np.flatnonzero(((own >= low) & (own <= high)).all(axis=1))
        if not len(near):
            return near, near
        found = Tree(own[near]).query_ball_point(middle, reach)
        count = np.array([len(some) for some in found])
        node = near[np.concatenate([np.asarray(some, dtype=np.intp) for some in found])]
        return node, np.repeat(np.arange(len(middle)), count)


def standing_nodes(
    other: ContactSurface, own: ContactSurface, node: Index, face: Index, least: float
) -> tuple[Index, Index, Array]:
    """Nodes of one surface that lie in the body of the other, under a face that looks at them.

    Parameters
    ----------
    other, own : ContactSurface
        With the faces, and with the nodes.
    node, face : ndarray of int, shape (q,)
        Pairs to look at.
    least : float
        What is less deep need not be found [length].

    Returns
    -------
    node, face : ndarray of int, shape (p,)
        A node may lie under several faces; it is listed with the nearest.
    depth : ndarray, shape (p,)
        Distances from these faces, > 0 [length].
    """
    looks = dot(own.normals[node], other.facet_normals[face]) < 0
    node, face = node[looks], face[looks]
    if not len(node):
        return node, face, np.zeros(0)
    feet = project(other, face, own.points[node])
    depth = -dot(own.points[node] - feet.foot, feet.own)
    within = feet.over <= COINCIDENT * other.lengths[face]
    there = np.flatnonzero(within & (depth > least))
    order = there[np.lexsort((depth[there], node[there]))]
    first = np.r_[True, np.diff(node[order]) != 0] if len(order) else np.zeros(0, dtype=bool)
    order = order[first]
    return node[order], face[order], depth[order]


def falls_away(own: ContactSurface, node: Index, across: Array, by: float) -> Mask:
    """Nodes from which every face of their surface falls away by more than a length, (p,).

    Parameters
    ----------
    own : ContactSurface
        As it is meshed: faces that lie on the other side are deformed by the contact.
    node : ndarray of int, shape (p,)
    across : ndarray, shape (p, 3)
        Unit normals of what each is pressed on, towards the node.
    by : float
        [length]
    """
    found = np.zeros(len(node), dtype=bool)
    for k, (i, normal) in enumerate(zip(node, across, strict=True)):
        faces = own.facets[(own.facets == i).any(axis=1)]
        heights = (own.points[faces] - own.points[i]) @ normal
        found[k] = (heights.max(axis=1) > by).all()
    return found


def _farthest(points: Array, before: Array) -> float:
    return float(np.sqrt(np.max(np.sum((points - before) ** 2, axis=1), initial=0.0)))
