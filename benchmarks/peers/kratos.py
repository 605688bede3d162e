"""The cases of `compare.py` by Kratos: dual mortar, multipliers, augmented Lagrangian.

    pip install KratosMultiphysics KratosStructuralMechanicsApplication \
        KratosLinearSolversApplication KratosContactStructuralMechanicsApplication
    python kratos.py CASE FILE

Settings are the defaults of its contact application but for tolerances. Linear systems: for solids
its multigrid (amgcl) with the multipliers condensed, for plane bodies the direct solver that it takes
by itself; `KRATOS_SOLVER` names another. Dynamics, self-contact and large sliding are not compared.
Contact with a rigid plane it does not have.
"""

from __future__ import annotations

import json
import os
from typing import Any

import KratosMultiphysics as KM
import numpy as np
from KratosMultiphysics import ContactStructuralMechanicsApplication as Contact
from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import (
    StructuralMechanicsAnalysis,
)
from scene import NU, E, Scene, run

RELATIVE, ABSOLUTE = 1e-6, 1e-18  # of residuals and increments; the forces of nodes are about 1e-6
LINEAR = 1e-6  # of linear systems, its default
NAMES = {  # by dimension: element, law
    2: ("SmallDisplacementElement2D4N", "LinearElasticPlaneStrain2DLaw"),
    3: ("SmallDisplacementElement3D8N", "LinearElastic3DLaw"),
}


def solver_name(scene: Scene) -> str:
    """Multigrid for solids; what Kratos takes by itself for plane bodies."""
    return os.environ.get("KRATOS_SOLVER", "amgcl" if scene.dim == 3 else "")


def multigrid(dim: int) -> Any:
    """Multigrid with condensed multipliers. From its name alone version 10.4.4 does not make it."""
    stated: dict[str, Any] = {"solver_type": "amgcl", "smoother_type": "ilu0", "krylov_type": "lgmres"}
    stated |= {"coarsening_type": "aggregation", "tolerance": LINEAR, "block_size": dim, "verbosity": 0}
    condensed: dict[str, Any] = {
        "solver_type": "mixed_ulm_linear_solver",
        "tolerance": LINEAR,
        "max_iteration_number": 200,
    }
    inner = KM.AMGCLSolver(KM.Parameters(json.dumps(stated)))
    return Contact.MixedULMLinearSolver(inner, KM.Parameters(json.dumps(condensed)))


def settings(scene: Scene) -> KM.Parameters:
    """What the input file of a user says."""
    solver = solver_name(scene)
    kind = "Frictional" if scene.mu else "Frictionless" + "Components" * bool(solver)
    of = [
        f"{what}_{kind_}_tolerance"
        for what in ("displacement", "residual")
        for kind_ in ("relative", "absolute")
    ]
    tolerances = {name: RELATIVE if "relative" in name else ABSOLUTE for name in of}
    stated: dict[str, Any] = {
        "problem_data": {
            "problem_name": "peer",
            "parallel_type": "OpenMP",
            "start_time": 0.0,
            "end_time": len(scene.motion) - 0.5,
            "echo_level": 0,
        },
        "solver_settings": {
            "solver_type": "Static",
            "model_part_name": "Structure",
            "domain_size": scene.dim,
            "echo_level": 0,
            "analysis_type": "non_linear",
            "model_import_settings": {"input_type": "use_input_model_part"},
            "material_import_settings": {"materials_filename": ""},
            "contact_settings": {"mortar_type": "ALMContact" + kind}
            | {f"contact_{name}": value for name, value in tolerances.items()},
            "time_stepping": {"time_step": 1.0},
            "convergence_criterion": "contact_residual_criterion",
            "max_iteration": 50,
            "buffer_size": 3,
            **tolerances,
        },
        "processes": {
            "contact_process_list": [
                {
                    "python_module": "alm_contact_process",
                    "kratos_module": "KratosMultiphysics.ContactStructuralMechanicsApplication",
                    "process_name": "ALMContactProcess",
                    "Parameters": {
                        "model_part_name": "Structure",
                        "assume_master_slave": {"0": ["body 1"]},
                        "contact_model_part": {"0": ["face"]},
                        "contact_type": kind,
                    }
                    | (
                        {"friction_coefficients": {"0": scene.mu}, "not_normal_update_frictional": True}
                        if scene.mu
                        else {}
                    ),
                }
            ]
        },
    }
    if solver not in ("", "amgcl"):
        stated["solver_settings"]["linear_solver_settings"] = {"solver_type": solver}
    return KM.Parameters(json.dumps(stated))


