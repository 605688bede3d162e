"""Random scenes for the judge: bodies, contacts and load steps as numbers, `scene(seed)`.

A scene is drawn in its own place and units, then turned, moved and scaled. The library is only met in
`build`, which also makes the same scene with bodies and contacts in another order, with the other
method, on a finer mesh, or by another route.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import skfem as fem
from judge_shapes import ELEMENTS, Block, Disc, Edge, Polygon, Ring, mesh_of, refined
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

TRIANGLES, ANY = ("P1", "P2"), ("P1", "Q1", "P2", "Q2", "S2")
COUNTS = {"P1": 1.0, "Q1": 1.0, "P2": 0.5, "Q2": 0.5, "S2": 0.5}  # facets of quadratic elements: half


@dataclass(frozen=True)
class BodySpec:
    """A body in numbers."""

    name: str
    shape: Any
    element: str
    E: float
    nu: float
    clamped: tuple[str, ...] = ()  # tags whose nodes are held in all components
    rollers: tuple[tuple[str, int], ...] = ()  # tags held in one component
    curved: bool = False


@dataclass(frozen=True)
class Drive:
    """What moves a scene: a traction, a prescribed displacement, or the motion of an obstacle.

    In a step with numbers (a, b) its value is ``a normal + b tangential``.
    """

    kind: str  # "f", "x", "motion"
    target: str  # body or obstacle
    tag: str
    normal: tuple[float, float]
    tangential: tuple[float, float]


@dataclass(frozen=True)
class ContactSpec:
    """A contact in numbers; `primary` is a body and tag, or an obstacle in local coordinates."""

    name: str
    secondary: tuple[str, str]
    primary: tuple[str, str] | None
    obstacle: tuple[Any, ...] | None = None  # ("plane", point, normal), ("cylinder", centre, radius)
    friction: tuple[Any, ...] | None = None  # ("coulomb", mu, cap, cohesion), ("tresca", limit)
    G: float | None = None  # tangential stiffness over E of the secondary
    method: str = "mortar"
    sliding: str = "small"
    tied: bool = False
    interference: float = 0.0


@dataclass(frozen=True)
class Scene:
    """One scene in numbers."""

    seed: int
    kind: str
    bodies: tuple[BodySpec, ...]
    contacts: tuple[ContactSpec, ...]
    drives: tuple[Drive, ...]
    steps: tuple[tuple[float, float], ...]
    angle: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    size: float = 1.0
    unit: float = 1.0  # of stress
    placement: float | None = None  # tolerance of finite sliding, where it is not the default

    @property
    def finite(self) -> bool:
        """Whether a contact slides far."""
        return any(c.sliding == "finite" for c in self.contacts)


@dataclass(frozen=True, eq=False)
class Made:
    """What scikit-fem makes of a body: the judge's own matrices."""

    spec: BodySpec
    basis: Any
    K: Any
    D: np.ndarray
    tags: dict[str, np.ndarray]
    loads: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    moves: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def f(self, a: float, b: float) -> np.ndarray:
        """Load of a step."""
        return sum((a * n + b * t for n, t in self.loads.values()), np.zeros(self.basis.N))

    def x(self, a: float, b: float) -> np.ndarray:
        """Prescribed displacements of a step."""
        return sum((a * n + b * t for n, t in self.moves.values()), np.zeros(self.basis.N))

    def facets(self, tag: str) -> np.ndarray:
        """Facets of an edge, or of several, "top+right"."""
        return np.concatenate([self.tags[t] for t in tag.split("+")])

    @cached_property
    def doflocs(self) -> np.ndarray:
        """Positions of the DOFs."""
        return np.ascontiguousarray(self.basis.doflocs.T)


def turn(scene: Scene) -> np.ndarray:
    """Rotation from local to global directions."""
    c, s = np.cos(scene.angle), np.sin(scene.angle)
    return np.array([[c, -s], [s, c]])


def place(scene: Scene, p: Any) -> np.ndarray:
    """Global position of a local point."""
    return scene.size * (turn(scene) @ np.asarray(p, dtype=float)) + np.array(scene.shift) * scene.size


def make(scene: Scene, factor: int = 1) -> dict[str, Made]:
    """All bodies of a scene, by name."""
    return {spec.name: _make(scene, spec, factor) for spec in scene.bodies}


