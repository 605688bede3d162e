"""Tables of joints and of load cases."""

import sys
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
import skfem as fem
from bolted import TIGHTEN, stack, upright
from rectangles import rectangle
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc


def pushed(tilt=0.0):
    """A block of 2 by 1, pressed on the floor by 2 p and pushed aside; a block that is glued on it."""
    low = sc.Body(
        rectangle(np.linspace(0, 2, 9), np.linspace(0, 1, 5)), linear_elasticity(0.0, 500.0), name="low"
    )
    top = sc.Body(
        rectangle(np.linspace(0, 2, 7), np.linspace(1, 2, 4)), linear_elasticity(0.0, 500.0), name="top"
    )
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    foot = sc.Contact(low.surface("bottom"), floor, friction=sc.Coulomb(0.5), name="foot")
    glue = sc.Contact(top.surface("bottom"), low.surface("top"), tied=True, name="glue")
    solver = sc.ContactSolver([low, top], [foot, glue])
    return solver, [{"f": {"top": {"top": (0.0, -10.0)}}}, {"f": {"top": {"top": (1.0 + tilt, -10.0)}}}]


def test_the_row_of_a_joint_against_statics():
    """Pressed by 20 and pushed by 2 at height 2: moment 4, margin 1 - 2 / 10."""
    solver, steps = pushed()
    *_, result = solver.history(steps)
    foot, glue = result.joints()
    np.testing.assert_allclose(foot.force, [-2.0, 20.0], atol=1e-10)
    # the floor takes up the moment of the push about the middle of the foot
    assert foot.moment == pytest.approx(2.0 * 2.0, rel=1e-9)
    assert glue.moment == pytest.approx(2.0 * 1.0, rel=1e-9)
    assert foot.closed == 1.0
    assert foot.slip_margin == pytest.approx(1 - 2.0 / (0.5 * 20.0), rel=1e-9)
    values = result["foot"]
    assert foot.sticking == pytest.approx(values.area[values.status == 1].sum() / 2.0)
    assert foot.mean_pressure == pytest.approx(10.0, rel=1e-9)
    assert foot.largest_pressure == values.pressure.max()
    assert foot.energy == values.dissipation_total
    assert np.isnan(glue.slip_margin) and np.isnan(glue.sticking)
    assert result.joints()["glue"].name == "glue" and len(result.joints()) == 2
    with pytest.raises(
        sc.errors.InputError, match="no 'head' among the joints; Known joints: 'foot', 'glue'"
    ):
        result.joints()["head"]


def test_most_points_slip_before_the_joint_does():
    """The margin by resultants and by points tell different things: of bolted plates both are told."""
    joint = upright()[1].joints()["joint"]
    assert 0 < joint.sticking <= 1 and 0 < joint.slip_margin < 1
    assert joint.moment.shape == (3,)


def test_joints_of_axisymmetric_bodies():
    """A disc of radius 2 pressed by 3 carries the force of the full circle, with friction to spare."""
    element, full = fem.ElementVector(fem.ElementQuad1()), lambda x: 2 * np.pi * x[0]
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 2, 5), np.linspace(0, 2, 4)).with_defaults()

    def disc(y, name, *held):
        basis = fem.Basis(mesh.translated((0, y)), element, intorder=4)
        D = np.concatenate(
            [basis.get_dofs("left").all("u^1"), *(basis.get_dofs(s).all("u^2") for s in held)]
        )
        return sc.Body(basis, sc.Elastic(1e3, 0.3), D=D, measure=full, name=name)

    discs = [disc(0, "low", "bottom"), disc(2, "high")]
    pairs = sc.find_contacts(discs, within=0.1, friction=sc.Coulomb(0.2))
    (result,) = sc.ContactSolver(discs, pairs).history([{"f": {"high": {"top": 3.0}}}])
    joint = result.joints()["low - high"]
    np.testing.assert_allclose(joint.force, [0, -12 * np.pi], atol=1e-10)
    assert joint.closed == 1.0 and joint.slip_margin == pytest.approx(1.0)
    assert joint.mean_pressure == pytest.approx(3.0, rel=1e-9)
    assert np.isnan([joint.moment, result.reaction_moment("low", "bottom")]).all()  # none, on a ring


def test_tables_print(monkeypatch):
    """In text, in notebooks, and by pandas where it is there."""
    solver, steps = pushed()
    *_, result = solver.history(steps)
    table = result.joints()
    head, foot, glue = str(table).splitlines()
    assert head.split()[:4] == ["joint", "force", "moment", "closed"]
    assert foot.startswith("foot   (-2, 20)") and glue.count(" - ") == 2
    assert table._repr_html_().count("<tr>") == 3 and "<td>foot</td>" in table._repr_html_()
    made = SimpleNamespace(DataFrame=dict)
    monkeypatch.setitem(sys.modules, "pandas", made)
    frame = table.to_frame()
    assert list(frame)[:4] == ["joint", "force x", "force y", "moment"]
    assert frame["force y"][0] == pytest.approx(20.0)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(sc.errors.InputError, match="pandas is not installed"):
        table.to_frame()


def test_load_cases_begin_from_the_same_state():
    """Each case is the step from the preloaded state, whatever the others are."""
    solver = stack()
    (tight,) = solver.history([TIGHTEN])
    steps = {name: {"f": {"head": {"y": pull}}} for name, pull in (("low", 5.0), ("high", 12.4))}
    cases = solver.cases(steps, start=tight)
    assert cases.names == ("low", "high") and len(cases) == 2
    assert cases["high"].bolts["M"].force == pytest.approx(12.48, rel=1e-9)
    assert cases["low"].bolts["M"].force == pytest.approx(11.0, rel=1e-9)
    head, low, high = str(cases).splitlines()
    assert head.split()[:2] == ["case", "M"]
    assert low.split()[:2] == ["low", "11"] and high.split()[:2] == ["high", "12.48"]
    with pytest.raises(sc.errors.InputError, match=r"cases are .* give a dict"):
        solver.cases([5.0], start=tight)
    with pytest.raises(sc.errors.InputError, match=r"cases are \{\}"):
        solver.cases({}, start=tight)


def test_all_joints_in_one_figure():
    """A picture for each contact, in the plane and in space."""
    for result in (stack().solve(), upright()[0]):
        figure = sc.output.plot_joints(result)
        shown = [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]
        assert len(shown) == len(result)
        plt.close(figure)
