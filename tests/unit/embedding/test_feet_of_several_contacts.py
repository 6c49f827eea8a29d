"""Feet of several contacts: when they stand, and where their contacts are in the air."""

from dataclasses import replace

import numpy as np
import pytest
from contact_flags import take_in

from template_control.embedding.modes import modes
from template_control.embedding.options import EmbeddingOptions, robot_kind
from template_control.embedding.swing import FEET, spread_contacts
from template_control.embedding.tick import TICK, stand
from template_control.estimation.contacts import CONTACTS, ContactOptions, set_contacts
from template_control.robot.library import load_floating_robot, load_robot
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import Experiment
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale
from template_control.whole_body.problem import QP_DATA
from template_control.whole_body.task import References

PAIRS = ((0, 3), (1, 2))
DT, STEP = 1e-3, 0.3


def flags(*touching):
    return np.isin(np.arange(4), touching)


def test_a_foot_stands_on_one_of_its_contacts():
    contacts, scale = np.zeros(1, CONTACTS), Scale.of(SlipParameters())
    set_contacts(contacts, ContactOptions(doubt=0.004), 100.0, scale, PAIRS)
    assert take_in(contacts, flags(3), None, (None, False), DT).tolist() == [True, False]
    assert contacts["touching"][0, :4].tolist() == [0, 0, 0, 1]
    take_in(contacts, flags(0, 3), None, (True, False), DT)
    assert contacts["touching"][0, :4].tolist() == [1, 0, 0, 1]
    # One that nobody expects is doubted; a foot that leaves has to leave with all of them.
    assert take_in(contacts, flags(0, 2, 3), None, (True, False), DT).tolist() == [True, False]
    assert take_in(contacts, flags(3), None, (False, False), DT).tolist() == [True, False]
    assert take_in(contacts, flags(), None, (False, False), DT).tolist() == [False, False]


@pytest.mark.parametrize(
    ("kind", "node", "bears"),
    [
        ("free", "SS_sc^r", []),
        ("free", "SS_av^w", [0]),
        ("trot", "SS_sc^r", []),
        ("trot", "SS_av^w", [0]),
    ],
)
def test_a_foot_that_has_bounced_bears_nothing_in_a_run(kind, node, bears):
    robot = load_floating_robot("bolt")
    tick, qp = np.zeros(1, TICK), np.zeros(1, QP_DATA)
    tick["mode"] = modes(AUTOMATON, robot.nv, EmbeddingOptions.of_kind(kind).phase_table())[
        node
    ].data
    tick["feet"]["roles"] = 0, 1
    stand(tick, robot.data, References().data, qp)
    assert qp["contact"][0, : int(qp["contacts"][0])].tolist() == bears
    tick["contacts"]["touching"][0, 0] = 1
    stand(tick, robot.data, References().data, qp)
    assert qp["contact"][0, : int(qp["contacts"][0])].tolist() == [0]


def offsets(swung, yaw=0.0):
    """(4, 3, 3) of Go2's contacts, ``swung`` seconds after a pair lifted off 2 cm further apart."""
    robot, feet = load_floating_robot("go2"), np.zeros(1, FEET)
    feet["spread"][0, :4] = robot.spread
    feet["lifted"][0, :4, :2] = 1.1 * robot.spread
    feet["swing_time"][0, 0] = swung
    offset = References().offset
    spread_contacts(feet[0], 0, robot.data[0], yaw, STEP, offset)
    return offset[:4].copy(), robot.spread


def test_contacts_return_to_their_places_in_half_a_step():
    first, spread = offsets(0.0)
    np.testing.assert_allclose(first[[0, 3], :2, 0], 1.1 * spread[[0, 3]], atol=1e-12)
    np.testing.assert_allclose(first[:, :, 1:], 0.0, atol=1e-12)
    for swung in (0.5 * STEP, STEP, np.inf):
        last, _ = offsets(swung)
        np.testing.assert_allclose(last[[0, 3], :2, 0], spread[[0, 3]], atol=1e-12)
        np.testing.assert_allclose(last[:, :, 1:], 0.0, atol=1e-9)
    assert not last[[1, 2]].any(), "the other pair's"


def test_their_velocities_are_the_derivatives_of_their_places():
    h = 1e-5
    for swung in (0.02, 0.07, 0.13):
        before, now, after = (offsets(swung + dt)[0] for dt in (-h, 0.0, h))
        for order in (0, 1):
            slope = (after[:, :, order] - before[:, :, order]) / (2.0 * h)
            np.testing.assert_allclose(now[:, :, order + 1], slope, atol=1e-5)


def test_their_places_turn_with_the_trunk():
    angle = 0.3
    turned, spread = offsets(STEP, angle)
    c, s = np.cos(angle), np.sin(angle)
    np.testing.assert_allclose(turned[0, :2, 0], spread[0] @ [[c, s], [-s, c]], atol=1e-12)


@pytest.mark.parametrize(
    ("robot", "kind"),
    [
        (RobotSpec("go2", free=True), "trot"),
        (RobotSpec("bolt", free=True), "free"),
        (RobotSpec("bolt"), "planar"),
    ],
)
def test_each_kind_of_robot_has_its_own_tuning(robot, kind, tmp_path):
    experiment = Experiment(robot)
    assert experiment.tuning == EmbeddingOptions.of_kind(kind)
    assert robot_kind(robot.load()) == kind
    assert experiment.with_({"robot.gravity": 1.62}).tuning == EmbeddingOptions.of_kind(kind)
    saved = experiment.save(tmp_path / "run.toml")
    assert Experiment.load(saved) == experiment.resolved()


def test_another_robot_takes_another_tuning():
    experiment = Experiment(RobotSpec("bolt", free=True)).resolved()
    assert experiment.with_({"robot.model": "go2"}).tuning == EmbeddingOptions.of_kind("trot")
    own = replace(experiment, robot=load_robot("five-link"), controller=None)
    assert own.tuning == EmbeddingOptions()
