"""Running gaits: they return to their apex, they are symmetric, and speed alone chooses them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from template_control.errors import GaitError, ParameterError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Event, Slot
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import GaitFamily, flight_share
from template_control.slip.gaits.running_gait import other_runs, running_gait, running_speeds
from template_control.slip.maps.section import APEX
from template_control.slip.parameters import SlipParameters

P = SlipParameters()
SMALL = SlipParameters(mass=10.0, gravity=3.7, rest_length=0.4, leg_stiffness=500.0)


@given(share=st.floats(0.0, 1.0))
@settings(max_examples=25, deadline=None)
def test_a_gait_returns_to_its_apex(share):
    low, high = running_speeds(P)
    gait = running_gait(P, low + share * (high - low))
    stride = simulate_stride(P, STRIDE_START["r"], APEX.state(gait.apex), gait.controls)
    assert stride.completed
    np.testing.assert_allclose(APEX.of(stride.state), gait.apex, atol=1e-9)
    assert stride.duration == gait.step_duration
    assert 0.0 < flight_share(gait) < 0.5
    # Symmetric: the leg is vertical at the bottom.
    bottom = next(event for event in stride.events if event.event is Event.BOTTOM)
    toe = stride.toes[1]
    assert bottom.state[0] == pytest.approx(toe, abs=1e-7)


def test_gaits_vary_smoothly_with_speed():
    speeds = np.linspace(*running_speeds(P), 60)
    gaits = [running_gait(P, float(speed)) for speed in speeds]
    for values in (
        [gait.controls[Slot.TOUCHDOWN_ANGLE] for gait in gaits],
        [gait.controls[Slot.K_SC] / 1e4 for gait in gaits],
        [gait.apex[1] for gait in gaits],
        [flight_share(gait) for gait in gaits],
    ):
        second = np.diff(values, 2)
        assert np.max(np.abs(second)) < 0.01


@given(share=st.floats(-0.99, 0.99))
@settings(max_examples=25, deadline=None)
def test_a_hop_goes_forward_on_the_spot_and_backward(share):
    speed = share * running_speeds(P, "hr")[1]
    gait, back = (running_gait(P, sign * speed, stride="hr") for sign in (1.0, -1.0))
    stride = simulate_stride(P, STRIDE_START["hr"], APEX.state(gait.apex), gait.controls)
    np.testing.assert_allclose(APEX.of(stride.state), gait.apex, atol=1e-9)
    assert 0.2 < flight_share(gait) < 0.3
    assert gait.step_length == pytest.approx(-back.step_length, abs=1e-9)
    assert gait.step_duration == pytest.approx(back.step_duration, abs=1e-9)
    angle = Slot.TOUCHDOWN_ANGLE
    assert gait.controls[angle] - 0.5 * np.pi == pytest.approx(
        0.5 * np.pi - back.controls[angle], abs=1e-9
    )


def test_a_hop_on_the_spot_lands_on_a_vertical_leg():
    still = running_gait(P, 0.0, stride="hr")
    assert still.controls[Slot.TOUCHDOWN_ANGLE] == pytest.approx(0.5 * np.pi, abs=1e-9)
    assert still.step_length == pytest.approx(0.0, abs=1e-9)


def test_templates_of_all_sizes_run_alike():
    unit, small = np.sqrt(P.gravity * P.rest_length), np.sqrt(SMALL.gravity * SMALL.rest_length)
    gait, other = running_gait(P, 0.9 * unit), running_gait(SMALL, 0.9 * small)
    angle = Slot.TOUCHDOWN_ANGLE
    assert other.controls[angle] == pytest.approx(gait.controls[angle], abs=1e-9)
    assert flight_share(other) == pytest.approx(flight_share(gait), abs=1e-8)
    assert other.apex[1] / SMALL.rest_length == pytest.approx(gait.apex[1] / P.rest_length)


def test_height_and_stiffness_may_be_chosen():
    gait = running_gait(P, 3.0, apex_height=0.98, leg_stiffness=22e3)
    np.testing.assert_array_equal(gait.apex, [3.0, 0.98])
    assert gait.controls[Slot.K_SC] == gait.controls[Slot.K_SD] == 22e3
    assert np.degrees(gait.controls[Slot.TOUCHDOWN_ANGLE]) == pytest.approx(73.5, abs=0.1)
    assert flight_share(gait) == pytest.approx(0.403, abs=2e-3)
    assert gait.mean_speed == pytest.approx(gait.step_length / gait.step_duration)


@pytest.mark.parametrize("speed", [1.1, 5.1, -3.0])
def test_a_speed_beyond_the_family_is_refused(speed):
    with pytest.raises(GaitError, match=r"give a speed from 1\.2 to 5 m/s"):
        running_gait(P, speed)


def test_a_speed_that_is_no_number_is_refused():
    with pytest.raises(ParameterError, match="speed is nan: give a finite number"):
        running_gait(P, np.nan)


def test_a_gait_that_is_none_is_refused():
    # Legs so soft that the CoM reaches the ground.
    with pytest.raises(GaitError, match=r"no running gait has 3 m/s and 0\.98 m at its apex"):
        running_gait(P, 3.0, apex_height=0.98, leg_stiffness=500.0)


def test_a_family_knows_its_gait_and_the_nearest():
    own = running_gait(P, 3.0, apex_height=0.98, leg_stiffness=22e3)
    family = GaitFamily(own, other_runs)
    assert family.towards(own, [3.0]) == (own, True)
    slower, exact = family.towards(own, [2.5])
    assert exact
    assert family.towards(own, [2.5])[0] is slower
    fastest, exact = family.towards(slower, [9.0])
    assert not exact
    assert fastest.apex[0] == running_speeds(P)[1]


def test_flight_is_what_the_nodes_without_a_foot_take(paper_gait):
    for speed in (1.3, 3.0, 4.9):
        gait = running_gait(P, speed)
        stride = simulate_stride(P, "F_aa^r", APEX.state(gait.apex), gait.controls)
        stands = stride.time_of(Event.REAR_LIFTOFF) - stride.time_of(Event.TOUCHDOWN)
        assert flight_share(gait) == pytest.approx(1.0 - stands / gait.step_duration, abs=1e-9)
    assert flight_share(paper_gait) == 0.0
