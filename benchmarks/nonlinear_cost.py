"""What one linearisation of a body that yields costs, beside one `skfem.solve` of it.

    OPENBLAS_NUM_THREADS=1 python benchmarks/nonlinear_cost.py [--cells 125] [--rounds 3]

A billet without hardening to speak of, of cells x cells quadrilaterals (31 752 DOFs with 125), under an
elastic tool with friction: CPU seconds of a load step over its linearisations, the tool being condensed
before, over those of `skfem.solve` with the stiffness of the billet; the median of some rounds in turn.
"""

from __future__ import annotations

import argparse
import time
from statistics import median

import numpy as np
import skfem as fem

import skfem_contact as sc

E, NU, YIELD = 210e3, 0.3, 300.0


def rectangle(x: tuple[float, float], y: tuple[float, float], nx: int, ny: int) -> fem.Basis:
    mesh = fem.MeshQuad.init_tensor(np.linspace(*x, nx + 1), np.linspace(*y, ny + 1))
    return fem.Basis(mesh.with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=125)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    n = given.cells
    law = sc.J2(E, NU, [[YIELD, 0.0], [YIELD + E / 50, 1.0]])
    billet = sc.NonlinearBody(rectangle((0, 1), (0, 1), n, n), law, D="bottom", name="billet")
    tool = sc.Body(
        rectangle((-0.25, 1.15), (1, 1.5), n, n // 3), sc.Elastic(E, NU), D="top", name="tool"
    )
    faces = billet.surface("top"), tool.surface("bottom")
    solver = sc.ContactSolver([billet, tool], [sc.Contact(*faces, friction=sc.Coulomb(0.2))])
    # the tool, whose load has components of its own, is condensed in the first two steps
    result = None
    for down in (0.001, 0.002):
        result = solver.solve(x={"tool": {"top": (0.0, -down)}}, start=result)
    steps, solves = [], []
    for k in range(given.rounds):
        begin = time.process_time()
        result = solver.solve(x={"tool": {"top": (0.0, -0.003 - 0.001 * k)}}, start=result)
        steps.append((time.process_time() - begin) / len(result.newton))
        K = billet.linearize(result.displacement("billet"), result.state["billet"]).K
        begin = time.process_time()
        fem.solve(*fem.condense(K, np.ones(billet.n), D=billet.D))
        solves.append(time.process_time() - begin)
        strain = result.state["billet"]["equivalent_plastic_strain"]
        print(
            f"step {k + 1}: {len(result.newton)} linearisations, {steps[-1]:.2f} s each; "
            f"skfem.solve {solves[-1]:.2f} s; {np.mean(strain > 0):.0%} of the billet yields"
        )
    share = median(steps) / median(solves)
    print(f"{billet.n} DOFs that yield, {tool.n} of the tool: {share:.2f} of one skfem.solve")


if __name__ == "__main__":
    main()
