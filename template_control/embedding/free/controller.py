"""Controller of a floating-base robot: the sagittal one on an (x, z) view, and what it lacks.

The sagittal controller runs as it is: of :class:`~template_control.robot.FloatingBaseBiped` it
sees x and z in the heading frame. Here that frame is turned, the feet are placed sideways, and the
forces get their third direction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cos, inf, isfinite, sin

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.lateral import (
    BEYOND,
    SIDES,
    LateralForecast,
    LateralPlanner,
    early_touchdown,
)
from template_control.embedding.free.options import FreeOptions
from template_control.embedding.planners.planner import (
    Context,
    Decision,
    Planner,
    Planners,
    decided,
)
from template_control.embedding.state import FloatingSnapshot
from template_control.embedding.swing import quintic_step
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import Event, Leg
from template_control.slip.lateral.gait import LateralWish
from template_control.slip.lateral.placing import LATERAL
from template_control.slip.maps.section import Section
from template_control.slip.scenario.route import Route
from template_control.slip.similarity import Scale
from template_control.warm_up import Part, ready
from template_control.whole_body.solver import Solution, Stance
from template_control.whole_body.tasks import follow_foot

Array = NDArray[np.float64]

_SIDE = 1  # y, to the left


def foot_in_plane() -> None:
    """A foot's rows, of arrays that are parts of those in space: every second of their numbers."""
    places, jacobian = np.zeros((2, 3))[:, ::2], np.zeros((2, 3, 2))[:, ::2]
    wish = np.zeros((2, 2, 3)), np.zeros(2)
    feels = places, places, jacobian, places
    follow_foot(0, feels, wish, 0.0, (1.0,) * 4, np.zeros((2, 5)))


FREE = (*LATERAL, Part(foot_in_plane, 0.3))
"""Kernels of a floating-base robot's tick, without its planner's."""


