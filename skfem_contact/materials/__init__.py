"""Materials: stress, its derivative and internal variables at points of integration.

* `material`: what a material is, and one's own from a function;
* `tensors`: second-order tensors at many points;
* `elastic`: linear elasticity;
* `plasticity`: J2, metals that yield;
* `hyperelastic`: neo-Hooke, Mooney-Rivlin, St. Venant-Kirchhoff;
* `felupe`: materials written for felupe.

Arrays have their components first, then elements and points of integration, as in scikit-fem's forms.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from skfem_contact.materials.elastic import Elastic
    from skfem_contact.materials.felupe import FromFelupe
    from skfem_contact.materials.hyperelastic import MooneyRivlin, NeoHooke, SaintVenantKirchhoff
    from skfem_contact.materials.material import FromFunction, Material
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
]

#: In which module each name is: modules are imported when they are first asked for.
_LATER = {
    "J2": "plasticity",
    "Elastic": "elastic",
    "FromFelupe": "felupe",
    "FromFunction": "material",
    "Material": "material",
    "MooneyRivlin": "hyperelastic",
    "NeoHooke": "hyperelastic",
    "SaintVenantKirchhoff": "hyperelastic",
}


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)
