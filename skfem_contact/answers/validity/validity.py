r"""Is the model valid here? What an answer says of the assumptions it was made with.

The certificate says how well the discrete problem is solved, the estimate how fine the mesh is. This
says whether the *model* holds at the answer: small sliding, contact conditions that see every overlap,
linear bodies. The bounds stand in `drift` and below, each with what it lets through, and on the page
docs/validity.md.

What is nearly free is looked at in every step (`watch`). Here the rest is measured, when somebody asks:
with the displacements of the interior, and by a search over whole deformed boundaries (`overlap`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.thresholds import (
    FACETS,
    GAP,
    LARGE,
    OVERLAP,
    SAGITTA,
    SECOND_ORDER,
    TILT,
    WIDTH,
)
from skfem_contact.answers.validity.drift import Drift, Track, tool_motion
from skfem_contact.answers.validity.hull import Hull, hull
from skfem_contact.answers.validity.intrusion import elastic_approach
from skfem_contact.answers.validity.lookout import Lookouts
from skfem_contact.answers.validity.meeting import Meeting, at_obstacle, between, sagitta, strains
from skfem_contact.answers.validity.overlap import Outline, outline
from skfem_contact.answers.validity.rotation import leaning_words, rotation_words
from skfem_contact.answers.validity.solids import looked_at, obstacle_drift
from skfem_contact.answers.validity.watch import facet_words, sliding_words, strain_words
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.lever import as_motion
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.errors import warn
from skfem_contact.obstacles.obstacle import Obstacle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ContactValidity:
    """Whether the model of one contact holds at an answer.

    Attributes
    ----------
    drift : Drift
        How far points have drifted from where small sliding has them, with exact slips; of finite
        sliding, which follows, only the elastic approach and the strain.
    overlap : float
        Deepest overlap of the deformed boundaries, or with the obstacle, beyond the interference and
        the gaps given by the user; found by a search that knows nothing of the pairing [length]. NaN
        for two surfaces of one body, where inside and outside are the same.
    chords : float
        What straight facets on curved sides explain of it [length].
    chord_gaps : float
        By how much gaps of closed points are off that node-to-segment contact measures to straight
        facets on a curved primary [length].
    unseen : int
        Points without a partner that overlap by more than that.
    opening : float
        Largest true gap of a closed point [length]; NaN for two surfaces of one body.
    angle : float
        Largest angle between the normals of the two sides at closed points [rad]: undeformed with
        small sliding, see `pairing.Pairing.tilt`; zero at obstacles.
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
    chord_gaps: float = 0.0

    @property
    def chord_share(self) -> float:
        """That error of gaps over the elastic approach."""
        approach = self.drift.approach
        return self.chord_gaps / approach if approach > 0 else 0.0

    @property
    def excess(self) -> float:
        """Overlap beyond what chords explain, over what is allowed; at most one where all is well."""
        beyond = self.overlap - self.chords
        if not beyond > 0:
            return 0.0
        allowed = OVERLAP * self.drift.approach
        return beyond / allowed if allowed > 0 else np.inf


