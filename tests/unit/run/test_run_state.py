"""A run's state changes where it is meant to, once."""

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.options import FREE_PLANNER, EmbeddingOptions
from template_control.embedding.phases import PHASES
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.running import RunningPlanner
from template_control.robot.start import state_in
from template_control.run.apex_pose import ApexStart, apex_pose
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.gaits.walking_by_speed import walking_gait


def _count_resets(planner):
    counts, reset = [], planner.reset

    def counted():
        counts.append(1)
        reset()

    planner.reset = counted
    return counts


@pytest.mark.parametrize("kind", ["planar walk", "planar run", "free walk"])
def test_a_run_begins_once(kind):
    free = kind == "free walk"
    robot = tc.load_floating_robot("bolt") if free else tc.load_robot("five-link")
    parameters = tc.template_for(robot)
    if kind == "planar run":
        planner = RunningPlanner(running_gait(parameters, 2.5))
    elif free:
        planner = LqrPlanner(walking_gait(parameters, 0.6), FREE_PLANNER)
    else:
        planner = LqrPlanner(walking_gait(parameters, 1.1))
    counts = _count_resets(planner)
    tuning = EmbeddingOptions.of_kind("free") if free else EmbeddingOptions(catches=False)
    record = simulate(Experiment(robot, planner=planner, steps=1, controller=tuning))
    assert record.steps == 1
    assert len(counts) == 1


def test_what_was_measured_stays_so_where_planning_fails(robot):
    gait = running_gait(tc.template_for(robot), 3.0)
    pose = apex_pose(robot, ApexStart(gait.apex, gait, PHASES[Phase.F].swing))
    controller = EmbeddingController(robot, RunningPlanner(gait))
    state_in(robot, pose)
    controller.start(pose.rear, pose.swung)
    measured = controller.observer.now.state[2:].copy()
    controller.observer.pre_impact_velocity[:] = 7.0, -3.0
    seen = []

    def fail(cause, node, sensed, now, *, height_error):
        seen.append(sensed.state[2:].copy())
        raise RuntimeError

    controller.supervisor.replan = fail
    controller._enter("DS_sc^wp")
    assert controller.mode.control.use_pre_impact_velocity
    with pytest.raises(RuntimeError):
        controller._touch_down(Leg.FRONT)
    np.testing.assert_array_equal(seen, [[7.0, -3.0]])
    np.testing.assert_array_equal(controller.observer.now.state[2:], measured)
