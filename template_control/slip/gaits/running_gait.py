"""Running gaits: period-one fixed points of the apex map, symmetric in time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.fitting import inward
from template_control.checks.ranges import Pair, Positive
from template_control.errors import GaitError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Outcome, Slot, StrideKind
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.gaits.gait import Gait, GaitsBySpeed, roots
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import APEX
from template_control.slip.parameters import SlipParameters

_SLOWEST, _FASTEST = 0.383, 1.597  # dx/dt at apex over sqrt(g l0): 1.2 to 5 m/s where l0 is 1 m
_RANGES = {StrideKind.RUN: (_SLOWEST, _FASTEST), StrideKind.HOP: (-_SLOWEST, _SLOWEST)}
_HOPS = 1.015, 0.995  # heights of the apex over l0, of a hop on the spot and of the fastest one
_SCAN = 60
_FLATTEST = np.radians(50.0)  # a leg that lands flatter would need a friction coefficient near 1
_TIP = 1e-6  # of the steepest leg from where it would land at once, or from the vertical [rad]
_SAME = 1e-9  # of sqrt(g l0): speeds that are one


@dataclass(frozen=True)
class RunningGait(Gait):
    """A passive symmetric running gait.

    Attributes:
        state: (2,) dx/dt and y at apex [m/s, m].
        stride: its kind, from apex to apex: a run, or a hop.
    """

    state: Pair
    stride: str = StrideKind.RUN

    def __repr__(self) -> str:
        angle = np.degrees(self.controls[Slot.TOUCHDOWN_ANGLE])
        return (
            f"<RunningGait {self.name}: {self.mean_speed:.3f} m/s, touchdown angle {angle:.2f} deg,"
            f" at apex {self.apex[0]:.3f} m/s and {self.apex[1]:.4f} m>"
        )

    @property
    def apex(self) -> Array:
        """(2,) :attr:`state`."""
        return self.state


@checked
def running_speeds(parameters: SlipParameters, stride: str = StrideKind.RUN) -> tuple[float, float]:
    """Slowest and fastest dx/dt at apex of the family [m/s].

    Args:
        parameters: the template.
        stride: of a run, or of a hop, which goes backward as fast as forward.
    """
    unit = parameters.speed_unit
    slowest, fastest = _RANGES[StrideKind(stride)]
    return float(slowest * unit), float(fastest * unit)


def suited_height(relative_speed: float) -> float:
    """Height of the apex over l0 that suits dx/dt over sqrt(g l0)."""
    # The lower the apex, the less the knees bend and the smaller their torques. A slow run needs a
    # higher one to leave the ground, and a hop one from which it falls by 1.5 % of l0.
    if abs(relative_speed) < _SLOWEST - _SAME:
        still, fast = _HOPS
        return still + (fast - still) * (relative_speed / _SLOWEST) ** 2
    return float(0.97 + 0.01 / (1.0 + np.exp((relative_speed - 0.69) / 0.06)))


def suited_stiffness(relative_speed: float) -> float:
    """k l0 / (m g) that suits dx/dt over sqrt(g l0); below the slowest run it is that one's."""
    # The stiffer the leg, the less the knee bends; a leg that is too stiff for a slow run leaves it
    # no flight, and its apexes alternate.
    relative_speed = max(relative_speed, _SLOWEST)
    return float(1.65 + (48.8 - 14.3 * relative_speed) * relative_speed)


@checked
def running_gait(
    parameters: SlipParameters,
    speed: float,
    apex_height: Positive | None = None,
    leg_stiffness: Positive | None = None,
    *,
    stride: str = StrideKind.RUN,
) -> RunningGait:
    """The symmetric gait with a given speed at apex.

    Args:
        parameters: the template; its k0 is not used.
        speed: dx/dt at apex [m/s].
        apex_height: y at apex [m]; by default :func:`suited_height`'s.
        leg_stiffness: before and after the bottom [N/m]; by default
            :func:`suited_stiffness`'s.
        stride: of a run, or of a hop: that backward is the mirror image of the one forward.

    Raises:
        GaitError: naming the range, if the speed is out of it; and if the template has no such
            gait.
    """
    p = parameters
    unit = p.speed_unit
    low, high = running_speeds(p, stride)
    if not low - _SAME * unit <= speed <= high + _SAME * unit:
        raise GaitError(
            f"no running gait has {speed:g} m/s at its apex: give a speed from"
            f" {inward(low, high)} m/s"
        )
    relative = abs(float(speed / unit))
    if apex_height is None:
        apex_height = suited_height(relative) * p.rest_length
    if leg_stiffness is None:
        leg_stiffness = suited_stiffness(relative) * p.mass * p.gravity / p.rest_length
    z = np.array([speed, apex_height])
    angle = _symmetric_angle(p, np.abs(z), leg_stiffness, stride)
    if angle is None:
        raise GaitError(
            f"no running gait has {speed:g} m/s and {apex_height:g} m at its apex with legs of"
            f" {leg_stiffness:g} N/m: give others, or neither"
        )
    u = controls(angle if speed >= 0.0 else np.pi - angle, leg_stiffness, leg_stiffness)
    path = simulate_stride(p, STRIDE_START[stride], APEX.state(z), u)
    return RunningGait("run", p, z, u, float(path.state[0]), path.duration, StrideKind(stride))


def _symmetric_angle(
    parameters: SlipParameters, z: Array, stiffness: float, kind: str
) -> float | None:
    """The touchdown angle with which the apex returns [rad], None if there is none."""
    step = ReturnMap(parameters, kind)
    # A hop that comes back to its height may have turned back.
    returns = 0 if kind == StrideKind.HOP else 1

    def surplus(angle: float) -> float:
        z_next, outcome = step.step(z, controls(angle, stiffness, stiffness))
        found = float(z_next[returns] - z[returns])
        return found if outcome is Outcome.SECTION else np.nan

    # A steeper leg lets the robot pass under the apex it came from, a flatter one throws it higher.
    top = np.arcsin(min(z[1] / parameters.rest_length, 1.0))
    top += -_TIP if z[1] < parameters.rest_length else _TIP  # on the spot the leg is vertical
    angles = np.linspace(top, _FLATTEST, _SCAN)
    return next(roots(surplus, angles, xtol=1e-13, rtol=1e-13), None)


def other_runs(gait: RunningGait) -> GaitsBySpeed:
    """Runs, or hops, that a gait may give way to, with heights and stiffnesses by speed."""
    make = partial(running_gait, gait.parameters, stride=gait.stride)
    return GaitsBySpeed(make, running_speeds(gait.parameters, gait.stride))