@dataclass(frozen=True, eq=False)
class Validity:
    """Whether the model holds at an answer; `print` shows it, `problems` says what to change.

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
        Sentences, by kind ("sliding", "overlap", "facets", "chords", "strain", "rotation",
        "second order") and name of the contact or body.
    second_order : dict of float
        What the moments of second order that small sliding leaves out would change of the motion of
        rigid bodies that may turn, over that motion.

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

    @property
    def holds(self) -> bool:
        """Whether everything is within its bound."""
        return not self.problems

    @property
    def worst(self) -> float:
        """The largest number over its bound; up to one the model holds."""
        found = [0.0]
        for part in self.contacts.values():
            drift = part.drift
            found += [min(drift.facets / FACETS, drift.widths / WIDTH), drift.tilt / TILT]
            found += [drift.gap_share / GAP, drift.strain / LARGE, part.excess]
            found += [part.chord_share / GAP, drift.sagitta_share / SAGITTA]
        found += [strain / LARGE for strain in self.strain.values()]
        found += [rotation / LARGE for rotation in self.rotation.values()]
        found += [share / SECOND_ORDER for share in self.second_order.values()]
        return float(np.nanmax(found))

    def __str__(self) -> str:
        lines = []
        for name, part in self.contacts.items():
            lines += [f"  {name}: {line}" for line in _contact_lines(part)]
        for name, strain in self.strain.items():
            lines.append(
                f"  {name}: strain {strain:.2g} where its energy is, rotation "
                f"{self.rotation[name]:.2g} (up to {LARGE:g})"
            )
        for name, share in self.second_order.items():
            lines.append(
                f"  {name}: moments of second order would change its motion by {100 * share:.2g} % "
                f"(up to {100 * SECOND_ORDER:g} %)"
            )
        return "\n".join(lines)


def _contact_lines(part: ContactValidity) -> list[str]:
    drift, words = part.drift, []
    if drift.slip:
        words.append(
            f"slip {drift.slip:.3g}, {drift.facets:.2g} facets and {drift.widths:.2g} widths "
            f"(up to {FACETS:g} or {WIDTH:g})"
        )
        words.append(
            f"normals off by {drift.tilt:.2g} (up to {TILT:g}), gaps by {100 * drift.gap_share:.2g} % "
            f"of the elastic approach (up to {100 * GAP:g} %)"
        )
    if not np.isnan(part.overlap):
        unseen = f", {part.unseen} points without partner" if part.unseen else ""
        words.append(
            f"overlap {part.overlap:.3g}, of which chords explain {part.chords:.2g}{unseen}; elastic "
            f"approach {drift.approach:.3g}"
        )
    if part.chord_gaps:
        words.append(
            f"gaps to chords are off by {part.chord_gaps:.2g}, {100 * part.chord_share:.2g} % of the "
            f"elastic approach (up to {100 * GAP:g} %)"
        )
    if drift.sagitta:
        words.append(
            f"over one facet curves stand {drift.sagitta:.2g} off each other, "
            f"{100 * drift.sagitta_share:.2g} % of the elastic approach (up to {100 * SAGITTA:g} %)"
        )
    if part.angle_over_mu > 0:
        words.append(
            f"normals of the two sides differ by {part.angle:.2g}, {part.angle_over_mu:.2g} of mu"
        )
    return words


def assess(result: Answer) -> Validity:
    """Measure the validity of a result; needs the displacements of all bodies.

    Warns
    -----
    ContactWarning
        What is beyond its bound, unless its history has said so before.
    """
    system = result.system
    solids = {name: body for name, body in system.solids.items() if body.components > 1}
    found = {name: strains(body, result.displacement(body)) for name, body in solids.items()}
    outlines = {
        n: (outline if b.dim == 2 else hull)(b, result.displacement(b)) for n, b in solids.items()
    }
    contacts: dict[str, ContactValidity] = {}
    problems: dict[tuple[str, str], str] = {}
    for i, (contact, name) in enumerate(zip(result.contacts, result.names, strict=True)):
        if not result.watched.tracks:  # scalar fields, and solids
            break
        part = contacts[name] = _contact(result, i, outlines)
        label = f"Contact {name!r} ({contact.label}): "
        if not part.drift.small_sliding_holds:
            problems["sliding", name] = label + sliding_words(part.drift)
        elif part.excess > 1.0:  # small sliding that does not follow is the reason already
            problems["overlap", name] = label + _overlap_words(part, contact)
        elif (words := _unseen_words(result, i, part)) and not part.drift.facets_too_long:
            problems["overlap", name] = label + words
        if part.drift.facets_too_long:
            problems["facets", name] = label + facet_words(part.drift)
        if part.chord_share > GAP:
            problems["chords", name] = label + _chord_words(part)
        if part.drift.strain > LARGE:
            problems["strain", name] = label + strain_words(part.drift)
    strain, largest, rotation = ({n: f[k] for n, f in found.items()} for k in range(3))
    told = any(kind == "strain" for kind, _ in problems)
    for name in solids:
        if strain[name] > LARGE and not told:
            problems["strain", name] = (
                f"Body {name!r} is strained by {strain[name]:.2g} where most of its energy is. "
                "Bodies are linear: errors are of that order."
            )
    far = {name: turn for name, turn in rotation.items() if turn > LARGE}
    if far:
        problems |= {("rotation", name): rotation_words({name: turn}) for name, turn in far.items()}
    leaning = result.watched.leaning
    far = {name: share for name, share in leaning.items() if share > SECOND_ORDER}
    problems |= {("second order", name): leaning_words({name: share}) for name, share in far.items()}
    for key, text in problems.items():
        if result.converged and key not in result.watched.said:
            warn(text)
    return Validity(contacts, strain, largest, rotation, problems, dict(leaning))


def _unseen_words(result: Answer, i: int, part: ContactValidity) -> str:
    """What no row of the contact sees: corners of obstacles, vertices and edges of solids."""
    if i in result.watched.unseen:
        return result.watched.unseen[i]
    if i not in result.watched.standing:
        return ""
    lookouts = Lookouts(result.recover.model.geometry, lambda: np.arange(result.system.n))
    return lookouts.sure(i, result, part.drift)


def _contact(result: Answer, i: int, outlines: Mapping[str, Outline | Hull]) -> ContactValidity:
    contact, part, track = result.contacts[i], result.slices()[i], result.watched.tracks[i]
    closed = (result.state.status[part] != 0) & result.kin.paired[part]
    drift = result.watched.drifts[i]
    if contact.sliding == "small":
        slip = _slip(result, part, track)
        gap = result.gap[part]
        force = result.state.normal_force[part]
        tool = tool_motion(result.system, contact, track, result.u)
        found = track.drift(closed, slip, gap, force, drift.approach, result.worn_case, i, part, tool)
        if looked_at(contact):
            answer = result.state, result.gap, result.worn_case, result.u, drift.approach
            found |= obstacle_drift(result.recover.model.geometry, i, *answer)
        drift = replace(drift, **found)
    else:
        drift = replace(drift, approach=max(drift.approach, elastic_approach(result, i, closed)))
    chord_gaps = float(np.max(track.chord[closed], initial=0.0))
    secondary = contact.secondary
    moved = secondary.points + result.displacement(secondary.body)[secondary.dofs]
    added = track.added - result.worn_case.interference[part]
    args = moved, added, closed, result.kin.paired[part]
    if isinstance(contact.primary, Obstacle):
        # the obstacle is exact: where facets are too long to meet it, nothing explains the overlap
        chords = sagitta(secondary, secondary.facet_node_normals)
        motion = result.case.motion[i].as_argument()
        if contact.rigid_body is not None:
            motion = as_motion(result.system, contact.rigid_body, result.u)
        obstacle = contact.primary.moved(motion)
        meeting = at_obstacle(obstacle, secondary, chords, *args)
    elif contact.primary.body is secondary.body:
        chords, meeting = 0.0, Meeting()
    else:
        names = [result.system.names[result.system.index(s.body)] for s in (secondary, contact.primary)]
        chords = sagitta(secondary, secondary.facet_node_normals)
        chords += sagitta(contact.primary, contact.primary.facet_node_normals)
        meeting = between(outlines[names[0]], outlines[names[1]], chords, result.system.extent, *args)
    angle = float(np.max(result.kin.tilt[part][closed], initial=0.0))
    mu = float(np.max(_coefficient(contact.friction)))
    share = angle / mu if mu > 0 else np.nan
    return ContactValidity(
        drift, meeting.overlap, chords, meeting.unseen, meeting.opening, angle, share, chord_gaps
    )


def _coefficient(law: FrictionLaw | None) -> Any:
    """The coefficient of friction that a tilt counts against, one or (m,); NaN without."""
    return law.smaller if isinstance(law, OrthotropicCoulomb) else getattr(law, "mu", np.nan)


def _slip(result: Answer, part: slice, track: Track) -> Array:
    """By the displacements: along the tangents (m,), in 3-D vectors (m, 3)."""
    t = result.kin.tangents
    slip = result.kin.B_t[part.start * t : part.stop * t] @ result.u
    if t == 1:
        return slip.ravel()
    return np.asarray(np.einsum("mk,mkd->md", slip.reshape(-1, t), result.kin.duals[part]))


def _chord_words(part: ContactValidity) -> str:
    return (
        f"gaps are measured to the straight facets of a curved surface, and so are off by up to "
        f"{part.chord_gaps:.3g}, {100 * part.chord_share:.3g} % of the elastic approach of "
        f"{part.drift.approach:.3g}; forces are off by as much. Take method='mortar', quadratic "
        "elements or a finer mesh, or give the gap that you know, gap=."
    )


def _overlap_words(part: ContactValidity, contact: Contact) -> str:
    lonely = f", {part.unseen} points without partner among them" if part.unseen else ""
    way = {
        "small": "Give the contact sliding='finite'"
        if part.unseen or not isinstance(contact.primary, Obstacle)
        else "Refine the surface, whose facets are too long for what presses between their nodes",
        "finite": "Take smaller steps, a finer or quadratic mesh where the surfaces turn, and see that "
        "both surfaces cover all that may touch",
    }[contact.sliding]
    return (
        f"the deformed bodies overlap by up to {part.overlap:.3g}{lonely}, where chords explain "
        f"{part.chords:.2g} and the bodies take up {part.drift.approach:.3g}: contact conditions do "
        f"not see it. {way}."
    )
