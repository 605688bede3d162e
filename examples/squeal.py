r"""Squeal: a brake pad on a sliding belt vibrates by itself above some coefficient of friction.

       held, moved along
      __________________
     |                  |
     |       pad        |         20 x 8 x 10 mm, of which half is meshed: modes that are
     |                  |         alike on both sides of its middle plane;
     |__________________|         the belt is rigid, and slides on steadily
    ------------------------  -->

All points slide on, and in a vibration their friction follows the pressure: the equations of motion
are not symmetric, and two modes may meet. Up to there all modes only oscillate; beyond it, one of the
two grows and the other fades. The coefficient at which they meet is found twice: by bisection, as the
first at which a mode grows, and from below: the squared difference of the two eigenvalues is a smooth
function of the coefficient, which is zero there. Both agree to 1e-5.

Run ``python examples/squeal.py [folder]``: a table, and a picture of how the two modes lock in.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers: N, mm, MPa, tonnes, so that frequencies are in Hz
steel = sc.Elastic(210e3, 0.3, density=7.85e-9)
pressed, moved = 0.02, 0.4  # the way of the pad's back: so far that all points slide
pair = slice(3, 5)  # the modes that meet, counted from zero

# %% The pad
x, y, z = np.linspace(0, 20, 13), np.linspace(0, 4, 3), np.linspace(0, 10, 7)
sides = {"bottom": lambda x: x[2] == 0, "top": lambda x: x[2] == 10, "cut": lambda x: x[1] == 0}
mesh = fem.MeshHex.init_tensor(x, y, z).with_boundaries(sides)
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
pad = sc.Body(basis, steel, D=["top", {"cut": "y"}], x={"top": (moved, 0.0, -pressed)}, name="pad")
belt = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="belt")
lining = sc.Contact(pad.surface("bottom"), belt, friction=sc.Coulomb(0.1), name="lining")
smooth = sc.ContactSolver(pad, lining)


def modes(mu):
    """The lowest modes while the pad slides on."""
    solver = smooth.with_friction(sc.Coulomb(mu))
    result = solver.solve()
    assert np.all(result.status == 2), "all points press and slide"
    return solver.modes(result, 6, slipping="steady")


# %% Frequencies over friction
print("  mu   frequencies [kHz]                       growth [1/s]")
for mu in (0.05, 0.15, 0.2, 0.25, 0.3):
    found = modes(mu)
    print(f"{mu:5.2f}  " + " ".join(f"{f / 1e3:7.2f}" for f in found.frequency[:5]), end="")
    print(f"  {found.growth.max():9.0f}")

# %% Lock-in over friction
mus = np.linspace(0.02, 0.3, 29)
swept = [modes(mu) for mu in mus]
figure, axes = plt.subplot_mosaic("SA;SB", figsize=(10, 4.6), layout="constrained")
result = smooth.with_friction(sc.Coulomb(mus[-1])).solve()
shape = swept[-1].shapes[pair][0].real
sc.plot_deformed(result, scale=1.0, u=2 * shape / np.abs(shape).max(), ax=axes["S"], obstacles=False)
axes["S"].set_title("the mode that grows, half of the pad")
above, below_it = axes["A"], axes["B"]
above.sharex(below_it)
above.plot(mus, np.array([m.frequency[pair] for m in swept]) / 1e3, "o-", ms=3, color="#20618d")
above.set(ylabel="frequency [kHz]", title="two modes of a pad that slides on")
below_it.plot(mus, np.array([m.growth[pair] for m in swept]) / 1e3, "o-", ms=3, color="#b5441c")
below_it.set(xlabel="coefficient of friction", ylabel="growth [1/ms]")
for ax in (above, below_it):
    ax.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "squeal.png", dpi=80)
plt.close(figure)

# %% Where they meet: the first coefficient at which a mode grows
low, high = 0.1, 0.3
while high - low > 1e-7:
    middle = 0.5 * (low + high)
    grows = modes(middle).growth[pair].max() > 0
    low, high = (low, middle) if grows else (middle, high)

# %% The same from below, where nothing grows
below = np.linspace(low - 0.03, low - 0.005, 6)
squares = np.array([(2 * np.pi * modes(mu).frequency[pair]) ** 2 for mu in below])
apart = np.diff(squares, axis=1)[:, 0] ** 2
by_mu = np.polynomial.Polynomial.fit(below, apart, 4)
roots = by_mu.roots()
meet = float(min(roots[np.abs(roots.imag) < 1e-9].real, key=lambda mu: abs(mu - low)))

error, tolerance = abs(meet - low) / low, 1e-5
print(f"squeal from mu = {low:.6f} on; the modes meet at {meet:.6f}: off by {error:.1e}")
