"""Humanoids on flat feet walk in both engines, with torques only, and are recorded and drawn."""

from dataclasses import replace

import numpy as np
import pytest
from places import EXAMPLES

import template_control as tc
from template_control.plant.bullet import PlantOptions
from template_control.run.record import SoleRecord
from template_control.run.specs import GaitSpec
from template_control.run.velocity import VelocityProfile
from template_control.slip.automaton.vocabulary import Phase
from template_control.view.replay.film import Stage
from template_control.view.replay.playback import playback


def walk(robot, steps, upper_body=False, **given):
    spec = tc.robot.RobotSpec(robot, free=True, upper_body=upper_body)
    return tc.simulate(tc.Experiment(spec, motion=GaitSpec(speed=0.6), steps=steps, **given))


def lateral_distance(record, row):
    """Distance of the feet to the side [m]."""
    away = np.diff(record.space_foot[row, :, :2], axis=0)[0]
    c, s = np.cos(record.heading[row]), np.sin(record.heading[row])
    return abs(c * away[1] - s * away[0])


def capture_point(record, row):
    """(2,) x and y of the capture point [m]."""
    speed = np.gradient(record.space_com[:, :2], record.time, axis=0)[row]
    return record.space_com[row, :2] + speed * np.sqrt(record.space_com[row, 2] / 9.81)


def check(record, steps):
    """The walk has its speed; the trunk is upright, and the pressure stays within the soles."""
    assert (record.fall_reason, record.steps) == ("", steps)
    assert record.solved.all()
    begun = record.section_time[1]
    after = record.time > begun
    travelled = record.space_com[-1, 0] - record.space_com[after][0, 0]
    assert travelled / (record.time[-1] - begun) == pytest.approx(0.6, rel=0.05)
    assert np.sqrt((record.attitude[:, :2] ** 2).mean(axis=0)).max() < 0.01
    assert (np.abs(record.torque) <= record.torque_limit + 1e-9).all()
    off = np.abs(record.centre_of_pressure - record.soles[:, :2])
    single = record.in_phase(Phase.SS)
    assert (np.nanmax(off[single], axis=0) <= record.soles[:, 2:] + 2e-3).all()


@pytest.mark.slow(seconds=4)
def test_g1_stands_walks_and_stands_again():
    """In MuJoCo; ``test_one_command.py`` has the same command with a run in it, in PyBullet."""
    given = tc.Experiment.load(EXAMPLES / "zero_walk_zero.toml")
    robot = tc.robot.RobotSpec("g1", free=True)
    # The CoM comes to rest with a time constant of 0.4 s: stand for two seconds.
    motion = replace(given.motion, duration=6.0)
    record = tc.simulate(replace(given, motion=motion, robot=robot, world=tc.MujocoOptions()))
    assert record.fall_reason == ""
    assert record.solved.all()
    kinds = record.kinds_of_stride
    assert kinds[: kinds.index("s")] == ["sw", "wp", "wp", "wp", "ws"]
    walks = record.section_state[1:5, 0]
    np.testing.assert_allclose(walks, record.section_target[1:4, 0].mean(), atol=0.07)
    still = record.time > record.time[-1] - 1.0
    # MuJoCo's feet creep by 0.2 mm/s.
    assert np.ptp(record.space_com[still], axis=0).max() < 1e-3
    assert (np.abs(record.torque) < 0.95 * record.torque_limit).all()
    assert np.abs(record.attitude).max() < 0.01
    off = np.abs(record.centre_of_pressure - record.soles[:, :2])
    assert (np.nanmax(off[record.in_phase(Phase.SS)], axis=0) <= record.soles[:, 2:] + 2e-3).all()


