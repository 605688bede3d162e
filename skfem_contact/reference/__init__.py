"""Closed-form solutions of contact and friction, with their sources.

They judge the finite elements in the tests and examples, and are there for users to do the same.
Units are the caller's own; forces of plane problems are per unit thickness; pressure is positive.

Examples
--------
>>> from skfem_contact.reference import cattaneo_mindlin, effective_modulus, hertz_line
>>> contact = hertz_line(P=1000.0, R=100.0, E_star=effective_modulus(200e3, 0.3, 200e3, 0.3))
>>> print(f"half width {contact.a:.6f}, largest pressure {contact.p0:.4f}")
half width 1.076405, largest pressure 591.4314
>>> print(f"stick zone {cattaneo_mindlin(contact, mu=0.3, Q=150.0).c / contact.a:.6f}")
stick zone 0.707107
"""

from __future__ import annotations

from skfem_contact.reference.fretting import (
    BarBetweenPlanes,
    CappedSliding,
    LayeredCantilever,
    PartialSlip,
    annulus_torsion_capacity,
    bar_between_planes,
    capped_sliding,
    cattaneo_mindlin,
    cattaneo_mindlin_slip,
    fretting_dissipation_line,
    layered_cantilever,
    mindlin_compliance,
    mindlin_dissipation,
    mindlin_shift,
    sphere_torsion_capacity,
    tangential_shift_line,
)
from skfem_contact.reference.friction_problems import (
    InclinedBlock,
    UniformShear,
    capstan_ratio,
    corner_pressures,
    friction_cone_turn,
    inclined_block,
    sliding_wedge_force,
    stacked_blocks_normal_forces,
    taper_force,
    uniform_shear,
)
from skfem_contact.reference.hertz import (
    HertzLine,
    HertzPoint,
    QuarticLine,
    block_coefficient,
    block_curvature,
    effective_modulus,
    hertz_line,
    hertz_point,
    quartic_line,
)
from skfem_contact.reference.punch import (
    BondedPunch,
    bonded_flat_punch,
    bonded_round_punch_ratio,
    dundurs_beta_rigid,
    flat_punch_pressure,
    round_punch_load,
    round_punch_pressure,
    stick_ratio_axisymmetric,
    stick_ratio_plane,
)
from skfem_contact.reference.rings import (
    ConcentricRings,
    Ring,
    lame_rings,
    persson_half_angle,
    persson_load_number,
    persson_pressure,
    ring_twist,
    torque_capacity,
)
from skfem_contact.reference.verification import (
    ONE_NODE_TRIANGLE,
    RAOUS,
    Equilibrium,
    ManufacturedSlip,
    RaousBlock,
    critical_friction,
    one_node_equilibria,
    triangle_stiffness,
    worst_triangle_friction,
)

__all__ = [
    "ONE_NODE_TRIANGLE",
    "RAOUS",
    "BarBetweenPlanes",
    "BondedPunch",
    "CappedSliding",
    "ConcentricRings",
    "Equilibrium",
    "HertzLine",
    "HertzPoint",
    "InclinedBlock",
    "LayeredCantilever",
    "ManufacturedSlip",
    "PartialSlip",
    "QuarticLine",
    "RaousBlock",
    "Ring",
    "UniformShear",
    "annulus_torsion_capacity",
    "bar_between_planes",
    "block_coefficient",
    "block_curvature",
    "bonded_flat_punch",
    "bonded_round_punch_ratio",
    "capped_sliding",
    "capstan_ratio",
    "cattaneo_mindlin",
    "cattaneo_mindlin_slip",
    "corner_pressures",
    "critical_friction",
    "dundurs_beta_rigid",
    "effective_modulus",
    "flat_punch_pressure",
    "fretting_dissipation_line",
    "friction_cone_turn",
    "hertz_line",
    "hertz_point",
    "inclined_block",
    "lame_rings",
    "layered_cantilever",
    "mindlin_compliance",
    "mindlin_dissipation",
    "mindlin_shift",
    "one_node_equilibria",
    "persson_half_angle",
    "persson_load_number",
    "persson_pressure",
    "quartic_line",
    "ring_twist",
    "round_punch_load",
    "round_punch_pressure",
    "sliding_wedge_force",
    "sphere_torsion_capacity",
    "stacked_blocks_normal_forces",
    "stick_ratio_axisymmetric",
    "stick_ratio_plane",
    "tangential_shift_line",
    "taper_force",
    "torque_capacity",
    "triangle_stiffness",
    "uniform_shear",
    "worst_triangle_friction",
]
