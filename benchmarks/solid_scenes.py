"""Random scenes of solids: stacks of blocks with plane, inclined, domed or waved faces, and obstacles.

A scene is a function of its number. All in it is given in local axes, z along the stack, and placed by
one rotation. `build` hands it to the library; all matrices are scikit-fem's.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import skfem as fem
from scipy.sparse import coo_matrix
from scipy.spatial.transform import Rotation
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc

#: Element, mesh of the same order where faces are to be curved, quadrature order, faces a side.
ELEMENTS: dict[str, tuple[Any, Any, int]] = {
    "tet P1": (fem.ElementTetP1, None, 2),
    "tet P2": (fem.ElementTetP2, fem.MeshTet2, 4),
    "hex Q1": (fem.ElementHex1, None, 3),
    "hex S2": (fem.ElementHexS2, None, 5),
    "hex Q2": (fem.ElementHex2, fem.MeshHex2, 5),
}
WALLS = {"left": (0, 0.0), "right": (0, 1.0), "front": (1, 0.0), "back": (1, 1.0), "bottom": (2, 0.0)}
WALLS["top"] = (2, 1.0)


@dataclass(frozen=True)
class Height:
    """z = level + a x + b y + dome ((x - 1/2)^2 + (y - 1/2)^2) + wave sin 2 x cos 2 y."""

    level: float
    a: float = 0.0
    b: float = 0.0
    dome: float = 0.0
    wave: float = 0.0

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        round_ = self.dome * ((x - 0.5) ** 2 + (y - 0.5) ** 2)
        return self.level + self.a * x + self.b * y + round_ + self.wave * np.sin(2 * x) * np.cos(2 * y)

    @property
    def plane(self) -> bool:
        """Whether it is a plane."""
        return not (self.dome or self.wave)


@dataclass(frozen=True)
class BodySpec:
    """A block between two heights; `rounded` pulls its outline towards a circle."""

    name: str
    element: str
    counts: tuple[int, int, int]
    low: tuple[float, float]
    wide: tuple[float, float]
    bottom: Height
    top: Height
    E: float
    nu: float
    rounded: float = 0.0
    curved: bool = False
    bed: float = 0.0  # stiffness of springs to the ground in its volume, over E
    clamped: tuple[str, ...] = ()
    rollers: tuple[tuple[str, int], ...] = ()
    uneven: float = 0.0  # nodes moved by this part of an element

    def place(self, p: np.ndarray) -> np.ndarray:
        """Local positions of points of the unit cube."""
        q = 2 * p[:2] - 1
        length, most = np.linalg.norm(q, axis=0), np.abs(q).max(axis=0)
        ball = q * most / np.where(length > 0, length, 1.0)
        q = 0.5 + 0.5 * ((1 - self.rounded) * q + self.rounded * ball)
        x, y = (self.low[i] + self.wide[i] * q[i] for i in range(2))
        z0, z1 = self.bottom(x, y), self.top(x, y)
        return np.array([x, y, z0 + p[2] * (z1 - z0)])


@dataclass(frozen=True)
class ContactSpec:
    """A contact: body and tag of both sides, or an obstacle."""

    name: str
    secondary: tuple[str, str]
    primary: tuple[str, str] | None
    obstacle: tuple[Any, ...] | None = None  # ("plane", point, normal), ("sphere" | "cylinder", ...)
    friction: tuple[Any, ...] | None = None  # ("coulomb", mu, cap, cohesion), ("tresca", limit)
    method: str = "mortar"
    tied: bool = False
    interference: float = 0.0
    G: float | None = None  # tangential stiffness over E times size of the secondary
    grain: tuple[float, float, float, float] | None = None  # direction, and what it leaves of friction


@dataclass(frozen=True)
class Scene:
    """One scene in numbers; `drive` is "x" (the top is moved) or "f" (a traction there)."""

    seed: int
    bodies: tuple[BodySpec, ...]
    contacts: tuple[ContactSpec, ...]
    drive: str
    steps: tuple[tuple[float, float, float], ...]
    turn: tuple[tuple[float, ...], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    size: float = 1.0
    unit: float = 1.0  # of stress
    finite: bool = False
    placement: float = 1e-7  # tolerance of finite sliding
    rigid: tuple[tuple[str, float], ...] = ()  # obstacles on springs: stiffness over the unit and size
    rise: float = 0.0  # friction over small normal forces where it would jump; zero: it jumps

    def springs(self, name: str) -> tuple[float, float]:
        """Stiffness of the springs of a rigid body, and the arm by which they hold its turns."""
        return dict(self.rigid)[name] * self.unit * self.size, 0.5 * self.size

    @property
    def mu(self) -> float:
        """The largest coefficient of friction."""
        return max(
            (c.friction[1] for c in self.contacts if c.friction and len(c.friction) > 2), default=0.0
        )

    @property
    def jumps(self) -> bool:
        """Whether some friction does not begin at zero: a point may be closed by it, or open."""
        laws = [c.friction for c in self.contacts if c.friction]
        return any(law[0] == "tresca" or law[3] > 0 for law in laws)

    @property
    def R(self) -> np.ndarray:
        """From local to global directions."""
        return np.array(self.turn)

    def at(self, p: Any) -> np.ndarray:
        """Global position of a local point."""
        return self.size * (self.R @ np.asarray(p, dtype=float) + np.array(self.shift))


@dataclass(frozen=True, eq=False)
class Made:
    """What scikit-fem makes of a body: the judge's own matrices."""

    spec: BodySpec
    basis: Any
    K: Any
    D: np.ndarray
    tags: dict[str, np.ndarray]
    drive: tuple[np.ndarray, ...] = field(default=())  # f or x for a unit along each local axis


