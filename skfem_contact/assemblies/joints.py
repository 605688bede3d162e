"""Tables of an assembly: its joints after one load step, and several load cases beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from skfem_contact.arguments import Named, NamesAttributes
from skfem_contact.arrays import Array
from skfem_contact.bodies.selection import written
from skfem_contact.conditions.friction import CheckedLaw
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass, sealed

T = TypeVar("T")


class Table(Named[T]):
    """Rows of names, numbers and vectors, that print in text, in notebooks, and as a pandas frame.

    Parameters
    ----------
    heads : sequence of str
    rows : sequence of sequences
        Each begins with its name.
    members : sequence
        What rows are of: `Named`.
    kind : str

    Examples
    --------
    >>> print(
    ...     Table(
    ...         ("joint", "force", "slip margin"),
    ...         [("seat", (0.0, 5.0), 0.75), ("rim", 1.0, np.nan)],
    ...         [1, 2],
    ...         "joints",
    ...     )
    ... )
    joint  force   slip margin
    seat   (0, 5)         0.75
    rim    1                 -
    """

    def __init__(
        self, heads: Sequence[str], rows: Sequence[Sequence[Any]], members: Sequence[T], kind: str
    ) -> None:
        super().__init__(members, [row[0] for row in rows], kind)
        self.heads, self.rows = tuple(heads), [tuple(row) for row in rows]

    def _cells(self) -> list[tuple[str, ...]]:
        return [self.heads, *(tuple(map(_shown, row)) for row in self.rows)]

    def __str__(self) -> str:
        # columns of numbers stand to the right
        first = (self.rows or [self.heads])[0]
        return aligned(self._cells(), [isinstance(v, str) or np.ndim(v) > 0 for v in first])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        from html import escape  # for notebooks alone

        head, *rows = self._cells()
        lines = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
        body = "".join(f"<tr>{line}</tr>" for line in lines)
        top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
        return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"

    def to_frame(self) -> Any:
        """The table as a `pandas.DataFrame`, with a column for each component of vectors.

        Raises
        ------
        InputError
            If pandas is missing.
        """
        try:
            import pandas  # type: ignore[import-untyped]
        except ImportError:
            raise InputError(
                "pandas is not installed: pip install pandas. print(table) needs nothing"
            ) from None
        columns: dict[str, Any] = {}
        for head, values in zip(self.heads, zip(*self.rows, strict=True), strict=True):
            if np.ndim(values[0]) == 0:
                columns[head] = values
            else:
                columns |= {f"{head} {a}": x for a, x in zip("xyz", np.transpose(values), strict=False)}
        return pandas.DataFrame(columns)


def aligned(rows: Sequence[Sequence[str]], left: Sequence[bool]) -> str:
    """Lines of columns, to the left or to the right each.

    >>> print(aligned([("name", "size"), ("rim", "0.5")], (True, False)))
    name  size
    rim    0.5
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    put = [str.ljust if to_left else str.rjust for to_left in left]
    lines = ["  ".join(map(lambda f, c, w: f(c, w), put, row, widths)) for row in rows]
    return "\n".join(line.rstrip() for line in lines)


def _shown(value: Any) -> str:
    if isinstance(value, str):
        return value
    if np.ndim(value):
        return written(np.asarray(value) + 0.0)
    return "-" if np.isnan(value) else f"{value + 0.0:.6g}"


