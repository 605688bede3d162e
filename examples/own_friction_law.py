r"""A friction law of one's own: a coefficient that falls while the surfaces slip.

        ______________
       |              |--> U         mu
       |    block     |          0.6 |\
       |              |              | \
       |______________|          0.3 |  \_______
    ///////////////////////          |___________ slip
          rigid                         5 micrometres

The block is pressed down evenly and its top is then moved sideways. Nothing depends on x, so that a
hand solution follows from the balance G (U - slip) / H = mu(slip) p. There are two kinds of it: if
the block is stiff, friction falls gradually; if it is soft, its shear lets go faster than friction
falls, and the slip jumps, as in stick-slip. Both blocks follow the hand solution in every step and
at every point, to eight digits.

Run ``python examples/own_friction_law.py [folder]``: report and a picture.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"


# %% The law: all it takes is limit(...)
@dataclass(frozen=True, eq=False)
class Weakening(sc.conditions.FrictionLaw):
    """From `rest` at no slip straight down to `sliding` at a slip of `length`."""

    rest: float = 0.6
    sliding: float = 0.3
    length: float = 5e-3

    def limit(self, normal_force, area, slip):
        drop = np.minimum(np.linalg.norm(slip, axis=1) / self.length, 1.0)
        return (self.rest - (self.rest - self.sliding) * drop) * normal_force


law = Weakening()

# %% Numbers (N, mm, MPa); nu = 0, so that pressing and shearing do not mix
H, p = 10.0, 10.0
blocks = {"stiff": 20e3, "soft": 2e3}  # shear moduli G


# %% The solution by hand
def by_hand(G, U):
    """Slip and shear stress when the top has moved by `U`."""
    spring, fall = G / H, p * (law.rest - law.sliding) / law.length
    if spring * U <= law.rest * p:
        return 0.0, spring * U
    slip = (spring * U - law.rest * p) / (spring - fall)
    if fall > spring or slip > law.length:  # it jumps, or friction has fallen to its end
        slip = U - law.sliding * p / spring
    return slip, spring * (U - slip)


# %% Body, contact, history
def shear(name, G, U):
    """Results of moving the top of a block by the steps `U`."""
    x, y = np.linspace(0, 2 * H, 13), np.linspace(0, H, 7)
    mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    top = basis.get_dofs("top")
    block = sc.Body(basis, linear_elasticity(0.0, G), D=top, name=name)
    contact = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=law)
    solver = sc.ContactSolver([block], [contact])

    # in uniform shear the sides carry it too
    sides = fem.FacetBasis(mesh, basis.elem, facets=["left", "right"])
    load = fem.LinearForm(lambda v, w: w.n[0] * v[1]).assemble(sides)
    steps = []
    for move in U:
        u = np.zeros(basis.N)
        u[top.all("u^1")], u[top.all("u^2")] = move, -p * H / (2 * G)
        steps.append({"x": {name: u}, "f": {name: by_hand(G, move)[1] * load}})
    return list(solver.history(steps))


# %% Solve, check, plot
figure, axes = plt.subplots(
    2, 2, figsize=(11, 6), sharex="col", sharey="row", height_ratios=[1.6, 1], layout="constrained"
)
error, tolerance = 0.0, 1e-8
for (above, below), (name, G) in zip(axes.T, blocks.items(), strict=True):
    onset = law.rest * p * H / G  # the motion at which slip begins
    U = np.linspace(0, 2.5, 43)
    U = onset * U[1:]
    results = shear(name, G, U)
    slip = -np.array([result.slip[:, 0] for result in results])
    stress = -np.array([result.traction[:, 0] for result in results])
    hand_slip, hand_stress = np.array([by_hand(G, move) for move in U]).T
    off = np.abs(stress.T - hand_stress).max() / (law.rest * p)
    off = max(off, np.abs(slip.T - hand_slip).max() / onset)
    error = max(error, off)
    print(f"{name} block: slip and shear stress differ by {off:.1e} from those by hand")

    fine = np.linspace(0, U[-1], 2001)
    hand = np.array([by_hand(G, move) for move in fine]).T
    for ax, line, dots in (
        (above, hand[1] / p, stress[:, 0] / p),
        (below, 1e3 * hand[0], 1e3 * slip[:, 0]),
    ):
        ax.plot(1e3 * fine, line, color="#b5441c", lw=1.4, label="by hand")
        ax.plot(1e3 * U, dots, ".", ms=7, color="#20618d", label="finite elements")
        ax.spines[["top", "right"]].set_visible(False)
    above.set_title(f"{name}: G/H = {G / H:g} MPa/mm")
    above.axhline(law.rest, color="#999999", lw=0.7, ls=(0, (4, 2)))
    above.axhline(law.sliding, color="#999999", lw=0.7, ls=(0, (4, 2)))
    below.axhline(1e3 * law.length, color="#999999", lw=0.7, ls=(0, (4, 2)))
    below.set_xlabel("motion of the top [µm]")
axes[0, 0].set(ylabel="shear stress / pressure", ylim=(0, None))
axes[1, 0].set(ylabel="slip [µm]")
axes[0, 0].legend(frameon=False)
out.mkdir(parents=True, exist_ok=True)
figure.savefig(out / "own_friction_law.png", dpi=90)
