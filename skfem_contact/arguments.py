"""Checks of numbers, words, switches and lists that users pass, with the name of the argument.

Attributes and members that users ask for by name, too: `NamesAttributes`, `Named`.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import inspect
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from skfem_contact.errors import InputError, UnknownKeyword
from skfem_contact.records import NotMade

Array = NDArray[np.float64]
P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)
T = TypeVar("T")
WORDS = (bool, np.bool_, str, bytes)

# How many of a kind a message names: points that can not all be closed, rows that contradict others.
NAMED = 4


def shown(value: Any) -> str:
    """A value for a message: what it is, and not more of it than fits a line.

    >>> shown("left"), shown([1])
    ("'left'", '[1] (list)')
    """
    text = " ".join(repr(value).split())
    text = text if len(text) <= 60 else text[:57] + "..."
    plain = value is None or isinstance(value, str | int | float | complex)
    return text if plain else f"{text} ({type(value).__name__})"


def suggest(name: str, known: Iterable[str], what: str) -> str:
    """Tail of a message about an unknown name: close matches, then everything known.

    Close are names that are spelt alike, and those that begin in the same way.

    >>> suggest("botom", ["bottom", "top"], "boundaries")
    "; did you mean 'bottom'? Known boundaries: 'bottom', 'top'"
    """
    known, name = sorted(known), str(name)
    if not known:
        return f"; there are no {what} with a name"
    hint = did_you_mean(name, known) or ";"
    return f"{hint} Known {what}: {', '.join(map(repr, known))}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The same tail with the close matches alone; empty if there are none.

    >>> did_you_mean("contact_pressure", ["pressure", "gap"])
    "; did you mean 'pressure'?"
    """
    known = sorted(known)
    begun = [k for k in known if name and (k.startswith(name) or name.startswith(k))]
    ended = [k for k in known if name.endswith(f"_{k}")]
    spelt = difflib.get_close_matches(name, known, n=3)
    spelt += [k for k in known if k.lower() == name.lower()]
    close = list(dict.fromkeys([*begun, *ended, *spelt]))[:3]
    return f"; did you mean {' or '.join(map(repr, close))}?" if close else ""


class NamesAttributes:
    """Answers an attribute that there is not by those with names like it.

    >>> class Tower(NamesAttributes):
    ...     height = 3.0
    >>> Tower().heigth
    Traceback (most recent call last):
        ...
    AttributeError: Tower has no attribute 'heigth'; did you mean 'height'?
    """

    if not TYPE_CHECKING:  # type checkers know what there is

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_"):  # asked for by Python, as a rule
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            if hasattr(type(self), name):  # a property that failed: its own error
                return object.__getattribute__(self, name)
            known = [key for key in dir(self) if not key.startswith("_")]
            hint = did_you_mean(name, known) or f"; it has {', '.join(known)}"
            words = f"{type(self).__name__} has no attribute {name!r}{hint}"
            raise AttributeError(words, obj=self)  # without name=, or Python adds a guess of its own


class Named(Sequence[T], Generic[T]):
    """A sequence that never changes, asked by position or by name.

    >>> few = Named(["x", "y"], ["first", "second"], "letters")
    >>> few["second"], few[0], list(few), few.names
    ('y', 'x', ['x', 'y'], ('first', 'second'))
    >>> few
    <letters: first, second>
    """

    def __init__(self, members: Sequence[T], names: Sequence[str], kind: str) -> None:
        self._members, self.names, self._kind = tuple(members), tuple(names), kind

    def __len__(self) -> int:
        return len(self._members)

    def __repr__(self) -> str:
        return f"<{self._kind}: {', '.join(self.names)}>"

    @overload
    def __getitem__(self, key: int | str) -> T: ...
    @overload
    def __getitem__(self, key: slice) -> Sequence[T]: ...
    def __getitem__(self, key: Any) -> Any:
        return self._members[self.index_of(key) if isinstance(key, str) else key]

    def index_of(self, name: str) -> int:
        """The position of a member by its name."""
        if name not in self.names:
            raise InputError(
                f"there is no {name!r} among the {self._kind}{suggest(name, self.names, self._kind)}"
            )
        return self.names.index(name)


def numbers(value: Any, what: str, usage: str, copy: bool = True) -> Array:
    """An array of real numbers; NaN and infinity are left to the caller.

    With `copy` it is the caller's to keep and to change; without, it may be the user's own.

    >>> numbers([1, 2], "f", "give a vector").tolist()
    [1.0, 2.0]
    """
    check_unmasked(value, what)
    try:
        array = np.asarray(value)
        # NumPy makes numbers of True, and of words such as "1.0" among objects
        if array.dtype.kind not in "fiuO" or (
            array.dtype.kind == "O"
            and any(entry is None or isinstance(entry, WORDS) for entry in array.flat)
        ):
            raise TypeError
        return np.array(array, dtype=float) if copy else np.asarray(array, dtype=float)
    except (TypeError, ValueError, IndexError, OverflowError, AttributeError):
        raise InputError(
            f"{what} is {shown(value)}, which is not made of real numbers; {usage}"
        ) from None


