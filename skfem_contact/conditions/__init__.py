"""The contact conditions: gaps and slips as rows, friction laws, loads, and what they hold.

* `friction_rule`: what friction makes of trial forces, and the rule at all points; `friction`: laws, of
  wear too, every value checked; `orthotropic`: friction with a material direction;
* `contact`, `discretisation`, `kinematics`, `geometry`: one contact, its pairing, frames of small
  sliding, gaps and slips, and where they are when contact slides far; `rows`: their matrices, along the
  axes of friction, of rigid bodies too;
* `interface`: laws of all points, and what a state belongs to; `state`: loads of a step, and what
  friction remembers;
* `motions`: what supports leave free, whether contact holds it, and the words of "no equilibrium";
* `checks`: what can be said before solving, of pairings and of axisymmetric bodies;
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.conditions.friction import Archard as Archard
    from skfem_contact.conditions.friction import FrictionLaw as FrictionLaw
    from skfem_contact.conditions.kinematics import Kinematics as Kinematics
    from skfem_contact.conditions.orthotropic import OrthotropicCoulomb as OrthotropicCoulomb

__all__ = ["Archard", "FrictionLaw", "Kinematics", "OrthotropicCoulomb"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "discretisation": "along_supports carriers pair plane_moduli",
        "friction": "Archard CheckedLaw FrictionLaw steep_words unlawful",
        "friction_rule": "Derivatives FrictionRule radial_return",
        "kinematics": "Kinematics",
        "motions": "RigidMotions escape null_space rigid_motions",
        "orthotropic": "combinations duals OrthotropicCoulomb",
        "rows": "combined_rows tangential_matrix",
        "state": "LoadCase LocalState Motion transport",
    },
)
