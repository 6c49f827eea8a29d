"""The walking gait of a mean forward speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from template_control.checks.checked import checked
from template_control.checks.ranges import Angle
from template_control.errors import GaitError
from template_control.slip.gaits.by_speed.speed_family import walking_by_speed
from template_control.slip.gaits.gait import WalkingGait, find_gait_at, gait_at, root
from template_control.slip.parameters import SlipParameters

_VLO_SPEEDS = np.linspace(0.2, 0.45, 26)  # over sqrt(g l0): where gaits are looked for
_XTOL, _RTOL = 1e-10, 8.881784197001252e-16  # of speeds [m/s]; scipy's default


@checked
def mean_speed_range(
    parameters: SlipParameters, touchdown_angle: float | None = None
) -> tuple[float, float] | None:
    """Slowest and fastest mean speed of :func:`gait_for_speed` [m/s], to a centimetre per second.

    Args:
        parameters: the template.
        touchdown_angle: alpha of gaits with the template's stiffness k0 [rad]; None: the range of
            the family by speed.

    Returns:
        Both speeds, or None if there is no gait at this angle.
    """
    if touchdown_angle is None:
        return walking_by_speed().range(parameters)
    unit = parameters.speed_unit
    ends = []
    for speeds in (_VLO_SPEEDS, _VLO_SPEEDS[::-1]):
        means = (_mean_speed(parameters, touchdown_angle, unit * s) for s in speeds)
        ends.append(next((mean for mean in means if np.isfinite(mean)), np.nan))
    if not np.isfinite(ends).all():
        return None
    return float(np.ceil(100.0 * ends[0]) / 100.0), float(np.floor(100.0 * ends[1]) / 100.0)


def _mean_speed(parameters: SlipParameters, touchdown_angle: float, vlo_speed: float) -> float:
    """Of the gait that :func:`find_gait_at` finds [m/s]; NaN if it finds none."""
    gait = find_gait_at(parameters, touchdown_angle, vlo_speed)
    return np.nan if gait is None else gait.mean_speed


@checked
def gait_for_speed(
    parameters: SlipParameters,
    mean_speed: float,
    name: str = "walk",
    touchdown_angle: Angle | None = None,
) -> WalkingGait:
    """The symmetric gait with a given mean forward speed.

    Without an angle it is that of the library's family by speed, in steps with push-off: its
    stiffness varies with the speed, and is that of its own ``parameters``. With an angle both legs
    keep the template's stiffness k0, and the steps are the paper's.

    Args:
        parameters: the template.
        mean_speed: step length over step duration [m/s].
        name: of the gait.
        touchdown_angle: alpha, from the ground to the leg [rad]; None: the family's.

    Raises:
        GaitError: naming the range, if there is none, or the speed is not positive.
    """
    p = parameters
    if not (np.isfinite(mean_speed) and mean_speed > 0.0):
        raise GaitError(f"speed is {mean_speed!r} m/s: give a positive number")
    if touchdown_angle is None:
        return replace(walking_by_speed().gait_for(p, mean_speed), name=name)
    angle = touchdown_angle
    unit = p.speed_unit

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
    found = mean_speed_range(p, angle)
    at = f" and {np.degrees(angle):g} deg at touchdown"
    if found is not None and not found[0] <= mean_speed <= found[1]:
        hint = f"give one from {found[0]:.2f} to {found[1]:.2f} m/s"
    else:
        hint = "give another angle, or none"
    raise GaitError(f"no walking gait at a mean speed of {mean_speed:g} m/s{at}: {hint}")
