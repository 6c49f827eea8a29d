"""Planners of strides along curves: standing, starting to walk, changing speed, stopping, a step.

A step from a stand goes over one leg, whose foot stays, to where the other lands. It closes the
feet after a walk, and catches a stand that is pushed too hard. A step back is the mirror image of
one forward: all is planned forward, and turned round.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np

from template_control.arrays import Array, Pair
from template_control.checks.checked import checked
from template_control.embedding.planners.planner import Context, Decision, Planner, RestContext
from template_control.embedding.standing.curves import PLACE, BetweenFeet, Found, StandingOptions
from template_control.embedding.standing.passes import PassTable, SingleSupportPass
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Slot, StrideKind
from template_control.slip.dynamics.stride import Stride, chained, controls
from template_control.slip.dynamics.timed import Quintic, timed_stride
from template_control.slip.gaits.gait import Gait, GaitsBySpeed
from template_control.slip.gaits.walking_by_speed import gaits_by_speed, paper_walks
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.catching import CatchingStep
from template_control.slip.similarity import Scale, scaled

STEPS = (StrideKind.STEP_FORWARD, StrideKind.STEP_BACK)
"""Strides that step from a stand to a stand."""
_PLANNED = (
    StrideKind.STAND,
    StrideKind.STAND_TO_WALK,
    StrideKind.WALK_TO_STAND,
    StrideKind.CHANGE_SPEED,
    *STEPS,
)
BEAT = 0.5
"""A stand is planned anew, and the route asked, after this time [s], for the reference template; a
step from a stand ends this long after its curve, when the robot has come to rest too."""
STEP_DURATION = 1.5
"""Duration of a step from a stand, about [s], for the reference template."""
_STILL = 0.1  # least time in which the CoM rests where its curve has led it [s]
# How far behind the middle of the feet the capture point may be before a step, over l0.
_BEHIND = 0.01
_OFF = 0.1  # excess that counts as much as a speed at VLO which is off by 1 m/s [s]
_STEEP = 1.4  # touchdown angle of a step that is not planned yet [rad]
# Excess of a curve to a liftoff that is still followed, over l0: the QP keeps the centre of
# pressure inside. Without a step the robot would fall.
_LAUNCH = 0.05


class CurvePlanner(Planner):
    """Planner of a stride whose CoM follows a curve in time.

    While both feet stand it leads to rest where one stands, or to a liftoff: one from which the
    template passes VLO with the speed that is wanted, or that of a step from a stand to a stand,
    over the foot that stays. A stride that begins at VLO chooses its step before, after which rest,
    or that speed, can be had best.

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
        length = passes.parameters.rest_length
        self._launch, self._behind = _LAUNCH * length, _BEHIND * length
        self._speed = 0.0  # at VLO, to which the last curve leads [m/s]
        self._steps = stride in STEPS
        back = AUTOMATON.start(stride).edge(Event.FRONT_LIFTOFF) is not None
        self._way = -1.0 if back else 1.0
        lasts, kind = self._beat, StrideKind.STAND
        if self._steps:
            lasts, kind = STEP_DURATION * passes.scale.time, StrideKind(stride)
        state, none = np.array([0.0, passes.options.height, 0.0]), np.zeros(NUM_SLOTS)
        # No spring carries: a stride that returns to its state in some time.
        stand = Gait("standing", passes.parameters, state, none, 0.0, lasts, kind)
        self.gait: Gait = stand if walk is None else walk.gait

    def reset(self) -> None:
        """See :class:`~.planner.Planner`: the ground is level again."""
        self.on_slope(0.0)

    def on_slope(self, slope: float) -> SlipParameters | None:
        """See :meth:`~.planner.Planner.on_slope`; CoM and feet are those of axes that lean."""
        if self._steps:
            return None
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
        passes, end, stiffness = self._passes, self.gait.state, 0.0
        speeds: list[float] = []
        if not self._rests:
            present = float(z[0])
            speeds = passes.between(present if target is None else float(target[0]), present)
        step = passes.best_touchdown(z, angles, speeds)
        if speeds:
            over = passes.at(speeds[0] if step is None else step.speed)
            end, stiffness = over.vlo, over.stiffness
        angle, before = (_STEEP, passes.parameters.leg_stiffness) if step is None else step[:2]
        u = controls(angle, before, stiffness)
        return Decision(u, end.copy(), step is not None, True, False)

    def next_gait(self) -> Gait | None:
        """See :meth:`~.planner.Planner.next_gait`."""
        return None if self._rests else self._passes.family.nearest(self._speed)

    def decide_rest(self, context: RestContext) -> Decision | None:
        """See :meth:`~.planner.Planner.decide_rest`."""
        return None if self._walk is None else self._walk.decide_rest(context)

    def curve(
        self,
        node: str,
        start: Array,
        toes: Pair,
        decision: Decision,
        catching: CatchingStep | None = None,
    ) -> tuple[Decision, Stride]:
        """See :meth:`~.planner.Planner.curve`.

        ``catching`` is the step that catches the robot, over the foot that stays as over a centre
        of pressure at rest; None: the planner's own step.
        """
        here = AUTOMATON.node(node)
        if here.edge(Event.REST) is not None:
            way, lands = self._way, self._lands or self._steps
            feet = self._passes.feet((way * toes[0], way * toes[1]))
            found = feet.to_rest(self._turned(start), lands)
            stride = timed_stride(AUTOMATON, node, self._resting(feet, found.pieces), toes)
            return replace(decision, feasible=feet.fits(found)), stride
        if self._steps:
            return self._step(node, start, toes, decision, catching)
        feet = self._passes.feet(toes)
        found, over = self._away(feet, start, float(decision.predicted[0]))
        u = decision.controls.copy()
        u[Slot.K_SD] = over.stiffness
        first = timed_stride(AUTOMATON, node, found.pieces, toes)
        liftoff = found.pieces[-1].end()[:, :2].T.ravel()
        second = self._passes.simulator.run(first.node, liftoff, u, first.toes)
        speed = self._speed = float(over.vlo[0])
        slowest = self._passes.options.slowest
        # A walk that falls back comes to rest first.
        carried = start[0, 1] > 0.0 and found.excess <= self._launch
        lasts = carried if self._lands else speed >= slowest
        chosen = replace(
            decision,
            controls=u,
            feasible=lasts and feet.fits(found),
            lasting=lasts,
            accepted=None if speed == decision.predicted[0] else speed,
        )
        return chosen, chained(first, second)

    def _away(
        self, feet: BetweenFeet, start: Array, wanted: float
    ) -> tuple[Found, SingleSupportPass]:
        """Curve to a liftoff, with the first speed at VLO that there is a curve to."""
        ways, present, front = [], float(start[0, 1]), np.zeros((2, 3))
        front[0, 0] = feet.toes[1]
        if not self._lands:
            wanted, present = max(wanted, self._passes.options.slowest), 0.0
        speeds = self._passes.between(wanted, present)
        i, fails, holds = 0, 0, len(speeds)
        while i < holds:
            over = self._passes.at(speeds[i])
            # From rest there is time to come to any of them.
            ends = over.way if self._lands else over.way[::2]
            found = feet.to_liftoff(start, ends + front, self._lands)
            if feet.fits(found):
                ways, holds = [(found, over)], i
            else:
                fails = i
                if holds == len(speeds):
                    ways.append((found, over))
            i = (fails + holds + 1) // 2
        off = _OFF * self._passes.scale.time
        return min(ways, key=lambda way: way[0].cost + off * abs(float(way[1].vlo[0]) - wanted))

    def _resting(self, feet: BetweenFeet, pieces: tuple[Quintic, ...]) -> list[Quintic]:
        """A curve to rest with some time in which the robot comes to it, in the world."""
        left = self._beat - (0.0 if self._steps else sum(piece.duration for piece in pieces))
        last = max(left, _STILL * self._passes.scale.time)
        rest = Quintic.between(pieces[-1].end(), feet.at_rest(feet.place(PLACE)), last)
        return self._back((*pieces, rest))

    def _step(
        self,
        node: str,
        start: Array,
        toes: Pair,
        decision: Decision,
        catching: CatchingStep | None,
    ) -> tuple[Decision, Stride]:
        """To rest by a step over the foot that stays; the other one lifts off first, or has."""
        way, passes, ahead = self._way, self._passes, self._turned(start)
        lifted = len(AUTOMATON.node(node).stance) == 1
        lifts, stays = toes if way > 0.0 and not lifted else toes[::-1]
        feet = passes.feet((way * lifts, way * stays))
        if catching is not None:
            at, over = way * catching.foothold, way * catching.pressure
            catching = catching._replace(foothold=at, pressure=over)
        found, foothold = feet.by_step(ahead, lifted, catching)
        resting = self._resting(passes.feet((feet.toes[1], foothold)), found.parts[-1])
        alone, both = (stays, np.nan), (stays, way * foothold)
        parts = [*map(self._back, found.parts[:-1]), resting]
        ground = (alone, both) if lifted else (toes, alone, both)
        strides = []
        for pieces, on in zip(parts, ground, strict=True):
            strides.append(timed_stride(AUTOMATON, node, pieces, on))
            node = strides[-1].node
        stride = reduce(chained, strides)
        if catching is not None:
            return replace(decision, feasible=feet.fits(found)), stride
        behind = feet.toes[1] if lifted else feet.place(PLACE) - self._behind
        fits = (lifted or found.excess <= self._launch) and feet.capture(ahead) > behind
        return replace(decision, feasible=fits), stride

    def _turned(self, state: Array) -> Array:
        """(2, 3) x and y with their derivatives, seen in the direction of the step."""
        return state * np.array([[self._way], [1.0]])

    def _back(self, pieces: tuple[Quintic, ...]) -> list[Quintic]:
        """The pieces of a curve, planned forward, in the world."""
        return [Quintic(self._turned(piece.coefficients), piece.duration) for piece in pieces]


def recovery_planners(walk: Planner, options: StandingOptions) -> dict[str, Planner]:
    """Planners of what a slow walk breaks into: both feet carry it on, or it stops and starts.

    The options are for the reference template.
    """
    p = walk.gait.parameters
    passes = PassTable(p, scaled(options, Scale.of(p)), gaits_by_speed(p))
    return {
        StrideKind.CHANGE_SPEED: CurvePlanner(passes, StrideKind.CHANGE_SPEED, walk),
        StrideKind.WALK_TO_STAND: CurvePlanner(passes, StrideKind.WALK_TO_STAND),
        StrideKind.STEP_BACK: CurvePlanner(passes, StrideKind.STEP_BACK),
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
        family: the gaits that a walk may have, such as :func:`.gaits_by_speed`; None: the library's
            own.
    """
    gaits = family or paper_walks(parameters)
    o = scaled(options or StandingOptions(), Scale.of(parameters))
    passes = PassTable(parameters, o, gaits)
    return {kind: CurvePlanner(passes, kind) for kind in _PLANNED}
