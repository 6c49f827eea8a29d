"""Planners of standing, of starting to walk, of changing the speed of a walk and of stopping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.com_path import Quintic, chained, timed_stride
from template_control.embedding.planners.planner import (
    ANY_ANGLE,
    Decision,
    EndOfStride,
    LandingPlanner,
    decided,
)
from template_control.embedding.standing.curves import BetweenFeet, Found
from template_control.embedding.standing.options import StandingOptions
from template_control.embedding.standing.passes import (
    PassTable,
    SingleSupportPass,
    Touchdown,
    width_price,
)
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Slot, StrideKind
from template_control.slip.dynamics.stride import Stride, controls
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.section import PADDED
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale

Array = NDArray[np.float64]

_TRIALS = 6  # of speeds, where a step's angle is chosen
BEAT = 0.5
"""A stand is planned anew, and the route asked, after this time [s], for the reference template; a
step from a stand ends this long after its curve, when the robot has come to rest too."""
_STEEP = 1.4  # touchdown angle of a step that is not planned yet [rad]


@dataclass(frozen=True)
class StandingGait:
    """A stand as a gait: a stride that returns to its state.

    Attributes:
        parameters: the template.
        state: (3,) dx/dt, y, dy/dt at rest.
        controls: (NUM_SLOTS,) zero: no spring carries.
        step_duration: of a beat [s].
        step_length: 0 [m].
        stride: its kind.
        name: for tables and records.
    """

    parameters: SlipParameters
    state: Array
    controls: Array
    step_duration: float
    step_length: float = 0.0
    stride: str = StrideKind.STAND
    name: str = "standing"

    @classmethod
    def of(cls, parameters: SlipParameters, options: StandingOptions) -> StandingGait:
        """The stand of a template.

        Args:
            parameters: the template.
            options: tuning, for that template.
        """
        state = np.array([0.0, options.height, 0.0])
        return cls(parameters, state, np.zeros(NUM_SLOTS), BEAT * Scale.of(parameters).time)


class Curves:
    """Common part of the planners of curves: they learn nothing.

    Args:
        passes: over a leg.
        automaton: of the strides.
    """

    def __init__(self, passes: PassTable, automaton: Automaton = AUTOMATON) -> None:
        self.parameters, self.options = passes.parameters, passes.options
        self.passes, self.automaton = passes, automaton
        self.gait: Gait = StandingGait.of(self.parameters, self.options)
        self.offset: Array = np.zeros(PADDED)
        self.beat = BEAT * passes.scale.time

    def reset(self) -> None:
        """See :class:`~.planner.Planner`."""

    def observe(self, decision: Decision, z: Array) -> None:
        """See :meth:`~.planner.Planner.observe`."""

    def decide(
        self, z: Array, target: Array | None = None, angles: tuple[float, float] = ANY_ANGLE
    ) -> Decision:
        """See :class:`~.planner.Planner`: what is chosen depends on the feet, so ``curve`` does."""
        return Decision(self.gait.controls, self.gait.state.copy(), True, True, False)

    def _step(self, step: Touchdown | None, end: Array, stiffness: float) -> Decision:
        """The decision for a step (None: there is none) to a state ``end`` (3,)."""
        angle, before = (_STEEP, self.parameters.leg_stiffness) if step is None else step[:2]
        u = controls(angle, before, stiffness)
        return Decision(u, end.copy(), step is not None, True, False)

    def _price(self, step: Touchdown, found: Found) -> float:
        """Of a step and the curve after it [m]."""
        return found.cost + width_price(step.toes[1], self.parameters)

    def _between(self, toes: tuple[float, float]) -> BetweenFeet:
        return BetweenFeet(toes, self.parameters, self.options)

    def _stilled(self, found: Found, duration: float) -> tuple[Quintic, ...]:
        """A curve to rest, and some time [s] in which the robot comes to it."""
        if duration <= 0.0:
            return found.pieces
        still = np.zeros_like(found.pieces[-1].coefficients)
        still[:, 0] = found.pieces[-1].end()[:, 0]
        return (*found.pieces, Quintic(still, duration))

    def _fits(self, found: Found) -> bool:
        return found.excess <= self.options.slack

    def _away(
        self, feet: BetweenFeet, start: Array, speeds: list[float], lands: bool
    ) -> tuple[Found, SingleSupportPass, Array]:
        """Curve to a liftoff that leads to VLO, with the first speed that there is a curve to.

        Args:
            feet: on the ground.
            start: (2, 3) x and y, each position, velocity, acceleration.
            speeds: at VLO [m/s], the best first.
            lands: see :meth:`BetweenFeet.to_liftoff`.

        Returns:
            The curve, the VLO, and the (2, 3) state at liftoff.
        """
        ways = []
        for speed in speeds:
            over = self.passes.at(speed)
            ends = self.passes.approach(over, feet.toes[1])
            found, i = feet.to_liftoff(start, ends, lands)
            ways.append((found, over, ends[i]))
            if self._fits(found):
                return ways[-1]
        return min(ways, key=lambda way: way[0].cost)

    def _leaving(
        self, node: str, feet: BetweenFeet, way: tuple[Found, SingleSupportPass, Array], u: Array
    ) -> tuple[Array, Stride]:
        """Controls and stride of a curve to a liftoff, and on to VLO."""
        found, over, liftoff = way
        changed = u.copy()
        changed[Slot.K_SD] = over.stiffness
        first = timed_stride(self.automaton, node, found.pieces, feet.toes)
        state = liftoff[:, :2].T.ravel()
        second = self.passes.arriving(first.node, state, changed, first.toes)
        return changed, chained(first, second)


class SlopeCurves(Curves):
    """Curves that know slopes: CoM and feet are those of axes that lean with the ground."""

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: the ground is level again."""
        self.on_slope(0.0)

    def on_slope(self, slope: float) -> SlipParameters:
        """See :meth:`~.planner.SlopePlanner.on_slope`."""
        if slope != self.parameters.slope:
            self.passes = self.passes.on_slope(slope)
            self.parameters = self.passes.parameters
        return self.parameters