def _make(scene: Scene, spec: BodySpec, factor: int) -> Made:
    mesh, tags = mesh_of(refined(spec.shape, factor), spec.element, spec.curved)
    at = scene.size * (turn(scene) @ mesh.doflocs + np.array(scene.shift)[:, None])
    basis = fem.Basis(type(mesh)(at, mesh.t), fem.ElementVector(ELEMENTS[spec.element][1]()))
    form = linear_elasticity(*lame_parameters(spec.E * scene.unit, spec.nu))
    K = form.assemble(basis).tocsr()
    driven = [d for d in scene.drives if d.target == spec.name]
    held = {*spec.clamped, *(d.tag for d in driven if d.kind == "x")}
    D = [basis.get_dofs(tags[t]).all() for t in held]
    for tag, component in spec.rollers:
        D.append(basis.get_dofs(tags[tag]).all([f"u^{component + 1}"]))
    made = Made(spec, basis, K, np.unique(np.concatenate(D)) if D else np.zeros(0, int), tags)
    R = turn(scene)
    for k, drive in enumerate(driven):
        directions = [R @ np.array(v) for v in (drive.normal, drive.tangential)]
        if drive.kind == "f":
            facets = fem.FacetBasis(basis.mesh, basis.elem, facets=tags[drive.tag])
            made.loads[k] = tuple(_traction(facets, v * scene.unit) for v in directions)
        else:
            dofs = basis.get_dofs(tags[drive.tag])
            made.moves[k] = tuple(_motion(basis, dofs, v * scene.size) for v in directions)
    return made


def _traction(facets: Any, t: np.ndarray) -> np.ndarray:
    return fem.LinearForm(lambda v, w: t[0] * v[0] + t[1] * v[1]).assemble(facets)


def _motion(basis: Any, dofs: Any, v: np.ndarray) -> np.ndarray:
    x = np.zeros(basis.N)
    for component in range(2):
        x[dofs.all([f"u^{component + 1}"])] = v[component]
    return x


@dataclass(frozen=True)
class Way:
    """How a scene is handed to the library."""

    bodies: tuple[int, ...] | None = None  # order
    contacts: tuple[int, ...] | None = None
    method: str | None = None
    linear: str = "auto"
    loop: str = "newton"


GIVEN = Way()


def build(
    scene: Scene, made: dict[str, Made], way: Way = GIVEN
) -> tuple[sc.ContactSolver, list[dict[str, Any]]]:
    """The library's solver of a scene and its load steps."""
    names = [b.name for b in scene.bodies]
    order = way.bodies or tuple(range(len(names)))
    bodies = {}
    for i in order:
        m = made[names[i]]
        bodies[names[i]] = sc.Body(m.basis, m.K.copy(), D=m.D, name=names[i])
    specs = [scene.contacts[i] for i in way.contacts or range(len(scene.contacts))]
    contacts = [_contact(scene, c, bodies, made, way) for c in specs]
    options = {} if scene.placement is None else {"placement_tolerance": scene.placement}
    solver = sc.ContactSolver(
        list(bodies.values()),
        contacts,
        loop=way.loop,
        linear=sc.linalg.Direct() if way.linear == "direct" else "auto",
        options=sc.Options(**options),
    )
    return solver, [step_of(scene, made, a, b) for a, b in scene.steps]


def step_of(scene: Scene, made: dict[str, Made], a: float, b: float) -> dict[str, Any]:
    """A load step as the library takes it."""
    step: dict[str, Any] = {
        "f": {name: m.f(a, b) for name, m in made.items() if m.loads},
        "x": {name: m.x(a, b) for name, m in made.items() if m.moves},
    }
    motion = {
        d.target: scene.size * (turn(scene) @ (a * np.array(d.normal) + b * np.array(d.tangential)))
        for d in scene.drives
        if d.kind == "motion"
    }
    return {**{k: v for k, v in step.items() if v}, **({"motion": motion} if motion else {})}


def _contact(
    scene: Scene, spec: ContactSpec, bodies: dict[str, sc.Body], made: dict[str, Made], way: Way
) -> sc.Contact:
    name, tag = spec.secondary
    secondary = bodies[name].surface(made[name].facets(tag), name=tag)
    if spec.primary is not None:
        other, tag = spec.primary
        primary = bodies[other].surface(made[other].facets(tag), name=tag)
    else:
        primary = obstacle(scene, spec)
    E = made[name].spec.E * scene.unit
    return sc.Contact(
        secondary,
        primary,
        friction=_law(spec, E, scene.unit),
        method=way.method or spec.method,
        sliding=spec.sliding,
        tied=spec.tied,
        interference=spec.interference * scene.size,
        name=spec.name,
    )


