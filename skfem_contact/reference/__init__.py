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

import types

from skfem_contact.reference.fretting import BarBetweenPlanes as BarBetweenPlanes
from skfem_contact.reference.fretting import CappedSliding as CappedSliding
from skfem_contact.reference.fretting import LayeredCantilever as LayeredCantilever
from skfem_contact.reference.fretting import PartialSlip as PartialSlip
from skfem_contact.reference.fretting import annulus_torsion_capacity as annulus_torsion_capacity
from skfem_contact.reference.fretting import bar_between_planes as bar_between_planes
from skfem_contact.reference.fretting import capped_sliding as capped_sliding
from skfem_contact.reference.fretting import cattaneo_mindlin as cattaneo_mindlin
from skfem_contact.reference.fretting import cattaneo_mindlin_slip as cattaneo_mindlin_slip
from skfem_contact.reference.fretting import fretting_dissipation_line as fretting_dissipation_line
from skfem_contact.reference.fretting import layered_cantilever as layered_cantilever
from skfem_contact.reference.fretting import mindlin_compliance as mindlin_compliance
from skfem_contact.reference.fretting import mindlin_dissipation as mindlin_dissipation
from skfem_contact.reference.fretting import mindlin_shift as mindlin_shift
from skfem_contact.reference.fretting import sphere_torsion_capacity as sphere_torsion_capacity
from skfem_contact.reference.fretting import tangential_shift_line as tangential_shift_line
from skfem_contact.reference.friction_problems import InclinedBlock as InclinedBlock
from skfem_contact.reference.friction_problems import UniformShear as UniformShear
from skfem_contact.reference.friction_problems import capstan_ratio as capstan_ratio
from skfem_contact.reference.friction_problems import corner_pressures as corner_pressures
from skfem_contact.reference.friction_problems import friction_cone_turn as friction_cone_turn
from skfem_contact.reference.friction_problems import inclined_block as inclined_block
from skfem_contact.reference.friction_problems import sliding_wedge_force as sliding_wedge_force
from skfem_contact.reference.friction_problems import (
    stacked_blocks_normal_forces as stacked_blocks_normal_forces,
)
from skfem_contact.reference.friction_problems import taper_force as taper_force
from skfem_contact.reference.friction_problems import uniform_shear as uniform_shear
from skfem_contact.reference.hertz import HertzLine as HertzLine
from skfem_contact.reference.hertz import HertzPoint as HertzPoint
from skfem_contact.reference.hertz import QuarticLine as QuarticLine
from skfem_contact.reference.hertz import block_coefficient as block_coefficient
from skfem_contact.reference.hertz import block_curvature as block_curvature
from skfem_contact.reference.hertz import effective_modulus as effective_modulus
from skfem_contact.reference.hertz import hertz_line as hertz_line
from skfem_contact.reference.hertz import hertz_point as hertz_point
from skfem_contact.reference.hertz import quartic_line as quartic_line
from skfem_contact.reference.punch import BondedPunch as BondedPunch
from skfem_contact.reference.punch import bonded_flat_punch as bonded_flat_punch
from skfem_contact.reference.punch import bonded_round_punch_ratio as bonded_round_punch_ratio
from skfem_contact.reference.punch import dundurs_beta_rigid as dundurs_beta_rigid
from skfem_contact.reference.punch import flat_punch_pressure as flat_punch_pressure
from skfem_contact.reference.punch import round_punch_load as round_punch_load
from skfem_contact.reference.punch import round_punch_pressure as round_punch_pressure
from skfem_contact.reference.punch import stick_ratio_axisymmetric as stick_ratio_axisymmetric
from skfem_contact.reference.punch import stick_ratio_plane as stick_ratio_plane
from skfem_contact.reference.rings import ConcentricRings as ConcentricRings
from skfem_contact.reference.rings import Ring as Ring
from skfem_contact.reference.rings import lame_rings as lame_rings
from skfem_contact.reference.rings import persson_half_angle as persson_half_angle
from skfem_contact.reference.rings import persson_load_number as persson_load_number
from skfem_contact.reference.rings import persson_pressure as persson_pressure
from skfem_contact.reference.rings import ring_twist as ring_twist
from skfem_contact.reference.rings import torque_capacity as torque_capacity
from skfem_contact.reference.verification import ONE_NODE_TRIANGLE as ONE_NODE_TRIANGLE
from skfem_contact.reference.verification import RAOUS as RAOUS
from skfem_contact.reference.verification import Equilibrium as Equilibrium
from skfem_contact.reference.verification import ManufacturedSlip as ManufacturedSlip
from skfem_contact.reference.verification import RaousBlock as RaousBlock
from skfem_contact.reference.verification import critical_friction as critical_friction
from skfem_contact.reference.verification import one_node_equilibria as one_node_equilibria
from skfem_contact.reference.verification import triangle_stiffness as triangle_stiffness
from skfem_contact.reference.verification import worst_triangle_friction as worst_triangle_friction

# the names above, and not the modules that they come from
__all__ = sorted(n for n, v in vars().items() if n[0] != "_" and not isinstance(v, types.ModuleType))