@dataclass(frozen=True)
class Way:
    """How a scene is handed to the library."""

    bodies: tuple[int, ...] | None = None
    contacts: tuple[int, ...] | None = None
    method: str | None = None
    linear: str = "auto"
    loop: str = "newton"
    start: str = ""  # "proximal": no other start may find the answer
    shuffle: int = 0  # another numbering of the meshes
    turn: int = 0  # another rotation of the whole scene


GIVEN = Way()


class Mapping(fem.MappingIsoparametric):
    """scikit-fem's mapping, inverted from several starts and without bounds.

    Its own stops at faces of the element where a Newton step leaves it, and may not get away again.
    """

    def invF(self, x, tind=None, **_):  # type: ignore[no-untyped-def]
        for start in (0.25, 0.5, 0.1):
            X = np.full(x.shape, start)
            for _ in range(30):
                step = np.einsum("ijkl,jkl->ikl", self.invDF(X, tind), x - self.F(X, tind))
                X = X + step
                if np.abs(step).max() < 1e-12:
                    return X
        raise ValueError("a face of the scene is too crooked")


def facet_basis(mesh: Any, element: Any, **given: Any) -> Any:
    """A basis on facets."""
    own = mesh.mapping()
    if isinstance(own, fem.MappingIsoparametric):
        given["mapping"] = Mapping(mesh, own.elem, own.bndelem)
    return fem.FacetBasis(mesh, element, **given)


def moved(m: Made, u: np.ndarray) -> Made:
    """A body of linear elements where it is after displacements."""
    mesh = m.basis.mesh
    p = np.ascontiguousarray(mesh.p + u[m.basis.nodal_dofs])
    return replace(m, basis=fem.Basis(type(mesh)(p, mesh.t), m.basis.elem, intorder=2))


def unit_cube(spec: BodySpec, seed: int, shuffle: int) -> tuple[Any, dict[str, np.ndarray]]:
    """The mesh in the unit cube, and the facets of its walls."""
    rng = np.random.default_rng([seed, 7])
    axes = [np.linspace(0, 1, n + 1) for n in spec.counts]
    mesh = fem.MeshHex.init_tensor(*axes)
    p = mesh.p.copy()
    for i, n in enumerate(spec.counts):  # nodes on walls stay on them
        moved = p[i] + spec.uneven / n * rng.uniform(-1, 1, p.shape[1])
        p[i] = np.where((p[i] > 1e-9) & (p[i] < 1 - 1e-9), moved, p[i])
    mesh = fem.MeshHex(p, mesh.t)
    if spec.element.startswith("tet"):
        mesh = mesh.to_meshtet()
    if shuffle:
        mesh = _shuffled(mesh, np.random.default_rng([seed, shuffle]))
    outer = mesh.boundary_facets()
    mid = mesh.p[:, mesh.facets[:, outer]]
    tags = {w: outer[np.all(np.isclose(mid[i], v, atol=1e-9), axis=0)] for w, (i, v) in WALLS.items()}
    return mesh, tags


def _shuffled(mesh: Any, rng: np.random.Generator) -> Any:
    new = rng.permutation(mesh.nvertices)
    p = np.empty((3, mesh.nvertices))
    p[:, new] = mesh.p
    return type(mesh)(p, new[mesh.t][:, rng.permutation(mesh.nelements)])


