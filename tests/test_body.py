"""Bodies: what they accept, what they refuse, rigid modes, stacking."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from quick_elasticity import linear_elasticity
from skfem.models.poisson import laplace

from skfem_contact import J2, Body, Contact, ContactSolver, RigidPlane
from skfem_contact.bodies import pieces, stack
from skfem_contact.errors import InputError

ELASTIC = linear_elasticity()
MESH = fem.MeshQuad().refined(2).with_defaults()
BASIS = fem.Basis(MESH, fem.ElementVector(fem.ElementQuad1()))


@fem.LinearForm
def weight(v, w):
    return -v[1]


@pytest.mark.parametrize(
    "mesh, element",
    [
        (fem.MeshTri.init_circle(2), fem.ElementTriP1()),
        (fem.MeshTri2.init_circle(2), fem.ElementTriP2()),
        (fem.MeshQuad().refined(1), fem.ElementQuad1()),
        (fem.MeshQuad().refined(1), fem.ElementQuad2()),
        (fem.MeshQuad().refined(1), fem.ElementQuadS2()),
        (fem.MeshTet().refined(1), fem.ElementTetP2()),
        (fem.MeshHex().refined(1), fem.ElementHex1()),
    ],
)
@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_rigid_modes_have_no_strain(mesh, element, unit):
    """An elastic stiffness resists no rigid mode, and the modes are independent, in any unit."""
    mesh = mesh.scaled(unit).translated((unit,) * mesh.dim())
    body = Body(fem.Basis(mesh, fem.ElementVector(element)), ELASTIC)
    modes = body.rigid_modes
    assert modes.shape == (body.n, {2: 3, 3: 6}[body.dim]) == (body.n, len(body.rigid_mode_names))
    # round-off of assembly
    assert np.abs(body.K @ modes).max() <= 1e-12 * abs(body.K).max()
    assert np.linalg.matrix_rank(modes) == modes.shape[1]
    assert np.abs(modes).max() == pytest.approx(1.0)


def test_rotation_is_counterclockwise_about_the_centroid():
    """The rotation of a unit square about (1/2, 1/2) carries its right side upwards."""
    body = Body(BASIS, ELASTIC)
    rotation = body.rigid_modes[:, 2]
    x = body.dof_points[:, 0]
    assert np.all(rotation[(body.dof_component == 1) & (x > 0.9)] > 0)
    assert rotation[BASIS.get_dofs("right").nodal["u^2"]].tolist() == pytest.approx([1.0] * 5)
    assert rotation[BASIS.get_dofs("left").nodal["u^2"]].tolist() == pytest.approx([-1.0] * 5)


def test_points_and_components_of_dofs_are_those_of_interpolation():
    """The field u = (x, 10 y) has the nodal values that dof_points and dof_component say."""
    for element in (fem.ElementQuad1(), fem.ElementQuad2(), fem.ElementQuadS2()):
        basis = fem.Basis(MESH, fem.ElementVector(element))
        body = Body(basis, ELASTIC)
        u = basis.project(lambda x: np.array([x[0], 10 * x[1]]))
        said = np.where(body.dof_component == 0, body.dof_points[:, 0], 10 * body.dof_points[:, 1])
        np.testing.assert_allclose(said, u, rtol=0, atol=1e-10)  # round-off of the projection


def test_axisymmetric_bodies_move_along_their_axis_only():
    """A measure proportional to the radius leaves one rigid mode, a thickness all three."""
    ring = Body(BASIS, ELASTIC, measure=lambda x: 2 * np.pi * x[0])
    assert ring.axisymmetric and ring.rigid_modes.shape == (ring.n, 1)
    assert ring.rigid_mode_names == ("translation along the axis",)
    assert np.array_equal(ring.rigid_modes[:, 0], ring.dof_component)
    plate = Body(BASIS, ELASTIC, measure=lambda x: 0.1 + 0 * x[0])
    assert not plate.axisymmetric and plate.rigid_modes.shape == (plate.n, 3)


def test_scalar_bodies_have_one_component_and_the_constant():
    """A temperature has one DOF per node; a constant temperature conducts no heat."""
    body = Body(fem.Basis(MESH, fem.ElementQuad1()), laplace)
    assert body.components == 1 and body.rigid_mode_names == ("constant",)
    assert np.abs(body.K @ body.rigid_modes).max() < 1e-12


def test_forms_are_assembled_on_the_basis():
    """Passing forms or what they assemble to is the same body."""
    one = Body(BASIS, ELASTIC, weight)
    two = Body(BASIS, ELASTIC.assemble(BASIS), weight.assemble(BASIS))
    assert abs(one.K - two.K).max() == 0 and np.array_equal(one.f, two.f)
    assert one.f.sum() == pytest.approx(-1.0)


def test_inputs_of_any_type_become_float64_and_are_never_modified():
    """float32, integers, read-only, strided, unsummed inputs: the same body, and left alone."""
    K = ELASTIC.assemble(BASIS)
    rows, cols = K.nonzero()
    half = np.asarray(K[rows, cols]).ravel() / 2
    doubled = sp.csr_array((np.r_[half, half], (np.r_[rows, rows], np.r_[cols, cols])), K.shape)
    doubled = sp.csr_array((doubled.data, doubled.indices.astype(np.int64), doubled.indptr))
    f = np.zeros(2 * BASIS.N, dtype=np.float32)[::2]
    f[3] = 1.5
    f.flags.writeable = False
    before = doubled.data.copy()
    body = Body(BASIS, doubled, f, D=[0, 0, 1], x=np.ones(BASIS.N, dtype=int))
    assert body.f.dtype == body.x.dtype == body.K.dtype == np.float64
    assert isinstance(body.K, sp.csr_matrix) and body.K.indices.dtype == np.int32
    assert abs(body.K - K).max() <= 1e-12 and np.array_equal(body.f, f)
    assert np.array_equal(doubled.data, before)
    assert body.D.tolist() == [0, 1] and body.x.sum() == 2
    with pytest.raises(ValueError, match="read-only"):
        body.f[0] = 7  # the body's own copy, from which results are computed
    assert f[0] == 0


@pytest.mark.parametrize(
    "D",
    [
        "bottom",
        ["bottom"],
        BASIS.get_dofs("bottom"),
        {"one": BASIS.get_dofs("bottom")},
        [BASIS.get_dofs("bottom"), 0],
        np.isin(np.arange(BASIS.N), BASIS.get_dofs("bottom")),
        BASIS.get_dofs("bottom").flatten()[::-1],
    ],
    ids=["name", "names", "view", "dict", "mixed", "mask", "array"],
)
def test_prescribed_dofs_in_every_form(D):
    """Boundary names, views, dicts, masks and numbers of the same DOFs are the same."""
    body = Body(BASIS, ELASTIC, D=D)
    assert np.array_equal(body.D, np.sort(BASIS.get_dofs("bottom").flatten()))
    assert Body(BASIS, ELASTIC).D.size == Body(BASIS, ELASTIC, D=np.array([])).D.size == 0


def test_prescribed_values_count_only_at_prescribed_dofs():
    """Entries of x outside D are ignored, as in skfem.condense, even if they are NaN."""
    x = np.full(BASIS.N, np.nan)
    x[BASIS.get_dofs("bottom").flatten()] = 2.0
    body = Body(BASIS, ELASTIC, D="bottom", x=x)
    assert np.array_equal(body.x != 0, np.isin(np.arange(BASIS.N), body.D))


def broken_mesh() -> fem.MeshQuad:
    p = MESH.p.copy()
    p[0, 3] = np.nan
    return fem.MeshQuad(p, MESH.t)


def spoiled(index: int) -> np.ndarray:
    f = np.zeros(BASIS.N)
    f[index] = np.inf
    return f


P2 = fem.Basis(MESH, fem.ElementVector(fem.ElementQuad2()))
TRI = fem.MeshTri().refined(1)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: Body(MESH, ELASTIC), "MeshQuad1, not a skfem.CellBasis"),
        (lambda: Body(fem.FacetBasis(MESH, BASIS.elem), ELASTIC), "not a skfem.CellBasis"),
        (
            lambda: Body(fem.Basis(TRI, fem.ElementVector(fem.ElementTriCR())), ELASTIC),
            "uses ElementTriCR: contact needs elements whose DOFs are values at nodes",
        ),
        (lambda: Body(fem.Basis(TRI, fem.ElementTriArgyris()), laplace), "ElementTriArgyris"),
        (
            lambda: Body(fem.Basis(TRI, fem.ElementDG(fem.ElementTriP1())), laplace),
            "uses ElementDG",
        ),
        (
            lambda: Body(fem.Basis(MESH, fem.ElementVector(fem.ElementQuad1(), 3)), sp.eye(75)),
            "3 components in 2-D",
        ),
        (
            lambda: Body(fem.Basis(MESH, BASIS.elem, elements=[0, 1]), ELASTIC),
            "covers 2 of 16 elements",
        ),
        (lambda: Body(BASIS, ELASTIC.assemble(P2)), "K belongs to another basis"),
        (lambda: Body(BASIS, lambda u, v, w: 0), "decorate the function"),
        (lambda: Body(BASIS, J2(1.0, 0.3, 0.1)), "take sc.NonlinearBody for this material"),
        (lambda: Body(BASIS, (1.0, 0.3)), r"write sc.Elastic\(1.0, 0.3\) if these are E and nu"),
        (lambda: Body(BASIS, 1j * sp.eye(BASIS.N)), "complex128, contact needs real"),
        (lambda: Body(BASIS, np.nan * sp.eye(BASIS.N)), "K of a body holds NaN .* in row 0"),
        (lambda: Body(BASIS, ELASTIC, np.ones(3)), r"f of a body has shape \(3,\), .* 50 DOFs"),
        (lambda: Body(BASIS, ELASTIC, spoiled(4)), "1 of 50 entries, the first in DOF 4"),
        (lambda: Body(BASIS, ELASTIC, lambda v, w: 0), "assemble a skfem.LinearForm"),
        (lambda: Body(BASIS, ELASTIC, D=[0, 4], x=spoiled(4)), "x of a body holds NaN"),
        (lambda: Body(BASIS, ELASTIC, x=np.zeros(BASIS.N)), "does not say at which DOFs"),
        (lambda: Body(BASIS, ELASTIC, D="botom", name="A"), "body 'A': .*did you mean 'bottom'"),
        (lambda: Body(BASIS, ELASTIC, D=[50]), "DOFs 0 to 49; D belongs to another basis"),
        (lambda: Body(BASIS, ELASTIC, D=P2.get_dofs("top")), "taken from a basis with 162 DOFs"),
        (lambda: Body(BASIS, ELASTIC, D=np.array([0.5])), "not of DOF numbers"),
        (lambda: Body(BASIS, ELASTIC, measure=0.1), "pass measure=lambda x: 0.1"),
        (lambda: Body(BASIS, ELASTIC, name=3), "not a string"),
        (lambda: Body(BASIS, ELASTIC, springs=1.0), "add their matrix to K"),
        (lambda: Body(BASIS, ELASTIC, density=1.0), "write mass=density"),
    ],
)
def test_what_is_no_body_is_refused_by_name(make, message):
    """Wrong elements, shapes, numbers and names are errors that say what was found."""
    with pytest.raises(InputError, match=message):
        make()


def test_nan_coordinates_are_named():
    """A NaN in the mesh is found before anything is assembled."""
    with np.errstate(invalid="ignore"):
        basis = fem.Basis(broken_mesh(), fem.ElementVector(fem.ElementQuad1()))
    with pytest.raises(InputError, match=r"1 nodes of the mesh .* node 3 at"):
        Body(basis, sp.eye(basis.N))


def test_missing_default_tags_are_explained():
    """A mesh without tags says where the usual names come from."""
    basis = fem.Basis(fem.MeshQuad(), fem.ElementVector(fem.ElementQuad1()))
    with pytest.raises(InputError, match=r"no boundaries with a name .*with_defaults.*names\)$"):
        Body(basis, ELASTIC, D="left")
    curved = fem.Basis(fem.MeshTri2(), fem.ElementVector(fem.ElementTriP2()))
    with pytest.raises(InputError, match=r"with a name\. .* second-order files: sc\.read_bodies"):
        Body(curved, ELASTIC, D="rim")


def test_unsymmetric_stiffness_is_refused():
    """skfem.enforce breaks symmetry: no direct solver takes that, so the body does not either."""
    K = fem.enforce(ELASTIC.assemble(BASIS), D=BASIS.get_dofs("bottom"))
    with pytest.raises(InputError, match=r"K of a body is not symmetric.*skfem\.enforce"):
        Body(BASIS, K)


@pytest.mark.parametrize("size", [2e-7, 9e-7])
def test_round_off_of_assembly_is_made_symmetric(size):
    """A stiffness of single precision is not symmetric in its last digits; what passes is solved."""
    K = ELASTIC.assemble(BASIS).tolil()
    i, j = np.argwhere(K.toarray() > 0)[1]
    K[i, j] += size * abs(K.toarray()).max()
    given = K.tocsr()
    body = Body(BASIS, given, D="top", x=np.where(np.arange(BASIS.N) % 2, -0.01, 0.0))
    assert abs(body.K - body.K.T).max() <= 1e-15 * abs(body.K).max()
    assert abs(body.K - 0.5 * (given + given.T)).max() <= 1e-15 * abs(body.K).max()
    floor = RigidPlane((0, 0), (0, 1))
    result = ContactSolver(body, Contact(body.surface("bottom"), floor)).solve()
    assert result.certificate.worst < 1e-10
    assert body.K is not given and Body(BASIS, ELASTIC.assemble(BASIS)).K.nnz == given.nnz


def test_stack_numbers_one_body_after_the_other():
    """The stacked system is the block diagonal one, with shifted prescribed DOFs."""
    a = Body(BASIS, ELASTIC, weight, D="bottom", name="a")
    b = Body(P2, ELASTIC, D="top", x=np.ones(P2.N))
    system = stack([a, b])
    assert system.names == ("a", "body 2") and system.n == a.n + b.n
    assert abs(system.K - sp.block_diag([a.K, b.K])).max() == 0
    assert isinstance(system.K, sp.csr_matrix) and system.K.indices.dtype == np.int32
    for vector, parts in ((system.f, (a.f, b.f)), (system.x, (a.x, b.x))):
        assert np.array_equal(vector[system.slice(a)], parts[0])
        assert np.array_equal(vector[system.slice("body 2")], parts[1])
    assert np.array_equal(system.D, np.r_[a.D, b.D + a.n])
    assert system.index(b) == system.index("body 2") == 1
    assert stack(a).n == a.n


def test_bodies_that_can_not_be_stacked():
    """Repeated bodies, repeated names and mixed dimensions are errors; so are unknown ones."""
    a, b = Body(BASIS, ELASTIC, name="punch"), Body(BASIS, ELASTIC, name="punch")
    solid = Body(fem.Basis(fem.MeshHex(), fem.ElementVector(fem.ElementHex1())), ELASTIC)
    for bodies, message in [
        ([], "no bodies"),
        ([a, a], "given twice"),
        ([a, b], "several bodies are named 'punch'"),
        ([a, solid], "'punch' 2-D, 'body 2' 3-D"),
        ([a, BASIS], "not a Body"),
    ]:
        with pytest.raises(InputError, match=message):
            stack(bodies)
    with pytest.raises(InputError, match="did you mean 'punch'"):
        stack([a]).index("punsh")
    with pytest.raises(InputError, match="not one of the stacked bodies"):
        stack([a]).index(b)


def test_the_solver_asks_a_body_for_its_equations_once():
    """A body with a prestress near its undeformed state: the solver solves what `linearize` says."""
    asked = []

    class Prestressed(Body):
        def linearize(self, u=None, state=None):
            asked.append(u)
            answer = super().linearize(u, state)
            return answer._replace(internal=answer.internal - pull)

    def solver(kind, f):
        block = kind(BASIS, ELASTIC, f, D=BASIS.get_dofs("left").all("u^1"), name="block")
        return ContactSolver([block], [Contact(block.surface("bottom"), RigidPlane((0, 0), (0, 1)))])

    load = 1e-3 * weight.assemble(BASIS)
    pull = 0.5 * load
    told, plain = solver(Prestressed, load), solver(Body, 1.5 * load)
    results = [s.solve() for s in (told, told, plain)]
    assert asked == [None]
    np.testing.assert_array_equal(results[0].u, results[2].u)
    assert results[0].force[1] == pytest.approx(1.5e-3, rel=1e-12)  # the weight of a unit square


@pytest.mark.parametrize(
    "element",
    [fem.ElementHex1(), fem.ElementHexS2(), fem.ElementHex2()],
    ids=lambda e: type(e).__name__,
)
def test_components_of_boundaries_are_held_by_name(element):
    """A list joins boundaries, components by name and DOFs; scikit-fem's numbers are the other way."""
    basis = fem.Basis(fem.MeshHex().refined(1).with_defaults(), fem.ElementVector(element))
    point = basis.nodal_dofs[1, :1]
    body = Body(basis, ELASTIC, D=["back", {"left": "x", "bottom": ("y", "z")}, point])
    sides = {"back": ["u^1", "u^2", "u^3"], "left": ["u^1"], "bottom": ["u^2", "u^3"]}
    parts = [basis.get_dofs(side).all(names) for side, names in sides.items()]
    np.testing.assert_array_equal(body.D, np.unique(np.concatenate([*parts, point])))


def test_pieces_are_those_that_elements_join_one_after_the_other():
    """Random elements in any order; numbers go up with the first DOF of each piece."""
    random = np.random.default_rng(2)
    seen = set()
    for count in [*range(1, 12)] * 5:
        n = int(random.integers(3, 9))
        elements = random.integers(0, n, (3, count))
        labels = np.arange(n)
        for _ in range(n):
            for element in elements.T:
                labels[element] = labels[element].min()
        assert np.array_equal(pieces(elements, n), np.unique(labels, return_inverse=True)[1])
        seen.add(len(np.unique(labels)))
    assert {1, 2, 3} <= seen
