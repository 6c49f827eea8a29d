"""Discrete LQR on the VLO state about the gait's fixed point, with an offset estimate.

The robot is no template: its swing leg and its impacts add something systematic to each
step. The planner learns it, z_next = P(z, u) + d with a slowly filtered d, and aims at the
fixed point nearest the gait's that the robot then has, so that the walk settles on the
gait and not beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from template_control.embedding.planners.planner import ANY_ANGLE, Decision
from template_control.embedding.planners.step_search import (
    FALL_PRICE,
    Grid,
    Law,
    linear,
    price,
    search,
)
from template_control.embedding.scaling import Scale
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.gaits.gait import WALKING_SLOTS, WalkingGait, vlo_jacobians

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SearchOptions:
    """How a step is searched for where the linear law's own is not good enough.

    Attributes:
        first_weight: of the cost-to-go after the first step beside that after the second:
            where two steps end alike, the one that is nearer the gait half-way is taken.
        coarse: points in alpha, kappa_1 and kappa_2 over all of their ranges; most in alpha,
            which decides where the foot lands.
        fine: points in alpha and kappa_2 of each finer grid about the best so far, at least 2;
            kappa_1, which matters least there, gets two points beside its plane.
        rounds: finer grids; with two, alphas end 0.03 rad apart.
        narrowing: a finer grid's half-widths over those of the one before; at most the spacing
            of its alphas, half of a half-width: what lies beyond has its neighbour's price.
    """

    first_weight: float = 0.3
    coarse: tuple[int, int, int] = (5, 3, 3)
    fine: tuple[int, int] = (5, 3)
    rounds: int = 2
    narrowing: float = 0.4


@dataclass(frozen=True)
class LqrOptions:
    """Tuning of the LQR; states in m/s, m, m/s, controls in rad and shares of k0.

    States are those of the reference template (80 kg, 1 m, 9.81 m/s^2); the planner scales
    them to its gait's by dynamic similarity.

    Attributes:
        state_cost: on dx/dt, y, dy/dt.
        control_cost: on alpha, kappa_1, kappa_2.
        offset_gain: share of a step's surprise that enters the offset estimate.
        offset_bound: largest offset believed, per state.
        surprise_bound: a larger surprise counts as this much: a push is no offset.
        tolerance: errors of the settled state that count as equally bad; decides which
            part of an offset that the controls cannot cancel shows up where.
        stiffness_range: kappa_1 and kappa_2 over k0.
        angle_range: touchdown angle relative to the gait's [rad]; steeper ones make steps
            too short in time for the swing leg, flatter ones let the CoM sink lower than the
            knees can carry it.
        top_margin: alpha stays this far [rad] below asin(y / l0), the angle at which the
            foot would touch down at once.
        trusted_price: the linear law's step is taken without a search below this price.
        spread: half-widths of the search in alpha [rad] and kappa_2 / k0.
        search: points, rounds and weights of the search.
        second_steps: second steps that the search reckons with beside the law's own: alpha relative
            to the gait's [rad], kappa_1 and kappa_2 over k0. A leg that is stiffer before its
            virtual bottom than after takes energy out, the reverse puts some in.
    """

    state_cost: tuple[float, float, float] = (10.0, 100.0, 10.0)
    control_cost: tuple[float, float, float] = (5.0, 2.0, 2.0)
    offset_gain: float = 0.2
    offset_bound: tuple[float, float, float] = (0.06, 0.015, 0.12)
    surprise_bound: tuple[float, float, float] = (0.03, 0.008, 0.06)
    tolerance: tuple[float, float, float] = (0.011, 0.005, 0.03)
    stiffness_range: tuple[float, float] = (0.5, 1.5)
    angle_range: tuple[float, float] = (-0.12, 0.065)
    top_margin: float = 0.01
    trusted_price: float = 1.0
    spread: tuple[float, float] = (0.16, 0.25)
    search: SearchOptions = field(default_factory=SearchOptions)
    second_steps: tuple[tuple[float, float, float], ...] = (
        (0.0, 1.5, 1.0),
        (-0.058, 1.0, 0.75),
        (0.025, 1.5, 1.0),
        (-0.058, 1.25, 0.75),
        (-0.03, 0.75, 1.0),
        (0.0, 1.0, 1.5),
        (0.045, 0.5, 0.75),
    )

    def scaled(self, scale: Scale) -> LqrOptions:
        """The same tuning for a template of another size."""
        return replace(
            self,
            state_cost=scale.state_cost(self.state_cost),
            offset_bound=scale.state(self.offset_bound),
            surprise_bound=scale.state(self.surprise_bound),
            tolerance=scale.state(self.tolerance),
        )


class LqrPlanner:
    """u = u_s - K (z - z_s), where the template completes its step; else a search.

    Args:
        gait: to settle on.
        options: tuning.

    Attributes:
        offset: (3,) the estimate of d.
        a, b: (3, 3) state and control Jacobians of the VLO map at the gait.
    """

    def __init__(self, gait: WalkingGait, options: LqrOptions | None = None) -> None:
        self.gait = gait
        self.options = (options or LqrOptions()).scaled(Scale.of(gait.parameters))
        self.offset: Array = np.zeros(3)
        self.a, self.b = vlo_jacobians(gait)
        o = self.options
        q, r = np.diag(o.state_cost), np.diag(o.control_cost)
        self._cost = solve_discrete_are(self.a, self.b, q, r)
        self._gain = np.linalg.solve(
            r + self.b.T @ self._cost @ self.b, self.b.T @ self._cost @ self.a
        )
        self._settling = _settling_map(self.a, self.b, np.array(o.tolerance))
        self._scratch = new_scratch()
        grid = o.search
        self._grid = Grid(grid.coarse, grid.fine, grid.rounds, *o.spread, grid.narrowing)
        self._law = self._aim()
        # Compile now what a step would otherwise wait for; the search only once a step needs
        # it, as it takes as long again and a walk without disturbances never does.
        self.decide(gait.vlo)

    def _aim(self) -> Law:
        """The linear law about the fixed point the robot has with the present offset."""
        p, o = self.gait.parameters, self.options
        shift = self._settling @ self.offset
        nominal = self.gait.controls[WALKING_SLOTS] / [1.0, p.leg_stiffness, p.leg_stiffness]
        return Law(
            target=self.gait.vlo + shift[:3],
            control=nominal + shift[3:],
            gain=self._gain,
            cost=self._cost,
            offset=self.offset,
            lower=np.array([nominal[0] + o.angle_range[0], *[o.stiffness_range[0]] * 2]),
            upper=np.array([nominal[0] + o.angle_range[1], *[o.stiffness_range[1]] * 2]),
            second_steps=np.add(np.array(o.second_steps).reshape(-1, 3), (nominal[0], 0.0, 0.0)),
            enough=o.trusted_price,
            first_weight=o.search.first_weight,
            top_margin=o.top_margin,
            stiffness=p.leg_stiffness,
            kernel=stride_kernel(p, "w"),
        )

    def decide(self, z: Array, angles: tuple[float, float] = ANY_ANGLE) -> Decision:
        """Controls for a step from VLO state ``z`` (3,); see :class:`Planner`."""
        law, s = self._law, self._scratch
        if angles != ANY_ANGLE:
            lower, upper = law.lower.copy(), law.upper.copy()
            lower[0] = min(max(lower[0], angles[0]), upper[0])
            upper[0] = max(min(upper[0], angles[1]), lower[0])
            law = law._replace(lower=lower, upper=upper)
        u, first = np.empty(3), np.empty(3)
        linear(law, z, u)
        cost = price(law, None, s, z, u, np.inf, first)
        trusted = cost < self.options.trusted_price
        if not trusted:
            cost = search(law, self._grid, s, z, u, first)
        controls = self.gait.controls.copy()
        controls[WALKING_SLOTS] = u * [1.0, law.stiffness, law.stiffness]
        return Decision(controls, first, cost < 2.0 * FALL_PRICE, cost < FALL_PRICE, trusted)

    def observe(self, decision: Decision, z: Array) -> None:
        """Learn from the VLO state ``z`` (3,) in which the step of ``decision`` ended."""
        if not (decision.feasible and decision.reached):
            return  # far from the gait the surprise says little about it
        o = self.options
        limit = np.array(o.surprise_bound)
        surprise = np.clip(z - decision.predicted, -limit, limit)
        bound = np.array(o.offset_bound)
        self.offset = np.clip(self.offset + o.offset_gain * surprise, -bound, bound)
        self._law = self._aim()


def _settling_map(a: Array, b: Array, tolerance: Array) -> Array:
    """(6, 3) map from an offset d to the shift (dz, du) of the fixed point.

    Minimises |dz / tolerance|^2 + |du / 0.1|^2 subject to (I - A) dz = B du + d. The three
    controls act in two directions only, so not every offset can be cancelled with dz = 0.
    """
    weight = np.concatenate((1.0 / tolerance**2, np.full(3, 1e2)))
    constraint = np.hstack((np.eye(3) - a, -b))
    kkt = np.zeros((9, 9))
    kkt[:6, :6] = np.diag(weight)
    kkt[6:, :6] = constraint
    kkt[:6, 6:] = constraint.T
    solution = np.linalg.solve(kkt, np.vstack((np.zeros((6, 3)), np.eye(3))))
    return np.asarray(solution[:6], dtype=np.float64)
