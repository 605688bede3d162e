"""`find_contacts`: which boundaries of an assembly may touch, as contacts that can be looked through.

What faces what comes from `facing`. Here it is put together: pairs of patches, the side that is to be
the secondary one, names, and what was near and not taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arguments import check_kind, number
from skfem_contact.assemblies.drafting import drafts, names_of, strange_bodies
from skfem_contact.assemblies.facing import Boundaries, look
from skfem_contact.assemblies.joints import Table
from skfem_contact.assemblies.thresholds import NEARLY
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.system import stack
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.errors import InputError
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.records import dataclass

Mask = NDArray[np.bool_]


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
