"""Pushes aside, which only a robot that nothing holds can be given."""

from __future__ import annotations

from functools import partial
from math import pi

from template_control.robustness.disturbance import Disturbance
from template_control.robustness.disturbances import (
    DISTURBANCES,
    NEWTON_SECONDS,
    PHASES,
    PUSHES,
    impulse_unit,
    pushed,
)

ASIDE: tuple[Disturbance, ...] = tuple(
    Disturbance(
        f"push-{side}",
        f"push to the {side}",
        NEWTON_SECONDS,
        PUSHES,
        PHASES,
        impulse_unit,
        partial(pushed, direction=direction),
        passing=True,
    )
    for side, direction in (("left", 0.5 * pi), ("right", -0.5 * pi))
)
"""In the step they come in the left foot stands, and then the right one."""

ALL = (*DISTURBANCES, *ASIDE)
"""What a free robot is disturbed by, in the order shown; a planar one by ``DISTURBANCES``."""
