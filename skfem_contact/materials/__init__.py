"""Materials: stress, its derivative and internal variables at points of integration.

* `material`: what a material is, and one's own from a function;
* `tensors`: second-order tensors at many points;
* `elastic`: linear elasticity;
* `plasticity`: J2, metals that yield;
* `logarithmic`: laws of small strains at large ones;
* `hyperelastic`: neo-Hooke, Mooney-Rivlin, St. Venant-Kirchhoff;
* `felupe`: materials written for felupe.

Arrays have their components first, then elements and points of integration, as in scikit-fem's forms.
All names below are public.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "material": "FromFunction Material Split",
        "elastic": "Elastic",
        "plasticity": "J2",
        "hyperelastic": "MooneyRivlin NeoHooke SaintVenantKirchhoff",
        "felupe": "FromFelupe",
    },
)