def make(s: Scene, shuffle: int = 0) -> dict[str, Made]:
    """All bodies of a scene, by name."""
    return {spec.name: _make(s, k, shuffle) for k, spec in enumerate(s.bodies)}


def _make(s: Scene, k: int, shuffle: int) -> Made:
    spec = s.bodies[k]
    mesh, tags = unit_cube(spec, 10 * s.seed + k, shuffle)
    element, curved, order = ELEMENTS[spec.element]
    if spec.curved:
        mesh = curved.from_mesh(mesh)
    at = s.size * (s.R @ spec.place(mesh.doflocs) + np.array(s.shift)[:, None])
    mesh = type(mesh)(np.ascontiguousarray(at), mesh.t)
    basis = fem.Basis(mesh, fem.ElementVector(element()), intorder=order)
    E = spec.E * s.unit
    K = stiffness(basis, *lame_parameters(E, spec.nu))
    if spec.bed:
        values = np.array([np.broadcast_to(b[0], b[0].shape) for b in basis.basis])
        mass = assembled(basis, np.einsum("aieq,bieq,eq->eab", values, values, basis.dx, optimize=True))
        K = K + spec.bed * E / s.size**2 * mass
    last = k == len(s.bodies) - 1
    D = [basis.get_dofs(tags[t]).all() for t in spec.clamped]
    if last and s.drive == "x":
        D.append(basis.get_dofs(tags["top"]).all())
    for tag, axis in spec.rollers:
        column = int(np.argmax(np.abs(s.R[:, axis])))
        D.append(basis.get_dofs(tags[tag]).all([f"u^{column + 1}"]))
    drive: list[np.ndarray] = []
    for axis in range(3 * last):
        if s.drive == "x":
            v = s.size * s.R[:, axis]
            x = np.zeros(basis.N)
            for c, dofs in enumerate(components(basis)):
                x[np.intersect1d(dofs, basis.get_dofs(tags["top"]).all())] = v[c]
            drive.append(x)
        else:
            facets = facet_basis(mesh, basis.elem, facets=tags["top"], intorder=order)
            t = s.unit * s.R[:, axis]
            form = fem.LinearForm(lambda v, w, t=t: sum(t[i] * v[i] for i in range(3)))
            drive.append(form.assemble(facets))
    D = np.unique(np.concatenate(D)) if D else np.zeros(0, int)
    return Made(spec, basis, K.tocsr(), D, tags, tuple(drive))


def stiffness(basis: Any, lam: float, mu: float) -> Any:
    """Linear elasticity, all pairs of shape functions at once (scikit-fem takes them one by one)."""
    grad = np.array([b[0].grad for b in basis.basis])  # (a, i, j, e, q)
    strain = 0.5 * (grad + np.swapaxes(grad, 1, 2)).reshape(len(grad), 9, *grad.shape[3:])
    div = strain[:, [0, 4, 8]].sum(axis=1)
    blocks = lam * np.einsum("aeq,beq,eq->eab", div, div, basis.dx, optimize=True)
    blocks += 2 * mu * np.einsum("aieq,bieq,eq->eab", strain, strain, basis.dx, optimize=True)
    return assembled(basis, blocks)


def assembled(basis: Any, blocks: np.ndarray) -> Any:
    """The matrix of element matrices (e, a, b)."""
    dofs = basis.element_dofs.T
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    matrix = coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(basis.N, basis.N))
    return matrix.tocsr()


def components(basis: Any) -> list[np.ndarray]:
    """DOFs of each component."""
    return [np.asarray(i) for i in basis.split_indices()]


def given(s: Scene, m: Made, step: tuple[float, ...]) -> np.ndarray:
    """Load, or prescribed displacements, of the driven body in a step."""
    return sum((a * d for a, d in zip(step, m.drive, strict=True)), np.zeros(m.basis.N))


def turned(s: Scene, k: int) -> Scene:
    """The scene in another direction."""
    if k == 0:
        return s
    T = Rotation.random(random_state=s.seed + 1000 * k).as_matrix()
    if any(b.rollers for b in s.bodies):
        T = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # rollers stay along the axes
    return replace(s, turn=tuple(map(tuple, T @ s.R)), shift=tuple(T @ np.array(s.shift)))


