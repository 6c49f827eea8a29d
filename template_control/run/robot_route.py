"""Scenarios on the template of a robot."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from template_control.checks.checked import checked
from template_control.checks.fitting import inward
from template_control.embedding.planners.running import AGILE
from template_control.errors import ScenarioError
from template_control.robot.biped import Biped
from template_control.robot.template import can_stand, template_for
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.gaits.running_gait import running_speeds, suited_height
from template_control.slip.gaits.walking_by_speed import family_speeds, speed_range
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.gait_table import STATE, gait_table, row_at
from template_control.slip.scenario.scenario import STAND, Scenario
from template_control.slip.scenario.scenario_route import ScenarioRoute
from template_control.slip.similarity import Scale, scaled

_RANGES = {"walk": (speed_range, "at VLO"), "run": (running_speeds, "at apex")}
_STRIDE = 0.7  # of sqrt(l0 / g): the duration of a fast running stride


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
    slowest, fastest = (family_speeds if push_off else speed_range)(p)
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
