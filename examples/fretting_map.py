r"""A fretting map: the energy that friction takes per cycle, for many coefficients and amplitudes.

          |  |  | pressed by P, pushed to and fro between -Q and Q
       ___v__v__v___
      |    <-->     |     two alike elastic blocks; a cylinder's profile x^2 / 2R between them,
      |____________-|     plane strain, half width of contact about 1
      |-            |
      |_____________|     for every (mu, Q) a full cycle, Q -> -Q -> Q, in 20 load steps
       o  o  o  o  o

Below Q = mu P the contact sticks in the middle and slips at its edges. For half planes the energy
lost per cycle is W = 4/pi (mu P)^2 / E* [x - x^2/2 + (1 - x) ln(1 - x)], x = Q / (mu P). The bodies are
condensed once, for all coefficients of friction and all loads. Every point of the map is within
2 % of the closed form.

Run ``python examples/fretting_map.py [folder] [--full]``: 6 x 6 points, or 40 x 40 on 100 000 DOFs.
"""

import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import (
    block_curvature,
    effective_modulus,
    fretting_dissipation_line,
    hertz_line,
)

full = "--full" in sys.argv
folders = [word for word in sys.argv[1:] if not word.startswith("-")]
out = Path(folders[0]) if folders else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers
E, nu, radius, depth, width = 1.0, 0.3, 100.0, 20.0, 40.0
h, growth, points, steps = (1 / 41, 1.1, 40, 10) if full else (1 / 24, 1.2, 6, 10)

# %% Two blocks, fine where they touch, on guided bases
ratios = np.arange(1, int(np.log1p((width - 1.5) * (growth - 1) / h) / np.log(growth)) + 2)
grown = 1.5 + np.cumsum(h * growth**ratios)
grid = np.concatenate([np.arange(0, 1.5 + h / 2, h), grown])
x, y = grid / grid[-1] * width, grid[grid < depth]
x = np.concatenate([-x[:0:-1], x])
y = y / y[-1] * depth


def block(name, y, base):
    mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    held = basis.get_dofs(base).all("u^2")
    if name == "lower":  # and sideways at one node; friction holds the upper block
        held = np.append(held, basis.get_dofs(base).all("u^1")[len(x) // 2])
    stiffness = linear_elasticity(*lame_parameters(E, nu))
    f = fem.LinearForm(lambda v, w: v[0] / (2 * width)).assemble(basis.boundary(base))
    return sc.Body(basis, stiffness, D=held, name=name), f if name == "upper" else -f


upper, push_up = block("upper", y, "top")
lower, push_low = block("lower", -y[::-1], "bottom")

# %% Press once
contact = sc.Contact(
    upper.surface("bottom"),
    lower.surface("top"),
    friction=sc.Coulomb(1.0),
    gap=lambda x: x[0] ** 2 / (2 * radius),
)
solver = sc.ContactSolver([upper, lower], [contact])
E_star = effective_modulus(E, nu, E, nu)
down = np.where(np.isin(np.arange(upper.n), upper.D), -np.log(2 * depth) / (2 * radius), 0.0)
pressed = solver.solve(x={"upper": down})
P = pressed.normal_force.sum()
curvature = 2 * block_curvature(P, depth, E, nu, base="roller", width=width / depth)
hertz = hertz_line(P, radius, E_star, added_curvature=curvature)

# %% Every coefficient, every amplitude: a cycle
coefficients, shares = np.linspace(0.1, 1.0, points), np.linspace(0.3, 0.95, points)
cycle = np.concatenate([[1.0], np.linspace(1, -1, steps + 1)[1:], np.linspace(-1, 1, steps + 1)[1:]])
lost, exact = np.zeros((points, points)), np.zeros((points, points))
begin = time.process_time()
for i, mu in enumerate(coefficients):
    twin = solver.with_friction(sc.Coulomb(mu))
    for j, share in enumerate(shares):
        Q = share * mu * P
        pushes = (
            {"x": {"upper": down}, "f": {"upper": q * push_up, "lower": q * push_low}}
            for q in Q * cycle
        )
        first, *rest = twin.history(pushes, start=pressed)
        lost[i, j] = sum(result.dissipation for result in rest)
        exact[i, j] = fretting_dissipation_line(hertz, mu, Q)
seconds = time.process_time() - begin

# %% Check: the closed form
error = np.abs(lost / exact - 1).max()
tolerance = 0.02
increments = points**2 * len(cycle)
print(f"{points**2} cycles, {increments} load steps on {solver.system.n} DOFs: {seconds:.1f} s")
print(f"the energy lost differs from the closed form by at most {100 * error:.2f} %")
assert error <= tolerance

# %% Picture
figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
Q_over_P = coefficients[:, None] * shares
mu_grid = np.broadcast_to(coefficients[:, None], lost.shape)
size = np.log10(lost * E_star / P**2)
filled = axes[0].pcolormesh(mu_grid, Q_over_P, size, shading="gouraud")
axes[0].contour(mu_grid, Q_over_P, size, 8, colors="white", linewidths=0.6, linestyles="solid")
axes[0].plot([0, 1], [0, 1], color="black", lw=1)
axes[0].text(0.28, 0.6, "gross sliding, Q > μP", rotation=0, ha="center")
axes[0].text(0.75, 0.08, "nearly all sticks", ha="center")
axes[0].set(xlim=(0, 1), ylim=(0, 1), xlabel="coefficient of friction μ", ylabel="amplitude Q / P")
figure.colorbar(filled, ax=axes[0], label="log₁₀ of energy lost per cycle, W E* / P²")
fine = np.linspace(0.02, 0.999, 200)
curve = [fretting_dissipation_line(hertz, 1.0, s * P) * E_star / P**2 for s in fine]
axes[1].semilogy(fine, curve, color="#20618d", label="closed form")
scaled = lost * E_star / (coefficients[:, None] * P) ** 2
axes[1].plot(np.broadcast_to(shares, lost.shape).ravel(), scaled.ravel(), "k.", ms=3, label="computed")
axes[1].set(xlabel="Q / (μP)", ylabel="W E* / (μP)²", ylim=(1e-4, 1))
axes[1].spines[["top", "right"]].set_visible(False)
axes[1].legend(frameon=False)
figure.savefig(out / "fretting_map.png", dpi=90)
