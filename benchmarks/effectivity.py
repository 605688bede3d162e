"""The error estimate against the true error, over the verification problems.

    python benchmarks/effectivity.py [--only WORD ...] [--write]

True error: L2 norm, over the contact surface, of the traction that `interpolate` gives less the
exact one, over the norm of the exact one. Exact is a closed form, or where there is none the same
problem on a mesh at least four times as fine. Effectivity: estimated over true error.

Stores benchmarks/results/effectivity.json; with --write the table goes into docs/checks/effectivity.md.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy starts its threads

import numpy as np

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "tests" / "verification"))
sys.path.append(str(HERE.parent / "tests"))

import test_conforming  # noqa: E402
import test_mortar_contact  # noqa: E402
import test_mortar_hertz  # noqa: E402
import test_obstacles  # noqa: E402
import test_partial_slip  # noqa: E402
import test_rings  # noqa: E402
import test_structures  # noqa: E402
from effectivity_table import HIGH, LOW, PLANE, inside, write  # noqa: E402
from sheared import Sheared  # noqa: E402
from smooth_contacts import Blocks  # noqa: E402

import skfem_contact as sc  # noqa: E402
from skfem_contact.reference import (  # noqa: E402
    cattaneo_mindlin,
    effective_modulus,
    flat_punch_pressure,
    hertz_point,
    lame_rings,
    persson_load_number,
    persson_pressure,
    quartic_line,
)

Array = np.ndarray
STORED = HERE / "results" / "effectivity.json"


@dataclass(frozen=True)
class Answer:
    """A result, and the exact pressure and friction (towards one side) at points (k, d)."""

    result: Any
    pressure: Callable[[Array], Array]
    friction: Callable[[Array], Array] | None = None


@dataclass(frozen=True)
class Problem:
    """A verification problem; `make` solves it."""

    name: str
    make: Callable[[], Answer]
    slow: bool = False


# -- true errors ------------------------------------------------------------------------------


def true_error(answer: Answer) -> tuple[float, float]:
    """Relative L2 errors of the pressure, and of pressure and friction together."""
    values = answer.result.values[0]
    surface = values.surface
    t, weight = np.polynomial.legendre.leggauss(24)
    N, _ = surface.kind.shapes((t[:, None] + 1) / 2)

    def between(nodal: Array) -> Array:
        return np.einsum("qk,fk...->fq...", N, nodal[surface.facets])

    points = between(surface.points)
    area = surface.lengths[:, None] * weight / 2
    measure = surface.body.measure
    if measure is not None:
        area = area * measure(np.moveaxis(points, -1, 0))
    # facets with a node whose force goes into a support have no traction to compare
    area = (area * ~surface.held.all(axis=1)[surface.facets].any(axis=1)[:, None]).ravel()
    points = points.reshape(-1, 2)
    p = between(values.pressure).ravel()
    q = between(values.friction_stress[:, 0]).ravel()
    exact_p = answer.pressure(points)
    lost, size = area @ (p - exact_p) ** 2, area @ exact_p**2
    pressure = np.sqrt(lost / size)
    if answer.friction is None:
        return float(pressure), float(pressure)
    exact_q = answer.friction(points)
    exact_q = exact_q * (np.sign(area @ (q * exact_q)) or 1.0)
    lost, size = lost + area @ (q - exact_q) ** 2, size + area @ exact_q**2
    return float(pressure), float(np.sqrt(lost / size))


def finer(result: Any, fine: Any, friction: bool = True) -> Answer:
    """A result with that on a finer mesh in place of the exact answer."""
    values = fine.values[0]
    q = values.friction_stress[:, 0]
    return Answer(
        result,
        lambda x: values.interpolate(values.pressure, x),
        (lambda x: values.interpolate(q, x)) if friction else None,
    )


def measure(problem: Problem) -> dict[str, Any]:
    """A row of the table."""
    begin = time.process_time()
    answer = problem.make()
    solved = time.process_time()
    estimate = answer.result.values[0].error_estimate
    seconds = time.process_time() - solved
    pressure, traction = true_error(answer)
    row = {
        "problem": problem.name,
        "true": {"pressure": pressure, "traction": traction},
        "estimated": {
            "pressure": estimate.pressure.total,
            "traction": estimate.traction.total,
        },
        "sources": {k: float(v) for k, v in vars(estimate.traction).items()},
        "advice": estimate.advice,
        "seconds": {"solve": solved - begin, "estimate": seconds},
    }
    row["effectivity"] = {k: row["estimated"][k] / row["true"][k] for k in ("pressure", "traction")}
    return row


# -- the problems -----------------------------------------------------------------------------


def hertz(n: float, method: str, kind: str, ratio: float) -> Answer:
    result, exact = test_mortar_hertz.hertz.__wrapped__(n, method, kind, ratio)  # not to be kept
    return Answer(result, lambda x: exact.pressure(x[:, 0]))


def partial_slip(n: float, share: float, ratio: float = 1.0, method: str = "mortar", kind: str = "Q1"):
    mu = 0.5
    blocks, P, exact = test_mortar_hertz.scene(n, sc.Coulomb(mu), ratio=ratio, method=method, kind=kind)
    normal, depth = blocks.press(P, 1.0)
    Q = share * mu * P
    result = blocks.solver.solve(x=blocks.lowered(depth), f=blocks.push(Q), start=normal)
    law = cattaneo_mindlin(exact, mu, Q)
    return Answer(result, lambda x: exact.pressure(x[:, 0]), lambda x: law.traction(x[:, 0]))


def fretting(n: float, share: float) -> Answer:
    """On the way back from .75 mu P."""
    scene = test_partial_slip.Scene(n, fine_depth=0.4)
    way = [0.0, *np.linspace(0, 0.75, 6)[1:], *np.linspace(0.75, share, 6)[1:]]
    *_, result = scene.history(way)
    mu, P = scene.mu, scene.P
    law = cattaneo_mindlin(scene.exact, mu, share * mu * P, after=(0.75 * mu * P,))
    return Answer(result, lambda x: scene.exact.pressure(x[:, 0]), lambda x: law.traction(x[:, 0]))


def springs(factor: float) -> Answer:
    """Partial slip with a finite tangential stiffness instead of sticking."""
    exact = test_partial_slip.Scene(16.4, fine_depth=0.4)
    surface = exact.blocks.bodies[0].surface("bottom")
    middle = surface.dofs[np.argmin(np.abs(surface.points[:, 0])), 0]
    G = factor * exact.blocks.bodies[0].K.diagonal()[middle]
    scene = test_partial_slip.Scene(16.4, stiffness=G, d=exact.d, fine_depth=0.4)
    *_, result = scene.history([0.0, 0.6])
    law = cattaneo_mindlin(scene.exact, scene.mu, 0.6 * scene.mu * scene.P)
    return Answer(result, lambda x: scene.exact.pressure(x[:, 0]), lambda x: law.traction(x[:, 0]))


def capped(n: float, s: float) -> Answer:
    plain = test_partial_slip.Scene(n, pushed=False)
    mu, exact = plain.mu, plain.exact
    law = sc.Coulomb(mu, tau_max=s * mu * exact.p0)
    scene = test_partial_slip.Scene(n, law=law, pushed=False, d=plain.d)
    result = scene.blocks.solver.solve(x=scene.blocks.lowered(scene.d, shift=0.1))

    def friction(x: Array) -> Array:
        return np.minimum(mu * exact.pressure(x[:, 0]), law.tau_max)

    return Answer(result, lambda x: exact.pressure(x[:, 0]), friction)


def quartic(n: float) -> Answer:
    C = 0.01
    scene = Blocks(1 / n, lambda x: C * x[0] ** 4, H=40.0)
    exact = quartic_line(3 * np.pi / 4 * scene.E_star * C, C, scene.E_star)
    result, _ = scene.press(exact.P, exact.a)
    return Answer(result, lambda x: exact.pressure(x[:, 0]))


def rings(n: int, share: float, method: str) -> Answer:
    result, exact = test_rings.squeezed(n, share, method, 0.1234), test_rings.exact_L1()
    return Answer(result, lambda x: exact.pressure + 0 * x[:, 0], lambda x: 0 * x[:, 0])


def press_fit(n: int, outer: Any, plane: str) -> Answer:
    exact = lame_rings(1, 2, 3, test_rings.STEEL, outer, interference=test_rings.DELTA, plane=plane)
    result = test_rings.press_fit(n, outer, plane).solve()
    return Answer(result, lambda x: exact.pressure + 0 * x[:, 0])


def tubes(n: int) -> Answer:
    return Answer(test_rings.tube_fit(n, test_rings.STEEL), lambda x: lame_fit() + 0 * x[:, 0])


def curved_fit(layers: int) -> Answer:
    return Answer(test_rings.curved_fit(layers, 2 * layers), lambda x: lame_fit() + 0 * x[:, 0])


def lame_fit() -> float:
    steel = test_rings.STEEL
    return float(lame_rings(1, 2, 3, steel, steel, interference=test_rings.DELTA).pressure)


def manufactured(kind: str, n: int, method: str) -> Answer:
    exact = test_mortar_contact.UPPER
    result = test_mortar_contact.made(kind, n, method)
    return Answer(result, lambda x: exact.pressure(x.T), lambda x: exact.traction(x.T))


def pin(nt: int, half: float) -> Answer:
    number = persson_load_number(np.radians(half))
    result = test_conforming.pin_in_hole(nt, number * (1 - 0.3**2)).solve()

    def pressure(x: Array) -> Array:
        angle = np.arctan2(x[:, 1], x[:, 0]) + np.pi / 2
        return persson_pressure(angle, np.radians(half), 1.0, 1.0)

    return Answer(result, pressure)


def layer(h: float, rigid: bool) -> Answer:
    fine = test_conforming.pressed_layer(0.0125, rigid)[1]
    return finer(test_conforming.pressed_layer(h, rigid)[1], fine, friction=False)


def fillet(mu: float, method: str) -> Answer:
    """F4, with elements of 2 mm against elements of 0.5 mm."""
    coarse = test_conforming.punch(mu, method, h=2.0, growth=1.08)
    return finer(coarse, test_conforming.punch(mu, "mortar", h=0.5, growth=1.04), mu > 0)


def roller(mu: float, method: str, secondary: str) -> Answer:
    """F5, with elements of 1 mm against elements of 0.25 mm; the half width is 6.2 mm."""
    coarse = test_conforming.roller(mu, 1.0, secondary, method)
    return finer(coarse, test_conforming.roller(mu, 0.25, secondary, "mortar"), mu > 0)


def raous(n: int) -> Answer:
    return finer(test_structures.raous(n)[0], test_structures.raous(128)[0])


def round_obstacle(shape: str, kind: str) -> Answer:
    result, exact = test_obstacles.pressed_by(shape, kind)
    return Answer(result, lambda x: exact.pressure(x[:, 0]))


def ball(kind: str, n: float) -> Answer:
    body = test_obstacles.block(1 / n, kind=kind, axis=True, H=40.0)
    sphere = sc.RigidSphere((0, 100.0), 100.0, name="ball")
    solver = sc.ContactSolver([body], [sc.Contact(test_obstacles.top(body, 3.0), sphere)])
    result = next(solver.history([{"motion": {"ball": (0.0, -0.01)}}]))
    exact = hertz_point(result.force_on_primary[1], 100.0, effective_modulus(1.0, 0.3))
    return Answer(result, lambda x: exact.pressure(x[:, 0]))


def flat_punch(n: int) -> Answer:
    """The pressure is not square integrable: only the resultant is known to any mesh."""
    result = test_obstacles.punched(n, 0.3)
    P = result.force_on_primary[1]
    return Answer(result, lambda x: flat_punch_pressure(x[:, 0], P, 1.0))


def patch(kind: str, coarser: bool) -> Answer:
    """Uniform pressure node by node between three facets and five."""
    lines = np.linspace(0, 1, 4), np.linspace(0, 1, 6)
    law = sc.Coulomb(0.5)
    x_low, x_top = lines[::-1] if coarser else lines
    result, _ = test_mortar_contact.patch(kind, x_low, x_top, shear=0.2, law=law, method="node")
    return Answer(result, lambda x: 0.01 + 0 * x[:, 0], lambda x: 0.002 + 0 * x[:, 0])


def sheared(kappa: float) -> Answer:
    """Uniform shear with a tangential stiffness of kappa per area, against exact sticking."""
    case = Sheared(U=3e-4, n=8)
    law = case.law(stiffness=kappa / 8)
    bodies = case.bodies()
    result = sc.ContactSolver(bodies, [case.contact(bodies, friction=law)]).solve()
    return Answer(result, lambda x: case.state.p + 0 * x[:, 0], lambda x: case.state.tau + 0 * x[:, 0])


def problems() -> Iterator[Problem]:
    """All of them."""
    for kind, n in (("Q1", 12.2), ("P1", 12.2), ("Q2", 6.1), ("P2", 6.1)):
        for method in ("mortar", "node"):
            for ratio in (2 / 3, 4 / 3):
                yield Problem(
                    f"H1 Hertz, {kind}, {method}, {n} per half width, partner {ratio:.2f}",
                    lambda a=(n, method, kind, ratio): hertz(*a),
                )
    for kind, n in (("Q1", 8.5), ("Q1", 24.75), ("Q1", 32.0), ("P1", 24.75), ("Q2", 12.4), ("S2", 6.3)):
        yield Problem(
            f"H1 Hertz, {kind}, {n} per half width", lambda a=(n, "mortar", kind, 0.77): hertz(*a)
        )
    for n, share, ratio, method, kind in (
        (8.5, 0.6, 1.0, "mortar", "Q1"),
        (16.2, 0.25, 1.0, "mortar", "Q1"),
        (16.2, 0.6, 1.0, "mortar", "Q1"),
        (16.2, 0.9, 1.0, "mortar", "Q1"),
        (16.2, 0.6, 4 / 3, "mortar", "Q1"),
        (16.2, 0.6, 4 / 3, "node", "Q1"),
        (16.2, 0.6, 4 / 3, "mortar", "P1"),
        (8.1, 0.6, 4 / 3, "mortar", "Q2"),
        (30.7, 0.6, 2 / 3, "mortar", "Q1"),
    ):
        yield Problem(
            f"H4 Cattaneo-Mindlin, {kind}, {method}, {n} per half width, Q = {share} mu P, "
            f"partner {ratio:.2f}",
            lambda a=(n, share, ratio, method, kind): partial_slip(*a),
        )
    for share in (0.3, -0.3, -0.75):
        yield Problem(
            f"H5 fretting, back to Q = {share} mu P", lambda share=share: fretting(16.4, share)
        )
    for factor in (0.1, 1.0, 10.0):
        yield Problem(
            f"H4 with stiffness {factor} K_tt instead of sticking", lambda f=factor: springs(f)
        )
    for s in (0.25, 0.75):
        yield Problem(f"H8 sliding, capped at {s} mu p0", lambda s=s: capped(12.3, s))
    for n in (12.5, 24.2):
        yield Problem(f"H7 quartic profile, {n} per half width", lambda n=n: quartic(n))
    for share, method in ((0.75, "mortar"), (1.25, "mortar"), (0.75, "node"), (1.0, "mortar")):
        yield Problem(
            f"L1 rings, 64 chords, partner {1 / share:.2f}, {method}",
            lambda a=(64, share, method): rings(*a),
        )
    for n, outer, plane in (
        (48, test_rings.STEEL, "strain"),
        (96, test_rings.STEEL, "stress"),
        (48, test_rings.ALUMINIUM, "strain"),
        (96, test_rings.ALUMINIUM, "stress"),
    ):
        name = "steel" if outer is test_rings.STEEL else "aluminium"
        yield Problem(
            f"L2 press fit in {name}, {n} chords, plane {plane}",
            lambda a=(n, outer, plane): press_fit(*a),
        )
    for kind, n, method in (
        ("Q1", 16, "plane"),
        ("Q1", 32, "mortar"),
        ("P1", 32, "plane"),
        ("P1", 16, "mortar"),
        ("Q2", 8, "plane"),
        ("Q2", 16, "mortar"),
        ("P2", 8, "mortar"),
        ("Q1", 32, "node"),
    ):
        yield Problem(
            f"M1 manufactured, {kind}, n = {n}, {method}", lambda a=(kind, n, method): manufactured(*a)
        )
    for half in (22.61986, 61.92751, 84.82795):
        yield Problem(f"C1 pin in hole, {half:.1f} degrees", lambda h=half: pin(48, h))
    for n in (8, 16):
        yield Problem(f"L2 press fit of tubes, axisymmetric, n = {n}", lambda n=n: tubes(n))
    for n in (2, 4):
        yield Problem(f"L2 press fit, curved Q2, {n} layers", lambda n=n: curved_fit(n))
    for rigid in (True, False):
        yield Problem(
            f"C2 receding layer on a {'rigid' if rigid else 'like'} base",
            lambda rigid=rigid: layer(0.05, rigid),
        )
    for mu, method in ((0.0, "mortar"), (0.1, "mortar"), (0.1, "node")):
        yield Problem(
            f"F4 punch with fillet, mu = {mu}, {method}", lambda a=(mu, method): fillet(*a), slow=True
        )
    for mu, method, secondary in (
        (0.0, "mortar", "roller"),
        (0.1, "mortar", "block"),
        (0.1, "node", "roller"),
    ):
        yield Problem(
            f"F5 roller, mu = {mu}, {method}, secondary {secondary}",
            lambda a=(mu, method, secondary): roller(*a),
            slow=True,
        )
    for n in (16, 32):
        yield Problem(f"R1 Raous' block, n = {n}", lambda n=n: raous(n), slow=True)
    for shape, kind in (("cylinder", "Q1"), ("cylinder", "P1"), ("cylinder", "Q2")):
        yield Problem(f"H1 under a rigid {shape}, {kind}", lambda a=(shape, kind): round_obstacle(*a))
    for kind, n in (("Q1", 16.3), ("Q2", 8.2)):
        yield Problem(f"H2 rigid sphere, {kind}, {n} per radius", lambda a=(kind, n): ball(*a))
    yield Problem("F1 flat punch, 20 per half width", lambda: flat_punch(20))
    for kind, coarser in (("Q1", False), ("P1", True), ("Q2", False)):
        size = "coarser" if coarser else "finer"
        yield Problem(
            f"P1 patch test, node by node, {kind}, secondary {size}",
            lambda a=(kind, coarser): patch(*a),
        )
    for kappa in (1e1, 1e3):
        yield Problem(f"P2 uniform shear, stiffness {kappa:g} E/H", lambda k=kappa: sheared(k))


# -- the runner -------------------------------------------------------------------------------


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=(), help="words in the names of problems")
    parser.add_argument("--write", action="store_true", help="put the table into the documents")
    args = parser.parse_args()
    rows = []
    for problem in problems():
        if args.only and not any(word in problem.name for word in args.only):
            continue
        row = measure(problem)
        rows.append(row)
        e, s = row["effectivity"], row["sources"]
        print(
            f"{problem.name:75s} p {100 * row['true']['pressure']:7.3f} % eff {e['pressure']:5.2f}  "
            f"t {100 * row['true']['traction']:7.3f} % eff {e['traction']:5.2f}  "
            + " ".join(f"{k} {100 * v:.3f}" for k, v in s.items())
            + f" {row['seconds']['estimate']:.2f} of {row['seconds']['solve']:.2f} s",
            flush=True,
        )
    good = sum(map(inside, rows))
    print(f"{good} of {len(rows)} between {LOW} and {HIGH}")
    if args.only:
        return
    STORED.write_text(json.dumps({"inside": good, "rows": rows}, indent=1) + "\n", encoding="utf-8")
    if args.write:
        write(rows, PLANE)


if __name__ == "__main__":
    main()
