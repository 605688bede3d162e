"""States on disk: a history that was interrupted goes on from them."""

from __future__ import annotations

import zlib
from dataclasses import field, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.arguments import file_path
from skfem_contact.arrays import Array
from skfem_contact.conditions.interface import Identity
from skfem_contact.conditions.state import LoadCase, Motion, State
from skfem_contact.errors import InputError, warn
from skfem_contact.records import dataclass

FORMAT = 9  # of the file; a file of another one is refused
# What reading a file may raise that is damaged, or that is none of ours.
DAMAGED = (OSError, ValueError, EOFError, KeyError, BadZipFile, zlib.error)


@dataclass(frozen=True, eq=False)
class SavedState:
    """The state that a history has come to, as ``solve`` and ``history`` need it for their ``start``.

    Attributes
    ----------
    state : State
        What friction remembers.
    case : LoadCase
        The loads in force, which stay as they are where the next step does not name them.
    dissipation_before, dissipation_by_contact : ndarray
        Energy lost before and in the last step, per contact [energy].
    identity : Identity
        The bodies and contacts that this is a state of.
    converged : bool
        A state that is not can be a `guess`, but no `start`.
    message : str
    tightness : dict
        Shift and force of each bolt by name [length], [force].
    u : ndarray, shape (n,)
        Displacements of all bodies, from which movement counts where a place is indifferent [length].
    material : tuple of dict
        Internal variables of each body; empty where all are linear.
    trend : ndarray, shape (n,)
        How the displacements of bodies that are not linear changed last [length].

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> import tempfile, pathlib
    >>> solver = sc.ContactSolver(block, foot)
    >>> path = solver.save_state(pathlib.Path(tempfile.mkdtemp()) / "state.npz", solver.solve())
    >>> start = solver.load_state(path)
    >>> start.converged
    True
    >>> solver.solve(start=start).converged  # the same loads again
    True
    """

    state: State
    case: LoadCase
    dissipation_before: Array
    dissipation_by_contact: Array
    identity: Identity
    converged: bool
    message: str
    u: Array
    tightness: dict[str, tuple[float, float]] = field(default_factory=dict)
    material: tuple[dict[str, Any], ...] = ()
    trend: Array = field(default_factory=lambda: np.zeros(0), repr=False)

    @property
    def bolt_names(self) -> tuple[str, ...]:
        """Names of the bolts."""
        return tuple(self.tightness)


def save_state(path: str | Path, result: Answer | SavedState) -> Path:
    """Write a state to an ``.npz`` file; see `ContactSolver.save_state`."""
    path = file_path(path)
    path = _with_suffix(path)
    case = result.case
    data: dict[str, Any] = {"format": FORMAT, "u": result.u}
    data |= {f"state_{name}": value for name, value in vars(result.state).items()}
    for name in ("x", "gap0", "slip0", "interference"):
        data[f"case_{name}"] = getattr(case, name)
    data["case_f"] = case.applied
    if result.tightness:
        data |= {"bolts": list(result.tightness), "tightness": list(result.tightness.values())}
    for f in fields(Motion):
        data[f"motion_{f.name}"] = np.array([getattr(motion, f.name) for motion in case.motion])
    data["case_own"] = case.own
    data["case_scale"] = [np.nan if scale is None else scale for scale in (*case.scale, case.factor)]
    if case.multiples is not None:
        data["case_multiples"] = case.multiples
    data["dissipation_before"] = result.dissipation_before
    data["dissipation_by_contact"] = result.dissipation_by_contact
    data |= {f"identity_{f.name}": getattr(result.identity, f.name) for f in fields(Identity)}
    data |= {"converged": result.converged, "message": result.message}
    data |= _materials(result) | {f"apart_{i}": value for i, value in case.apart.items()}
    _write(path, data)
    if not result.converged:
        warn(
            f"the state in {str(path)!r} did not converge ({result.message}); it can be a guess, but "
            "no history can start from it"
        )
    return path


def _write(path: Path, data: dict[str, Any]) -> None:
    if not path.parent.is_dir():
        raise InputError(
            f"there is no folder {str(path.parent)!r} to save a state in; make it first, for example "
            "by Path(...).mkdir(parents=True)"
        )
    partial = path.with_name(path.name + ".part")
    try:
        with partial.open("wb") as file:
            np.savez(file, **data)
        partial.replace(path)  # an interruption while writing leaves the old file whole
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise InputError(f"the state could not be written to {str(path)!r}: {error}") from None


