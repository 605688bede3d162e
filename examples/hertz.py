r"""A steel cylinder pressed on a steel block: Hertz' line contact, on two meshes that do not match.

         ///////////////
        |_______________|     down by 0.02 mm
        |               |     segment of a cylinder, radius 100 mm, 10 mm high
         \__         __/
     _______\___.___/_______  contact on 2 a, about 2 mm
    |                       |
    |         block         |  10 mm deep; both 40 mm wide, plane strain
    |_______________________|
    /////////////////////////

Hertz' bodies are half planes. These are eight half widths deep, and clamped, which adds C P/(E* H²) to
the curvature of each body; the reference takes that in. The largest pressure agrees with it to 0.2 %
(half planes would be off by 0.4 %), and the pressure everywhere to 1 % in the mean square.

Run ``python examples/hertz.py [folder]``: report, a file for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import block_curvature, effective_modulus, hertz_line

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers (N, mm, MPa; forces per mm of thickness)
R, H, W = 100.0, 10.0, 20.0  # radius of the cylinder, depth and half width of both bodies
material = {"E": 210e3, "nu": 0.3}
down = 0.02


# %% Bodies: two rectangles, fine where they touch; one side of the upper one becomes an arc
def graded(h, end, fine=1.3, ratio=1.12):
    """Coordinates from 0 to `end`: steps of about `h` up to `fine`, growing beyond."""
    count = int(np.log1p((end - fine) * (ratio - 1) / (h * ratio)) / np.log(ratio))
    growing = np.cumsum(ratio ** np.arange(1, count + 1))
    even = np.linspace(0, fine, round(fine / h) + 1)
    return np.concatenate([even, fine + (end - fine) * growing / growing[-1]])


def rectangle(h, above):
    x, y = graded(h, W), graded(h, H)
    x, y = np.append(-x[:0:-1], x), (y if above else -y[::-1])
    return fem.MeshQuad.init_tensor(x, y).with_defaults()


def rise(x):
    """Height of the cylinder's surface over its lowest point."""
    return R - np.sqrt(R**2 - x**2)


element = fem.ElementVector(fem.ElementQuad1())
stiffness = linear_elasticity(*lame_parameters(**material))

flat = rectangle(0.04, above=True)
arc = flat.morphed(lambda p: p[0], lambda p: p[1] + rise(p[0]) * (1 - p[1] / H))
upper = fem.Basis(arc, element, intorder=2)
lowered = np.zeros(upper.N)
lowered[upper.get_dofs("top").all("u^2")] = -down
cylinder = sc.Body(upper, stiffness, D="top", x=lowered, name="cylinder")

lower = fem.Basis(rectangle(0.05, above=False), element, intorder=2)
block = sc.Body(lower, stiffness, D="bottom", name="block")

# %% Contact, solve
contact = sc.Contact(cylinder.surface("bottom"), block.surface("top"), method="mortar")
result = sc.ContactSolver([cylinder, block], [contact]).solve()
print(result.report())

# %% Check: Hertz, for the force that the finite elements carry
P = result.force[1]
E_star = effective_modulus(*material.values(), *material.values())
added = 2 * block_curvature(P, H, **material, base="fixed", width=W / H)
exact = hertz_line(P, R, E_star, added_curvature=added)

x, p = result.points[:, 0], result.pressure
difference = result.integrate((p - exact.pressure(x)) ** 2)
off = np.sqrt(difference / result.integrate(exact.pressure(x) ** 2))
off_peak = abs(p.max() / exact.p0 - 1)
error = max(off_peak / 2e-3, off / 1e-2)  # in units of what is promised above
tolerance = 1.0
left, right = np.sort(result.contact_edges[:, 0])
print(f"\nforce {P:.1f} N/mm        finite elements      Hertz    on half planes")
half_plane = hertz_line(P, R, E_star)
print(f"largest pressure [MPa] {p.max():14.2f} {exact.p0:12.2f} {half_plane.p0:12.2f}")
print(f"half width [mm]        {(right - left) / 2:14.4f} {exact.a:12.4f} {half_plane.a:12.4f}")
print(f"largest pressure differs by {off_peak:.2%}, pressure by {off:.2%} in the mean square")


# %% Write and plot
def mises(body, u):
    return sc.von_mises(body, u, **material, plane="strain")


sc.write(out / "hertz.vtu", result, stress=mises)

figure, (left_axes, right_axes) = plt.subplots(
    1, 2, figsize=(11, 4.6), width_ratios=[1.05, 1], layout="constrained"
)
units, window = {"length": "mm", "stress": "MPa"}, (-2, 2, -2, 2)
sc.plot_deformed(result, 1.0, stress=mises, ax=left_axes, arrows=False, units=units, window=window)
left_axes.set_title("the stress is largest below the surface", fontsize="medium")
fine = np.linspace(-exact.a, exact.a, 400)
right_axes.plot(fine, exact.pressure(fine), color="#b5441c", lw=1.5, label="Hertz")
right_axes.plot(x, p, ".", ms=5, color="#20618d", label="finite elements")
right_axes.set(xlim=(-1.4, 1.4), xlabel="x [mm]", ylabel="pressure [MPa]", ylim=(0, None))
right_axes.legend(frameon=False)
right_axes.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "hertz.png", dpi=90)
