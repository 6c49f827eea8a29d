"""The robot's state from encoders, IMU and contacts, and walking on it."""

from itertools import islice

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import solve_discrete_are

import template_control as tc
from template_control.cli.main import build_parser, main
from template_control.errors import ParameterError
from template_control.estimation.base_filter import BaseFilter, BaseFilterOptions
from template_control.estimation.filters import JointFilter, JointFilterOptions
from template_control.estimation.imu import ImuOptions, ImuSensors
from template_control.robustness.severity_sweep import gait_errors
from template_control.run.experiment import Experiment
from template_control.run.specs import GaitSpec
from template_control.slip.similarity import Scale

DT = 1e-3
SILENT = ImuOptions(encoder_noise=0.0, gyro_noise=0.0, accelerometer_noise=0.0)


def estimated(record, options, robot=None, ticks=None):
    """What the estimator makes of a recorded run, and the truth; five-link's if not given.

    Of its first ``ticks``; None: all.
    """
    robot = robot or tc.load_robot("five-link")
    template = tc.template_for(robot)
    sensors = ImuSensors(options, robot, Scale.of(template), DT)
    touching = record.contact_force[:, :, -1] > 0.005 * robot.mass * robot.gravity
    accelerations = np.gradient(record.v, DT, axis=0)
    found = []
    all_ticks = zip(record.q, record.v, touching, accelerations, strict=True)
    for q, v, contact, expected in islice(all_ticks, ticks):
        found.append(np.concatenate(sensors.measure(q, v, contact)))
        sensors.expect(expected)
    return np.array(found), np.hstack((record.q, record.v))[:ticks]


def test_gains_are_those_of_the_riccati_equation():
    o = JointFilterOptions(angle_noise=3e-4, acceleration_noise=40.0)
    flow, push = np.array([[1.0, DT], [0.0, 1.0]]), np.array([[0.5 * DT**2], [DT]])
    seen = np.array([[1.0, 0.0]])
    noise = o.acceleration_noise**2 * push @ push.T
    p = solve_discrete_are(flow.T, seen.T, noise, np.array([[o.angle_noise**2]]))
    gain = (p @ seen.T / (seen @ p @ seen.T + o.angle_noise**2)).ravel()
    filtered = JointFilter(o)
    filtered.reset(np.zeros(1), np.zeros(1))
    filtered.update(np.ones(1), np.zeros(1), DT)
    assert filtered.angle[0] == pytest.approx(gain[0], rel=1e-6)
    assert filtered.speed[0] == pytest.approx(gain[1], rel=1e-6)


def test_a_known_acceleration_is_followed_exactly():
    filtered = JointFilter(JointFilterOptions())
    filtered.reset(np.zeros(2), np.array([1.0, -2.0]))
    acceleration = np.array([30.0, -50.0])
    for i in range(1, 101):
        t = i * DT
        truth = np.array([1.0, -2.0]) * t + 0.5 * acceleration * t**2
        filtered.update(truth, acceleration, DT)
    np.testing.assert_allclose(filtered.angle, truth, atol=1e-12)
    np.testing.assert_allclose(filtered.speed, [1.0 + 3.0, -2.0 - 5.0], atol=1e-9)


def test_the_imu_alone_carries_a_thrown_trunk():
    """In free fall the accelerometer reads nothing, however the trunk turns."""
    robot = tc.load_robot("five-link")
    base = BaseFilter(robot, BaseFilterOptions())
    q, v = np.zeros(robot.nv), np.zeros(robot.nv)
    q[:3], v[:3] = (0.3, 1.2, 0.1), (2.0, 1.0, 3.0)
    base.reset(q, v)
    for _ in range(300):
        base.predict(np.array([3.0]), np.zeros(2), DT)
    t = 0.3
    fall = [0.3 + 2.0 * t, 1.2 + t - 0.5 * robot.gravity * t**2, 0.1 + 3.0 * t]
    np.testing.assert_allclose(base.base, fall, atol=1e-9)
    np.testing.assert_allclose(base.velocity, [2.0, 1.0 - robot.gravity * t], atol=1e-9)