class StandPlanner(SlopeCurves):
    """Planner of a stand: the CoM comes to rest between the feet, and stays there."""

    lands = False

    def curve(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """See :class:`~.planner.CurvePlanner`."""
        found = self._between(toes).to_rest(start, self.lands)
        left = self.beat - sum(piece.duration for piece in found.pieces)
        stride = timed_stride(self.automaton, node, self._stilled(found, left), toes)
        return replace(decision, feasible=self._fits(found)), stride


class StartPlanner(SlopeCurves):
    """Planner of a start: back, and forward to where the rear foot lifts off."""

    def decide(
        self, z: Array, target: Array | None = None, angles: tuple[float, float] = ANY_ANGLE
    ) -> Decision:
        """See :class:`~.planner.Planner`."""
        wanted = self.gait.state if target is None else target
        return Decision(controls(_STEEP, 0.0, 0.0), np.array(wanted), True, True, False)

    def curve(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """See :class:`~.planner.CurvePlanner`."""
        feet = self._between(toes)
        speeds = self.passes.between(float(decision.predicted[0]), 0.0)
        way = self._away(feet, start, speeds, False)
        u, stride = self._leaving(node, feet, way, decision.controls)
        return replace(decision, controls=u, feasible=self._fits(way[0])), stride


class StopPlanner(StandPlanner):
    """Planner of the last step, and of the rest after it."""

    lands = True

    def decide(
        self, z: Array, target: Array | None = None, angles: tuple[float, float] = ANY_ANGLE
    ) -> Decision:
        """See :class:`~.planner.Planner`: the step after which the CoM comes to rest best."""

        def cost(step: Touchdown) -> float:
            found = self._between(step.toes).to_rest(step.state, True)
            return self._price(step, found)

        steps = self.passes.touchdowns(z, angles)
        return self._step(min(steps, key=cost) if steps else None, self.gait.state, 0.0)


class SpeedChangePlanner(SlopeCurves):
    """Planner of a step to another speed."""

    def decide(
        self, z: Array, target: Array | None = None, angles: tuple[float, float] = ANY_ANGLE
    ) -> Decision:
        """See :class:`~.planner.Planner`: the step after which the speed can be had best."""
        present = float(z[0])
        wanted = present if target is None else float(target[0])
        steps = self.passes.touchdowns(z, angles)
        speeds = self.passes.between(wanted, present)
        if not steps:
            over = self.passes.at(speeds[0])
            return self._step(None, over.vlo, over.stiffness)
        step, over = self._towards(steps, speeds[:: 1 + len(speeds) // _TRIALS])
        return self._step(step, over.vlo, over.stiffness)

    def _towards(
        self, steps: list[Touchdown], speeds: list[float]
    ) -> tuple[Touchdown, SingleSupportPass]:
        """The step after which the first of the speeds can be had, and the VLO it leads to."""
        best = (np.inf, steps[0], self.passes.at(speeds[0]))
        for speed in speeds:
            over = self.passes.at(speed)
            fits = False
            for step in steps:
                ends = self.passes.approach(over, step.toes[1])
                found, _ = self._between(step.toes).to_liftoff(step.state, ends, True)
                fits = fits or self._fits(found)
                price = self._price(step, found)
                if price < best[0]:
                    best = price, step, over
            if fits:
                break
        return best[1:]

    def curve(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """See :class:`~.planner.CurvePlanner`."""
        feet = self._between(toes)
        present = float(start[0, 1])
        speeds = self.passes.between(float(decision.predicted[0]), present)
        way = self._away(feet, start, speeds, True)
        u, stride = self._leaving(node, feet, way, decision.controls)
        return replace(decision, controls=u, feasible=self._fits(way[0])), stride


class DoubleSupportRecovery(SpeedChangePlanner):
    """Recovery of a walk that is too slow: both feet carry it to a liftoff that leads to VLO.

    On one leg the walk's planner chooses.

    Args:
        passes: over a leg.
        walk: the walk's planner.
    """

    def __init__(self, passes: PassTable, walk: LandingPlanner) -> None:
        super().__init__(passes)
        self._walk = walk
        self.gait = walk.gait

    def land(
        self, ahead: EndOfStride, decision: Decision, target: Array, free: Sequence[int]
    ) -> Decision:
        """See :meth:`~.planner.LandingPlanner.land`."""
        return decided(self._walk.land, ahead, decision, target, free)
