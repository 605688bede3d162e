r"""Is the model valid here? What an answer says of the assumptions it was made with.

The certificate says how well the discrete problem is solved, the estimate how fine the mesh is. This
says whether the *model* holds at the answer: small sliding, contact conditions that see every overlap,
linear bodies. The bounds stand below, each with what it lets through, and on the page
docs/validity.md. Every step looks for signs at nearly no cost; what it suspects is measured as it is
when somebody asks (`assess`).

Small sliding keeps the partner, the frame and the gap of the undeformed bodies. With the slip ``s`` of
a point, the curvature ``k`` of the other side and the width ``w`` of the contact, that lets through

* forces that act by ``s`` beside their place: the share ``s/w`` of the contact, which is less than the
  mesh resolves below one facet;
* normals off by ``k s``, and so the directions of forces;
* gaps off by ``k s^2 / 2``, or what the true distance to a rigid obstacle at its place says, against
  the approach that the bodies take up elastically;
* points that press where the other surface has ended;
* friction along the chord to where a rigid obstacle has turned a point of it, where what passes under a
  point of contact goes along the arc.

Linear bodies let through errors of the order of their strains and rotations. All of this is told from
what a load step knows: gaps, slips, forces and prescribed displacements; vectors of the size of the
contact, no displacement of the interior, no search (`track`). What is not known is estimated: without
friction the way along the surface is that of the supports, as a rigid motion. `assess` measures the
rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np

from skfem_contact.arguments import NamesAttributes
from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.selection import written
from skfem_contact.conditions.contact import Contact
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.records import dataclass

#: What may be off without a word, relative to what it is a part of, so that forces are 10 % off: slip
#: over the width of the contact, where that is more than a facet (moments); the angle between the
#: normal that is used and the true one [rad]; the error of gaps over the elastic approach of bodies;
#: force of points beyond the end of the primary over that of the contact; strain or rotation, of which
#: linear elasticity leaves out the square; what moments of second order change of a tool's motion; its
#: contact force over the sum of the parts, from which on it has a direction; what friction by stress on
#: the deformed area differs from that on the area before.
A_TENTH = 0.1

#: Slip over a facet of the primary: below one the mesh does not resolve where a force acts.
FACETS = 1.0

#: Height of curves over one facet, over the elastic approach: forces are up to 15 % off by mortar and
#: 23 % node by node, half of that in general (`chords`); on balls, by 21 % with either.
SAGITTA = 0.2

#: Overlap beyond what chords explain, over the elastic approach: contact conditions hold at the
#: points of one side, between them unlike meshes overlap by a part of what they are pressed in. At the
#: end of a wedge that is driven in it is 0.28, whatever the mesh, with forces that are right to 1e-3.
OVERLAP = 0.35

#: Share of the energy that an average of the change of volume over neighbouring elements takes away:
#: forces are 9 % too large. Second-order elements have up to .05 where four of them meet a contact.
LOCKED = 0.08


#: What has been warned of in a history: kind, and name of the contact or body. Or what
#: has been seen, of whom, and the doublings of the approach at which whole bodies were looked at.
Issued = frozenset[tuple[str, str]]
#: The kinds that are bounds of the model. Others are said once in a history as well, and are none:
#: places that nothing decides, overlaps that supports prescribe.
BOUNDS = (
    "displacement",
    "facets",
    "locking",
    "overlap",
    "rotation",
    "second order",
    "sliding",
    "strain",
)


@dataclass(frozen=True)
class Drift:
    """The drift of one contact at an answer; largest values over its closed points.

    Attributes
    ----------
    closed : int
        Closed points.
    slip : float
        Since the undeformed state; that of a rigid obstacle's spin is the length of the arc [length].
    facets : float
        Slip over the length of the primary facet; 0 for obstacles, which have no mesh.
    widths : float
        Slip over the width of the contact.
    tilt : float
        Angle between the normals that are used and those where the points are [rad].
    gap_error : float
        By how much the gaps of small sliding are wrong; at rigid obstacles also overlaps of open
        points [length].
    gap_share : float
        That over the elastic approach.
    beyond : int
        Closed points that lie, with all of their share of the surface, beyond the end of the primary.
    overhang : float
        By how much the farthest of them does [length].
    beyond_share : float
        Normal force that acts beyond the end over that of the contact, points counted by the part of
        their share of the surface that has slid past it.
    motion : float
        By how much a rigid obstacle has moved where points are closed [length].
    off_arc : float
        How far the chords along which a rigid obstacle turns under points are off their arcs, over the
        arcs, the mean over the normal forces; with friction.
    stretch_share : float
        Moment of a rigid body that stretches what is glued to it as it turns, over that of all.
    approach : float
        What the bodies take up elastically between their supports and the contact; zero where that is
        round-off of their places [length].
    strain : float
        The approach over the extent of the bodies, or the mean pressure over the modulus: a sign of
        the strain of the bodies, which `Validity.strain` measures.
    sagitta : float
        Height of the curves over one facet, the mean over the normal forces (`chords`) [length].
    by_force : bool
        No support holds the body against a rigid obstacle: its force is that of the loads, however few
        facets carry it.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> drift = result.validity.contacts["foot"].drift
    >>> (
    ...     bool(drift.widths < 0.1),
    ...     drift.beyond,
    ... )  # slip over the width of the contact, points past the end
    (True, 0)
    """

    closed: int = 0
    slip: float = 0.0
    facets: float = 0.0
    widths: float = 0.0
    tilt: float = 0.0
    gap_error: float = 0.0
    gap_share: float = 0.0
    beyond: int = 0
    overhang: float = 0.0
    beyond_share: float = 0.0
    motion: float = 0.0
    off_arc: float = 0.0
    stretch_share: float = 0.0
    approach: float = 0.0
    strain: float = 0.0
    sagitta: float = 0.0
    by_force: bool = False

    @property
    def sagitta_share(self) -> float:
        """The height of the curves over one facet, over the elastic approach.

        Zero where the approach is none: nothing presses, whatever touches.
        """
        return self.sagitta / self.approach if self.approach > 0 else 0.0

    @property
    def facets_too_long(self) -> bool:
        """Return whether contact ends within the facets, so that their chords are not the curves."""
        return self.sagitta_share > self.sagitta_bound

    @property
    def sagitta_bound(self) -> float:
        """Up to which share forces are right; where these are given, up to which pressures spread."""
        return 1.0 if self.by_force else SAGITTA

    @property
    def slides_far(self) -> bool:
        """Return whether points have left the facets and the zone that they are held against."""
        return self.facets > FACETS and self.widths > A_TENTH

    @property
    def worst(self) -> float:
        """The largest number of small sliding over its bound."""
        past = self.beyond_share if self.beyond else 0.0
        off = max(self.tilt, self.off_arc, self.stretch_share, self.gap_share, past) / A_TENTH
        return max(min(self.facets / FACETS, self.widths / A_TENTH), off)

    @property
    def small_sliding_holds(self) -> bool:
        """Return whether small sliding is a good model at this answer."""
        return self.worst <= 1.0

    @property
    def passes_end(self) -> bool:
        """True if much of the force acts beyond the end; the mesh resolves whole shares of points."""
        return self.beyond > 0 and self.beyond_share > A_TENTH


@dataclass(frozen=True)
class Meeting:
    """The meeting of two sides, seen from outside.

    Attributes
    ----------
    overlap : float
        Deepest overlap, less gaps given by the user and with interferences [length].
    unseen : int
        Points of the secondary without a partner that overlap by more than chords explain.
    opening : float
        Largest true gap of a closed point [length].
    chords : float
        What straight facets on curved sides explain of the overlap [length].
    place : ndarray, shape (d,), or None
        Of the deepest point, where one boundary is in the other [length].
    side : int
        Whose point it is: 0 of the secondary, 1 of the primary.
    """

    overlap: float = np.nan
    unseen: int = 0
    opening: float = np.nan
    chords: float = 0.0
    place: Array | None = None
    side: int = 0


@dataclass(frozen=True)
class Crossing:
    """The deepest crossing of two edges, or the nearest one where they only touch.

    Attributes
    ----------
    count : int
        Pairs of edges that are too deep in each other; zero where they touch.
    depth : float
        [length]
    place : ndarray, shape (3,)
        [length]
    across : ndarray, shape (3,)
        Unit vector across both edges.
    """

    count: int
    depth: float
    place: Array
    across: Array


@dataclass(frozen=True)
class Diagnostics:
    """The bounds of the model at an answer, as a step has measured and suspects them.

    Attributes
    ----------
    drifts : tuple of Drift
        Of every contact.
    turns : dict
        Rotation of bodies as a whole, by name, as far as known: of surfaces that slide far, and of
        supports [rad].
    issued : frozenset
        What has been warned of in this history: kind, and name of the contact or body.
    tracks : tuple of Track
        Of every contact, for `validity`.
    intrusions : frozenset of int
        Numbers of contacts that slide far and seem to overlap beyond their bounds.
    undetected : dict
        What is to be said of obstacles that conditions do not see, by the contact's number.
    leaning : dict
        `Validity.second_order`.
    stretches : dict
        How far supports move against each other, over the extent of their body, by name.
    meetings : dict
        How deformed boundaries meet, as far as the step has measured it, by the contact's number.
    """

    drifts: tuple[Drift, ...] = ()
    turns: dict[str, float] = field(default_factory=dict)
    issued: Issued = frozenset()
    tracks: tuple[Any, ...] = ()
    intrusions: frozenset[int] = frozenset()
    undetected: dict[int, str] = field(default_factory=dict)
    leaning: dict[str, float] = field(default_factory=dict)
    stretches: dict[str, float] = field(default_factory=dict)
    meetings: dict[int, Meeting] = field(default_factory=dict)

    @property
    def beyond(self) -> list[tuple[str, str]]:
        """Bounds of the model that have been passed in this history: kind and name, sorted."""
        return sorted(key for key in self.issued if key[0] in BOUNDS)

    def prescribed(self, name: str) -> bool:
        """Return whether it was said that supports push the sides of a contact into each other."""
        return any(kind == "prescribed" and of.startswith(f"{name} ") for kind, of in self.issued)


@dataclass(frozen=True)
class ContactValidity(NamesAttributes):
    """The validity of the model of one contact at an answer.

    Attributes
    ----------
    drift : Drift
        How far points have drifted from where small sliding has them, with exact slips; of finite
        sliding, which follows, only the elastic approach and the strain.
    overlap : float
        Overlap of the deformed boundaries, or with the obstacle, where it is deepest beyond what chords
        explain, without the interference and the gaps given by the user; found by a search that knows
        nothing of the pairing [length]. NaN for two surfaces of one body, where inside and outside
        are the same.
    chords : float
        What straight facets on curved sides explain of it [length].
    unseen : int
        Points without a partner that overlap by more than that.
    opening : float
        Largest true gap of a closed point [length]; NaN for two surfaces of one body.
    angle : float
        Largest angle between the normals of the two sides at closed points [rad]: undeformed with
        small sliding, see `pairing.node.Pairing.tilt`; zero at obstacles.
    angle_over_mu : float
        That over the coefficient of friction: what the choice of one side's normal may change of the
        friction; NaN without a coefficient.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> measured = result.validity.contacts["foot"]
    >>> (
    ...     bool(measured.overlap < 1e-9),
    ...     bool(measured.opening < 1e-9),
    ... )  # of the deformed block and the floor
    (True, True)
    """

    drift: Drift
    overlap: float
    chords: float
    unseen: int
    opening: float
    angle: float
    angle_over_mu: float

    @property
    def excess(self) -> float:
        """Overlap beyond what chords explain, over what is allowed; at most one where all is well."""
        beyond = self.overlap - self.chords
        if not beyond > 0:
            return 0.0
        allowed = OVERLAP * self.drift.approach
        return beyond / allowed if allowed > 0 else np.inf


@dataclass(frozen=True, eq=False)
class Validity(NamesAttributes):
    """The validity of the model at an answer; `print` shows it, `problems` says what to change.

    Attributes
    ----------
    contacts : dict of ContactValidity
        By name.
    strain : dict of float
        Mean strain of every body by its energy: where most of it is strained.
    largest_strain : dict of float
        In any point of integration; at a sharp edge it has no bound.
    rotation : dict of float
        Root of the mean square of the rotation over every body [rad].
    problems : dict
        Sentences, by kind ("sliding", "overlap", "facets", "strain", "rotation", "displacement",
        "locking", "second order") and name of the contact or body.
    second_order : dict of float
        What the moments of second order that small sliding leaves out would change of the motion of
        rigid bodies that may turn, over that motion; and the moments that linear bodies leave out
        which turn and slide far, over what friction can hold.
    locking : dict of float
        Of bodies that are nearly incompressible, the share of the energy that neighbouring elements
        take back, see `locking`.
    before : tuple of (str, str)
        Kind and name of what this history has warned of before and what is within its bound now.
    displacement : dict of float
        What large displacements of every linear body would change of the contact forces, or of its
        own displacements, over the largest: zero where it hardly turns, NaN where it is not known.

    Examples
    --------
    A block dragged by three times its width, over a track that is long enough:

    >>> import numpy as np
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> import warnings
    >>> def square(x, y, **settings):
    ...     mesh = fem.MeshQuad.init_tensor(np.asarray(x), np.asarray(y)).with_defaults()
    ...     basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    ...     return sc.Body(basis, linear_elasticity(0.0, 0.5), **settings)
    >>> track = square(np.linspace(0, 5, 41), [-1, -0.5, 0], D="bottom", name="track")
    >>> block = square(np.linspace(0, 1, 9), [0, 0.5, 1], D="top", name="block")
    >>> move = block.basis.project(lambda x: np.stack([3 + 0 * x[0], -0.01 + 0 * x[0]]))
    >>> contact = sc.Contact(block.surface("bottom"), track.surface("top"), name="joint")
    >>> with warnings.catch_warnings():  # of small sliding
    ...     warnings.simplefilter("ignore", sc.ContactWarning)
    ...     result = sc.ContactSolver([block, track], [contact]).solve(x={"block": move})
    >>> result.converged, result.validity.holds
    (True, False)
    >>> drift = result.validity.contacts["joint"].drift
    >>> print(f"{drift.slip:.3g} is {drift.widths:.3g} widths of the contact")
    3 is 3 widths of the contact
    """

    contacts: dict[str, ContactValidity]
    strain: dict[str, float]
    largest_strain: dict[str, float]
    rotation: dict[str, float]
    problems: dict[tuple[str, str], str]
    second_order: dict[str, float] = field(default_factory=dict)
    locking: dict[str, float] = field(default_factory=dict)
    before: tuple[tuple[str, str], ...] = ()
    displacement: dict[str, float] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        """Return whether everything is within its bound."""
        return not self.problems

    @property
    def worst(self) -> float:
        """The largest number over its bound; up to one the model holds."""
        found = [0.0]
        for part in self.contacts.values():
            drift = part.drift
            found += [drift.worst, drift.sagitta_share / drift.sagitta_bound, part.excess]
        for shares in (self.strain, self.second_order, self.displacement):
            found += [share / A_TENTH for share in shares.values()]
        found += [turn / A_TENTH for name, turn in self.rotation.items() if turn > self.strain[name]]
        found += [share / LOCKED for share in self.locking.values()]
        return float(np.nanmax(found))

    def __str__(self) -> str:
        lines = []
        for name, part in self.contacts.items():
            lines += [f"  {name}: {line}" for line in _contact_lines(part)]
        for name, strain in self.strain.items():
            lines.append(
                f"  {name}: strain {strain:.2g} where its energy is, rotation "
                f"{self.rotation[name]:.2g} (up to {A_TENTH:g})"
            )
        displaced = {name: share for name, share in self.displacement.items() if share > 0}
        for words, shares, of_what, most in (
            ("large displacements change", displaced, "", A_TENTH),
            ("neighbouring elements take back", self.locking, " of the energy", LOCKED),
            ("moments of second order that are left out", self.second_order, "", A_TENTH),
        ):
            for name, share in shares.items():
                found = f"{100 * share:.2g} %{of_what} (up to {100 * most:g} %)"
                lines.append(f"  {name}: {words} {found}")
        return "\n".join(lines)


def _contact_lines(part: ContactValidity) -> list[str]:
    drift, words = part.drift, []
    if drift.slip:
        words.append(
            f"slip {drift.slip:.3g}, {drift.facets:.2g} facets and {drift.widths:.2g} widths "
            f"(up to {FACETS:g} or {A_TENTH:g})"
        )
        words.append(
            f"normals off by {drift.tilt:.2g} (up to {A_TENTH:g}), gaps by {100 * drift.gap_share:.2g} "
            f"% of the elastic approach (up to {100 * A_TENTH:g} %)"
        )
    if drift.off_arc:
        words.append(
            f"chords of the obstacle's turn {100 * drift.off_arc:.2g} % off their arcs (up to "
            f"{100 * A_TENTH:g} %)"
        )
    if drift.stretch_share:
        words.append(
            f"what a turn stretches is {100 * drift.stretch_share:.2g} % of the moment (up to "
            f"{100 * A_TENTH:g} %)"
        )
    if not np.isnan(part.overlap):
        unseen = f", {part.unseen} points without partner" if part.unseen else ""
        words.append(
            f"overlap {part.overlap:.3g}, of which chords explain {part.chords:.2g}{unseen}; elastic "
            f"approach {drift.approach:.3g}"
        )
    if drift.sagitta:
        words.append(
            f"over one facet curves stand {drift.sagitta:.2g} off each other, "
            f"{100 * drift.sagitta_share:.2g} % of the elastic approach "
            f"(up to {100 * drift.sagitta_bound:g} %)"
        )
    if part.angle_over_mu > 0:
        words.append(
            f"normals of the two sides differ by {part.angle:.2g}, {part.angle_over_mu:.2g} of mu"
        )
    return words


# -- sentences ----------------------------------------------------------------------------------------


def sliding_words(drift: Drift, turning: Sequence[str] = ()) -> str:
    """Say what small sliding does wrong, and what to do; with linear bodies that turn."""
    found = []
    if drift.slides_far:
        found.append(
            f"points have slid by up to {drift.slip:.3g}, {drift.facets:.3g} facets of the primary "
            f"and {drift.widths:.3g} times the width of the contact, and press where they began"
        )
    if drift.slides_far and drift.beyond:
        found.append(
            f"{drift.beyond} of {drift.closed} closed points lie beyond the end of the primary "
            f"surface, by up to {drift.overhang:.3g}"
        )
    if drift.passes_end:
        found.append(
            f"{100 * drift.beyond_share:.3g} % of the normal force acts beyond the end of the primary "
            f"surface (slip {drift.slip:.3g}, {drift.facets:.3g} facets)"
        )
    if drift.tilt > A_TENTH:
        found.append(f"normals are off by up to {drift.tilt:.3g} rad, and so are the forces")
    if drift.off_arc > A_TENTH:
        found.append(
            "the obstacle has turned, and slip, which is taken along the chord to where it has come, "
            f"is {100 * drift.off_arc:.3g} % off the arc that has passed under the points: friction "
            "points the wrong way"
        )
    if drift.stretch_share > A_TENTH:
        found.append(
            "the obstacle turns and stretches what is glued to it, which is "
            f"{100 * drift.stretch_share:.3g} % of its moment"
        )
    if drift.gap_share > A_TENTH:
        found.append(
            f"gaps are wrong by up to {drift.gap_error:.3g}, {100 * drift.gap_share:.3g} % of the "
            f"elastic approach of {drift.approach:.3g}, and forces by up to as much"
        )
    if drift.motion and not drift.slides_far:
        found.append(f"the obstacle has moved by {drift.motion:.3g}")
    out = "Give the contact sliding='finite'."
    if turning:
        names = ", ".join(map(repr, turning))
        out = (
            f"A linear body that turns, as {names} does, has wrong torques with sliding='finite' as "
            "well: take a NonlinearBody or a RigidBody in its place, and sliding='finite' in all of "
            "its contacts."
        )
    return (
        "small sliding, which keeps partners, normals and gaps of the undeformed bodies, does not "
        "follow: " + "; ".join(found) + f". {out}"
    )


def facet_words(drift: Drift, contact: Contact | None = None) -> str:
    """Say what long facets on curves do to a light contact, at an obstacle or not, and what to do."""
    share = f"{100 * drift.sagitta_share:.3g} % of the elastic approach of {drift.approach:.3g}"
    how_far = f"{drift.sagitta:.3g} off each other, {share}"
    if contact is not None and isinstance(contact.primary, Obstacle):
        pieces = contact.primary.outline is not None
        shorter = (
            f", and give {contact.primary.label!r} shorter straight pieces (STL)" if pieces else ""
        )
        return (
            f"over the length of one facet the two sides stand {how_far}: the "
            "contact is about as small as a facet, and what it carries depends on where the nodes are. "
            "Pressures are not resolved, and forces that follow from prescribed displacements, or the "
            f"way of a tool under a force, may be wrong by "
            f"{'a large factor' if drift.sagitta_share > 1 else 'tens of percent'}. Refine the surface "
            f"where it touches, to four nodes or more under the contact{shorter}."
        )
    # a body rests on one facet or on the next where it is pressed in by less than what they stand out
    several = "There may be several answers, one for each facet that can carry. "
    return (
        f"over the length of one facet the curves stand {how_far}: contact "
        "ends within the facets, and polygons meet elsewhere than curves do. Pressures there are not "
        "resolved, and forces that follow from prescribed displacements may be wrong by a large "
        f"factor. {several if drift.sagitta_share > 1 else ''}Refine both surfaces where they touch."
    )


def strain_words(name: str, strain: float, nonlinear: bool) -> str:
    """Say what equations of small strains do wrong, and what to do."""
    return (
        f"Body {name!r} is strained by about {strain:.2g} where most of its energy is. Its equations "
        f"are those of small strains: errors are of that order, {100 * strain:.0f} %. Check units, "
        f"load and modulus; large strains need {'a' if nonlinear else 'a NonlinearBody with a'} "
        "material of finite strain."
    )


def overlap_words(part: ContactValidity, contact: Contact, meeting: Meeting, way: str = "") -> str:
    """Say that bodies overlap where contact conditions do not see it, where, and what to do."""
    place = ""
    if meeting.place is not None:
        own, other = contact.secondary.label, contact.primary.label
        own, other = (own, other) if meeting.side == 0 else (other, own)
        place = f", at {written(meeting.place)}, where {own!r} lies in the body of {other!r}"
    lonely = f", {part.unseen} points without partner among them" if part.unseen else ""
    return (
        f"the deformed bodies overlap by up to {part.overlap:.3g}{place}{lonely}, where chords explain "
        f"{part.chords:.2g} and the bodies take up {part.drift.approach:.3g}. Contact conditions do "
        f"not see it. {way or _way_out(part, contact, meeting) + '.'}"
    )


def prescribed_words(part: ContactValidity) -> str:
    """Say that supports push bodies into each other."""
    return (
        f"the deformed bodies overlap by up to {part.overlap:.3g}: prescribed displacements push them "
        "into each other, where contact can do nothing. Change the supports, or take their points out "
        "of the contact."
    )


def _way_out(part: ContactValidity, contact: Contact, meeting: Meeting) -> str:
    """Return what to do about an overlap."""
    if contact.sliding == "finite":
        mortar = ", method='mortar'" if contact.method == "node" and not contact.rigid else ""
        return (
            f"Take smaller steps, a finer or quadratic mesh where the surfaces turn{mortar}, and see "
            "that both surfaces cover all that may touch"
        )
    if part.unseen:
        far = "Enlarge `reach`, or give" if contact.reach is not None else "Give"
        return f"{far} the contact sliding='finite'"
    if isinstance(contact.primary, Obstacle):
        finer = "Refine the surface, whose facets are too long for what presses between their nodes"
        if meeting.side == 0:
            return finer
        drawn = (
            f"Where the straight pieces of {contact.primary.label!r} stand for a curve (STL), give it"
        )
        return f"{drawn} shorter ones, four or more across the contact. Otherwise: {finer.lower()}"
    if part.drift.slip >= part.overlap:  # a slip goes no deeper than it is long
        return "Give the contact sliding='finite'"
    if contact.method == "node":
        return (
            "Nodes of the primary surface sink in between those of the secondary one where that is the "
            "coarser: swap the two, or take method='mortar'; and see that both surfaces cover all that "
            "may touch"
        )
    return "See that both surfaces cover all that may touch, and refine them where they do"


def rotation_words(name: str, angle: float) -> str:
    """Say that a body has turned further than linear elasticity follows, and what to do."""
    return (
        f"Body {name!r} has turned by {angle:.3g} rad ({np.degrees(angle):.3g} degrees), on the whole. "
        "Bodies are linear: their stiffness and loads do not turn with them, so a rotation is a strain "
        f"of {1 - np.cos(angle):.1g} to them, and contact forces, whose directions do turn, are off by "
        f"about {100 * angle:.0f} %. Sliding may be large, rotations of deformable bodies may not. "
        "Turn the rigid obstacle instead (motion=...), or rebuild the body in its turned position and "
        "continue there."
    )


def displacement_words(name: str, share: float) -> str:
    """Say that a slender body is stretched or straightened by its displacements, and what to do."""
    return (
        f"Body {name!r} is linear, and has the stiffness of its undeformed shape. Large displacements "
        f"would change contact forces or its displacements by about {100 * share:.2g} %: slender parts "
        "stretch as they bend, and arches and discs lose their height. Take a NonlinearBody, for "
        "metals of sc.materials.SaintVenantKirchhoff."
    )


def locking_words(name: str, body: Body, share: float) -> str:
    """Say that a body locks, why, and what to do; empty where it does not."""
    if share <= LOCKED:
        return ""
    assert body.moduli is not None
    ratio = body.moduli.quotient
    where = (
        f"{100 * share:.0f} % of its energy is in changes of volume that take turns from one element, "
        "or point of integration, to the next"
    )
    factor = f"about {1 / (1 - min(share, 0.99)):.2g} times too large, or more"
    if share == 1.0:
        where = "pressure and shear take turns from one element to the next, and no volume changes"
        factor = "twice to a hundred times too large"
    return (
        f"Body {name!r} locks: {where}. Its material, of a bulk modulus {ratio:.3g} times the shear "
        "modulus, hardly changes its volume, and elements of first order keep theirs by hardly moving: "
        f"the forces of prescribed displacements are {factor}. Take elements of second order, or "
        "hexahedra (quadrilaterals) with the part of the bulk modulus integrated at one point."
    )


def crossing_words(found: Crossing, secondary: str, primary: str) -> str:
    """Say which edges of solids cross where no row sees it, and what to change."""
    at = written(found.place)
    if found.count:
        return (
            f"{found.count} edges of {secondary!r} and {primary!r} cross inside each other, by up "
            f"to {found.depth:.3g} at {at}: no condition holds where edges meet between their nodes, "
            "and nothing presses there. Refine both sides at the edges, so that nodes come close to "
            "where they cross, or round the edges off by faces that turn by less than 45 degrees."
        )
    return (
        f"edges of {secondary!r} and {primary!r} meet at {at}, where forces act along normals "
        "of faces and not across both edges: their size and direction are wrong. Round the "
        "edges off by faces that turn by less than 45 degrees, or take method='mortar'."
    )