def _with_suffix(path: Path) -> Path:
    return path if path.suffix == ".npz" or not path.name else path.with_name(path.name + ".npz")


def load_state(path: str | Path, identity: Identity) -> SavedState:
    """Read a state back; see `ContactSolver.load_state`.

    Parameters
    ----------
    path : str or Path
    identity : Identity
        The bodies and contacts that it has to be a state of.

    Raises
    ------
    InputError
        If the file is none of `save_state`, damaged, or of other bodies and contacts.
    """
    path = file_path(path)
    if not path.is_file() and _with_suffix(path).is_file():
        path = _with_suffix(path)  # as it was given to save_state
    if not path.is_file():
        raise InputError(f"there is no file {str(path)!r} to load a state from")
    try:
        data = _read(path)
        found = int(data.get("format", 0))
        if found == FORMAT:
            return _state(path, data, identity)
    except InputError:
        raise
    except DAMAGED as error:
        raise InputError(
            f"{str(path)!r} can not be read as a state ({error}): it was not written by "
            "solver.save_state(...), or it is damaged or cut off. Take the one saved before it."
        ) from None
    if found:
        raise InputError(
            f"{str(path)!r} has format {found}, this version reads {FORMAT}: files of earlier versions "
            "do not hold all that a history goes on from. Compute the state again, and save it anew."
        )
    raise InputError(f"{str(path)!r} is no file written by save_state(...)")


def _read(path: Path) -> dict[str, Any]:
    with path.open("rb") as stream:  # NumPy leaves it open where it can not read it
        # NumPy takes what it does not know for pickled objects, and says how to load them unsafely
        if stream.read(2) not in (b"PK", b"\x93N", b""):
            raise ValueError("no NumPy file")
        stream.seek(0)
        file = np.load(stream, allow_pickle=False)
        if isinstance(file, np.ndarray):
            raise ValueError("a single array")
        with file:
            return dict(file)


def _state(path: Path, data: dict[str, Any], identity: Identity) -> SavedState:
    state = State(**{f.name: data[f"state_{f.name}"] for f in fields(State)})
    own = Identity(**{f.name: data[f"identity_{f.name}"] for f in fields(Identity)})
    identity.refuse(own, repr(str(path)))
    motion = tuple(
        Motion(shift, angle if np.ndim(angle) else float(angle), centre)
        for shift, angle, centre in zip(
            data["motion_translation"], data["motion_angle"], data["motion_centre"], strict=True
        )
    )
    names = ("f", "x", "gap0", "slip0", "interference")
    scale = [None if np.isnan(value) else float(value) for value in data["case_scale"]]
    case = LoadCase(
        **{name: data[f"case_{name}"] for name in names},
        motion=motion,
        own=tuple(map(bool, data["case_own"])),
        scale=(scale[0], scale[1]),
        multiples=data.get("case_multiples"),
        factor=scale[2],
        apart={int(key[6:]): data[key] for key in data if key.startswith("apart_")},
    )
    lost = data["dissipation_before"], data["dissipation_by_contact"]
    converged, message = bool(data["converged"]), str(data["message"])
    bolts = dict(zip(map(str, data.get("bolts", ())), data.get("tightness", ()), strict=True))
    tightness = {name: (float(shift), float(force)) for name, (shift, force) in bolts.items()}
    material = [dict[str, Any]() for _ in range(int(data.get("bodies", 0)))]
    for key, value in data.items():
        if key.startswith("material_"):
            _, i, name = key.split("_", 2)
            material[int(i)][name] = value
    trend = data.get("trend", np.zeros(len(data["u"])))
    u, inner = data["u"], tuple(material)
    return SavedState(state, case, *lost, own, converged, message, u, tightness, inner, trend)


def _materials(result: Answer | SavedState) -> dict[str, Any]:
    """Return what bodies that are not linear remember; nothing where there are none."""
    if not result.material:
        return {}
    data: dict[str, Any] = {"bodies": len(result.material), "trend": result.trend}
    for i, state in enumerate(result.material):
        data |= {f"material_{i}_{name}": value for name, value in state.items()}
    return data
