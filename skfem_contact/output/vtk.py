"""Results to files that ParaView opens: bodies in one grid, contact surfaces and obstacles in others.

A history becomes such files per load step and a collection (`.pvd`) that lists them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import check_kind, file_path, known_keywords, number, numbers, shown
from skfem_contact.errors import InputError
from skfem_contact.output.fields import checked_units, displaced
from skfem_contact.output.grids import (
    Fields,
    Grid,
    bodies_grid,
    contact_grid,
    obstacles_grid,
    with_time,
)
from skfem_contact.output.tools import tools

EXTENSIONS = (".vtu", ".vtk")


@known_keywords()
def write(
    path: str | Path,
    result: ContactResult,
    *,
    stress: Fields | None = None,
    time: float | None = None,
    units: Mapping[str, str] | None = None,
    u: ArrayLike | None = None,
) -> tuple[Path, Path]:
    """Write a result: bodies to `path`, contacts to ``<stem>_contact``, tools to ``<stem>_obstacles``.

    Bodies keep nodes of their own also where they touch. All files hold the undeformed geometry
    and the field ``displacement``, to warp by.

    Parameters
    ----------
    path : str or Path
        Ends in ``.vtu`` or ``.vtk``; missing folders are made.
    result : ContactResult
    stress : str or callable, list or dict of them, optional
        Names of fields of `nodal_field`, such as "stress" or "equivalent_plastic_strain", NaN on bodies
        without them. Or ``stress(body, u)`` returns a number for each node of the body, such as
        `skfem_contact.von_mises`, a vector, or a tensor (nodes, 3, 3), such as `nodal_stress`. It is
        written by the name of the function (``stress`` for a lambda), or by its name in the dict.
    time : float, optional
        Written as ``TimeValue``, which ParaView shows; by default the load factor.
    units : dict, optional
        Words that are written with the fields: ``{"length": "mm", "stress": "MPa", "force": "N"}``.
    u : ndarray, shape (n,), optional
        Displacements of all bodies in the place of those of the result: a shape of vibration.

    Returns
    -------
    bodies, contacts : Path
        The first two files. The first has the point data ``displacement`` (3 components) or, for scalar
        problems, ``u``, and the cell data ``body`` (1 for the first). The second has the point
        data of `ContactValues`: ``pressure``, ``traction`` on the secondary, ``gap`` (NaN where
        there is no partner), ``slip``, ``status`` (0 open, 1 stick, 2 slip), ``tangential_force``,
        ``wear_depth`` where surfaces wear, and the cell data ``contact`` (1 for the first). Slip and
        tangential force are one number along `tangent` in 2-D (the normal from primary to secondary,
        turned counter-clockwise) and a vector in global axes in 3-D.
        The third is written where there are rigid obstacles, and has the cell data ``obstacle``.

    Raises
    ------
    InputError
        If the extension is unknown, or `stress` returns something else than values per node.

    Notes
    -----
    Names are in the field data of ``.vtu`` files: an array ``body 1: block`` with the value 1 says that
    body 1 is "block"; contacts and obstacles have theirs, too. Tensors have six components, in the
    order XX, YY, ZZ, XY, YZ, XZ. Planes and other obstacles without end are written as far as the
    bodies reach. An obstacle of a user's own class is not written: its shape is not known.

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
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> import tempfile, pathlib
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> path = sc.write(folder / "block.vtu", result)
    >>> sorted(file.name for file in folder.iterdir())
    ['block.vtu', 'block_contact.vtu', 'block_obstacles.vtu']
    """
    path = file_path(path)
    check_kind(result, ContactResult, "result", "a history goes to write_series('name.pvd', results)")
    if path.suffix.lower() not in EXTENSIONS:
        raise InputError(
            f"can not write {path.name!r}: the extension {path.suffix!r} is not one of "
            f"{', '.join(EXTENSIONS)}. Use write('{path.stem}.vtu', result), or write_series for "
            "a history; other formats by `meshio convert`."
        )
    words = checked_units(units)
    if time is not None:
        time = number(time, "time", "give one number")
    result = displaced(result, u)
    path.parent.mkdir(parents=True, exist_ok=True)
    bodies, contacts, obstacles = _files(path)
    _write(bodies, with_time(bodies_grid(result, stress, words), result, time))
    _write(contacts, with_time(contact_grid(result, words), result, time))
    grid = obstacles_grid(result, words)
    if grid is not None:
        _write(obstacles, with_time(grid, result, time))
    return bodies, contacts


def _files(path: Path) -> tuple[Path, Path, Path]:
    ends = ("", "_contact", "_obstacles")
    bodies, contacts, obstacles = (path.with_name(f"{path.stem}{end}{path.suffix}") for end in ends)
    return bodies, contacts, obstacles


def _write(path: Path, grid: Grid) -> None:
    if path.suffix.lower() == ".vtu":
        grid.write(path)
        return
    import meshio  # takes as long to import as all else together, and only these files need it

    kinds, cuts = [kind for kind, _ in grid.cells], np.cumsum([len(c) for _, c in grid.cells])[:-1]
    cells = [(kind, nodes) for kind, (_, nodes) in zip(kinds, grid.cells, strict=True)]
    data = {name: np.split(values, cuts) for name, values in grid.cell_data.items()}
    meshio.Mesh(grid.points, cells, dict(grid.point_data), data).write(path)


@known_keywords()
def write_series(
    path: str | Path,
    results: Iterable[ContactResult],
    *,
    times: Sequence[float] | None = None,
    stress: Fields | None = None,
    units: Mapping[str, str] | None = None,
) -> Path:
    """Write a history as a ParaView collection ``<stem>.pvd``.

    Step 7 is in ``<stem>_0007.vtu``, ``<stem>_0007_contact.vtu`` and, where there are obstacles,
    ``<stem>_0007_obstacles.vtu``. The collection is renewed with every step, so what an interrupted
    history has reached can be opened.

    Parameters
    ----------
    path : str or Path
        Ends in ``.pvd``; missing folders are made.
    results : iterable of ContactResult
        A list, or ``solver.history(...)`` itself.
    times : sequence of float, optional
        Of each step. By default the load factors where they increase from step to step, else the
        numbers 0, 1, 2, ... of the steps.
    stress, units : optional
        As in `write`.

    Returns
    -------
    Path
        The collection.

    Raises
    ------
    InputError
        If the extension is not ``.pvd``, or there are fewer times than results.

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
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> results = list(sc.ContactSolver(block, foot).history([0.5, 1.0]))
    >>> path = sc.write_series(folder / "press.pvd", results, times=[0.0, 1.0])
    >>> len(list(folder.glob("*.vtu")))  # bodies, contacts and obstacles of two steps
    6
    """
    path = file_path(path)
    if path.suffix.lower() != ".pvd":
        raise InputError(
            f"can not write a history to {path.name!r}: a series is a ParaView collection. Use "
            f"write_series('{path.stem}.pvd', results); a single result goes to write(...)."
        )
    if isinstance(results, ContactResult) or not isinstance(results, Iterable):
        raise InputError(
            f"results is {shown(results)}, not a list of results, or a history; a single result goes "
            "to write('name.vtu', result)"
        )
    if times is not None:
        usage = "give one number for each result"
        times = np.atleast_1d(numbers(times, "times", usage)).tolist()
    path.parent.mkdir(parents=True, exist_ok=True)
    files: list[list[Path]] = []
    factors: list[float | None] = []
    _collection(path, [], [])
    for i, result in enumerate(results):
        if times is not None and i >= len(times):
            raise InputError(f"times has {len(times)} entries, but there are more results than that.")
        step = path.with_name(f"{path.stem}_{i:04d}.vtu")
        time = None if times is None else times[i]
        written = list(write(step, result, stress=stress, time=time, units=units))
        if tools(result):
            written.append(_files(step)[2])
        files.append(written)
        factors.append(result.factor)
        _collection(path, files, _clock(factors) if times is None else times[: i + 1])
    return path


def _clock(factors: Sequence[float | None]) -> list[float]:
    """Load factors if they can serve as time, which has to increase; numbers of steps if not."""
    known = [float(factor) for factor in factors if factor is not None]
    if len(known) == len(factors) and all(np.diff(known) > 0):
        return known
    return [float(i) for i in range(len(factors))]


def _collection(path: Path, files: list[list[Path]], times: Sequence[float]) -> None:
    from xml.etree import ElementTree  # only lists of files need it

    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    listing = ElementTree.SubElement(root, "Collection")
    for step, time in zip(files, times, strict=True):
        for part, file in enumerate(step):
            name = ("bodies", "contacts", "obstacles")[part]
            entry = {"timestep": repr(float(time)), "part": str(part), "name": name, "file": file.name}
            ElementTree.SubElement(listing, "DataSet", entry)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
