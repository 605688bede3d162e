r"""A bolted lap joint that vibrates: its frequency and its damping against the amplitude.

                              ##
    |/ _______________________##___
    |/|_______________________||___|____________________
    |/                     |__||________________________|   | first bending
                              ##                            v
                              ##

A bolt is tightened to 8 kN, and the first bending mode of the clamped assembly is looked at: load steps
along its inertia forces, up and down until the loop closes, say what friction in the joint does to it.

The frequency hardly depends on the amplitude: at all of them, and on both of two meshes, it is within a
percent. The damping grows by about ten times, from less than .0001 of critical, and is not converged:
the meshes are .3 of it apart, as it comes from the few points that slip. Loops close after some
cycles only, and the bolt has lost force by then. Masing's rule, which would make the loop of the first
loading, is of no use here: pressures change in the cycle. Energies are those of half the bodies.

Run ``python examples/lap_joint.py [folder]``: tables and a picture.
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
tightened, friction = 8e3, sc.Coulomb(0.2)
amplitudes = [0.1, 0.2, 0.4, 0.8]  # of the free end


# %% Bodies: half of them, cut along y = 0, of second order
def body(lines, solid, faces, name):
    mesh = fem.MeshHex.init_tensor(*(np.array(along, dtype=float) for along in lines))
    faces = {"middle": lambda x: x[1] == 0, "wall": lambda x: x[0] == -80, **faces}
    mesh = mesh.restrict(mesh.elements_satisfying(solid)).with_boundaries(faces)
    D = [{"middle": "y"}, "wall"] if name == "lower" else {"middle": "y"}
    return sc.Body.from_mesh(mesh, fem.ElementVector(fem.ElementHexS2()), steel, D=D, name=name)


def tight(along, across, up):
    """The solver of a mesh, and the state after the bolt is tightened."""
    hole = 4.5
    around, arm = np.concatenate([-np.array(along)[::-1], along]), np.linspace(along[-1], 80, 6)[1:]

    def plate(x):
        return np.maximum(np.abs(x[0]), np.abs(x[1])) > hole

    def shank(x):
        return (np.maximum(np.abs(x[0]), np.abs(x[1])) < 4) | (np.abs(x[2]) > 6)

    def faces(side):
        return {
            "joint": lambda x: (x[2] == 0) & (np.abs(x[0]) < 16),
            "seat": lambda x: (x[2] == 6 * side) & (np.abs(x[0]) < 12),
        }

    upper = body([np.append(around, arm), across, up], plate, faces(1), "upper")
    down = -np.array(up)[::-1]
    lower = body([np.append(-arm[::-1], around), across, down], plate, faces(-1), "lower")
    levels = [-12, *np.linspace(-6, 6, 5), 12]
    ends = {"head": lambda x: x[2] == 6, "nut": lambda x: x[2] == -6}
    bolt = body([[-8, -4, 0, 4, 8], [0, 4, 8], levels], shank, ends, "bolt")
    pairs = {
        "joint": (upper, "joint", lower),
        "head": (bolt, "seat", upper),
        "nut": (bolt, "seat", lower),
    }
    contacts = [
        sc.Contact(a.surface(name), b.surface(face), friction=friction, name=name)
        for name, (a, face, b) in pairs.items()
    ]
    section = sc.Bolt(bolt, point=(0, 0, 1.5), axis=(0, 0, 1), name="bolt")
    solver = sc.ContactSolver([lower, upper, bolt], contacts, bolts=section)
    return solver, next(solver.history([{"bolt": {"bolt": {"force": tightened / 2}}}]))


# %% Mode, frequency and damping on two meshes
meshes = {
    "coarse": ([4.5, 8, 12, 16], [0, 4.5, 8, 12], [0, 6]),
    "fine": ([2, 4.5, 8, 12, 16], [0, 2, 4.5, 8, 12], [0, 3, 6]),
}
found = {}
for name, lines in meshes.items():
    solver, state = tight(*lines)
    modes = solver.modes(state, 1)
    found[name] = solver.damping(state, modes, amplitudes)
    print(f"{name}: {solver.kin.m} points in the joints\n{found[name]}\n")
print(f"{state.joints()}\n")

# %% Picture, of the fine mesh
figure = sc.output.plot_damping(found["fine"], units={"length": "mm", "time": "s"})
coarse, (of_frequency, of_damping, _) = found["coarse"], figure.axes
of_frequency.plot(coarse.amplitude, coarse.frequency, "s--", ms=4, color="#8a8a8a")
of_damping.plot(coarse.amplitude, coarse.damping, "s--", ms=4, color="#8a8a8a", label="coarser mesh")
of_damping.legend(frameon=False, fontsize="small")
figure.savefig(out / "lap_joint.png", dpi=80)
plt.close(figure)

# %% Check what the first lines say
frequencies = np.array([[damping.linear, *damping.frequency] for damping in found.values()])
error, tolerance = float(np.ptp(frequencies) / frequencies.min()), 0.01
assert np.all(np.diff(found["fine"].damping) > 0)
ratio = found["coarse"].damping / found["fine"].damping
assert 0.05 < np.abs(ratio - 1).max() < 0.5  # not converged
print(f"frequencies within {error:.2%}; damping of the coarse mesh over the fine one: {ratio.round(2)}")
