"""Many runs: records are those of single runs, in order, and what cannot be sent is named."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info

import template_control as tc
from template_control.errors import ParameterError, RobotError
from template_control.sweep import workers


@pytest.mark.slow(seconds=4)
def test_records_of_many_runs_are_those_of_single_runs():
    walks = [
        tc.Experiment(steps=1, world=tc.PlantOptions(friction=friction)) for friction in (0.5, 0.7)
    ]
    with workers(1) as pool:  # one worker, so that the second run uses the robot of the first
        many = tc.simulate_many([*walks, walks[0]], pool)
    for walk, record in zip([*walks, walks[0]], many, strict=True):
        alone = tc.simulate(walk)
        for name in ("q", "v", "torque", "contact_force", "section_controls"):
            np.testing.assert_array_equal(getattr(record, name), getattr(alone, name))
        clocks = ("wall_seconds",)
        told = [{k: v for k, v in r.metadata.items() if k not in clocks} for r in (record, alone)]
        assert told[0] == told[1]


def test_an_experiment_with_what_only_this_process_has_is_refused():
    walk = tc.Experiment(tc.load_robot("five-link"), steps=1)
    with pytest.raises(ParameterError, match="robot"):
        tc.simulate_many([walk])


@pytest.mark.slow(seconds=3)
def test_a_robot_that_does_not_exist_is_reported_as_by_simulate():
    with pytest.raises(RobotError, match="there is no robot 'nobody'"):
        tc.simulate_many([tc.Experiment("nobody", steps=1)])


def blas_threads():
    return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]


def test_a_worker_has_one_thread_of_linear_algebra():
    """Others would wait for work in a loop, on the core of another worker."""
    np.linalg.norm(np.ones(2))
    with workers(1) as pool:
        assert set(pool.submit(blas_threads).result()) == {1}
