"""Contact and friction between deformable bodies for scikit-fem.

A scikit-fem script has bases, a stiffness and a load; five lines more and its bodies touch::

    block = sc.Body(block_basis, stiffness, D="bottom", name="block")
    punch = sc.Body(punch_basis, stiffness, f=load, name="punch")
    contact = sc.Contact(punch.surface("bottom"), block.surface("top"), friction=sc.Coulomb(0.3))
    result = sc.ContactSolver([block, punch], [contact]).solve()
    print(result)

From the solver to the law of friction a load step passes, in this order::

    history/solver            ContactSolver.solve      reads the loads
    history/solve_step        StepSolver.solve         makes an answer, looks at it, warns
    history/equilibrium       EquilibriumSearch.find   where bodies are held, or why there is no answer
    history/stepping          advance                  parts of the step, each on its own pairing
    history/stepper           Stepper.attempt          one attempt, on one pairing, from one start
    loops/driver              drive                    counts iterations, and stops them
    loops/multipliers         through_springs          once more, while springs of points have a strain
    loops/active_set          newton                   solves for a set of points, and corrects it
    loops/complementarity     Projection.proposal      what the answer asks every point to change to
    conditions/friction_rule  FrictionRule             bounds and forces of all laws
    conditions/return_map     radial_return            the force within its bound

The packages stand in the order of the theory, and each imports only from those above it:

* `materials`: what bodies are made of;
* `bodies`: what the user gives;
* `pairing`, `obstacles`: what meets what;
* `conditions`: gaps, slips, friction, loads;
* `assemblies`: bodies from files, contacts found, bolts, and tables of joints;
* `elimination`: constraints, ``u = T u_r + c``;
* `linalg`: linear solvers;
* `problem`: bodies reduced to gaps, slips and forces of the contact points;
* `loops`: the nonlinear iterations;
* `answers`: results, their certificate, validity and error;
* `history`: load steps and the solver;
* `output`: pictures and files;
* `petsc`: linear solvers over MPI ranks, which nothing else knows of.

All of them use `errors`, `arguments` and `arrays` (checks of what users pass), `digits` (what is zero),
`records` (dataclasses that are quick to import), `sealed` (arrays that do not change), `carried`
(functions in files and processes), `once` (what threads share), `trees` (points near each other) and
`entrances` (what tests take from inside a package). Closed forms to compare with are in `reference`,
which needs none of these.

Public are the names that ``dir(skfem_contact)`` shows, see docs/interface.md. What many jobs do without
is imported when it is first asked for: pictures, files, PETSc, obstacles, constraints alone, multigrid.
"""

import gc
from importlib import import_module
from typing import TYPE_CHECKING, Any

# All that is imported stays: to look for garbage among it takes as long as a third of the imports.
_COLLECTS = gc.isenabled()
gc.disable()
try:
    from skfem_contact.answers.certificate import Certificate
    from skfem_contact.answers.result import ContactResult
    from skfem_contact.answers.uniqueness import Uniqueness
    from skfem_contact.answers.validity.validity import ContactValidity, Drift, Validity
    from skfem_contact.answers.values import ContactValues
    from skfem_contact.assemblies.bolt import Bolt, BoltValues
    from skfem_contact.assemblies.joints import Joint, Joints, LoadCases
    from skfem_contact.bodies.body import Body
    from skfem_contact.bodies.surface import ContactSurface
    from skfem_contact.bodies.system import System, stack
    from skfem_contact.conditions.contact import Contact
    from skfem_contact.conditions.friction import Archard, Coulomb, FrictionLaw, Tresca
    from skfem_contact.conditions.kinematics import Kinematics
    from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
    from skfem_contact.errors import (
        ConstraintError,
        ContactError,
        ContactWarning,
        InputError,
        MaterialError,
        NoEquilibrium,
        NotConverged,
        UnknownKeyword,
    )
    from skfem_contact.history.solver import ContactSolver
    from skfem_contact.linalg.backend import LinearSolveError
    from skfem_contact.linalg.direct import Direct
    from skfem_contact.linalg.singular import SingularMatrix
    from skfem_contact.loops.driver import Options
    from skfem_contact.loops.step import Record
    from skfem_contact.obstacles.rigid_body import RigidBody
finally:
    if _COLLECTS:
        gc.enable()

if TYPE_CHECKING:
    from skfem_contact.answers.error.sources import ErrorEstimate, ErrorSources
    from skfem_contact.answers.tangent.changes import Parameter
    from skfem_contact.answers.tangent.modes import Modes
    from skfem_contact.answers.tangent.sensitivity import Sensitivity
    from skfem_contact.answers.tangent.tangent import Tangent
    from skfem_contact.assemblies.finding import FoundContact, FoundContacts, find_contacts
    from skfem_contact.assemblies.reading import read_bodies
    from skfem_contact.bodies.nonlinear import NonlinearBody
    from skfem_contact.elimination.condense import ConstraintRows, condense, contact_rows
    from skfem_contact.elimination.constraint import AffineConstraint
    from skfem_contact.elimination.eliminate import eliminate
    from skfem_contact.history.checkpoint import SavedState
    from skfem_contact.history.damping import Damping
    from skfem_contact.history.gradients import Gradient, Jacobian
    from skfem_contact.linalg.amg import AMG
    from skfem_contact.materials.elastic import Elastic
    from skfem_contact.materials.hyperelastic import MooneyRivlin, NeoHooke
    from skfem_contact.materials.plasticity import J2
    from skfem_contact.obstacles.level_set import LevelSet
    from skfem_contact.obstacles.polyline import RigidPolyline
    from skfem_contact.obstacles.shapes import RigidCylinder, RigidPlane, RigidSphere
    from skfem_contact.obstacles.triangles import RigidSurface
    from skfem_contact.output.plot_bodies import plot_deformed
    from skfem_contact.output.plot_contacts import plot_contact, plot_joints
    from skfem_contact.output.plot_histories import plot_damping, plot_force, plot_history
    from skfem_contact.output.plot_pairs import plot_pairs
    from skfem_contact.output.scene import scene
    from skfem_contact.output.stress import nodal_field, nodal_stress, von_mises
    from skfem_contact.output.vtk import write, write_series
    from skfem_contact.petsc.backend import PETSc

