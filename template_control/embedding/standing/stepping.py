"""A step from a stand to a stand: over one leg, whose foot stays, to where the other lands.

It closes the feet after a walk, and catches a stand that is pushed too hard. A step back is the
mirror image of one forward: all is planned forward, and turned round.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.embedding.com_path import TERMS, Quintic, chained, timed_stride
from template_control.embedding.planners.planner import Decision, LandingPlanner, Planner
from template_control.embedding.standing.curves import BetweenFeet, Found
from template_control.embedding.standing.options import PLACE, StandingOptions
from template_control.embedding.standing.passes import (
    NIMBLE,
    STEP_DURATION,
    GaitsBySpeed,
    LandingTable,
    PassTable,
    StepPass,
)
from template_control.embedding.standing.planners import (
    Curves,
    DoubleSupportRecovery,
    SpeedChangePlanner,
    StandingGait,
    StandPlanner,
    StartPlanner,
    StopPlanner,
)
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome, Slot, StrideKind
from template_control.slip.dynamics.stride import Stride
from template_control.slip.gaits.walking_by_speed import speed_range, walking_by_speed, walking_gait
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, scaled

Array = NDArray[np.float64]

_SOON = 1e-3  # [s]
_LAUNCH = 0.05  # excess with which a step is still made, over l0; without it the robot would fall


class Away(NamedTuple):
    """A curve to a liftoff, and the pass from there.

    Attributes:
        found: the curve.
        over: the pass.
        liftoff: (2, 3) x and y at liftoff, each position, velocity and acceleration.
        price: of all [m].
    """

    found: Found
    over: StepPass
    liftoff: Array
    price: float


class StepPlanner(Curves):
    """Planner of one step from a stand to a stand.

    Args:
        passes: over a leg.
        stride: which of the automaton's it makes; the leg that lifts off first tells its direction.
        landings: of another such planner, to share; None: its own.
        automaton: of the strides.
    """

    def __init__(
        self,
        passes: PassTable,
        stride: str,
        landings: LandingTable | None = None,
        automaton: Automaton = AUTOMATON,
    ) -> None:
        super().__init__(passes, automaton)
        first = automaton.start(stride)
        ahead = first.edge(Event.REAR_LIFTOFF) is not None
        self._way = 1.0 if ahead else -1.0
        lifts = Event.REAR_LIFTOFF if ahead else Event.FRONT_LIFTOFF
        self._single = automaton.successor(first.name, lifts)
        self._ways = {
            first.name: self._lift,
            self._single: self._swing,
            automaton.successor(self._single, Event.TOUCHDOWN): self._rest,
        }
        self._launch = _LAUNCH * self.parameters.rest_length
        self.landings = landings or LandingTable(passes, self._single)
        gait = StandingGait.of(self.parameters, self.options)
        self.gait = replace(gait, stride=stride, step_duration=STEP_DURATION * passes.scale.time)

    def curve(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """See :class:`~.planner.CurvePlanner`."""
        return self._ways[node](node, start, toes, decision)

    def _lift(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """Both feet stand: to the liftoff from which the step ends best."""
        ahead = self._turned(start)
        feet = self._between(toes if self._way > 0.0 else (-toes[1], -toes[0]))
        away = self._best_away(feet, ahead)
        u = self._controls(away.over.landing.angle, away.over.stiffness)
        first = timed_stride(self.automaton, node, self._back(away.found.pieces), toes)
        state = self._turned(away.liftoff)[:, :2].T.ravel()
        stands = first.toes if self._way > 0.0 else np.array(toes)
        second, _ = self._landed(state, u, stands)
        middle = feet.place(PLACE) - feet.margin
        fits = away.found.excess <= self._launch and self.landings.capture(ahead) >= middle
        return replace(decision, controls=u, feasible=fits), chained(first, second)

    def _best_away(self, feet: BetweenFeet, start: Array) -> Away:
        """The curve to a liftoff, forward, after which the step ends best."""
        ways, nimble = [], NIMBLE * self.passes.scale.speed
        for over in self.landings.known:
            far = feet.spacing + over.landing.toe
            in_time = over.landing.time - over.times >= far / nimble
            in_time[0] = True  # whatever it is, it has to do
            ends = over.states[in_time].copy()
            ends[:, 0, 0] += feet.toes[1]
            for loads in (True, False):
                found, i = feet.to_liftoff(start, ends, loads)
                ways.append(Away(found, over, ends[i], found.cost + over.landing.price))
                if self._fits(found):
                    break
        if not any(self._fits(away.found) for away in ways):
            ways += self._at_once(feet, start)
        return min(ways, key=lambda away: away.price)

    def _at_once(self, feet: BetweenFeet, start: Array) -> list[Away]:
        """The liftoff that is made now: the CoM may be past the foot that stays."""
        stiffness = self.landings.carrying(start, feet.toes[1])
        best = self.landings.best(start, stiffness, feet.toes[::-1])
        if best is None:
            return []
        on = np.zeros((2, TERMS))
        on[:, :2] = start[:, :2]
        soon = Quintic(on, _SOON)
        price = self.landings.hurried(best, feet.toes[0])
        over = StepPass(stiffness, np.zeros(0), np.zeros(0), best)
        return [Away(Found((soon,), 0.0, 0.0), over, soon.end(), price)]

    def _swing(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """One foot stands: to the landing after which the CoM comes to rest best.

        The foot cannot take it up where the CoM falls to the other side. A leg whose stiffness
        nobody has chosen yet carries the weight.
        """
        ahead = self._turned(start)
        foot = (self._way * toes[0], self._way * toes[1])
        stiffness = float(decision.controls[Slot.K_SC]) or self.landings.carrying(ahead, foot[0])
        best = self.landings.best(ahead, stiffness, foot)
        u = decision.controls
        if best is not None:
            u = self._controls(best.angle, stiffness)
        stride, landed = self._landed(start[:, :2].T.ravel(), u, np.array(toes))
        falls = self.landings.capture(ahead) > foot[0]
        return replace(decision, controls=u, feasible=landed and falls), stride

    def _rest(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """The foot has landed: to rest."""
        found, stride = self._to_rest(node, start, toes)
        return replace(decision, feasible=self._fits(found)), stride

    def _to_rest(self, node: str, start: Array, toes: tuple[float, float]) -> tuple[Found, Stride]:
        """The curve to rest, seen in the direction of the step, and its stride in the world."""
        feet = self._between((self._way * toes[0], self._way * toes[1]))
        found = feet.to_rest(self._turned(start), True)
        pieces = self._back(self._stilled(found, self.beat))
        return found, timed_stride(self.automaton, node, pieces, toes)

    # -- both ways --------------------------------------------------------------------

    def _turned(self, state: Array) -> Array:
        """(2, 3) x and y with their derivatives, seen in the direction of the step."""
        return state * np.array([[self._way], [1.0]])

    def _back(self, pieces: tuple[Quintic, ...]) -> list[Quintic]:
        """The pieces of a curve, planned forward, in the world."""
        return [Quintic(self._turned(piece.coefficients), piece.duration) for piece in pieces]

    def _controls(self, angle: float, stiffness: float) -> Array:
        """Controls of a step with a touchdown angle as seen in its direction."""
        u = np.zeros(NUM_SLOTS)
        u[Slot.TOUCHDOWN_ANGLE] = angle if self._way > 0.0 else np.pi - angle
        u[Slot.K_SC] = stiffness
        return u

    def _landed(self, state: Array, u: Array, toes: Array) -> tuple[Stride, bool]:
        """The stride from single stance to rest, and whether the foot lands."""
        stride = self.passes.arriving(self._single, state, u, toes)
        events = [event for event in stride.events if event.event is Event.TOUCHDOWN]
        if not events:
            return stride, False
        landing = events[0]
        rows = int(np.searchsorted(stride.meta[:, 0], landing.time - 1e-12))
        foot = float(landing.state[0] + self.parameters.rest_length * np.cos(u[0]))
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
        end = stride.sample(np.nextafter(landing.time, 0.0))[0].reshape(3, 2).T
        _, rest = self._to_rest(landing.target, end, both)
        return chained(cut, rest), True


def gaits_by_speed(parameters: SlipParameters) -> GaitsBySpeed:
    """The gaits of the family by speed, with push-off; slower walks pass over a stiff leg.

    Args:
        parameters: the template.
    """
    chain = walking_by_speed().chains[-1]
    unit = parameters.speed_unit
    ends = (float(chain.vlo_speed[0]) * unit, float(chain.vlo_speed[-1]) * unit)
    return GaitsBySpeed(partial(chain.gait, parameters), ends)


def recovery_planners(walk: Planner, options: StandingOptions) -> dict[str, Planner]:
    """Planners of what a slow walk breaks into: it is carried on, or stands and starts again.

    Args:
        walk: the walk's planner.
        options: tuning, for the reference template.
    """
    p = walk.gait.parameters
    passes = PassTable(p, scaled(options, Scale.of(p)), gaits_by_speed(p))
    change = SpeedChangePlanner(passes)
    if isinstance(walk, LandingPlanner):
        change = DoubleSupportRecovery(passes, walk)
    return {
        StrideKind.CHANGE_SPEED: change,
        StrideKind.WALK_TO_STAND: StopPlanner(passes),
        StrideKind.STEP_BACK: StepPlanner(passes, StrideKind.STEP_BACK),
        StrideKind.STAND_TO_WALK: StartPlanner(passes),
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
    gaits = family or GaitsBySpeed(partial(walking_gait, parameters), speed_range(parameters))
    passes = PassTable(
        parameters, scaled(options or StandingOptions(), Scale.of(parameters)), gaits
    )
    forward = StepPlanner(passes, StrideKind.STEP_FORWARD)
    return {
        StrideKind.STAND: StandPlanner(passes),
        StrideKind.STAND_TO_WALK: StartPlanner(passes),
        StrideKind.WALK_TO_STAND: StopPlanner(passes),
        StrideKind.CHANGE_SPEED: SpeedChangePlanner(passes),
        StrideKind.STEP_FORWARD: forward,
        StrideKind.STEP_BACK: StepPlanner(passes, StrideKind.STEP_BACK, forward.landings),
    }
