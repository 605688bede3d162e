"""`read_bodies`: tagged meshes from files, one body for each tag.

meshio reads the files, Gmsh those that it does not know (`.unv`) and meshes geometry (STEP). What files
call groups, sets, tags or families are all groups of cells here, by name: those of the cells of largest
dimension are bodies, those one dimension below are boundaries, as sets of nodes are.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from fnmatch import fnmatchcase
from inspect import isroutine
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import meshio
import numpy as np
import skfem
from skfem.assembly import BilinearForm
from skfem.io.meshio import from_meshio

from skfem_contact.arguments import Named, check_kind, file_path, known_keywords, shown, suggest
from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.inputs import SUPPORTED, deferred_basis
from skfem_contact.bodies.nonlinear import NonlinearBody
from skfem_contact.bodies.normal_field import CIRCLE
from skfem_contact.bodies.selection import pieces
from skfem_contact.errors import InputError
from skfem_contact.materials.elastic import Elastic
from skfem_contact.materials.material import Material

#: Elements by what meshio calls their cells, and the dimension of all cells.
ELEMENTS = {cell: element for element, cell in SUPPORTED.items()}
DIMS = {"line": 1, "triangle": 2, "quad": 2, "tetra": 3, "hexahedron": 3, "wedge": 3, "pyramid": 3}
#: Where formats keep one number for each cell that says which group it is in.
TAGS = ("gmsh:physical", "cell_tags", "medit:ref", "nastran:ref", "su2:tag", "flac3d:group")
#: Plane and axisymmetric elements of Abaqus, of which meshio knows some, and those with as many nodes.
PLANE = re.compile(r"(^\*ELEMENT\b.*\bTYPE\s*=\s*)(?:CPE|CPS|CAX)([3468])[A-Z]*\b", re.I | re.M)
KNOWN = {"3": "CPS3", "4": "CPS4", "6": "CPE6", "8": "S8R"}
#: What is meshed, or read, by Gmsh.
CAD, BY_GMSH = (".step", ".stp", ".iges", ".igs", ".brep"), (".unv",)
#: What STEP has for a name where none was given.
NAMELESS = "Open CASCADE"


@known_keywords(materials="write material", name="bodies are named after their tags")
def read_bodies(
    path: str | Path,
    material: Any,
    *,
    bodies: Mapping[str, str | Sequence[str]] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    size: float | None = None,
    order: int = 1,
) -> Named[Body]:
    """Read the bodies of an assembly from a file of a tagged mesh.

    Parameters
    ----------
    path : str or Path
        What meshio reads: Gmsh ``.msh``, Abaqus ``.inp`` with sets, whose plane and axisymmetric
        elements are read alike (settings have the `measure`), ``.med``, Nastran ``.bdf``, ...
        By Gmsh, if it is installed: ``.unv``, and geometry, ``.step``, ``.stp``, ``.iges``,
        ``.brep``, of which each volume becomes a body.
    material : Material, form, sparse matrix, callable or dict
        What `Body` takes as its stiffness, or `NonlinearBody` as a material, such as `J2`; a function
        of the basis that returns it; or a dict of these by the name of a body, of a subdomain, or a
        pattern: ``{"bolt*": steel, "*": aluminium}``.
    bodies : dict, optional
        Which tags make which body, ``{"block": ["lower half", "upper half"]}``; others are left out.
        Several tags of one body are its subdomains. Every tag is a body if it is not given.
    settings : dict, optional
        What else such a body takes, by its name or a pattern: ``{"base": {"D": "bottom"}}``; and
        more ``"boundaries"``, functions of the position of facets, where the file has no names.
    size : float, optional
        Of elements, where Gmsh meshes geometry, the largest [length]. Round faces have smaller ones,
        with 16 nodes to the turn.
    order : int
        Of elements, where Gmsh meshes geometry: 1, or 2 for curved ones with middle nodes.

    Returns
    -------
    sequence of Body
        Also by name: ``bodies["bolt"]``. Their meshes have boundaries by the names in the file. Bodies
        that share nodes in the file have nodes of their own.

    Raises
    ------
    InputError
        Files that can not be read, cells that are not supported, tags that overlap, names that do not
        exist.

    Examples
    --------
    Two squares with a tag each, and a line below the first:

    >>> import meshio, tempfile
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> points = [
    ...     (0, 0, 0),
    ...     (1, 0, 0),
    ...     (1, 1, 0),
    ...     (0, 1, 0),
    ...     (1, 1, 0),
    ...     (0, 1, 0),
    ...     (1, 2, 0),
    ...     (0, 2, 0),
    ... ]
    >>> cells = [("quad", [(0, 1, 2, 3), (5, 4, 6, 7)]), ("line", [(0, 1)])]
    >>> tags = {"gmsh:physical": [[1, 2], [3]], "gmsh:geometrical": [[1, 2], [3]]}
    >>> names = {"low": [1, 2], "high": [2, 2], "ground": [3, 1]}
    >>> mesh = meshio.Mesh(points, cells, cell_data=tags, field_data=names)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     mesh.write(f"{folder}/two.msh", file_format="gmsh22")
    ...     bodies = sc.read_bodies(
    ...         f"{folder}/two.msh", linear_elasticity(), settings={"low": {"D": "ground"}}
    ...     )
    >>> (
    ...     bodies.names,
    ...     bodies["low"].D.tolist(),
    ...     [pair.name for pair in sc.find_contacts(bodies, within=0.1)],
    ... )
    (('low', 'high'), [0, 1, 2, 3], ['low - high'])
    """
    file = file_path(path)
    groups = Groups(_read(file, size, order), file)
    chosen = groups.bodies(bodies)
    known = dict(settings or {})
    for name in known:
        if not any(fnmatchcase(body, name) for body in chosen):
            raise InputError(f"settings of {name!r}: no such body{suggest(name, chosen, 'bodies')}")
    made = []
    for name, parts in chosen.items():
        one, element = groups.mesh(name, parts)
        given = dict(_by_name(known, name) or {})
        one = one.with_boundaries(given.pop("boundaries", {}))
        basis = deferred_basis(one, skfem.ElementVector(element), None, f"body {name!r}")
        K = _stiffness(material, name, basis)
        kind = Body if isinstance(K, Elastic) or not isinstance(K, Material) else NonlinearBody
        made.append(kind(basis, K, name=name, **given))
    return Named(made, list(chosen), "bodies")


def _stiffness(material: Any, name: str, basis: Any) -> Any:
    """Return what a user means as the stiffness of a body, or of its subdomains one by one."""
    if not isinstance(material, Mapping):
        # a form and a material may be called as well, but not by a basis
        return material(basis) if isroutine(material) else material
    own = _by_name(material, name)
    if own is not None:
        return _stiffness(own, name, basis)
    parts = basis.mesh.subdomains or {}
    if len(parts) < 2 or any(_by_name(material, part) is None for part in parts):
        missing = [part for part in parts if _by_name(material, part) is None] or [name]
        raise InputError(
            f"material has nothing for {', '.join(map(repr, missing))}"
            f"{suggest(missing[0], material, 'materials')}. A pattern takes all: {{'*': steel}}"
        )
    total = 0
    for part, elements in parts.items():
        some = skfem.Basis(basis.mesh, basis.elem, elements=elements)
        K = _stiffness(_by_name(material, part), part, some)
        if isinstance(K, Material) and not isinstance(K, Elastic):
            raise InputError(
                f"{type(K).__name__} of {part!r}, which is a part of body {name!r}: a body that is not "
                "linear has one material. Make each tag a body, and tie them"
            )
        form = K if isinstance(K, BilinearForm) or not hasattr(K, "form") else K.form()  # of a material
        total = total + (form.assemble(some) if isinstance(form, BilinearForm) else form)
    return total


def _by_name(material: Mapping[str, Any], name: str) -> Any:
    """Return what a dict has for a name: itself, else the first pattern that it fits."""
    if name in material:
        return material[name]
    return next((value for key, value in material.items() if fnmatchcase(name, str(key))), None)


class Groups:
    """The cells of a file, by groups.

    Parameters
    ----------
    mesh : meshio.Mesh
        What meshio has read.
    file : Path

    Attributes
    ----------
    points : ndarray, shape (n, 3)
    kinds : ndarray of str, shape (cells,)
        What meshio calls each.
    dims : ndarray of int, shape (cells,)
        Their dimension; points, and what is unknown, have none.
    nodes : ndarray of int, shape (cells, k)
        The last one again where there are fewer than k.
    named : dict
        The cells of each group.
    sets : dict
        Sets of nodes.
    """

    def __init__(self, mesh: meshio.Mesh, file: Path) -> None:
        blocks = mesh.cells or [meshio.CellBlock("vertex", np.zeros((0, 1), dtype=int))]
        cells, sizes = [np.asarray(block.data, dtype=np.intp) for block in blocks], [*map(len, blocks)]
        widest = max(some.shape[1] for some in cells)
        pads = [np.pad(c, ((0, 0), (0, widest - c.shape[1])), mode="edge") for c in cells]
        self.file, self.sets, plane = file, mesh.point_sets, 3 - mesh.points.shape[1]
        self.points = np.pad(mesh.points, ((0, 0), (0, plane)))
        self.kinds = np.repeat([block.type for block in blocks], sizes)
        self.dims = np.repeat([DIMS.get(b.type.rstrip("0123456789"), 0) for b in blocks], sizes)
        self.nodes, self.dim = np.concatenate(pads), int(self.dims.max(initial=0))
        self.named: dict[str, Index] = {}
        starts = np.cumsum([0, *sizes])
        for name, found in mesh.cell_sets.items():
            if not name.startswith(("gmsh:", "_")):  # what programs need for themselves
                # blocks that came later, of .inp, are not in it
                own = [(i, part) for i, part in zip(starts, found, strict=False) if part is not None]
                parts = [i + np.asarray(part, dtype=np.intp).ravel() for i, part in own]
                self.named[name] = np.concatenate([starts[:0], *parts])
        for key in filter(mesh.cell_data.__contains__, TAGS):
            self.named = {**self._tagged(mesh, key), **self.named}

    def _tagged(self, mesh: meshio.Mesh, key: str) -> dict[str, Index]:
        """Groups from one number for each cell, by the names that formats keep elsewhere."""
        families = getattr(mesh, "cell_tags", {})  # of .med: several names for each number
        both = np.array([self.dims, np.concatenate([*map(np.ravel, mesh.cell_data[key])])]).T
        found: dict[str, Index] = {}
        kinds = np.unique(both[both.all(axis=1)], axis=0).astype(int)
        # .med: -1, -2
        for dim, tag in sorted(kinds.tolist(), key=lambda kind: (kind[0], abs(kind[1]))):
            own = [name for name, field in mesh.field_data.items() if tuple(field[:2]) == (tag, dim)]
            cells = np.flatnonzero((both == (dim, tag)).all(axis=1))
            for name in own or families.get(tag) or [f"tag {tag}"]:
                found[name] = np.union1d(found.get(name, cells[:0]), cells)
        return found

    def of_dim(self, name: str, dim: int) -> Index:
        """Cells of a group that have a dimension."""
        cells = self.named[name]
        return cells[self.dims[cells] == dim]

    def bodies(self, wanted: Mapping[str, str | Sequence[str]] | None) -> dict[str, dict[str, Index]]:
        """Cells of each body, by subdomain."""
        if self.dim < 2:
            raise InputError(f"{self.file}: there are no cells of two or three dimensions in it")
        there = {n: cells for n in self.named if len(cells := self.of_dim(n, self.dim))}
        chosen: dict[str, dict[str, Index]] = {}
        if wanted is not None:
            check_kind(wanted, Mapping, "bodies", "give {'body': ['tag', ...]}", "dict")
            for body, tags in wanted.items():
                names = [tags] if isinstance(tags, str) else list(tags)
                lost = next((name for name in names if name not in there), None)
                if not names:
                    raise InputError(f"{str(body)!r} has no tags: give {{'body': ['tag', ...]}}")
                if lost is not None:
                    raise InputError(
                        f"bodies: {str(body)!r} is to have {shown(lost)}, and {self.file} has no such "
                        f"tag of cells of {self.dim} dimensions{suggest(lost, there, 'tags')}"
                    )
                chosen[str(body)] = {name: there[name] for name in names}
            return chosen
        taken = np.zeros(len(self.kinds), dtype=np.intp)
        order = list(there)
        # the small ones first: sets of sets, "all", hold nothing else then; of equal ones the last, as
        # those of an .inp that stand with the elements
        for name in sorted(order, key=lambda n: (len(there[n]), -order.index(n))):
            used = taken[there[name]]
            if used.all():
                continue
            if used.any():
                other = list(chosen)[int(used.max()) - 1]
                raise InputError(
                    f"{self.file}: tags {name!r} and {other!r} share {np.count_nonzero(used)} cells, "
                    "so that they can not both be bodies. Say which are: "
                    f"bodies={{{name!r}: [{name!r}]}}"
                )
            chosen[name] = {name: there[name]}
            taken[there[name]] = len(chosen)
        found = {name: chosen[name] for name in order if name in chosen}
        # cells without a tag: every connected part of them is a body
        rest = np.flatnonzero((taken == 0) & (self.dims == self.dim))
        part = pieces(self.nodes[rest].T, len(self.points))[self.nodes[rest, 0]]
        for k in np.unique(part):
            name = f"body {len(found) + 1}"
            found[name] = {name: rest[part == k]}
        return found

    def mesh(self, name: str, parts: dict[str, Index]) -> tuple[skfem.Mesh, skfem.Element]:
        """The mesh of a body with its subdomains and boundaries by name, and its element."""
        chosen = np.concatenate(list(parts.values()))
        kinds = np.unique(self.kinds[chosen]).tolist()
        if len(kinds) > 1 or kinds[0] not in ELEMENTS:
            raise InputError(
                f"{self.file}: body {name!r} has cells {', '.join(kinds)}; a body has cells of one "
                f"kind, of {', '.join(ELEMENTS)}. Mesh it anew, or tie several bodies"
            )
        element = ELEMENTS[kinds[0]]
        cells = self.nodes[chosen, : len(element.doflocs)]
        corners = np.unique(cells[:, : element.refdom.nnodes])
        nodes = np.concatenate([corners, np.setdiff1d(cells, corners)])  # as scikit-fem numbers them
        local = np.full(len(self.points), -1)
        local[nodes] = np.arange(len(nodes))
        points, kind, table = completed(self.points[nodes], kinds[0], local[cells])
        if self.dim == 2 and np.ptp(points[:, 2:]) > 0:
            raise InputError(f"{self.file}: body {name!r} is made of shells: a body is plane or solid")
        mesh = from_meshio(meshio.Mesh(points, [(kind, table)]))
        if len(parts) > 1:
            places = np.split(np.arange(len(chosen)), np.cumsum([*map(len, parts.values())])[:-1])
            mesh = mesh.with_subdomains(dict(zip(parts, places, strict=True)))
        # groups of facets, and sets of nodes, by name
        numbers = mesh.boundary_facets()
        facets = np.sort(mesh.facets[:, numbers], axis=0).T
        found: dict[str, Any] = {}
        for tag in self.named:
            cells = self.of_dim(tag, self.dim - 1)
            mine = np.sort(local[self.nodes[cells, : facets.shape[1]]], axis=1)
            _, key = np.unique(np.concatenate([facets, mine]), axis=0, return_inverse=True)
            found[tag] = numbers[np.isin(key.ravel()[: len(facets)], key.ravel()[len(facets) :])]
        for tag, members in self.sets.items():
            inside = np.isin(np.arange(len(corners)), local[np.asarray(members, dtype=np.intp).ravel()])
            found.setdefault(tag, numbers[inside[facets].all(axis=1)])
        found = {name: some.astype(np.int32) for name, some in found.items() if len(some)}
        return mesh.with_boundaries(found), element()


def completed(points: Array, kind: str, cells: Index) -> tuple[Array, str, Index]:
    """Eight-node quadrilaterals and twenty-node bricks with all nodes of scikit-fem's meshes.

    Those are where the shape functions of the element have them, which stays what it is.
    """
    if kind not in ("quad8", "hexahedron20"):
        return points, kind, cells
    face = [-0.25] * 4 + [0.5] * 4  # corners, middles of edges
    weights, full = np.array([face]), "quad9"
    if kind == "hexahedron20":
        weights, full = np.zeros((7, 20)), "hexahedron27"
        weights[np.arange(6)[:, None], BRICK] = face
        weights[6] = [-0.25] * 8 + [0.25] * 12
    more = np.einsum("qk,ckd->cqd", weights, points[cells]).reshape(-1, 3)
    names = len(points) + np.arange(len(more)).reshape(len(cells), -1)
    return np.concatenate([points, more]), full, np.column_stack([cells, names])


#: The faces of a brick in the order in which meshio has the nodes in their middles: corners, edges.
BRICK = [
    (0, 3, 7, 4, 11, 19, 15, 16), (1, 2, 6, 5, 9, 18, 13, 17), (0, 1, 5, 4, 8, 17, 12, 16),
    (3, 2, 6, 7, 10, 18, 14, 19), (0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15),
]  # fmt: skip


def _read(file: Path, size: float | None, order: int) -> meshio.Mesh:
    """Return what a file has, by meshio, or by Gmsh and meshio."""
    if not file.is_file():
        raise InputError(f"{file} is no file")
    suffix = file.suffix.lower()
    if suffix in CAD + BY_GMSH:
        return _by_gmsh(file, suffix, size, order)
    said = StringIO()  # of a file that it can not read meshio tells the console why, and ends Python
    try:
        with redirect_stdout(said), redirect_stderr(said):
            mesh = _abaqus(file) if suffix == ".inp" else meshio.read(file)
    except ImportError as error:
        words = f"meshio reads {suffix} by {error.name}: pip install {error.name}"
        raise InputError(f"{file}: {words}") from error
    except (Exception, SystemExit) as error:  # every format fails in its own way
        words = said.getvalue().strip() or str(error)
        raise InputError(f"{file} can not be read by meshio: {words}") from error
    sys.stderr.write(said.getvalue())  # of what it has left out
    return mesh


def _abaqus(file: Path) -> meshio.Mesh:
    """Read a deck, its plane elements by the names of those with the same nodes that meshio knows."""
    text, count = PLANE.subn(lambda found: found[1] + KNOWN[found[2]], file.read_text())
    if not count:
        return meshio.read(file)
    deck = StringIO(text)
    vars(deck)["name"] = str(file)  # beside which other files of the deck are
    return meshio.read(deck, "abaqus")


def _by_gmsh(file: Path, suffix: str, size: float | None, order: int) -> meshio.Mesh:
    """Return what Gmsh reads, or meshes, by a file that meshio reads."""
    try:
        import gmsh  # optional
    except ImportError:
        raise InputError(
            f"{file}: files {suffix} are read by Gmsh, which is not installed: pip install "
            "'skfem-contact[step]'. Or write the mesh as .msh, .inp or .med where the program is that "
            "made it"
        ) from None
    with TemporaryDirectory() as folder, ExitStack() as after:
        if gmsh.isInitialized():  # by the user, whose model it stays
            after.callback(gmsh.model.setCurrent, gmsh.model.getCurrent())
        else:
            gmsh.initialize(interruptible=False)
            after.callback(gmsh.finalize)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.add(file.stem)
            if suffix in CAD:
                _mesh(gmsh, file, size, order)
            else:
                gmsh.merge(str(file))
            gmsh.write(f"{folder}/mesh.msh")
            gmsh.model.remove()
        except Exception as error:  # what Gmsh raises is no class of its own
            raise InputError(f"{file} can not be read or meshed by Gmsh: {error}") from error
        return meshio.read(f"{folder}/mesh.msh")


def _mesh(gmsh: Any, file: Path, size: float | None, order: int) -> None:
    """Mesh geometry in Gmsh's model; every volume is a group."""
    gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
    gmsh.model.occ.importShapes(str(file))
    gmsh.model.occ.synchronize()
    names: list[str] = []
    dim = max(d for d, _ in gmsh.model.getEntities())
    for i, (_, tag) in enumerate(gmsh.model.getEntities(dim)):
        name = gmsh.model.getEntityName(dim, tag).split("/")[-1]
        if not name or name.startswith(NAMELESS):
            name = f"body {i + 1}"
        names.append(name if name not in names else f"{name} ({i + 1})")
        gmsh.model.addPhysicalGroup(dim, [tag], name=names[-1])
    if size is not None:
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", CIRCLE / order)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.model.mesh.generate(dim)