__all__ = [
    "AMG",
    "J2",
    "AffineConstraint",
    "Archard",
    "Body",
    "Bolt",
    "BoltValues",
    "Certificate",
    "ConstraintError",
    "ConstraintRows",
    "Contact",
    "ContactError",
    "ContactResult",
    "ContactSolver",
    "ContactSurface",
    "ContactValidity",
    "ContactValues",
    "ContactWarning",
    "Coulomb",
    "Damping",
    "Direct",
    "Drift",
    "Elastic",
    "ErrorEstimate",
    "ErrorSources",
    "FoundContact",
    "FoundContacts",
    "FrictionLaw",
    "Gradient",
    "InputError",
    "Jacobian",
    "Joint",
    "Joints",
    "Kinematics",
    "LevelSet",
    "LinearSolveError",
    "LoadCases",
    "MaterialError",
    "Modes",
    "MooneyRivlin",
    "NeoHooke",
    "NoEquilibrium",
    "NonlinearBody",
    "NotConverged",
    "Options",
    "OrthotropicCoulomb",
    "PETSc",
    "Parameter",
    "Record",
    "RigidBody",
    "RigidCylinder",
    "RigidPlane",
    "RigidPolyline",
    "RigidSphere",
    "RigidSurface",
    "SavedState",
    "Sensitivity",
    "SingularMatrix",
    "System",
    "Tangent",
    "Tresca",
    "Uniqueness",
    "UnknownKeyword",
    "Validity",
    "condense",
    "contact_rows",
    "eliminate",
    "find_contacts",
    "nodal_field",
    "nodal_stress",
    "plot_contact",
    "plot_damping",
    "plot_deformed",
    "plot_force",
    "plot_history",
    "plot_joints",
    "plot_pairs",
    "read_bodies",
    "scene",
    "stack",
    "von_mises",
    "write",
    "write_series",
]

__version__ = "0.2.0"

#: Where the names stand that are imported when they are first asked for.
_LATER = {
    "AMG": "linalg.amg",
    "AffineConstraint": "elimination.constraint",
    "ConstraintRows": "elimination.condense",
    "Damping": "history.damping",
    "Elastic": "materials.elastic",
    "ErrorEstimate": "answers.error.sources",
    "ErrorSources": "answers.error.sources",
    "J2": "materials.plasticity",
    "FoundContact": "assemblies.finding",
    "FoundContacts": "assemblies.finding",
    "Gradient": "history.gradients",
    "Jacobian": "history.gradients",
    "LevelSet": "obstacles.level_set",
    "Modes": "answers.tangent.modes",
    "MooneyRivlin": "materials.hyperelastic",
    "NeoHooke": "materials.hyperelastic",
    "NonlinearBody": "bodies.nonlinear",
    "PETSc": "petsc.backend",
    "Parameter": "answers.tangent.changes",
    "RigidCylinder": "obstacles.shapes",
    "RigidPlane": "obstacles.shapes",
    "RigidPolyline": "obstacles.polyline",
    "RigidSphere": "obstacles.shapes",
    "RigidSurface": "obstacles.triangles",
    "SavedState": "history.checkpoint",
    "Sensitivity": "answers.tangent.sensitivity",
    "Tangent": "answers.tangent.tangent",
    "condense": "elimination.condense",
    "contact_rows": "elimination.condense",
    "eliminate": "elimination.eliminate",
    "find_contacts": "assemblies.finding",
    "nodal_field": "output.stress",
    "nodal_stress": "output.stress",
    "plot_contact": "output.plot_contacts",
    "plot_damping": "output.plot_histories",
    "plot_deformed": "output.plot_bodies",
    "plot_force": "output.plot_histories",
    "plot_history": "output.plot_histories",
    "read_bodies": "assemblies.reading",
    "plot_joints": "output.plot_contacts",
    "plot_pairs": "output.plot_pairs",
    "scene": "output.scene",
    "von_mises": "output.stress",
    "write": "output.vtk",
    "write_series": "output.vtk",
}


def __getattr__(name: str) -> Any:
    """A public name that is not imported yet."""
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_LATER[name]}"), name)
    globals()[name] = value  # from now on found without this function
    return value


def __dir__() -> list[str]:
    """The public names; packages are found by their imports, and are not public."""
    return [*__all__, "__all__", "__doc__", "__version__"]
