"""Lateral motion of a floating-base robot: its heading, and its feet to the left and right.

The controller runs in the sagittal plane: of :class:`~template_control.robot.FloatingBaseBiped` it
sees x and z in the heading frame. Here that frame is turned, and the feet are placed sideways.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import atan2, cos, inf, isnan, nan, remainder, sin, tau
from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.embedding.free.lateral import (
    BEYOND,
    SIDES,
    LateralForecast,
    LateralPlanner,
    early_touchdown,
)
from template_control.embedding.free.sway import LOWEST
from template_control.embedding.modes import Mode
from template_control.embedding.planners.planner import Cause, Context, Decision, decided
from template_control.embedding.state import TemplateState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.embedding.swing import Feet, level_reach
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.terms import UP, onward
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Event, StrideKind
from template_control.slip.gaits.gait import Gait
from template_control.slip.lateral.gait import LateralOptions, LateralWish, Side
from template_control.slip.lateral.placing import LATERAL
from template_control.slip.maps.section import APEX, REST, Section
from template_control.slip.planning.catching import Reach, catching_step
from template_control.slip.similarity import Scale, scaled
from template_control.warm_up import ready
from template_control.whole_body.solver import SOLE_SHARE
from template_control.whole_body.task import References

_SIDE = 1  # y, to the left
SIDE_RAMP = 0.05  # change of the speed to the left [m/s^2]
TURN_RAMP = 0.1  # change of a walk's turning rate [rad/s^2, of the reference template]
RUN_RAMP = 0.15  # and of a run's, which leans into its turns
# The same of kinds of stride that have their own. The foot of a hop is below the CoM: the legs turn
# the trunk only by pushing to and fro. With a run's ramp Bolt's fell behind by 0.25 rad as the turn
# changed from 0.3 to -0.34 rad/s.
TURN_RAMPS: dict[str, float] = {StrideKind.HOP: 0.045}
# Largest turn of a walking step on pairs of feet [rad]. The trunk turns over the feet that stand;
# further, and a knee of Go2's came to its stop before its pair lifted off, which braked the robot.
_PAIR_TURN = 0.12
BANK_RATE = 0.2  # of the roll into a turn's curve [rad/s, of the reference template]
# A trunk that turns from its course turns the course, at this rate at most [rad/s, of the reference
# template], and comes there with this time constant [s, the same].
FACING_RATE = 0.18
FACING_TIME = 1.7
SOLE_STAND = 0.24
"""Lateral distance of two soles that stand, over l0. With that of a walk's steps G1's soles
enclosed 8 mm less than 15 N s to a side take without a step."""
WIDEST_START = 0.32
"""Lateral distance of two soles from which on a step closes them before a walk starts, over l0.

