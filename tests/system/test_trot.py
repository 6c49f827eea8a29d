"""Quadrupeds trot on the planar template: diagonal pairs of legs are its two legs."""

import numpy as np
import pytest

import template_control as tc
from template_control.cli.main import main
from template_control.errors import ScenarioError
from template_control.plant.bullet import PlantOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.robot.spec import RobotSpec
from template_control.run.options import Push
from template_control.run.robot_route import robot_route
from template_control.run.specs import GaitSpec
from template_control.slip.scenario.scenario import Scenario, Segment

PACE = ((0, 2), (1, 3))
"""The pairs of Go2's feet on its left and on its right."""


def trot(name, gait, speed, steps, groups=(), **options):
    robot = RobotSpec(name, groups=groups).load()
    return tc.simulate(
        tc.Experiment(robot, motion=GaitSpec(gait, speed=speed), steps=steps, **options)
    )


def check_trot(record, tilt=0.02):
    """It stays on its feet, with a level trunk, within its motors' limits."""
    assert not record.fell, record.fall_reason
    assert record.solved.all()
    later = record.time > record.section_time[4]
    assert np.sqrt(np.mean(record.attitude[later] ** 2, axis=0)).max() < tilt
    assert np.all(np.abs(record.torque) <= record.torque_limit + 1e-9)
    # The pairs bear in turn, each with both of its feet.
    load = record.contact_force[later][:, :, 1]
    pairs = [load[:, list(group)] for group in record.groups]
    for pair in pairs:
        np.testing.assert_allclose(*pair.mean(axis=0), rtol=0.3)
    return load, pairs


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(
    ("name", "groups", "speed"), [("go2", PACE, 0.9), ("go2", (), 2.0), ("solo12", (), 0.8)]
)
def test_a_running_trot_or_pace_keeps_its_speed(name, groups, speed):
    record = trot(name, "run", speed, 24, groups)
    assert record.groups == (groups or ((0, 3), (1, 2)))
    load, pairs = check_trot(record)
    np.testing.assert_allclose(record.section_state[-6:, 0], speed, rtol=0.02)
    both = (pairs[0].max(axis=1) > 1.0) & (pairs[1].max(axis=1) > 1.0)
    assert both.mean() < 0.01
    assert (load.max(axis=1) == 0.0).mean() > 0.05, "it flies between the stances"


@pytest.mark.slow(seconds=4)
def test_a_walking_trot_keeps_its_speed():
    record = trot("go2", "walk", 0.5, 16)
    load, _ = check_trot(record)
    way = np.interp(record.section_time[[6, -1]], record.time, record.com[:, 0])
    speed = np.diff(way) / np.diff(record.section_time[[6, -1]])
    np.testing.assert_allclose(speed, 0.5, rtol=0.03)
    assert (load.max(axis=1) > 0.0).all()
    assert (load.min(axis=1) > 0.0).any(), "in double stance all four feet bear"


@pytest.mark.slow(seconds=6)
def test_it_trots_in_mujoco():
    record = trot("go2", "run", 1.5, 12, world=MujocoOptions())
    check_trot(record)
    np.testing.assert_allclose(record.section_state[-4:, 0], 1.5, rtol=0.02)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("direction", [90.0, 225.0])
def test_a_push_is_run_off(direction):
    # 40 N s on the reference template, a third of a metre per second.
    push = Push(4.7, step=5, phase=0.25, duration=0.06, direction=np.radians(direction))
    record = trot("go2", "run", 1.5, 18, pushes=(push,))
    assert not record.fell, record.fall_reason
    np.testing.assert_allclose(record.section_state[-3:, 0], 1.5, rtol=0.02)
    assert abs(record.com_velocity[-1, 0]) > 1.0


@pytest.mark.slow(seconds=4)
def test_commands_show_a_trot(tmp_path, capsys):
    command = ["run", "--robot", "go2", "--floating-base", "--speed", "1.5", "--steps", "5"]
    assert main([*command, "--output", str(tmp_path)]) == 0
    assert (tmp_path / "forces.png").exists()
    assert "FR_calf_joint" in capsys.readouterr().out
    record = tc.load_record(tmp_path / "run.npz")
    assert record.foot.shape[1:] == (4, 2)
    assert record.groups == ((0, 3), (1, 2))
    columns = record.to_dataframe().columns
    assert {"foot_RL_foot_y", "contact_force_FL_foot_x"} <= set(columns)
    assert {"swing_reference_FL_foot+RR_foot_x", "space_foot_RR_foot_z"} <= set(columns)
    film = ["replay", str(tmp_path / "run.npz"), "--end", "0.3"]
    assert main([*film, "--html", str(tmp_path / "trot.html")]) == 0
    assert main([*film, "--gif", str(tmp_path / "trot.gif")]) == 0


def going(*segments, **options):
    """Go2 through a scenario that begins at rest."""
    scenario = Scenario(segments=segments, start=(0.5, 0.98, 0.0), vlo=(0.98, 0.0))
    robot = tc.load_floating_robot("go2")
    return tc.simulate(tc.Experiment(robot, motion=scenario, **options))


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("world", [PlantOptions(), MujocoOptions()], ids=["bullet", "mujoco"])
def test_it_starts_trots_and_stops(world):
    stand = Segment("stand", duration=0.4)
    record = going(stand, Segment("walk", speed=0.5, steps=3), stand, world=world)
    assert not record.fell, record.fall_reason
    assert record.solved.all()
    assert np.abs(record.attitude).max() < 0.02
    moving = record.section_state[record.section_state[:, 0] > 0.1, 0]
    np.testing.assert_allclose(moving, 0.5, rtol=0.06)
    assert len(moving) == 4, "the start leads to the walk's own speed, and the stop from it"
    last = record.time > record.time[-1] - 0.2
    assert np.ptp(record.com[last], axis=0).max() < 1e-3
    assert (record.contact_force[-1, :, 1] > 10.0).all(), "all four feet bear"


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("direction", [0.0, 90.0, 225.0])
def test_a_stand_is_pushed(direction):
    push = Push(7.0, step=1, phase=0.1, duration=0.06, direction=np.radians(direction))
    record = going(Segment("stand", duration=1.8), pushes=(push,))
    assert not record.fell, record.fall_reason
    assert set(record.stride.tolist()) == {0}, "it makes no step"
    assert np.abs(record.com[-1] - record.com[0]).max() < 0.01
    assert np.abs(record.attitude).max() < 0.05


@pytest.mark.slow(seconds=3)
def test_a_stand_that_is_pushed_too_hard_falls():
    push = Push(20.0, step=1, phase=0.1, duration=0.06, direction=np.radians(90.0))
    record = going(Segment("stand", duration=1.8), pushes=(push,))
    assert record.fell
    assert np.isfinite(record.torque).all()


def test_point_feet_do_not_stand():
    segments = (Segment("walk", speed=0.5, steps=2), Segment("stand", duration=1.0))
    with pytest.raises(ScenarioError, match="segment 2 stands: bolt has a floating base"):
        robot_route(tc.load_floating_robot("bolt"), Scenario(segments=segments))
