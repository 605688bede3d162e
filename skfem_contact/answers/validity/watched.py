"""What is known of the bounds of the model at an answer: measured in every step, kept with it."""

from __future__ import annotations

from dataclasses import dataclass, field

from skfem_contact.answers.validity.drift import Drift
from skfem_contact.answers.validity.standing import Standing
from skfem_contact.answers.validity.track import Track

#: What has been warned of in a history: kind, and name of the contact or body. Or what
#: has been seen, of whom, and the doublings of the approach at which whole bodies were looked at.
Said = frozenset[tuple[str, str]]
#: The kinds that are bounds of the model. Others are said once in a history as well, and are none:
#: places that nothing decides, overlaps that supports prescribe.
BOUNDS = ("facets", "locking", "overlap", "rotation", "second order", "sliding", "strain")


@dataclass(frozen=True)
class Intrusion:
    """The deepest overlap of one contact that slides far.

    Attributes
    ----------
    depth : float
        Less gaps and with interferences given by the user [length].
    at : tuple of float
        Where [length].
    surface, body : str
        Labels of the surface of the point, and of the one whose body it lies in.
    """

    depth: float
    at: tuple[float, ...]
    surface: str
    body: str


@dataclass(frozen=True)
class Watched:
    """What is known of the bounds of the model at an answer: what a step has measured and suspects.

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
    stretches : dict
        How far supports move against each other, over the extent of their body, by name.
    """

    drifts: tuple[Drift, ...] = ()
    turns: dict[str, float] = field(default_factory=dict)
    said: Said = frozenset()
    tracks: tuple[Track, ...] = ()
    intrusions: dict[int, Intrusion] = field(default_factory=dict)
    unseen: dict[int, str] = field(default_factory=dict)
    standing: dict[int, Standing] = field(default_factory=dict)
    leaning: dict[str, float] = field(default_factory=dict)
    stretches: dict[str, float] = field(default_factory=dict)

    @property
    def beyond(self) -> list[tuple[str, str]]:
        """Bounds of the model that have been passed in this history: kind and name, sorted."""
        return sorted(key for key in self.said if key[0] in BOUNDS)

    def prescribed(self, name: str) -> bool:
        """Whether it was said that supports push the sides of a contact into each other."""
        return any(kind == "prescribed" and of.startswith(f"{name} ") for kind, of in self.said)
