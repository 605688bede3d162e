"""The contact conditions: gaps and slips as rows, friction laws, loads, and what they hold.

* `friction`: laws, of wear too, and what they make of trial forces; `orthotropic`: friction with a
  material direction; `friction_rule`: the rule at all points, every value checked;
* `contact`, `discretisation`, `kinematics`, `geometry`: one contact, its pairing, gaps and slips, and
  where they are when contact slides far; `rows`: their matrices, along the axes of friction, of rigid
  bodies too;
* `loads`, `interface`, `state`: loads of a step, laws of all points, what friction remembers and
  what that belongs to;
* `motions`: what supports leave free, in words too, and whether contact holds it;
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
        "discretisation": "carriers pair",
        "friction": "Archard Derivatives FrictionLaw radial_return unlawful",
        "friction_rule": "CheckedLaw FrictionRule steep_words",
        "kinematics": "Kinematics",
        "loads": "LoadCase Motion",
        "motions": "RigidMotions escape null_space rigid_motions",
        "orthotropic": "combinations duals OrthotropicCoulomb",
        "rows": "combined_rows tangential_matrix",
        "state": "LocalState transport",
    },
)
