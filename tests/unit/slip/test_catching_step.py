"""The step that catches a robot on soles which is pushed off the ground that its feet enclose."""

from dataclasses import replace

import numpy as np
import pytest

from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.catching import Reach, catching_step
from template_control.slip.similarity import Scale

FEET = np.array([[-0.13, 0.12], [0.13, -0.12]])  # the left one behind
HALF, RATE, LEAN = np.array([0.12, 0.04]), 3.0, 0.2
REACH = Reach(
    half=HALF,
    rates=np.array([RATE, RATE]),
    level=np.array([[0.18, LEAN], [-0.18, LEAN]]),
    scale=Scale.of(replace(SlipParameters(), rest_length=1.0)),
)


def at_rest_over(point):
    """Motion (2, 2) of a CoM in the middle of the feet, whose capture point is at ``point``."""
    return np.array([[0.0, 0.0], np.array(point) * RATE])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_foot_that_bears_nothing_lifts_off(side):
    """The other one bears the robot on its outer edge; x is kept."""
    step = catching_step(at_rest_over((0.0, side * 0.25)), FEET, REACH)
    swings = 1 if side > 0.0 else 0
    assert step.foot == swings
    stands = FEET[1 - swings]
    assert step.pressure == pytest.approx(np.clip(0.0, stands[0] - HALF[0], stands[0] + HALF[0]))
    assert step.foothold == pytest.approx(FEET[swings, 0])


def test_a_foot_lands_so_far_ahead_that_the_capture_point_is_midway():
    step = catching_step(at_rest_over((0.15, -0.2)), FEET, REACH)
    assert (step.foot, step.pressure) == (0, pytest.approx(0.15))  # it stays over the other sole
    assert 0.5 * (FEET[1, 0] + step.foothold) == pytest.approx(0.15)


def test_a_longer_way_takes_longer_and_a_foot_in_the_air_goes_on():
    near, far = (catching_step(at_rest_over((x, 0.1)), FEET, REACH) for x in (0.25, 0.5))
    assert near.lasts < far.lasts
    on = catching_step(at_rest_over((0.0, 0.25)), FEET, REACH, (0, 0.1))
    assert (on.foot, on.lasts >= 0.1) == (0, True)