def check_unmasked(value: Any, what: str) -> None:
    """Refuse masked entries: NumPy would take what is hidden under the mask."""
    if np.ma.is_masked(value):
        raise InputError(
            f"{what} is a masked array, {int(np.ma.count_masked(value))} of its entries have no value; "
            "give them one, values.filled(0.0)"
        )


def number(value: Any, what: str, usage: str) -> float:
    """One real number.

    >>> number(3, "radius", "give a length")
    3.0
    """
    array = numbers(value, what, usage)
    if array.shape:
        raise InputError(f"{what} has shape {array.shape} and has to be one number; {usage}")
    return float(array)


def finite(value: Any, sizes: tuple[int, ...], what: str, wanted: str) -> Array:
    """A vector of one of these sizes, of finite numbers."""
    array = numbers(value, what, f"give {wanted}")
    if array.ndim != 1 or len(array) not in sizes or not np.isfinite(array).all():
        raise InputError(f"{what} is {shown(value)}; give {wanted}")
    return array


def whole_number(value: Any, what: str, least: int, most: float = math.inf) -> None:
    """A whole number within bounds.

    >>> whole_number(2.0, "steps", 1)
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: steps is 2.0; give a whole number from 1 on
    """
    if not isinstance(value, int | np.integer) or not least <= value <= most:
        bounds = f"from {least} on" if math.isinf(most) else f"from {least} to {most}"
        raise InputError(f"{what} is {shown(value)}; give a whole number {bounds}")


def positive(**values: float) -> None:
    """Raise `InputError` unless every named value is a positive number.

    Examples
    --------
    >>> positive(R=1.0, P=2.0)
    >>> positive(R=-1.0)
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: R = -1.0 must be positive.
    """
    for name, value in values.items():
        if not value > 0:
            raise InputError(f"{name} = {value} must be positive.")


def not_negative(**values: float) -> None:
    """Raise `InputError` unless every named value is zero or positive."""
    for name, value in values.items():
        if not value >= 0:
            raise InputError(f"{name} = {value} must be zero or positive.")


def poisson(*ratios: float) -> None:
    """Raise `InputError` unless every Poisson's ratio lies in (-1, 0.5]."""
    for nu in ratios:
        if not -1 < nu <= 0.5:
            raise InputError(f"Poisson's ratio nu = {nu} must lie in (-1, 0.5].")


def check_name(value: Any, what: str) -> None:
    """A name is a string, or not given."""
    if value is not None and not isinstance(value, str):
        raise InputError(
            f"{what} is {shown(value)}, which is not a string; leave it out where there is none"
        )


def check_switch(value: Any, what: str) -> None:
    """True or False; what only counts as one of these in Python is a mistake."""
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{what} is {shown(value)}; it is a switch, True or False")


def file_path(value: Any) -> Path:
    """The name of a file, or a Path."""
    try:
        return Path(value)
    except TypeError:
        raise InputError(f"path is {shown(value)}; give the name of a file, or a Path") from None


def members(value: Any, kind: Any, what: str, usage: str, called: str = "") -> list[Any]:
    """One object of a kind, or several of them; `called` in messages, if not by its own name.

    Of one of several kinds, if `kind` is a tuple: `called` is then needed.

    >>> members("disc", (str, int), "bodies", "give names", "name"), members((1, 2), int, "n", "")
    (['disc'], [1, 2])
    """
    called = called or kind.__name__
    try:
        found = [value] if isinstance(value, kind) else list(value)
    except (TypeError, AttributeError):
        raise InputError(
            f"{what} is {shown(value)}, neither a {called} nor a list of them; {usage}"
        ) from None
    for i, member in enumerate(found):
        check_kind(member, kind, f"{what}[{i}]", usage, called)
    return found


def names_of(members: Iterable[Any], one: str, many: str) -> tuple[str, ...]:
    """Names of some things; a missing one is numbered, a repeated one refused.

    >>> from types import SimpleNamespace
    >>> names_of([SimpleNamespace(name="left"), SimpleNamespace(name=None)], "bolt", "bolts")
    ('left', 'bolt 2')
    """
    names = tuple(member.name or f"{one} {i + 1}" for i, member in enumerate(members))
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        words = ", ".join(map(repr, repeated))
        raise InputError(f"several {many} are named {words}; give each its own `name`")
    return names


def check_kind(value: Any, kind: Any, what: str, usage: str, called: str = "") -> None:
    """An object of a class of this package, or of one of several."""
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        names = called or " or ".join(k.__name__ for k in kinds)
        raise InputError(f"{what} is {shown(value)}, not a {names}; {usage}")