@pytest.mark.slow(seconds=8)
def test_g1_walks_and_is_recorded(tmp_path):
    record = walk("g1", 6)
    check(record, 6)
    again = tc.load_record(record.save(tmp_path / "run.npz"))
    assert isinstance(again, SoleRecord)
    np.testing.assert_array_equal(again.sole_wrench, record.sole_wrench)
    # The wrench is that of the forces, and bears the robot.
    np.testing.assert_allclose(record.sole_wrench[:, :, 2], record.contact_force[:, :, 1], atol=2.0)
    weight = record.mass * 9.81
    assert record.sole_wrench[:, :, 2].sum(axis=1).mean() == pytest.approx(weight, rel=0.02)
    assert record.plot("pressure").axes
    assert record.plot("stick_diagram").axes
    tc.save_html(record, tmp_path / "replay.html")
    stage = Stage(playback(record, fps=2.0))
    trunk = stage.seen(stage.corners.reshape(-1, 3))[:, 1]
    low, high = stage.figure.axes[0].get_ylim()
    assert low < trunk.min() < trunk.max() < high, "its trunk is in the film"


@pytest.mark.slow(seconds=6)
def test_talos_walks_with_the_same_tuning():
    check(walk("talos", 4), 4)


@pytest.mark.slow(seconds=7)
def test_g1_walks_with_all_its_joints():
    record = walk("g1", 4, upper_body=True)
    check(record, 4)
    assert len(record.joints) == 29
    arms_and_waist = record.q[:, 7 + 12 :]
    assert np.abs(arms_and_waist).max() < 0.05


@pytest.mark.slow(seconds=10)
@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_another_mass_walks_and_is_learnt(scale):
    record = walk("g1", 7, world=PlantOptions(mass_scale=scale))
    assert not record.fell
    assert record.section_load[-1] == pytest.approx(scale, abs=0.04)


@pytest.mark.slow(seconds=9)
@pytest.mark.parametrize(
    ("impulse", "heading", "steps"),
    [(15.0, 270.0, []), (15.0, 180.0, ["sb"]), (22.5, 90.0, ["sf"])],
)
def test_a_pushed_stand_is_held_or_caught_by_steps(impulse, heading, steps):
    """One foot is ahead: two corners of the rectangle around both are not between them."""
    motion = VelocityProfile(((0.0, 0.0, 0.0, 0.0),), 4.0, gaits=("stand", "walk"))
    push = tc.Push(impulse, time=1.0, duration=0.08, direction=np.radians(heading))
    spec = tc.robot.RobotSpec("g1", free=True)
    record = tc.simulate(tc.Experiment(spec, motion=motion, pushes=(push,)))
    assert record.fall_reason == ""
    assert record.solved.all()
    assert [kind for kind in record.kinds_of_stride if kind != "s"] == steps
    still = record.time > record.time[-1] - 0.5
    assert np.ptp(record.space_com[still], axis=0).max() < 5e-3


@pytest.mark.slow(seconds=5)
def test_g1_stops_from_a_walk_to_the_left():
    """The foot of the last step goes along, and the CoM comes to rest between both feet."""
    rows = ((0.0, 0.46, 0.1, -0.1), (4.5, 0.0, 0.0, 0.0))
    motion = VelocityProfile(rows, 9.0, foreseen=False, gaits=("stand", "walk"))
    spec = tc.robot.RobotSpec("g1", free=True)
    record = tc.simulate(tc.Experiment(spec, motion=motion))
    assert record.fall_reason == ""
    assert record.solved.all()
    kinds = record.kinds_of_stride
    assert kinds[kinds.index("ws") + 1 :] == ["s"] * (len(kinds) - kinds.index("ws") - 1)
    # As the gait's, 0.14 m, and as much further as a step goes to the left.
    assert 0.05 < lateral_distance(record, -1) < 0.25
    middle = record.space_foot[-1].mean(axis=0) - record.space_com[-1]
    assert np.hypot(*middle[:2]) < 5e-3


