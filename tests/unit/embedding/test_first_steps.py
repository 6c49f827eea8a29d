"""Plans of walking steps that begin with other first steps than the usual ones."""

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.planners import ahead
from template_control.embedding.planners.ahead import AheadPlanner
from template_control.embedding.planners.planner import Context
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.maps.return_map import ReturnMap

P = tc.SlipParameters()


def comes_back(planner, z):
    """Whether the template is led to the planner's gait from a VLO state."""
    step, gait = ReturnMap(P, "wp"), planner.gait.vlo
    planner.reset()
    for _ in range(14):
        z, outcome = step.step(z, planner.decide(Context(z, gait)).controls)
        if outcome is not Outcome.SECTION:
            return False
    return bool(np.all(np.abs(z - gait) < [0.03, 0.005, 0.03]))


@pytest.mark.slow(seconds=4)
def test_more_states_come_back_with_a_grid_of_first_steps(monkeypatch):
    slow = AheadPlanner(P, speed=0.5)
    rng = np.random.default_rng(1)
    states = slow.gait.vlo + rng.uniform([-0.5, -0.04, -0.3], [0.5, 0.02, 0.3], (60, 3))
    back = [comes_back(slow, z) for z in states]
    monkeypatch.setattr(ahead, "_GRID", 0)
    without = [comes_back(slow, z) for z in states]
    assert sum(back) > sum(without)
    assert sum(back) >= 0.9 * len(states)


def test_a_state_in_which_no_usual_step_is_completed_has_a_plan():
    """Of a ramp at 1 m/s^2, at the fastest gait, in which `five-link` fell without."""
    planner = AheadPlanner(P)
    planner.offset = np.array([0.009, 0.0, 0.037])
    z, fastest = np.array([1.291, 0.959, 0.079]), np.array([1.317, 0.996, 0.0])
    decision = planner.decide(Context(z, fastest))
    assert decision.nominal
    np.testing.assert_allclose(decision.predicted, fastest, atol=0.02)
