r"""A ball pressed on a block and pushed aside: Hertz and Mindlin in three dimensions.

            o  o  o  o  o
           |   ball     |  --> Q     pressed down first, then pushed to and fro
           |____     ___|
     ___________)   (___________     half widths of the contact: a; both bodies
    |           ¯¯¯¯¯           |    of the same material; Coulomb friction 0.4
    |           block           |
    |___________________________|    clamped below; half of it, cut along the plane of symmetry

The ball is its cap: what is farther than a few `a` from the contact does not matter. Under the push
the contact sticks within a circle and slips in the ring around it, towards the edge, where pressures
are small (Mindlin 1949); the friction traction turns with the slip. Forces and the circle of stick are
compared with the theory.

Run ``python examples/mindlin_ball.py [folder]``: report, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from matplotlib.collections import PolyCollection
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import cattaneo_mindlin, effective_modulus, hertz_point

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers (any units; the contact becomes a circle of radius 1)
E, nu, mu = 1.0, 0.3, 0.4
R, size = 100.0, 8.0
h = 1 / 7
down, aside = 0.0114, 0.004


# %% Bodies: one fine grid around the contact for both, so that node meets node
def graded(end, fine, ratio=1.45):
    """Coordinates from 0 to `end`: steps `h` up to `fine`, growing beyond."""
    even = h * np.arange(round(fine / h) + 1)
    count = int(np.log1p((end - fine) * (ratio - 1) / (h * ratio)) / np.log(ratio))
    growing = np.cumsum(ratio ** np.arange(1, count + 1))
    return np.concatenate([even, even[-1] + (end - even[-1]) * growing / growing[-1]])


y = graded(size, 9 * h)
x = np.append(-y[:0:-1], y)
z = graded(size, 2 * h)


def body(name, z, far, lift):
    """A body whose far side is held; only the half with y > 0 is meshed."""
    mesh = fem.MeshHex.init_tensor(x, y, z)
    p = mesh.p.copy()
    p[2] += lift(p[0] ** 2 + p[1] ** 2) * (1 - np.abs(p[2]) / size)
    mesh = fem.MeshHex(p, mesh.t).with_boundaries(
        {
            "far": lambda x: np.isclose(x[2], far),
            "symmetry": lambda x: np.isclose(x[1], 0),
            "contact": lambda x: (np.abs(x[2]) < 0.1) & (x[1] > 0) & (np.hypot(x[0], x[1]) < 9.5 * h),
        }
    )
    D = ["far", {"symmetry": "y"}]
    element, elastic = fem.ElementVector(fem.ElementHex1()), linear_elasticity(*lame_parameters(E, nu))
    return sc.Body.from_mesh(mesh, element, elastic, D=D, name=name)


ball = body("ball", z, size, lambda r2: r2 / (2 * R))
block = body("block", -z[::-1], -size, lambda r2: 0 * r2)

# %% Contact
contact = sc.Contact(
    ball.surface("contact"), block.surface("contact"), friction=sc.Coulomb(mu), name="joint"
)
solver = sc.ContactSolver([ball, block], contact)
print(solver)


def held_at(push):
    """The far side of the ball lowered, and pushed along x."""
    u = np.zeros(ball.basis.N)
    u[ball.basis.get_dofs("far").all("u^1")] = push
    u[ball.basis.get_dofs("far").all("u^3")] = -down
    return {"x": {"ball": u}}


# %% Press, then push aside and back
way = np.concatenate([np.linspace(0, aside, 6), np.linspace(aside, -aside, 11)[1:]])
turn = 5  # the step at which the push turns back
results = list(solver.history([held_at(push) for push in way]))
pressed = results[0]
print("At the turn:", results[turn], sep="\n")

# %% Check: the forces of the whole are twice those of the half
P = 2 * pressed.force[2]
hertz = hertz_point(P, R, effective_modulus(E, nu, E, nu))
print(f"circle of contact: radius {hertz.a:.4f}, largest pressure {pressed.pressure.max():.6f},")
print(f"by Hertz {hertz.p0:.6f}")
errors = [abs(pressed.pressure.max() / hertz.p0 - 1)]
r = np.linalg.norm(pressed.points[:, :2], axis=1)
share = np.array([-result.force[0] / (mu * result.force[2]) for result in results])


def exact(i):
    """Theory for step `i`: the first push, or the way back from the turn."""
    after = (mu * P * share[turn],) if i > turn else ()
    return cattaneo_mindlin(hertz, mu, mu * P * share[i], after=after)


def rms(values):
    return np.sqrt(pressed.integrate(values**2))


shown = (2, turn, turn + 5, turn + 9)
for i in shown:
    traction = exact(i).traction(r)
    off = rms(results[i].traction[:, 0] + traction) / rms(exact(turn).traction(r))
    print(f"Q = {share[i]:5.2f} mu P: traction differs from theory by {off:.1%} (root mean square)")
    errors.append(off)
error, tolerance = max(errors), 0.1  # tractions end in square roots, on faces of an eighth of `a`

# %% Write and plot
sc.write_series(out / "mindlin_ball.pvd", results[::5])
turned, line = results[turn]["joint"], np.abs(pressed.points[:, 1]) < 1e-9
order = np.argsort(pressed.points[line, 0])
figure, (plan, along) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
faces = turned.surface.points[turned.surface.facets][:, :, :2]
nodal = turned.pressure[turned.surface.facets].mean(axis=1) / hertz.p0
filled = PolyCollection(faces, array=nodal, cmap="YlOrRd", edgecolors="none")
plan.add_collection(filled)
plan.add_collection(PolyCollection(faces * [1, -1], array=nodal, cmap="YlOrRd", edgecolors="none"))
figure.colorbar(filled, ax=plan, label="pressure / largest of Hertz", shrink=0.8)
for radius, style in ((hertz.a, "-"), (exact(turn).c, "--")):
    plan.add_patch(plt.Circle((0, 0), radius, fill=False, ls=style, color="#444444"))
for status, mark, label in ((1, "o", "stick"), (2, "x", "slip")):
    at = turned.points[turned.status == status]
    plan.plot(at[:, 0], at[:, 1], mark, ms=3.5, color="#20618d", label=label, fillstyle="none")
plan.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), aspect="equal", xlabel="x [R / 100]", ylabel="y [R / 100]")
plan.set_title(f"Q = {share[turn]:.2f} μP; circles of contact and of stick", fontsize="medium")
plan.legend(frameon=False, loc="lower left")
fine = np.linspace(-1.25, 1.25, 400)
along.fill_between(
    fine / hertz.a,
    *(sign * mu * hertz.pressure(np.abs(fine)) / hertz.p0 for sign in (-1, 1)),
    color="#f0ece4",
)
for i in shown:
    colour = plt.get_cmap("viridis")(i / len(way))
    along.plot(fine / hertz.a, exact(i).traction(np.abs(fine)) / hertz.p0, color=colour, lw=1.2)
    measured = -results[i].traction[line, 0][order] / hertz.p0
    x_line = pressed.points[line, 0][order] / hertz.a
    along.plot(x_line, measured, ".", color=colour, label=f"{share[i]:.2f} μP")
along.set(
    xlim=(-1.15, 1.75), xlabel="x / a, on the plane of symmetry", ylabel="traction / largest pressure"
)
along.set_title("dots: finite elements; lines: theory; shaded: |q| < μp", fontsize="medium")
along.legend(frameon=False, title="Q, in order", loc="upper right")
along.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "mindlin_ball.png", dpi=90)
