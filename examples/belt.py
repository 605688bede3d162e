r"""A belt around a pulley: the capstan formula, and how slip creeps in from the tight end.

              ____
            /      \          belt of thickness R/50 and width R on a rigid drum, half around,
           |  drum  |         Coulomb friction 0.3; tension 1 on the slack side
           |        |
           |        |         the tight side is pulled by a stiff spring until the whole belt
     1     v        v   T     slips

Hung over the drum, the belt has slipped a little towards both sides, and its tension is least in
between. Pulled on one side, slip creeps in from there; the tension of what slips grows with the angle
as exp(lambda phi), a little slower than Euler's exp(mu phi), because
friction acts on the face of the belt and tension in its middle. When all of it slips the ratio of the
tensions agrees with the formula for thick belts within 0.1 %.

Run ``python examples/belt.py [folder]``: the ratio, and a picture of the tension along the belt.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from scipy.sparse import csr_matrix
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import capstan_ratio

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers (lengths over the radius of the drum)
mu, wrap, thickness, E = 0.3, np.pi, 0.02, 1e5

# %% The belt: a strip of elements bent around the drum
along, through = np.linspace(0, wrap, 151), np.linspace(1, 1 + thickness, 3)
strip = fem.MeshHex.init_tensor(along, through, [0.0, 0.5, 1.0])
ends = {
    "slack": strip.facets_satisfying(lambda x: x[0] < 1e-9),
    "tight": strip.facets_satisfying(lambda x: x[0] > wrap - 1e-9),
    "inside": strip.facets_satisfying(lambda x: x[1] < 1 + 1e-9),
}
angle, radius, across = strip.p
bent = fem.MeshHex(np.array([radius * np.cos(angle), radius * np.sin(angle), across]), strip.t)
basis = fem.Basis(bent.with_boundaries(ends), fem.ElementVector(fem.ElementHex1()), intorder=4)

# both ends hang straight down
down = fem.LinearForm(lambda v, w: -v[1] / thickness)
slack, tight = (down.assemble(basis.boundary(end)) for end in ("slack", "tight"))

sides = basis.nodal_dofs[2]  # the belt does not move along the axis of the drum

# a stiff spring at the tight end, whose other end is moved: so the tension there is an answer
spring = 0.1 * E
column = csr_matrix(tight[:, None])
elastic = linear_elasticity(*lame_parameters(E, 0.0)).assemble(basis)
belt = sc.Body(basis, csr_matrix(elastic + spring * (column @ column.T)), f=slack, D=sides, name="belt")

# %% Contact with the drum; the chords of the mesh touch it
drum = sc.RigidCylinder((0, 0, 0), 1.0, (0, 0, 1), name="drum")
contact = sc.Contact(belt.surface("inside"), drum, friction=sc.Coulomb(mu), adjust=1e-3)
solver = sc.ContactSolver([belt], [contact])
print(solver)

# %% Pull
pulled = np.linspace(50, 300, 16) / E
results = list(solver.history({"f": {"belt": slack + spring * d * tight}} for d in pulled))
print(results[-1].report())


def tension(result):
    """Angles and tension along the belt: moments about the axis of the drum."""
    points, force = result.points, result.traction * result.area[:, None]
    friction = (points[:, 0] * force[:, 1] - points[:, 1] * force[:, 0]) / np.hypot(*points[:, :2].T)
    place = np.arctan2(points[:, 1], points[:, 0])
    order = np.argsort(place)
    # friction acts at the radius one, tension at the middle of the belt
    grown = -np.cumsum(friction[order]) / (1 + thickness / 2)
    return place[order], 1 + grown


pull = np.array([spring * (d - tight @ r.u) for d, r in zip(pulled, results, strict=True)])
ratio, expected = pull[-1], capstan_ratio(mu, wrap, thickness)
error, tolerance = abs(ratio / expected - 1), 1e-3
print(f"ratio of the tensions {ratio:.5f}; thick belt {expected:.5f}, thin {np.exp(mu * wrap):.5f}")

# %% Picture: the belt on the drum, half of it slipping, and the tensions (lengths over R)


def hoop(body, u):
    """The stress along the belt, over that of the slack end."""
    x = body.basis.with_element(fem.ElementHex1()).doflocs[:2]
    direction = np.array([-x[1], x[0]]) / np.hypot(*x)
    stress = sc.nodal_stress(body, u, E=E, nu=0.0)[:, :2, :2]
    return thickness * np.einsum("im,mij,jm->m", direction, stress, direction)


figure = plt.figure(figsize=(13.5, 4.6), layout="constrained")
scene, places, history = figure.subplots(1, 3)
half = 5
sc.plot_deformed(
    results[half],
    scale=20,
    stress=hoop,
    ax=scene,
    obstacles=False,
    viewer=(1, 0.8, 2),
    up=(0, 1, 0),
    label="tension / that of the slack end",
    units={"stress": "T₀/R"},
)
scene.set_title("the belt, magnified 20 times")
shown = [k for k in (1, 3, 5, 7) if pull[k] < 0.99 * ratio] + [len(results) - 1]
for k, shade in zip(shown, plt.cm.viridis(np.linspace(0.9, 0.1, len(shown))), strict=True):
    place, T = tension(results[k])
    places.plot(np.degrees(place), T, color=shade, label=f"pulled with {pull[k]:.2f}")
phi = np.linspace(0, wrap, 100)
formula = [capstan_ratio(mu, p, thickness) for p in phi]
places.plot(np.degrees(phi), formula, "k:", lw=2, label="formula for thick belts")
places.set(xlabel="angle from the slack end [degrees]", ylabel="tension over that of the slack end")
places.legend(frameon=False)
history.plot(1e3 * pulled, pull, "o-", ms=3, color="#20618d", label="finite elements")
history.axhline(expected, color="k", ls=":", label="formula for thick belts")
history.axhline(np.exp(mu * wrap), color="gray", ls="--", lw=1, label="Euler, exp(μφ)")
history.set(
    xlabel="motion of the end of the spring [R / 1000]",
    ylabel="tension of the tight end over that of the slack end",
    ylim=(0, None),
)
history.legend(frameon=False, loc="lower right")
for axes in (places, history):
    axes.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "belt.png", dpi=90)

# %% Check what the first lines say
assert error < tolerance
