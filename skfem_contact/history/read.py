"""Load steps of the user, read as a `LoadCase` over all bodies and contact points.

What a history has come to so far is kept without loads that its steps tell, and put together again by
reading them (`PartialResults`).
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from typing import Any

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import number, numbers, shown, suggest
from skfem_contact.arrays import Array, check_finite, check_size, same
from skfem_contact.bodies.inputs import is_load
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact, field_values
from skfem_contact.conditions.geometry import Geometry
from skfem_contact.conditions.interface import point_slices
from skfem_contact.conditions.state import BoltLoads, LoadCase, Motion
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import read_motion
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.records import copied

KEYS = ("f", "x", "interference", "motion", "bolt")


class StepReader:
    """Reads steps: a number, or a dict that replaces just what it names."""

    def __init__(
        self,
        system: System,
        contacts: tuple[Contact, ...],
        names: tuple[str, ...],
        geometry: Geometry,
        own_f: Array,
        own_apart: Mapping[int, Array],
        bolts: tuple[str, ...] = (),
    ) -> None:
        self.system, self.contacts, self.names, self.bolts = system, contacts, names, bolts
        self.kin, self._own, self.own_f = geometry.kin, geometry.interference, own_f
        self.own_apart, self._spans = own_apart, system.spans
        self.point_slices = point_slices(contacts)
        d = self.kin.points.shape[1]
        self._still = (Motion.none(d),) * len(contacts)

    def initial(self) -> LoadCase:
        """The bodies' own loads and the contacts' own interference."""
        own = self._placed(np.concatenate(self._own), self._still)
        ours = (True,) * len(self.contacts)
        loads = {"f": self.own_f, "x": self.system.x, "apart": self.own_apart}
        return copied(own, **loads, own=ours, scale=(1.0, 1.0), factor=1.0)

    def unloaded(self) -> LoadCase:
        """No load, no prescribed displacement, no interference: where a history begins."""
        return self._placed(np.zeros(self.kin.gap0.shape), self._still)

    def resumed(self, start: LoadCase, found: Array, own: bool = False) -> LoadCase:
        """The loads of a state to go on from: a multiple of own loads is one of those here.

        Bodies may have other loads and supports of their own in the solver that goes on. Where steps
        have named displacements, supports that the state had not hold the body where they find it.

        Parameters
        ----------
        start : LoadCase
        found : ndarray, shape (n,)
            Its prescribed displacements, with the places of such supports [length].
        own : bool, optional
            Whether it is a state of this very geometry, of which gaps and slips are known.
        """
        f, x = start.scale
        given = [start.interference[part] for part in self.point_slices]
        ours = [
            was and np.array_equal(there, here)
            for was, there, here in zip(start.own, given, self._own, strict=True)
        ]
        return copied(
            start if own else self._placed(start.interference, start.motion),
            f=start.applied if f is None else f * self.own_f,
            x=found if x is None else x * self.system.x,
            own=tuple(ours),
            bolts=None,
            scale=start.scale,
            multiples=start.multiples,
            factor=start.factor,
            apart=start.apart if f is None else self._times(f),
        )

    def other_interference(self, start: LoadCase) -> str:
        """In words which contact's own interference a state of another solver leaves without effect."""
        for name, part, own, here in zip(
            self.names, self.point_slices, start.own, self._own, strict=True
        ):
            there = start.interference[part]
            if own and not np.array_equal(there, here):
                worst = int(np.argmax(np.abs(there - here)))
                return (
                    f"contact {name!r} has an interference of {here[worst]:.6g} here and "
                    f"of {there[worst]:.6g} in the state to go on from, which stays: what no step "
                    "names is as it was. If it is to change, name it in a step of history(...): "
                    f"{{'interference': {{{name!r}: ...}}}}."
                )
        return ""

    def _placed(self, interference: Array, motion: tuple[Motion, ...]) -> LoadCase:
        """Gaps and slips with interferences (m,) and obstacles that have moved; no loads."""
        kin = self.kin
        gap0, slip0 = np.array(kin.gap0), np.zeros((len(kin.gap0), kin.tangents))
        gap0 += kin.of_rows(np.concatenate(self._own) - interference)
        for part, moved in zip(self.point_slices, motion, strict=True):
            if moved is not self._still[0]:
                shift = moved.shift(kin.action[part])
                gap0[part] -= np.einsum("id,id->i", kin.normal[part], shift)
                slip0[part] -= np.einsum("ikd,id->ik", kin.axes[part], shift)
        nothing = np.zeros(self.system.n)
        return LoadCase(nothing, nothing, gap0, slip0, interference, motion)

    def read(self, step: Any, before: LoadCase) -> LoadCase:
        """The loads in force after a step; one that was made of others here is taken as it is."""
        if isinstance(step, LoadCase):
            return step
        if isinstance(step, Mapping):
            unknown = set(step) - set(KEYS)
            if unknown:
                raise InputError(
                    f"a load step names {sorted(map(str, unknown))}; it may name {list(KEYS)}, each "
                    "a dict by body, contact, obstacle or bolt name."
                )
            f, x = step.get("f"), step.get("x")
            load = self.vector("f", f, before.f, self.own_f)
            return copied(
                self._moved(step.get("interference"), step.get("motion"), before),
                f=load,
                x=self.vector("x", x, before.x, self.system.x),
                scale=(before.scale[0] if f is None else None, before.scale[1] if x is None else None),
                multiples=self._multiples((f, x), before),
                factor=None,
                bolts=self._tightened(step.get("bolt")),
                apart=self._apart(f, load, before.apart),
            )
        try:
            factor = number(step, "a load step", "")
        except InputError:
            raise InputError(
                f"a load step is {shown(step)}: it has to be a number (the factor on the bodies' own f "
                "and x) or a dict with some of the keys " + ", ".join(KEYS)
            ) from None
        if not np.isfinite(factor):
            raise InputError(f"a load step is {factor}: give a finite factor.")
        if factor not in (0.0, 1.0) and not (self.own_f.any() or self.system.x.any()):
            raise InputError(
                f"a load step is {shown(step)}, a factor on the bodies' own f and x, but these are "
                "zero: nothing would change. Give f or x to a Body, or the loads of the step by name; "
                "an interference is not scaled by a number, write {'interference': {...}}."
            )
        f, x = factor * self.own_f, factor * self.system.x
        apart = self._times(factor)
        return copied(before, f=f, x=x, scale=(factor, factor), factor=factor, bolts=None, apart=apart)

    def _times(self, factor: float) -> dict[int, Array]:
        """A multiple of what is known apart of the bodies' own loads."""
        return {i: factor * own for i, own in self.own_apart.items()}

    def _apart(self, given: Any, load: Array, before: Mapping[int, Array]) -> Mapping[int, Array]:
        """What is known apart after a step that names loads, which have been read, (n,)."""
        if not isinstance(given, Mapping):
            return before if given is None else {}
        parts: dict[int, Any] = dict(before)
        for name, value in given.items():
            i = self.system.index(name)
            factor = not is_load(value) and np.ndim(value) == 0  # on its own
            body, own = self.system.bodies[i], load[self._spans[i]]
            parts[i] = self._times(value).get(i) if factor else body.apart(value, own)
        return {i: part for i, part in parts.items() if part is not None}

    def _multiples(self, given: tuple[Any, Any], before: LoadCase) -> Array:
        """By which numbers steps multiply the own f and x of each body, (2, bodies)."""
        out = np.ones((2, len(self.system.bodies)))
        if before.multiples is not None:
            out[:] = before.multiples
        for row, scale, named in zip(out, before.scale, given, strict=True):
            if scale is not None:
                row[:] = scale
            if named is not None and not isinstance(named, Mapping):
                row[:] = 1.0
            for name, value in named.items() if isinstance(named, Mapping) else ():
                factor = not is_load(value) and np.ndim(value) == 0
                row[self.system.index(name)] = value if factor else 1.0
        return out

    def vector(self, what: str, given: Any, before: Array, own: Array) -> Array:
        """A stacked vector from a dict by body name, a stacked vector, or None."""
        if given is None:
            return before
        units = self.system.units if what == "x" else 1.0 / self.system.units
        parts: list[tuple[slice, Array]]
        if isinstance(given, Mapping):
            named: dict[int, tuple[slice, Array]] = {}
            for name, value in given.items():
                i = self.system.index(name)
                span, scale = (
                    self._spans[i],
                    units if isinstance(units, float) else units[self._spans[i]],
                )
                was = named[i][1] if i in named else before[span]
                named[i] = span, self._part(what, name, value, was, own[span], scale)
            parts = list(named.values())
        else:
            whole = _checked(given, self.system.n, f"{what} of all bodies")
            for body, name, span in zip(
                self.system.bodies, self.system.names, self._spans, strict=True
            ):
                if what == "x" and whole[span].any():
                    _needs_places(body, name)
            parts = [(slice(None), whole * units)]
        # what is named and stays as it was is the same vector: what follows from it is known
        changed = [(span, values) for span, values in parts if not same(values, before[span])]
        if not changed:
            return before
        out = np.array(before)
        for span, values in changed:
            out[span] = values
        return out

    def _part(
        self, what: str, name: Any, value: Any, was: Array, own: Array, scale: Array | float
    ) -> Array:
        """What a step gives to one body, from what it was and what is the body's own, (n_body,)."""
        body, label = self.system.bodies[self.system.index(name)], f"{what} of body {name!r}"
        if what == "f" and is_load(value) and not isinstance(body, RigidBody):
            return body.load(value, label) * scale
        if isinstance(value, Mapping):
            if what == "x" and isinstance(body, RigidBody):
                body.check_held(body.numbers(value, label), label)
            return np.asarray(body.displaced(value, was / scale, label) * scale)
        given = _checked(value, None, label)
        if what == "x":
            _needs_places(body, name)
        if isinstance(body, RigidBody) and given.shape not in ((), (len(was),)):
            named = {k: v for k, v in zip(body.directions, given.tolist(), strict=False) if v}
            raise InputError(
                f"{label}, which is rigid, is {shown(value)}: write {named or {'y': 0.0}}, of "
                f"{', '.join(map(repr, body.directions))}, or {len(was)} numbers"
            )
        if given.ndim:
            _check_size(given, len(was), label)
            return given if isinstance(scale, float) else given * scale
        if given != 0 and not own.any():  # a number is a factor on the body's own
            raise InputError(
                f"{what} of body {name!r} is {shown(value)}, a factor on its own {what}, but that is "
                f"zero: nothing would change. Give {what} to the Body, or a vector here."
            )
        return np.asarray(given * own)

    def _moved(self, interference: Any, motion: Any, before: LoadCase) -> LoadCase:
        """The loads before, with the interferences and places of obstacles that a step names."""
        if interference is None and motion is None:
            return before
        values, own = np.array(before.interference), list(before.own)
        for name, value in self._named(interference, "interference").items():
            if name not in self.names:
                raise InputError(
                    f"interference: there is no contact {name!r}{suggest(name, self.names, 'contacts')}"
                )
            i = self.names.index(name)
            part, what = self.point_slices[i], f"interference of contact '{name}'"
            values[part], own[i] = field_values(value, self.kin.points[part], what), False
        moved = list(before.motion)
        for name, value in self._named(motion, "motion").items():
            for i in self._obstacles(name):
                whose = f"motion of {self.names[i]!r}"
                moved[i] = Motion(*read_motion(value, self.kin.points.shape[1], whose))
        placed = self._placed(values, tuple(moved))
        kept = {"f": before.f, "x": before.x, "scale": before.scale, "multiples": before.multiples}
        return copied(placed, own=tuple(own), **kept)

    def _tightened(self, given: Any) -> BoltLoads | None:
        """The forces or stretches of bolts that a step names; None where it names no bolt."""
        if given is None:
            return None
        shift, force = np.full((2, len(self.bolts)), np.nan)
        usage = "give {'force': 15e3} or {'stretch': 0.02}"
        for name, value in self._named(given, "bolt").items():
            if name not in self.bolts:
                raise InputError(f"bolt: there is no bolt {name!r}{suggest(name, self.bolts, 'bolts')}")
            if not isinstance(value, Mapping) or list(value) not in (["force"], ["stretch"]):
                raise InputError(f"bolt {name!r} in a load step is {shown(value)}; {usage}")
            (what, size), i = next(iter(value.items())), self.bolts.index(name)
            found = number(size, f"{what} of bolt {name!r}", usage)
            if not np.isfinite(found) or (what == "force" and found < 0):
                raise InputError(
                    f"{what} of bolt {name!r} is {found:g}: a bolt pulls, by a finite force >= 0; to "
                    "let it loose give the force 0, or a stretch"
                )
            (force if what == "force" else shift)[i] = found
        return BoltLoads(shift, force)

    def _obstacles(self, name: Any) -> list[int]:
        """The contacts with an obstacle of this name."""
        known = [contact.primary.name if contact.rigid else None for contact in self.contacts]
        rigid = [i for i, contact in enumerate(self.contacts) if contact.rigid]
        meant = [i for i in rigid if name in (known[i], self.names[i])]
        for i in meant:
            body = self.contacts[i].rigid_body
            if body is not None:
                whose = self.system.names[self.system.index(body)]
                raise InputError(
                    f"motion: {name!r} is a rigid body, which moves by its loads. Prescribe its motion "
                    f"by D=(...) of the RigidBody and a step {{'x': {{{whose!r}: {{'y': -0.1}}}}}}."
                )
        if not meant:
            listed = [known[i] or self.names[i] for i in rigid]
            raise InputError(
                f"motion: there is no obstacle {name!r}{suggest(name, listed, 'obstacles')}"
            )
        return meant

    @staticmethod
    def _named(given: Any, what: str) -> Mapping[str, Any]:
        if given is None:
            return {}
        if not isinstance(given, Mapping):
            raise InputError(f"{what} in a load step has to be a dict by name, not {given!r}.")
        return given