def obstacle(scene: Scene, spec: ContactSpec) -> Any:
    """The rigid obstacle of a contact."""
    kind, point, form = spec.obstacle
    if kind == "plane":
        return sc.RigidPlane(place(scene, point), turn(scene) @ np.array(form), name=spec.name)
    return sc.RigidCylinder(place(scene, point), form * scene.size, name=spec.name)


def _law(spec: ContactSpec, E: float, unit: float) -> sc.conditions.FrictionLaw | None:
    if spec.friction is None:
        return None
    G = {} if spec.G is None else {"stiffness": spec.G * E}
    if spec.friction[0] == "tresca":
        return sc.Tresca(spec.friction[1] * unit, **G)
    _, mu, cap, cohesion = spec.friction
    return sc.Coulomb(mu, tau_max=cap * unit, cohesion=cohesion * unit, **G)


# What is drawn


def scene(seed: int) -> Scene:
    """The scene of a number."""
    rng = np.random.default_rng([seed, 20])
    names = list(TEMPLATES)
    weights = np.array([TEMPLATES[n][1] for n in names], dtype=float)
    kind = str(rng.choice(names, p=weights / weights.sum()))
    drawn = TEMPLATES[kind][0](rng)
    straight = any(b.rollers for b in drawn.bodies)
    angle = float(rng.choice([0.0, 0.0, 0.5 * np.pi, rng.uniform(-np.pi, np.pi)]))
    if straight:
        angle = 0.0
    units = rng.random() < 0.3
    return replace(
        drawn,
        seed=seed,
        kind=kind,
        angle=angle,
        shift=(0.0, 0.0) if straight else tuple(rng.uniform(-3, 3, 2)),
        size=float(10 ** rng.uniform(-4, 4)) if units else 1.0,
        unit=float(10 ** rng.uniform(-4, 10)) if units else 1.0,
        placement=1e-6 if drawn.finite and rng.random() < 0.5 else None,
    )


def _log(rng: Any, low: float, high: float) -> float:
    return float(10 ** rng.uniform(np.log10(low), np.log10(high)))


def _material(rng: Any, count: int) -> list[tuple[float, float]]:
    """Moduli and Poisson ratios; the softest modulus is one."""
    spread = float(rng.choice([0.0, 1.0, 3.0, 6.0], p=[0.3, 0.3, 0.2, 0.2]))
    E = 10 ** (spread * rng.random(count))
    if spread and count > 1:
        E[rng.integers(count)] = 10**spread
    E = E / E.min()
    return [(float(e), float(rng.uniform(0.0, 0.45))) for e in E]


def _elements(rng: Any, count: int) -> list[str]:
    one = str(rng.choice(ANY, p=[0.2, 0.35, 0.15, 0.15, 0.15]))
    if rng.random() < 0.75:
        return [one] * count
    return [str(rng.choice(ANY)) for _ in range(count)]


def _count(rng: Any, element: str, low: int, high: int) -> int:
    return max(1, int(COUNTS[element] * rng.integers(low, high + 1)))


def _friction(rng: Any, pressure: float, contact: ContactSpec) -> ContactSpec:
    """A law of friction, or none, or glue, with numbers that matter beside a pressure."""
    draw = rng.random()
    if draw < 0.06:
        return replace(contact, tied=True, sliding="small", interference=0.0)
    if draw < 0.28:
        return contact
    G = float(rng.choice([1.0, 30.0])) if rng.random() < 0.25 else None
    if draw < 0.36:
        return replace(contact, friction=("tresca", pressure * _log(rng, 0.03, 1.0)), G=G)
    cap = pressure * _log(rng, 0.03, 1.0) if rng.random() < 0.2 else np.inf
    cohesion = pressure * _log(rng, 0.01, 0.3) if rng.random() < 0.2 else 0.0
    mu = float(rng.choice([0.05, 0.1, 0.2, 0.3, 0.5, 0.8]))
    return replace(contact, friction=("coulomb", mu, cap, cohesion), G=G)


def _grip(contact: ContactSpec) -> float:
    """About how much a contact holds along itself, over what presses it."""
    if contact.tied:
        return 1.0
    if contact.friction is None:
        return 0.0
    return contact.friction[1] if contact.friction[0] == "coulomb" else 0.3