def build(s: Scene, made: dict[str, Made], way: Way = GIVEN) -> tuple[Any, list[dict[str, Any]]]:
    """The library's solver of a scene and its load steps."""
    specs = [s.bodies[i] for i in way.bodies or range(len(s.bodies))]
    bodies = {
        b.name: sc.Body(made[b.name].basis, made[b.name].K.copy(), D=made[b.name].D, name=b.name)
        for b in specs
    }
    tools = {name: tool(s, name) for name, _ in s.rigid}
    contacts = []
    for c in (s.contacts[i] for i in way.contacts or range(len(s.contacts))):
        sides = [
            bodies[side[0]].surface(made[side[0]].tags[side[1]], name=side[1])
            for side in (c.secondary, c.primary)
            if side is not None
        ]
        contacts.append(
            sc.Contact(
                sides[0],
                sides[1] if c.primary else tools.get(c.name) or obstacle(s, c),
                friction=law(s, c),
                method=way.method or c.method,
                tied=c.tied,
                interference=c.interference * s.size,
                sliding="finite" if s.finite else "small",
                name=c.name,
            )
        )
    linear = sc.linalg.Direct() if way.linear == "direct" else way.linear
    most = 2 if way.start else None
    options = sc.Options(placement_tolerance=s.placement, max_iterations=most)
    solver = sc.ContactSolver(
        [*bodies.values(), *tools.values()], contacts, loop=way.loop, linear=linear, options=options
    )
    top = s.bodies[-1].name
    return solver, [{s.drive: {top: given(s, made[top], step)}} for step in s.steps]


def tool(s: Scene, name: str) -> Any:
    """An obstacle on springs."""
    stiff, arm = s.springs(name)
    c = next(c for c in s.contacts if c.name == name)
    K = np.repeat([stiff, stiff * arm**2], 3)
    return sc.RigidBody(obstacle(s, c), about=s.at((0.5, 0.5, 0.0)), K=K, name=name)


def obstacle(s: Scene, c: ContactSpec) -> Any:
    """The rigid obstacle of a contact."""
    assert c.obstacle is not None
    kind, point, form = c.obstacle
    if kind == "plane":
        return sc.RigidPlane(s.at(point), s.R @ np.array(form), name=c.name)
    if kind == "sphere":
        return sc.RigidSphere(s.at(point), form * s.size, name=c.name)
    return sc.RigidCylinder(
        s.at(point), form * s.size, axis=s.R @ np.array([0.0, 1.0, 0.0]), name=c.name
    )


@dataclass(frozen=True, eq=False)
class Rising(sc.conditions.FrictionLaw):
    """A law whose bound begins at zero and rises steeply."""

    law: Any
    rise: float

    def limit(self, normal_force: np.ndarray, area: np.ndarray, slip: np.ndarray) -> np.ndarray:
        return np.minimum(self.law.limit(normal_force, area, slip), self.rise * normal_force)


def law(s: Scene, c: ContactSpec) -> Any:
    """The friction law of a contact."""
    found = _law_as_given(s, c)
    return Rising(found, s.rise, stiffness=found.stiffness) if found and s.rise else found


def _law_as_given(s: Scene, c: ContactSpec) -> Any:
    if c.friction is None:
        return None
    body = next(b for b in s.bodies if b.name == c.secondary[0])
    G = None if c.G is None else c.G * body.E * s.unit * s.size
    if c.friction[0] == "tresca":
        return sc.Tresca(c.friction[1] * s.unit, stiffness=G)
    _, mu, cap, cohesion = c.friction
    if c.grain is None:
        return sc.Coulomb(mu, tau_max=cap * s.unit, cohesion=cohesion * s.unit, stiffness=G)
    pair = np.array([c.grain[3], 1.0])
    return sc.conditions.OrthotropicCoulomb(
        mu * pair, s.R @ c.grain[:3], cap * s.unit * pair, cohesion * s.unit * pair, stiffness=G
    )


def on_circle(s: Scene, c: ContactSpec, normal: Any, vectors: Any, power: int) -> Any:
    """Tangential vectors (m, 3) of a contact with a grain as those that a circle would bound.

    `power` is 1 for slips, which count for less along the grain, and -1 for forces, which for more.
    """
    if c.grain is None:
        return vectors
    d = s.R @ c.grain[:3]
    d = d - np.sum(d * normal, axis=1)[:, None] * normal
    d /= np.linalg.norm(d, axis=1)[:, None]
    return vectors + (c.grain[3] ** power - 1.0) * np.sum(vectors * d, axis=1)[:, None] * d


# What is drawn