def test_the_imu_alone_carries_a_robot_that_is_thrown_and_turns_in_space():
    robot = tc.load_floating_robot("bolt")
    base = BaseFilter(robot, BaseFilterOptions())
    q, v, turning = robot.neutral(), np.zeros(robot.nv), np.array([1.0, -2.0, 3.0])
    start = pin.exp3(np.array([0.3, 0.4, -0.5]))
    q[:3], q[3:7] = (0.3, -0.2, 1.2), pin.Quaternion(start).coeffs()
    v[:3], v[3:6] = start.T @ (2.0, -0.5, 1.0), turning
    base.reset(q, v)
    for _ in range(300):
        base.predict(turning, np.zeros(3), DT)
    t = 0.3
    fall = [0.3 + 2.0 * t, -0.2 - 0.5 * t, 1.2 + t - 0.5 * robot.gravity * t**2]
    turned = start @ pin.exp3(turning * t)
    np.testing.assert_allclose(base.base[:3], fall, atol=1e-9)
    np.testing.assert_allclose(pin.Quaternion(base.base[3:]).toRotationMatrix(), turned, atol=1e-9)
    speed = turned.T @ (2.0, -0.5, 1.0 - robot.gravity * t)
    np.testing.assert_allclose(base.rates, [*speed, *turning], atol=1e-9)


@pytest.mark.slow(seconds=1)
def test_feet_that_stand_hold_a_trunk_whose_gyro_is_off_if_it_is_little_believed():
    robot = tc.load_floating_robot("go2")
    q = robot.neutral()

    def tilt(feet):
        base = BaseFilter(robot, BaseFilterOptions(gyro_noise=1.0))
        base.reset(q, np.zeros(robot.nv))
        for _ in range(1000):
            base.correct(q[7:], np.full(4, feet))
            base.predict(np.array([0.002, 0.002, 0.0]), np.array([0.0, 0.0, robot.gravity]), DT)
        return np.linalg.norm(pin.log3(pin.Quaternion(base.base[3:]).toRotationMatrix())[:2])

    assert tilt(feet=False) == pytest.approx(0.002 * np.sqrt(2.0), rel=1e-3)
    assert tilt(feet=True) < 0.3 * tilt(feet=False)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("name", "motion"), [("bolt", "walk"), ("go2", "run")])
def test_a_robot_in_space_goes_on_its_estimate(name, motion):
    robot, speed = tc.load_floating_robot(name), {"walk": 0.6, "run": 0.9}[motion]
    record = tc.simulate(
        tc.Experiment(robot, GaitSpec(motion, speed=speed), steps=20, sensors=ImuOptions(seed=1))
    )
    assert not record.fell
    assert record.summary.qp_failures == 0
    assert record.section_state[10:, 0].mean() == pytest.approx(record.gait_state[0], rel=0.02)
    assert np.abs(record.attitude[:, :2]).max() < 0.03
    found, truth = estimated(record, SILENT, tc.load_floating_robot(name))
    missed = np.abs(found - truth)
    # A round foot rolls on: its contact point moves by 4 % of the way.
    assert missed[:, :2].max() < 0.004 * truth[-1, 0]
    assert missed[:, robot.model.nq : robot.model.nq + 6].max() < 5e-3


@pytest.mark.slow(seconds=1)
def test_without_noise_a_walk_is_told_as_it_is(long_walk):
    found, truth = estimated(long_walk, SILENT)
    missed = np.abs(found - truth)
    walked = truth[-1, 0]
    assert walked > 5.0
    # The feet of the simulation sink and creep a little: that is all that is missed.
    assert missed[:, 0].max() < 1e-3 * walked
    assert missed[:, 1].max() < 1e-3 * walked
    assert missed[:, 2].max() < 1e-3
    assert missed[:, 7:9].max() < 5e-3


