"""Two solid blocks whose meshes match at the interface; rows of gaps and slips made by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem as fem
from numpy.typing import NDArray
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.bodies import System
from skfem_contact.conditions import Kinematics, LoadCase, rigid_motions
from skfem_contact.problem import PosedOn

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Blocks:
    """A system of a lower block, which is held, and an upper one; and their contact."""

    system: System
    stiffness: list[csr_matrix]
    kin: Kinematics
    wanted: NDArray[np.intp]

    def on(self) -> PosedOn:
        """What a contact problem is posed on: all points with friction."""
        motions = rigid_motions(self.system, self.kin, self.stiffness)
        return PosedOn(self.kin, motions, None, np.ones(self.kin.m, dtype=bool))

    def case(self, f: Array, x: Array) -> LoadCase:
        """A load case."""
        m = self.kin.m
        still = np.zeros((m, self.kin.tangents))
        return LoadCase(f, x, self.kin.gap0, still, np.zeros(m), (), (), (), None)


def two_blocks(n: int, layers: int, *, floating: bool = False, E: float = 1.0) -> Blocks:
    """Blocks of n x n x `layers` hexahedra, one upon the other; the gap is that of a sphere."""
    bodies = [_block("low", -0.5, n, layers, 1.0, "low"), _block("up", 0.0, n, layers, E, None)]
    if not floating:
        bodies[1] = _block("up", 0.0, n, layers, E, "high")
    system = sc.bodies.stack(bodies)
    low, up = (body.basis for body in bodies)
    top, bottom = (_plane(basis) for basis in (low, up))
    points = up.mesh.p[:, bottom].T
    m = len(bottom)
    rows = [
        csr_matrix(
            (
                np.repeat([1.0, -1.0], m),
                (
                    np.tile(np.arange(m), 2),
                    np.concatenate([low.N + up.nodal_dofs[k, bottom], low.nodal_dofs[k, top]]),
                ),
            ),
            shape=(m, system.n),
        )
        for k in range(3)
    ]
    B_t = csr_matrix((2 * m, system.n))
    for k in range(2):
        spread = csr_matrix((np.ones(m), (2 * np.arange(m) + k, np.arange(m))), shape=(2 * m, m))
        B_t = csr_matrix(B_t + spread @ rows[k])
    kin = Kinematics(
        B_n=rows[2],
        tangential=lambda: B_t,
        tangents=2,
        gap0=0.05 * np.sum((points[:, :2] - 0.5) ** 2, axis=1),
        area=np.full(m, 1.0 / m),
        points=points,
        normal=np.tile([0.0, 0.0, 1.0], (m, 1)),
        tangent=np.tile(np.eye(3)[:2], (m, 1, 1)),
        paired=np.ones(m, dtype=bool),
        tied=np.zeros(m, dtype=bool),
        bilateral=np.zeros(m, dtype=bool),
        heir=np.arange(m),
        action=points,
        offset=np.zeros((m, 3)),
        tilt=np.zeros(m),
        vertex=np.full(m, -1),
    )
    wanted = np.unique(np.concatenate([rows[2].indices, B_t.indices]))
    return Blocks(system, [body.K for body in bodies], kin, wanted)


def _block(name: str, bottom: float, n: int, layers: int, E: float, held: str | None) -> sc.Body:
    side, height = np.linspace(0, 1, n + 1), bottom + np.linspace(0, 0.5, layers + 1)
    mesh = fem.MeshHex.init_tensor(side, side, height)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    level = {"low": height[0], "high": height[-1], None: np.nan}[held]
    D = basis.get_dofs(lambda x: np.isclose(x[2], level)).all() if held else None
    return sc.Body(basis, linear_elasticity(*lame_parameters(E, 0.3)), D=D, name=name)


def _plane(basis: fem.CellBasis) -> NDArray[np.intp]:
    """Nodes at the interface, in the same order on both sides."""
    nodes = np.flatnonzero(np.isclose(basis.mesh.p[2], 0.0))
    return nodes[np.lexsort(np.round(basis.mesh.p[:2, nodes], 9))]
