"""Planners of strides along curves: standing, starting to walk, changing speed, stopping, a step.

A step from a stand goes over one leg, whose foot stays, to where the other lands. It closes the
feet after a walk, and catches a stand that is pushed too hard. A step back is the mirror image of
one forward: all is planned forward, and turned round.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.embedding.free.catching import CatchingStep
from template_control.embedding.planners.planner import (
    Context,
    Decision,
    Planner,
    RestContext,
    settled,
)
from template_control.embedding.standing.curves import (
    PLACE,
    BetweenFeet,
    Found,
    StandingOptions,
    with_rest,
)
from template_control.embedding.standing.passes import (
    NIMBLE,
    STEP_DURATION,
    PassTable,
    SingleSupportPass,
    StepLanding,
    Touchdown,
    shifted,
    states_at,
)
from template_control.embedding.standing.pressure import curve_over
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome, Slot, StrideKind
from template_control.slip.dynamics.stride import Stride, controls
from template_control.slip.dynamics.timed import TERMS, Quintic, chained, timed_stride
from template_control.slip.gaits.gait import Gait, GaitsBySpeed
from template_control.slip.gaits.walking_by_speed import paper_walks, walking_by_speed
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, scaled

_CURVED = (
    StrideKind.STAND,
    StrideKind.STAND_TO_WALK,
    StrideKind.WALK_TO_STAND,
    StrideKind.CHANGE_SPEED,
)
_STEPS = (StrideKind.STEP_FORWARD, StrideKind.STEP_BACK)
_TRIALS = 6  # of speeds, where a step's angle is chosen
BEAT = 0.5
"""A stand is planned anew, and the route asked, after this time [s], for the reference template; a
step from a stand ends this long after its curve, when the robot has come to rest too."""
_LOW = 0.3  # of l0: the least height of the CoM that a catching step is planned with
_CATCHING = 4  # pieces of the CoM's way over one foot
_STEEP = 1.4  # touchdown angle of a step that is not planned yet [rad]
_SOON = 1e-3  # [s]
# Excess of a curve to a liftoff that is still followed, over l0: the QP keeps the centre of
# pressure inside. Without a step the robot would fall.
_LAUNCH = 0.05


def standing_gait(passes: PassTable, stride: str, duration: float) -> Gait:
    """A stand as a gait: a stride that returns to its state in a time [s]; no spring carries."""
    state, none = np.array([0.0, passes.options.height, 0.0]), np.zeros(NUM_SLOTS)
    return Gait("standing", passes.parameters, state, none, 0.0, duration, stride)


class CurvePlanner(Planner):
    """Planner of a stride whose CoM follows a curve in time while both feet stand.

    A stride that ends at rest leads to where one stands; another one to a liftoff from which the
    template passes VLO with the speed that is wanted. One that begins at VLO chooses its step
    before: the one after which rest, or that speed, can be had best.

    Args:
        passes: over a leg.
        stride: its kind.
        walk: the walk's planner, which chooses on one leg; None: nobody does.
    """

    def __init__(self, passes: PassTable, stride: str, walk: Planner | None = None) -> None:
        begin, end = AUTOMATON.sections(AUTOMATON.starts[stride])
        self._lands, self._rests = begin is not Event.REST, end is Event.REST
        self._passes, self._walk = passes, walk
        self._beat = BEAT * passes.scale.time
        self._launch = _LAUNCH * passes.parameters.rest_length
        self._speed = 0.0  # at VLO, to which the last curve leads [m/s]
        stand = standing_gait(passes, StrideKind.STAND, self._beat)
        self.gait: Gait = stand if walk is None else walk.gait

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: the ground is level again."""
        self.on_slope(0.0)

    def on_slope(self, slope: float) -> SlipParameters:
        """See :meth:`~.planner.Planner.on_slope`; CoM and feet are those of axes that lean."""
        if slope != self._passes.parameters.slope:
            self._passes = self._passes.on_slope(slope)
        return self._passes.parameters

    def decide(self, context: Context) -> Decision:
        """See :class:`~.planner.Planner`; what depends on the feet, ``curve`` chooses."""
        z, target, angles, *_ = context
        if not self._lands:
            if self._rests or target is None:
                target = self.gait.state
            u = self.gait.controls if self._rests else controls(_STEEP, 0.0, 0.0)
            return Decision(u, np.array(target), True, True, False)
        steps = self._passes.touchdowns(z, angles)
        if self._rests:
            step = min(steps, key=self._rest_price, default=None)
            end, stiffness = self.gait.state, 0.0
        else:
            present = float(z[0])
            wanted = present if target is None else float(target[0])
            step, over = self._towards(steps, self._passes.between(wanted, present))
            end, stiffness = over.vlo, over.stiffness
        k0 = self._passes.parameters.leg_stiffness
        angle, before = (_STEEP, k0) if step is None else step[:2]
        u = controls(angle, before, stiffness)
        return Decision(u, end.copy(), step is not None, True, False)

    def next_gait(self) -> Gait | None:
        """See :meth:`~.planner.Planner.next_gait`."""
        return None if self._rests else self._passes.family.nearest(self._speed)

    def decide_rest(self, context: RestContext) -> Decision | None:
        """See :meth:`~.planner.Planner.decide_rest`."""
        return None if self._walk is None else self._walk.decide_rest(context)

    def curve(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """See :meth:`~.planner.Planner.curve`."""
        feet = self._passes.feet(toes)
        if self._rests:
            found = feet.to_rest(start, self._lands)
            left = self._beat - sum(piece.duration for piece in found.pieces)
            stride = timed_stride(AUTOMATON, node, with_rest(found.pieces, left), toes)
            return replace(decision, feasible=feet.fits(found)), stride
        found, over, liftoff = self._away(feet, start, float(decision.predicted[0]))
        u = decision.controls.copy()
        u[Slot.K_SD] = over.stiffness
        first = timed_stride(AUTOMATON, node, found.pieces, toes)
        second = self._passes.arriving(first.node, liftoff, u, first.toes)
        speed = self._speed = float(over.vlo[0])
        slowest = self._passes.options.slowest
        lasts = found.excess <= self._launch if self._lands else speed >= slowest
        chosen = replace(
            decision,
            controls=u,
            feasible=lasts and feet.fits(found),
            lasting=lasts,
            accepted=None if speed == decision.predicted[0] else speed,
        )
        return chosen, chained(first, second)

    def _price(self, step: Touchdown, found: Found) -> float:
        """Of a step and the curve after it [m]."""
        return found.cost + self._passes.width_price(step.toes[1])

    def _rest_price(self, step: Touchdown) -> float:
        return self._price(step, self._passes.feet(step.toes).to_rest(step.state, True))

    def _towards(
        self, steps: list[Touchdown], speeds: list[float]
    ) -> tuple[Touchdown | None, SingleSupportPass]:
        """The step after which the first of the speeds can be had, and the VLO it leads to."""
        best: tuple[float, Touchdown | None, SingleSupportPass]
        best = np.inf, None, self._passes.at(speeds[0])
        for speed in speeds[:: 1 + len(speeds) // _TRIALS] if steps else ():
            over = self._passes.at(speed)
            fits = False
            for step in steps:
                feet = self._passes.feet(step.toes)
                ends = shifted(over.way, step.toes[1])
                found, _ = feet.to_liftoff(step.state, ends, True)
                fits = fits or feet.fits(found)
                price = self._price(step, found)
                if price < best[0]:
                    best = price, step, over
            if fits:
                break
        return best[1:]

    def _away(
        self, feet: BetweenFeet, start: Array, wanted: float
    ) -> tuple[Found, SingleSupportPass, Array]:
        """Curve to a liftoff (2, 3), with the first speed at VLO that there is a curve to."""
        ways, present = [], float(start[0, 1])
        if not self._lands:
            wanted, present = max(wanted, self._passes.options.slowest), 0.0
        for speed in self._passes.between(wanted, present):
            over = self._passes.at(speed)
            ends = shifted(over.way, feet.toes[1])
            found, i = feet.to_liftoff(start, ends, self._lands)
            ways.append((found, over, ends[i]))
            if feet.fits(found):
                return ways[-1]
        return min(ways, key=lambda way: way[0].cost)


class Away(NamedTuple):
    """A curve to a liftoff, and the landing after it."""

    found: Found
    liftoff: Array  # (2, 3) state of the CoM
    stiffness: float  # of the leg that stays [N/m]
    landing: StepLanding
    price: float  # of both [m]


_Made = tuple[Array, bool, Stride]
"""Controls of the rest of a step, whether it can be made, and its stride."""


class StepPlanner(Planner):
    """Planner of one step from a stand to a stand.

    Args:
        passes: over a leg.
        stride: which of the automaton's it makes; the first leg to lift off gives its direction.
    """

    def __init__(self, passes: PassTable, stride: str) -> None:
        first = AUTOMATON.start(stride)
        ahead = first.edge(Event.REAR_LIFTOFF) is not None
        self._way = 1.0 if ahead else -1.0
        lifts = Event.REAR_LIFTOFF if ahead else Event.FRONT_LIFTOFF
        self._single = AUTOMATON.successor(first.name, lifts)
        self._ways = {
            first.name: self._lift,
            self._single: self._swing,
            AUTOMATON.successor(self._single, Event.TOUCHDOWN): self._rest,
        }
        self._passes, self._steps = passes, passes.steps
        self._launch = _LAUNCH * passes.parameters.rest_length
        self._beat = BEAT * passes.scale.time
        self.gait: Gait = standing_gait(passes, stride, STEP_DURATION * passes.scale.time)

    def decide(self, context: Context) -> Decision:
        """See :class:`~.planner.Planner`: what is chosen depends on the feet, so ``curve`` does."""
        return settled(self.gait)

    def curve(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """See :meth:`~.planner.Planner.curve`."""
        u, feasible, stride = self._ways[node](node, start, toes, decision.controls)
        return replace(decision, controls=u, feasible=feasible), stride

    def catch(
        self, node: str, start: Array, toes: tuple[float, float], step: CatchingStep
    ) -> tuple[Decision, Stride]:
        """A step that catches the robot: over the other foot as over a centre of pressure at rest.

        Args:
            node: the first, or single stance.
            start: as for :meth:`curve`.
            toes: the same.
            step: which it is.
        """
        lifts = None
        if node != self._single:
            soon = _straight(start)
            lifts = timed_stride(AUTOMATON, node, [soon], toes)
            start, toes = soon.end(), toes if self._way < 0.0 else toes[::-1]
        end = np.array([[0.0, 0.0, 0.0], [self.gait.state[1], 0.0, 0.0]])
        p = self._passes.parameters
        height = max(float(start[1, 0]), _LOW * p.rest_length)  # of a robot that falls
        rates = np.full(_CATCHING, np.sqrt(p.gravity / height))
        pressures = np.full(_CATCHING, step.pressure)
        pieces = curve_over(start, end, step.lasts, pressures, rates)
        over = timed_stride(AUTOMATON, self._single, pieces, (toes[0], np.nan))
        both, first = (toes[0], step.foothold), settled(self.gait)
        _, feasible, rests = self._rest(over.node, pieces[-1].end(), both, first.controls)
        stride = chained(replace(over, toes=np.array(both)), rests)
        decision = replace(first, feasible=feasible)
        return decision, stride if lifts is None else chained(lifts, stride)

    def _lift(self, node: str, start: Array, toes: tuple[float, float], u: Array) -> _Made:
        """Both feet stand: to the liftoff from which the step ends best."""
        ahead = self._turned(start)
        feet = self._passes.feet(toes if self._way > 0.0 else (-toes[1], -toes[0]))
        away = self._best_away(feet, ahead)
        u = self._controls(away.landing.angle, away.stiffness)
        first = timed_stride(AUTOMATON, node, self._back(away.found.pieces), toes)
        stands = first.toes if self._way > 0.0 else np.array(toes)
        second, _ = self._landed(self._turned(away.liftoff), u, stands)
        middle = feet.place(PLACE) - feet.margin
        fits = away.found.excess <= self._launch and self._passes.capture(ahead) >= middle
        return u, fits, chained(first, second)

    def _best_away(self, feet: BetweenFeet, start: Array) -> Away:
        """The curve to a liftoff, forward, after which the step ends best."""
        passes, ways = self._passes, []
        nimble = NIMBLE * passes.scale.speed
        for stiffness, times, states, landing in self._steps:
            far = feet.spacing + landing.toe
            in_time = landing.time - times >= far / nimble
            in_time[0] = True  # whatever it is, it has to do
            ends = shifted(states[in_time], feet.toes[1])
            for loads in (True, False):
                found, i = feet.to_liftoff(start, ends, loads)
                ways.append(Away(found, ends[i], stiffness, landing, found.cost + landing.price))
                if feet.fits(found):
                    break
        if not any(feet.fits(away.found) for away in ways):
            # At once: the CoM may be past the foot that stays.
            stiffness = passes.carrying(start, feet.toes[1])
            best = passes.best_landing(start, stiffness, feet.toes[::-1])
            if best is not None:
                soon, price = _straight(start), passes.hurried(best, feet.toes[0])
                now = Found((soon,), 0.0, 0.0)
                ways.append(Away(now, soon.end(), stiffness, best, price))
        return min(ways, key=lambda away: away.price)

    def _swing(self, node: str, start: Array, toes: tuple[float, float], u: Array) -> _Made:
        """One foot stands: to the landing after which the CoM comes to rest best.

        The foot cannot take it up where the CoM falls to the other side. A leg whose stiffness
        nobody has chosen yet carries the weight.
        """
        passes, ahead = self._passes, self._turned(start)
        foot = (self._way * toes[0], self._way * toes[1])
        stiffness = float(u[Slot.K_SC]) or passes.carrying(ahead, foot[0])
        best = passes.best_landing(ahead, stiffness, foot)
        if best is not None:
            u = self._controls(best.angle, stiffness)
        stride, landed = self._landed(start, u, np.array(toes))
        return u, landed and passes.capture(ahead) > foot[0], stride

    def _rest(self, node: str, start: Array, toes: tuple[float, float], u: Array) -> _Made:
        """The foot has landed: the curve to rest, seen in the direction of the step."""
        feet = self._passes.feet((self._way * toes[0], self._way * toes[1]))
        found = feet.to_rest(self._turned(start), True)
        pieces = self._back(with_rest(found.pieces, self._beat))
        return u, feet.fits(found), timed_stride(AUTOMATON, node, pieces, toes)

    def _turned(self, state: Array) -> Array:
        """(2, 3) x and y with their derivatives, seen in the direction of the step."""
        return state * np.array([[self._way], [1.0]])

    def _back(self, pieces: tuple[Quintic, ...]) -> list[Quintic]:
        """The pieces of a curve, planned forward, in the world."""
        return [Quintic(self._turned(piece.coefficients), piece.duration) for piece in pieces]

    def _controls(self, angle: float, stiffness: float) -> Array:
        """Controls of a step with a touchdown angle as seen in its direction."""
        return controls(angle if self._way > 0.0 else np.pi - angle, stiffness, 0.0)

    def _landed(self, state: Array, u: Array, toes: Array) -> tuple[Stride, bool]:
        """The stride from single stance (2, 3) to rest, and whether the foot lands."""
        stride = self._passes.arriving(self._single, state, u, toes)
        landing = next((e for e in stride.events if e.event is Event.TOUCHDOWN), None)
        if landing is None:
            return stride, False
        rows = int(np.searchsorted(stride.meta[:, 0], landing.time - 1e-12))
        foot = float(landing.state[0] + self._passes.parameters.rest_length * np.cos(u[0]))
        both = (float(toes[0]), foot)
        cut = replace(
            stride,
            outcome=Outcome.SECTION,
            node=landing.target,
            state=landing.state,
            toes=np.array(both),
            duration=landing.time,
            events=(landing,),
            cx=stride.cx[:rows],
            cy=stride.cy[:rows],
            meta=stride.meta[:rows],
        )
        end = states_at(stride, np.nextafter(landing.time, 0.0))[0]
        *_, rest = self._rest(landing.target, end, both, u)
        return chained(cut, rest), True


def _straight(start: Array) -> Quintic:
    """A moment from a start (2, 3), in which the CoM moves on."""
    on = np.zeros((2, TERMS))
    on[:, :2] = start[:, :2]
    return Quintic(on, _SOON)


def gaits_by_speed(parameters: SlipParameters) -> GaitsBySpeed:
    """The gaits of the family by speed, with push-off; slower walks pass over a stiff leg.

    Args:
        parameters: the template.
    """
    return walking_by_speed().chains[-1].gaits(parameters)


def recovery_planners(walk: Planner, options: StandingOptions) -> dict[str, Planner]:
    """Planners of what a slow walk breaks into: both feet carry it on, or it stops and starts.

    The options are for the reference template.
    """
    p = walk.gait.parameters
    passes = PassTable(p, scaled(options, Scale.of(p)), gaits_by_speed(p))
    return {
        StrideKind.CHANGE_SPEED: CurvePlanner(passes, StrideKind.CHANGE_SPEED, walk),
        StrideKind.WALK_TO_STAND: CurvePlanner(passes, StrideKind.WALK_TO_STAND),
        StrideKind.STEP_BACK: StepPlanner(passes, StrideKind.STEP_BACK),
        StrideKind.STAND_TO_WALK: CurvePlanner(passes, StrideKind.STAND_TO_WALK),
    }


@checked
def standing_planners(
    parameters: SlipParameters,
    options: StandingOptions | None = None,
    family: GaitsBySpeed | None = None,
) -> dict[str, Planner]:
    """A planner for standing, starting to walk, stopping, changing a walk's speed, and a step.

    Args:
        parameters: the template.
        options: tuning, for the reference template.
        family: the gaits that a walk may have, such as :func:`gaits_by_speed`; None: the library's
            own.
    """
    gaits = family or paper_walks(parameters)
    o = scaled(options or StandingOptions(), Scale.of(parameters))
    passes = PassTable(parameters, o, gaits)
    curves: dict[str, Planner] = {kind: CurvePlanner(passes, kind) for kind in _CURVED}
    return curves | {kind: StepPlanner(passes, kind) for kind in _STEPS}
