r"""Partial slip: a Hertz contact pushed to and fro, the traction it remembers and the energy it loses.

         o  o  o  o  o  o
        |_______________|  --> Q       pressed down first, then kept there
        |    body       |
        |_____     _____|
         _____)2a=2(_____              two equal bodies, 20 half widths deep, guided along
        |               |              their bases; the profile x²/2R is given as initial gap;
        |    body       |              Coulomb friction 0.4; plane strain
    Q <-|_______________|
         o  o  o  o  o  o

Q goes to 70 % of the sliding force, back to -70 %, and up again. Slip eats into the contact from its
edges (Cattaneo 1938, Mindlin 1949); after a reversal it starts anew from there, so that traction
depends on the way taken and each cycle loses energy. Before the first turn, at the turns and half
way between them the traction is within 3 % of the theory in the mean square, and so is the energy
lost per cycle.

Run ``python examples/cattaneo_mindlin.py [folder]``: report, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import (
    block_curvature,
    cattaneo_mindlin,
    effective_modulus,
    fretting_dissipation_line,
    hertz_line,
)

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers (any units; the contact becomes about 1 wide to either side)
E, nu, mu = 1.0, 0.3, 0.4
R, H, W = 100.0, 20.0, 40.0
h = 1 / 24.5
down = 0.0188
amplitude = 0.7  # largest Q over the force of full sliding


# %% Bodies: one fine grid around the middle for both, so that node meets node
def graded(end, fine=1.3, ratio=1.15):
    """Coordinates from 0 to `end`: steps `h` up to `fine`, growing beyond."""
    count = int(np.log1p((end - fine) * (ratio - 1) / (h * ratio)) / np.log(ratio))
    growing = np.cumsum(ratio ** np.arange(1, count + 1))
    even = h * np.arange(round(fine / h) + 1)
    return np.concatenate([even, even[-1] + (end - even[-1]) * growing / growing[-1]])


x, y = graded(W), graded(H)
x = np.append(-x[:0:-1], x)


def body(name, y, base, down):
    """A body on guides: its base keeps its height and is pushed by a uniform unit of shear."""
    mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    guided = basis.get_dofs(base).all("u^2")
    if name == "lower":  # one node against sideways motion; the upper body is left to friction
        middle = mesh.nodes_satisfying(lambda p: (p[0] == 0) & (p[1] == -H))
        guided = np.append(guided, basis.nodal_dofs[0, middle])
    lowered = np.zeros(basis.N)
    lowered[basis.get_dofs(base).all("u^2")] = -down
    facets = fem.FacetBasis(mesh, basis.elem, facets=base)
    push = fem.LinearForm(lambda v, w: v[0] / (2 * W)).assemble(facets)
    stiffness = linear_elasticity(*lame_parameters(E, nu))
    return sc.Body(basis, stiffness, D=guided, x=lowered, name=name), push


upper, push_upper = body("upper", y, "top", down)
lower, push_lower = body("lower", -y[::-1], "bottom", 0.0)

# %% Contact
contact = sc.Contact(
    upper.surface("bottom"),
    lower.surface("top"),
    friction=sc.Coulomb(mu),
    gap=lambda x: x[0] ** 2 / (2 * R),
)
solver = sc.ContactSolver([upper, lower], [contact])

# %% Press, then push: up to the largest Q, and two cycles
pressed = solver.solve()
P = pressed.force[1]
Q0 = amplitude * mu * P
n = 24  # steps from one turn to the next
up = np.linspace(-Q0, Q0, n + 1)[1:]
Q = np.concatenate([[0], up[n // 2 :], -up, up, -up, up])
steps = [{"f": {"upper": q * push_upper, "lower": -q * push_lower}} for q in Q]
results = list(solver.history(steps, start=pressed))
print("At the end of the history:", results[-1], sep="\n")

# %% Check: tractions, and the energy lost per cycle
added = 2 * block_curvature(P, H, E, nu, base="roller", width=W / H)
hertz = hertz_line(P, R, effective_modulus(E, nu, E, nu), added_curvature=added)
turn = n // 2 + n * np.arange(5)  # the steps at which Q turns


def exact_traction(i):
    """Theory for step `i`: the first push, or a branch that began at the turn before."""
    before = Q[turn[turn < i]][-1:]
    return cattaneo_mindlin(hertz, mu, Q[i], after=tuple(before)).traction(x)


x = pressed.points[:, 0]
errors = []
for i in [n // 4, n // 2, n, 3 * n // 2, 2 * n]:
    difference = pressed.integrate((results[i].traction[:, 0] + exact_traction(i)) ** 2)
    errors.append(np.sqrt(difference / pressed.integrate(exact_traction(n // 2) ** 2)))
    print(f"Q = {Q[i] / (mu * P) + 0.0:5.2f} mu P: traction differs from theory by {errors[-1]:.2%}")

total = np.array([result.dissipation_total for result in results])
first, second = np.diff(total[turn[::2]])
exact_loss = fretting_dissipation_line(hertz, mu, Q0)
errors.append(abs(second / exact_loss - 1))
error, tolerance = max(errors), 0.03

# how far the bodies shift, as the work of Q sees it: its loop has the area of the energy lost
solver.recover(results)  # all displacements in one go
shift = np.array(
    [push_upper @ r.displacement(upper) - push_lower @ r.displacement(lower) for r in results]
)
cycle = slice(turn[2], turn[4] + 1)
area = np.sum(np.diff(shift[cycle]) * (Q[cycle][1:] + Q[cycle][:-1]) / 2)
print(f"lost in the first cycle {first:.6e}, in the second {second:.6e}, theory {exact_loss:.6e}")
print(f"area of the second loop {area:.6e}")

# %% Write and plot
sc.write_series(out / "cattaneo_mindlin.pvd", results[:: n // 4])

figure, (traction_axes, loop_axes) = plt.subplots(
    1, 2, figsize=(11, 4.8), width_ratios=[1.3, 1], layout="constrained"
)
inside = np.argsort(x)
inside = inside[np.abs(x[inside]) < 1.12]
near = x[inside] / hertz.a
bound = mu * hertz.pressure(x[inside]) / hertz.p0
traction_axes.fill_between(near, -bound, bound, color="#f0ece4", lw=0)
shown = range(n // 4, 2 * n, n // 4)
for i in shown:
    colour = plt.get_cmap("viridis")(0.5 * i / n)
    measured = -results[i].traction[inside, 0] / hertz.p0
    traction_axes.plot(near, exact_traction(i)[inside] / hertz.p0, color=colour, lw=1.2)
    label = f"{Q[i] / (mu * P) + 0.0:.2f} μP"
    traction_axes.plot(near, measured, ".", ms=4, color=colour, label=label)
traction_axes.set(xlim=(-1.12, 1.7), xlabel="x / a", ylabel="traction / largest pressure")
traction_axes.set_title("dots: finite elements; lines: theory; shaded: |q| < μp", fontsize="medium")
traction_axes.legend(frameon=False, title="Q, in order", loc="center right")

# taking off what is proportional to Q widens the loop, and does not change its area
lean = (shift - Q * shift[turn[0]] / Q0) / hertz.a * 1e3
loop_axes.fill(lean[cycle], Q[cycle] / (mu * P), color="#e3eef5")
loop_axes.plot(lean, Q / (mu * P), "-o", ms=2.5, color="#20618d")
loop_axes.set(
    xlabel="shift − (largest shift / largest Q) · Q   [a / 1000]", ylabel="tangential force Q / μP"
)
loop_axes.set_title("two cycles, one loop: its area is the energy lost", fontsize="medium")
for axes in (traction_axes, loop_axes):
    axes.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "cattaneo_mindlin.png", dpi=90)
