"""Kalman filter of the trunk: an IMU predicts its motion, and the feet in stance correct it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from template_control.arrays import Array, BoolArray
from template_control.checks.checked import Checked
from template_control.checks.ranges import Positive
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.planar_biped import PlanarBiped
from template_control.slip.similarity import LENGTH, SPEED, tuned


@dataclass(frozen=True)
class BaseFilterOptions(Checked):
    """Noise that the filter of the trunk assumes; standard deviations.

    Attributes:
        gyro_noise: of a reading [rad/s]; the sensor's own, whatever the robot's size.
        force_noise: of a reading of the accelerometer [m/s^2]; likewise.
        foot_noise: of a foot's position relative to the trunk, from encoders and model [m].
        creep: of a standing foot in a second, by slip and by a ground that gives way [m/s].
    """

    gyro_noise: Positive = 5e-3
    force_noise: Positive = 0.1
    foot_noise: Positive = tuned(5e-4, LENGTH)
    creep: Positive = tuned(0.01, SPEED)


class _PlanarTrunk:
    """A planar robot's trunk, with d = 2 directions and a = 1 axis about which it turns."""

    axes = 1

    def __init__(self, robot: PlanarBiped) -> None:
        self._robot = robot

    def rotation(self, base: Array) -> Array:
        """(d, d) from the trunk to the world, of a configuration, or of its base (nq - nu,)."""
        sine, cosine = np.sin(base[2]), np.cos(base[2])
        return np.array([[cosine, sine], [-sine, cosine]])

    def turned(self, base: Array, angle: Array) -> Array:
        """The configuration after a turn by ``angle`` (a,) about the trunk's axes [rad]."""
        return np.concatenate((base[:2], base[2:] + angle))

    def swept(self, rotation: Array, vector: Array) -> Array:
        """(d, a) derivative of ``rotation`` times a vector of the trunk (d,) by such an angle."""
        forward, up = rotation @ vector
        return np.array([[up], [-forward]])

    def rolled(self, q: Array) -> Array:
        """(n, d) by how much the feet's spheres have rolled on [m]; ``q`` is the robot's update."""
        robot = self._robot
        angle = robot.foot_turning[: len(robot.feet)] @ q
        return np.stack((robot.foot_radius * angle, np.zeros(len(angle))), axis=1)

    def middle(self, base: Array, other: Array) -> Array:
        """(d, d) rotation half-way between two configurations."""
        return self.rotation(0.5 * (base + other))

    def velocity_axes(self, base: Array) -> Array:
        """(d, d) from the axes in which v has the base's velocity to the world's."""
        return np.eye(2)


class _FloatingTrunk:
    """As :class:`_PlanarTrunk`, in space; the base is a place and a quaternion (x, y, z, w)."""

    axes = 3

    def __init__(self, robot: FloatingBaseBiped) -> None:
        self._robot = robot
        self._feet: Array | None = None
        self._rolled = np.zeros((len(robot.feet), 3))

    def rotation(self, base: Array) -> Array:
        return pin.Quaternion(base[3:7]).toRotationMatrix()

    def turned(self, base: Array, angle: Array) -> Array:
        quaternion = pin.Quaternion(base[3:7]) * pin.Quaternion(pin.exp3(angle))
        return np.concatenate((base[:3], quaternion.normalized().coeffs()))

    def swept(self, rotation: Array, vector: Array) -> Array:
        return -rotation @ pin.skew(vector)

    def rolled(self, q: Array) -> Array:
        """The turns of the feet since the last call are added."""
        feet, before = self._robot.foot_rotation, self._feet
        self._feet = feet
        if before is not None and self._robot.foot_radius:
            for foot, (now, then) in enumerate(zip(feet, before, strict=True)):
                x, y, _ = pin.log3(now @ then.T)
                self._rolled[foot, :2] += self._robot.foot_radius * np.array([y, -x])
        return self._rolled

    def middle(self, base: Array, other: Array) -> Array:
        rotation = self.rotation(base)
        return rotation @ pin.exp3(0.5 * pin.log3(rotation.T @ self.rotation(other)))

    def velocity_axes(self, base: Array) -> Array:
        return self.rotation(base)


def trunk_frame(robot: PlanarBiped | FloatingBaseBiped) -> _PlanarTrunk | _FloatingTrunk:
    """The trunk's frame of a robot of either kind."""
    return _FloatingTrunk(robot) if isinstance(robot, FloatingBaseBiped) else _PlanarTrunk(robot)


