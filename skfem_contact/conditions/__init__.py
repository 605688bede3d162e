"""The contact conditions: gaps and slips as rows, friction laws, loads, and what they hold.

* `friction`: laws, of wear too; `orthotropic`: friction with a material direction;
  `return_map`, `friction_rule`: what laws make of trial forces; the rule at all points, every value
  checked;
* `contact`, `discretisation`, `kinematics`, `geometry`: one contact, its pairing, gaps and slips, and
  where they are when contact slides far; `rows`: their matrices, along the axes of friction, of rigid
  bodies too;
* `loads`, `interface`, `state`: loads of a step, laws of all points, what friction remembers and
  what that belongs to;
* `motions`, `statics`: what supports leave free, in words too, and whether contact holds it;
* `checks`: what can be said before solving, of pairings and of axisymmetric bodies;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "discretisation": "carriers pair",
        "friction_rule": "CheckedLaw FrictionRule steep_words",
        "loads": "LoadCase Motion",
        "motions": "RigidMotions null_space rigid_motions",
        "orthotropic": "combinations duals",
        "return_map": "Derivatives radial_return unlawful",
        "rows": "combined_rows tangential_matrix",
        "state": "LocalState transport",
        "statics": "escape",
    },
)
