"""The case `press` of `compare.py` by SfePy: faces against faces, by penalty, without friction.

    pip install sfepy
    python sfepy_contact.py "press 6k" FILE

`dw_contact`, its built-in term. The one of the IPC toolkit is experimental and not run. It has no
friction, so `rub` is not run. Linear systems: MUMPS, UMFPACK or SuperLU, the first that it finds.
"""

from __future__ import annotations

import importlib.metadata
import sys
from typing import Any

import numpy as np
from scene import NU, E, Scene, run
from sfepy.base.base import IndexedStruct, output
from sfepy.discrete import Equation, Equations, FieldVariable, Function, Integral, Material, Problem
from sfepy.discrete.conditions import Conditions, EssentialBC
from sfepy.discrete.fem import FEDomain, Field, Mesh
from sfepy.mechanics.matcoefs import stiffness_from_youngpoisson
from sfepy.solvers.auto_fallback import AutoDirect
from sfepy.solvers.nls import Newton
from sfepy.terms import Term

PENALTY = 100 * E  # [force / length^3], for lengths of 1; its example has 20, with 1000 Newton diverges
TOLERANCE, ITERATIONS = 1e-6, 50


def chosen(ids: np.ndarray) -> Function:
    """What a region asks for its vertices."""
    return Function("chosen", lambda coors, domain=None: ids)


def solve(scene: Scene) -> tuple[np.ndarray, dict[str, Any]]:
    """The displacements of the last step."""
    output.set_output(quiet=True)
    points = np.concatenate([body.points for body in scene.bodies])
    cells = np.concatenate([body.cells + scene.first(i) for i, body in enumerate(scene.bodies)])
    groups = np.repeat([0, 1], [len(body.cells) for body in scene.bodies])
    parts = np.repeat([0, 1], [len(body.points) for body in scene.bodies])
    mesh = Mesh.from_data(
        "press", points, parts, [cells.astype(np.int32)], [groups.astype(np.int32)], ["3_8"]
    )
    domain = FEDomain("domain", mesh)
    omega = domain.create_region("Omega", "all")
    for i, body in enumerate(scene.bodies):
        for name, ids in ((f"Face{i}", np.unique(body.face)), (f"Held{i}", body.held)):
            lookup = {"chosen": chosen(ids + scene.first(i))}
            domain.create_region(name, "vertices by chosen", "facet", functions=lookup)
    both = domain.create_region("Contact", "r.Face0 +s r.Face1", "facet")
    field = Field.from_args("displacement", np.float64, "vector", omega, approx_order=1)
    u = FieldVariable("u", "unknown", field)
    v = FieldVariable("v", "test", field, primary_var_name="u")
    solid = Material("solid", D=stiffness_from_youngpoisson(3, E, NU))
    contact = Material("contact", values={".epss": PENALTY})
    rule = Integral("i", order=2)
    stiffness = Term.new("dw_lin_elastic(solid.D, v, u)", rule, omega, solid=solid, v=v, u=u)
    touching = Term.new("dw_contact(contact.epss, v, u)", rule, both, contact=contact, v=v, u=u)
    problem = Problem("press", equations=Equations([Equation("balance", stiffness + touching)]))
    values = dict(zip(("u.0", "u.1", "u.2"), map(float, scene.motion[-1]), strict=True))
    held = EssentialBC("bottom", domain.regions["Held0"], {"u.all": 0.0})
    moved = EssentialBC("top", domain.regions["Held1"], values)
    problem.set_bcs(ebcs=Conditions([held, moved]))
    said = IndexedStruct()
    # its line search, which watches the residual, stalls when points come into contact
    given = {"i_max": ITERATIONS, "eps_a": 0.0, "eps_r": TOLERANCE, "eps_mode": "or", "ls_on": np.inf}
    problem.set_solver(Newton(given, lin_solver=AutoDirect({}), status=said))
    state = problem.solve(status=said)
    if said.condition != 0:
        sys.exit(f"not converged in {ITERATIONS} iterations")
    found = state.get_state_parts()["u"].reshape(-1, 3)
    return found, {
        "version": importlib.metadata.version("sfepy"),
        "iterations": int(said.get("n_iter", -1)),
    }


if __name__ == "__main__":
    run(solve)
