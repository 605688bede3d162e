r"""Calibration: friction and Young's modulus from a measured fretting loop.

          Q <-->            a block is pressed onto a longer one, and its top moved to and fro by a
        _________           machine that measures the force Q: a loop with a stiffness and a width
       |  block  |
     __|_________|__
    |     base      |
    |_______________|

Two numbers are to be found from the loop: the coefficient of friction and the modulus of the block.
`solver.jacobian` gives the derivatives of all forces by both, exactly and without another history, and
SciPy's `least_squares` does the rest. The "measured" loop is one of this model, so that the answer is
known: both numbers come out to 1e-10, with half of the histories that difference quotients take, or
fewer.

From a start where everything sticks no force depends on friction. The Jacobian says so in words, and
there an optimiser would stop: the start has to slip.

Run ``python examples/fretting_calibration.py [folder]``: numbers, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from scipy.optimize import least_squares
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers: N, mm, MPa
E_base, nu = 210e3, 0.3
true = np.array([0.32, 1.15])  # friction, and the modulus of the block over that of the base
start = np.array([0.2, 0.9])
pressed, amplitude = 0.004, 0.002


# %% Bodies
def cuboid(width, low, high, n, nz):
    x, z = np.linspace(-width / 2, width / 2, n + 1), np.linspace(low, high, nz + 1)
    sides = {"bottom": lambda x: x[2] == low, "top": lambda x: x[2] == high}
    mesh = fem.MeshHex.init_tensor(x, x, z).with_boundaries(sides)
    return fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)


steel = linear_elasticity(*lame_parameters(E_base, nu))
base_basis, block_basis = cuboid(10, -4, 0, 8, 4), cuboid(4, 0, 3, 4, 3)
K_block = steel.assemble(block_basis)
base = sc.Body(base_basis, steel, D="bottom", name="base")
phase = np.linspace(0, 2.5 * np.pi, 31)
steps = [{"x": {"block": {"top": (amplitude * np.sin(a), 0.0, -pressed)}}} for a in phase]
histories = 0


def solver_of(parameters):
    """The model with these two numbers."""
    mu, stiffness = parameters
    block = sc.Body(block_basis, stiffness * K_block, D="top", name="block")
    contact = sc.Contact(
        block.surface("bottom"), base.surface("top"), friction=sc.Coulomb(mu), name="joint"
    )
    return sc.ContactSolver([base, block], [contact])


def loop(results):
    """The measured forces, and that the k-th is a component of the force of the k-th result."""
    Q = np.array([result.force[0] for result in results])
    return Q, [{k: {"force": (1.0, 0.0, 0.0)}} for k in range(len(Q))]


measured = loop(list(solver_of(true).history(steps)))[0]

# %% With derivatives: one history gives the forces and how they change
known: dict[bytes, sc.history.Jacobian] = {}


def at(parameters):
    global histories
    key = parameters.tobytes()
    if key not in known:
        histories += 1
        by = ["friction", sc.answers.Parameter("stiffness", of="block")]
        known[key] = solver_of(parameters).jacobian(loop, steps, by=by)
    return known[key]


def residual(parameters):
    return at(parameters).values / measured.max() - measured / measured.max()


def jacobian(parameters):
    # the parameter is a factor on the stiffness as it is: over it, for one on that of the base
    return at(parameters).matrix / measured.max() / (1.0, parameters[1])


goal = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14, "x_scale": (0.1, 1.0)}
found = least_squares(residual, start, jac=jacobian, **goal)
with_derivatives = histories

# %% With difference quotients, for comparison
histories = 0


def by_differences(parameters):
    global histories
    histories += 1
    return (
        loop(list(solver_of(parameters).history(steps)))[0] / measured.max() - measured / measured.max()
    )


quotients = least_squares(by_differences, start, **goal)

error, tolerance = np.max(np.abs(found.x / true - 1)), 1e-10
print(f"friction {found.x[0]:.12f}, stiffness {found.x[1]:.12f}: off by {error:.1e}")
print(f"histories: {with_derivatives} with derivatives, {histories} with difference quotients")
error = max(error, 0.0 if 2 * with_derivatives <= histories else 1.0)

# %% A start that sticks
stuck = solver_of((5.0, 1.0)).jacobian(loop, steps, by=["friction", "stiffness"])
print(f"from a start where everything sticks: rank {stuck.rank}. {stuck.words}")
assert stuck.rank == 1

# %% Picture: the loop that is measured, of the start, and found
figure = plt.figure(figsize=(9, 3.8), layout="constrained")
solid, ax = figure.subplots(1, 2)
*_, aside = solver_of(true).history(steps[:7])
sc.plot_deformed(aside, 300, ax=solid, units={"length": "mm"})
moved = 1e3 * amplitude * np.sin(phase)
ax.plot(moved, measured, "ko", ms=4, label="measured")
ax.plot(moved, at(start).values, color="#999999", label="start")
ax.plot(moved, at(found.x).values, color="#20618d", label="found")
ax.set(xlabel="displacement of the top [µm]", ylabel="force [N]")
ax.legend(frameon=False)
ax.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "fretting_calibration.png", dpi=90)
