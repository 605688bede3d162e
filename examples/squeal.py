r"""Squeal: a brake pad on a sliding belt vibrates by itself above some coefficient of friction.

       held, moved along
      __________________
     |                  |
     |       pad        |         the belt is rigid, and slides on steadily
     |__________________|
    ------------------------  -->

All points slide on, and in a vibration their friction follows the pressure: the equations of motion
are not symmetric, and two modes may meet. Up to there all modes only oscillate; beyond it, one of the
two grows and the other fades. The coefficient at which they meet is found twice: by bisection, as the
first at which a mode grows, and from below: the squared difference of the two eigenvalues is a smooth
function of the coefficient, which is zero there. Both agree to 1e-5.

Run ``python examples/squeal.py [folder]``: a table, and a picture.
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
mesh = fem.MeshQuad.init_tensor(np.linspace(0, 20, 25), np.linspace(0, 10, 13)).with_defaults()
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
pad = sc.Body(basis, steel, D="top", x={"top": (moved, -pressed)}, name="pad")
belt = sc.RigidPlane((0, 0), (0, 1), name="belt")
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
coefficients, table = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3), []
for mu in coefficients:
    found = modes(mu)
    table.append(found)
    print(f"{mu:5.2f}  " + " ".join(f"{f / 1e3:7.2f}" for f in found.frequency[:5]), end="")
    print(f"  {found.growth.max():9.0f}")

# %% Where they meet: the first coefficient at which a mode grows
low, high = 0.2, 0.3
while high - low > 1e-7:
    middle = 0.5 * (low + high)
    grows = modes(middle).growth[pair].max() > 0
    low, high = (low, middle) if grows else (middle, high)

# %% The same from below, where nothing grows
below = np.linspace(0.19, low - 0.005, 6)
squares = np.array([(2 * np.pi * modes(mu).frequency[pair]) ** 2 for mu in below])
apart = np.diff(squares, axis=1)[:, 0] ** 2
by_mu = np.polynomial.Polynomial.fit(below, apart, 4)
roots = by_mu.roots()
meet = float(min(roots[np.abs(roots.imag) < 1e-9].real, key=lambda mu: abs(mu - low)))

error, tolerance = abs(meet - low) / low, 1e-5
print(f"squeal from mu = {low:.6f} on; the modes meet at {meet:.6f}: off by {error:.1e}")

# %% Picture: the two modes, which meet and then share a frequency
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
known = {mu: found.frequency[pair] for mu, found in zip(coefficients, table, strict=True)}
known |= {mu: np.sqrt(both) / (2 * np.pi) for mu, both in zip(below, squares, strict=True)}
known[high] = modes(high).frequency[pair]
mu = np.array(sorted(known))
left.plot(mu, np.array([known[k] for k in mu]) / 1e3, "o-", ms=3.5)
left.set(xlabel="coefficient of friction", ylabel="frequency of two modes [kHz]")
grow = [found.growth[pair].max() / 1e3 for found in table]
right.plot(coefficients, grow, "o", color="#c1440e")
right.set(xlabel="coefficient of friction", ylabel="growth of a vibration [1/ms]")
for ax in (left, right):
    ax.axvline(meet, color="k", lw=0.8, ls=":")
    ax.spines[["top", "right"]].set_visible(False)
right.text(meet, 0.9 * max(grow), "squeal ", ha="left")
figure.savefig(out / "squeal.png", dpi=90)
