r"""A gear pair: two teeth as solids, one gear held, the other turned by a torque.

                     \   gear 2   /          involute teeth that touch at the pitch point,
          ________    |  (held)  |           where the flanks roll without slip
         /        \___|__________/
        |  gear 1  )  <- flanks touch here   steel on steel, without friction
        | (torque) |
         \________/                          half the width is meshed, from the plane of symmetry

The flank of an involute has the radius r sin(alpha) at the pitch point, with the pitch radius r and the
pressure angle alpha. The force is the torque over the base radius, F = T / (r1 cos(alpha)). So Hertz'
line contact with the relative radius R, 1/R = 1/(r1 sin(alpha)) + 1/(r2 sin(alpha)), gives the pressure
on the flank (the basis of ISO 6336-2). In the middle of the width it is found to 3 %. The torque that
holds gear 2 is T r2/r1, to 0.1 %.

Run ``python examples/gear_pair.py [folder]``: numbers, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import effective_modulus, hertz_line

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers: N, mm and MPa
E, nu = 210e3, 0.3
module, alpha, width = 4.0, np.radians(20), 10.0
teeth = (20, 30)
torque = 150e3  # N mm
r1, r2 = (0.5 * module * z for z in teeth)
E_star, R = effective_modulus(E, nu, E, nu), np.sin(alpha) / (1 / r1 + 1 / r2)
F = torque / (r1 * np.cos(alpha))
hertz = hertz_line(F / width, np.sin(alpha) * r1 * r2 / (r1 + r2), E_star)
h = hertz.a / 5


# %% One tooth on a piece of its rim, as hexahedra
def away(start, end, ratio=1.5):
    """From a fine place on in growing steps, without the start."""
    steps = [h]
    while sum(steps) < abs(end - start):
        steps.append(ratio * steps[-1])
    return start + np.cumsum(steps) * (end - start) / sum(steps)


def half_angle(radius, z):
    """Half the thickness of a tooth as an angle: involute flanks, radial below the base circle."""
    r = 0.5 * module * z
    phi = np.arccos(np.minimum(1, r * np.cos(alpha) / radius))
    return np.pi / (2 * z) + (np.tan(alpha) - alpha) - (np.tan(phi) - phi)


def gear(z, name, centre, facing, held):
    """A gear whose flank meets the x axis at the pitch radius, and is fine there."""
    r = 0.5 * module * z
    root, tip, bore = r - 1.25 * module, r + module, r - 3.5 * module
    near = r + h * np.arange(-8, 9)
    rim = np.linspace(bore, root, 4)
    radii = np.concatenate([rim, away(near[0], root)[-2::-1], near, away(near[-1], tip)])
    thick = r * half_angle(r, z)
    into = np.concatenate([[0], away(0, thick)]) / thick  # depths below the flank over the half tooth
    across = np.concatenate([[-3, -2, -1, -0.5], 1 - into[::-1], [2, 3]])
    layers = width / 2 * np.array([0, 0.3, 0.58, 0.8, 0.93, 1])
    mesh = fem.MeshHex.init_tensor(radii, across, layers)
    mesh = mesh.restrict(mesh.elements_satisfying(lambda x: (x[0] < root) | (np.abs(x[1]) < 1)))
    mesh = mesh.with_boundaries(
        {
            "flank": lambda x: (x[1] == 1) & (x[0] > root),
            "bore": lambda x: x[0] == bore,
            "middle": lambda x: x[2] == 0,
        }
    )
    radius, tau, depth = mesh.p
    half, sector = half_angle(radius, z), 1.2 * 2 * np.pi / z
    beside = np.maximum(np.abs(tau) - 1, 0) / 2 * (sector - half)
    angle = np.clip(tau, -1, 1) * half + np.sign(tau) * beside
    angle += np.pi - half_angle(r, z) if facing else -half_angle(r, z)
    places = np.array([centre + radius * np.cos(angle), radius * np.sin(angle), depth])
    mesh = fem.MeshHex(places, mesh.t, _boundaries=mesh.boundaries)
    element, steel = fem.ElementVector(fem.ElementHex1()), linear_elasticity(*lame_parameters(E, nu))
    return sc.Body.from_mesh(mesh, element, steel, D=held, name=name)


symmetric = {"middle": "z"}
driver = gear(teeth[0], "gear 1", 0.0, False, symmetric)
driven = gear(teeth[1], "gear 2", r1 + r2, True, ["bore", symmetric])

# %% The shaft of gear 1: a rigid body that may only turn, under half of the torque
shape = sc.RigidCylinder((0.0, 0.0, 0.0), r1 - 3.5 * module, axis=(0, 0, 1))
fixed = ("x", "y", "z", "rotation x", "rotation y")
shaft = sc.RigidBody(shape, moment=(0, 0, torque / 2), D=fixed, name="shaft")
seat = sc.Contact(driver.surface("bore"), shaft, tied=True, name="seat")
flank = sc.Contact(driver.surface("flank"), driven.surface("flank"), name="flank")
solver = sc.ContactSolver([driver, driven, shaft], [seat, flank])
result = solver.solve()
print(result)

# %% Beside Hertz and the balance of the gears
values = result["flank"]
middle = np.flatnonzero(values.points[:, 2] == 0)
largest = values.pressure[middle].max()
held = -2 * values.moment((r1 + r2, 0, 0))[2]
force = 2 * np.linalg.norm(values.force)
print(f"force on the flank         {force:9.1f} N,    T / (r1 cos alpha) {F:9.1f}")
print(f"largest pressure, middle   {largest:9.1f} MPa,  Hertz              {hertz.p0:9.1f}")
print(f"torque that holds gear 2   {abs(held):9.0f} N mm, T r2 / r1          {torque * r2 / r1:9.0f}")

# %% Files and pictures
sc.write(out / "gear_pair.vtu", result)
figure = plt.figure(figsize=(11, 4.8), layout="constrained")
left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[1, 0.9]).flat
units = {"length": "mm", "stress": "MPa"}
mises = {"von Mises stress": lambda body, u: sc.von_mises(body, u, E=E, nu=nu)}
sc.plot_deformed(
    result, stress=mises, ax=left.subplots(), units=units, cmap="turbo", obstacles=False,
    viewer=(6, -62, 61),
)  # fmt: skip
over = right.subplots()
along = (values.points[:, 0] - r1) / np.cos(alpha)  # along the flank from the pitch point
order = middle[np.argsort(along[middle])]
place = np.linspace(-0.4, 0.4, 400)
over.plot(place, hertz.pressure(place), "k", lw=0.8, label="Hertz")
over.plot(along[order], values.pressure[order], "o", ms=4, label="found, middle of the width")
over.set(
    xlim=(-0.4, 0.4),
    ylim=(0, 1.25 * hertz.p0),
    xlabel="along the flank from the pitch point [mm]",
    ylabel="pressure [MPa]",
)
over.legend(frameon=False, loc="upper left", fontsize="small")
over.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "gear_pair.png", dpi=90)

# %% Check what the first lines say
assert abs(abs(held) / (torque * r2 / r1) - 1) < 1e-3
assert abs(force / F - 1) < 1e-3
error, tolerance = abs(largest / hertz.p0 - 1), 0.03
assert error < tolerance
