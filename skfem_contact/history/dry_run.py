"""The dry run: `print(solver)` says what is modelled, before anything is solved.

Then what is said while a history is solved: a bar, a line of the log, how far it came.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.validity.chords import straight_words
from skfem_contact.answers.values import status_words
from skfem_contact.arrays import Index
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.friction import steep_words
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.linalg.dense_factors import written_bytes
from skfem_contact.linalg.fronts import FactorSize
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.pairing.diagnosis import diagnose, say_stiffer
from skfem_contact.pairing.node import Pairing
from skfem_contact.problem.model import LinearModel
from skfem_contact.trees import pairs_within

# Bodies that are so many times as large as others may be meant, or metres beside millimetres (1000
# times, where the bodies themselves are alike within a factor of three).
UNLIKE = 300.0


class Solver(Protocol):
    """The part of a solver that is told before it solves."""

    loop: str
    system: System
    contacts: tuple[Contact, ...]
    names: tuple[str, ...]
    geometry: Geometry
    kin: Kinematics
    interface: Interface
    linear_model: LinearModel

    def sizes(self) -> dict[str, FactorSize]:
        """Return what the factorisation of each body in contact will take."""
        ...


def dry_run(solver: Solver) -> str:
    """Return what a solver models and what it leaves out, before anything is solved."""
    system = solver.system
    lines = [f"Contact solver: loop '{solver.loop}', {_linear_words(solver)}", ""]
    for body, name, K in zip(system.bodies, system.names, solver.linear_model.stiffness, strict=True):
        what = "rigid"
        if isinstance(body, Body):
            what = f"{type(body.basis.mesh).__name__}, {body.basis.mesh.nelements} elements"
        lines.append(f"body {name}: {body.n} DOFs, {len(body.D)} prescribed, {what}")
        if isinstance(body, Body):
            lines += body_words(body, K is body.K, solver.contacts)
        for slide in system.slides.get(system.index(body), ((), ()))[1]:
            lines.append(f"  load steps may tighten it: {slide}")
    lines += _size_words(solver)
    lines.append(_free_words(solver))
    for contact, name, pairing in zip(
        solver.contacts, solver.names, solver.geometry.pairings, strict=True
    ):
        part = solver.interface.point_slices[solver.names.index(name)]
        lines += ["", f"{name}: {contact.label}"]
        lines.append(f"  {_model_words(contact)}")
        lines += [f"  {line}" for line in _spring_words(solver, contact, part)]
        lines += [f"  {line}" for line in _gap_words(solver, contact, pairing, part)]
        lines += [f"  {line}" for line in _straight_words(contact)]
        sides = pairing, contact.secondary, contact.primary, contact.method_name
        # glue holds what is together in the undeformed meshes
        follows = contact.sliding == "finite" and not contact.bilateral
        lines += [f"  {line}" for line in (*diagnose(*sides, follows), *say_stiffer(*sides))]
    return "\n".join(lines)


def _linear_words(solver: Solver) -> str:
    choice, points, n = solver.linear_model.choice, int(solver.kin.paired.sum()), solver.system.n
    dofs = len(np.setdiff1d(solver.linear_model.touched(), solver.system.D))
    sizes = f"{n} DOFs -> {dofs} contact DOFs -> {choice.rows} gaps and slips of {points} points"
    if choice.route == "full":
        return f"linear solver {choice.backend!r} on all {n} DOFs in every iteration, {choice.reason}"
    if choice.route == "multigrid":
        return f"multigrid: {sizes}; {choice.backend!r}, {choice.reason}"
    factors = f"factors by {choice.backend!r}"
    if isinstance(choice.linear, str):
        factors = (
            f"{written_bytes(sum(size.memory for size in solver.sizes().values()))} for the factors"
        )
    if choice.route == "iterated":
        return f"iterated: {sizes}; {factors}; forces by GMRES, {choice.reason}"
    dense = f"at most {written_bytes(choice.dense_bytes)} of dense matrices"
    return f"condensed: {sizes}; {factors}, {dense}, {choice.reason}"


def _size_words(solver: Solver) -> list[str]:
    """Sizes that are a thousand times apart or so: as meant, or lengths in two units."""
    solids = solver.system.solids
    sizes = {
        f"body {name}": float(np.ptp(body.basis.mesh.p, axis=1).max()) for name, body in solids.items()
    }
    for contact in solver.contacts:  # polylines and triangles, which come from files
        outline = contact.primary.outline if isinstance(contact.primary, Obstacle) else None
        if outline is not None:
            sizes[contact.primary.label] = float(np.ptp(outline.points, axis=0).max())
    large, small = max(sizes, key=sizes.__getitem__), min(sizes, key=sizes.__getitem__)
    if sizes[large] < UNLIKE * sizes[small]:
        return []
    return [
        f"{large} is {sizes[large] / sizes[small]:.0f} times as large as {small} "
        f"({sizes[large]:.3g} and {sizes[small]:.3g}): as meant, if all lengths are in one unit"
    ]


def _free_words(solver: Solver) -> str:
    motions = solver.linear_model.motions
    if motions.k == 0:
        return "no rigid motion is free: supports alone hold all bodies"
    words = [motions.describe(column) for column in np.eye(motions.k)]
    listed = "; ".join(f"{' and '.join(bodies)}: {motion}" for bodies, motion in words)
    return f"free without contact and friction: {listed}"


def _model_words(contact: Contact) -> str:
    if contact.tied:
        return f"tied ({contact.method_name}): gaps and slips are zero, also in tension"
    method = "node by node" if contact.rigid else contact.method_name
    if not contact.separation:
        method += "; no separation: gaps are zero, also in tension"
    law = "frictionless: nothing tangential is modelled"
    if contact.friction is not None:
        steep = steep_words(contact.friction)
        law = f"friction {contact.friction!r}" + (f", which holds {steep}" if steep else "")
    if contact.wear is not None:
        law += f"; wear {contact.wear!r} of {contact.secondary.label}"
    return f"method {method}; {law}"


def _straight_words(contact: Contact) -> list[str]:
    sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
    return [words for words in map(straight_words, sides) if words]


def _spring_words(solver: Solver, contact: Contact, part: slice) -> list[str]:
    """What holds sticking points, where it gives way: two of the loops take springs by themselves."""
    found = solver.interface.stiffness[part][solver.interface.frictional[part]]
    springs = found[np.isfinite(found)]
    if contact.friction is None or not len(springs):
        return []
    few, most = f"{springs.min():.3g}", f"{springs.max():.3g}"
    whose = "its own" if contact.friction.stiffness is not None else f"that of the loop '{solver.loop}'"
    return [
        f"sticking points give way by their friction over a stiffness, {whose}: "
        + (few if few == most else f"{few} to {most}")
    ]


def _gap_words(solver: Solver, contact: Contact, pairing: Pairing, part: slice) -> list[str]:
    paired = solver.kin.paired[part]
    gap, total = solver.kin.gap0[part][paired], part.stop - part.start
    lines = [f"{len(gap)} of {total} points have a partner"]
    if len(gap) and contact.bilateral:
        apart = pairing.gap[paired]
        widest, deepest = max(apart.max(), 0.0), max(-apart.min(), 0.0) + 0.0
        lines.append(
            f"held together as meshed: up to {widest:.6g} apart, overlapping by up to {deepest:.6g}"
        )
    elif len(gap):
        touching = int(np.sum(gap == 0.0))
        widest, deepest = max(gap.max(), 0.0), max(-gap.min(), 0.0) + 0.0
        lines.append(
            f"initial gaps: {int(np.sum(gap > 0))} open (largest {widest:.6g}), "
            f"{touching} closed, {int(np.sum(gap < 0))} overlap (deepest {deepest:.6g})"
        )
    return lines


def body_words(body: Body, own: bool, contacts: Sequence[Contact]) -> list[str]:
    """Lines about the mesh, the supports and the stiffness of one body; none as a rule.

    Parameters
    ----------
    body : Body
    own : bool
        Whether the stiffness is the body's own, and not another one that the solver was given.
    contacts : sequence of Contact
        What stands on both sides of them is known to be apart.
    """
    surfaces = [s for c in contacts for s in (c.secondary, c.primary) if isinstance(s, ContactSurface)]
    dofs = [s.dofs[:, 0] for s in surfaces if s.body is body]
    told = [f"  K was assembled by scikit-fem: {body.by_skfem}"] if own and body.by_skfem else []
    return [
        *told,
        *_apart(body, np.unique(np.concatenate([np.zeros(0, dtype=np.intp), *dofs]))),
        *_half_held(body),
        *_own_turn(body),
    ]


def _apart(body: Body, in_contact: Index) -> list[str]:
    """Nodes at one place that no element joins, and that no contact keeps from overlapping."""
    mesh = body.basis.mesh
    nodes = np.unique(mesh.facets[:, mesh.boundary_facets()])
    x = mesh.p[:, nodes].T
    pairs = pairs_within(x, SOLVED * float(np.ptp(mesh.p, axis=1).max()))
    known = np.isin(body.basis.nodal_dofs[0, nodes], in_contact)
    count = int(np.sum(~known[pairs].all(axis=1)))
    if not count:
        return []
    return [
        f"  {count} of its nodes lie where another one is, and nothing joins the two or keeps them "
        "from overlapping: as meant, if it is a slit that opens; else the parts of the mesh were not "
        "merged (mesh.remove_duplicate_nodes())"
    ]


def _half_held(body: Body) -> list[str]:
    """Facets whose corners are prescribed and whose other nodes are free, two and more side by side."""
    basis = body.basis
    mesh, facets = basis.mesh, basis.mesh.boundary_facets()
    between = basis.facet_dofs if mesh.dim() == 2 else basis.edge_dofs
    if len(between) != len(basis.nodal_dofs):
        return []  # linear elements
    middle = between[:, facets[None] if mesh.dim() == 2 else mesh.f2e[:, facets]]
    held = np.zeros(body.n, dtype=bool)
    held[body.D] = True
    corners = mesh.facets[:, facets]
    half = held[basis.nodal_dofs[:, corners]].all(axis=1) & ~held[middle].any(axis=1)
    found = np.zeros(half.shape[1], dtype=bool)
    for some in half:
        # one alone may be the end of a strip one element wide, whose two sides are held
        met = np.bincount(corners[:, some].ravel(), minlength=mesh.p.shape[1]) > 1
        found |= some & met[corners].any(axis=0)
    if not found.any():
        return []
    return [
        f"  D holds the corners of {int(found.sum())} facets and not the nodes between them: as from "
        "get_dofs(...).nodal; get_dofs(...).all() has all nodes of quadratic elements"
    ]


def _own_turn(body: Body) -> list[str]:
    """A stiffness that resists rotations of the body and no translations."""
    if body.components == 1 or body.axisymmetric:
        return []
    R = body.rigid_modes
    turns = np.array(["rotation" in name for name in body.rigid_mode_names])
    forces = np.linalg.norm(body.K @ R, axis=0)
    scale = np.linalg.norm(body.K.diagonal()[:, None] * R, axis=0)
    # round-off of a motion that K does not resist is 1e-12 at most, a mesh scaled by 1.001 far above
    resisted = forces / np.where(scale > 0, scale, 1.0) > SOLVED
    if resisted[~turns].any() or not resisted[turns].any():
        return []
    return [
        "  K resists rotations of the whole body and no translations: as meant, if it is that of a "
        "body under load; else it was assembled on another mesh (scaled, turned or moved nodes since)"
    ]


class Progress:
    """A bar of tqdm; the time that is left is that of the steps behind, in the mean.

    Parameters
    ----------
    total : int or None
        How many steps there are: with that there is an estimate.
    prepare : callable
        What is done once, before the first step: it is no step, and not counted in the estimate.
    """

    def __init__(self, total: int | None, prepare: Callable[[], object]) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise InputError(
                "progress=True needs tqdm, which is not installed: "
                "pip install 'skfem-contact[progress]'"
            ) from None
        # smoothing=0: the mean of all steps, since the last is no better guess for the rest
        self.bar = tqdm(total=total, unit="step", smoothing=0, desc="condensing the bodies")
        try:
            prepare()
        except BaseException:
            self.bar.close()
            raise
        self.bar.set_description("load steps", refresh=False)
        self.bar.reset(total=total)

    def shows(self, answer: Answer) -> None:
        """One step more."""
        self.bar.set_postfix_str(words(answer), refresh=False)
        self.bar.update()

    def close(self) -> None:
        """The bar stays as it is."""
        self.bar.close()


def words(answer: Answer) -> str:
    """The load and how it was found."""
    load = "" if answer.factor is None else f"load factor {answer.factor:g}, "
    return f"{load}{answer.iterations} iteration{'s' if answer.iterations != 1 else ''}"


def line(number: int, total: int | None, answer: Answer) -> str:
    """A line of the log: which step, how it ended, and what every contact does."""
    of = "" if total is None else f" of {total}"
    load = "" if answer.factor is None else f", load factor {answer.factor:g}"
    contacts = (f"{values.name}: {status_words(values)}" for values in ContactResult(answer))
    return "; ".join([f"step {number}{of}{load}: {answer.message}", *contacts])


def reached(number: int, total: int | None) -> str:
    """For an exception that ends a history: how far it came, and where that is."""
    of = "" if total is None else f" of {total}"
    steps = "step was" if number == 1 else "steps were"
    return (
        f"{number}{of} load {steps} finished before: their results are in `.results` of this exception "
        "(sys.last_value.results in an interactive session)"
    )
