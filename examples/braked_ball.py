r"""A braked ball: it rolls along a rubber track, a brake moment grows, and at last it slides.

               _______
             /    _    \      rigid ball, pressed by its weight P, led along the track;
            |    (_)->  |     its turn is free, but for the moment M of a brake
             \    M    /
        ______\___P___/______________
       |     track (half of it)      |   Coulomb friction 0.3, nearly incompressible
       |_____________________________|

The ball is a `RigidBody` with six degrees of freedom, the contact slides far, and which part of it
sticks is found anew in each step. Without brake the ball rolls: it turns by the way over its radius,
and takes next to no force. Braked, more and more of the contact slips, from the rear forward, and the
ball turns by 2 % less than it goes (creep). The force on the axle is the moment over the arm, to 1 %:
balance of the ball about its centre. With its turn locked it slides, every point at the coefficient
times its normal force, to nine digits. Locking is a second solver, which goes on from the state of
the first.

Run ``python examples/braked_ball.py [folder]``: report, files for ParaView, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc

here = Path(__file__).parent
out = Path(sys.argv[1]) if len(sys.argv) > 1 else here / "out"

# %% Numbers: any units; the contact becomes a circle of radius a
E, nu, mu, R, a = 1.0, 0.45, 0.3, 10.0, 1.0
h = a / 4
P = 4 * a**3 * E / (1 - nu**2) / (3 * R)  # Hertz

# %% The track: fine where the ball goes; half of it, cut along the way
x = np.concatenate([[-6, -4.4, -3.2, -2.4], np.arange(-1.75, 7.76, h), [8.4, 9.2, 10.4, 12]])
y = np.concatenate([np.arange(0, 1.51, h), [2.2, 3.2, 4.5]])
z = np.array([-4, -2.5, -1.5, -0.9, -0.45, -0.2, 0])
mesh = fem.MeshHex.init_tensor(x, y, z).with_boundaries(
    {
        "way": lambda x: (x[2] == 0) & (x[0] > -1.8) & (x[0] < 7.8) & (x[1] < 1.51),
        "under": lambda x: x[2] == -4,
        "middle": lambda x: x[1] == 0,
    }
)
track = sc.Body.from_mesh(
    mesh,
    fem.ElementVector(fem.ElementHex1()),
    linear_elasticity(*lame_parameters(E, nu)),
    D=["under", {"middle": "y"}],
    name="track",
)


# %% The ball: free to turn, or with its turn locked
def with_ball(*also_held):
    """A solver with the ball, whose symmetry and way are prescribed, and what else is named."""
    sphere = sc.RigidSphere((0, 0, R), R)
    ball = sc.RigidBody(sphere, D=("x", "y", "rotation x", "rotation z", *also_held), name="ball")
    friction = sc.Coulomb(mu)
    contact = sc.Contact(track.surface("way"), ball, friction=friction, sliding="finite", name="way")
    return sc.ContactSolver([track, ball], [contact])


free, locked = with_ball(), with_ball("rotation y")
print(free)

# %% Roll, brake, slide: forces are those of the half that is meshed
rolled, braked, slid = np.arange(1, 9) * h, np.arange(1, 13) * h, np.arange(1, 5) * h
most = 0.9 * mu * P * R  # of the moment
steps = [{"f": {"ball": {"z": -P / 2}}}]
steps += [{"x": {"ball": {"x": way}}} for way in rolled]
for way, share in zip(rolled[-1] + braked, np.linspace(0, 1, 9)[1:].tolist() + [1.0] * 4, strict=True):
    steps.append(
        {"x": {"ball": {"x": way}}, "f": {"ball": {"z": -P / 2, "rotation y": -share * most / 2}}}
    )
results = list(free.history(steps))
turn = results[-1].motion("ball")[1][1]
after = rolled[-1] + braked[-1]
steps = [{"x": {"ball": {"x": after + way, "rotation y": turn}}} for way in slid]
results += list(locked.history(steps, start=results[-1]))

# %% What the axle feels
moved = [result.motion("ball") for result in results]
way = np.array([translation[0] for translation, _, _ in moved])
angle = np.array([rotation[1] for _, rotation, _ in moved])
arm = np.array([R + translation[2] for translation, _, _ in moved])
force = np.array([2 * result.reaction("ball")[0] for result in results])
slip = 1 - R * np.diff(angle) / np.diff(way)  # share of each step that the ball does not turn
print(results[len(rolled)])
print(results[-1])
for w, q, s in zip(way[1:], force[1:], slip, strict=True):
    print(f"way {w:4.2f}: force {q / (mu * P):7.4f} mu P, creep {100 * s:6.2f} %")

# %% Files and pictures
sc.write_series(out / "braked_ball.pvd", results[::3])
figure = plt.figure(figsize=(12, 8), layout="constrained")
top, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[1.25, 1]).flat
shown = {"rolls": len(rolled), "is braked": len(rolled) + len(braked), "slides": len(results) - 1}
axes = top.subplots(1, 3, sharey=True)
largest = max(results[i].pressure.max() for i in shown.values())
for ax, (words, i) in zip(axes, shown.items(), strict=True):
    values = results[i]["way"]
    px, py = values.points[:, 0] - way[i], values.points[:, 1]
    near = (np.abs(px) < 1.6) & (py < 1.6)
    closed = near & (values.status > 0)
    for side in (1, -1):  # the other half is the mirror image
        filled = ax.scatter(
            px[closed],
            side * py[closed],
            c=values.pressure[closed] / largest,
            s=520,
            marker="s",
            cmap="YlGnBu",
            vmin=0,
            vmax=1,
        )
        friction = values.tangential_force_vector[closed] / values.area[closed, None]
        arrows = ax.quiver(
            px[closed],
            side * py[closed],
            friction[:, 0],
            side * friction[:, 1],
            color=np.where(values.status[closed] == 2, "#c1440e", "#999999"),
            scale=6 * mu * largest,
            width=0.008,
        )
    ring = np.linspace(0, 2 * np.pi, 200)
    ax.plot(a * np.cos(ring), a * np.sin(ring), "k:", lw=0.8)
    ax.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6), aspect="equal", xlabel="ahead of the ball, over a")
    ax.set_title(f"the ball {words}", fontsize="medium")
top.suptitle("friction on the track where it sticks (grey) and slips (red)", fontsize="medium")
axes[0].set_ylabel("aside, over a")
axes[2].quiverkey(arrows, 0.22, 0.93, mu * largest, "μ times the largest pressure", labelpos="E")
top.colorbar(filled, ax=axes, label="pressure over the largest", shrink=0.8)
pull, creep = below.subplots(1, 2)
pull.plot(way / a, force / (mu * P), "o-", ms=3.5)
pull.axhline(1, color="k", lw=0.8, ls=":")
pull.set(xlabel="way over a", ylabel="force on the axle over μP")
creep.plot(way[1:] / a, 100 * slip, "o-", ms=3.5)
creep.set(xlabel="way over a", ylabel="creep [%]", yscale="symlog")
for ax in (pull, creep):
    for edge in (rolled[-1], after):
        ax.axvline(edge / a, color="#999999", lw=0.6)
figure.savefig(out / "braked_ball.png", dpi=100)

# %% Check what the first lines say
rolling = slice(2, len(rolled) + 1)
assert abs(R * (angle[rolling][-1] - angle[1]) / (way[rolling][-1] - way[1]) - 1) < 0.005
assert np.abs(force[rolling]).max() < 0.05 * mu * P
last = len(rolled) + len(braked)
assert abs(force[last] * arm[last] / most - 1) < 0.01 and slip[last - 1] > 3 * abs(
    slip[len(rolled) - 1]
)
values = results[-1]["way"]
size = np.linalg.norm(values.tangential_force, axis=1)
error = float(np.max(np.abs(size - mu * values.normal_force)) / size.max())
tolerance = 1e-9
assert error < tolerance