def _steps(rng: Any, sideways: float, held: bool) -> tuple[tuple[float, float], ...]:
    """Load steps (a, b): press first, then push and turn back, sometimes lift."""
    count = int(rng.integers(2, 6))
    steps = []
    for k in range(count):
        a = 1.0 if rng.random() < 0.5 else float(rng.uniform(0.3, 1.3))
        if held and k and rng.random() < 0.08:
            a = -0.2 if rng.random() < 0.5 else 0.0
        b = sideways * float(rng.uniform(-1, 1))
        if k == 0 and rng.random() < 0.5:
            b = 0.0
        steps.append((a, b))
    return tuple(steps)


def _contact_settings(rng: Any, finite_share: float = 0.25) -> dict[str, Any]:
    return {
        "method": str(rng.choice(["mortar", "node"], p=[0.6, 0.4])),
        "sliding": "finite" if rng.random() < finite_share else "small",
    }


def _sides(rng: Any, one: tuple[str, str], two: tuple[str, str]) -> dict[str, Any]:
    pair = (one, two) if rng.random() < 0.5 else (two, one)
    return {"secondary": pair[0], "primary": pair[1]}


def _far(rng: Any, contacts: list[ContactSpec], facet: float, height: float) -> float:
    """Sideways displacement: part of a facet, or some of them where contacts slide far."""
    if any(c.sliding == "finite" for c in contacts):
        return facet * _log(rng, 0.1, 3.0)
    return min(facet * _log(rng, 0.01, 0.3), 0.03 * height)


def _driver(
    rng: Any,
    body: str,
    tag: str,
    contacts: list[ContactSpec],
    strain: float,
    height: float,
    facet: float,
    soft: float = 1.0,
) -> tuple[Drive, float, bool]:
    """A drive downwards and sideways on an edge, the share sideways, and whether it prescribes."""
    weakest = min(_grip(c) for c in contacts)
    if rng.random() < 0.5:
        side = _far(rng, contacts, facet, height) if rng.random() < 0.8 else 0.0
        return Drive("x", body, tag, (0.0, -strain * height), (side, 0.0)), 1.0, True
    push = strain * soft
    side = push * weakest * float(rng.choice([0.0, 0.5, 0.9, 1.2], p=[0.2, 0.4, 0.3, 0.1]))
    return Drive("f", body, tag, (0.0, -push), (side, 0.0)), 1.0, False


def _stack(rng: Any) -> Scene:
    """Two to four blocks on each other, interfaces level or inclined, gaps or not."""
    n = int(rng.choice([2, 3, 4], p=[0.5, 0.3, 0.2]))
    materials, elements = _material(rng, n), _elements(rng, n)
    matching = rng.random() < 0.3
    slopes = [0.0] * (n + 1)
    if rng.random() < 0.3:
        slopes[1:n] = rng.uniform(-0.15, 0.15, n - 1)
    heights = rng.uniform(0.4, 1.2, n)
    widths = np.full(n, 1.0) if matching else rng.uniform(0.6, 2.0, n)
    middles = np.zeros(n) if matching else rng.uniform(-0.2, 0.2, n)
    strain = _log(rng, 1e-5, 5e-3)
    gap = strain * float(rng.choice([0.0, 0.0, 0.5, -0.5]))
    y, bodies, contacts = 0.0, [], []
    nx = int(rng.integers(4, 17))
    for i in range(n):
        e, (E, nu) = elements[i], materials[i]
        columns = max(2, int(COUNTS[e] * nx)) if matching else _count(rng, e, 4, 18)
        counts = (columns, _count(rng, e, 3, 10))
        x0, x1 = middles[i] - widths[i] / 2, middles[i] + widths[i] / 2
        lower = Edge(y, float(slopes[i]))
        upper = Edge(y + heights[i], float(slopes[i + 1]))
        shape = Block(float(x0), float(x1), lower, upper, counts)
        clamped: tuple[str, ...] = ("bottom",) if i == 0 else ()
        if rng.random() < 0.08:
            clamped += (str(rng.choice(["left", "right"])),)
        bodies.append(BodySpec(f"body{i}", shape, e, E, nu, clamped))
        if i:
            sides = _sides(rng, (f"body{i - 1}", "top"), (f"body{i}", "bottom"))
            spec = ContactSpec(f"joint{i}", **sides, **_contact_settings(rng, 0.2))
            contacts.append(_friction(rng, strain, spec))
        y += float(heights[i]) + gap
    if rng.random() < 0.2:
        over = strain * float(rng.uniform(-1, 1))
        contacts = [replace(c, interference=0.0 if c.tied else over) for c in contacts]
    facet = float(min(w / b.shape.counts[0] for w, b in zip(widths, bodies, strict=True)))
    drive, side, held = _driver(rng, f"body{n - 1}", "top", contacts, strain, y, facet)
    steps = _steps(rng, side, held)
    return Scene(0, "", tuple(bodies), tuple(contacts), (drive,), steps)