class BaseFilter:
    """Extended Kalman filter of the trunk's place, rotation R and velocity, and of the feet's p_i.

    The IMU predicts the state, with w its turning and f the specific force, in the trunk's axes:

        R' = R [w],    v' = R f - (0, g),    x' = v,

    and a foot in stance stays where it landed. The measurement is p_i minus the foot's position
    by forward kinematics; a round foot rolls, so that p_i is its contact point less by how much it
    has rolled on, which keeps its value. Along the ground, and about the vertical, nothing is
    measured: the estimate drifts there as a real robot's does. (Bloesch et al. 2012.) The error of
    R is a turn about the trunk's axes. The robot's last update is overwritten.

    Attributes:
        base: (nq - nu,) configuration of the base.
        velocity: (d,) of its origin in the world [m/s].
        turning: (a,) angular velocity, the gyro's last [rad/s].
        points: (n, d) the p_i [m].
    """

    def __init__(self, robot: PlanarBiped | FloatingBaseBiped, options: BaseFilterOptions) -> None:
        self.robot, self.options, self._trunk = robot, options, trunk_frame(robot)
        d, a, n = robot.directions, self._trunk.axes, len(robot.feet)
        self._d, self._angle, self._speed = d, slice(d, d + a), slice(d + a, 2 * d + a)
        self.base: Array = np.zeros(robot.model.nq - len(robot.joint_names))
        self.velocity, self.turning, self.points = np.zeros(d), np.zeros(a), np.zeros((n, d))
        self._covariance = np.zeros((2 * d + a + d * n, 2 * d + a + d * n))
        self._stands = np.zeros(n, dtype=bool)

    def reset(self, q: Array, v: Array) -> None:
        """Reset to a known state q (nq,), v (nv,) [m, rad, m/s, rad/s], with no foot in stance."""
        self.base = q[: len(self.base)].copy()
        self.velocity = self._trunk.velocity_axes(self.base) @ v[: self._d]
        self.turning = v[self._angle].copy()
        self._covariance[:], self.points[:], self._stands[:] = 0.0, 0.0, False

    @property
    def rates(self) -> Array:
        """(d + a,) velocities of the base, as they stand in v."""
        own = self._trunk.velocity_axes(self.base).T @ self.velocity
        return np.concatenate((own, self.turning))

    def predict(self, turning: Array, specific_force: Array, dt: float) -> None:
        """Advance by dt [s], with the gyro's (a,) now, and the mean specific force (d,)."""
        o, d, trunk = self.options, self._d, self._trunk
        angle = 0.5 * (self.turning + turning) * dt
        rotation = trunk.rotation(trunk.turned(self.base, 0.5 * angle))
        acceleration = rotation @ specific_force
        swept = trunk.swept(rotation, specific_force)
        acceleration[-1] -= self.robot.gravity
        self.base = trunk.turned(self.base, angle)
        self.base[:d] += (self.velocity + 0.5 * acceleration * dt) * dt
        self.velocity = self.velocity + acceleration * dt
        self.turning = turning
        size = len(self._covariance)
        flow, noise = np.eye(size), np.full(size, o.creep**2 * dt)
        flow[:d, self._speed] = np.eye(d) * dt
        flow[:d, self._angle] = 0.5 * swept * dt**2
        flow[self._speed, self._angle] = swept * dt
        if trunk.axes > 1:
            flow[self._angle, self._angle] = pin.exp3(-angle)
        noise[:d] = 0.0
        noise[self._angle] = (o.gyro_noise * dt) ** 2
        noise[self._speed] = (o.force_noise * dt) ** 2
        self._covariance = flow @ self._covariance @ flow.T + np.diag(noise)

    def correct(self, joints: Array, contact: BoolArray) -> None:
        """Correct the estimate with the joints' angles (nu,) [rad] of the feet in contact (n,)."""
        robot, d = self.robot, self._d
        q = np.concatenate((self.base, joints))
        robot.update(q, np.zeros(robot.nv))
        places = robot.contact_position - self._trunk.rolled(q)
        slopes = np.zeros((len(places), d, len(self._covariance)))
        slopes[:, :, :d] = np.eye(d)
        slopes[:, :, self._angle] = robot.contact_jacobian[:, :d, d : d + self._trunk.axes]
        for foot in np.flatnonzero(contact):
            self._take(int(foot), places[foot], slopes[foot])
        self._stands[:] = contact

    def _take(self, foot: int, place: Array, slope: Array) -> None:
        d, p = self._d, self._covariance
        first = len(p) - self.points.size + d * foot
        here, noise = slice(first, first + d), self.options.foot_noise**2 * np.eye(d)
        if not self._stands[foot]:
            # It has just landed: the rest of the state determines its position.
            p[here, :] = slope @ p
            p[:, here] = p[here, :].T
            p[here, here] = slope @ p @ slope.T + noise
            self.points[foot] = place
            return
        slope[:, here] = -np.eye(d)
        missed = self.points[foot] - place
        gain = np.linalg.solve(slope @ p @ slope.T + noise, slope @ p).T
        step = gain @ missed
        self.base = self._trunk.turned(self.base, step[self._angle])
        self.base[:d] += step[:d]
        self.velocity = self.velocity + step[self._speed]
        self.points += step[self._speed.stop :].reshape(self.points.shape)
        self._covariance = p - gain @ slope @ p
