"""States on disk: a history that was interrupted goes on from a file."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arguments import shown
from skfem_contact.errors import InputError
from skfem_contact.loads import LoadCase, Motion
from skfem_contact.states import State
from skfem_contact.steps import Settings

if TYPE_CHECKING:
    from skfem_contact.result import ContactResult

Array = NDArray[np.float64]

FORMAT = 1  # of the file; a file of another one is refused


@dataclass(frozen=True, eq=False)
class SavedState:
    """Where a history stands: what ``solve`` and ``history`` need of their ``start``.

    Attributes
    ----------
    state : State
        What friction remembers.
    case : LoadCase
        The loads under which this is the state.
    settings : Settings
        The loads in force, which stay as they are where the next step does not name them.
    dissipation_before, dissipation_by_contact : ndarray
        Energy lost before and in the last step, per contact [energy].
    """

    state: State
    case: LoadCase
    settings: Settings
    dissipation_before: Array
    dissipation_by_contact: Array


def save_state(path: str | Path, result: ContactResult | SavedState) -> Path:
    """Write the state of a result to an ``.npz`` file, for ``solver.load_state``.

    Everything that the next step depends on is kept, to the last bit: friction, the surfaces where
    contact slides far, loads, and the energy lost so far. The displacements of the bodies' interior
    are not; they follow from these.

    Parameters
    ----------
    path : str or Path
        ``.npz`` is added where it is missing.
    result : ContactResult

    Returns
    -------
    Path
        Of the file written.
    """
    path = _path(path)
    if not hasattr(result, "state") or not hasattr(result, "settings"):
        raise InputError(f"save_state: result is {shown(result)}, not what solve(...) returned")
    path = path if path.suffix == ".npz" else path.with_name(path.name + ".npz")
    case, settings = result.case, result.settings
    data: dict[str, Any] = {"format": FORMAT}
    data |= {f"state_{name}": value for name, value in vars(result.state).items()}
    for name in ("f", "x", "gap0", "slip0", "interference"):
        data[f"case_{name}"] = getattr(case, name)
    data |= _motions(case.motion)
    data |= {"settings_f": settings.f, "settings_x": settings.x}
    data["settings_moved"] = [motion is not None for motion in settings.motion]
    data["settings_factor"] = np.nan if settings.factor is None else settings.factor
    data["dissipation_before"] = result.dissipation_before
    data["dissipation_by_contact"] = result.dissipation_by_contact
    partial = path.with_name(path.name + ".part")
    with partial.open("wb") as file:
        np.savez(file, **data)
    partial.replace(path)  # an interruption while writing leaves the old file whole
    return path


def _path(path: Any) -> Path:
    try:
        return Path(path)
    except TypeError:
        raise InputError(f"path is {shown(path)}; give the name of a file, or a Path") from None


def load_state(path: str | Path, n: int, points: tuple[slice, ...]) -> SavedState:
    """Read a state back; see `ContactSolver.load_state`.

    Parameters
    ----------
    path : str or Path
    n : int
        DOFs of all bodies.
    points : tuple of slice
        The points of each contact.

    Raises
    ------
    InputError
        If the file is none of `save_state`, or of other bodies and contacts.
    """
    path = _path(path)
    if not path.is_file():
        raise InputError(f"there is no file {str(path)!r} to load a state from")
    with np.load(path, allow_pickle=False) as file:
        data = dict(file)
    if int(data.get("format", 0)) != FORMAT:
        raise InputError(f"{str(path)!r} is no file written by this version's save_state(...)")
    state = State(**{f.name: data[f"state_{f.name}"] for f in fields(State)})
    m, count = len(state.status), len(data["motion_angle"])
    if len(data["case_f"]) != n or m != points[-1].stop or count != len(points):
        raise InputError(
            f"{str(path)!r} is a state of {len(data['case_f'])} DOFs, {m} contact points and {count} "
            f"contacts; this solver has {n}, {points[-1].stop} and {len(points)}. A state can be "
            "carried over only between solvers of the same bodies and contacts, in the same order."
        )
    motion = tuple(
        Motion(shift, float(angle), centre)
        for shift, angle, centre in zip(
            data["motion_translation"], data["motion_angle"], data["motion_centre"], strict=True
        )
    )
    names = ("f", "x", "gap0", "slip0", "interference")
    case = LoadCase(**{name: data[f"case_{name}"] for name in names}, motion=motion)
    factor = float(data["settings_factor"])
    moved = zip(motion, data["settings_moved"], strict=True)
    settings = Settings(
        data["settings_f"],
        data["settings_x"],
        tuple(case.interference[part] for part in points),
        tuple(m.as_argument() if there else None for m, there in moved),
        None if np.isnan(factor) else factor,
    )
    return SavedState(state, case, settings, data["dissipation_before"], data["dissipation_by_contact"])


def _motions(motions: tuple[Motion, ...]) -> dict[str, Any]:
    listed = [asdict(motion) for motion in motions]
    return {f"motion_{f.name}": np.array([m[f.name] for m in listed]) for f in fields(Motion)}
