"""The delay from measurement to torque: learnt, and reckoned with."""

from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.estimation import DelayCompensation, DelayOptions

DT = 1e-3


class Bodies:
    """Seven bodies that move exactly as expected, some ticks late.

    Args:
        delay: of the accelerations, in ticks.
        noise: of the measured speeds, standard deviation [rad/s].
    """

    def __init__(self, delay, noise=0.0, then=None):
        rng = np.random.default_rng(4)
        ticks = 1500
        # Swings of some hertz, as large as those of a leg.
        phases = rng.uniform(0.0, 2.0 * np.pi, 7)
        self.expected = 80.0 * np.sin(
            2.0 * np.pi * 2.5 * DT * np.arange(ticks)[:, None] + phases
        ) + rng.normal(0.0, 2.0, (ticks, 7))
        late = np.full(ticks, delay)
        late[ticks // 2 :] = delay if then is None else then
        acting = self.expected[np.maximum(np.arange(ticks) - late, 0)]
        self.v = np.vstack((np.zeros(7), DT * np.cumsum(acting, axis=0)))
        steps = DT * self.v[:-1] + 0.5 * DT * DT * acting
        self.q = np.vstack((np.zeros(7), np.cumsum(steps, axis=0)))
        self.told = self.v + noise * rng.standard_normal(self.v.shape)
        self.ticks = ticks


def follow(bodies, robot, options=None):
    """What is foreseen at each tick, and the delay that is believed in then, in ticks."""
    delay = DelayCompensation(options or DelayOptions(), robot, DT)
    foreseen, believed = [], []
    for k in range(bodies.ticks):
        foreseen.append(delay.foresee(bodies.q[k], bodies.told[k]))
        delay.expect(bodies.expected[k])
        believed.append(delay.ticks)
    return foreseen, believed


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("late", [0, 1, 4, 8])
def test_every_delay_is_found(robot, late, noise):
    _, believed = follow(Bodies(late, noise), robot)
    assert set(believed[400:]) == {late}


def test_a_short_memory_sooner_believes_in_another_delay(robot):
    after = {}
    for memory in (0.1, 0.5):
        bodies = Bodies(2, then=6)
        _, believed = follow(bodies, robot, DelayOptions(memory=memory))
        after[memory] = believed.index(6) - bodies.ticks // 2
        assert set(believed[bodies.ticks // 2 + after[memory] :]) == {6}
    assert 0 < 2 * after[0.1] < after[0.5]


@pytest.mark.parametrize("late", [1, 3, 7])
def test_the_state_in_which_the_torques_act_is_foreseen_exactly(robot, late):
    bodies = Bodies(late)
    foreseen, believed = follow(bodies, robot)
    for k in range(500, bodies.ticks - late):
        assert believed[k] == late
        np.testing.assert_allclose(foreseen[k][0], bodies.q[k + late], rtol=0.0, atol=1e-11)
        np.testing.assert_allclose(foreseen[k][1], bodies.v[k + late], rtol=0.0, atol=1e-11)


def test_without_delay_nothing_is_changed(robot):
    bodies = Bodies(0)
    foreseen, _ = follow(bodies, robot)
    assert all(q is not None and np.shares_memory(q, bodies.q) for q, _ in foreseen)
    assert all(np.shares_memory(v, bodies.told) for _, v in foreseen)


def test_a_delay_that_is_not_looked_for_is_not_reckoned_with(robot):
    _, believed = follow(Bodies(4), robot, DelayOptions(longest=0.0))
    assert set(believed) == {0}
    _, believed = follow(Bodies(4), robot, DelayOptions(longest=0.002))
    assert set(believed) <= {0, 1, 2}


def test_a_delay_is_scaled_with_the_robots_time():
    from template_control.slip.similarity import REFERENCE, Scale, scaled

    small = scaled(DelayOptions(), Scale.of(replace(REFERENCE, rest_length=0.25)))
    assert small.longest == pytest.approx(0.004)
    assert small.most == pytest.approx(240.0)


@pytest.mark.slow(seconds=4)
def test_a_walk_that_reckons_with_its_delay_keeps_nearer_to_its_gait(default_gait):
    def off(options):
        planner = tc.LqrPlanner(default_gait)
        record = tc.simulate(
            tc.Experiment(
                tc.load_robot("five-link"),
                planner=planner,
                steps=12,
                delay=0.008,
                controller=options,
            )
        )
        assert not record.fell
        return np.abs(record.section_state[-5:] - default_gait.vlo).mean(axis=0)

    deaf = off(tc.EmbeddingOptions(delay=DelayOptions(longest=0.0)))
    hears = off(tc.EmbeddingOptions())
    assert np.all(hears[:2] < 0.3 * deaf[:2])
    assert hears[0] < 0.01
    assert hears[1] < 0.0015