def _needs_places(body: Member, name: Any) -> None:
    if not len(body.D):
        raise InputError(
            f"x of body {name!r} prescribes values, but the body has no prescribed DOFs: say "
            "at which by D of its Body(...). A load goes to f."
        )


def _checked(value: Any, size: int | None, what: str) -> Array:
    usage = "give a vector, or a number as a factor on the body's own"
    array = numbers(value, what, usage, copy=False)
    if size is not None:
        _check_size(array, size, what)
    check_finite(array.ravel(), what)
    return array


def _check_size(array: Array, size: int, what: str) -> None:
    if array.shape == (size,):
        return
    why = (
        f"but {size} DOFs belong to it. Usually the vector was assembled on another basis, or the "
        "load is not stacked in the order of the bodies."
    )
    check_size(array, size, what, why)


class PartialResults:
    """Results of one history, in their order; without the loads that a number stands for."""

    def __init__(self) -> None:
        self._light: list[tuple[Answer, StepReader]] = []
        self._alive: list[weakref.ref[ContactResult]] = []

    def add(self, answer: Answer, result: ContactResult, reader: StepReader) -> None:
        """Keep an answer and its result; `reader` knows the loads that a number stands for."""
        # a number stands for the loads, but not for those of bolts
        named = answer.factor is None or bool(reader.bolts)
        none = answer.case.f[:0]
        light = copied(answer) if named else _with_loads(answer, none, none)
        self._light.append((light, reader))
        self._alive.append(weakref.ref(result))

    def all(self) -> tuple[ContactResult, ...]:
        """The results themselves where they are still held by somebody, and equal ones elsewhere."""
        found = []
        for (light, reader), alive in zip(self._light, self._alive, strict=True):
            result = alive()
            if result is None:
                if light.factor is not None and not reader.bolts:
                    loads = reader.read(light.factor, light.case)
                    light = _with_loads(light, loads.f, loads.x)
                result = ContactResult(light)
            found.append(result)
        return tuple(found)


def _with_loads(answer: Answer, f: Array, x: Array) -> Answer:
    """The same answer with other vectors of loads, and without what it remembers."""
    case = copied(answer.case, f=f, x=x)
    seen = case if answer.seen is answer.case else copied(answer.seen, f=f, x=x)
    return copied(answer, case=case, seen=seen, recover=copied(answer.recover, case=case))