def scene(seed: int, friction: bool = True, grain: bool = False) -> Scene:
    """The scene of a number; without `friction` the same one is smooth, and held by springs.

    With `grain` all of its friction but Tresca's has a direction, along which it is less.
    """
    s = _stack(seed, friction)
    s = _rough(s, np.random.default_rng([seed, 32])) if friction else s
    return _grained(s, np.random.default_rng([seed, 33])) if grain else s


def _grained(s: Scene, rng: np.random.Generator) -> Scene:
    """The scene with a direction of friction, which is level but for what does not count."""
    contacts = []
    for c in s.contacts:
        angle, ratio = rng.uniform(0, np.pi), float(10 ** rng.uniform(-1.0, 0.0))
        grain = (float(np.cos(angle)), float(np.sin(angle)), float(rng.uniform(-0.2, 0.2)), ratio)
        has = c.friction is not None and c.friction[0] == "coulomb"
        contacts.append(replace(c, grain=grain if has else None))
    return replace(s, contacts=tuple(contacts))


def _rough(s: Scene, rng: np.random.Generator) -> Scene:
    """The scene with some large coefficients, soft friction, finite sliding and tools on springs."""
    large, soft = rng.random(), rng.random() < 0.2
    G = float(10 ** rng.uniform(-0.5, 1.5))
    contacts = []
    for c in s.contacts:
        law = c.friction
        if law and law[0] == "coulomb" and large < 0.12:
            law = ("coulomb", 1.5 if large < 0.08 else 3.0, *law[2:])
        contacts.append(replace(c, friction=law, G=G if law and soft else None))
    straight = all(b.element in ("tet P1", "hex Q1") for b in s.bodies)
    finite = bool(rng.random() < 0.3) and straight
    rigid = ()
    if s.contacts[0].primary is None and s.contacts[0].name == "floor" and rng.random() < 0.35:
        rigid = (("floor", float(min(b.E for b in s.bodies) * 10 ** rng.uniform(-0.5, 1.5))),)
    return replace(s, contacts=tuple(contacts), finite=finite, rigid=rigid)