def _pad(rng: Any) -> Scene:
    """A block with a round foot on a block, or the other way round."""
    (E1, nu1), (E2, nu2) = _material(rng, 2)
    e = _elements(rng, 2)
    radius, width, strain = _log(rng, 1.0, 20.0), 1.0, _log(rng, 1e-4, 3e-3)
    foot = Edge(0.0, 0.0, 0.5 / radius, 0.0)
    counts = (_count(rng, e[0], 6, 20), _count(rng, e[0], 4, 8))
    upper = Block(-width / 2, width / 2, foot, Edge(0.8), counts)
    counts = (_count(rng, e[1], 6, 24), _count(rng, e[1], 4, 8))
    bend = 0.0 if rng.random() < 0.6 else float(rng.uniform(-0.7, 0.7)) / (2 * radius)
    lower = Block(-0.75, 0.75, Edge(-0.8), Edge(0.0, 0.0, bend, 0.0), counts)
    curved = bool(rng.random() < 0.6)
    bodies = (
        BodySpec("block", lower, e[1], E2, nu2, ("bottom",), curved=curved),
        BodySpec("pad", upper, e[0], E1, nu1, (), curved=curved),
    )
    spec = ContactSpec(
        "foot", **_sides(rng, ("pad", "bottom"), ("block", "top")), **_contact_settings(rng)
    )
    spec = _friction(rng, strain, spec)
    facet = 1.0 / max(b.shape.counts[0] for b in bodies)
    drive, side, held = _driver(rng, "pad", "top", [spec], strain, 1.6, facet)
    return Scene(0, "", bodies, (spec,), (drive,), _steps(rng, side, held))


def _roller(rng: Any) -> Scene:
    """A disc between two blocks, or on one of them."""
    materials, e = _material(rng, 3), _elements(rng, 3)
    element = str(rng.choice(TRIANGLES))
    radius, strain = 0.5, _log(rng, 1e-4, 5e-3)
    around = 4 * _count(rng, element, 5, 10)
    disc = BodySpec("disc", Disc(radius, (4, around)), element, *materials[1])
    facet = 2 * np.pi * radius / around
    settings = _contact_settings(rng, 0.5)
    nx, ny = _count(rng, e[0], 8, 20), _count(rng, e[0], 3, 8)
    low = Block(-0.8, 0.8, Edge(-1.2), Edge(-radius), (nx, ny))
    bodies = [BodySpec("below", low, e[0], *materials[0], ("bottom",)), disc]
    spec = ContactSpec("below", **_sides(rng, ("disc", "lower"), ("below", "top")), **settings)
    contacts = [_friction(rng, strain, spec)]
    nx, ny = _count(rng, e[2], 8, 20), _count(rng, e[2], 3, 8)
    high = Block(-0.7, 0.7, Edge(radius), Edge(1.2), (nx, ny))
    bodies.append(BodySpec("above", high, e[2], *materials[2]))
    spec = ContactSpec("above", **_sides(rng, ("disc", "upper"), ("above", "bottom")), **settings)
    contacts.append(_friction(rng, strain, spec))
    height = 2.4
    side = facet * _log(rng, 0.1, 3.0) if settings["sliding"] == "finite" else 0.1 * facet
    drive = Drive("x", "above", "top", (0.0, -strain * height), (side, 0.0))
    return Scene(0, "", tuple(bodies), tuple(contacts), (drive,), _steps(rng, 1.0, True))