@pytest.mark.slow(seconds=4)
def test_with_noise_the_speed_is_better_than_the_sensors(long_walk):
    found, truth = estimated(long_walk, ImuOptions(seed=4))
    missed = found - truth
    rms = np.sqrt(np.mean(missed**2, axis=0))
    assert rms[2] < 1e-3
    assert rms[7:9].max() < 1e-2
    # Differences of the encoders' angles are off by 0.2 mrad sqrt(2) / 1 ms.
    assert rms[10:].max() < 0.3 * 2e-4 * np.sqrt(2.0) / DT
    assert rms[3:7].max() < 2e-4
    again, other = (estimated(long_walk, ImuOptions(seed=s), ticks=1000)[0] for s in (4, 5))
    np.testing.assert_array_equal(found[:1000], again)
    assert not np.allclose(found[5:1000], other[5:])


def test_a_foot_lands_where_the_state_says():
    robot = tc.load_robot("five-link")
    base = BaseFilter(robot, BaseFilterOptions())
    q = np.zeros(robot.nv)
    q[:3] = (1.0, 0.95, 0.05)
    q[3:] = 0.3 * np.arange(1, 5) - 0.6
    base.reset(q, np.zeros(robot.nv))
    contact = np.array([True, False])
    for _ in range(20):
        base.correct(q[3:], contact)
        base.predict(np.zeros(1), np.array([-np.sin(0.05), np.cos(0.05)]) * robot.gravity, DT)
    np.testing.assert_allclose([*base.base, *base.velocity], [*q[:3], 0.0, 0.0], atol=1e-6)
    place = robot.foot_position[0] - [_rolled(robot, q), 0.0]
    np.testing.assert_allclose(base.points[0], place, atol=1e-6)


def test_a_standing_foot_holds_against_a_biased_accelerometer_as_far_as_it_is_believed():
    robot = tc.load_robot("five-link")
    q, contact = np.array([0.0, 0.95, 0.0, -0.3, 0.6, 0.3, 0.0]), np.array([True, False])

    def drift(**noise):
        base = BaseFilter(robot, BaseFilterOptions(**noise))
        base.reset(q, np.zeros(robot.nv))
        for _ in range(200):
            base.correct(q[3:], contact)
            base.predict(np.zeros(1), np.array([0.5, robot.gravity]), DT)
        return abs(base.velocity[0])

    assert drift(force_noise=1.0) < drift() < drift(force_noise=0.01)
    assert drift(foot_noise=5e-5) < drift() < drift(foot_noise=5e-3)


def _rolled(robot, q):
    leg = list(robot.legs[0])
    return robot.foot_radius * (q[2] + robot.joint_sign[leg] @ q[3:][leg])


def test_wrong_noise_is_named():
    with pytest.raises(ParameterError, match="gyro_noise"):
        ImuOptions(gyro_noise=-1.0)
    with pytest.raises(ParameterError, match="creep"):
        BaseFilterOptions(creep=0.0)


def test_the_run_file_knows_the_estimator(tmp_path):
    experiment = Experiment(sensors=ImuOptions(seed=7)).resolved()
    assert Experiment.load(experiment.save(tmp_path / "run.toml")) == experiment


def test_noise_and_estimate_exclude_each_other(refused):
    assert "--estimate" in refused(["walk", "--estimate", "--noise", "0.001", "--steps", "1"])
    words = ["walk", "--estimate"]
    assert build_parser(words).parse_args(words).estimate


@pytest.mark.slow(seconds=5)
def test_the_robot_walks_on_its_estimate(default_gait):
    robot = tc.load_robot("five-link")
    record = tc.simulate(
        tc.Experiment(
            robot, planner=tc.LqrPlanner(default_gait), steps=30, sensors=ImuOptions(seed=1)
        )
    )
    assert not record.fell
    speed, height = gait_errors(record, default_gait)
    assert abs(speed) < 0.02
    assert abs(height) < 0.01


@pytest.mark.slow
def test_the_command_walks_on_an_estimate(tmp_path, capfd):
    words = ["walk", "--steps", "3", "--estimate", "--no-figures", "--json"]
    assert main([*words, "--output", str(tmp_path)]) == 0
    assert Experiment.load(tmp_path / "run.toml").sensors == ImuOptions()
    assert '"fell": false' in capfd.readouterr().out
