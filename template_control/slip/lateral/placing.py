"""Where the next foot is put, to the left or right: asked at every tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.slip.lateral.cycle import LateralCycle
from template_control.slip.lateral.gait import LateralGait
from template_control.slip.lateral.learnt import LateralLearnt
from template_control.slip.lateral.options import LateralOptions
from template_control.slip.lateral.path import NEXT, LateralPath
from template_control.slip.lateral.side import Side
from template_control.slip.lateral.transition import COLUMNS, advance

Array = NDArray[np.float64]

_FOOTHOLDS, _NEXT = 2, 2 + NEXT  # columns of a motion


class LateralAim(NamedTuple):
    """What the next foothold is chosen for.

    Attributes:
        state: (2,) wanted y from the next foot and dy/dt, at the section after touchdown.
        step: distance from the stance foot to the next foothold in the periodic gait, to the
            left [m].
        cost: (2, 2) cost-to-go of an error of the state.
        step_cost: of an error of the step [1/m^2].
        offset: (2,) what the robot adds to that state.
        steps: (2,) least and largest distance from the stance foot to the next, to the left [m].
        reach: largest distance aside between CoM and foot at touchdown [m].
        stretch: single stance takes this times as long as on the path.
    """

    state: Array
    step: float
    cost: Array
    step_cost: float
    offset: Array
    steps: Array
    reach: float
    stretch: float


class Placement(NamedTuple):
    """A foothold, and what is expected of it; NaN where the path has no touchdown and section.

    Attributes:
        y: of the foothold [m].
        wanted: y of the cheapest foothold, before bounds [m].
        left: time to touchdown [s], the stretch included.
        com: y of the CoM at touchdown [m].
        expected: (2,) y of the CoM and dy/dt at the section after it, were the foothold at
            y = 0 [m, m/s].
        slope: (2,) their change per foothold's y [1, 1/s].
    """

    y: float
    wanted: float
    left: float
    com: float
    expected: Array
    slope: Array

    def state(self, foothold: float) -> Array:
        """(2,) y from the foot and dy/dt expected at the section, where it lands at ``foothold``.

        The robot's own part is included.
        """
        return self.expected + self.slope * foothold - (foothold, 0.0)


def lateral_aim(
    lateral: LateralGait,
    cycle: LateralCycle,
    stance: Side,
    learnt: LateralLearnt,
    options: LateralOptions,
) -> LateralAim:
    """What the next foot is put down for; it holds until that touchdown.

    Args:
        lateral: the gait's step map.
        cycle: its periodic motion.
        stance: side of the foot beside which the next one lands.
        learnt: what the robot's own part is.
        options: scaled to the template.
    """
    near, far = options.widths
    steps = (-far, -near) if stance is Side.LEFT else (near, far)
    return LateralAim(
        state=cycle.states[stance.other.row],
        step=float(cycle.steps[stance.row]),
        cost=lateral.cost,
        step_cost=options.step_cost,
        offset=learnt.offset[stance.row],
        steps=np.array(steps),
        reach=options.reach,
        stretch=learnt.stretch,
    )


@compiled
def place(path: LateralPath, aim: LateralAim, time: float, com: Array, feet: Array) -> Placement:
    """The foothold that costs least: its own step's cost and the cost-to-go at the section.

    Args:
        path: planar path that the robot is on.
        aim: what the foothold is for.
        time: on the path [s], before the touchdown.
        com: (2,) y of the CoM and dy/dt [m, m/s].
        feet: (2,) y of the feet that were rear and front at the start of the path [m].
    """
    if not np.isfinite(path.section):
        nowhere = np.full(2, np.nan)
        return Placement(np.nan, np.nan, np.nan, np.nan, nowhere, nowhere)
    motion = np.zeros((2, COLUMNS))
    motion[0, 0] = motion[1, 1] = 1.0
    advance(path, time, path.touchdown, aim.stretch, motion)
    landing = motion[0, 0] * com[0] + motion[0, 1] * com[1]
    for i in range(2):
        landing += motion[0, _FOOTHOLDS + i] * feet[i]
    advance(path, max(time, path.touchdown), path.section, aim.stretch, motion)
    ahead, slope = np.empty(2), np.empty(2)
    for k in range(2):
        ahead[k] = motion[k, 0] * com[0] + motion[k, 1] * com[1] + aim.offset[k]
        for i in range(2):
            ahead[k] += motion[k, _FOOTHOLDS + i] * feet[i]
        slope[k] = motion[k, _NEXT]
    stance = feet[path.beside]
    # The error of the state is e + s p; that of the step p - stance - step.
    s0, s1 = slope[0] - 1.0, slope[1]
    e0, e1 = ahead[0] - aim.state[0], ahead[1] - aim.state[1]
    c = aim.cost
    top = aim.step_cost * (stance + aim.step)
    top -= s0 * (c[0, 0] * e0 + c[0, 1] * e1) + s1 * (c[1, 0] * e0 + c[1, 1] * e1)
    bottom = aim.step_cost + s0 * (c[0, 0] * s0 + c[0, 1] * s1) + s1 * (c[1, 0] * s0 + c[1, 1] * s1)
    wanted = top / bottom
    y = min(max(wanted, landing - aim.reach), landing + aim.reach)
    y = min(max(y, stance + aim.steps[0]), stance + aim.steps[1])
    left = _left(path, time, aim.stretch)
    return Placement(y, wanted, left, landing, ahead, slope)


@compiled
def _left(path: LateralPath, time: float, stretch: float) -> float:
    """Time to touchdown [s]; single stance takes ``stretch`` times as long as on the path."""
    left = 0.0
    for row in range(path.meta.shape[0]):
        start = path.meta[row, 0]
        span = min(start + path.meta[row, 1], path.touchdown) - max(start, time)
        if span > 0.0:
            single = (path.footholds[row, 0] >= 0) != (path.footholds[row, 1] >= 0)
            left += span * (stretch if single else 1.0)
    return left
