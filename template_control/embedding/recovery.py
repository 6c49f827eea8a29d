"""Recovery: what a stride that cannot go on breaks into, and the way back to the walk.

A walk that is too fast runs until it is slow. One that is too slow is carried on in its double
stance, or comes to a stand there; on one leg it steps back. From a stand it starts again, and a
stand that is pushed too hard makes a step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.slip.automaton.automaton import AUTOMATON, RUN_ON
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.gaits.running_gait import running_speeds, suited_height
from template_control.slip.maps.section import APEX, REST, Section
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.scenario.scenario import STAND_HEIGHT
from template_control.slip.similarity import REFERENCE, SPEED, Scale, scaled, tuned

_BOTH_STAND = ("DS_sc^w", "DS_sd^w", "DS_sc^wp", "DS_sd^wp")
_BEFORE_VLO = ("SS_bv^w", "SS_bv^wp")
TO_REST = ("DS_ar^s", "DS_br^ws", "DS_br^sf")
"""Nodes in which a curve carries the CoM to rest over both feet."""
_START = AUTOMATON.starts[StrideKind.STAND_TO_WALK]
_CURVED = (*TO_REST, _START, "DS_bl^ww")
_STEPS = (StrideKind.STEP_FORWARD, StrideKind.STEP_BACK)

EXITS: Mapping[tuple[str, str], str] = {
    **{(node, StrideKind.WALK_TO_RUN): entry for node, entry in RUN_ON.items()},
    **{(node, StrideKind.CHANGE_SPEED): "DS_bl^ww" for node in _BOTH_STAND},
    **{(node, StrideKind.WALK_TO_STAND): "DS_br^ws" for node in (*_BOTH_STAND, "DS_bl^ww")},
    **{(node, StrideKind.STEP_BACK): "SS_bt^sb" for node in _BEFORE_VLO},
    **{(node, step): AUTOMATON.starts[step] for node in (*TO_REST, _START) for step in _STEPS},
}
"""Ways out of a stride: by node of the automaton and other kind of stride, the node where that one
goes on. A fast walk runs. The springs of a slow one would throw it back: a curve in time carries
the CoM while both feet stand, on or to rest; the foot that is up is set down behind again. Where
both feet stand and the CoM cannot come to rest, or not start, a step is made; where it cannot come
to another speed, it comes to rest."""


def entry(node: str, left: str, stride: str) -> str | None:
    """Node where a stride goes on from another one; None where it cannot.

    The robot is in ``node`` of the kind of stride that is ``left``; the same kind goes on where it
    is.
    """
    return node if stride == left else EXITS.get((node, stride))


def ways_to_rest(node: str) -> list[tuple[str, str]]:
    """Ways to a stand from a ``node`` in which a curve carries the CoM, the first one first.

    Of each the kind of stride, and the node where it goes on.
    """
    ways = ((stride, entry) for (at, stride), entry in EXITS.items() if at == node)
    return list(ways) if node in _CURVED else []


_WALKS = (StrideKind.WALK, StrideKind.WALK_PUSH_OFF)
_RUN_ON, _CARRY_ON = StrideKind.WALK_TO_RUN, StrideKind.CHANGE_SPEED
_STOPS = (StrideKind.WALK_TO_STAND, StrideKind.STEP_BACK)
_AFTER: dict[tuple[str, Section], str] = {
    (StrideKind.WALK_TO_RUN, APEX): StrideKind.RUN_TO_WALK,
    **{(stop, REST): StrideKind.STAND_TO_WALK for stop in _STOPS},
}  # where a stride that was broken into has led to: the stride back to the walk

NEEDED = frozenset((StrideKind.WALK_TO_RUN, StrideKind.RUN, StrideKind.RUN_TO_WALK))
"""Strides that need a planner where walks are to recover."""


@dataclass(frozen=True)
class CatchOptions(Checked):
    """Limits at which a walk breaks into another stride, and a run that catches it is over.

    Attributes:
        excess: a walk that is faster than wanted by less than this is left to its planner,
        fast: unless it is at least this fast at VLO, where the template is about to take off.
        walkable: at an apex with at most this speed the robot walks again.
        slow: dx/dt at apex that the run slows down to; less than ``walkable``, as no run settles
            on its speed exactly.
        lag: a walk whose CoM moves slower than its wanted speed at VLO by at least this is carried
            on by both feet, comes to a stand or steps back. While both feet stand, a walk that is
            not disturbed is faster than at VLO.
    """

    excess: NotNegative = tuned(0.42, SPEED)
    fast: Positive = tuned(1.45, SPEED)
    walkable: Positive = tuned(1.45, SPEED)
    slow: Positive = tuned(1.35, SPEED)
    lag: NotNegative = tuned(0.25, SPEED)


class Recovery:
    """Goals of a walk that breaks into other strides, until it walks again."""

    def __init__(self, parameters: SlipParameters, options: CatchOptions | None = None) -> None:
        self.parameters = parameters
        self.options = scaled(options or CatchOptions(), Scale.of(parameters))
        self.reset()

    def reset(self) -> None:
        """Forget an earlier run."""
        self.follow(None)

    def follow(self, goal: StrideGoal | None) -> None:
        """The stride that begins is the route's own; None at the route's end."""
        self._walk = goal if goal is not None and goal.stride in _WALKS else None
        self._taken = ""  # the stride that was broken into

    def take(self, goal: StrideGoal) -> None:
        """The robot has broken into ``goal``, one of :meth:`ways`."""
        self._taken = goal.stride

    def goal(self, section: Section, z: Array) -> StrideGoal | None:
        """The stride that begins after one that was broken into; None where the route goes on.

        ``z`` (n,) is the state at the section that was reached.
        """
        walk, back = self._walk, _AFTER.get((self._taken, section))
        if walk is None or back is None:
            return None
        if section is APEX and z[0] > self.options.walkable:
            return self._run(walk, StrideKind.RUN, self.options.slow, StrideKind.RUN_TO_WALK)
        return replace(walk, stride=back, then=walk.stride)

    def ways(self, goal: StrideGoal, speed: float, excess: float) -> Sequence[StrideGoal]:
        """Strides that the robot can break into within a stride, the best first.

        ``speed`` is dx/dt now; ``excess`` is by how much the robot is faster than wanted: dx/dt at
        the section less the target's, and what disturbances have added since [m/s].
        """
        slowest, fastest = running_speeds(self.parameters)
        o, at_vlo = self.options, float(goal.target[0]) + excess
        walk = goal.stride in _WALKS
        carried = self._taken == goal.stride == _CARRY_ON
        if (walk or carried) and speed <= goal.target[0] - o.lag:
            return self._slower(goal, goal.then if carried else goal.stride)
        fast = walk and (excess >= o.excess or at_vlo >= o.fast)
        on = self._taken == goal.stride == _RUN_ON
        if speed < slowest or not (fast or on):
            return ()
        return (self._run(goal, _RUN_ON, min(speed, fastest), StrideKind.RUN),)

    def _slower(self, goal: StrideGoal, walk: str | None) -> Sequence[StrideGoal]:
        """On to the goal's target and the next stride of ``walk``, or to a stand."""
        height = STAND_HEIGHT / REFERENCE.rest_length * self.parameters.rest_length
        rest = replace(goal, target=np.array([0.0, height, 0.0]), then=StrideKind.STAND_TO_WALK)
        stops = [replace(rest, stride=stop) for stop in _STOPS]
        return replace(goal, stride=_CARRY_ON, then=walk), *stops

    def _run(self, walk: StrideGoal, stride: str, speed: float, then: str) -> StrideGoal:
        p = self.parameters
        target = np.array([speed, suited_height(speed / p.speed_unit) * p.rest_length])
        return StrideGoal(stride, target, speed, walk.segment, then)
