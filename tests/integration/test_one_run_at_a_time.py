"""A run begins afresh with what an earlier one used, and shares nothing with one that goes on."""

import threading
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.planners.planner import Context
from template_control.embedding.planners.transition import RUN_TO_WALK, TransitionPlanner
from template_control.errors import ParameterError
from template_control.run.robot_route import robot_route
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.gaits.walking_by_speed import walking_gait
from template_control.slip.scenario.scenario import Scenario, Segment

OPTIONS = tc.Experiment(steps=3, record_every=10)


@pytest.mark.parametrize("kind", [tc.LqrPlanner, tc.ModifiedPlanner])
def test_a_planner_forgets_the_gaits_of_an_earlier_run(kind, gait):
    planner, fresh = kind(gait), kind(gait)
    z = gait.vlo * [1.01, 1.0, 1.0]
    first = planner.decide(Context(z))
    other = walking_gait(gait.parameters, 0.95)
    planner.observe(planner.decide(Context(z, other.vlo)), other.vlo + 0.01)
    assert planner.gait.vlo[0] == pytest.approx(0.95)
    planner.reset()
    assert planner.gait is gait
    for again in (planner.decide(Context(z)), fresh.decide(Context(z))):
        np.testing.assert_array_equal(again.controls, first.controls)
        np.testing.assert_array_equal(again.predicted, first.predicted)


def test_running_and_transition_planners_forget_the_gaits_of_an_earlier_run():
    slow, fast = (running_gait(tc.SlipParameters(), speed) for speed in (3.0, 3.5))
    planner, fresh = tc.RunningPlanner(slow), tc.RunningPlanner(slow)
    z = slow.apex * [1.01, 1.0]
    planner.observe(planner.decide(Context(z, fast.apex)), z)
    assert planner.gait.apex[0] == 3.5
    planner.reset()
    assert planner.gait is slow
    again, first = planner.decide(Context(z)), fresh.decide(Context(z))
    np.testing.assert_array_equal(again.controls, first.controls)
    np.testing.assert_array_equal(again.predicted, first.predicted)

    walk = partial(walking_gait, tc.SlipParameters())
    landing = TransitionPlanner("rw", planner, lambda speed: walk(min(speed, 1.2)), RUN_TO_WALK)
    own = landing.gait
    landing.decide(Context(z, walk(0.95).vlo))
    assert landing.gait is not own
    landing.reset()
    assert landing.gait is own


def test_a_second_run_of_one_robot_and_planner_is_as_the_first(robot, default_gait):
    planner = tc.LqrPlanner(default_gait)
    first, second = (tc.simulate(replace(OPTIONS, robot=robot, planner=planner)) for _ in range(2))
    for name in ("time", "q", "torque", "section_state", "section_controls"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


@pytest.mark.slow(seconds=2)
def test_a_second_run_of_one_route_is_as_the_first(robot):
    walk = Scenario((Segment("walk", 1.1, steps=2),), start=(1.1, 0.978, 0.0))
    route = robot_route(robot, walk, push_off=False)
    first, again = (tc.simulate(replace(OPTIONS, robot=robot, motion=route)) for _ in range(2))
    assert first.arrived
    np.testing.assert_array_equal(again.q, first.q)


@pytest.mark.slow(seconds=2)
@pytest.mark.parametrize("shared", ["robot", "planner"])
def test_a_robot_or_planner_in_use_is_refused_to_another_thread(shared, default_gait):
    own = {"robot": tc.load_robot("five-link"), "planner": tc.LqrPlanner(default_gait)}
    other = {"robot": tc.load_robot("five-link"), "planner": tc.LqrPlanner(default_gait)}
    other[shared] = own[shared]
    told = []

    def meanwhile(done):
        def second():
            try:
                tc.simulate(replace(OPTIONS, robot=other["robot"], planner=other["planner"]))
            except ParameterError as error:
                told.append(str(error))

        thread = threading.Thread(target=second)
        thread.start()
        thread.join()

    record = tc.simulate(replace(OPTIONS, robot=own["robot"], planner=own["planner"]), meanwhile)
    assert record.steps == 3
    assert len(told) == 3
    assert all("is in use by another run" in line for line in told)
    # The run has given them back.
    assert tc.simulate(replace(OPTIONS, robot=other["robot"], planner=other["planner"])).steps == 3
