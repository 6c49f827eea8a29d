"""The environment of Gymnasium: its interface, its reward, and a run that it shares with others."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import template_control as tc
from template_control.errors import ParameterError
from template_control.robot.spec import RobotSpec

BOLT = tc.Experiment(RobotSpec("bolt", free=True))


def walked(env, action, seed=0, **options):
    """Observations and rewards of an episode with one action."""
    seen, rewards = [env.reset(seed=seed, options=options)[0]], []
    while True:
        observation, reward, terminated, truncated, info = env.step(np.float32(action))
        seen.append(observation)
        rewards.append(reward)
        if terminated or truncated:
            return np.array(seen), np.array(rewards), terminated, info


@pytest.mark.slow(seconds=2)
@pytest.mark.parametrize("residuals", [False, True], ids=["command", "residuals"])
@pytest.mark.parametrize("experiment", ["five-link", BOLT], ids=["planar", "floating"])
def test_the_interface_is_gymnasium_s(experiment, residuals):
    env = tc.run.WalkEnv(experiment, strides=3, residuals=residuals)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env, skip_render_check=True, skip_close_check=True)
    env.close()


@pytest.mark.slow(seconds=2)
def test_a_walk_at_the_wanted_speed_is_worth_one_a_stride():
    env = tc.run.WalkEnv(strides=10)
    low, high = tc.run.VelocityRange.of(tc.load_robot("five-link")).speeds
    wanted = 0.5 * (low + high)
    seen, rewards, terminated, info = walked(env, [0.0], wanted=(wanted, 0.0))
    assert not terminated
    assert info["fall_reason"] == ""
    assert np.all(rewards[2:] > 0.9)
    assert seen[-1][4] == pytest.approx(wanted, abs=0.02)
    assert seen[-1][5] == pytest.approx(wanted, abs=0.02)
    seen, slow, _, _ = walked(env, [-1.0], wanted=(wanted, 0.0))
    assert seen[-1][4] == pytest.approx(low, abs=0.05)  # MuJoCo's slowest walk is 0.026 m/s slower
    assert slow[-1] == pytest.approx(1.0 - 4.0 * (wanted - seen[-1][4]), abs=1e-3)
    env.close()


@pytest.mark.slow(seconds=2)
def test_episodes_repeat_with_their_seed_and_pushes_differ():
    env = tc.run.WalkEnv(strides=4, impulse=15.0)
    first, again, other = (walked(env, [0.0], seed=seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.01
    env.close()


def test_a_fall_ends_an_episode_and_costs_ten():
    env = tc.run.WalkEnv(tc.Experiment(world=tc.PlantOptions(friction=0.02)))
    _, rewards, terminated, info = walked(env, [0.0])
    assert terminated
    assert rewards[-1] == -10.0
    assert "in step" in info["fall_reason"]
    env.close()


@pytest.mark.slow(seconds=2)
def test_residuals_change_a_walk_that_keeps_its_speed_without_them():
    env = tc.run.WalkEnv(strides=8, residuals=True)
    seen, rewards, _, _ = walked(env, np.zeros(3), wanted=(0.8, 0.0))
    assert np.all(rewards[2:] > 0.9)
    other, _, _, _ = walked(env, [0.2, 0.0, 0.0], wanted=(0.8, 0.0))
    assert np.abs(other[1] - seen[1]).max() > 1e-3
    env.close()


@pytest.mark.slow(seconds=2)
def test_a_floating_base_turns_as_it_is_commanded():
    env = tc.run.WalkEnv(BOLT, strides=16)
    seen, _, terminated, _ = walked(env, [0.0, 0.5], wanted=(0.55, 0.25))
    assert not terminated
    turned = seen[-4:, 9].mean()
    assert turned > 0.05
    assert seen[-1][10] == pytest.approx(
        0.25 * np.sqrt(tc.template_for(BOLT.robot.load()).rest_length), abs=0.01
    )
    env.close()


@pytest.mark.slow(seconds=2)
def test_environments_walk_side_by_side():
    """Each has its own robot and world: alone and in a vector it walks alike."""
    make = lambda: tc.run.WalkEnv(strides=3)  # noqa: E731
    many = gymnasium.vector.SyncVectorEnv([make, make])
    many.reset(seed=[3, 4])
    together = [many.step(np.zeros((2, 1), np.float32))[0] for _ in range(2)]
    many.close()
    for i, seed in enumerate((3, 4)):
        env = make()
        env.reset(seed=seed)
        for both in together:
            np.testing.assert_array_equal(env.step(np.zeros(1, np.float32))[0], both[i])
        env.close()


def test_wrong_use_is_refused():
    with pytest.raises(ParameterError, match="the action is the robot's motion"):
        tc.run.WalkEnv(tc.Experiment(steps=3))
    env = tc.run.WalkEnv(strides=1)
    with pytest.raises(ParameterError, match="call reset first"):
        env.step(np.zeros(1, np.float32))
    for options, why in (
        ({"wanted": (5.0, 0.0)}, "give a speed from 0.3"),
        ({"wanted": (0.8, 0.5)}, "a turning rate within 0 rad/s"),
        ({"wanted": 0.8}, "wanted is 0.8"),
        ({"want": (0.8, 0.0)}, "unknown option want"),
    ):
        with pytest.raises(ParameterError, match=why):
            env.reset(options=options)
    env.reset(seed=0)
    for action in (np.zeros(3), [np.nan]):
        with pytest.raises(ParameterError, match="the action is"):
            env.step(action)
    assert env.step(np.float32([0.5]))[0][-1] == 0.5
    with pytest.raises(ParameterError, match="it is over"):
        env.step(np.zeros(1, np.float32))
    env.close()