def known_keywords(**elsewhere: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Of a function or method: answers unknown keywords by those it has, or by what to write instead.

    >>> @known_keywords()
    ... def tower(height):
    ...     pass
    >>> tower(heigth=3)
    Traceback (most recent call last):
        ...
    skfem_contact.errors.UnknownKeyword: tower has no argument 'heigth'; did you mean 'height'? ...
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        return _answering(function, function.__name__, elsewhere)

    return decorate


def with_known_keywords(surplus: str = "", /, **elsewhere: str) -> Callable[[C], C]:
    """Of a class: its constructor answers unknown keywords, see `known_keywords`.

    `surplus` is what usually is wrong where it is given too much without names.
    """

    def decorate(cls: C) -> C:
        def answering(takes: Callable[P, R]) -> Callable[P, R]:
            return _answering(takes, cls.__name__, elsewhere, surplus)

        takes = vars(cls).get("__init__") or cls.__init__  # type: ignore[misc]
        if isinstance(takes, NotMade):
            takes.then = answering
        else:
            cls.__init__ = answering(takes)  # type: ignore[misc]
        return cls

    return decorate


def _answering(
    function: Callable[P, R], name: str, elsewhere: dict[str, str], surplus: str = ""
) -> Callable[P, R]:
    @functools.cache  # to ask for it takes as long as to import a module
    def asked() -> tuple[list[str], bool, list[str]]:
        takes = inspect.signature(function).parameters.values()
        first = [p.name for p in takes if p.kind is p.POSITIONAL_OR_KEYWORD]
        bounded = all(p.kind is not p.VAR_POSITIONAL for p in takes)
        known = [p.name for p in takes if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
        return first, bounded, [k for k in known if k not in ("self", "cls")]

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        first, bounded, known = asked()
        for key in kwargs:
            if key not in known:
                there = elsewhere.get(key)
                hint = f": {there}" if there else suggest(key, known, "arguments")
                raise UnknownKeyword(f"{name} has no argument {key!r}{hint}")
        if bounded and len(args) > len(first):
            raise UnknownKeyword(_too_many(name, first, known, len(args), surplus))
        return function(*args, **kwargs)

    return checked


def _too_many(name: str, first: list[str], known: list[str], given: int, surplus: str) -> str:
    """Say which arguments have to be named where more came without names than there are."""
    own = first[:1] in (["self"], ["cls"])
    plain, count = first[own:], given - own
    named = [k for k in known if k not in first]
    order = f"{name}({', '.join([*plain, *(f'{k}=...' for k in named)])})"
    return f"{name} was given {count} arguments without a name and takes {len(plain)}: {order}{surplus}"


def take(thing: Any, **given: Any) -> None:
    """Keeps what the constructor of a frozen dataclass was given as its fields, and has it checked.

    Such a class has a constructor of its own where users may give more than its fields then hold, a
    list for an array: fields have the type that is read, parameters the type that goes in. Dataclasses
    derived from it are checked as well, since the checks stay in ``__post_init__``.

    >>> @dataclasses.dataclass(frozen=True, init=False)
    ... class Point:
    ...     place: Array
    ...
    ...     def __init__(self, place: ArrayLike) -> None:
    ...         take(self, place=place)
    ...
    ...     def __post_init__(self) -> None:
    ...         object.__setattr__(self, "place", numbers(self.place, "place", "give coordinates"))
    >>> Point([0, 1]).place
    array([0., 1.])
    """
    vars(thing).update(given)
    thing.__post_init__()


class PrintedAsCall(NamesAttributes):
    """Dataclasses that print as the call that makes them: in its order, without what is by default.

    >>> @dataclasses.dataclass(frozen=True, eq=False)
    ... class Law(PrintedAsCall):
    ...     mu: float
    ...     tau_max: float = np.inf
    ...     stiffness: float | None = dataclasses.field(default=None, kw_only=True)
    >>> Law(0.3, stiffness=2.0), Law(np.full(41, 0.3))
    (Law(mu=0.3, stiffness=2.0), Law(mu=<41 numbers>))
    """

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        if "__repr__" not in vars(cls):  # what dataclass makes has the fields of the base first
            cls.__repr__ = _as_call  # type: ignore[method-assign]


def _as_call(thing: Any) -> str:
    name = type(thing).__name__
    if not dataclasses.is_dataclass(thing):
        return object.__repr__(thing)
    given = []
    for f in sorted(dataclasses.fields(thing), key=lambda f: bool(f.kw_only)):
        value = getattr(thing, f.name)
        usual = value is f.default or (np.ndim(value) == 0 and value == f.default)
        if f.init and not usual:
            given.append(f"{f.name}={_brief(value)}")
    return f"{name}({', '.join(given)})"


def _brief(value: Any) -> str:
    if not isinstance(value, np.ndarray):
        return repr(value)
    return repr(tuple(value.tolist())) if value.shape in ((2,), (3,)) else f"<{value.size} numbers>"
