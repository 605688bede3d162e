"""What is known of the bounds of the model at an answer: measured in every step, kept with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from skfem_contact.answers.thresholds import BULGE, CHORDS
from skfem_contact.answers.validity.drift import Drift
from skfem_contact.answers.validity.standing import Standing
from skfem_contact.answers.validity.track import Track
from skfem_contact.bodies.selection import written

#: What has been warned of in a history: kind, and name of the contact or body. Or "seen", with the
#: contact and the doublings of its approach at which a look with all displacements was taken.
Said = frozenset[tuple[str, str]]
#: The kinds that are bounds of the model. Others are said once in a history as well, and are none:
#: places that nothing decides, overlaps that supports prescribe.
BOUNDS = ("facets", "overlap", "rotation", "second order", "sliding", "strain")


@dataclass(frozen=True)
class Intrusion:
    """The deepest overlap of one contact.

    Attributes
    ----------
    depth : float
        Less gaps and with interferences given by the user [length].
    at : tuple of float
        Where [length].
    surface, body : str
        Labels of the surface of the point, and of the one whose body it lies in.
    chords, bulge : float
        Sagitta of straight facets on curved sides; what the largest nodal force presses in [length].
    left : float
        What the pairing may be off in this step, or what hardly changes the forces [length].
    """

    depth: float
    at: tuple[float, ...]
    surface: str
    body: str
    chords: float
    bulge: float
    left: float

    @property
    def explained(self) -> float:
        """Beyond this the overlap is warned of [length]."""
        return max(CHORDS * self.chords, BULGE * self.bulge, self.left)

    @property
    def excessive(self) -> bool:
        """Whether it is to be warned of."""
        return self.depth > self.explained

    def words(self, reasons: Sequence[str]) -> str:
        """What was found, and what to change."""
        way = " ".join(reasons) or (
            "Take smaller steps, or finer facets (quadratic elements) where the surfaces turn, and "
            "take all sides that may touch into the surfaces."
        )
        return (
            f"the deformed bodies overlap by {self.depth:.3g} at {written(np.array(self.at))}, where "
            f"{self.surface!r} lies in the body of {self.body!r}; straight facets and the give between "
            f"points explain {self.explained:.2g}. Contact conditions do not see it. {way}"
        )


@dataclass(frozen=True)
class Watched:
    """What is known of the bounds of the model at an answer.

    Attributes
    ----------
    drifts : tuple of Drift
        Of every contact.
    turns : dict
        Rotation of bodies as a whole, by name, as far as known: of surfaces that slide far, and of
        supports [rad].
    said : frozenset
        What has been warned of in this history: kind, and name of the contact or body.
    tracks : tuple of Track
        Of every contact, for `validity`.
    intrusions : dict
        Overlaps of contacts that slide far that seem to be beyond their bounds, by the contact's
        number.
    unseen : dict
        What is to be said of corners of obstacles that stand between nodes, by the contact's number.
    standing : dict
        Vertices and edges of solids that seem to overlap where no row sees it, by the contact's number.
    leaning : dict
        What moments of second order change of the motion of rigid bodies, over that motion, by name.
    """

    drifts: tuple[Drift, ...] = ()
    turns: dict[str, float] = field(default_factory=dict)
    said: Said = frozenset()
    tracks: tuple[Track, ...] = ()
    intrusions: dict[int, Intrusion] = field(default_factory=dict)
    unseen: dict[int, str] = field(default_factory=dict)
    standing: dict[int, Standing] = field(default_factory=dict)
    leaning: dict[str, float] = field(default_factory=dict)

    @property
    def beyond(self) -> list[tuple[str, str]]:
        """Bounds of the model that have been passed in this history: kind and name, sorted."""
        return sorted(key for key in self.said if key[0] in BOUNDS)