def _fit(rng: Any) -> Scene:
    """A shaft in a hub, pressed in or with clearance; whole rings or a quarter."""
    (E1, nu1), (E2, nu2) = _material(rng, 2)
    e = _elements(rng, 2)
    quarter = rng.random() < 0.5
    angles = (0.0, 0.5 * np.pi) if quarter else (0.0, 2 * np.pi)
    hole, middle, outer = 0.25, float(rng.uniform(0.5, 0.7)), 1.0
    strain = _log(rng, 1e-5, 3e-3)
    matching = rng.random() < 0.4
    n1 = _count(rng, e[0], 6, 16) * (1 if quarter else 4)
    n2 = n1 if matching else _count(rng, e[1], 6, 16) * (1 if quarter else 4)
    if quarter:
        n1, n2 = max(n1, 3), max(n2, 3)
    shaft = Ring(hole, middle, angles, (_count(rng, e[0], 3, 6), n1))
    hub = Ring(middle, outer, angles, (_count(rng, e[1], 3, 6), n2))
    rollers = (("start", 1), ("end", 0)) if quarter else ()
    curved = bool(quarter and rng.random() < 0.6)
    held: tuple[str, ...] = () if quarter else ("outer",)
    inner: tuple[str, ...] = () if quarter or rng.random() < 0.5 else ("inner",)
    bodies = [
        BodySpec("shaft", shaft, e[0], E1, nu1, inner, rollers, curved),
        BodySpec("hub", hub, e[1], E2, nu2, held, rollers, curved),
    ]
    over = strain if rng.random() < 0.7 else 0.0
    settings = _contact_settings(rng, 0.15)
    spec = ContactSpec(
        "fit", **_sides(rng, ("shaft", "outer"), ("hub", "inner")), **settings, interference=over
    )
    spec = _friction(rng, strain, spec)
    if spec.tied:
        spec = replace(spec, tied=False)
    p = strain if rng.random() < 0.7 or not over else 0.0
    # on the hole of the shaft: pushes it to the side, or a squeeze by a prescribed edge
    drives = ()
    if inner:
        side = strain * float(rng.uniform(0.1, 1.0))
        drives = (Drive("x", "shaft", "inner", (0.0, -side), (side, 0.0)),)
    elif quarter:
        drives = (Drive("f", "hub", "outer", (-p, -p), (0.3 * p, -0.3 * p)),)
    elif over or spec.friction is not None:
        drives = (Drive("f", "shaft", "inner", (0.0, -p), (0.2 * p, 0.0)),)
    return Scene(0, "", tuple(bodies), (spec,), drives, _steps(rng, 1.0, bool(quarter)))


def _polygon(rng: Any) -> Scene:
    """A convex polygon standing on one of its sides, on a block."""
    k = int(rng.integers(3, 8))
    corner = np.sort(rng.uniform(0, 2 * np.pi, k) * 0.4 + 2 * np.pi * np.arange(k) / k * 0.6)
    points = 0.5 * np.array([np.cos(corner), np.sin(corner)]).T
    base = points[1] - points[0]
    a = -np.arctan2(base[1], base[0])
    points = points @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
    points = points - points[0]  # side0 lies on the x axis, the polygon above it
    (E1, nu1), (E2, nu2) = _material(rng, 2)
    element, e = str(rng.choice(TRIANGLES)), _elements(rng, 1)[0]
    strain = _log(rng, 1e-5, 3e-3)
    corners = tuple((float(x), float(y)) for x, y in points)
    body = Polygon(corners, _count(rng, element, 4, 8))
    nx, ny = _count(rng, e, 6, 20), _count(rng, e, 3, 8)
    low = Block(-0.4, float(np.linalg.norm(base)) + 0.4, Edge(-0.6), Edge(0.0), (nx, ny))
    bodies = (
        BodySpec("block", low, e, E2, nu2, ("bottom",)),
        BodySpec("polygon", body, element, E1, nu1),
    )
    sides = _sides(rng, ("polygon", "side0"), ("block", "top"))
    spec = _friction(rng, strain, ContactSpec("foot", **sides, **_contact_settings(rng)))
    tag = f"side{int(rng.integers(1, k))}"
    facet = float(np.linalg.norm(base)) / body.count
    drive, side, held = _driver(rng, "polygon", tag, [spec], strain, 1.0, facet)
    return Scene(0, "", bodies, (spec,), (drive,), _steps(rng, side, held))


