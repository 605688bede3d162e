"""Answers, and what can be said of them.

* `answer`: all numbers of a load step, for the modules of this library, and forces of supports;
  where bodies that are not linear are and what they remember, and how their residuals fell;
  `fields`, `values`: those of each contact, between its points and at them;
* `certificate`: how well the discrete equations hold, and forces that they leave open; `uniqueness`:
  whether there are other answers, by the pieces of the equation, or a proof that there is only one;
* `validity`: whether the model holds; `estimate`, `surface_error`: how far the
  mesh may be off;
* `tangent`: the answer linearised, and its derivatives;
* `result`: all of it as users see it, by contacts, and printed.
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.answers.certificate import Certificate as Certificate
    from skfem_contact.answers.result import ContactResult as ContactResult
    from skfem_contact.answers.tangent.changes import Parameter as Parameter
    from skfem_contact.answers.tangent.derivatives import Sensitivity as Sensitivity
    from skfem_contact.answers.tangent.modes import Modes as Modes
    from skfem_contact.answers.tangent.tangent import Tangent as Tangent
    from skfem_contact.answers.uniqueness import Uniqueness as Uniqueness
    from skfem_contact.answers.validity.validity import ContactValidity as ContactValidity
    from skfem_contact.answers.validity.validity import Drift as Drift
    from skfem_contact.answers.validity.validity import Validity as Validity
    from skfem_contact.answers.values import ContactValues as ContactValues
    from skfem_contact.answers.values import ErrorEstimate as ErrorEstimate
    from skfem_contact.answers.values import ErrorSources as ErrorSources

__all__ = [
    "Certificate",
    "ContactResult",
    "ContactValidity",
    "ContactValues",
    "Drift",
    "ErrorEstimate",
    "ErrorSources",
    "Modes",
    "Parameter",
    "Sensitivity",
    "Tangent",
    "Uniqueness",
    "Validity",
]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "answer": "answer_of",
        "certificate": "Certificate",
        "surface_error": "Net",
        "fields": "contour interpolate",
        "result": "ContactResult",
        "tangent.changes": "Parameter",
        "tangent.modes": "Modes",
        "tangent.derivatives": "Sensitivity",
        "tangent.tangent": "Tangent",
        "uniqueness": "critical_friction Form orientation turning_springs unique_up_to Uniqueness",
        "validity.chords": "bends curvatures sagittas",
        "validity.deformed_boundaries": "Boundary boundary crossings Rim sharp_edges_of",
        "validity.overlaps": "pierced",
        "validity.strain": "strains",
        "validity.support": "Support",
        "validity.track": "Track node_lengths",
        "validity.validity": "ContactValidity Drift facet_words Validity",
        "values": "ContactValues ErrorEstimate ErrorSources",
    },
)
