"""The gait of level ground on a slope: what the climb takes, the legs give in double stance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.errors import GaitError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import WalkingGait, control_units
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import Slope

_ROUNDS = 12
_DONE = 1e-9
_DIFFERENCE = 1e-4  # of g, to differentiate by the assist
# Weights of squared changes: y over l0, dy/dt over sqrt(g l0), the angle [rad], stiffnesses over
# k0. The assist may be what it must.
_HEIGHT, _RISE, _ANGLE, _STIFFNESS, _ASSIST = 4e4, 1e4, 1e3, 1e2, 1e-4


@checked
def on_slope(gait: WalkingGait, slope: Slope) -> WalkingGait:
    """The gait with the same speed at VLO on a slope, and as near to a gait as there is.

    The template's axes are turned with the ground. In single stance gravity's part along the ground
    acts; in double stance the assist (:class:`~template_control.slip.parameters.SlipParameters`)
    gives back what that takes in a step. So the motion stays nearly that on level ground. Of
    all fixed points the one with the least change of state and controls is taken.

    Args:
        gait: on level ground.
        slope: angle of the ground, uphill positive [rad].

    Raises:
        GaitError: if there is none.
    """
    p = gait.parameters
    if slope == p.slope:
        return gait
    slots, units = control_units(gait)
    weights = np.array([_HEIGHT / p.rest_length**2, _RISE / p.speed_unit**2, _ANGLE])
    weights = np.append(weights, [_STIFFNESS] * (len(slots) - 1))
    weights = np.append(weights, _ASSIST / p.gravity**2)
    wanted = np.concatenate((gait.vlo[1:], gait.controls[slots] / units, [p.assist]))
    x = wanted.copy()
    for _ in range(_ROUNDS):
        z, u, assist = _taken_apart(gait, x)
        own = replace(p, slope=slope, assist=assist)
        here = ReturnMap(own, gait.stride).linearise(z, u)
        change = _DIFFERENCE * p.gravity
        pushed = replace(own, assist=assist + change)
        there, outcome = ReturnMap(pushed, gait.stride).step(z, u)
        if Outcome.SECTION not in (here.outcome, outcome):
            break
        by_state = (here.state_jacobian - np.eye(3))[:, 1:]
        by_controls = here.control_jacobian[:, slots] * units
        by_assist = (there - here.state)[:, None] / change
        slopes = np.hstack((by_state, by_controls, by_assist))
        step = _least_change(weights, wanted - x, slopes, z - here.state)
        x += step
        if np.max(np.abs(step)) < _DONE:
            return _found(gait, slope, x)
    raise GaitError(
        f"no walking gait with {gait.vlo[0]:.3g} m/s at VLO on a slope of"
        f" {np.degrees(slope):.3g} deg: take a gentler slope"
    )


def _taken_apart(gait: WalkingGait, x: Array) -> tuple[Array, Array, float]:
    """VLO state, controls by Slot and assist of the unknowns ``x``."""
    slots, units = control_units(gait)
    u = gait.controls.copy()
    u[slots] = x[2:-1] * units
    return np.array([gait.vlo[0], *x[:2]]), u, float(x[-1])


def _least_change(weights: Array, wanted: Array, slopes: Array, missing: Array) -> Array:
    """The step s with slopes s = missing and the least weighted distance from ``wanted``."""
    n, m = len(weights), len(missing)
    kkt = np.zeros((n + m, n + m))
    kkt[:n, :n] = np.diag(weights)
    kkt[:n, n:], kkt[n:, :n] = slopes.T, slopes
    solution = np.linalg.solve(kkt, np.concatenate((weights * wanted, missing)))
    return np.asarray(solution[:n], dtype=np.float64)


def _found(gait: WalkingGait, slope: float, x: Array) -> WalkingGait:
    z, u, assist = _taken_apart(gait, x)
    own = replace(gait.parameters, slope=slope, assist=assist)
    step = simulate_stride(own, STRIDE_START[gait.stride], VLO.state(z), u)
    length = float(step.state[0])
    return replace(
        gait, parameters=own, state=z, controls=u, step_length=length, step_duration=step.duration
    )
