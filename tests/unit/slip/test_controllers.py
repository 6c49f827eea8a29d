"""The paper's controllers against the paper's numbers and against the exact model."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import EXAMPLES

from template_control.errors import ParameterError
from template_control.paper import transitions
from template_control.slip.automaton.vocabulary import MapKind, Outcome, Slot
from template_control.slip.control.controllers import (
    ActiveRunning,
    ActiveWalking,
    ModifiedWalking,
    RunToWalk,
    WalkToRun,
)
from template_control.slip.dynamics.stride import controls
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.run import simulate_scenario
from template_control.slip.scenario.scenario import load_scenario

P = SlipParameters()
CLOSED = [MapKind.PAPER, MapKind.IMPROVED]


@pytest.fixture(scope="module")
def running():
    return ActiveRunning(P)


@given(st.floats(2.0, 5.5), st.floats(-0.25, 0.25), st.floats(0.97, 0.99))
@settings(max_examples=15, deadline=None)
def test_running_reaches_its_apex_and_compression(running, speed, change, height):
    solution = running.solve([speed, 0.98], [speed + change, height])
    assert solution.reached
    mapped = ReturnMap(P, "r")([speed, 0.98], solution.controls)
    np.testing.assert_allclose(mapped.state, [speed + change, height], atol=1e-3)
    np.testing.assert_allclose(mapped.state, solution.predicted, rtol=1e-10)
    assert mapped.bottom[0] == pytest.approx(0.9, abs=1e-3)


def test_stiffness_at_5_metres_per_second_is_the_papers():
    for kind in (MapKind.EXACT, *CLOSED):
        u = ActiveRunning(P, kind).solve([5.0, 0.98], [5.0, 0.98]).controls
        assert u[[Slot.K_SC, Slot.K_SD]].mean() == pytest.approx(28.2e3, rel=0.05)


def test_papers_map_returns_table_4_for_the_run_to_walk_stride():
    u = RunToWalk(P, MapKind.PAPER).solve(transitions.RWT_STATE, transitions.RWT_TARGET).controls
    published = transitions.RWT_CONTROLS
    assert np.degrees(u[0] - published[0]) == pytest.approx(0.0, abs=0.1)
    np.testing.assert_allclose(u[1:3], published[1:3], rtol=0.01)


def test_table_4s_walk_to_run_gains_lead_into_a_run():
    mapped = ReturnMap(P, "wr")(transitions.WRT_STATE, transitions.WRT_CONTROLS)
    assert mapped.state[1] == pytest.approx(0.98, abs=0.01)
    going_on = ActiveRunning(P).solve(mapped.state, [mapped.state[0] + 0.3, 0.98])
    assert going_on.reached


def test_a_low_apex_is_left_with_the_leg_at_its_bound():
    """The best touchdown angle is the one at which the leg touches the ground soon after it."""
    z, target = [1.5422, 0.95377], [1.6576, 0.98]
    solution = ActiveRunning(P).solve(z, target)
    assert solution.outcome is Outcome.SECTION
    assert solution.controls[Slot.TOUCHDOWN_ANGLE] == pytest.approx(
        np.arcsin(z[1]) - 0.001, abs=1e-6
    )
    assert solution.residual < 0.05  # without the bound 0.038 is the least, at the apex itself


def test_the_template_alone_runs_at_five_metres_per_second_and_walks_again():
    record = simulate_scenario(load_scenario(EXAMPLES / "zero_five_zero.toml"))
    assert record.completed
    assert record.section_state[:, 0].max() > 4.9


@pytest.mark.parametrize("kind", [MapKind.EXACT, MapKind.IMPROVED])
@pytest.mark.parametrize("speed", [1.7, 1.9, 2.1])
def test_walk_to_run_reaches_an_apex(kind, speed):
    guess = transitions.WRT_CONTROLS
    solution = WalkToRun(P, kind).solve(transitions.WRT_STATE, [speed, 0.98], guess)
    assert solution.reached
    np.testing.assert_array_equal(solution.controls[:3], guess[:3])
    mapped = ReturnMap(P, "wr")(transitions.WRT_STATE, solution.controls)
    np.testing.assert_allclose(mapped.state, [speed, 0.98], atol=0.02)


def test_a_solution_does_not_depend_on_earlier_guesses():
    controller, z, target = WalkToRun(P), transitions.WRT_STATE, [1.9, 0.98]
    alone = controller.solve(z, target)
    controller.solve(z, target, transitions.WRT_CONTROLS)
    np.testing.assert_array_equal(controller.solve(z, target).controls, alone.controls)


def test_simplified_walk_to_run_ignores_the_rear_leg():
    z, u = transitions.WRT_STATE, controls(np.radians(71.94), 16.5e3, 16.5e3, 25e3, 90e3)
    simplified = ReturnMap(P, "wr*")
    assert simplified(z, u).outcome == Outcome.SECTION
    linear = simplified.linearise(z, u)
    assert np.all(linear.control_jacobian[:, Slot.K_SD] == 0.0)
    assert np.any(ReturnMap(P, "wr").linearise(z, u).control_jacobian[:, Slot.K_SD] != 0.0)


@pytest.mark.parametrize("kind", [MapKind.EXACT, *CLOSED])
def test_active_walking_reaches_its_vlo(kind):
    solution = ActiveWalking(P, kind).solve([1.1, 0.98, 0.0], [1.1, 0.98, 0.0])
    assert solution.reached
    np.testing.assert_allclose(solution.predicted, [1.1, 0.98, 0.0], atol=1e-3)


def test_modified_walking_injects_the_energy_that_is_missing():
    """(38): with kappa_2 the energy after the step is the target's, at the target's height."""
    target = np.array([1.13, 0.98, 0.0])
    solution = ModifiedWalking(P).solve([1.12, 0.98, 0.0], target, None)
    u, z = solution.controls, solution.predicted
    assert u[Slot.K_SC] == P.leg_stiffness
    assert u[Slot.K_SD] != pytest.approx(P.leg_stiffness, rel=1e-4)

    def energy(state, height):
        kinetic = 0.5 * P.mass * (state[0] ** 2 + state[2] ** 2)
        spring = 0.5 * u[Slot.K_SD] * (P.rest_length - height) ** 2
        return kinetic + P.mass * P.gravity * state[1] + spring

    # (38) counts the spring's energy as if the target's height were met.
    missed = energy(z, z[1]) - energy(target, target[1])
    assert missed == pytest.approx(0.0, abs=1e-6)


def test_unreachable_target_is_answered_with_the_nearest():
    solution = RunToWalk(P).solve([4.0, 0.98], [1.1, 0.98, 0.0])
    assert not solution.reached
    assert solution.residual > 0.1


@pytest.mark.parametrize(
    ("controller", "z", "target", "culprit"),
    [
        (ActiveRunning, [4.0, 0.98], [np.inf, 0.98], "target is"),
        (ActiveRunning, [4.0, 0.98], [4.0, 0.6], "under the lowest touchdown height"),
        (ActiveRunning, [np.nan, 0.98], [4.0, 0.98], "section state is"),
        (ActiveRunning, [4.0, 0.98], [-1.0, 0.98], "target speed is -1"),
        (ModifiedWalking, [1.1, 0.98, 0.0], [1.1, 1.02, 0.0], "rest length of 1 m"),
        (WalkToRun, [1.1, 0.98], [2.0, 0.98], "give 3 numbers"),
    ],
)
def test_bad_targets_are_named(controller, z, target, culprit):
    with pytest.raises(ParameterError, match=culprit):
        controller(P).solve(z, target)
