"""Whole-body control on ProxQP: one warm-started workspace per number of contacts.

ProxQP is asked where a limit acts. Elsewhere the minimum is known without it
(:mod:`~template_control.whole_body.problem`).

A joint near its limit of speed, or fast before its stop, has its acceleration bounded, in a
workspace with these further rows. Where the motors cannot slow down so much, it shall not get
faster; where they cannot do that either, the tick is solved without these rows.

ProxQP is that built for any processor: the same problem gives the same bits each time. The builds
with wider vector instructions sum in an order that depends on where in memory a solver happens to
lie. Near the edge of what has a solution, the last bits decide; a run that is repeated with the
same seed would then fall at another moment. For the small problems of a tick these builds are no
faster.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive, Share
from template_control.robot.robot import Robot
from template_control.slip.similarity import RATE, TIME, tuned
from template_control.whole_body import problem
from template_control.whole_body.stack import TaskStack

_LOG = logging.getLogger(__name__)

BUILD = "TEMPLATE_CONTROL_PROXQP"
"""Environment variable: ``native`` leaves the build to proxsuite, as if it was imported alone."""

FORCE_COST = 1e-3
"""Of the contact forces' distance from the template's, per (m g)^2.

Small: in double stance it chooses between forces that serve the tasks alike.
"""

TORQUE_COST = 1e-4
"""Of the joint torques, per squared limit. Smaller: it only makes the optimum unique."""

SOLE_SHARE = 0.9
"""Share of a sole, in length and width, in which its centre of pressure is kept: at its edge the
foot tilts. With 0.25 and 0.5 G1 walks too."""

_CHECKS = "proxsuite.instructionset"
"""Module that proxsuite asks at its import which of its builds the processor can run."""


def load_proxqp() -> Any:
    """ProxQP of proxsuite's portable build, or that which the process has imported before.

    Only one can be loaded: a later import of proxsuite gets this one too, and the log says so.
    """
    if "proxsuite" not in sys.modules and os.environ.get(BUILD) != "native":
        none = ModuleType(_CHECKS)
        vars(none).update(has_AVX512F=bool, has_AVX2=bool)  # called without arguments: False
        sys.modules[_CHECKS] = none
        try:
            import_module("proxsuite")
        finally:
            del sys.modules[_CHECKS]
        _LOG.info(
            "this process has ProxQP's portable build, with which runs repeat to the last bit; for"
            " another one import proxsuite first, or set %s=native",
            BUILD,
        )
    return import_module("proxsuite").proxqp


@dataclass(frozen=True)
class QpOptions(Checked):
    """Motors and ground as the QP knows them, and its regularisation.

    Attributes:
        friction: Coulomb coefficient of the ground, as far as the controller knows it.
        friction_margin: share of it that the cones use; a foot slides before the QP knows.
        torque_scale: share of the URDF's torque limits that may be used.
        contact_damping: brings a foot that landed sliding to rest [1/s].
        speed_share: from this share of its limit on a joint's speed is bounded. Far from the
            limit the bound would only cost time.
        speed_horizon: a joint gains at most the rest up to its limit in this time [s]. Shorter,
            and it would meet the limit with a jolt; longer, and swings would be slowed that
            never come near it.
        stop_share: from this share of a joint's limit of speed on it slows down before its stop.
            A slower one hits it gently, and asking would only cost time.
        stop_horizon: a joint's speed is at most the way to its stop over this time [s]. Shorter,
            and motors must brake harder than they can; longer, and legs could not be nearly
            straight.
    """

    friction: Positive = tuned(0.7)
    friction_margin: Positive = tuned(0.9)
    torque_scale: Positive = tuned(1.0)
    contact_damping: NotNegative = tuned(40.0, RATE)
    speed_share: Share = tuned(0.85)
    speed_horizon: Positive = tuned(0.005, TIME)
    stop_share: Share = tuned(0.5)
    stop_horizon: Positive = tuned(0.02, TIME)

    @property
    def cone(self) -> float:
        """Coefficient that the cones are built with."""
        return self.friction_margin * self.friction


class Stance(NamedTuple):
    """The contacts on the ground and what they should do there.

    Attributes:
        contacts: their indices.
        force: (d c,) contact forces to stay near, of each x and y, in space x, y and z [N]; of
            patches (6 c,), force and moment of each.
        cap: (c,) largest normal force of each [N] (inf: none).
    """

    contacts: tuple[int, ...] = ()
    force: Array = np.zeros(0)
    cap: Array = np.zeros(0)


AIRBORNE = Stance()
"""Of a robot none of whose contacts is on the ground, or that has none."""


class Solution(NamedTuple):
    """Answer of one tick.

    Attributes:
        torque: (nu,) joint torques [N m], within their limits.
        force: (d c,) force at each contact on the ground [N], by direction; of patches (6 c,),
            force and moment at the toe of each [N, N m].
        acceleration: (nv,) generalised accelerations.
        solved: False where the QP was infeasible, singular or not solved within its caps;
            the torques are then the last solved ones, and force and acceleration follow
            from them.
        solve_seconds: time in ProxQP, 0 where no limit acts.
    """

    torque: Array
    force: Array
    acceleration: Array
    solved: bool
    solve_seconds: float


def bound_joints(robot: Robot, options: QpOptions, bounds: Array, slack: float) -> None:
    """Write bounds of the joints' accelerations, near their limits of speed and before their stops.

    A leg that has pushed off trails behind hips that run on, and its knee straightens. One that
    goes straight hits its stop with tens of kilonewtons, which throws the leg back and the trunk
    forward. So no joint may be faster than one that is to come to rest before its stop:

        (-v_least - v) / T <= a <= (v_most - v) / T
        v_most = min(v_max, (q_max - q) / T_s),  v_least = min(v_max, (q - q_min) / T_s)

    with T the horizon in which a limit of speed is met, and T_s that in which a stop is.

    ``bounds`` (2, nu), least and greatest [rad/s^2], are overwritten. ``slack`` is allowed at least
    in either direction [rad/s^2]: -inf, or 0 where a joint that is too fast may stay so.
    """
    o, limit = options, robot.velocity_limit
    place, speed, (low, high) = robot.joint_angle, robot.joint_velocity, robot.joint_stops.T
    down = np.minimum((place - low) / o.stop_horizon, limit)
    up = np.minimum((high - place) / o.stop_horizon, limit)
    bounds[1] = np.maximum((up - speed) / o.speed_horizon, slack)
    bounds[0] = -np.maximum((down + speed) / o.speed_horizon, slack)


class Workspace:
    """Matrices and ProxQP object for so many contacts, and ``bounded`` accelerations of joints.

    ``shared`` are the model's limits of torque, and its torques (nu,) [N m], for all matrices.
    """

    def __init__(
        self, robot: Robot, shared: tuple[Array, Array], contacts: int, bounded: int
    ) -> None:
        nu, forces = len(shared[0]), robot.contact_rows * contacts
        rows = nu + problem.rows_per_contact(robot.contact_rows) * contacts + bounded
        maps = (robot.nv, nu + 1), (forces, nu + 1)
        quadratic = (nu, nu), (nu,), (rows, nu), (rows,), (rows,), (nu,)
        shapes = (2, bounded), *maps, *quadratic, (forces, robot.nv), (forces,), (nu + 1,)
        self.matrices = problem.Matrices(*shared, *(np.zeros(shape) for shape in shapes))
        self._proxqp = load_proxqp()
        self._warm: Any = None  # or a QP that has solved the problem of an earlier tick

    def _new(self) -> Any:
        dense, (rows, nu) = self._proxqp.dense, self.matrices.constraint.shape
        kinds = dense.HessianType.Dense, dense.DenseBackend.PrimalDualLDLT
        qp = dense.QP(nu, 0, rows, False, *kinds)
        # The tolerance is tight because a warm start stops as soon as it is met.
        qp.settings.eps_abs, qp.settings.eps_rel = 1e-8, 0.0
        # Without caps an infeasible problem runs for minutes.
        qp.settings.max_iter = qp.settings.max_iter_in = 40
        return qp

    def solve(self) -> Array | None:
        """The w of least cost, by a warm start, else from scratch; None where none is found."""
        m, qp, proxqp = self.matrices, self._warm, self._proxqp
        solved, guess = proxqp.QPSolverOutput.PROXQP_SOLVED, proxqp.InitialGuess
        if qp is not None:
            qp.update(g=m.gradient, C=m.constraint, l=m.lower, u=m.upper)
            qp.solve()
            if qp.results.info.status == solved:
                return np.asarray(qp.results.x)
        # A failed solve leaves penalties behind with which the next one can stop at a wrong answer,
        # even after `init`; a new object costs microseconds.
        self._warm, qp = None, self._new()
        qp.settings.initial_guess = guess.NO_INITIAL_GUESS
        qp.init(H=np.eye(len(m.gradient)), g=m.gradient, C=m.constraint, l=m.lower, u=m.upper)
        qp.solve()
        if qp.results.info.status != solved:
            return None
        qp.settings.initial_guess = guess.WARM_START_WITH_PREVIOUS_RESULT
        self._warm = qp
        return np.asarray(qp.results.x)


class WholeBodyQp:
    """Torques that serve weighted tasks within limits of torque and speed, and friction cones.

    Args:
        robot: the model; :meth:`solve` reads its last update.
        options: motors, ground, regularisers.

    Attributes:
        torque_limit: (nu,) that may be used [N m].
        data: (1,) of ``QP_DATA``: the stance, for compiled code.
    """

    @checked
    def __init__(self, robot: Robot, options: QpOptions | None = None) -> None:
        o = options or QpOptions()
        self.robot = robot
        self.data = np.zeros(1, problem.QP_DATA)
        now = self.data[0]
        now["force_cost"], now["torque_cost"] = FORCE_COST, TORQUE_COST
        now["sole_share"] = SOLE_SHARE
        now["friction"], now["contact_damping"] = o.cone, o.contact_damping
        now["speed_share"], now["stop_share"] = o.speed_share, o.stop_share
        now["stop_time"], now["load"] = o.stop_horizon / o.speed_share, 1.0
        self._options = o
        nu, most = len(robot.torque_limit), int(robot.data["contacts"][0])
        self._limit, self._torque = of_model = np.zeros(nu), np.zeros(nu)
        self.workspaces, self._braked = (
            [Workspace(robot, of_model, contacts, bounded) for contacts in range(most + 1)]
            for bounded in (0, nu)
        )
        self._contacts, self._sizes = self.data["contacts"], (nu, robot.nv, robot.contact_rows)
        self._load = 1.0
        self.torque_limit = robot.torque_limit * o.torque_scale
        self._failing = False

    @property
    def torque_limit(self) -> Array:
        """See the class."""
        return self._torque_limit

    @torque_limit.setter
    def torque_limit(self, limit: Array) -> None:
        """See the class."""
        self._torque_limit = limit
        self._take_load(self._load)

    def solve(self, tasks: TaskStack, stance: Stance = AIRBORNE, load: float = 1.0) -> Solution:
        """Solve one tick.

        Args:
            tasks: rows, desired accelerations and weights.
            stance: the contacts on the ground; none of a robot with a fixed base.
            load: ratio of the real to the modelled inertia; the torques are scaled by it
                and stay within their limits.

        Raises:
            ParameterError: naming a task that wrote a number which is not finite.
        """
        now, count = self.data[0], len(stance.contacts)
        now["contacts"], now["contact"][:count] = count, stance.contacts
        now["cap"][:count], directions = stance.cap, self.robot.contact_rows
        now["force"][:count, :directions] = stance.force.reshape(count, directions)
        robot, m, found = self.robot, self.room(load), self.answer_arrays()
        kind = problem.solve_free(self.data, robot.data, robot.arrays, tasks.table, m, found)
        return self.finish(kind, tasks, found)

    def room(self, load: float) -> problem.Matrices:
        """Those for :func:`.problem.solve_free` of the stance in ``data``, the same for the same.

        ``load`` is as for :meth:`solve`.
        """
        if load != self._load:
            self._take_load(load)
        return self.workspaces[self._contacts[0]].matrices

    def answer_arrays(self) -> problem.Answer:
        """New arrays for the answer of :func:`.problem.solve_free`, of the stance in ``data``."""
        (nu, nv, rows), empty = self._sizes, np.empty
        return empty(nu), empty(rows * int(self._contacts[0])), empty(nv)

    def finish(self, kind: int, tasks: TaskStack, found: problem.Answer) -> Solution:
        """The answer of a tick, by ProxQP where limits act.

        Args:
            kind: what :func:`.problem.solve_free` has found.
            tasks: rows, desired accelerations and weights.
            found: that function has filled it where ``kind`` is ``FREE``.

        Raises:
            ParameterError: naming a task that wrote a number which is not finite.
        """
        seconds, solved = 0.0, kind == problem.FREE
        if not solved:
            seconds, solved = self._solve_limited(kind, tasks, found)
        self._failing = not solved
        return Solution(*found, solved, seconds)

    def _take_load(self, load: float) -> None:
        """Scale the model's limits of torque, which times ``load`` are within the robot's."""
        limit = self.torque_limit / load
        # The product is rounded once more, and may be a hair beyond.
        beyond = load * limit > self.torque_limit
        self._limit[:] = np.where(beyond, np.nextafter(limit, 0.0), limit)
        self._load = load
        self.data["load"] = load

    def _solve_limited(
        self, kind: int, tasks: TaskStack, found: problem.Answer
    ) -> tuple[float, bool]:
        """Fill ``found`` where limits act; seconds in ProxQP, and whether it is solved."""
        robot, braked, seconds = self.robot, kind == problem.BRAKED, 0.0
        contacts = int(self._contacts[0])
        # With bounds, with bounds that let a joint which is too fast stay so, and without.
        slacks = (-np.inf, 0.0, None) if braked else (None,)
        for slack in slacks:
            w = (self.workspaces if slack is None else self._braked)[contacts]
            if slack is not None:
                bound_joints(robot, self._options, w.matrices.bounds, slack)
            if braked:
                state = self.data, robot.data, robot.arrays
                kind = problem.assemble(*state, tasks.table, w.matrices)
            best = w.matrices.minimum if kind == problem.FREE else None
            if best is None:
                tasks.check_finite()  # with such a number no constraint is kept
                start = time.perf_counter()
                best = None if kind == problem.SINGULAR else w.solve()
                seconds += time.perf_counter() - start
            if best is not None:
                problem.torques(w.matrices, best)
                break
        else:
            if not self._failing:
                regular = "has no solution within its limits"
                _LOG.warning(
                    "%s: the QP with %d contacts on the ground %s: the last torques are kept",
                    robot.name,
                    contacts,
                    "is singular" if kind == problem.SINGULAR else regular,
                )
            np.clip(self._torque, -self._limit, self._limit, out=self._torque)
        problem.answer(self._load, w.matrices, found)
        return seconds, best is not None
