"""Contact and friction between deformable bodies for scikit-fem.

A scikit-fem script has bases, a stiffness and a load; five lines more and its bodies touch::

    block = sc.Body(block_basis, stiffness, D="bottom", name="block")
    punch = sc.Body(punch_basis, stiffness, f=load, name="punch")
    contact = sc.Contact(punch.surface("bottom"), block.surface("top"), friction=sc.Coulomb(0.3))
    result = sc.ContactSolver([block, punch], [contact]).solve()
    print(result)

The modules stand in the order of the theory, and each imports only from those above it:

* what the user gives: `errors`, `arguments`, `sealed`, `carried`, `inputs`, `selection`, `body`,
  `system`, `facets`, `normals`, `surface`;
* what meets what: `search`, `projection`, `closest`, `strips`, `segmentation`, `supports`, `kinks`,
  `facing`, `pairing`, `dual`, `smooth`, `mortar`, `corners`, `frames`, `pairing_diagnosis`,
  `obstacle`, `rigid_shapes`, `level_set`;
* the contact conditions: `friction`, `checked_law`, `contact`, `discretisation`, `loads`,
  `kinematics`, `diagnosis`, `interface`, `identity`, `rigid`, `statics`, `pivoting`,
  `constraint_inputs`, `constraint`, `elimination`, `skfem_solve`, `constraint_rows`;
* linear algebra: `threads`, `singular`, `ordering`, `fronts`, `front_assembly`, `multifrontal`,
  `backend`, `amg`, `linear`, `spaces`, `points`, `substructure`, `sparse_route`, `condensation`;
* iterations: `states`, `guided`, `rules`, `anderson`, `loops`, `geometry`, `lemke`;
* answers: `fields`, `rotation`, `support`, `drift`, `overlap`, `skin`, `meeting`, `intrusion`,
  `watch`, `certificate`, `uniqueness`, `misfit`, `surface_error`, `body_error`, `estimate`,
  `validity`, `contact_values`, `result`;
* the way through a load history: `driver`, `linear_model`, `nested`, `starts`, `attempt`,
  `stepping`, `steps`, `checkpoint`, `recovery`, `indifference`, `load_step`,
  `yielded`, `solver`;
* what is shown: `report`, `stress`, `io`, `drawing`, `plot_bodies`, `plot_contacts`.

Closed forms to compare with are in `reference`, which needs none of these.
"""

from skfem_contact.amg import AMG
from skfem_contact.body import Body
from skfem_contact.certificate import Certificate
from skfem_contact.checkpoint import SavedState, save_state
from skfem_contact.constraint import AffineConstraint
from skfem_contact.constraint_rows import ConstraintRows, contact_rows
from skfem_contact.contact import Contact
from skfem_contact.driver import Options
from skfem_contact.elimination import eliminate
from skfem_contact.errors import (
    ConstraintError,
    ContactError,
    ContactWarning,
    InputError,
    NoEquilibrium,
    NotConverged,
)
from skfem_contact.estimate import ErrorEstimate, ErrorSources
from skfem_contact.friction import Coulomb, FrictionLaw, Tresca
from skfem_contact.io import write, write_series
from skfem_contact.kinematics import Kinematics
from skfem_contact.level_set import LevelSet
from skfem_contact.linear import Direct
from skfem_contact.plot_bodies import plot_deformed
from skfem_contact.plot_contacts import plot_contact, plot_history
from skfem_contact.result import ContactResult
from skfem_contact.rigid_shapes import RigidCylinder, RigidPlane, RigidSphere
from skfem_contact.skfem_solve import condense
from skfem_contact.solver import ContactSolver
from skfem_contact.stress import nodal_stress, von_mises
from skfem_contact.surface import ContactSurface
from skfem_contact.system import System, stack
from skfem_contact.validity import ContactValidity, Validity

__all__ = [
    "AMG",
    "AffineConstraint",
    "Body",
    "Certificate",
    "ConstraintError",
    "ConstraintRows",
    "Contact",
    "ContactError",
    "ContactResult",
    "ContactSolver",
    "ContactSurface",
    "ContactValidity",
    "ContactWarning",
    "Coulomb",
    "Direct",
    "ErrorEstimate",
    "ErrorSources",
    "FrictionLaw",
    "InputError",
    "Kinematics",
    "LevelSet",
    "NoEquilibrium",
    "NotConverged",
    "Options",
    "RigidCylinder",
    "RigidPlane",
    "RigidSphere",
    "SavedState",
    "System",
    "Tresca",
    "Validity",
    "condense",
    "contact_rows",
    "eliminate",
    "nodal_stress",
    "plot_contact",
    "plot_deformed",
    "plot_history",
    "save_state",
    "stack",
    "von_mises",
    "write",
    "write_series",
]

__version__ = "0.1.0"
