r"""A wedge pushed into a slot and let go: where it stays, and where it jumps out.

              F
         _____|_____
        |           |          half angle 5 degrees: self-locking, tan 5 < 0.15
     ____\         /____                12 degrees: it comes out by itself
    |     \       /     |
    |      \     /      |      Coulomb friction 0.15 on both flanks, plane strain;
    |       \___/       |      jaws guided straight, on springs
    |    |         |    |
    |____|         |____|

Pushed in over six facets, all of the flanks slip and F/N = 2 (sin a + mu cos a), with N the force on
one flank. Let go, the flat wedge sticks and keeps its N; it takes 2 (mu cos a - sin a) N to pull it
out. The steep one comes out by itself, and holds nothing when F is zero. The forces agree with the
formulas within 1 %: flanks tilt a little under the pressure.

Run ``python examples/wedge.py [folder]``: the forces, and a picture.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import skfem as fem
from scipy.sparse import csr_matrix
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.reference import taper_force

out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "out"
out.mkdir(parents=True, exist_ok=True)

# %% Numbers (mm, MPa; forces per mm of thickness)
mu, width, depth = 0.15, 1.0, 1.0  # the wedge is 2 `width` wide at its top
spring, guide = 10.0, 1e5  # of a jaw: against translation [N/mm per mm], against rotation
element = fem.ElementVector(fem.ElementQuad1())
stiffness = linear_elasticity(*lame_parameters(1e3, 0.3))


def grid(corners, nx, ny):
    """Basis on a quadrilateral from its corners, lower left and on counterclockwise."""
    square = fem.MeshQuad.init_tensor(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1))
    square = square.with_defaults()
    a, b, c, d = np.array(corners, dtype=float)[:, :, None]
    s, t = square.p
    points = (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * d + s * c)
    mesh = fem.MeshQuad(points, square.t).with_boundaries(square.boundaries)
    return fem.Basis(mesh, element, intorder=3)


def jaw(name, corners, outer):
    """A jaw whose outer side is guided: it may move sideways against a spring, and not turn."""
    basis = grid(corners, 12, 22)
    side = basis.boundary(outer)
    length = side.dx.sum()
    middle = (side.dx * side.global_coordinates()[1]).sum() / length
    shift = fem.LinearForm(lambda v, w: v[0] / length).assemble(side)
    turn = fem.LinearForm(lambda v, w: (w.x[1] - middle) * v[0]).assemble(side)
    K = stiffness.assemble(basis)
    for k, form in ((spring, shift), (guide, turn)):
        column = csr_matrix(form[:, None])
        K = csr_matrix(K + k * (column @ column.T))
    return sc.Body(basis, K, D=basis.get_dofs(outer).nodal["u^2"], name=name)


def push_and_pull(degrees, moves):
    """The results of moving the top of the wedge down by each of `moves`."""
    t = np.tan(np.radians(degrees))
    bottom = width - depth * t
    basis = grid([(-bottom, 0), (bottom, 0), (width, depth), (-width, depth)], 20, 14)
    top, down = basis.get_dofs("top"), np.zeros(basis.N)
    down[top.nodal["u^2"]] = -1.0
    wedge = sc.Body(basis, stiffness, D=top, x=down, name="wedge")
    # the jaws are longer, so that the wedge slides along them and not over their ends
    low, high = -0.4, 1.2
    foot, head = width - (depth - low) * t, width + (high - depth) * t
    right = jaw("right", [(foot, low), (2.5, low), (2.5, high), (head, high)], "right")
    left = jaw("left", [(-2.5, low), (-foot, low), (-head, high), (-2.5, high)], "left")
    contacts = [
        sc.Contact(
            wedge.surface(side),
            other.surface(flank),
            friction=sc.Coulomb(mu),
            sliding="finite",
            name=side,
        )
        for side, other, flank in (("right", right, "left"), ("left", left, "right"))
    ]
    solver = sc.ContactSolver([wedge, left, right], contacts)
    return list(solver.history({"x": {"wedge": move}} for move in moves))


def forces(result):
    """The force on the top of the wedge, downwards, and the normal force on one flank."""
    return sum(result[side].force[1] for side in ("left", "right")), result["right"].normal_force.sum()


# %% Push in, let go, pull out
moves = {
    5: np.concatenate([np.linspace(0, 0.4, 21), np.linspace(0.4, 0.2, 21)[1:]]),
    12: np.concatenate([np.linspace(0, 0.4, 21), np.linspace(0.4, 0, 21)[1:]]),
}
results = {angle: push_and_pull(angle, path) for angle, path in moves.items()}
F, N = {}, {}
for angle in moves:
    F[angle], N[angle] = np.array([forces(result) for result in results[angle]]).T
errors = []
for angle in moves:
    ratio = F[angle] / np.maximum(N[angle], 1e-300)
    slipping = np.array([np.all(r["right"].status != 1) for r in results[angle]]) & (N[angle] > 1e-6)
    pushed = np.diff(moves[angle], prepend=0) > 0
    for words, part, out_of in (("in", pushed, False), ("out", ~pushed, True)):
        measured = ratio[slipping & part].mean()
        expected = (-1 if out_of else 1) * taper_force(np.radians(angle), mu, pull_out=out_of)
        errors.append(abs(measured / expected - 1))
        print(f"{angle:2d} degrees, {words:3s}: F/N {measured:8.5f}, formula {expected:8.5f}")
error, tolerance = max(errors), 0.01
kept = np.interp(0.0, -F[5][20:], N[5][20:]) / N[5].max()
print(f"let go, the wedge of 5 degrees keeps {100 * kept:.0f} % of N; that of 12 degrees comes out")


# %% Pictures
def mises(body, u):
    return sc.von_mises(body, u, E=1e3, nu=0.3)


units = {"length": "mm", "stress": "MPa"}
figure, axes = plt.subplot_mosaic(
    [["in", "in"], [5, 12]], figsize=(9, 7.6), height_ratios=[1, 1.1], layout="constrained"
)
sc.plot_deformed(results[12][20], stress=mises, ax=axes["in"], units=units)
axes["in"].set_title("12 degrees, pushed in by 0.4 mm; true positions")
for angle in (5, 12):
    ax, a, half = axes[angle], np.radians(angle), len(moves[angle]) // 2 + 1
    ax.plot(moves[angle], F[angle], "o-", ms=3, color="#20618d", label="finite elements")
    pushing, pulling = taper_force(a, mu) * N[angle], -taper_force(a, mu, pull_out=True) * N[angle]
    ax.plot(moves[angle][:half], pushing[:half], "k:", lw=2, label="formulas, with N as computed")
    ax.plot(moves[angle][half:], pulling[half:], "k:", lw=2)
    ax.axhline(0, color="gray", lw=0.8)
    ax.set(xlabel="depth of the wedge [mm]", ylabel="force on its top, downwards [N/mm]")
    ax.spines[["top", "right"]].set_visible(False)
axes[5].set_title("5 degrees: it stays, and has to be pulled out")
axes[12].set_title("12 degrees: it comes out by itself")
axes[5].legend(frameon=False, loc="upper left")
figure.savefig(out / "wedge.png", dpi=110)

# %% Check what the first lines say
assert error < tolerance
assert kept > 0.9 and N[12][-1] < 1e-6 * N[12].max()
