"""Whole-body control on ProxQP: one warm-started workspace per contact state."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import proxsuite
from numpy.typing import NDArray

from template_control.robot.planar_biped import PlanarBiped
from template_control.whole_body.problem import ROWS_PER_FOOT, affine, assemble, torques
from template_control.whole_body.tasks import TaskStack, Weights

Array = NDArray[np.float64]

_proxqp = proxsuite.proxqp
_SOLVED = _proxqp.QPSolverOutput.PROXQP_SOLVED


@dataclass(frozen=True)
class Solution:
    """Answer of one tick.

    Attributes:
        torque: (nu,) joint torques [N m], within their limits.
        force: (2 c,) contact forces [N], x and y of each stance foot.
        acceleration: (nv,) generalised accelerations.
        solved: False where the QP was infeasible, singular or not solved within its caps;
            the torques are then the last solved ones, and force and acceleration follow
            from them.
        solve_seconds: time in ProxQP.
    """

    torque: Array
    force: Array
    acceleration: Array
    solved: bool
    solve_seconds: float


class _Workspace:
    """Matrices and ProxQP object for one number of stance feet."""

    def __init__(self, nv: int, nu: int, feet: int) -> None:
        rows = nu + ROWS_PER_FOOT * feet
        self.a_map = np.zeros((nv, nu + 1))
        self.f_map = np.zeros((2 * feet, nu + 1))
        self.factor = np.zeros((nu, nu))
        self._identity = np.eye(nu)
        self.gradient = np.zeros(nu)
        self.constraint = np.zeros((rows, nu))
        self.lower = np.zeros(rows)
        self.upper = np.zeros(rows)
        self.jacobian = np.zeros((2 * feet, nv))
        self.bias = np.zeros(2 * feet)
        self.rows = rows
        self.qp = self._new()
        self.ready = False

    def _new(self) -> Any:
        qp = _proxqp.dense.QP(
            len(self.gradient),
            0,
            self.rows,
            False,
            _proxqp.dense.HessianType.Dense,
            _proxqp.dense.DenseBackend.PrimalDualLDLT,
        )
        settings = qp.settings
        # The tolerance is tight because a warm start stops as soon as it is met.
        settings.eps_abs = 1e-8
        settings.eps_rel = 0.0
        # Without caps an infeasible problem runs for minutes.
        settings.max_iter = 40
        settings.max_iter_in = 40
        return qp

    def solve(self) -> bool:
        """Solve for the current matrices; warm, and once more from scratch if that fails."""
        if self.ready:
            self.qp.update(
                g=self.gradient,
                C=self.constraint,
                l=self.lower,
                u=self.upper,
            )
            self.qp.solve()
            if self.qp.results.info.status == _SOLVED:
                return True
            # A failed solve leaves penalties behind with which the next one can stop at a
            # wrong answer, even after `init`; a new object costs microseconds.
            self.qp = self._new()
        qp = self.qp
        qp.settings.initial_guess = _proxqp.InitialGuess.NO_INITIAL_GUESS
        qp.init(self._identity, self.gradient, None, None, self.constraint, self.lower, self.upper)
        qp.solve()
        self.ready = bool(qp.results.info.status == _SOLVED)
        if self.ready:
            qp.settings.initial_guess = _proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        else:
            self.qp = self._new()
        return self.ready


class WholeBodyQp:
    """Torques that serve weighted tasks within torque limits and friction cones.

    Args:
        robot: the model; :meth:`solve` reads its last update.
        friction: coefficient the cones are built with.
        torque_scale: fraction of the URDF's torque limits that may be used.
        contact_damping: brings a foot that landed sliding to rest [1/s].
    """

    def __init__(
        self,
        robot: PlanarBiped,
        friction: float,
        torque_scale: float = 1.0,
        contact_damping: float = 40.0,
    ) -> None:
        self.robot = robot
        self.friction = friction
        self.torque_limit: Array = robot.torque_limit * torque_scale
        nu = len(self.torque_limit)
        self._workspaces = {n: _Workspace(robot.nv, nu, n) for n in (1, 2)}
        self._torque = np.zeros(nu)
        self.contact_damping = contact_damping

    def solve(
        self,
        tasks: TaskStack,
        weights: Weights,
        row_weights: Array,
        stance: tuple[int, ...],
        force_reference: Array,
        force_cap: Array,
        load: float = 1.0,
    ) -> Solution:
        """Solve one tick.

        Args:
            tasks: rows and desired accelerations.
            weights: regularisers.
            row_weights: (5,) weights of the task rows.
            stance: indices of the feet on the ground, one or two.
            force_reference: (2 c,) contact forces to stay near [N].
            force_cap: (c,) largest normal forces [N].
            load: ratio of the real to the modelled inertia; the torques are scaled by it
                and stay within their limits.
        """
        robot = self.robot
        w = self._workspaces[len(stance)]
        limit = self.torque_limit / load
        for i, foot in enumerate(stance):
            w.jacobian[2 * i : 2 * i + 2] = robot.foot_jacobian[foot]
            w.bias[2 * i : 2 * i + 2] = (
                robot.foot_bias[foot] + self.contact_damping * robot.foot_velocity[foot]
            )
        regular = assemble(
            robot.mass_matrix,
            robot.nonlinear_effects,
            w.jacobian,
            w.bias,
            tasks.jacobian,
            tasks.bias,
            tasks.desired,
            row_weights,
            force_reference,
            weights.force,
            weights.torque,
            limit,
            self.friction,
            force_cap,
            robot.mass * robot.gravity,
            w.a_map,
            w.f_map,
            w.factor,
            w.gradient,
            w.constraint,
            w.lower,
            w.upper,
        )
        start = time.perf_counter()
        solved = regular and w.solve()
        seconds = time.perf_counter() - start
        if solved:
            torques(w.factor, w.qp.results.x, limit, self._torque)
        else:
            np.clip(self._torque, -limit, limit, out=self._torque)
        force = np.empty(2 * len(stance))
        acceleration = np.empty(robot.nv)
        affine(w.f_map, self._torque, force)
        affine(w.a_map, self._torque, acceleration)
        return Solution(load * self._torque, force, acceleration, solved, seconds)
