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
    loops/active_set          active_set               solves for a set of points, and corrects it
    conditions/friction_rule  FrictionRule             the force of all laws within its bound

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

All of them use `errors`, `arguments` and `arrays` (checks of what users pass, vectors, entries of
matrices), `digits` (what is zero), `records` (what is made once, when it is first needed, and what
does not change, in files and processes too) and `trees` (points near each other). Closed
forms to compare with are in `reference`, which needs none of these but checks of arguments.

Public is what docs/interface.md lists: names of this package and of those in it. What many jobs do
without is imported when it is first asked for: pictures, files, PETSc, obstacles, constraints alone,
multigrid.
"""

import gc
from importlib import import_module
from typing import TYPE_CHECKING, Any

# All that is imported stays: to look for garbage among it takes as long as a third of the imports.
_COLLECTS = gc.isenabled()
gc.disable()
try:
    from skfem_contact.arguments import did_you_mean
    from skfem_contact.assemblies.bolt import Bolt
    from skfem_contact.bodies.body import Body
    from skfem_contact.conditions.contact import Contact
    from skfem_contact.conditions.friction import Coulomb, Tresca
    from skfem_contact.errors import ContactError, ContactWarning
    from skfem_contact.history.solver import ContactSolver
    from skfem_contact.loops.driver import Options
    from skfem_contact.obstacles.rigid_body import RigidBody
finally:
    if _COLLECTS:
        if not gc.get_freeze_count():  # else a program has put objects there, which are to stay
            gc.freeze()
            gc.unfreeze()  # among what is old: the first look at what is young would take all of it
        gc.enable()

if TYPE_CHECKING:
    from skfem_contact import (
        answers,
        assemblies,
        bodies,
        conditions,
        elimination,
        errors,
        history,
        linalg,
        loops,
        materials,
        obstacles,
        output,
        petsc,
        reference,
    )
    from skfem_contact.assemblies.finding import find_contacts
    from skfem_contact.assemblies.reading import read_bodies
    from skfem_contact.bodies.nonlinear import NonlinearBody
    from skfem_contact.materials.elastic import Elastic
    from skfem_contact.materials.plasticity import J2
    from skfem_contact.obstacles.faceted import RigidPolyline, RigidSurface
    from skfem_contact.obstacles.shapes import RigidCylinder, RigidPlane, RigidSphere
    from skfem_contact.output.plot_bodies import plot_deformed
    from skfem_contact.output.plot_contacts import plot_contact
    from skfem_contact.output.plot_histories import plot_history
    from skfem_contact.output.stress import nodal_stress, von_mises
    from skfem_contact.output.vtk import write, write_series

#: What a script needs first, and the packages that have the other public names.
__all__ = [
    "J2",
    "Body",
    "Bolt",
    "Contact",
    "ContactError",
    "ContactSolver",
    "ContactWarning",
    "Coulomb",
    "Elastic",
    "NonlinearBody",
    "Options",
    "RigidBody",
    "RigidCylinder",
    "RigidPlane",
    "RigidPolyline",
    "RigidSphere",
    "RigidSurface",
    "Tresca",
    "answers",
    "assemblies",
    "bodies",
    "conditions",
    "elimination",
    "errors",
    "find_contacts",
    "history",
    "linalg",
    "loops",
    "materials",
    "nodal_stress",
    "obstacles",
    "output",
    "petsc",
    "plot_contact",
    "plot_deformed",
    "plot_history",
    "read_bodies",
    "reference",
    "von_mises",
    "write",
    "write_series",
]

__version__ = "0.2.0"

#: Where the names stand that are imported when they are first asked for.
_LATER = {
    "Elastic": "materials.elastic",
    "J2": "materials.plasticity",
    "NonlinearBody": "bodies.nonlinear",
    "RigidCylinder": "obstacles.shapes",
    "RigidPlane": "obstacles.shapes",
    "RigidPolyline": "obstacles.faceted",
    "RigidSphere": "obstacles.shapes",
    "RigidSurface": "obstacles.faceted",
    "find_contacts": "assemblies.finding",
    "nodal_stress": "output.stress",
    "plot_contact": "output.plot_contacts",
    "plot_deformed": "output.plot_bodies",
    "plot_history": "output.plot_histories",
    "read_bodies": "assemblies.reading",
    "von_mises": "output.stress",
    "write": "output.vtk",
    "write_series": "output.vtk",
}

_PACKAGES = [name for name in __all__ if name.islower() and name not in _LATER]


def __getattr__(name: str) -> Any:
    """A public name that is not imported yet."""
    if name in _PACKAGES:
        return import_module(f"{__name__}.{name}")
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{_elsewhere(name)}")
    value = getattr(import_module(f"{__name__}.{_LATER[name]}"), name)
    globals()[name] = value  # from now on found without this function
    return value


def _elsewhere(name: str) -> str:
    """Where a name is that is not at the top, or what is like it; Python asks for private ones."""
    if name.startswith("_"):
        return ""
    has = [p for p in _PACKAGES if name in getattr(import_module(f"{__name__}.{p}"), "__all__", ())]
    return f": it is in {__name__}.{has[0]}" if has else did_you_mean(name, __all__)


def __dir__() -> list[str]:
    """The public names; other packages are found by their imports, and are not public."""
    return [*__all__, "__all__", "__doc__", "__version__"]
