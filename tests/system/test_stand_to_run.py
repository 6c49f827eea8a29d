"""From standing through walking to running, and back to a stand: one file, two engines."""

import numpy as np
import pytest
from places import EXAMPLES
from printed import ZERO_FIVE_ZERO, go

import template_control as tc

ENGINES = {"pybullet": tc.PlantOptions(), "mujoco": tc.MujocoOptions()}


@pytest.mark.slow(seconds=7)
@pytest.mark.parametrize(
    ("example", "name", "engine", "top"),
    [
        ("stand_walk_run_stand", "five-link", "pybullet", 3.0),
        ("zero_five_zero", "runner", "mujoco", 5.0),
    ],
)
def test_a_robot_stands_runs_and_stands_again(example, name, engine, top):
    scenario = tc.load_scenario(EXAMPLES / f"{example}.toml")
    check(
        tc.simulate(
            tc.Experiment(tc.load_robot(name), scenario, world=ENGINES[engine], record_every=5)
        ),
        top,
    )


@pytest.mark.slow(seconds=7)
def test_runner_stands_runs_and_stands_again_as_the_readme_prints_it(tmp_path, monkeypatch):
    check(go(ZERO_FIVE_ZERO, tmp_path, monkeypatch), 5.0)


def check(record, top):
    """Stood, ran at ``top`` [m/s] and stood again, within its limits."""
    assert (record.fall_reason, record.arrived) == ("", True)
    kinds = record.kinds_of_stride[:-1]
    order = [kind for i, kind in enumerate(kinds) if i == 0 or kind != kinds[i - 1]]
    assert order[:8] == ["s", "sw", "ww", "w", "wr", "r", "rw", "w"]
    assert order[-2:] == ["sf", "s"]
    # It slows down in as many steps as it takes; from the slowest it closes its feet at once.
    assert order[-3] in ("ws", "ww")
    assert set(order[8:-3]) <= {"ww", "w"}
    speed = record.section_state[:, 0]
    assert speed.max() == pytest.approx(top, abs=0.05)
    error = speed[1:] - record.section_target[:-1, 0]
    assert np.sqrt(np.mean(error**2)) < 0.15
    assert np.all(np.abs(record.torque) <= record.torque_limit)
    assert np.all(np.abs(record.v[:, 3:]) <= 1.01 * record.velocity_limit)
    assert record.solved.all()
    still = record.time > record.time[-1] - 2.0
    assert np.ptp(record.com[still, 0]) < 0.01, "it stands; MuJoCo's feet creep by 2 mm/s"
    upright = record.time < 1.9
    assert np.abs(record.com_velocity[upright]).max() < 0.01