class FreeController(EmbeddingController):
    """Joint torques of a floating-base robot.

    Args:
        robot: the (nominal) model; every tick updates it.
        planners: as for :class:`~template_control.embedding.controller.EmbeddingController`.
        options: tuning.
        route: which stride comes next.
        automaton: of the route's strides.

    Attributes:
        lateral: where the feet land to the left or right.
    """

    robot: FloatingBaseBiped
    options: FreeOptions

    @checked
    def __init__(
        self,
        robot: FloatingBaseBiped,
        planners: Planners | Planner,
        options: FreeOptions | None = None,
        route: Route | None = None,
        automaton: Automaton = AUTOMATON,
    ) -> None:
        unscaled = options or FreeOptions()
        super().__init__(robot, planners, unscaled, route, automaton)
        ready(FREE)
        wish = LateralWish(self.options.step_width)
        self.lateral = LateralPlanner(self.parameters, unscaled.lateral, wish)
        self._reach = BEYOND * Scale.of(self.parameters).length
        self.turning: Callable[[float], float] = lambda time: 0.0

    def start(
        self,
        rear: int = 0,
        swung: tuple[float, float] | None = None,
        *,
        first: tuple[Planner, Node] | None = None,
    ) -> None:
        """As :meth:`~template_control.embedding.controller.EmbeddingController.start`."""
        first = first or self.supervisor.begin(self.supervisor.route.section)
        self.lateral.reset(first[0].gait)
        super().start(rear, swung, first=first)

    def tick(
        self,
        q: Array,
        v: Array,
        contact: NDArray[np.bool_],
        dt: float,
        force: Array | None = None,
    ) -> Solution:
        """As :meth:`~template_control.embedding.controller.EmbeddingController.tick`.

        Feet that also swing sideways tell no walls. On feet that slide ``force`` is looked at.
        """
        solution = super().tick(q, v, contact, dt)
        if force is not None:
            self._update_friction(self.robot.faced(force), dt)
        return solution

    # -- sections, touchdowns, liftoffs --------------------------------------------------

    def _decide(self, section: Section) -> None:
        lateral, first = self.lateral, not self.supervisor.deciding
        stance = self.feet.foot_of_leg[Leg.REAR]
        if not first:
            if self.supervisor.decision.nominal:
                lateral.end_step(SIDES[stance], self._foot_side(stance), self.lateral_state())
            if lateral.wish.turn:
                self._turn(lateral.wish.turn, self.robot.space.foot[stance, :2].copy())
        super()._decide(section)
        turn = self.turning(self.time) * self.planner.gait.step_duration
        lateral.wish = replace(lateral.wish, turn=turn)
        lateral.walk(self.planner.gait)
        lateral.aim(SIDES[stance])
        self._advance_touchdown(section)
        lateral.expect(self.supervisor.time_of(Event.TOUCHDOWN))

    def _advance_touchdown(self, section: Section) -> None:
        """Let the step that begins at a section end sooner, where its foothold is out of reach."""
        supervisor, sensed = self.supervisor, self.observer.now
        target, z, planner = supervisor.goal.target, section.of(sensed.state), self.planner

        def decide(least: float) -> Decision:
            return decided(planner.decide, Context(z, target, (least, inf)))

        def look(decision: Decision) -> LateralForecast:
            if decision is not supervisor.decision:
                self._follow(decision)
            feet = np.array([self._foot_side(foot) for foot in supervisor.feet])
            return self.lateral.forecast(supervisor.path, 0.0, self.lateral_state(), feet)

        best = early_touchdown(supervisor.decision, decide, look, self._reach)
        if best is not supervisor.decision:
            self._follow(best)

    def _follow(self, decision: Decision) -> None:
        """Take another decision for the present step, and the path that follows it."""
        supervisor, sensed = self.supervisor, self.observer.now
        supervisor.set_decision(decision)
        self._enter(supervisor.follow(self.node, sensed, self.time).name)
        self.path_clock.restart()

    def _touch_down(self, leg: Leg) -> None:
        self.lateral.touch_down(self.time - self.supervisor.begun_at)
        super()._touch_down(leg)

    def _lift(self, foot: int, swung: float = 0.0) -> None:
        super()._lift(foot, swung)
        speed = float(self.robot.contact_velocity[foot, _SIDE])
        self.references.side[foot] = self._foot_side(foot), speed, 0.0
        self.lateral.aim(SIDES[1 - foot])

    def _turn(self, angle: float, about: Array) -> None:
        """Turn the heading frame about a point of it; what is kept in it turns back."""
        self.robot.turn(angle, about)
        c, s = cos(angle), sin(angle)
        for foot in range(2):
            ahead, side = self.references.foot[foot, 0], self.references.side[foot]
            ahead[0] -= about[0]
            side[0] -= about[1]
            ahead[:], side[:] = c * ahead + s * side, c * side - s * ahead
            ahead[0] += about[0]
            side[0] += about[1]
        self.robot.update(*self.ground.raw_state)
        self._sense()

    def _foot_side(self, foot: int) -> float:
        return float(self.robot.space.foot[foot, _SIDE])

    def snapshot(self) -> FloatingSnapshot:
        """As :meth:`~template_control.embedding.controller.EmbeddingController.snapshot`."""
        planar, feet = super().snapshot(), self.feet.foot_of_leg
        side = np.full(2, np.nan)
        for leg in self.mode.swings:
            side[feet[leg]] = self.references.side[feet[leg], 0]
        sway = self.lateral_state() - (self._foot_side(planar.rear), 0.0)
        return FloatingSnapshot(**vars(planar), sway=sway, side_reference=side)

    def lateral_state(self) -> Array:
        """(2,) y of the CoM, and dy/dt with the angular momentum as the forward speed has it."""
        s = self.robot.space
        height = self.observer.now.state[1]
        speed = s.com_velocity[_SIDE]
        if self.mode.control.momentum_speed:
            speed = speed - s.momentum[0] / (self.robot.mass * height)
        return np.array([s.com[_SIDE], speed])

    # -- control ----------------------------------------------------------------------

    def _swing(self, q: Array, v: Array, dt: float) -> None:
        super()._swing(q, v, dt)
        supervisor = self.supervisor
        for leg in self.mode.swings:
            foot = self.feet.foot_of_leg[leg]
            shape, side = self.feet.swing[foot].options, self.references.side[foot]
            due = supervisor.landing(foot).time - self.path_clock.time
            feet = np.array([self._foot_side(foot) for foot in supervisor.feet])
            target = self.lateral.foothold(
                supervisor.path, self.path_clock.time, self.lateral_state(), feet
            )
            # Without a touchdown on the path there is no time in which to get there.
            if not shape.horizon < due < inf or not isfinite(target):
                side[1:] = 0.0
            else:
                time = max(due - shape.early, shape.horizon)
                quintic_step(side, target, 0.0, time, dt)

    def _stance(self) -> Stance:
        """In space a leg's force points at the CoM sideways too."""
        stance, s = super()._stance(), self.robot.space
        force = np.empty((len(stance.feet), 3))
        planar = stance.force.reshape(-1, 2)
        for row, foot, (x, z) in zip(force, stance.feet, planar, strict=True):
            away, up = s.com[_SIDE] - s.foot[foot, _SIDE], s.com[2] - s.foot[foot, 2]
            row[:] = x, z * away / up, z
        return stance._replace(force=force)
