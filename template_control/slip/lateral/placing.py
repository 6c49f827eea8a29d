"""Lateral foot placement, asked at every tick, and what it learns from step to step."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.lateral.gait import (
    LateralCycle,
    LateralGait,
    LateralLearningOptions,
    LateralOptions,
    Side,
)
from template_control.slip.lateral.path import (
    NEXT,
    LateralPath,
    acceleration,
    lateral_path,
    motion_ahead,
)
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.warm_up import Part

_STRETCH_GAIN = 0.2  # share of a stance's surprise that enters the stretch
_STRETCHES = 0.9, 1.2  # of single stance; one that is longer or shorter was disturbed


@dataclass(frozen=True)
class LateralLearnt:
    """State of the sideways learning; each lesson gives a new one.

    Attributes:
        offset: (2, 2) what the robot adds to y and dy/dt at a section, in steps from the left and
            from the right foot [m, m/s]; rows are :attr:`Side.row`.
        stretch: duration of single stance over the template's.
    """

    offset: Array = field(default_factory=lambda: np.zeros((len(Side), 2)))
    stretch: float = 1.0

    def after_step(
        self, stance: Side, surprise: Array, options: LateralLearningOptions
    ) -> LateralLearnt:
        """After the section of a nominal step; a step with a push teaches nothing.

        Args:
            stance: side of the foot that the step began on.
            surprise: (2,) y from the stance foot and dy/dt over what was expected as the foot
                landed [m, m/s].
            options: scaled to the template.
        """
        limit, bound = np.array(options.surprise_bound), np.array(options.offset_bound)
        lesson = 0.5 * options.gain * np.clip(surprise, -limit, limit)
        offset = self.offset.copy()
        offset[stance.row] += (1.0 + options.one_sided) * lesson
        offset[stance.other.row] -= (1.0 - options.one_sided) * lesson
        return replace(self, offset=np.clip(offset, -bound, bound))

    def after_stance(self, lasted: float, planned: float) -> LateralLearnt:
        """After a piece of single stance, such as that from a section to the touchdown.

        Args:
            lasted: its duration [s].
            planned: its duration on the path, without a stretch [s]; more than 0.
        """
        low, high = _STRETCHES
        seen = min(max(lasted / planned, low), high)
        return replace(self, stretch=self.stretch + _STRETCH_GAIN * (seen - self.stretch))


_FOOTHOLDS, _NEXT = 2, 2 + NEXT  # columns of a motion


class LateralAim(NamedTuple):
    """Target and costs by which the next foothold is chosen.

    Attributes:
        state: (2,) wanted y from the next foot and dy/dt, at the section after touchdown.
        step: distance from the stance foot to the next foothold in the periodic gait, to the left
            [m].
        cost: (2, 2) cost-to-go of an error of the state.
        step_cost: of an error of the step [1/m^2].
        offset: (2,) what the robot adds to that state.
        steps: (2,) least and largest distance from the stance foot to the next, to the left [m].
        reach: largest lateral distance between CoM and foot at touchdown [m].
    """

    state: Array
    step: float
    cost: Array
    step_cost: float
    offset: Array
    steps: Array
    reach: float


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
    """Target of the next foothold; it holds until that touchdown.

    Args:
        lateral: the gait's step map.
        cycle: its periodic motion.
        stance: side of the foot next to which the next one lands.
        learnt: the robot's own part of the motion.
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
    )


def before_turn(aim: LateralAim, lateral: LateralGait, turn: float) -> LateralAim:
    """An aim of the axes after a turn to the left [rad], in those so far, to the first order.

    What is further ahead is further to the side before.
    """
    to_left = lateral.length * turn
    return aim._replace(
        state=aim.state + np.array([lateral.ahead, lateral.speed]) * turn,
        step=aim.step + to_left,
        steps=aim.steps + to_left,
    )


@compiled
def pivot(contact: Any, com: Any, rolling: Any) -> Any:
    """y of the point about which the CoM falls, of a foot that rolls on the ground [m].

    ``rolling`` is by how much the contact moves per way of the CoM, the foot's radius over the
    leg's length: from the pivot, which rests, the CoM is 1 / (1 - rolling) times as far away.
    """
    return (contact - rolling * com) / (1.0 - rolling)


@compiled
def contact(pivot: Any, com: Any, rolling: Any) -> Any:
    """y of the contact of a foot whose pivot is there: the inverse of :func:`pivot` [m]."""
    return (1.0 - rolling) * pivot + rolling * com


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
    motion = motion_ahead(path, time)
    landing, ahead, slope = 0.0, np.empty(2), np.empty(2)
    for row in range(3):
        total = motion[row, 0] * com[0] + motion[row, 1] * com[1]
        for i in range(2):
            total += motion[row, _FOOTHOLDS + i] * feet[i]
        if row == 0:
            landing = total
        else:
            ahead[row - 1], slope[row - 1] = total + aim.offset[row - 1], motion[row, _NEXT]
    stance = feet[path.stance]
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
    return Placement(y, wanted, _left(path, time), landing, ahead, slope)


@compiled
def _left(path: LateralPath, time: float) -> float:
    """Time to touchdown [s]."""
    left = 0.0
    for row in range(path.meta.shape[0]):
        start = path.meta[row, 0]
        span = min(start + path.meta[row, 1], path.touchdown) - max(start, time)
        if span > 0.0:
            single = (path.footholds[row, 0] >= 0) != (path.footholds[row, 1] >= 0)
            left += span * (path.stretch if single else 1.0)
    return left


def sideways() -> None:
    """A step's motion to the left, and the foothold that is chosen on it."""
    p = SlipParameters()
    u = controls(1.152, p.leg_stiffness, p.leg_stiffness)
    stride = simulate_stride(p, STRIDE_START[StrideKind.WALK], VLO.state([1.1, 0.978, 0.0]), u)
    path, two = lateral_path((stride,), p.gravity), np.zeros(2)
    acceleration(path, 0.0, 0.0, np.zeros(NEXT + 1))
    place(path, LateralAim(two, 0.1, np.eye(2), 0.1, two, two, 0.1), 0.0, two, two)


LATERAL = (Part(sideways, 2.0),)
"""Compiled functions of a floating-base tick, for :func:`~template_control.warm_up.ready`."""
