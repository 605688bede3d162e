r"""A rigid wheel that tows: pressed by its weight, driven by its turn, held back by a force.

               ___
             /     \        turned step by step about its axle, which is free to move:
        Q <-|   +   | )     the wheel sinks and rolls forward as its weight P, the force Q
             \_____/        and the friction of the strip let it
        ________|P_________
       |      strip        |    Coulomb friction 0.3, plane strain, nearly incompressible
       |___________________|
       ////////////////////

The wheel is a `RigidBody`: its axle is under force control, its turn is prescribed, and what it takes
to turn it comes out. A wheel that tows does not roll as far as it turns. The share that is lost, the
creep, follows from the part of the contact that slips, at the trailing edge (Carter 1926; Johnson,
Contact Mechanics, chapter 8), with the half width of contact a:

    creep = mu a / R (1 - sqrt(1 - Q / (mu P)))

beyond that of the free wheel, which the strip stretches under. All four points lie on that curve to
2 % of mu a / R.

Run ``python examples/towing_wheel.py [folder]``: a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers
E, nu, mu, R, a = 1.0, 0.45, 0.3, 10.0, 0.5
h = a / 10
P = np.pi * a**2 * E / (1 - nu**2) / (4 * R)  # Hertz: half width a on a half-plane
shares = [0.0, 0.25, 0.5, 0.75, 0.9]  # Q / (mu P)


# %% The strip: fine where the wheel rolls
def coarser(start, end):
    """From a fine region on in growing steps."""
    x, step = [start], h * np.sign(end - start)
    while abs(x[-1] - start) < abs(end - start):
        step *= 1.25
        x.append(x[-1] + step)
    return x[1:]


x = np.concatenate([coarser(-1.0, -8.0)[::-1], np.arange(-1.0, 3.0 + h / 2, h), coarser(3.0, 9.0)])
y = np.concatenate([coarser(-0.5, -8.0)[::-1], np.arange(-0.5, h / 2, h)])
mesh = fem.MeshQuad.init_tensor(x, y).with_defaults()
basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
strip = sc.Body(basis, linear_elasticity(*lame_parameters(E, nu)), D="bottom", name="strip")

# %% The wheel: an obstacle with the degrees of freedom of its motion
wheel = sc.RigidBody(sc.RigidCylinder((0.0, R), R), D="rotation", name="wheel")
contact = sc.Contact(strip.surface("top"), wheel, friction=sc.Coulomb(mu), sliding="finite")
solver = sc.ContactSolver([strip, wheel], [contact])
print(solver)
pressed = next(solver.history([{"f": {"wheel": {"y": -P}}}]))

# %% Four half widths of rolling, forward by turning backward
turns = -np.arange(1, 61) * 0.04 / R
creep, rolled = [], []
for share in shares:
    load = {"wheel": {"x": -share * mu * P, "y": -P}}
    steps = [{"f": load, "x": {"wheel": {"rotation": turn}}} for turn in turns]
    way, torque = [], []
    for result in solver.history(steps, start=pressed):
        translation, _, _ = result.motion("wheel")
        way.append(translation[0])
        torque.append(-result.reaction("wheel")[2])
    rolled.append(result)
    creep.append(1 + np.diff(way)[20:].mean() / np.diff(R * turns)[20:].mean())
    work = torque[-1] / R / (share * mu * P) if share else 0.0
    print(f"Q / (mu P) = {share:4.2f}: creep {creep[-1]:8.5f}, torque / (Q R) {work:.4f}")
print(rolled[2].report())

# %% Carter's curve
found = np.array(creep) - creep[0]
carter = mu * a / R * (1 - np.sqrt(1 - np.array(shares)))
for share, here, there in zip(shares, found, carter, strict=True):
    print(f"Q / (mu P) = {share:4.2f}: {here:.5f}, Carter {there:.5f}")

# %% Pictures
figure = plt.figure(figsize=(9, 6.6), layout="constrained")
top, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[11, 8]).flat
scene = top.subplots()
towing = rolled[2]


def mises(body, u):
    return sc.von_mises(body, u, E=E, nu=nu)


(dx, dy), _, _ = towing.motion("wheel")
units = {"length": "R/10", "stress": "E"}
window = (-1.5, 5, -1.6, 1.2)
sc.plot_deformed(towing, scale=1.0, stress=mises, ax=scene, window=window, units=units)
scene.set_title("a wheel that tows half of what friction bears; true positions", pad=8)
traction, curve = below.subplots(1, 2)
values = towing[contact]
order = np.argsort(values.points[:, 0])
s = (values.points[order, 0] - dx) / a
p0 = 2 * P / (np.pi * a)
traction.plot(s, values.pressure[order] / p0, label="pressure")
traction.plot(s, values.friction_stress[order, 0] / (mu * p0), label="friction / μ")
traction.plot(s, -values.pressure[order] / p0, "k:", lw=0.8)
traction.plot([], [], "k:", lw=0.8, label="−pressure")
traction.set(
    xlim=(-1.6, 1.6), xlabel="place from below the axle [a]", ylabel="stress over Hertz' pressure"
)
traction.legend(frameon=False, fontsize="small", loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
q = np.linspace(0, 1, 200)
curve.plot(q, 1 - np.sqrt(1 - q), "k", lw=0.8, label="Carter")
curve.plot(shares, found / (mu * a / R), "o", label="rigid wheel on the strip")
curve.set(xlabel="Q / (μP)", ylabel="creep over μa / R")
curve.legend(frameon=False)
figure.savefig(out / "towing_wheel.png", dpi=120)

# %% Check what the first lines say
error, tolerance = float(np.max(np.abs(found - carter)) / (mu * a / R)), 0.02
assert error < tolerance
