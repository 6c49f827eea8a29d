"""Walking gaits that vary continuously with speed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.errors import GaitError
from template_control.slip.gaits.by_speed.speed_family import walking_by_speed
from template_control.slip.gaits.gait import WalkingGait, gait_at
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

_SPEEDS = (0.195, 0.225, 0.29, 0.35, 0.395)  # at VLO, over sqrt(g l0)
_ANGLES = (70.0, 69.5, 68.0, 66.0, 66.0)  # [deg]
_PAPER = ("w",)  # strides
_SAME = 1e-9  # of sqrt(g l0): speeds that are one


@checked
def speed_range(parameters: SlipParameters) -> tuple[float, float]:
    """Slowest and fastest dx/dt at VLO of the family [m/s]."""
    unit = parameters.speed_unit
    return float(_SPEEDS[0] * unit), float(_SPEEDS[-1] * unit)


@checked
def walking_gait(parameters: SlipParameters, vlo_speed: float) -> WalkingGait:
    """The family's gait with this speed at VLO.

    The touchdown angle falls with the speed, along a line inside the region of angles and
    speeds at VLO in which symmetric gaits of the default stiffness exist.

    Args:
        parameters: the template, with k0 l0 / (m g) of the reference template.
        vlo_speed: dx/dt at VLO [m/s].

    Raises:
        GaitError: naming the range, if the speed is out of it.
    """
    low, high = speed_range(parameters)
    if not low <= vlo_speed <= high:
        raise GaitError(
            f"no walking gait has {vlo_speed:g} m/s at VLO: give a speed from {low:.3g} to"
            f" {high:.3g} m/s"
        )
    unit = parameters.speed_unit
    angle = np.radians(np.interp(vlo_speed / unit, _SPEEDS, _ANGLES))
    return gait_at(parameters, float(angle), vlo_speed)


def _others(gait: WalkingGait) -> tuple[float, float, Callable[..., WalkingGait]]:
    """Range of speeds at VLO [m/s], and maker, of the gaits that ``gait`` may give way to.

    The paper's steps keep the stiffness, with push-off they are the family's by speed.
    """
    if gait.stride in _PAPER:
        return *speed_range(gait.parameters), walking_gait
    chain = walking_by_speed().chain_of(gait)
    unit = gait.parameters.speed_unit
    return float(chain.vlo_speed[0] * unit), float(chain.vlo_speed[-1] * unit), chain.gait


class WalkingFamily:
    """The gaits that a planner's targets stand for.

    With push-off they are those of the family by speed on the branch of the present gait.

    Args:
        gait: the planner's own; its target is its VLO state.
    """

    @checked
    def __init__(self, gait: WalkingGait) -> None:
        self._known = [gait]

    def reset(self) -> WalkingGait:
        """Forget all gaits but the planner's own, which is returned."""
        del self._known[1:]
        return self._known[0]

    def towards(self, present: WalkingGait, target: Array | None) -> tuple[WalkingGait, bool]:
        """The gait with the target's speed at VLO, or the nearest there is.

        Args:
            present: is kept where it has that speed.
            target: (3,) dx/dt, y, dy/dt; None: the present gait's.

        Returns:
            The gait, and whether it has the target's speed.
        """
        if target is None:
            return present, True
        p = present.parameters
        low, high, make = _others(present)
        same = _SAME * p.speed_unit
        wanted = float(target[0])
        for gait in (present, *self._known):
            if abs(gait.vlo[0] - wanted) <= same:
                return gait, True
        speed = float(np.clip(wanted, low, high))
        gait = make(p, speed)
        self._known.append(gait)
        return gait, abs(speed - wanted) <= same
