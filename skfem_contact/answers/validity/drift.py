r"""How far contact has drifted from where ``sliding="small"`` takes it: what costs nearly nothing.

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

from dataclasses import dataclass

from skfem_contact.answers.thresholds import BEYOND, FACETS, GAP, SAGITTA, TILT, WIDTH


@dataclass(frozen=True)
class Drift:
    """How far one contact has drifted at an answer; largest values over its closed points.

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
    approach : float
        What the bodies take up elastically between their supports and the contact; zero where that is
        round-off of their places [length].
    strain : float
        The approach over the extent of the bodies, or the mean pressure over the modulus: a sign of
        the strain of the bodies, which `Validity.strain` measures.
    sagitta : float
        Height of the curves over one facet, the mean over the normal forces (`chords`) [length].

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
    approach: float = 0.0
    strain: float = 0.0
    sagitta: float = 0.0

    @property
    def sagitta_share(self) -> float:
        """The height of the curves over one facet, over the elastic approach.

        Zero where the approach is none: nothing presses, whatever touches.
        """
        return self.sagitta / self.approach if self.approach > 0 else 0.0

    @property
    def facets_too_long(self) -> bool:
        """Whether contact ends within the facets, so that their chords are not the curves."""
        return self.sagitta_share > SAGITTA

    @property
    def slides_far(self) -> bool:
        """Whether points have left the facets and the zone that they are held against."""
        return self.facets > FACETS and self.widths > WIDTH

    @property
    def small_sliding_holds(self) -> bool:
        """Whether small sliding is a good model at this answer."""
        off = self.tilt > TILT or self.off_arc > TILT or self.gap_share > GAP
        return not (self.slides_far or self.passes_end or off)

    @property
    def passes_end(self) -> bool:
        """Whether much of the force acts beyond the end; the mesh resolves whole shares of points."""
        return self.beyond > 0 and self.beyond_share > BEYOND