@pytest.mark.slow(seconds=11)
@pytest.mark.parametrize(
    ("velocity", "stop"), [((0.51, 0.08, -0.18), 5.61), ((0.32, 0.05, -0.16), 5.99)]
)
def test_the_last_foot_of_a_stop_lands_where_the_capture_point_is_between_both(velocity, stop):
    """Not where the walk's next step had it: as far to the side as ahead, in shares of the step."""
    rows = ((0.0, *velocity), (stop, 0.0, 0.0, 0.0))
    motion = VelocityProfile(rows, stop + 1.0, foreseen=False, gaits=("stand", "walk"))
    spec = tc.robot.RobotSpec("g1", free=True)
    record = tc.simulate(tc.Experiment(spec, motion=motion))
    stops = record.section_time[list(record.kinds_of_stride).index("ws")]
    load = record.space_force[:, :, 2]
    row = np.flatnonzero((record.time > stops) & (load.min(axis=1) > 0.0))[0] - 1
    c, s = np.cos(record.heading[row]), np.sin(record.heading[row])
    lands, stands = record.space_foot[row, np.argsort(load[row]), :2]
    turned = np.array([[c, s], [-s, c]])
    ahead, sideways = (turned @ (capture_point(record, row) - stands)) / (turned @ (lands - stands))
    assert sideways == pytest.approx(ahead, abs=0.12)


@pytest.mark.slow(seconds=8)
@pytest.mark.parametrize(("speed", "stop"), [(0.4, 5.0), (0.45, 4.6)])
def test_g1_closes_wide_feet_before_it_starts(speed, stop):
    """A start from where a stop from a walk to the left leaves them ended in a fall."""
    rows = ((0.0, speed, 0.1, 0.0), (stop, 0.0, 0.0, 0.0), (stop + 4.5, 0.7, 0.0, 0.0))
    motion = VelocityProfile(rows, stop + 9.0, foreseen=False, gaits=("stand", "walk"))
    spec = tc.robot.RobotSpec("g1", free=True)
    record = tc.simulate(tc.Experiment(spec, motion=motion))
    assert record.fall_reason == ""
    kinds = list(record.kinds_of_stride)
    step = kinds.index("sf")
    assert kinds[step : step + 4] == ["sf", "sw", "wp", "wp"]
    before, after = np.searchsorted(record.time, record.section_time[step : step + 2])
    assert lateral_distance(record, before) > 0.22
    assert lateral_distance(record, after) < 0.21


@pytest.mark.slow(seconds=6)
def test_g1_starts_with_room_to_both_sides():
    """As it lifts the rear foot, the capture point is well on the inner side of the other one."""
    rows = ((0.0, 0.5, 0.0, 0.0), (4.3, 0.0, 0.0, 0.0), (10.3, 0.7, 0.0, 0.0))
    motion = VelocityProfile(rows, 12.0, foreseen=False, gaits=("stand", "walk"))
    spec = tc.robot.RobotSpec("g1", free=True)
    record = tc.simulate(tc.Experiment(spec, motion=motion))
    assert record.fall_reason == ""
    started = record.section_time[list(record.kinds_of_stride).index("sw")]
    load = record.space_force[:, :, 2]
    row = np.flatnonzero((record.time > started + 0.3) & (load.min(axis=1) < 1.0))[0]
    assert record.time[row] < started + 1.1
    c, s = np.cos(record.heading[row]), np.sin(record.heading[row])
    stands, lifts = record.space_foot[row, np.argsort(-load[row]), :2]
    left = np.array([-s, c])
    inwards = np.sign(left @ (lifts - stands)) * (left @ (capture_point(record, row) - stands))
    assert inwards > 0.025


@pytest.mark.slow(seconds=3)
def test_g1_runs():
    """With flight, at its speed, and with its motors hardly ever at their limits."""
    spec = tc.robot.RobotSpec("g1", free=True)
    run = GaitSpec(name="run", speed=1.35)
    record = tc.simulate(tc.Experiment(spec, motion=run, steps=10))
    assert (record.fall_reason, record.steps) == ("", 10)
    assert record.solved.all()
    np.testing.assert_allclose(record.section_state[:, 0], 1.35, rtol=0.05)
    flies = (record.contact_force[:, :, 1] == 0.0).all(axis=1)
    assert flies.mean() > 0.15
    assert (np.abs(record.torque) >= record.torque_limit).any(axis=1).mean() < 0.03
    assert np.abs(record.attitude[:, 0]).max() < 0.15
