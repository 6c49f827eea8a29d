"""The robot's state from encoders, IMU and contacts, and walking on it."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import template_control as tc
from template_control.cli.main import build_parser, main
from template_control.errors import ParameterError
from template_control.estimation.filters import (
    BaseFilter,
    BaseFilterOptions,
    JointFilter,
    JointFilterOptions,
)
from template_control.estimation.imu import ImuOptions, ImuSensors
from template_control.robustness.severity_sweep import gait_errors
from template_control.run.experiment import Experiment
from template_control.slip.similarity import Scale

DT = 1e-3
SILENT = ImuOptions(encoder_noise=0.0, gyro_noise=0.0, accelerometer_noise=0.0)


def estimated(record, options):
    """What the estimator makes of a recorded run, and the truth."""
    robot = tc.load_robot("five-link")
    template = tc.template_for(robot)
    sensors = ImuSensors(options, robot, Scale.of(template), DT)
    touching = record.contact_force[:, :, 1] > 0.005 * robot.mass * robot.gravity
    accelerations = np.gradient(record.v, DT, axis=0)
    found = []
    for q, v, contact, expected in zip(record.q, record.v, touching, accelerations, strict=True):
        found.append(np.concatenate(sensors.measure(q, v, contact)))
        sensors.expect(expected)
    return np.array(found), np.hstack((record.q, record.v))


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
        base.predict(3.0, np.zeros(2), DT)
    t = 0.3
    fall = [0.3 + 2.0 * t, 1.2 + t - 0.5 * robot.gravity * t**2, 0.1 + 3.0 * t]
    np.testing.assert_allclose(base.state[:3], fall, atol=1e-9)
    np.testing.assert_allclose(base.state[3:5], [2.0, 1.0 - robot.gravity * t], atol=1e-9)


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
    again, _ = estimated(long_walk, ImuOptions(seed=4))
    other, _ = estimated(long_walk, ImuOptions(seed=5))
    np.testing.assert_array_equal(found, again)
    assert not np.allclose(found[5:], other[5:])


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
        base.predict(0.0, np.array([-np.sin(0.05), np.cos(0.05)]) * robot.gravity, DT)
    np.testing.assert_allclose(base.state[:5], [*q[:3], 0.0, 0.0], atol=1e-6)
    place = robot.foot_position[0] - [_rolled(robot, q), 0.0]
    np.testing.assert_allclose(base.state[5:7], place, atol=1e-6)


def test_a_standing_foot_holds_against_a_biased_accelerometer_as_far_as_it_is_believed():
    robot = tc.load_robot("five-link")
    q, contact = np.array([0.0, 0.95, 0.0, -0.3, 0.6, 0.3, 0.0]), np.array([True, False])

    def drift(**noise):
        base = BaseFilter(robot, BaseFilterOptions(**noise))
        base.reset(q, np.zeros(robot.nv))
        for _ in range(200):
            base.correct(q[3:], contact)
            base.predict(0.0, np.array([0.5, robot.gravity]), DT)
        return abs(base.state[3])

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