@dataclass(frozen=True, eq=False)
class Joint(NamesAttributes):
    """Force, moment and pressures of one contact, in a few numbers.

    Attributes
    ----------
    name : str
    force : ndarray, shape (d,)
        Resultant on the secondary body [force].
    moment : float, or ndarray (3,) in 3-D
        Of these forces about the middle of the secondary surface [force length].
    closed : float
        Area of the points that touch, over that of all.
    slip_margin : float
        One less the resultant of friction over the sum of what friction may be at the points: how far
        the joint is from slipping as a whole. NaN where there is no friction or no force, and of tied
        contacts.
    sticking : float
        Area of the points that stick, over that of all that touch; NaN as `slip_margin` is. Most points
        may slip long before the joint slips as a whole.
    mean_pressure, largest_pressure : float
        Over what touches; the largest at a point [stress].
    energy : float
        Lost by friction since the start of the history [energy].

    Examples
    --------
    >>> joint = Joint("seat", np.array([3.0, 20.0]), 1.5, 1.0, 0.7, 0.9, 10.0, 14.0, 0.0)
    >>> joint.closed, joint.slip_margin
    (1.0, 0.7)
    """

    name: str
    force: Array
    moment: Any
    closed: float
    slip_margin: float
    sticking: float
    mean_pressure: float
    largest_pressure: float
    energy: float

    @classmethod
    def of(cls, values: Any) -> Joint:
        """Say that of a `ContactValues`."""
        closed, area, points = values.status != OPEN, values.area, values.points
        touching, margin, sticking = float(area[closed].sum()), np.nan, np.nan
        law = values.contact.friction
        if law is not None and touching > 0:
            pressed = np.maximum(values.normal_force, 0.0)
            limit = CheckedLaw(law, values.name, points).limit(pressed, area, values.slip)
            bound = float(limit[closed].sum())
            friction = float(np.linalg.norm(values.tangential_force_vector.sum(axis=0)))
            margin = 1.0 - friction / bound if bound > 0 else np.nan
            sticking = float(area[values.status == STICK].sum()) / touching
        middle = np.average(points, axis=0, weights=area)
        # what cancels is printed as zero
        least = COMPUTED * float(np.abs(values.forces).sum())
        arm = float(np.abs(points - middle).max())
        force, moment = values.force, np.asarray(values.moment(middle))
        moment = np.where(np.abs(moment) < least * arm, 0.0, moment)
        return cls(
            name=values.name,
            force=sealed(np.where(np.abs(force) < least, 0.0, force)),
            moment=sealed(moment) if moment.ndim else float(moment),
            closed=float(touching / area.sum()),
            slip_margin=margin,
            sticking=sticking,
            mean_pressure=float(values.normal_force.sum()) / touching if touching > 0 else 0.0,
            largest_pressure=float(np.max(values.pressure, initial=0.0)),
            energy=values.dissipation_total,
        )


class Joints(Table[Joint]):
    """The joints of a result: a table, and each `Joint` by its name or in a loop.

    Parameters
    ----------
    joints : sequence of Joint

    Examples
    --------
    >>> joint = Joint("seat", np.array([3.0, 20.0]), 1.5, 1.0, 0.7, 0.9, 10.0, 14.0, 0.0)
    >>> joints = Joints([joint])
    >>> print(joints)
    joint  force    moment  closed  slip margin  sticking  mean pressure  largest pressure  energy
    seat   (3, 20)     1.5       1          0.7       0.9             10                14       0
    >>> joints["seat"].sticking
    0.9
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        names = [field.name for field in fields(Joint)]
        heads = ["joint", *(name.replace("_", " ") for name in names[1:])]
        rows = [[getattr(joint, name) for name in names] for joint in joints]
        super().__init__(heads, rows, joints, "joints")


class LoadCases(Table[Any]):
    """Several load cases from one state: the result of each, by its name too, and a table of all.

    The table has the force of each bolt, and of all joints the least closed share, the least slip
    margin and the largest pressure, each with the joint that has it.

    Parameters
    ----------
    results : dict of ContactResult

    Examples
    --------
    A block under two loads:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="left", name="block")
    >>> foot = sc.Contact(block.surface("right"), sc.RigidPlane((1, 0), (-1, 0)), name="foot")
    >>> loads = {
    ...     "none": {"f": {"block": {"right": (0.0, 0.0)}}},
    ...     "push": {"interference": {"foot": 0.05}},
    ... }
    >>> cases = sc.ContactSolver(block, foot).cases(loads)
    >>> print(cases)
    case  closed  closed of  slip margin  slip margin of  largest pressure  largest pressure of
    none       1  foot                 -  -                              0  foot
    push       1  foot                 -  -                           0.05  foot
    >>> cases["push"].force.round(9).tolist()
    [-0.05, 0.0]
    """

    def __init__(self, results: Mapping[str, Any]) -> None:
        rows: list[dict[str, Any]] = []
        for case, result in results.items():
            found = {"case": case, **{name: bolt.force for name, bolt in result.bolts.items()}}
            for what, pick in (("closed", min), ("slip_margin", min), ("largest_pressure", max)):
                known = [joint for joint in result.joints() if np.isfinite(getattr(joint, what))]
                head = what.replace("_", " ")
                # of joints that print alike the first, whatever their round-off
                at = pick(known, key=lambda joint: float(_shown(getattr(joint, what))), default=None)
                found[head] = np.nan if at is None else getattr(at, what)
                found[f"{head} of"] = "-" if at is None else at.name
            rows.append(found)
        values = [list(row.values()) for row in rows]
        super().__init__(list(rows[0]), values, list(results.values()), "load cases")