def _stack(seed: int, friction: bool) -> Scene:
    """A random stack of blocks."""
    rng = np.random.default_rng([seed, 31])
    n = int(rng.choice([2, 2, 2, 3, 3, 4]))
    smooth = rng.random() < 0.3 or not friction
    axes = rng.random() < 0.4  # rollers are along the axes
    contrast = rng.random() < 0.25
    E = 10 ** (rng.uniform(-3, 3, n) if contrast else rng.uniform(-0.5, 0.5, n))
    floor = str(rng.choice(["none", "none", "plane", "sphere", "cylinder"]))
    flavours = [str(rng.choice(["flat", "flat", "inclined", "dome", "wave", "gap"])) for _ in range(n)]
    bodies: list[BodySpec] = []
    contacts: list[ContactSpec] = []
    strength = 1e-3 * float(E.min())
    lower, level = Height(0.0), 0.0
    if floor in ("sphere", "cylinder") and rng.random() < 0.3:
        lower = Height(0.0, dome=0.05)
    grids: list[tuple[int, int]] = []
    for k in range(n):
        level += float(rng.uniform(0.4, 0.8))
        flavour = flavours[k] if k < n - 1 else "flat"
        a, b = rng.uniform(-0.25, 0.25, 2) if flavour == "inclined" else (0.0, 0.0)
        wave = float(rng.uniform(0.02, 0.05)) if flavour == "wave" else 0.0
        top = Height(level, float(a), float(b), 0.0, wave)
        element = str(rng.choice(list(ELEMENTS), p=[0.25, 0.12, 0.4, 0.1, 0.13]))
        quadratic = ELEMENTS[element][2] >= 4
        nx, ny = (
            (int(i) for i in rng.integers(1, 3, 2)) if quadratic else map(int, rng.integers(2, 5, 2))
        )
        if grids and rng.random() < 0.3:
            nx, ny = grids[-1]
        grids.append((nx, ny))
        form = str(rng.choice(["same", "same", "inner", "shifted"])) if k else "same"
        low = {"same": (0.0, 0.0), "inner": (0.2, 0.15), "shifted": tuple(rng.uniform(-0.3, 0.3, 2))}[
            form
        ]
        wide = (0.6, 0.6) if form == "inner" else (1.0, 1.0)
        clamped = ("bottom",) if k == 0 and floor == "none" else ()
        if k == 0 and rng.random() < 0.2:
            clamped += ("left",)
        driven = k == n - 1
        bed, rollers = 0.0, ()
        if not clamped:
            bed = float(10 ** rng.uniform(-3, -1)) if rng.random() < 0.6 or smooth else 0.0
            if axes and form == "same" and rng.random() < 0.6:
                rollers = (("left", 0), ("front", 1))
                bed = 0.0 if (k or floor == "plane") and rng.random() < 0.3 else bed
        curved = ELEMENTS[element][1] is not None and rng.random() < 0.5
        bodies.append(
            BodySpec(
                f"body{k}",
                element,
                (nx, ny, 1 if quadratic else int(rng.integers(1, 3))),
                tuple(float(v) for v in low),
                wide,
                lower,
                top,
                float(E[k]),
                float(rng.choice([0.0, 0.3, 0.3, 0.45])),
                rounded=float(rng.choice([0.0, 0.0, 0.5])) if form == "inner" else 0.0,
                curved=bool(curved),
                bed=0.0 if driven and rng.random() < 0.3 and not smooth else bed,
                clamped=clamped,
                rollers=rollers,
                uneven=float(rng.choice([0.0, 0.2])),
            )
        )
        lift = float(rng.uniform(0, 4e-4)) if flavour == "gap" else 0.0
        dome = float(rng.choice([5e-4, 2e-3, 1e-2])) if flavour == "dome" else 0.0
        lower = Height(level + lift, float(a), float(b), dome, wave)

        if k == 0 and floor != "none":
            radius = float(rng.uniform(2, 20))
            form_ = (0.0, 0.0, 1.0) if floor == "plane" else radius
            point = (0.5, 0.5, 0.0 if floor == "plane" else -radius)
            contacts.append(
                ContactSpec(
                    "floor",
                    ("body0", "bottom"),
                    None,
                    (floor, point, form_),
                    _law(rng, smooth, strength),
                )
            )
        if k:
            up, down = (f"body{k}", "bottom"), (f"body{k - 1}", "top")
            sides = (up, down) if rng.random() < 0.5 else (down, up)
            tied = bool(rng.random() < 0.15)
            contacts.append(
                ContactSpec(
                    f"joint{k}",
                    *sides,
                    friction=None if tied else _law(rng, smooth, strength),
                    method=str(rng.choice(["mortar", "node"])),
                    tied=tied,
                    interference=float(rng.uniform(0, 3e-4))
                    if rng.random() < 0.15 and not tied
                    else 0.0,
                )
            )
    drive = str(rng.choice(["x", "x", "f"]))
    if rng.random() < 0.2 and bodies[0].rollers == ():  # a wall beside the lowest body
        contacts.append(
            ContactSpec("wall", ("body0", "right"), None, ("plane", (1.0, 0, 0), (-1.0, 0, 0)), None)
        )
    scale = 1e-3 if drive == "x" else strength
    steps = []
    for _ in range(int(rng.integers(2, 5))):
        press = rng.uniform(0.3, 1.5) if rng.random() < 0.9 else -0.2
        side = rng.uniform(-0.6, 0.6, 2)
        steps.append((float(scale * side[0]), float(scale * side[1]), float(-scale * press)))
    T = np.eye(3)
    if any(b.rollers for b in bodies):
        T = np.roll(np.eye(3), int(rng.integers(3)), axis=0)
    elif rng.random() < 0.7:
        T = Rotation.random(random_state=seed).as_matrix()
    return Scene(
        seed,
        tuple(bodies),
        tuple(contacts),
        drive,
        tuple(steps),
        tuple(map(tuple, T)),
        tuple(rng.uniform(-2, 2, 3)),
        float(rng.choice([1.0, 1.0, 1e-3, 50.0])),
        float(rng.choice([1.0, 1.0, 1e9])),
    )


def _law(rng: np.random.Generator, smooth: bool, strength: float) -> tuple[Any, ...] | None:
    """A friction law, or none."""
    kind = rng.random()
    mu = float(rng.choice([0.1, 0.3, 0.6, 1.0, 2.0], p=[0.2, 0.4, 0.25, 0.1, 0.05]))
    cap = float(strength * rng.uniform(0.1, 1)) if rng.random() < 0.2 else np.inf
    cohesion = float(strength * rng.uniform(0.05, 0.3)) if rng.random() < 0.2 else 0.0
    limit = float(strength * rng.uniform(0.05, 0.5))
    if smooth or kind < 0.2:
        return None
    if kind < 0.3:
        return ("tresca", limit)
    return ("coulomb", mu, max(cap, cohesion), cohesion)
