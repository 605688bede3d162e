"""The judge of random solids: scenes it finds right, and that it sees what is spoiled on purpose."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import judge_solids as bench
from solid_checks import Court
from solid_oracle import against_oracle, fits
from solid_scenes import BodySpec, ContactSpec, Height, Scene, Way, build, make, scene, turned

PRESSED = ((2e-4, 1e-4, -8e-4), (-2e-4, 2e-4, -1e-3))


def stack(method: str, element: str = "hex Q1", **settings) -> Scene:
    """A smaller block on a clamped one, its faces not matching, pressed and moved sideways, turned."""
    middle, top = Height(0.6, 0.1, -0.05), Height(1.2)
    bodies = (
        BodySpec(
            "body0",
            element,
            (3, 3, 2),
            (0.0, 0.0),
            (1.0, 1.0),
            Height(0.0),
            middle,
            1.0,
            0.3,
            clamped=("bottom",),
        ),
        BodySpec("body1", "hex Q1", (2, 3, 1), (0.2, 0.1), (0.6, 0.7), middle, top, 2.0, 0.2),
    )
    joint = ContactSpec("joint1", ("body1", "bottom"), ("body0", "top"), method=method, **settings)
    turn = ((0.36, 0.48, -0.8), (-0.8, 0.6, 0.0), (0.48, 0.64, 0.6))
    return Scene(0, bodies, (joint,), "x", PRESSED, turn, (0.3, -0.2, 0.1))


def found(truth: Scene, told: Scene | None = None, spoil=None) -> set[str]:
    """Names of what the judge finds, the answers coming from another scene, or spoiled."""
    run = bench.run(told or truth)
    assert run.error is None
    answers = run.answers if spoil is None else [spoil(a) for a in run.answers]
    return {f.check for f in Court(truth, make(truth)).examine(answers)}


def reported(answer, **changes):
    """The answer with what it reports of its contact changed."""
    told = answer.contacts["joint1"]
    new = {name: change(getattr(told, name)) for name, change in changes.items()}
    return replace(answer, contacts={"joint1": replace(told, **new)})


@pytest.mark.parametrize("method", ["mortar", "node"])
@pytest.mark.parametrize("element", ["hex Q1", "tet P1", "hex Q2"])
@pytest.mark.parametrize("tied", [False, True])
def test_nothing_is_found_on_right_answers(method, element, tied):
    """Solids pressed together satisfy all that is asked of them."""
    assert found(stack(method, element, tied=tied)) == set()


@pytest.mark.parametrize("method", ["mortar", "node"])
class TestSpoiled:
    """Answers spoiled on purpose are found wrong, and for the right reason."""

    def test_reported_forces_a_tenth_too_large(self, method):
        assert "balance" in found(
            stack(method),
            spoil=lambda a: reported(a, force=lambda v: 1.1 * v, forces=lambda v: 1.1 * v),
        )

    def test_moments_about_another_point(self, method):
        def spoil(a):
            force = a.contacts["joint1"].force
            return reported(a, moment=lambda v: v + np.cross([0.01, 0.0, 0.0], force))

        assert "moment" in found(stack(method), spoil=spoil)

    def test_a_point_that_pulls(self, method):
        def spoil(a):
            return reported(
                a, forces=lambda v: v * np.where(np.arange(len(v)) == v[:, 0].argmax(), -1, 1)[:, None]
            )

        assert "compression" in found(stack(method), spoil=spoil)

    def test_glue_in_place_of_contact(self, method):
        """Glue carries shear, which smooth contact may not."""
        assert "bound" in found(stack(method), stack(method, tied=True))

    def test_contact_in_place_of_glue(self, method):
        assert "glue" in found(stack(method, tied=True), stack(method))

    def test_interference_that_is_not_there(self, method):
        told = stack(method, interference=3e-4)
        assert found(stack(method), told) & {"gap", "overlap"}

    def test_interference_that_is_missed(self, method):
        assert found(stack(method, interference=3e-4), stack(method)) & {"gap", "overlap"}

    def test_another_material(self, method):
        truth = stack(method)
        soft = replace(truth, bodies=(replace(truth.bodies[0], nu=0.2), truth.bodies[1]))
        assert "equilibrium" in found(truth, soft)

    def test_another_load(self, method):
        truth = stack(method)
        assert "supports" in found(truth, replace(truth, steps=PRESSED[::-1]))


@pytest.mark.parametrize("element", ["hex Q1", "tet P1"])
def test_the_own_solution(element):
    """Least squares with bounds give the library's forces, and other ones a gap of 1e-6 more."""
    s = stack("node", element)
    assert fits(s)
    made, answers = make(s), bench.run(s).answers
    assert against_oracle(s, made, answers) == []
    other = bench.run(stack("node", element, interference=1e-6)).answers
    assert len(against_oracle(s, made, other)) == len(PRESSED)


@pytest.mark.parametrize("seed", [3, 5, 9, 11])
def test_random_scenes(seed):
    """Some scenes of the run that is stored."""
    assert bench.judge(seed, friction=False).kind in ("right", "warned")


@pytest.mark.filterwarnings("ignore::skfem_contact.ContactWarning")  # 7 slides far
@pytest.mark.parametrize("seed, way", [(7, Way(shuffle=1)), (12, Way(turn=1))])
def test_the_area_of_contact_follows_neither_numbering_nor_direction(seed, way):
    """Nodes with several heirs, and open nodes on one line: it was 18 % and 1 % off."""
    areas = []
    for other in (Way(), way):
        s = turned(scene(seed, friction=False), other.turn)
        solver, steps = build(s, make(s, other.shuffle), other)
        areas.append(
            [
                [c.contact_area for c in (result[spec.name] for spec in s.contacts)]
                for result in solver.history(steps)
            ]
        )
    np.testing.assert_allclose(areas[0], areas[1], rtol=1e-6)


def test_the_stored_run_is_on_the_page():
    """The documentation has the table of the stored run, and nothing in it is wrong."""
    stored = json.loads(bench.STORED.read_text(encoding="utf-8"))
    assert stored["kinds"]["WRONG"] == 0
    assert sum(stored["kinds"].values()) == stored["scenes"]
    assert bench.table(stored) in bench.PAGE.read_text(encoding="utf-8")