def _obstacle(rng: Any) -> Scene:
    """One or two blocks, the lower with a straight or round foot, on a rigid plane or cylinder."""
    two = rng.random() < 0.4
    materials, e = _material(rng, 2), _elements(rng, 2)
    strain = _log(rng, 1e-5, 3e-3)
    bend = float(rng.choice([0.0, _log(rng, 0.03, 0.5)]))
    counts = (_count(rng, e[0], 6, 20), _count(rng, e[0], 4, 8))
    shape = Block(-0.5, 0.5, Edge(0.0, 0.0, bend), Edge(0.7), counts)
    moved = rng.random() < 0.4
    top_held = () if two or not moved else ("top",)
    bodies = [BodySpec("block", shape, e[0], *materials[0], top_held, curved=bool(rng.random() < 0.5))]
    kind = ("plane", (0.0, 0.0), (0.0, 1.0))
    if rng.random() < 0.4:
        radius = _log(rng, 0.5, 20.0)
        kind = ("cylinder", (0.0, -radius), radius)
    settings = _contact_settings(rng, 0.4)
    spec = ContactSpec("floor", ("block", "bottom"), None, kind, **settings)
    contacts = [_friction(rng, strain, spec)]
    upper = "block"
    if two:
        counts = (_count(rng, e[1], 4, 16), _count(rng, e[1], 3, 6))
        shape = Block(-0.4, 0.45, Edge(0.7), Edge(1.3), counts)
        bodies.append(BodySpec("upper", shape, e[1], *materials[1], ("top",) if moved else ()))
        sides = _sides(rng, ("upper", "bottom"), ("block", "top"))
        spec = ContactSpec("joint", **sides, **_contact_settings(rng, 0.2))
        contacts.append(_friction(rng, strain, spec))
        upper = "upper"
    facet = 1.0 / bodies[0].shape.counts[0]
    if moved:
        side = _far(rng, contacts, facet, 1.0)
        drive = Drive("motion", "floor", "", (0.0, strain), (side, 0.0))
        return Scene(0, "", tuple(bodies), tuple(contacts), (drive,), _steps(rng, 1.0, True))
    drive, side, held = _driver(rng, upper, "top", contacts, strain, 1.0, facet)
    return Scene(0, "", tuple(bodies), tuple(contacts), (drive,), _steps(rng, side, held))


def _gripped(rng: Any) -> Scene:
    """Two blocks side by side on a common floor that grips both, pushed together."""
    (E1, nu1), (E2, nu2) = _material(rng, 2)
    e = _elements(rng, 2)
    strain = _log(rng, 1e-5, 3e-3)
    ny = [_count(rng, e[0], 4, 16), _count(rng, e[1], 4, 16)]
    if rng.random() < 0.3:
        ny[1] = ny[0]
    left = Block(-1.0, 0.0, Edge(0.0), Edge(1.0), (_count(rng, e[0], 4, 10), ny[0]))
    right = Block(0.0, 0.8, Edge(0.0), Edge(1.0), (_count(rng, e[1], 4, 10), ny[1]))
    both = rng.random() < 0.5
    bodies = (
        BodySpec("left", left, e[0], E1, nu1, ("bottom",)),
        BodySpec("right", right, e[1], E2, nu2, ("bottom", "top") if both else ("bottom",)),
    )
    sides = _sides(rng, ("left", "right"), ("right", "left"))
    over = strain * float(rng.choice([0.0, 1.0, 1.0]))
    spec = ContactSpec("seam", **sides, **_contact_settings(rng, 0.15), interference=over)
    spec = _friction(rng, strain, spec)
    if spec.tied:
        spec = replace(spec, interference=0.0)
    p = strain * float(rng.uniform(0.2, 2.0))
    drive = Drive("f", "left", "left", (p, 0.0), (0.0, 0.3 * p))
    return Scene(0, "", bodies, (spec,), (drive,), _steps(rng, 1.0, True))


def _bridge(rng: Any) -> Scene:
    """A beam across two blocks, loaded from above."""
    materials, e = _material(rng, 3), _elements(rng, 3)
    strain = _log(rng, 1e-5, 1e-3)
    h = float(rng.uniform(0.3, 0.6))
    spans = [(-1.0, -0.3), (0.3, 1.0)]
    bodies, contacts = [], []
    settings = _contact_settings(rng, 0.15)
    for i, (a, b) in enumerate(spans):
        counts = (_count(rng, e[i], 4, 12), _count(rng, e[i], 3, 8))
        shape = Block(a, b, Edge(-0.8), Edge(0.0), counts)
        bodies.append(BodySpec(f"pier{i}", shape, e[i], *materials[i], ("bottom",)))
    counts = (_count(rng, e[2], 12, 36), _count(rng, e[2], 3, 5))
    bodies.append(BodySpec("beam", Block(-1.0, 1.0, Edge(0.0), Edge(h), counts), e[2], *materials[2]))
    for i in range(2):
        spec = ContactSpec(f"seat{i}", (f"pier{i}", "top"), ("beam", "bottom"), **settings)
        contacts.append(_friction(rng, strain, spec))
    facet = min(0.7 / b.shape.counts[0] for b in bodies[:2])
    drive, side, held = _driver(rng, "beam", "top", contacts, strain, 1.0, facet)
    return Scene(0, "", tuple(bodies), tuple(contacts), (drive,), _steps(rng, side, held))


