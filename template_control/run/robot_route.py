"""Routes on the template of a robot: scenarios, stands, and what cannot be had in time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from template_control.checks.checked import checked
from template_control.checks.fitting import inward
from template_control.embedding.free.motion import SOLE_STAND
from template_control.embedding.planners.ahead import AheadPlanner
from template_control.embedding.planners.planner import Context
from template_control.embedding.planners.running import AGILE
from template_control.embedding.standing.curves import StandingOptions
from template_control.errors import ScenarioError
from template_control.robot.biped import Biped
from template_control.robot.template import can_stand, template_for
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.dynamics.stride import StrideSimulator
from template_control.slip.gaits.running_gait import running_speeds, suited_height
from template_control.slip.gaits.walking_by_speed import gaits_by_speed, speed_range
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.gait_table import STATE, gait_table, row_at
from template_control.slip.scenario.route import Route
from template_control.slip.scenario.scenario import STAND, Scenario
from template_control.slip.scenario.scenario_route import ScenarioRoute
from template_control.slip.similarity import Scale, scaled
from template_control.whole_body.solver import SOLE_SHARE

_RANGES = {"walk": (speed_range, "at VLO"), "run": (running_speeds, "at apex")}
_STRIDE = 0.7  # of sqrt(l0 / g): the duration of a fast running stride
_LIFTED = 0.03  # shortest time on a pair of feet before VLO; the other has nothing to pass [s]
_PASSED = 0.08  # the same on a sole: the other one, a step behind, swings past it [s]
_SHIFT = 0.8  # time in which a CoM at rest moves over one of two soles or pairs [s], for l0 = 1 m
# dx/dt at VLO of a start [m/s], for l0 = 1 m. The step of G1 after a slow one takes a second, and
# it falls sideways: in 8 of 12 starts at 0.13 to 0.21 m/s, and in none of 9 at 0.26 or more.
_SLOWEST_START = 0.3
_BEHIND = 0.08  # of the wanted speed, that is none [m/s], for the reference
_MOST_STRIDES = 1000  # that are rehearsed, of a route that does not end


def standing_options(robot: Biped) -> StandingOptions:
    """Options of a robot's stand, for the reference template; the height is the library's."""
    if not robot.half_length:
        return StandingOptions()
    length = Scale.of(template_for(robot)).length
    half = robot.half_length / length
    if not robot.patches:
        return StandingOptions(half_length=half, shift=_SHIFT, single=_LIFTED)
    slant = SOLE_SHARE * robot.half_width / (SOLE_STAND * length)
    return StandingOptions(
        half_length=half, slant=slant, shift=_SHIFT, single=_PASSED, slowest=_SLOWEST_START
    )


@checked
def robot_route(robot: Biped, scenario: Scenario, push_off: bool | None = None) -> ScenarioRoute:
    """The scenario on the robot's own template.

    Args:
        robot: its last update is overwritten.
        scenario: speeds in m/s, as they are; its heights are scaled with l0.
        push_off: whether its walk has the gaits of the family by speed, in steps with push-off,
            and their heights at VLO; None: wherever it may. Its planner then takes the nearest
            speed where a segment wants what cannot be had.

    Raises:
        ScenarioError: if a segment stands, and the robot cannot; if the start, or a segment of
            another walk, wants a speed that no gait of the robot has, or a segment a change of
            speed that is beyond a stride's reach.
    """
    if scenario.stands and not can_stand(robot):
        number = next(i for i, s in enumerate(scenario.segments, 1) if s.gait == STAND)
        raise ScenarioError(
            f"segment {number} stands: {robot.name} has a floating base and cannot stand on two"
            " feet that are points; leave the stands out, or take a robot with four legs"
        )
    own = scenario.on(template_for(robot))
    p = own.parameters
    unit = p.speed_unit
    bears = robot.half_length > 0.0
    may = own.has_any_speed(bears)
    if push_off and not may:
        raise ScenarioError(
            "the scenario does more than walk: its walk has no push-off; leave planner ahead out"
        )
    push_off = may if push_off is None else push_off
    if not push_off:
        _check_segments(robot, own)
    slowest, fastest = gaits_by_speed(p).speeds if push_off else speed_range(p)
    moves = own.segments[0].gait in _RANGES
    if moves and not slowest <= own.start[0] <= fastest:
        raise ScenarioError(
            f"the start has {own.start[0]:g} m/s at VLO: {robot.name} walks from"
            f" {inward(slowest, fastest)} m/s"
        )
    return ScenarioRoute(
        own,
        lambda speed: suited_height(speed / unit) * p.rest_length,
        vlo_height=_family_height(p) if push_off else None,
        walks=StrideKind.WALK_PUSH_OFF if push_off else StrideKind.WALK,
        bears=bears,
    )


def _family_height(p: SlipParameters) -> Callable[[float], float]:
    table = gait_table(p)
    return lambda speed: float(row_at(table, speed)[STATE + 1])


def _check_segments(robot: Biped, own: Scenario) -> None:
    """Refuse speeds that no gait has, and changes that no stride makes, whatever its motors."""
    p = own.parameters
    most = scaled(AGILE, Scale.of(p)).pace / (_STRIDE * float(np.sqrt(p.rest_length / p.gravity)))
    for number, segment in enumerate(own.segments, 1):
        find_range, where = _RANGES.get(segment.gait, (None, ""))
        slowest, fastest = (-np.inf, np.inf) if find_range is None else find_range(p)
        for speed in (segment.speed, segment.until_speed):
            if speed is not None and not slowest <= speed <= fastest:
                raise ScenarioError(
                    f"segment {number} wants to {segment.gait} at {speed:g} m/s:"
                    f" {robot.name} can {segment.gait} from {inward(slowest, fastest)} m/s {where}"
                )
        if abs(segment.acceleration) > most:
            raise ScenarioError(
                f"segment {number} wants {segment.acceleration:g} m/s^2: a stride of {robot.name}"
                f" changes its speed by at most {most:.2g} m/s^2"
            )


def check_feasibility(route: Route, planner: AheadPlanner) -> None:
    """Walk a route on the template, and refuse it where a step would be behind.

    Args:
        route: of walking steps; it is reset before and after.
        planner: of these steps; it learns nothing.

    Raises:
        ScenarioError: naming the first speed that cannot be had in time.
    """
    simulator, unit = StrideSimulator(route.parameters, AUTOMATON), Scale.of(route.parameters).speed
    route.reset()
    z, now = np.array(route.start), 0.0
    for _ in range(_MOST_STRIDES):
        if (goal := route.next(VLO, z, now)) is None:
            break
        decision = planner.decide(Context(z, goal.target))
        wanted, had = float(goal.target[0]), float(decision.predicted[0])
        if not decision.feasible or abs(had - wanted) > _BEHIND * unit:
            raise ScenarioError(
                f"segment {goal.segment + 1} wants {wanted:.3g} m/s at VLO {now:.1f} s after the"
                f" start, and {had:.3g} m/s can be had then: give a smaller acceleration or"
                " change of speed, or leave out --strict"
            )
        node = AUTOMATON.start(goal.stride).name
        stride = simulator.run(node, VLO.state(z), decision.controls)
        z, now = VLO.of(stride.state), now + stride.duration
    route.reset()
    planner.reset()
