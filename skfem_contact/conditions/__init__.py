"""The contact conditions: gaps and slips as rows, friction laws, loads, and what they hold.

* `friction`, `friction_rule`: laws and their return map; the rule at all points, every value checked;
  `orthotropic`: friction with a material direction;
  `wear`: the depth that slip wears off;
* `contact`, `discretisation`, `kinematics`, `geometry`: one contact, its pairing, gaps and slips, and
  where they are when contact slides far; `rows`: their matrices, along the axes of friction, of rigid
  bodies too;
* `loads`, `interface`, `state`: loads of a step, laws of all points, what friction remembers;
* `motions`, `statics`: what supports leave free, in words too, and whether contact holds it;
* `checks`: what can be said before solving, of pairings and of axisymmetric bodies;
  `identity`: what a stored state belongs to;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "discretisation": "carriers pair",
        "friction": "Derivatives radial_return",
        "friction_rule": "CheckedLaw FrictionRule steep_words unlawful",
        "loads": "LoadCase Motion",
        "motions": "RigidMotions null_space rigid_motions",
        "rows": "combinations combined_rows duals tangential_matrix",
        "state": "LocalState transport",
        "statics": "escape",
    },
)
