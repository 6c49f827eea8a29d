"""What a walking gait of a family costs: stability, torque and the swing leg's work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve_discrete_are

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.errors import GaitError
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import WalkingGait, vlo_jacobians, without_push_off
from template_control.slip.maps.section import VLO

Array = NDArray[np.float64]

_SAMPLES = 60
_LITTLE = 0.02  # of a singular value
_STATE_COST = np.diag([10.0, 100.0, 10.0])  # of the planner, for l0 = 1 m
_CONTROL_COST = (5.0, 2.0, 2.0, 2.0)
_ERRORS = np.diag([0.05, 0.005, 0.05]) ** 2  # of dx/dt, y, dy/dt that a step may begin with


@dataclass(frozen=True)
class FamilyCost(Checked):
    """Weights of a family's cost; all gaits are those of the reference template.

    Attributes:
        control: of the LQR's mean cost-to-go with four controls, from errors of 0.05 m/s, 5 mm
            and 0.05 m/s.
        authority: over the least singular value of the four controls' Jacobian and 0.02: where
            that value vanishes, one direction of the state is out of their reach.
        torque: of the largest knee torque of a leg without mass, over m g l0.
        growth: of ln of the largest eigenvalue of the passive map, where that is above 1.
        step: of the squared ln of the step length over ``lengths``.
        speeds, lengths: mean speeds [m/s] and step lengths [m] that suit them, for l0 = 1 m:
            long steps need high torques, short ones a fast swing.
        shortest: a step takes at least so long [s], for l0 = 1 m: a swing leg needs the time.
        leg: length of the robot's leg, from the CoM on, over l0: the knee is never straight.
        bend: of the chain's squared second differences, in changes of ln k, alpha and y / l0
            that count alike.
    """

    control: NotNegative = 10.0
    authority: NotNegative = 0.02
    torque: NotNegative = 1.0
    growth: NotNegative = 0.15
    step: NotNegative = 8.0
    speeds: tuple[float, ...] = (0.2, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.45)
    lengths: tuple[float, ...] = (0.28, 0.32, 0.42, 0.49, 0.52, 0.55, 0.57, 0.54)
    shortest: Positive = 0.33
    leg: Positive = 1.06
    bend: NotNegative = 2.0


class Figures(NamedTuple):
    """A gait's figures; those without unit are over m, g and l0.

    Attributes:
        closed: largest absolute eigenvalue of the walk under the LQR's four controls.
        without: the same with the three of the paper.
        passive: largest absolute eigenvalue of the passive map.
        authority: least singular value of the controls' Jacobian.
        torque: largest knee torque of a leg without mass, over m g l0.
        double_stance: share of the step.
        cost: by :func:`gait_figures`.
    """

    closed: float
    without: float
    passive: float
    authority: float
    torque: float
    double_stance: float
    cost: float


def gait_figures(gait: WalkingGait, weights: FamilyCost) -> Figures:
    """Figures and cost of a gait with push-off, on the reference template.

    Args:
        gait: of the family.
        weights: of its cost.

    Raises:
        GaitError: if no control holds it.
    """
    a, b = vlo_jacobians(gait)
    ahead, closed = _controlled(a, b)
    if not np.isfinite(closed):
        raise GaitError(f"no control holds {gait!r}: give another gait")
    passive = float(np.abs(np.linalg.eigvals(a)).max())
    authority = float(np.linalg.svd(b)[1][2])
    torque, double_stance = stance_figures(gait, weights.leg)
    suited = float(np.interp(gait.mean_speed, weights.speeds, weights.lengths))
    cost = (
        weights.control * float(np.trace(ahead @ _ERRORS))
        + weights.authority / (authority + _LITTLE)
        + weights.torque * torque
        + weights.growth * max(np.log(passive), 0.0)
        + weights.step * np.log(gait.step_length / suited) ** 2
    )
    without = _controlled(*vlo_jacobians(without_push_off(gait)))[1]
    return Figures(
        closed=closed,
        without=without,
        passive=passive,
        authority=authority,
        torque=torque,
        double_stance=double_stance,
        cost=float(cost),
    )


def _controlled(a: Array, b: Array) -> tuple[Array, float]:
    """Cost-to-go (3, 3) of the LQR and the largest absolute eigenvalue with it, NaN without one."""
    costs = np.diag(_CONTROL_COST[: b.shape[1]])
    try:
        ahead = np.asarray(solve_discrete_are(a, b, _STATE_COST, costs))
    except (LinAlgError, ValueError):
        return np.full((3, 3), np.nan), np.nan
    gain = np.linalg.solve(costs + b.T @ ahead @ b, b.T @ ahead @ a)
    return ahead, float(np.abs(np.linalg.eigvals(a - b @ gain)).max())


def stance_figures(gait: WalkingGait, leg: float = FamilyCost.leg) -> tuple[float, float]:
    """Largest knee torque over m g l0, and the share of double stance.

    A leg of two equal halves that pushes with F has the torque F times the knee's distance from
    the line of the push.

    Args:
        gait: with push-off.
        leg: length of the robot's leg, from the CoM on, over l0.
    """
    p = gait.parameters
    stride = simulate_stride(p, STRIDE_START[gait.stride], VLO.state(gait.vlo), gait.controls)
    times = np.linspace(0.0, stride.duration, _SAMPLES)
    x, y = stride.sample(times)[:, :2].T
    row = np.clip(np.searchsorted(stride.meta[:, 0], times, "right") - 1, 0, len(stride.meta) - 1)
    torque = 0.0
    for toe, k in ((3, 5), (4, 6)):
        length = np.hypot(x - stride.meta[row, toe], y)
        force = stride.meta[row, k] * (p.rest_length - length)
        knee = 0.5 * np.sqrt(np.clip((leg * p.rest_length) ** 2 - length**2, 0.0, None))
        torque = max(torque, float(np.max(force * knee)))
    double = stride.time_of(Event.REAR_LIFTOFF) - stride.time_of(Event.TOUCHDOWN)
    return torque / (p.mass * p.gravity * p.rest_length), double / stride.duration