The centre of pressure goes forward and to the side by the same shares of the load. From wide feet
the CoM is not at rest to the side when the walk begins: of G1's starts from up to 0.27 l0 none of
32 fell, from 0.35 l0 and more 4 of 6.
"""
TURNED_ROUND = 1.0
"""Angle between the course and a new one from which on the robot stops in between [rad]."""


class Course(NamedTuple):
    """Where a robot is to go, and where its trunk is to face; its speed is the route's.

    The heading frame follows the course: the template walks and runs along its x. A quadruped's
    pairs stand below the middle of its trunk, whichever way that faces: so it goes to the left, and
    backward, by facing away from its course, and the planes of the template know nothing of it. A
    planar robot goes backward likewise, facing half a turn away.

    Attributes:
        left: speed to the left of the course, by footholds further to the left [m/s].
        turning: rate at which the trunk turns, to the left [rad/s].
        facing: angle from the course to where the trunk faces, to the left [rad]; NaN: as it is.
    """

    left: float = 0.0
    turning: float = 0.0
    facing: float = nan

    def away(self, robot: Biped) -> float:
        """Angle that the trunk of a robot is to turn from its course, to face so [rad]."""
        away = self.facing - robot.facing
        return 0.0 if isnan(away) else remainder(away, tau)

    def turns_round(self, robot: Biped) -> bool:
        """Whether a robot that goes has to stop first."""
        return abs(self.away(robot)) > TURNED_ROUND


def _steps(gait: Gait) -> bool:
    """Whether a gait has steps, on the spot too: no spring carries a stand."""
    return bool(gait.controls.any())


class LateralMotion:
    """Heading, and footholds to the left and right.

    Every tick updates the nominal ``robot``, and what is ``sensed`` of it; ``options`` are not
    scaled; ``data`` (1,) is of :data:`~.lateral.LATERAL`. Courses are followed by ramps: a jump
    would move the periodic motion further than one step reaches.
    """

    def __init__(
        self,
        robot: FloatingBaseBiped,
        options: LateralOptions,
        supervisor: StrideSupervisor,
        sensed: TemplateState,
        feet: Feet,
        references: References,
        data: Any,
    ) -> None:
        ready(LATERAL)
        self._supervisor, self._sensed = supervisor, sensed
        parameters = supervisor.parameters
        scale = self._scale = Scale.of(parameters)
        step = self.step_width = scaled(options, scale).step_width
        self.stand_width = SOLE_STAND * parameters.rest_length if robot.patches else step
        self.robot, self._feet, self._references = robot, feet, references
        rolling = robot.foot_radius / parameters.rest_length if robot.paired else 0.0
        wish = LateralWish(step)
        self.planner = LateralPlanner(parameters, options, wish, data, robot.sway, rolling)
        data["bank_rate"] = BANK_RATE / scale.time
        data["unit"], data["pressure"] = scale.time, np.nan
        data["half_width"] = robot.half_width
        self._stood: Array = data["stood"][0]
        # Speed to the left [m/s], rates of the trunk: in the world, and from its course [rad/s].
        self._now: Array = np.zeros(3)
        self._turns = 0.0  # of the trunk from the course, in the present stride [rad]

    def begin(self, gaits: Iterable[Gait], course: Course, in_flight: bool) -> None:
        """Begin a run with the first gait that has steps; it turns at once, but not in flight."""
        self._now[:] = course.left, 0.0 if in_flight else course.turning, 0.0
        self._width = self.planner.wish.width
        self.robot.facing, self._turns = 0.0, 0.0
        self.planner.reset(next(filter(_steps, gaits), None))
        self._stood[:] = self.robot.space.foot_position[:, :2]

    def state(self, height: float, momentum_speed: bool) -> Array:
        """(2,) y of the CoM at a height [m], and dy/dt, with the momentum if the phase has it."""
        s = self.robot.space
        speed = s.com_velocity[_SIDE]
        if momentum_speed:
            speed = (speed - s.momentum[0] / (self.robot.mass * height)) * self.robot.sway
        return np.array([s.com[_SIDE], speed])

    def catch(self, cause: Cause | None, mode: Mode, now: float) -> Node | None:
        """Let a robot on soles step that is pushed too hard to stand; its node in that step.

        After a deviation, the ``cause`` of a new plan, the rest of a step is planned anew.
        """
        robot, data, supervisor, in_air = self.robot, self.robot.data[0], self._supervisor, None
        swings = mode.control.swings if mode.control.follow_curve else ()
        if robot.patches and cause is Cause.DEVIATION and swings:
            due = supervisor.time_of(Event.TOUCHDOWN) - supervisor.phase_time
            in_air = self._feet.foot_of_leg[swings[0]], due
        elif not self.planner.data[0]["leaves"]:
            return None
        x, height, speed, _ = self._sensed.state.tolist()
        height = max(height, LOWEST * robot.leg_length)
        y, sideways = self.state(height, True)
        level = [level_reach(data, foot, data["foot_position"][foot, UP]) for foot in range(2)]
        reach = Reach(
            half=SOLE_SHARE * np.array([robot.half_length, robot.half_width]),
            rates=np.sqrt(robot.gravity / height * np.array([1.0, robot.sway])),
            level=np.array(level) - (y, 0.0),
            scale=self._scale,
        )
        motion = np.array([[x, y], [speed, sideways]])
        step = catching_step(motion, robot.space.foot_position[:, :2], reach, in_air)
        node = supervisor.step(mode.node, step, self._sensed, now)
        self.planner.data["catches"] = node is not None
        return node

    @property
    def taken(self) -> Course:
        """What is taken of the course in the stride that begins."""
        left, turning, _ = self._now.tolist()
        return Course(left, turning)

    def _side(self, foot: int) -> Side:
        """Side of the course that a foot is on: a robot that goes backward faces away from it.

        Diagonal pairs of feet have no side, whichever way the trunk faces.
        """
        side = SIDES[foot]
        return side if self.robot.paired or onward(self.robot.facing) > 0.0 else side.other

    def end_stride(self, course: Course, com: Array, nominal: bool, section: Section) -> bool:
        """Learn from a stride that has ended, and turn the heading frame; whether that has turned.

        ``com`` (2,) is :meth:`state` there; ``nominal`` says whether the stride went near the gait.
        A robot that rests may go anywhere next.
        """
        planner, stance = self.planner, self._feet.landed
        about = self._stood[stance].copy()
        if nominal:
            planner.end_step(self._side(stance), about[_SIDE], com)
        turn, turns = planner.wish.turn, self._turns
        if section is REST:
            turns = course.away(self.robot)
            turn = -turns
        if section is APEX:
            about[0] = self.robot.space.com[0]
            if turn:
                planner.data["placed"] = 0  # in the axes so far
        if turn or turns:
            self._turn(turn, about)
            self.robot.facing += turns
        return bool(turn or turns)

    def _turn(self, angle: float, about: Array) -> None:
        """Turn the heading frame about a point of it; what is kept in it turns back."""
        self.robot.turn(angle, about)
        c, s = cos(angle), sin(angle)
        for foot in range(2):
            ahead, side = self._references.foot[foot, 0], self._references.side[foot]
            ahead[0] -= about[0]
            side[0] -= about[1]
            ahead[:], side[:] = c * ahead + s * side, c * side - s * ahead
            ahead[0] += about[0]
            side[0] += about[1]
            for contact in self.robot.groups[foot]:
                lifted = self._feet.data["lifted"][0, contact, :2]
                lifted[:] = lifted @ [[c, -s], [s, c]]
        self._stood[:] = (self._stood - about) @ [[c, -s], [s, c]] + about

    def begin_stride(
        self, section: Section, course: Course, node: Node, com: Array, now: float
    ) -> Node:
        """Take note of the stride that begins, and let it end sooner where that is better.

        ``com`` (2,) is :meth:`state`. The supervisor, which has decided the stride, follows another
        decision where there is a better one; returns the node that the robot is in then.
        """
        planner, supervisor = self.planner, self._supervisor
        gait = supervisor.planner.gait
        planner.data["section_began"] = now
        if not _steps(gait):
            node = self._close_feet(section, node, now)
            self._stand(section)
            return node
        scale, turning = self._scale, TURN_RAMP if node.stance else RUN_RAMP
        turn_ramp = TURN_RAMPS.get(gait.stride, turning) / scale.time**2
        ramps = np.array([SIDE_RAMP * scale.length / scale.time**2, turn_ramp, turn_ramp])
        most, wanted = gait.step_duration * ramps, self._wanted(course)
        if node.stance and self.robot.paired:
            rate = _PAIR_TURN / gait.step_duration
            wanted[1] = min(max(wanted[1], -rate), rate)
        self._now += np.clip(wanted - self._now, -most, most)
        left, turn, self._turns = (gait.step_duration * self._now).tolist()
        planner.wish = replace(planner.wish, left=left, turn=turn - self._turns)
        planner.walk(gait)
        planner.aim(self._side(self._feet.landed), turned=True)
        z, target = supervisor.reports[-1].state, supervisor.goal.target

        def decide(least: float) -> Decision:
            return decided(supervisor.planner, Context(z, target, (least, inf)))

        def follow(decision: Decision) -> Node:
            if decision is supervisor.decision:
                return node
            supervisor.decision = decision
            return supervisor.follow(node, self._sensed, now)

        def look(decision: Decision) -> LateralForecast:
            follow(decision)
            feet = self._stood[list(supervisor.feet), _SIDE]
            return planner.forecast(supervisor.path, com, feet)

        self._turn_trunk(gait.step_duration, now, 0.0 if node.stance else float(z[0]))
        if not node.stance:
            planner.due = inf
            return node
        reach = BEYOND * scale.length
        node = follow(early_touchdown(supervisor.decision, decide, look, reach))
        planner.due = supervisor.time_of(Event.TOUCHDOWN)
        return node

    def _wanted(self, course: Course) -> Array:
        """(3,) what a course wants of a robot that goes: see ``_now``."""
        if course.turns_round(self.robot):
            return np.zeros(3)
        time = self._scale.time
        fastest, constant = FACING_RATE / time, FACING_TIME * time
        turns = min(max(course.away(self.robot) / constant, -fastest), fastest)
        return np.array([course.left, course.turning, turns])

    def _close_feet(self, section: Section, node: Node, now: float) -> Node:
        """Step before a walk starts, where soles are too far apart; the node of the step."""
        supervisor, (left, right) = self._supervisor, self.robot.space.foot_position[:, _SIDE]
        widest = WIDEST_START * supervisor.parameters.rest_length
        starts = section is REST and supervisor.planner.next_gait() is not None
        if not (starts and self.robot.patches and abs(left - right) > widest):
            return node
        return supervisor.step(node, None, self._sensed, now) or node

    def _stand(self, section: Section) -> None:
        """A stride that leads to a stand, or from it to a walk: it goes straight on.

        A foot that lands in it goes to where the last gait's would, or after a walk to the left,
        whose CoM is on its way already, where that one's would.
        """
        planner = self.planner
        self._now[:], self._turns = 0.0, 0.0
        left = 0.0 if section is REST else planner.wish.left
        gait = self._supervisor.planner.next_gait()
        width = self.stand_width if gait is None else self._width
        planner.wish = LateralWish(width, left)
        planner.walk(gait)
        self._turn_trunk(1.0, 0.0)
        planner.aim(self._side(self._feet.landed))
        planner.data["placed"] = 0  # the foothold so far is one of a walk that goes on
        planner.due = self._supervisor.time_of(Event.TOUCHDOWN)

    def _turn_trunk(self, duration: float, time: float, speed: float = 0.0) -> None:
        """Turn the trunk in the stride that begins, as much as the axes turn at its end.

        It banks and spins as it runs, with a ``speed`` [m/s]; a walk's feet turn it.
        """
        data, turn = self.planner.data, self.planner.wish.turn
        data["bank"] = -atan2(speed * turn / duration, self.robot.gravity)
        turn = turn + self._turns if speed or self.robot.paired else 0.0
        data["turn"], data["begun"], data["duration"] = turn, time, duration
        data["spin"] = self.robot.yaw_inertia() * turn / duration if speed else 0.0

    def touch_down(self, foot: int, lasted: float) -> None:
        """A foot has landed, ``lasted`` [s] after the section."""
        self.planner.touch_down(lasted)
        self.planner.data["catches"] = 0
        self._stood[foot] = self.robot.space.foot_position[foot, :2]
        self.planner.aim(self._side(foot))

    def lift(self, foot: int) -> None:
        """A foot begins its swing."""
        now = self.robot.data[0]
        motion = now["foot_position"][foot, _SIDE], now["foot_velocity"][foot, _SIDE], 0.0
        self._references.side[foot] = motion
        self._references.offset[list(self.robot.groups[foot])] = 0.0
