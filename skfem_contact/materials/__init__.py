"""Materials: stress, its derivative and internal variables at points of integration.

* `material`: what a material is, one's own from a function, also of felupe's signature; second-order
  tensors at many points; laws of small strains at large ones;
* `elastic`: linear elasticity, St. Venant-Kirchhoff, and rubber: neo-Hooke, Mooney-Rivlin;
* `plasticity`: J2, metals that yield.

Arrays have their components first, then elements and points of integration, as in scikit-fem's forms.
All names below are public.
"""

from skfem_contact.materials.elastic import Elastic, MooneyRivlin, NeoHooke, SaintVenantKirchhoff
from skfem_contact.materials.material import FromFelupe, FromFunction, Material, Split
from skfem_contact.materials.plasticity import J2

__all__ = [
    "J2",
    "Elastic",
    "FromFelupe",
    "FromFunction",
    "Material",
    "MooneyRivlin",
    "NeoHooke",
    "SaintVenantKirchhoff",
    "Split",
]


def __dir__() -> list[str]:
    return [*__all__]
