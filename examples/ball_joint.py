r"""A ball joint: a ball in a socket with clearance, pressed and turned, and the torque of friction.

                 | P            ball: steel, taken as rigid, radius R
              _______           socket: plastic, radius R + clearance, held on its outer side
        |\  /         \  /|
        | \|    (_)    |/ |     The ball is pressed into the socket by P, then turned about the
        |  \    turn  /   |     direction of P (spin), or about an axis across it (swing).
        |    ` _____ '    |
         \_______________/      Coulomb friction

Under a small load the contact is a small circle, and Hertz holds with the difference of the curvatures,
1/R - 1/(R + clearance). The torque of spin is then 3 pi/16 mu P a, with the radius a of that circle.
Friction while it is pressed makes the pressure some percent larger than that of Hertz. Under a large
load the contact is a wide cap, and the torque of spin is less than by this formula. It is also less
than mu P R, which is the torque of a half sphere under the pressure p0 cos(angle). The torque
of swing is mu P R for a small contact, and a little more for a wide one. Under the
smallest load both torques are found to 2 %.

Run ``python examples/ball_joint.py [folder]``: a table, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import effective_modulus, hertz_point, sphere_torsion_capacity

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers: N, mm and MPa
E, nu, mu = 3000.0, 0.35, 0.1
R, clearance, wall = 10.0, 0.05, 10.0
loads = [10.0, 250.0, 2500.0]
turn = 0.05  # radians: enough for all points to slip

# %% The socket: a grid of angles and depths, bent to a part of a hollow sphere
fine = np.linspace(0, 0.25, 8)
half = np.append(fine, [0.30, 0.39, 0.52, 0.68, 0.85, 1.02])
angles, depths = np.append(-half[:0:-1], half), np.array([0, 0.25, 0.6, 1.2, 2.3, 4.5, wall])
grid = fem.MeshHex.init_tensor(angles, angles, -depths[::-1])
a, b, depth = grid.p
direction = np.array([np.tan(a), np.tan(b), -np.ones(len(a))])
direction /= np.linalg.norm(direction, axis=0)
inner = R + clearance
mesh = fem.MeshHex((inner - depth) * direction, grid.t).with_boundaries(
    {
        "seat": lambda x: np.linalg.norm(x, axis=0) < inner + 0.01,
        "outside": lambda x: np.linalg.norm(x, axis=0) > inner + wall - 0.5,
    }
)
element = fem.ElementVector(fem.ElementHex1())
plastic = linear_elasticity(*lame_parameters(E, nu))
socket = sc.Body.from_mesh(mesh, element, plastic, D="outside", name="socket")

# %% The ball: touches the socket at its lowest point; guided, and turned as told
sphere = sc.RigidSphere((0.0, 0.0, -clearance), R)
guided = ("x", "y", "rotation x", "rotation y", "rotation z")
ball = sc.RigidBody(sphere, D=guided, name="ball")
contact = sc.Contact(socket.surface("seat"), ball, friction=sc.Coulomb(mu), name="seat")
solver = sc.ContactSolver([socket, ball], [contact])
print(solver)

# %% Press, and turn from every load
steps = [{"f": {"ball": {"z": -P}}} for P in loads]
pressed = list(solver.history(steps))
spun = [solver.solve(x={"ball": {"rotation z": turn}}, start=start) for start in pressed]
swung = [solver.solve(x={"ball": {"rotation y": turn}}, start=start) for start in pressed]
spin = np.array([result.reaction("ball")[5] for result in spun])
swing = np.array([result.reaction("ball")[4] for result in swung])

# %% Beside the closed forms
E_star, R_relative = effective_modulus(E, nu), 1 / (1 / R - 1 / inner)
hertz = [hertz_point(P, R_relative, E_star) for P in loads]
small = np.array([sphere_torsion_capacity(contact, mu) for contact in hertz])
print("     load    largest pressure     torque of spin [N mm]              torque of swing")
print("      [N]    [MPa]    Hertz     found  small circle  half sphere   over mu P R")
for P, a, b, c, d, e in zip(loads, pressed, hertz, spin, small, swing, strict=True):
    largest, whole = a["seat"].pressure.max(), mu * P * R
    line = f"{P:9.0f} {largest:8.2f} {b.p0:8.2f} {c:9.3f} {d:12.3f} {whole:12.1f} {e / whole:12.3f}"
    print(line)

# %% Files and pictures
sc.write_series(out / "ball_joint.pvd", [*pressed, *spun])
figure = plt.figure(figsize=(11, 4.8), layout="constrained")
seat, curve = figure.subplots(1, 2)
sc.plot_contact(spun[1], ax=seat, units={"length": "mm", "stress": "MPa"})
seat.set_title(f"socket under {loads[1]:.0f} N, the ball spins", fontsize="medium")
many = np.geomspace(loads[0] / 2, 2 * loads[-1], 100)
circle = [sphere_torsion_capacity(hertz_point(P, R_relative, E_star), mu) / (mu * P * R) for P in many]
curve.semilogx(many, circle, "k", lw=0.8, label="spin, small circle (Hertz)")
curve.axhline(1, color="k", lw=0.8, ls=":", label="swing, small circle; spin, half sphere")
for torque, mark, name in ((swing, "s", "swing"), (spin, "o", "spin")):
    curve.plot(loads, torque / (mu * np.array(loads) * R), mark, label=f"{name}, found")
curve.set(xlabel="load [N]", ylabel="torque of friction / (μ P R)", ylim=(0, 1.2))
curve.legend(frameon=False, loc="center left", bbox_to_anchor=(0, 0.68), fontsize="small")
curve.spines[["top", "right"]].set_visible(False)
figure.savefig(out / "ball_joint.png", dpi=90)

# %% Check what the first lines say
for result, P in zip(spun, loads, strict=True):
    assert abs(result["seat"].force[2] + P) < 1e-8 * P  # the socket is pressed down by the load
assert all(small[1:] > spin[1:]) and spin[-1] < mu * loads[-1] * R  # a wide cap
error = max(abs(spin[0] / small[0] - 1), abs(swing[0] / (mu * loads[0] * R) - 1))
tolerance = 0.02
assert error < tolerance
