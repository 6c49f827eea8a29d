"""A free robot's state from noisy measurements of all of it."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import template_control as tc
from template_control.embedding import FREE_PLANNER, EmbeddingController, EmbeddingOptions
from template_control.estimation import NoiseFilter, NoiseFilterOptions
from template_control.robustness.severity_sweep import gait_errors
from template_control.run.sensing import FilteredSensors, Sensors, senses_of

DT = 1e-3
DEVIATION = np.array([1e-3, 0.02])
BOTH = np.ones(2, dtype=bool)


@pytest.fixture(scope="module")
def bolt():
    return tc.load_floating_robot("bolt")


def moving(robot, seed=3):
    """A state in the air, and an acceleration."""
    draws = np.random.default_rng(seed)
    q = robot.moved(robot.neutral(), 0.3 * draws.standard_normal(robot.nv))
    return q, draws.standard_normal(robot.nv), 5.0 * draws.standard_normal(robot.nv)


def filtered(robot, options=None):
    return NoiseFilter(robot, DEVIATION, options or NoiseFilterOptions())


def test_gains_are_those_of_the_riccati_equation(bolt):
    o = NoiseFilterOptions(acceleration_noise=4.0)
    found = filtered(bolt, o)
    q = moving(bolt)[0]
    still = np.zeros(bolt.nv)
    for _ in range(3000):
        at = found.update((q, still), still, BOTH, DT)
    np.testing.assert_allclose(at[0], q, atol=1e-12)
    flow, push = np.array([[1.0, DT], [0.0, 1.0]]), np.array([[0.5 * DT**2], [DT]])
    noise = np.diag(DEVIATION**2)
    p = solve_discrete_are(flow.T, np.eye(2), o.acceleration_noise**2 * push @ push.T, noise)
    gain = p @ np.linalg.inv(p + noise)
    # A measurement that is off by 1e-4 rad and 1e-3 rad/s in every coordinate.
    away = np.array([np.full(bolt.nv, 1e-4), np.full(bolt.nv, 1e-3)])
    q_seen, v_seen = found.update((bolt.moved(q, away[0]), away[1]), still, BOTH, DT)
    np.testing.assert_allclose(bolt.between(q, q_seen), (gain @ away)[0], rtol=1e-3)
    np.testing.assert_allclose(v_seen, (gain @ away)[1], rtol=1e-3)


def test_a_known_acceleration_is_followed_without_delay(bolt):
    q, v, acceleration = moving(bolt)
    found = filtered(bolt)
    found.update((q, v), acceleration, BOTH, DT)
    for _ in range(200):
        q, v = bolt.moved(q, (v + 0.5 * acceleration * DT) * DT), v + acceleration * DT
        q_seen, v_seen = found.update((q, v), acceleration, BOTH, DT)
    np.testing.assert_allclose(bolt.between(q, q_seen), 0.0, atol=1e-10)
    np.testing.assert_allclose(v_seen, v, atol=1e-10)


def test_noise_is_less_than_measured(bolt):
    draws = np.random.default_rng(5)
    q, still = moving(bolt)[0], np.zeros(bolt.nv)
    found, missed = filtered(bolt), []
    for _ in range(1000):
        noise = DEVIATION[:, None] * draws.standard_normal((2, bolt.nv))
        q_seen, v_seen = found.update((bolt.moved(q, noise[0]), noise[1]), still, BOTH, DT)
        missed.append((bolt.between(q, q_seen), v_seen))
    share = np.std(missed[300:], axis=0).max(axis=1) / DEVIATION
    assert np.all(share < 0.35)


def test_a_jolt_of_the_joints_is_believed_at_a_touchdown_only(bolt):
    q, still = moving(bolt)[0], np.zeros(bolt.nv)
    jolt = still.copy()
    jolt[6:] = 1.0
    one, soft = np.array([True, False]), NoiseFilterOptions(landing_noise=2.0)
    told = []
    for landing, options in ((BOTH, None), (one, None), (BOTH, soft)):
        found = filtered(bolt, options)
        for _ in range(200):
            found.update((q, still), still, one, DT)
        told.append(found.update((q, jolt), still, landing, DT)[1])
    assert np.all(told[0][6:] > 0.85)
    assert np.all(told[1][6:] < 0.2)
    np.testing.assert_allclose(told[0][:6], told[1][:6], atol=1e-9)
    np.testing.assert_allclose(told[2], told[1], atol=1e-6)  # where landings are like the rest


def senses(robot, sensors, tuning=None):
    gait = tc.robot_gait_for_speed(robot, 0.55)
    controller = EmbeddingController(robot, tc.LqrPlanner(gait, FREE_PLANNER), tuning)
    return senses_of(controller, sensors, DT)


def test_only_noise_is_filtered(bolt):
    noisy = tc.SensorOptions(noise=1e-3)
    assert isinstance(senses(bolt, tc.SensorOptions()), Sensors)
    assert isinstance(senses(bolt, noisy), FilteredSensors)
    assert isinstance(
        senses(bolt, noisy, EmbeddingOptions.of_kind("free", noise_filter=None)), Sensors
    )


@pytest.mark.slow(seconds=4)
def test_bolt_walks_with_noise_and_delay(bolt):
    gait = tc.robot_gait_for_speed(bolt, 0.55)
    noise = tc.SensorOptions(noise=1e-3, seed=1)
    record = tc.simulate(
        tc.Experiment(
            bolt, planner=tc.LqrPlanner(gait, FREE_PLANNER), steps=15, sensors=noise, delay=1e-3
        )
    )
    assert not record.fell, record.fall_reason
    assert record.summary.qp_failures == 0
    assert abs(gait_errors(record, gait)[0]) < 0.03
