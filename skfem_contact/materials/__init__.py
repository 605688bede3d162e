"""Materials: stress, its derivative and internal variables at points of integration.

* `material`: what a material is, and one's own from a function, also of felupe's signature;
* `tensors`: second-order tensors at many points; laws of small strains at large ones;
* `elastic`: linear elasticity;
* `plasticity`: J2, metals that yield;
* `hyperelastic`: neo-Hooke, Mooney-Rivlin, St. Venant-Kirchhoff.

Arrays have their components first, then elements and points of integration, as in scikit-fem's forms.
All names below are public.
"""

from typing import TYPE_CHECKING

from skfem_contact.entrances import entrances

if TYPE_CHECKING:
    from skfem_contact.materials.elastic import Elastic as Elastic
    from skfem_contact.materials.hyperelastic import MooneyRivlin as MooneyRivlin
    from skfem_contact.materials.hyperelastic import NeoHooke as NeoHooke
    from skfem_contact.materials.hyperelastic import SaintVenantKirchhoff as SaintVenantKirchhoff
    from skfem_contact.materials.material import FromFelupe as FromFelupe
    from skfem_contact.materials.material import FromFunction as FromFunction
    from skfem_contact.materials.material import Material as Material
    from skfem_contact.materials.material import Split as Split
    from skfem_contact.materials.plasticity import J2 as J2

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

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "elastic": "Elastic",
        "hyperelastic": "MooneyRivlin NeoHooke SaintVenantKirchhoff",
        "material": "FromFelupe FromFunction Material Split",
        "plasticity": "J2",
    },
)
