"""Wrong inputs of every public argument: refused with an error of the library, and in words."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from quick_elasticity import linear_elasticity

import skfem_contact as sc

BASIS = fem.Basis(
    fem.MeshQuad().refined(1).with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2
)
K = linear_elasticity(0.0, 0.5).assemble(BASIS)
N = BASIS.N
DOWN = np.where(np.arange(N) % 2, -0.01, 0.0)
BLOCK = sc.Body(BASIS, K, D="top", x=DOWN, name="block")
LOW = sc.Body(
    fem.Basis(BASIS.mesh.translated((0, -1)).with_defaults(), BASIS.elem, intorder=2),
    K,
    D="bottom",
    name="low",
)
SURFACE = BLOCK.surface("bottom")
FLOOR = sc.RigidPlane((0, 0), (0, 1), name="floor")
JOINT = sc.Contact(SURFACE, FLOOR, friction=sc.Coulomb(0.3), name="joint")
SOLVER = sc.ContactSolver(BLOCK, JOINT)
RESULT = SOLVER.solve()
OTHER = sc.ContactSolver([BLOCK, LOW], sc.Contact(SURFACE, LOW.surface("top"))).solve()
SYSTEM = sc.bodies.stack(BLOCK)
ROWS = sc.elimination.contact_rows(SYSTEM, JOINT)


class Odd:
    """Something that is nothing."""


BAD = {
    "None": None,
    "word": "nonsense",
    "empty word": "",
    "NaN": np.nan,
    "infinity": np.inf,
    "negative": -1.0,
    "zero": 0,
    "true": True,
    "complex": 1j,
    "huge": 10**30,
    "bytes": b"x",
    "object": Odd(),
    "function of a word": lambda x: "a",
    "function of nothing": lambda x: None,
    "empty list": [],
    "empty dict": {},
    "empty array": np.zeros(0),
    "empty matrix": np.zeros((0, 0)),
    "three numbers": np.zeros(3),
    "vector": np.zeros(N),
    "vector of NaN": np.full(N, np.nan),
    "vector of None": np.array([None] * N, dtype=object),
    "vector of words": np.array(["a"] * N),
    "complex vector": np.zeros(N, dtype=complex),
    "matrix": np.zeros((N, N)),
    "number in an array": np.array(1.0),
    "words": ["a", "b"],
    "mixed": [1, "a", None],
    "ragged": [[1], [1, 2]],
    "dict by number": {1: 2},
    "dict by None": {None: 1.0},
    "dict of None": {"block": None, "joint": None, "floor": None},
    "dict of words": {"block": "x"},
    "half a motion": ((0, 1), 1.0),
    "motion of words": ((0, 1), "a", (0, 0)),
    "motion of NaN": ((0, np.nan), 1.0, (0, 0)),
    "sparse": sp.csr_matrix((3, 3)),
    "basis": BASIS,
    "body": BLOCK,
    "surface": SURFACE,
    "contact": JOINT,
    "solver": SOLVER,
    "result": RESULT,
    "other result": OTHER,
    "numbers beyond": np.array([10**9]),
    "set": {1, 2},
    "generator": (i for i in ()),
    "date": np.datetime64("2020-01-01"),
    "slice": slice(2),
    "memory": memoryview(b"ab"),
    "law": sc.Coulomb(0.1),
    "class": ValueError,
}


def touch(**settings):
    sc.ContactSolver(BLOCK, sc.Contact(SURFACE, FLOOR, **settings)).solve()


def against(obstacle):
    sc.ContactSolver(BLOCK, sc.Contact(SURFACE, obstacle)).solve()


def updated(**given):
    solver = sc.ContactSolver(BLOCK, JOINT)
    solver.update(**{"body": "block", **given})
    solver.solve()


CALLS = {
    "Body basis": lambda v: sc.Body(v, K),
    "Body K": lambda v: sc.Body(BASIS, v),
    "Body f": lambda v: sc.Body(BASIS, K, f=v),
    "Body D": lambda v: sc.Body(BASIS, K, D=v),
    "Body x": lambda v: sc.Body(BASIS, K, D="top", x=v),
    "Body measure": lambda v: sc.Body(BASIS, K, measure=v).surface("bottom"),
    "Body name": lambda v: sc.Body(BASIS, K, name=v),
    "surface where": lambda v: BLOCK.surface(v),
    "surface where, nodes": lambda v: BLOCK.surface(v, nodes=True),
    "surface name": lambda v: BLOCK.surface("bottom", name=v),
    "surface moved": lambda v: SURFACE.moved(v),
    "stack": lambda v: sc.bodies.stack(v),
    "stack, second": lambda v: sc.bodies.stack([BLOCK, v]),
    "system index": lambda v: SYSTEM.index(v),
    "Contact secondary": lambda v: sc.Contact(v, FLOOR),
    "Contact primary": lambda v: sc.Contact(SURFACE, v),
    "RigidPlane point": lambda v: against(sc.RigidPlane(v, (0, 1))),
    "RigidPlane normal": lambda v: against(sc.RigidPlane((0, 0), v)),
    "RigidPlane name": lambda v: against(sc.RigidPlane((0, 0), (0, 1), name=v)),
    "RigidCylinder centre": lambda v: against(sc.RigidCylinder(v, 1.0)),
    "RigidCylinder radius": lambda v: against(sc.RigidCylinder((0.5, -1.0), v)),
    "RigidCylinder axis": lambda v: against(sc.RigidCylinder((0.5, -1.0), 1.0, axis=v)),
    "RigidSphere hollow": lambda v: against(sc.RigidSphere((0.5, -1.0), 1.0, hollow=v)),
    "LevelSet function": lambda v: against(sc.obstacles.LevelSet(v)),
    "LevelSet gradient": lambda v: against(sc.obstacles.LevelSet(lambda x: x[1], v)),
    "plane moved": lambda v: FLOOR.moved(v),
    "level set moved": lambda v: sc.obstacles.LevelSet(lambda x: x[1]).moved(v),
    "pair": lambda v: FLOOR.pair(v),
    "ContactSolver bodies": lambda v: sc.ContactSolver(v, JOINT).solve(),
    "ContactSolver contacts": lambda v: sc.ContactSolver(BLOCK, v).solve(),
    "ContactSolver, second contact": lambda v: sc.ContactSolver(BLOCK, [JOINT, v]).solve(),
    "ContactSolver loop": lambda v: sc.ContactSolver(BLOCK, JOINT, loop=v).solve(),
    "ContactSolver linear": lambda v: sc.ContactSolver(BLOCK, JOINT, linear=v).solve(),
    "ContactSolver options": lambda v: sc.ContactSolver(BLOCK, JOINT, options=v).solve(),
    "history": lambda v: list(SOLVER.history(v)),
    "history, one step": lambda v: list(SOLVER.history([v])),
    "history start": lambda v: list(SOLVER.history([1.0], start=v)),
    "update body": lambda v: updated(body=v),
    "update K": lambda v: updated(K=v),
    "update f": lambda v: updated(f=v),
    "with_friction": lambda v: SOLVER.with_friction(v).solve(),
    "with_friction contact": lambda v: SOLVER.with_friction(sc.Coulomb(0.1), v),
    "recover": lambda v: SOLVER.recover(v),
    "load_state": lambda v: SOLVER.load_state(v),
    "save_state": lambda v: SOLVER.save_state("never_written", v) if v not in SAVED else None,
    "contact_rows system": lambda v: sc.elimination.contact_rows(v, JOINT),
    "contact_rows contacts": lambda v: sc.elimination.contact_rows(SYSTEM, v),
    "contact_rows closed": lambda v: sc.elimination.contact_rows(SYSTEM, JOINT, v),
    "condense K": lambda v: sc.elimination.condense(v, SYSTEM.f, rows=ROWS),
    "condense f": lambda v: sc.elimination.condense(SYSTEM.K, v, rows=ROWS),
    "condense rows": lambda v: sc.elimination.condense(SYSTEM.K, SYSTEM.f, rows=v),
    "displacement": lambda v: RESULT.displacement(v),
    "result of a contact": lambda v: RESULT[v],
    "Direct": lambda v: sc.linalg.Direct(v),
}
SETTINGS = ["friction", "method", "interference", "gap", "adjust", "reach", "outside", "sliding"]
for _name in [*SETTINGS, "tied", "name"]:
    CALLS[f"Contact {_name}"] = lambda v, name=_name: touch(**{name: v})
for _name in ["mu", "tau_max", "cohesion", "stiffness"]:
    CALLS[f"Coulomb {_name}"] = lambda v, name=_name: touch(friction=sc.Coulomb(**{"mu": 0.3, name: v}))
for _name in ["tau_max", "stiffness"]:
    CALLS[f"Tresca {_name}"] = lambda v, name=_name: touch(
        friction=sc.Tresca(**{"tau_max": 1.0, name: v})
    )
for _name in vars(sc.Options()):
    CALLS[f"Options {_name}"] = lambda v, name=_name: sc.Options(**{name: v})
for _name in ["f", "x", "start", "guess"]:
    CALLS[f"solve {_name}"] = lambda v, name=_name: SOLVER.solve(**{name: v})
for _name, _whose in (("f", "block"), ("x", "block"), ("interference", "joint"), ("motion", "floor")):
    CALLS[f"step {_name}"] = lambda v, name=_name: list(SOLVER.history([{name: v}]))
    CALLS[f"step {_name} by name"] = lambda v, name=_name, whose=_whose: list(
        SOLVER.history([{name: {whose: v}}])
    )
U = RESULT.displacement("block")
FOOT = RESULT["joint"]
for _name in ["force", "moment", "about", "D", "x", "K", "name"]:
    CALLS[f"RigidBody {_name}"] = lambda v, name=_name: sc.RigidBody(FLOOR, **{name: v})
for _name in ["u", "E", "nu", "plane"]:
    CALLS[f"nodal_stress {_name}"] = lambda v, name=_name: sc.nodal_stress(
        BLOCK, **{"u": U, "E": 1.0, "nu": 0.3, name: v}
    )
CALLS |= {
    "Archard": lambda v: sc.conditions.Archard(v),
    "Contact separation": lambda v: touch(separation=v),
    "RigidBody": lambda v: sc.RigidBody(v),
    "RigidPolyline": lambda v: sc.RigidPolyline(v),
    "RigidSurface points": lambda v: sc.RigidSurface(v, [(0, 1, 2)]),
    "RigidSurface triangles": lambda v: sc.RigidSurface(np.eye(3), v),
    "RigidSurface file": lambda v: sc.RigidSurface.from_file(v),
    "Body f by boundary": lambda v: sc.Body(BASIS, K, f={"top": v}),
    "Body x by boundary": lambda v: sc.Body(BASIS, K, D="top", x={"top": v}),
    "reaction": lambda v: RESULT.reaction(v),
    "reaction boundary": lambda v: RESULT.reaction("block", v),
    "moment": lambda v: FOOT.moment(v),
    "integrate": lambda v: FOOT.integrate(v),
    "interpolate values": lambda v: FOOT.interpolate(v, FOOT.points),
    "interpolate points": lambda v: FOOT.interpolate(FOOT.pressure, v),
    "history progress": lambda v: None if v is True else list(SOLVER.history([1.0], progress=v)),
    "write": lambda v: None if v is RESULT or v is OTHER else sc.write("never_written.vtu", v),
    "write path": lambda v: sc.write(v, RESULT),
    "write_series": lambda v: sc.write_series(3, v),
    "write_series path": lambda v: sc.write_series(v, [RESULT]),
    "plot_contact": lambda v: None if v is RESULT or v is OTHER else sc.plot_contact(v),
    "plot_deformed": lambda v: None if v is RESULT or v is OTHER else sc.plot_deformed(v),
    "plot_contact axes": lambda v: None if v is None else sc.plot_contact(RESULT, ax=v),
    "plot_history": lambda v: None if v is RESULT or v is OTHER else sc.plot_history(v),
    "plot_history over": lambda v: None if v is None else sc.plot_history([RESULT], over=[v, v]),
    "plot_force": lambda v: sc.output.plot_force([RESULT], v),
}
for _name in ["C", "b", "D", "x", "prefer", "labels"]:
    CALLS[f"eliminate {_name}"] = lambda v, name=_name: sc.elimination.eliminate(
        **{"C": ROWS.C, "b": ROWS.b, name: v}
    )


class Saved:
    """Values that `save_state` rightly takes."""

    def __contains__(self, value):
        return value is RESULT or value is OTHER


SAVED = Saved()


@pytest.mark.parametrize("argument", CALLS)
def test_what_is_wrong_is_refused_in_words(argument):
    """Nothing but an error of the library escapes from a wrong input, with a message of some length."""
    refused = 0
    for name, value in BAD.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                CALLS[argument](value)  # some are no mistake for this argument
            except sc.ContactError as error:
                refused += 1
                assert len(str(error)) > 30, f"{name}: {error}"
            except TypeError as error:  # a function of the user's, called with what it does not take
                assert "positional argument" in str(error), f"{name}: {error}"
    assert refused > 10


@pytest.mark.parametrize("wrong", [2.5, np.inf])
def test_counts_are_whole_numbers(wrong):
    """Of iterations and cuts there is no half, and no end is none of them."""
    for name in ("max_iterations", "max_cuts"):
        with pytest.raises(sc.errors.InputError, match=rf"{name} = .* give a whole number"):
            sc.Options(**{name: wrong})


def test_numbers_in_other_clothes_are_taken():
    """NumPy scalars, lists of integers and generators of steps are right inputs, and stay so."""
    touch(adjust=np.float32(0.1), reach=np.int64(3), tied=np.bool_(False), gap=[0, 0, 0])
    touch(friction=sc.Coulomb([0, 1, 2], tau_max=np.array(1.0), stiffness=10))
    assert sc.Options(max_cuts=np.int64(2), max_travel=np.inf).max_cuts == 2
    steps = (
        {"motion": {"floor": m}} for m in ([0, 1e-3], ([0, 1e-3], 0, [0, 0]), ((0, 0), 0.0, (0, 0)))
    )
    assert len(list(SOLVER.history(steps))) == 3
    assert len(list(SOLVER.history(np.linspace(0.5, 1, 2)))) == 2
    assert len(list(SOLVER.history([{"f": {"block": np.float64(0)}, "x": {"block": 1}}]))) == 1


@pytest.mark.parametrize(
    "argument",
    [
        "Body f",
        "Body x",
        "solve f",
        "Contact interference",
        "Contact gap",
        "Coulomb mu",
        "Tresca tau_max",
    ]
    + ["step f by name", "step interference by name", "RigidPlane point", "update f"],
)
def test_masked_entries_have_no_value(argument):
    """NumPy would take the numbers that are hidden under the mask."""
    size = {
        "RigidPlane point": 2,
        "Body f": N,
        "Body x": N,
        "solve f": N,
        "step f by name": N,
        "update f": N,
    }
    values = np.ma.masked_array(np.zeros(size.get(argument, 3)), mask=False)
    CALLS[argument](values)  # nothing is hidden
    values[0] = np.ma.masked
    with pytest.raises(sc.errors.InputError, match="masked array, 1 of its entries"):
        CALLS[argument](values)


def test_law_with_wrong_number_of_points():
    """A coefficient per point has to fit the points, and the message has both numbers."""
    with pytest.raises(sc.errors.InputError, match=r"mu .* has shape \(2,\).* has 3 points"):
        touch(friction=sc.Coulomb([0.1, 0.2]))
