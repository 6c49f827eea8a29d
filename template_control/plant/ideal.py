"""Ideal plant: the robot on rigid ground, with nothing that a contact solver adds.

Forward dynamics of the Pinocchio model with the feet's rolling contacts as rigid constraints:
they stick (friction is not modelled, it always suffices), hold only while they press, and a
touchdown is a plastic impact, M (v+ - v-) = J^T L, J v+ = 0. What a robot does differently in
PyBullet is then due to contact and integration there, and what it does differently from its
template here is due to the robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import ClassVar

import numpy as np
import pinocchio as pin

from template_control.arrays import Array, BoolArray
from template_control.checks.checked import checked
from template_control.errors import DivergedError
from template_control.plant.agreement import check_damping, trunk_corners
from template_control.plant.rigid_contact import RollingFeet, pressing, solve
from template_control.plant.world import OptionsPlant, WorldOptions
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.terms import PLANAR_DOF

_DEPTH = 1e-8  # [m] a foot this deep in the ground has touched down
_HALVINGS = 24  # of a time step, to locate an event in
_EVENTS = 16  # in one time step; beyond them it is integrated to its end as it is
_PULL = 1e-6  # of the weight: a foot that would pull this much is released
_REST = 1e-3  # [m/s] a foot that an impact lifts more slowly than this stays on the ground
_SWEEPS = 30  # over the joints with friction; four coupled joints need no more
_DRIFT = 1e-12  # constraint error [m, m/s] that is projected away


@dataclass(frozen=True, kw_only=True)
class IdealOptions(WorldOptions):
    """Options of the ideal world. Friction is not modelled: stance feet stick.

    The integrator makes one step in each ``time_step``.
    """

    kind: ClassVar[str] = "ideal"


class IdealPlant(OptionsPlant):
    """Rigid ground and one robot, driven by joint torques.

    The integrator is the classical Runge-Kutta method of order four; touchdowns and releases
    are located within its steps by bisection. Its tiny constraint drift is taken out by
    projection (mass-weighted, position and velocity) after every step. Joint stops are not
    modelled.

    Args:
        robot: whose model and URDF to copy.
        options: time step, mass error, ground.

    Attributes:
        contacts: indices of the feet on the ground.
        impacts: impulses (n, 2) [N s] on the feet at each touchdown so far.
    """

    @checked
    def __init__(self, robot: PlanarBiped, options: IdealOptions) -> None:
        self.options = options
        model = robot.model.copy()
        scale = options.mass_scale
        for joint, body in enumerate(robot.model.inertias):
            model.inertias[joint] = pin.Inertia(scale * body.mass, body.lever, scale * body.inertia)
        same = robot.feet, robot.foot_radius
        self.robot = PlanarBiped(robot.path, robot.urdf, model, *same, groups=robot.groups)
        self.contacts: tuple[int, ...] = ()
        self.impacts: list[Array] = []
        self._q, self._v = np.zeros(robot.nv), np.zeros(robot.nv)
        self._seen = np.empty(0), np.empty(0)
        self._drive = np.zeros(robot.nv)
        self._push = 0.0
        self._feet = RollingFeet(self.robot, options.ground)
        self._nothing = np.zeros((len(robot.feet), 2))
        self._impulse = self._nothing.copy()
        check_damping(self.robot, options.time_step)
        self._rubbing = np.flatnonzero(robot.joint_friction) + PLANAR_DOF
        self._trunk_corners = trunk_corners(self.robot).tolist()

    def reset(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.reset`.

        A foot within 1 um of the ground that does not leave it is on it, and stops at once.
        """
        self._q, self._v = np.array(q, dtype=float), np.array(v, dtype=float)
        self.contacts = ()
        self._impulse[:] = 0.0
        self._see(self._q, self._v)
        low = self._feet.gaps() < 1e-6
        self._land(low & (self.robot.contact_velocity[:, 1] <= 1e-9))
        self._impulse[:] = 0.0
        self.impacts.clear()

    def read(self, q: Array, v: Array) -> None:
        """See :meth:`~.plant.Plant.read`."""
        q[:], v[:] = self._q, self._v

    def contact_forces(self, out: Array) -> None:
        """See :meth:`~.plant.Plant.contact_forces`; impacts are included."""
        out[:] = self._impulse / self.options.time_step

    def trunk_touches_ground(self) -> bool:
        """True where the box around the trunk's collision shapes reaches the ground."""
        x, y, pitch = self._q[:PLANAR_DOF].tolist()
        sine, cosine = sin(pitch), cos(pitch)
        return any(
            y - along * sine + up * cosine <= self.ground_height(x + along * cosine + up * sine)
            for along, up in self._trunk_corners
        )

    def step(self, torque: Array, push: float = 0.0) -> None:
        """See :meth:`~.plant.Plant.step`.

        Raises:
            DivergedError: if the state is not finite any more, or the legs lie so that the
                contacts' forces are not determined.
        """
        self._drive[PLANAR_DOF:] = torque
        self._push = push
        self._impulse[:] = 0.0
        try:
            if self._rubbing.size:
                self._rub()
            self._advance(self.options.time_step)
        except np.linalg.LinAlgError:
            raise DivergedError(
                f"{self.robot.name}: the contacts' forces are not determined at q ="
                f" {self._q.tolist()}"
            ) from None

    def _rub(self) -> None:
        """Add the joints' dry friction to the drive, held during the step as the torques are.

        It is what stops a joint within the step, or as much of it as there is: a problem of
        complementarity in the joints' speeds at the end of the step, solved in sweeps.
        """
        r, h, joints = self.robot, self.options.time_step, self._rubbing
        self._see(self._q, self._v)
        rows, gamma = self._feet.rows()
        a, _ = solve(r.mass_matrix, self._right(self._q), rows, gamma, self.contacts)
        units = np.eye(r.nv)[joints]
        none = self._nothing
        answer = [solve(r.mass_matrix, unit, rows, none, self.contacts)[0] for unit in units]
        per_torque = np.array(answer)[:, joints]
        ends = self._v[joints] / h + a[joints]
        most, torque = r.joint_friction[joints - PLANAR_DOF], np.zeros(len(joints))
        for _ in range(_SWEEPS):
            for i, own in enumerate(per_torque):
                wanted = torque[i] - (ends[i] + own @ torque) / own[i]
                torque[i] = min(max(wanted, -most[i]), most[i])
        self._drive[joints] += torque

    def _advance(self, left: float) -> None:
        """Go on for ``left`` seconds, from event to event."""
        for _ in range(_EVENTS):
            left -= self._to_event(left)
            if left <= 0.0:
                return
        self._commit(*self._flow(left, self._rates(self._q, self._v)))

    def _see(self, q: Array, v: Array) -> None:
        """Let the robot's update be at (q, v); no state is ever changed in place."""
        if q is not self._seen[0] or v is not self._seen[1]:
            self.robot.update(q, v)
            self._seen = q, v

    def _right(self, q: Array) -> Array:
        """Generalised forces less nonlinear effects at the robot's last update."""
        right = self._drive - self.robot.nonlinear_effects
        if self._push:
            x, _, z = self.robot.trunk_lever
            right[0] += self._push
            right[2] += self._push * (z * cos(q[2]) - x * sin(q[2]))
        return right

    def _rates(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Acceleration (nv,) and forces (n, 2) along and out of the ground, ``contacts`` held."""
        r = self.robot
        self._see(q, v)
        return solve(r.mass_matrix, self._right(q), *self._feet.rows(), self.contacts)

    def _flow(self, h: float, begin: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """State after ``h`` seconds with the present contacts, and their impulse (n, 2)."""
        q, v = self._q, self._v
        a1, f1 = begin
        a2, f2 = self._rates(q + 0.5 * h * v, v2 := v + 0.5 * h * a1)
        a3, f3 = self._rates(q + 0.5 * h * v2, v3 := v + 0.5 * h * a2)
        a4, f4 = self._rates(q + h * v3, v4 := v + h * a3)
        return (
            q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4),
            v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4),
            self._feet.in_world(h / 6.0 * (f1 + 2.0 * f2 + 2.0 * f3 + f4)),
        )

    def _to_event(self, h: float) -> float:
        """Go on until a foot touches down or is released, at most ``h``; the time gone by."""
        r = self.robot
        right = self._right(self._q)
        self.contacts, a, f, clean = pressing(
            r.mass_matrix, right, *self._feet.rows(), self.contacts
        )
        end = self._flow(h, (a, f))
        if clean and self._margin(end) < 0.0:
            low, high = 0.0, h
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                flown = self._flow(middle, (a, f))
                if self._margin(flown) < 0.0:
                    high, end = middle, flown
                else:
                    low = middle
            h = high
        self._commit(*end)
        self._land(self._feet.gaps() < -_DEPTH)
        return h

    def _margin(self, end: tuple[Array, Array, Array]) -> float:
        """Negative where, at the ``end`` of a flow, a foot is in the ground or pulls at it."""
        q, v, _ = end
        _, force = self._rates(q, v)
        weight, gaps = self.robot.mass * self.robot.gravity, self._feet.gaps()
        return min(
            force[i, 1] / weight + _PULL if i in self.contacts else float(gaps[i]) + _DEPTH
            for i in range(len(gaps))
        )

    def _land(self, feet: BoolArray) -> None:
        """Plastic impact of ``feet`` (n,) with the ground; another one may be released."""
        landing = tuple(i for i in range(len(feet)) if feet[i] and i not in self.contacts)
        if not landing:
            return
        r = self.robot
        for i in landing:
            self._feet.meet(i, self._q)
        touching = tuple(sorted((*self.contacts, *landing)))
        momentum, zero = r.mass_matrix @ self._v, self._nothing
        rows, _ = self._feet.rows()
        held, v, impulse, _ = pressing(r.mass_matrix, momentum, rows, zero, touching)
        if all(rows[i, 1] @ v < _REST for i in touching):
            held = touching
            v, impulse = solve(r.mass_matrix, momentum, rows, zero, held)
        self.contacts, self._v = held, v
        impulse = self._feet.in_world(impulse)
        self._impulse += impulse
        self.impacts.append(impulse)
        self._commit(self._q, self._v, self._nothing)

    def _commit(self, q: Array, v: Array, impulse: Array) -> None:
        """Take over (q, v), projected onto the contacts; the robot's update is at it."""
        r = self.robot
        self._impulse += impulse
        self._see(q, v)
        error = self._nothing.copy()
        for i in self.contacts:
            error[i] = self._feet.errors(i, q)
        if np.abs(error).max() > _DRIFT:
            rows, _ = self._feet.rows()
            q = q + solve(r.mass_matrix, np.zeros(r.nv), rows, error, self.contacts)[0]
            self._see(q, v)
        rows, _ = self._feet.rows()
        slip = rows[list(self.contacts)] @ v
        if slip.size and np.abs(slip).max() > _DRIFT:
            v, _ = solve(r.mass_matrix, r.mass_matrix @ v, rows, self._nothing, self.contacts)
            self._see(q, v)
        self._q, self._v = q, v
