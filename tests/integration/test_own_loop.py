"""A loop of one's own: the recorder makes of it what ``simulate`` makes of its own."""

from dataclasses import fields

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.options import FREE_PLANNER
from template_control.errors import ParameterError
from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.robot.start import state_at_vlo
from template_control.run.experiment import Experiment
from template_control.run.record import FloatingRecord
from template_control.run.simulation import simulate
from template_control.run.start import start

STEPS = 2
DT = 1e-3


def looped(controller, plant, q, v):
    """A recorder of ``STEPS`` steps, with the snapshots after each tick."""
    recorder, snapshots = tc.Recorder(controller), []
    robot = controller.robot
    force = np.zeros((2, robot.directions))
    plant.reset(q, v)
    while len(controller.reports) <= STEPS:
        plant.read(q, v)
        plant.contact_forces(force)
        contact = force[:, -1] > 0.005 * robot.mass * robot.gravity
        solution = controller.tick(q, v, contact, DT, force)
        recorder.tick(q, v, force, solution)
        snapshots.append(controller.snapshot())
        plant.step(solution.torque)
    return recorder, snapshots


@pytest.fixture(scope="module")
def planar(default_gait):
    """Recorder and snapshots of the default walk of five-link."""
    robot = tc.load_robot("five-link")
    planner = tc.LqrPlanner(default_gait)
    controller = tc.EmbeddingController(robot, planner)
    z, shape = planner.gait.vlo, controller.swings.towards(controller.supervisor.first_goal())
    swing = np.array([0.0, shape.clearance]), np.array([2.0 * z[0], 0.0])
    q, v = state_at_vlo(robot, z, 0, *swing, controller.first_pitch())
    controller.start()
    with BulletPlant(robot, PlantOptions()) as plant:
        return looped(controller, plant, q, v)


@pytest.fixture(scope="module")
def floating():
    """Recorder and snapshots of a floating-base walk of Bolt."""
    robot = tc.load_floating_robot("bolt")
    planner = tc.LqrPlanner(tc.robot_gait_for_speed(robot, 0.6), FREE_PLANNER)
    options = Experiment(robot, planner=planner).prepare()
    controller = tc.EmbeddingController(robot, planner, options.tuning)
    q, v = start(controller, options)
    with BulletPlant(robot, PlantOptions()) as plant:
        return looped(controller, plant, q, v)


def test_a_loop_of_ones_own_is_recorded_as_simulate_does(planar, default_gait):
    record = planar[0].record()
    robot = tc.load_robot("five-link")
    other = simulate(Experiment(robot, planner=tc.LqrPlanner(default_gait), steps=STEPS))
    for field in fields(record):
        if field.name == "metadata" or field.name.endswith("_seconds"):
            continue
        mine, theirs = (getattr(r, field.name)[: len(record.time)] for r in (record, other))
        np.testing.assert_allclose(mine, theirs, rtol=0.0, atol=1e-12, err_msg=field.name)
    assert record.kinds_of_stride == other.kinds_of_stride
    assert record.duration == pytest.approx(len(record.time) * DT)
    assert (record.fell, record.plant, record.planner) == (False, "", "LqrPlanner")
    assert record.summary.joint_torque["left_knee"].peak <= np.abs(other.torque).max()


def test_a_snapshot_is_what_the_record_has_of_a_tick(planar):
    recorder, snapshots = planar
    record = recorder.record("tripped")
    assert record.fall_reason == "tripped"
    for name in ("template_com", "template_velocity", "template_force", "swing_reference"):
        kept = np.array([getattr(snapshot, name) for snapshot in snapshots])
        np.testing.assert_array_equal(getattr(record, name), kept)
    assert [record.nodes[i] for i in record.node] == [snapshot.node for snapshot in snapshots]
    times = [snapshot.time for snapshot in snapshots]
    np.testing.assert_allclose(np.diff(times), DT)


def test_a_floating_base_loop_is_read_back_by_the_same_names(floating, tmp_path):
    recorder, snapshots = floating
    record = recorder.record()
    assert isinstance(record, FloatingRecord)
    np.testing.assert_array_equal([snapshot.sway for snapshot in snapshots], record.sway)
    for read in (tc.load_record, tc.Record.load, FloatingRecord.load):
        again = read(record.save(tmp_path / "run.npz"))
        assert isinstance(again, FloatingRecord)
        np.testing.assert_array_equal(again.sway, record.sway)
        assert again.summary == record.summary
    assert again.to_dataframe()["space_com_z"].min() > 0.2


def test_a_recorder_of_a_controller_that_has_not_started_is_refused(default_gait):
    controller = tc.EmbeddingController(tc.load_robot("five-link"), tc.LqrPlanner(default_gait))
    with pytest.raises(ParameterError, match="has started: start it first"):
        tc.Recorder(controller)


def test_a_run_without_a_tick_is_a_record_too(planar, default_gait):
    controller = planar[0].controller
    record = tc.Recorder(controller).record("never began")
    assert (len(record.time), record.ticks, record.duration) == (0, 0, 0.0)
    assert record.fell