class Analysis(StructuralMechanicsAnalysis):
    """An analysis whose boundary is that of a scene."""

    def __init__(self, model: KM.Model, scene: Scene) -> None:
        self.scene = scene
        self.part = model.CreateModelPart("Structure")
        self.part.ProcessInfo[KM.DOMAIN_SIZE] = scene.dim
        self.counts: list[int] = []
        super().__init__(model, settings(scene))
        fill(self.part, scene)
        if solver_name(scene) == "amgcl":
            self._GetSolver()._linear_solver = multigrid(scene.dim)

    def Initialize(self) -> None:
        super().Initialize()
        names = (KM.DISPLACEMENT_X, KM.DISPLACEMENT_Y, KM.DISPLACEMENT_Z)
        for name in ("held 0", "held 1"):
            for variable in names[: self.scene.dim]:
                KM.VariableUtils().ApplyFixity(variable, True, self.part.GetSubModelPart(name).Nodes)

    def InitializeSolutionStep(self) -> None:
        at = self.scene.motion[len(self.counts)]
        names = (KM.DISPLACEMENT_X, KM.DISPLACEMENT_Y, KM.DISPLACEMENT_Z)
        for variable, value in zip(names, at, strict=False):
            KM.VariableUtils().SetVariable(variable, value, self.part.GetSubModelPart("held 1").Nodes)
        super().InitializeSolutionStep()

    def FinalizeSolutionStep(self) -> None:
        super().FinalizeSolutionStep()
        self.counts.append(self.part.ProcessInfo[KM.NL_ITERATION_NUMBER])


def fill(part: Any, scene: Scene) -> None:
    """Nodes, elements, material and named parts."""
    element, law = NAMES[scene.dim]
    whole = part.CreateSubModelPart("face")
    for i, body in enumerate(scene.bodies):
        properties = part.CreateNewProperties(i + 1)
        properties.SetValue(KM.YOUNG_MODULUS, E)
        properties.SetValue(KM.POISSON_RATIO, NU)
        properties.SetValue(KM.CONSTITUTIVE_LAW, KM.KratosGlobals.GetConstitutiveLaw(law).Clone())
        first = 1 + scene.first(i)
        points = np.pad(body.points, ((0, 0), (0, 3 - scene.dim)))
        for j, point in enumerate(points.tolist()):
            part.CreateNewNode(first + j, *point)
        start = part.NumberOfElements()
        for j, cell in enumerate((body.cells + first).tolist()):
            part.CreateNewElement(element, 1 + start + j, cell, properties)
        face = (np.unique(body.face) + first).tolist()
        part.CreateSubModelPart(f"body {i}").AddNodes(face)
        part.CreateSubModelPart(f"held {i}").AddNodes((body.held + first).tolist())
        whole.AddNodes(face)


def solve(scene: Scene) -> tuple[np.ndarray, dict[str, Any]]:
    """The displacements of the last step."""
    KM.Logger.GetDefaultOutput().SetSeverity(KM.Logger.Severity.WARNING)
    analysis = Analysis(KM.Model(), scene)
    analysis.Run()
    nodes = analysis.part.Nodes
    u = np.array(KM.VariableUtils().GetSolutionStepValuesVector(nodes, KM.DISPLACEMENT, 0, scene.dim))
    said = {
        "version": KM.KratosGlobals.Kernel.Version().split("-")[0].replace('"', ""),
        "iterations": sum(analysis.counts),
    }
    return u.reshape(-1, scene.dim), said


if __name__ == "__main__":
    run(solve)
