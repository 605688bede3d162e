"""Scenes with one ingredient and the same scenes without it, for `audit.py`.

Two blocks as in `cases.py`, pressed together by prescribed displacements of their outer sides; both are
held by these sides, so that no scene needs an ingredient to be solvable. What a scene leaves behind
(solver and results) is kept, and what it contains is counted.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import skfem as fem
from cases import NU, Case, E, H, R, Scene, steps
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.answers.answer import answer_of

STEPS = 20
WIDE = 10.0  # half width and depth of the blocks with many points
NEAR = 1.5  # half width of the part of a side that may touch; that of the contact is 1 at most
Counts = dict[str, int]


@dataclass(frozen=True, eq=False)
class Done:
    """What a scene leaves behind."""

    solver: sc.ContactSolver
    results: list[Any]
    extra: Any = None


class Blocks:
    """Meshes, stiffness and loads that all scenes share; their histories have `count` steps."""

    def __init__(self, dofs: float, count: int = STEPS) -> None:
        self.count = count
        self.scene = Scene(Case("audit", dofs, mu=0.0))
        stiffness = linear_elasticity(*lame_parameters(E, NU))
        upper, lower = self.scene.bases["upper"], self.scene.bases["lower"]
        self.upper = sc.Body(upper, stiffness, D="top", name="upper")
        self.lower = sc.Body(lower, stiffness, D="bottom", name="lower")
        self._stiffness = stiffness

    @cached_property
    def apart(self) -> sc.Body:
        """A third block above the other two, with a load of its own."""
        mesh = self.scene.bases["upper"].mesh.translated((0.0, 2 * H)).with_defaults()
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
        pull = fem.LinearForm(lambda v, w: 1e-3 * v[0])
        return sc.Body(basis, self._stiffness, f=pull, D="top", name="apart")

    @cached_property
    def floating(self) -> sc.Body:
        """The upper block without the support sideways, pressed by a load."""
        basis = self.scene.bases["upper"]
        return sc.Body(basis, self._stiffness, D=basis.get_dofs("top").all("u^2"), name="upper")

    @cached_property
    def flat(self) -> list[sc.Body]:
        """The same blocks with one size of element all along, and few layers: many points."""
        x = np.linspace(-WIDE, WIDE, 1 + 2 * round(self.scene.bases["upper"].N / 64))
        y = WIDE * np.linspace(0, 1, 16) ** 2
        bodies = []
        for name, rows, held in (("upper", y, "top"), ("lower", -y[::-1], "bottom")):
            mesh = fem.MeshQuad.init_tensor(x, rows).with_defaults()
            basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
            bodies.append(sc.Body(basis, self._stiffness, D=held, name=name))
        return bodies

    def contact(self, upper: sc.Body | None = None, primary: Any = None, **settings: Any) -> sc.Contact:
        """Node by node, with Hertz's profile as the gap, unless the settings say otherwise."""
        given = {"method": "node", "gap": lambda x: x[0] ** 2 / (2 * R)} | settings
        sides = (upper or self.upper).surface("bottom"), primary or self.lower.surface("top")
        return sc.Contact(*sides, **given)

    def moved(self, body: sc.Body, down: float, along: float) -> dict[str, Any]:
        """A load step: the upper side of a body goes down, and along, by parts of the depth."""
        x = np.zeros(body.n)
        top = body.basis.get_dofs("top")
        x[top.all("u^2")] = -down * self.scene.depth
        x[np.intersect1d(top.all("u^1"), body.D)] = along * self.scene.depth
        return {"x": {body.name: x}}

    def way(self, body: sc.Body | None = None) -> Iterator[dict[str, Any]]:
        """Half of the steps press, the others push along."""
        body, count = body or self.upper, self.count
        for down in steps(0, 1, count // 2):
            yield self.moved(body, down, 0.0)
        for along in steps(0, 0.2, count - count // 2):
            yield self.moved(body, 1.0, along)

    def solve(
        self,
        *contacts: sc.Contact,
        bodies: Any = (),
        after: Callable[[sc.ContactSolver, sc.answers.ContactResult], Any] | None = None,
        **settings: Any,
    ) -> Done:
        """The history; `after` is done with solver and every result, and what it returns is kept."""
        bodies = bodies or [self.upper, self.lower]
        solver = sc.ContactSolver(bodies, contacts or [self.contact()], **settings)
        results, extra = [], []
        for result in solver.history(self.way(bodies[0])):
            results.append(result)
            extra.append(after(solver, result) if after else None)
        return Done(solver, results, extra)


@dataclass(frozen=True)
class Row:
    """One ingredient.

    Attributes
    ----------
    ingredient, present, absent : str
        Its name, and the two scenes in words.
    run : callable
        ``run(blocks, present)`` does everything from the contacts to the results.
    functions : tuple of str
        ``module:function`` (or ``module:`` for all of it): what only the ingredient needs.
    counts : callable, optional
        ``counts(done)``: how much of it the scene holds.
    fewer : bool
        The scene without still has some of it, but less; else it has none.
    """

    ingredient: str
    present: str
    absent: str
    run: Callable[[Blocks, bool], Done]
    functions: tuple[str, ...] = ()
    counts: Callable[[Done], Counts] = lambda done: {}
    fewer: bool = False


# -- what scenes contain ----------------------------------------------------------------------


def tangential(done: Done) -> Counts:
    """Rows of slips in the dense problem, and entries of the tangential operator."""
    space = done.solver.linear_model.problem_on(None, None).points
    return {"tangential rows": int(np.sum(space.tangential_rows >= 0))} | operator(done)


def operator(done: Done) -> Counts:
    """Entries of the tangential operator."""
    built = done.solver.kin.__dict__.get("B_t")
    return {"entries of B_t": 0 if built is None else int(built.nnz)}


def moving(done: Done) -> Counts:
    """DOFs that are followed."""
    return {"DOFs followed": len(done.solver.geometry.surface_dofs)}


def bodies(done: Done) -> Counts:
    """DOFs of the second body, and those of them that are condensed."""
    parts = done.solver.model.substructures[1:]
    return {
        "DOFs of the second body": sum(part.body.n for part in parts),
        "condensed": sum(len(part.kept) for part in parts),
    }


def factored(done: Done) -> Counts:
    """What the last body's factorisation takes."""
    part = done.solver.model.substructures[-1]
    return {
        "its DOFs condensed": len(part.kept),
        "bytes of its factors": part.memory if "_factor" in part.__dict__ else 0,
    }


def never_closed(done: Done) -> Counts:
    """Points with a partner that stay open in all steps, and the dense problem they are part of."""
    closed = np.any([answer_of(result).state.status != 0 for result in done.results], axis=0)
    points = done.solver.linear_model.problem_on(None, None).points
    parts = sum(part.S.nbytes + part.flexibility.nbytes for part in done.solver.model.substructures)
    return {
        "points that never close": int(np.sum(done.solver.kin.paired & ~closed)),
        "rows": len(points.S),
        "bytes of dense matrices": parts + points.S.nbytes,
    }


def recovered(done: Done) -> Counts:
    """Results that hold displacements."""
    return {"displacements": sum("u" in vars(answer_of(result)) for result in done.results)}


def anchored(done: Done) -> Counts:
    """Rigid motions, and springs that stop them."""
    return {
        "rigid motions": done.solver.linear_model.motions.k,
        "springs": int(done.solver.model.P.shape[1]),
    }


def springs(done: Done) -> Counts:
    """Points that stick on a spring."""
    return {"springs": int(np.isfinite(done.solver.interface.stiffness).sum())}


def bilateral(done: Done) -> Counts:
    """Points that are glued."""
    return {"glued points": int(done.solver.kin.tied.sum())}


# -- the scenes -------------------------------------------------------------------------------


def friction(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(blocks.contact(friction=sc.Coulomb(0.3) if present else None))


def slip(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(after=(lambda _, result: result.slip) if present else None)


def history(blocks: Blocks, present: bool) -> Done:
    if present:
        return blocks.solve()
    solver = sc.ContactSolver([blocks.upper, blocks.lower], [blocks.contact()])
    x = solver.system.x.copy()
    x[solver.system.slice("upper")] = blocks.moved(blocks.upper, 1.0, 0.2)["x"]["upper"]
    return Done(solver, [solver.solve(x=x)])


def interior(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(linear=sc.linalg.Direct() if present else "auto")


def displacements(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(after=(lambda _, result: result.u) if present else None)


def candidates(blocks: Blocks, present: bool) -> Done:
    upper, lower = blocks.flat
    near = np.inf if present else NEAR
    surfaces = [
        body.surface(lambda x: (np.abs(x[1]) < 1e-9) & (np.abs(x[0]) < near), name="face")
        for body in (upper, lower)
    ]
    gap = lambda x: x[0] ** 2 / (2 * R)  # noqa: E731
    contact = sc.Contact(*surfaces, method="node", gap=gap, friction=sc.Coulomb(0.3))
    return blocks.solve(contact, bodies=[upper, lower])


def second(blocks: Blocks, present: bool) -> Done:
    if present:
        return blocks.solve()
    contact = blocks.contact(primary=sc.RigidPlane((0, 0), (0, 1)))
    return blocks.solve(contact, bodies=[blocks.upper])


def apart(blocks: Blocks, present: bool) -> Done:
    bodies = [blocks.upper, blocks.lower, blocks.apart]
    contacts = [blocks.contact(name="near")]
    if present:
        far = sc.Contact(
            blocks.apart.surface("bottom"), blocks.upper.surface("top"), method="node", name="far"
        )
        contacts.append(far)
    return blocks.solve(*contacts, bodies=bodies)


def mortar(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(blocks.contact(method="mortar" if present else "node"))


def sliding(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(blocks.contact(sliding="finite" if present else "small"))


def tied(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(blocks.contact(tied=present, gap=None if present else 0.0))


def tangential_stiffness(blocks: Blocks, present: bool) -> Done:
    loop = "direct" if present else "newton"
    return blocks.solve(blocks.contact(friction=sc.Coulomb(0.3)), loop=loop)


def support(blocks: Blocks, present: bool) -> Done:
    upper = blocks.floating if present else blocks.upper
    contact = blocks.contact(upper, friction=sc.Coulomb(0.3))
    return blocks.solve(contact, bodies=[upper, blocks.lower])


def pivoting(blocks: Blocks, present: bool) -> Done:
    options = sc.Options(max_iterations=1 if present else 80)
    return blocks.solve(blocks.contact(friction=sc.Coulomb(0.3)), options=options)


def certificate(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(after=(lambda _, result: result.certificate) if present else None)


def validity(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(after=(lambda _, result: result.validity) if present else None)


def checkpoint(blocks: Blocks, present: bool) -> Done:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "state.npz"
        return blocks.solve(
            after=(lambda solver, result: solver.save_state(path, result)) if present else None
        )


def report(blocks: Blocks, present: bool) -> Done:
    return blocks.solve(after=(lambda _, result: result.report()) if present else None)


def pictures(blocks: Blocks, present: bool) -> Done:
    done = blocks.solve()
    if present:
        os.environ["MPLBACKEND"] = "Agg"
        import matplotlib.pyplot as plt

        sc.plot_contact(done.results[-1])
        plt.close("all")
    return done


ROWS = (
    Row(
        "friction",
        "Coulomb, mu = 0.3",
        "no friction",
        friction,
        (
            "conditions/friction_rule:bound",
            "conditions/friction_rule:slope",
            "loops/active_set:_slipping",
        ),
        tangential,
    ),
    Row(
        "tangential operator",
        "no friction, slip asked for",
        "no friction",
        slip,
        ("conditions/rows:tangential_rows",),
        operator,
    ),
    Row(
        "dissipation",
        "Coulomb, mu = 0.3",
        "no friction",
        friction,
        ("history/load_step:friction_energy",),
    ),
    Row(
        "history",
        f"{STEPS} steps",
        "one solve",
        history,
        ("history/solver:history",),
    ),
    Row(
        "interior DOFs",
        "`linear=Direct()`: in every iteration",
        "condensed once",
        interior,
        ("elimination/constraint:eliminate", "problem/full:"),
    ),
    Row(
        "displacements",
        "`u` of every step",
        "not asked for",
        displacements,
        ("linalg/multifrontal:_backward", "problem/substructure:recover"),
        recovered,
    ),
    Row(
        "candidates",
        "whole sides, mu = 0.3",
        "1.5 times the contact",
        candidates,
        counts=never_closed,
        fewer=True,
    ),
    Row("second body", "elastic", "rigid plane", second, ("pairing/node:node_to_segment",), bodies),
    Row(
        "body without contact",
        "may meet a third body",
        "third body meets nobody",
        apart,
        (),
        factored,
    ),
    Row(
        "mortar integration",
        "mortar",
        "node",
        mortar,
        ("pairing/mortar:", "pairing/segmentation:", "pairing/dual:dual_basis"),
    ),
    Row(
        "moving pairing",
        '`sliding="finite"`',
        '`sliding="small"`',
        sliding,
        (
            "conditions/geometry:at",
            "conditions/geometry:mismatch",
            "conditions/geometry:_offset",
            "history/stepping:travelled",
        ),
        moving,
    ),
    Row(
        "glued surfaces",
        "`tied=True`",
        "contact",
        tied,
        ("conditions/checks:_check_tied",),
        bilateral,
    ),
    Row(
        "tangential stiffness G",
        '`loop="direct"`: 1e3 of K',
        "exact sticking",
        tangential_stiffness,
        ("conditions/rows:compliance_scale",),
        springs,
    ),
    Row(
        "body that only contact holds",
        "free sideways",
        "supported",
        support,
        ("conditions/motions:_resistance",),
        anchored,
    ),
    Row(
        "pivoting",
        "one iteration is allowed",
        "80 are",
        pivoting,
        ("loops/lemke:",),
    ),
    Row("certificate", "of every step", "not asked for", certificate, ("answers/certificate:",)),
    Row(
        "validity",
        "of every step",
        "not asked for",
        validity,
        (
            "answers/validity/assess:problems",
            "answers/validity/deformed_boundaries:inside",
            "problem/substructure:recover",
        ),
    ),
    Row(
        "checkpoints",
        "after every step",
        "none",
        checkpoint,
        ("history/checkpoint:save_state", "history/checkpoint:_write"),
    ),
    Row("report", "of every step", "none", report, ("answers/result:report",)),
    Row("pictures", "one, at the end", "none", pictures, ("output/plot_contacts:", "output/drawing:")),
)
