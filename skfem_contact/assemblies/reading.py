"""`read_bodies`: tagged meshes from files, one body for each tag.

meshio reads the files, Gmsh those that it does not know (`.unv`) and meshes geometry (STEP). What files
call groups, sets, tags or families are all groups of cells here, by name: those of the cells of largest
dimension are bodies, those one dimension below are boundaries, as sets of nodes are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from inspect import isroutine
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import meshio
import numpy as np
import skfem
from numpy.typing import NDArray
from skfem.assembly import BilinearForm
from skfem.io.meshio import from_meshio

from skfem_contact.arguments import check_kind, file_path, known_keywords, shown, suggest
from skfem_contact.assemblies.named import Named
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.inputs import SUPPORTED, deferred_basis
from skfem_contact.bodies.pieces import pieces
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: Elements by what meshio calls their cells, and by the dimension and the corners of all cells.
ELEMENTS = {cell: element for element, cell in SUPPORTED.items()}
CORNERS = {
    "line": (1, 2), "triangle": (2, 3), "quad": (2, 4), "tetra": (3, 4), "hexahedron": (3, 8),
    "wedge": (3, 6), "pyramid": (3, 5),
}  # fmt: skip
#: Where formats keep one number for each cell that says which group it is in.
TAGS = ("gmsh:physical", "cell_tags", "medit:ref", "nastran:ref", "su2:tag", "flac3d:group")
#: What is meshed, or read, by Gmsh.
CAD, BY_GMSH = (".step", ".stp", ".iges", ".igs", ".brep"), (".unv",)
#: What STEP has for a name where none was given.
NAMELESS = "Open CASCADE"

NO_GMSH = (
    "{path}: files {suffix} are read by Gmsh, which is not installed: pip install "
    "'skfem-contact[step]'. Or write the mesh as .msh, .inp or .med where the program is that made it"
)


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
        What meshio reads: Gmsh ``.msh``, Abaqus ``.inp`` with sets, ``.med``, Nastran ``.bdf``, ...
        By Gmsh, if it is installed: ``.unv``, and geometry, ``.step``, ``.stp``, ``.iges``,
        ``.brep``, of which each volume becomes a body.
    material : form, sparse matrix, callable or dict
        What `Body` takes as its stiffness; a function of the basis that returns it; or a dict of these
        by the name of a body, of a subdomain, or a pattern: ``{"bolt*": steel, "*": aluminium}``.
    bodies : dict, optional
        Which tags make which body, ``{"block": ["lower half", "upper half"]}``; others are left out.
        Several tags of one body are its subdomains. Every tag is a body if it is not given.
    settings : dict, optional
        What else `Body` takes, by the name of a body: ``{"base": {"D": "bottom"}}``.
    size : float, optional
        Of elements, where Gmsh meshes geometry [length].
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
    mesh = _read(file, size, order)
    groups = Groups.of(mesh, file)
    chosen = groups.bodies(bodies)
    known = dict(settings or {})
    for name in known:
        if name not in chosen:
            raise InputError(f"settings of {name!r}: no such body{suggest(name, chosen, 'bodies')}")
    made = []
    for name, parts in chosen.items():
        one = groups.mesh(name, parts)
        element = ELEMENTS[groups.kind(name, parts)]()
        basis = deferred_basis(one, skfem.ElementVector(element), None, f"body {name!r}")
        K = _stiffness(material, name, basis)
        made.append(Body(basis, K, name=name, **known.get(name, {})))
    return Named(made, list(chosen), "bodies")


def _stiffness(material: Any, name: str, basis: Any) -> Any:
    """What a user means as the stiffness of a body, or of its subdomains one by one."""
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
        form = K if isinstance(K, BilinearForm) or not hasattr(K, "form") else K.form()  # of a material
        total = total + (form.assemble(some) if isinstance(form, BilinearForm) else form)
    return total


def _by_name(material: Mapping[str, Any], name: str) -> Any:
    """What a dict has for a name: itself, else the first pattern that it fits."""
    if name in material:
        return material[name]
    return next((value for key, value in material.items() if fnmatchcase(name, str(key))), None)


@dataclass(frozen=True, eq=False)
class Groups:
    """The cells of a file, by groups.

    Attributes
    ----------
    file : Path
    points : ndarray, shape (n, 3)
    kinds : list of str
        What meshio calls the cells of each block.
    cells : list of ndarray
        Nodes of the cells of each block.
    named : dict
        Of each group the numbers of its cells in every block.
    nodes : dict
        Sets of nodes.
    """

    file: Path
    points: Array
    kinds: list[str]
    cells: list[Index]
    named: dict[str, list[Index]]
    nodes: dict[str, Index]

    @classmethod
    def of(cls, mesh: meshio.Mesh, file: Path) -> Groups:
        """The groups of a mesh that meshio has read."""
        named: dict[str, list[Index]] = {}
        for name, found in mesh.cell_sets.items():
            if not name.startswith(("gmsh:", "_")):  # what programs need for themselves
                missing = [None] * (len(mesh.cells) - len(found))  # blocks that came later, of .inp
                named[name] = [_numbers(part) for part in [*found, *missing]]
        for key in TAGS:
            for name, found in _tagged(mesh, key).items():
                named.setdefault(name, found)
        nodes = {name: _numbers(found) for name, found in mesh.point_sets.items()}
        kinds = [block.type for block in mesh.cells]
        return cls(file, mesh.points, kinds, [np.asarray(b.data) for b in mesh.cells], named, nodes)

    @property
    def dim(self) -> int:
        """The largest dimension of a cell."""
        return max((_shape(kind)[0] for kind in self.kinds), default=0)

    def of_dim(self, name: str, dim: int) -> dict[int, Index]:
        """Cells of a group that have a dimension, by block."""
        blocks = enumerate(zip(self.kinds, self.named[name], strict=True))
        return {i: some for i, (kind, some) in blocks if _shape(kind)[0] == dim and len(some)}

    def bodies(
        self, wanted: Mapping[str, str | Sequence[str]] | None
    ) -> dict[str, dict[str, dict[int, Index]]]:
        """Cells of each body, by subdomain and block."""
        if self.dim < 2:
            raise InputError(f"{self.file}: there are no cells of two or three dimensions in it")
        there = {name: self.of_dim(name, self.dim) for name in self.named}
        there = {name: blocks for name, blocks in there.items() if blocks}
        if wanted is not None:
            check_kind(wanted, Mapping, "bodies", "give {'body': ['tag', ...]}", "dict")
            return {str(b): self._tags(str(b), tags, there) for b, tags in wanted.items()}
        taken = [np.zeros(len(cells), dtype=np.intp) for cells in self.cells]
        chosen: dict[str, Any] = {}
        order = list(there)
        # the small ones first: sets of sets, "all", hold nothing else then; of equal ones the last, as
        # those of an .inp that stand with the elements
        for name in sorted(order, key=lambda n: (sum(map(len, there[n].values())), -order.index(n))):
            used = np.concatenate([taken[i][some] for i, some in there[name].items()])
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
            for i, some in there[name].items():
                taken[i][some] = len(chosen)
        found = {name: chosen[name] for name in order if name in chosen}
        return {**found, **self._rest(taken, found)}

    def _tags(
        self, body: str, tags: Any, there: dict[str, dict[int, Index]]
    ) -> dict[str, dict[int, Index]]:
        """The cells of some tags."""
        names = [tags] if isinstance(tags, str) else list(tags)
        for name in names:
            if name not in there:
                raise InputError(
                    f"bodies: {body!r} is to have {shown(name)}, and {self.file} has no such tag of "
                    f"cells of {self.dim} dimensions{suggest(name, there, 'tags')}"
                )
        return {name: there[name] for name in names}

    def _rest(
        self, taken: list[Index], found: dict[str, Any]
    ) -> dict[str, dict[str, dict[int, Index]]]:
        """Cells without a tag: every connected part of them is a body."""
        rest = {
            i: np.flatnonzero(used == 0)
            for i, used in enumerate(taken)
            if _shape(self.kinds[i])[0] == self.dim and not used.all()
        }
        if not rest:
            return {}
        corners = {i: self.cells[i][some][:, : _shape(self.kinds[i])[1]] for i, some in rest.items()}
        widest = max(part.shape[1] for part in corners.values())
        tables = [
            np.pad(part, ((0, 0), (0, widest - part.shape[1])), mode="edge")
            for part in corners.values()
        ]
        number = pieces(np.concatenate(tables).T, len(self.points))
        parts = {i: number[part[:, 0]] for i, part in corners.items()}
        bodies: dict[str, dict[str, dict[int, Index]]] = {}
        for k in np.unique(np.concatenate(list(parts.values()))):
            name = f"body {len(found) + len(bodies) + 1}"
            bodies[name] = {name: {i: rest[i][parts[i] == k] for i in rest if np.any(parts[i] == k)}}
        return bodies

    def kind(self, name: str, parts: dict[str, dict[int, Index]]) -> str:
        """What meshio calls the cells of a body: all of them are alike."""
        kinds = sorted({self.kinds[i] for blocks in parts.values() for i in blocks})
        if len(kinds) > 1 or kinds[0] not in ELEMENTS:
            raise InputError(
                f"{self.file}: body {name!r} has cells {', '.join(kinds)}; a body has cells of one "
                f"kind, of {', '.join(ELEMENTS)}. Mesh it anew, or tie several bodies"
            )
        return kinds[0]

    def mesh(self, name: str, parts: dict[str, dict[int, Index]]) -> skfem.Mesh:
        """The mesh of a body with its subdomains and boundaries by name."""
        kind = self.kind(name, parts)
        tables = {
            part: [self.cells[i][some] for i, some in blocks.items()] for part, blocks in parts.items()
        }
        cells = np.concatenate([table for several in tables.values() for table in several])
        corners = np.unique(cells[:, : _shape(kind)[1]])
        nodes = np.concatenate([corners, np.setdiff1d(cells, corners)])  # as scikit-fem numbers them
        local = np.full(len(self.points), -1)
        local[nodes] = np.arange(len(nodes))
        points, kind, table = completed(self.points[nodes], kind, local[cells])
        if self.dim == 2 and np.ptp(points[:, 2:]) > 0:
            raise InputError(f"{self.file}: body {name!r} is made of shells: a body is plane or solid")
        mesh = from_meshio(meshio.Mesh(points, [(kind, table)]))
        if len(tables) > 1:
            ends = np.cumsum([0, *(sum(map(len, several)) for several in tables.values())])
            places = zip(tables, ends[:-1], ends[1:], strict=True)
            mesh = mesh.with_subdomains({part: np.arange(a, b) for part, a, b in places})
        found = self._boundaries(mesh, local, len(corners))
        return mesh.with_boundaries(found) if found else mesh

    def _boundaries(self, mesh: skfem.Mesh, local: Index, corners: int) -> dict[str, Index]:
        """Facets of the boundary of a mesh by the names of groups of facets, and of sets of nodes."""
        numbers = mesh.boundary_facets()
        facets = np.sort(mesh.facets[:, numbers], axis=0).T
        found: dict[str, Any] = {}
        for name in self.named:
            for i, some in self.of_dim(name, self.dim - 1).items():
                mine = np.sort(local[self.cells[i][some][:, : facets.shape[1]]], axis=1)
                _, key = np.unique(np.concatenate([facets, mine]), axis=0, return_inverse=True)
                there = np.isin(key.ravel()[: len(facets)], key.ravel()[len(facets) :])
                found[name] = np.union1d(found.get(name, numbers[:0]), numbers[there])
        for name, nodes in self.nodes.items():
            inside = np.zeros(corners, dtype=bool)
            own = local[nodes]
            inside[own[(own >= 0) & (own < corners)]] = True
            found.setdefault(name, numbers[inside[facets].all(axis=1)])
        return {name: some.astype(np.int32) for name, some in found.items() if len(some)}


def completed(points: Array, kind: str, cells: Index) -> tuple[Array, str, Index]:
    """Eight-node quadrilaterals and twenty-node bricks with all nodes of scikit-fem's meshes.

    Those are where the shape functions of the element have them, which stays what it is.
    """
    if kind not in ("quad8", "hexahedron20"):
        return points, kind, cells
    x = points[cells]
    if kind == "quad8":
        more, kind = (x[:, 4:].sum(axis=1) / 2 - x[:, :4].sum(axis=1) / 4)[:, None], "quad9"
        names = len(points) + np.arange(len(cells))[:, None]
        return np.concatenate([points, more[:, 0]]), kind, np.column_stack([cells, names])
    rims = np.array(BRICK)
    faces = x[:, rims[:, 4:]].sum(axis=2) / 2 - x[:, rims[:, :4]].sum(axis=2) / 4
    middle = x[:, 8:].sum(axis=1) / 4 - x[:, :8].sum(axis=1) / 4
    more = np.concatenate([faces, middle[:, None]], axis=1).reshape(-1, 3)
    names = len(points) + np.arange(len(more)).reshape(len(cells), 7)
    return np.concatenate([points, more]), "hexahedron27", np.column_stack([cells, names])


#: The faces of a brick in the order in which meshio has the nodes in their middles: corners, edges.
BRICK = [
    (0, 3, 7, 4, 11, 19, 15, 16), (1, 2, 6, 5, 9, 18, 13, 17), (0, 1, 5, 4, 8, 17, 12, 16),
    (3, 2, 6, 7, 10, 18, 14, 19), (0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15),
]  # fmt: skip


def _shape(kind: str) -> tuple[int, int]:
    """Dimension and corners of what meshio calls a cell; points, and what is unknown, have none."""
    return CORNERS.get(kind.rstrip("0123456789"), (0, 1))


def _numbers(found: Any) -> Index:
    return np.asarray([] if found is None else found, dtype=np.intp).ravel()


def _tagged(mesh: meshio.Mesh, key: str) -> dict[str, list[Index]]:
    """Groups from one number for each cell, by the names that formats keep elsewhere."""
    if key not in mesh.cell_data:
        return {}
    families = getattr(mesh, "cell_tags", {})  # of .med: several names for each number
    blocks = [np.asarray(tags).ravel() for tags in mesh.cell_data[key]]
    found: dict[str, list[Index]] = {}
    for dim in (1, 2, 3):
        mine = [_shape(block.type)[0] == dim for block in mesh.cells]
        numbers = np.unique(np.concatenate([[0], *(b for b, m in zip(blocks, mine, strict=True) if m)]))
        for tag in numbers[numbers != 0]:
            own = [
                n
                for n, (t, d) in ((n, v[:2]) for n, v in mesh.field_data.items())
                if (t, d) == (tag, dim)
            ]
            for name in own or families.get(tag) or [f"tag {int(tag)}"]:
                some = [
                    np.flatnonzero(b == tag) if m else _numbers(None)
                    for b, m in zip(blocks, mine, strict=True)
                ]
                before = found.get(name, [_numbers(None)] * len(blocks))
                found[name] = [np.union1d(a, b) for a, b in zip(before, some, strict=True)]
    return found


def _read(file: Path, size: float | None, order: int) -> meshio.Mesh:
    """What a file has, by meshio, or by Gmsh and meshio."""
    if not file.is_file():
        raise InputError(f"{file} is no file")
    suffix = file.suffix.lower()
    if suffix not in CAD + BY_GMSH:
        try:
            return meshio.read(file)
        except ImportError as error:
            package = error.name
            raise InputError(
                f"{file}: meshio reads {suffix} by {package}: pip install {package}"
            ) from error
        except (Exception, SystemExit) as error:  # every format fails in its own way
            raise InputError(f"{file} can not be read by meshio: {error}") from error
    try:
        import gmsh  # optional
    except ImportError:
        raise InputError(NO_GMSH.format(path=file, suffix=suffix)) from None
    with TemporaryDirectory() as folder:
        own = not gmsh.isInitialized()
        if own:
            gmsh.initialize(interruptible=False)
        before = None if own else gmsh.model.getCurrent()
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.add(file.stem)
            _by_gmsh(gmsh, file, suffix in CAD, size, order)
            gmsh.write(f"{folder}/mesh.msh")
            gmsh.model.remove()
        except Exception as error:  # what Gmsh raises is no class of its own
            raise InputError(f"{file} can not be read or meshed by Gmsh: {error}") from error
        finally:
            if own:
                gmsh.finalize()
            elif before is not None:
                gmsh.model.setCurrent(before)
        return meshio.read(f"{folder}/mesh.msh")


def _by_gmsh(gmsh: Any, file: Path, cad: bool, size: float | None, order: int) -> None:
    """Load a file into Gmsh's model; of geometry every volume is a group, and it is meshed."""
    if not cad:
        gmsh.merge(str(file))
        return
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
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.model.mesh.generate(dim)