def _slot(rng: Any) -> Scene:
    """A block in a slot between two walls and on a floor: its corners are in two contacts."""
    materials, e = _material(rng, 4), _elements(rng, 4)
    strain = _log(rng, 1e-5, 2e-3)
    counts = [(_count(rng, e[i], 4, 8), _count(rng, e[i], 4, 10)) for i in range(4)]
    left = Block(-1.0, -0.5, Edge(0.0), Edge(1.0), counts[0])
    right = Block(0.5, 1.0, Edge(0.0), Edge(1.0), counts[1])
    floor = Block(-0.5, 0.5, Edge(-0.5), Edge(0.0), counts[2])
    key = Block(-0.5, 0.5, Edge(0.0), Edge(0.9), counts[3])
    bodies = (
        BodySpec("left", left, e[0], *materials[0], ("left",)),
        BodySpec("right", right, e[1], *materials[1], ("right",)),
        BodySpec("floor", floor, e[2], *materials[2], ("bottom",)),
        BodySpec("key", key, e[3], *materials[3]),
    )
    over = strain * float(rng.uniform(-0.5, 1.0))
    settings = _contact_settings(rng, 0.1)
    pairs = [
        (("key", "left"), ("left", "right"), over),
        (("key", "right"), ("right", "left"), over),
        (("key", "bottom"), ("floor", "top"), 0.0),
    ]
    contacts = []
    for i, (one, two, o) in enumerate(pairs):
        spec = ContactSpec(f"face{i}", **_sides(rng, one, two), **settings, interference=o)
        spec = _friction(rng, strain, spec)
        contacts.append(replace(spec, interference=0.0) if spec.tied else spec)
    facet = 1.0 / counts[3][0]
    drive, side, held = _driver(rng, "key", "top", contacts, strain, 0.5, facet)
    if drive.kind == "x":  # into the wall by no more than down
        drive = replace(drive, tangential=(0.3 * strain, 0.0))
    return Scene(0, "", bodies, tuple(contacts), (drive,), _steps(rng, side, held))


def _corner(rng: Any) -> Scene:
    """A disc pressed into a block and dragged or rolled towards its corner and over it."""
    (E1, nu1), (E2, nu2) = _material(rng, 2)
    element, e = str(rng.choice(TRIANGLES)), _elements(rng, 1)[0]
    around = 4 * _count(rng, element, 6, 10)
    disc = BodySpec("disc", Ring(0.2, 0.5, (0.0, 2 * np.pi), (3, around), (0.6, 0.5)), "Q1", E1, nu1)
    n = _count(rng, e, 6, 14)
    bodies = (
        BodySpec("block", Block(0.0, 1.0, Edge(-1.0), Edge(0.0), (n, n)), e, E2, nu2, ("bottom",)),
        disc,
    )
    settings = {**_contact_settings(rng), "sliding": "finite"}
    spec = ContactSpec("rim", **_sides(rng, ("disc", "outer"), ("block", "top+right")), **settings)
    mu = float(rng.choice([0.0, 0.1, 0.3]))
    if mu:
        spec = replace(spec, friction=("coulomb", mu, np.inf, 0.0))
    deep, way = float(rng.uniform(0.002, 0.01)), float(rng.uniform(0.2, 0.9))
    drive = Drive("x", "disc", "inner", (0.0, -deep), (way, 0.0))
    count = int(rng.integers(3, 6))
    steps = tuple((1.0, k / (count - 1)) for k in range(count))
    return Scene(0, "", bodies, (spec,), (drive,), steps)


TEMPLATES: dict[str, tuple[Callable[[Any], Scene], float]] = {
    "stack": (_stack, 0.3),
    "pad on block": (_pad, 0.13),
    "roller between blocks": (_roller, 0.06),
    "shaft in hub": (_fit, 0.12),
    "polygon on block": (_polygon, 0.08),
    "rigid obstacle": (_obstacle, 0.12),
    "gripped blocks": (_gripped, 0.08),
    "beam on piers": (_bridge, 0.05),
    "block in a slot": (_slot, 0.04),
    "over a corner": (_corner, 0.02),
}
__all__ = ["GIVEN", "Made", "Scene", "Way", "build", "make", "scene", "step_of"]
