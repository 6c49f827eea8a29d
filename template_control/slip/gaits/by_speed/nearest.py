"""The symmetric gait nearest a guess, by Gauss and Newton's method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.errors import GaitError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Outcome, Slot
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.gaits.gait import WalkingGait, with_push_off
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED, VLO
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

_HEIGHT, _RISE = 1, 2  # places in a VLO state
_COLUMNS = np.array(
    [PADDED + Slot.K_SC, PADDED + Slot.K_SD, PADDED + Slot.TOUCHDOWN_ANGLE, _HEIGHT]
)
NATURAL = np.array([0.1, 0.02, 0.005])
"""Changes of ln k, alpha [rad] and y / l0 that count alike: what "nearest" means."""

_STEPS = 40
_REACH = 0.5  # of a natural change: a longer step may end on another branch
_DONE = 1e-13  # of a natural change
_SINGULAR = 1e-6  # one of both misses may say nothing that the other does not
_RETURNED = 1e-9  # of the units of the state


def nearest_gait(parameters: SlipParameters, vlo_speed: float, guess: Array) -> WalkingGait:
    """The gait with a speed at VLO that is nearest a guess, in steps with push-off.

    At the next VLO of a symmetric gait dy/dt is zero and the height the same. Of all changes of
    the guess that make it so, the method takes the least, with exact derivatives. So it does not
    mind where gaits of one stiffness and angle turn back, or where other strides cross them.

    Args:
        parameters: the template; its stiffness k0 counts for nothing, the gait has its own.
        vlo_speed: dx/dt at VLO [m/s].
        guess: (3,) ln of k l0 / (m g), alpha [rad], y / l0 at VLO.

    Raises:
        GaitError: if there is none near it.
    """
    p, step = parameters, ReturnMap(parameters)
    unit, weight = p.speed_unit, p.mass * p.gravity / p.rest_length
    x = np.array(guess, dtype=float)
    for _ in range(_STEPS):
        z, u = _stride(x, vlo_speed, weight, p.rest_length)
        end, slopes, outcome = step.derivatives(z, u, _COLUMNS)
        if outcome is not Outcome.SECTION:
            break
        k, kinds = u[Slot.K_SC], slopes[[_RISE, _HEIGHT]]
        slope = np.column_stack((k * kinds[:, :2].sum(axis=1), kinds[:, 2], kinds[:, 3]))
        slope[:, 2] *= p.rest_length
        slope[1, 2] -= p.rest_length
        units = np.array([unit, p.rest_length])
        misses = np.array([end[_RISE], end[_HEIGHT] - z[_HEIGHT]]) / units
        scaled = slope / units[:, None] * NATURAL
        if not np.all(np.isfinite(scaled)):
            break
        change = -np.linalg.lstsq(scaled, misses, rcond=_SINGULAR)[0]
        size = float(np.max(np.abs(change)))
        x += NATURAL * change * min(1.0, _REACH / max(size, _DONE))
        if size < _DONE:
            break
    z, u = _stride(x, vlo_speed, weight, p.rest_length)
    stride = simulate_stride(p, STRIDE_START["w"], VLO.state(z), u)
    missed = np.abs(VLO.of(stride.state) - z) / [unit, p.rest_length, unit]
    if not stride.completed or np.max(missed) > _RETURNED:
        raise GaitError(
            f"no symmetric gait with {vlo_speed:g} m/s at VLO near"
            f" {np.degrees(guess[1]):.4g} deg at touchdown: give another guess"
        )
    own = replace(p, leg_stiffness=float(u[Slot.K_SC]))
    gait = WalkingGait("walk", own, z, u, float(stride.state[0]), stride.duration)
    return with_push_off(gait)


def coordinates(gait: WalkingGait) -> Array:
    """(3,) ln of k l0 / (m g), alpha [rad] and y / l0 of a gait."""
    p = gait.parameters
    weight = p.mass * p.gravity / p.rest_length
    angle = float(gait.controls[Slot.TOUCHDOWN_ANGLE])
    return np.array([np.log(p.leg_stiffness / weight), angle, gait.vlo[1] / p.rest_length])


def _stride(x: Array, vlo_speed: float, weight: float, length: float) -> tuple[Array, Array]:
    """State and controls at coordinates ``x``; ``weight`` is m g / l0 [N/m]."""
    k = float(np.exp(x[0])) * weight
    return np.array([vlo_speed, x[2] * length, 0.0]), controls(float(x[1]), k, k)
