"""The walking gait of a mean forward speed."""

from __future__ import annotations

import numpy as np

from template_control.checks.checked import checked
from template_control.checks.ranges import Angle
from template_control.errors import GaitError
from template_control.slip.gaits.gait import WalkingGait, gait_at, root
from template_control.slip.parameters import SlipParameters

_MEAN_SPEEDS = (0.255, 0.287, 0.351)  # over sqrt(g l0)
_ANGLES = (69.0, 68.0, 66.0)  # [deg]
_VLO_SPEEDS = np.linspace(0.2, 0.45, 26)  # over sqrt(g l0): where gaits are looked for
_XTOL, _RTOL = 1e-10, 8.881784197001252e-16  # of speeds [m/s]; scipy's default


def _nominal_angle(mean_speed: float, rest_length: float, gravity: float) -> float:
    """Touchdown angle [rad] at which a mean speed is walked: steeper when slower.

    66 deg from 1.1 m/s up and 68 deg at 0.9 m/s (for l0 = 1 m), where the steps are long
    enough in time for a swing leg to follow.
    """
    dimensionless = mean_speed / np.sqrt(gravity * rest_length)
    return float(np.radians(np.interp(dimensionless, _MEAN_SPEEDS, _ANGLES)))


@checked
def mean_speed_range(
    parameters: SlipParameters, touchdown_angle: float | None = None
) -> tuple[float, float] | None:
    """Slowest and fastest mean speed of :func:`gait_for_speed` [m/s], to a centimetre per second.

    They are those of the slowest gait at the steepest angle, and of the fastest at the flattest.

    Args:
        parameters: the template; both legs have its stiffness k0.
        touchdown_angle: alpha of all gaits [rad]; None: the usual one at each speed.

    Returns:
        Both speeds, or None if there is no gait at one of these angles.
    """
    steep, flat = float(np.radians(_ANGLES[0])), float(np.radians(_ANGLES[-1]))
    if touchdown_angle is not None:
        steep = flat = touchdown_angle
    unit = np.sqrt(parameters.gravity * parameters.rest_length)
    ends = []
    for angle, speeds in ((steep, _VLO_SPEEDS), (flat, _VLO_SPEEDS[::-1])):
        means = (_mean_speed(parameters, angle, unit * s) for s in speeds)
        ends.append(next((mean for mean in means if np.isfinite(mean)), np.nan))
    if not np.isfinite(ends).all():
        return None
    return float(np.ceil(100.0 * ends[0]) / 100.0), float(np.floor(100.0 * ends[1]) / 100.0)


def _mean_speed(parameters: SlipParameters, touchdown_angle: float, vlo_speed: float) -> float:
    """Of the gait that :func:`gait_at` finds [m/s]; NaN if it finds none."""
    try:
        return gait_at(parameters, touchdown_angle, vlo_speed).mean_speed
    except GaitError:
        return np.nan


@checked
def gait_for_speed(
    parameters: SlipParameters,
    mean_speed: float,
    name: str = "walk",
    touchdown_angle: Angle | None = None,
) -> WalkingGait:
    """The symmetric gait with a given mean forward speed.

    Args:
        parameters: the template; both legs have its stiffness k0.
        mean_speed: step length over step duration [m/s].
        name: of the gait.
        touchdown_angle: alpha, from the ground to the leg [rad]; None: the usual one at this speed.

    Raises:
        GaitError: naming the range, if there is none, or the speed is not positive.
    """
    p = parameters
    if not (np.isfinite(mean_speed) and mean_speed > 0.0):
        raise GaitError(f"speed is {mean_speed!r} m/s: give a positive number")
    unit = np.sqrt(p.gravity * p.rest_length)
    angle = touchdown_angle
    if angle is None:
        angle = _nominal_angle(mean_speed, p.rest_length, p.gravity)

    def surplus(vlo_speed: float) -> float:
        return _mean_speed(p, angle, vlo_speed) - mean_speed

    # The mean speed grows with the speed at VLO; find two neighbours around the wanted one.
    speeds = unit * _VLO_SPEEDS
    values = np.array([surplus(s) for s in speeds])
    for lo, hi, f_lo, f_hi in zip(speeds, speeds[1:], values, values[1:], strict=False):
        if f_lo <= 0.0 <= f_hi:
            speed = root(surplus, (lo, hi), _XTOL, _RTOL)
            if speed is not None:
                return gait_at(p, angle, speed, name)
    found = mean_speed_range(p, touchdown_angle)
    at = "" if touchdown_angle is None else f" and {np.degrees(angle):g} deg at touchdown"
    if found is not None and not found[0] <= mean_speed <= found[1]:
        hint = f"give one from {found[0]:.2f} to {found[1]:.2f} m/s"
    elif touchdown_angle is not None:
        hint = "give another angle, or none"
    else:
        stiffness = p.leg_stiffness * p.rest_length / (p.mass * p.gravity)
        hint = f"k0 l0 / (m g) is {stiffness:.3g}, and 21 has gaits at all usual speeds"
    raise GaitError(f"no walking gait at a mean speed of {mean_speed:g} m/s{at}: {hint}")
