"""State of a robot where a run begins, for a pose of CoM, trunk and feet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np
import pinocchio as pin

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Pair, Range, Shape, Triple, Vector
from template_control.errors import ParameterError, RobotError
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.legs import foot_frame
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.robot import WORLD_ALIGNED
from template_control.robot.terms import PLANAR_DOF

_SHORT = 0.15  # of a step of Newton's method [rad]
_LONGEST = 0.2  # the same, of a floating-base robot [rad, m]
_EXACT = 1e-12  # [m, rad]

AnyBiped = TypeVar("AnyBiped", PlanarBiped, FloatingBaseBiped)
# By a configuration, what a robot misses of a pose at its last update, and its Jacobian.
Missed = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Pose(Checked):
    """Positions and velocities of the CoM and the feet; x and y up, or in space x, y and z up.

    In space they are in the heading frame.

    Attributes:
        com, com_velocity: (d,) of the CoM [m, m/s], d the robot's directions.
        feet: (2, d) lowest points of rear and front foot [m]; of several contacts the mean, from
            which they are as far as where the legs hang down. Of flat feet the toes of level soles.
        feet_velocity: (2, d) [m/s].
        rear: the foot that is the rear leg's.
        swung: time since rear and front foot left the ground [s]; None: they are in the middle of
            their swings, if they swing.
        pitch: of the trunk [rad].
        angular_momentum: forward, about the CoM [N m s]; the trunk turns so that the robot has it.
            None: the trunk is at rest.
        momentum_speed: whether ``com_velocity`` is meant to include the angular momentum about the
            CoM, as if it moved the CoM: times m and the CoM's height it is the momentum about the
            point on the ground below. With flat feet the lateral one is ``sway`` times that.
    """

    com: Vector
    com_velocity: Vector
    feet: Annotated[Array, Shape((2, None))]
    feet_velocity: Annotated[Array, Shape((2, None))]
    rear: Annotated[int, Range(0, 1)] = 0
    swung: tuple[NotNegative, NotNegative] | None = None
    pitch: float = 0.0
    angular_momentum: float | None = None
    momentum_speed: bool = False


def state_in(robot: PlanarBiped, pose: Pose) -> tuple[Array, Array]:
    """(nv,) q [m, rad] and (nv,) v [m/s, rad/s] of a robot in a pose, which it is updated to."""
    # From far away Newton's full step may bend a knee the wrong way; short ones do not.
    q = _bent_to(robot, pose, _planar_configuration, (np.inf, _SHORT))
    robot.update(q, np.zeros(robot.nv))
    feet, speeds = _feet(robot, pose, pose.feet_velocity)
    rows = _placing_rows(robot, feet)
    momentum = _angular_momentum_row(robot, q)
    if pose.momentum_speed:
        rows[0] += momentum / (robot.mass * pose.com[1])
    if pose.angular_momentum is not None:
        rows[2] = momentum
    wanted = [*pose.com_velocity, pose.angular_momentum or 0.0, *speeds.ravel()]
    v = _solved(robot, rows, np.array(wanted))
    robot.update(q, v)
    return q, v


@checked
def state_at_vlo(
    robot: PlanarBiped,
    z: Triple,
    stance: Annotated[int, Range(0, 1)],
    swing_position: Pair,
    swing_velocity: Pair,
    pitch: float = 0.0,
) -> tuple[Array, Array]:
    """State of a robot at VLO, with the stance foot at x = 0.

    Args:
        robot: the model; its last update is overwritten.
        z: (3,) dx/dt, y, dy/dt [m/s, m, m/s]; dx/dt is the angular momentum about the foot over
            m y.
        stance: index of the stance foot.
        swing_position, swing_velocity: (2,) of the swing foot [m, m/s].
        pitch: of the trunk, at rest [rad].

    Returns:
        q and v as of :func:`state_in`.

    Raises:
        RobotError: as :func:`state_in`.
    """
    pose = Pose(
        com=np.array([0.0, z[1]]),
        com_velocity=np.array([z[0], z[2]]),
        feet=np.array([np.zeros(2), swing_position]),
        feet_velocity=np.array([np.zeros(2), swing_velocity]),
        rear=stance,
        pitch=pitch,
        momentum_speed=True,
    )
    return state_in(robot, pose)


@checked
def floating_state_in(robot: FloatingBaseBiped, pose: Pose) -> tuple[Array, Array]:
    """State of a floating-base robot whose CoM and feet are in a pose.

    Args:
        robot: the model; its last update is overwritten, and the robot faces along the world's x.
        pose: what is wanted.

    Returns:
        (nq,) configuration q; (nv,) velocity v.

    Raises:
        RobotError: if the legs do not reach, or joints would be beyond their limits.
    """
    robot.face(0.0, np.zeros(2))
    q = _bent_to(robot, pose, _floating_configuration, (_LONGEST,))
    robot.update(q, np.zeros(robot.nv))
    rows, momentum = robot.placing_rows(), robot.jacobians.momentum
    weight = robot.mass * pose.com[2]
    if pose.angular_momentum is not None:
        rows[3:6] = momentum
    if pose.momentum_speed:
        rows[0] += momentum[1] / weight
        rows[1] -= momentum[0] / weight
        rows[1] *= robot.sway
    wanted, velocities = np.zeros(len(rows)), np.zeros((len(robot.feet), robot.contact_rows))
    wanted[:3], wanted[4] = pose.com_velocity, pose.angular_momentum or 0.0
    velocities[:, :3] = _by_contact(robot, pose, pose.feet_velocity)
    wanted[6:] = velocities.ravel()
    v = robot.smallest_motion(rows, wanted)
    robot.update(q, v)
    return q, v


def _bent_to(
    robot: AnyBiped,
    pose: Pose,
    solve: Callable[[AnyBiped, Pose, Array, float], Array | None],
    longest: Sequence[float],
) -> Array:
    """(nq,) configuration of a pose, with knees bent as their ranges allow.

    ``solve`` finds the pose from one with bent legs, or None, by steps as long as ``longest``.
    """
    places = pose.com, pose.com_velocity, pose.feet, pose.feet_velocity
    if any(place.shape[-1] != robot.directions for place in places):
        raise ParameterError(
            f"the pose of {robot.name} has places of {len(pose.com)} numbers, or velocities of"
            f" others: give {robot.directions} each"
        )
    beyond, height = "", pose.com[-1]
    low, high = robot.joint_range.T
    for backward in (False, True):
        for length in longest:
            q = solve(robot, pose, robot.bent(backward), length)
            if q is None:
                continue
            angles = q[-len(low) :]
            out = np.flatnonzero((angles < low) | (angles > high))
            if not len(out):
                return q
            joint = out[0]
            beyond = beyond or (
                f"joint {robot.joint_names[joint]!r} at {angles[joint]:.3g} rad, beyond its limits"
                f" of {low[joint]:.3g} to {high[joint]:.3g} rad"
            )
    if beyond:
        raise RobotError(f"{robot.name}: a start at height {height:g} m needs {beyond}")
    straight = robot.neutral()[-len(low) :]
    legs = ", ".join(f"{n} = {q:.3g}" for n, q in zip(robot.joint_names, straight, strict=True))
    raise RobotError(
        f"{robot.name}: the legs do not reach a CoM height of {height:g} m, with knees bent forward"
        f" or backward from the straight legs at {legs} rad"
    )


def _newton(
    robot: AnyBiped,
    q: Array,
    missed: Missed,
    solve: Callable[[AnyBiped, Array, Array], Array],
    longest: float,
    iterations: int,
) -> Array | None:
    """(nq,) configuration at which nothing is ``missed``, by Newton's method; None: not found.

    ``solve`` finds the step (nv,); ``longest`` is its largest change of a coordinate.
    """
    rest = np.zeros(robot.nv)
    for _ in range(iterations):
        robot.update(q, rest)
        away, rows = missed(q)
        if np.max(np.abs(away)) < _EXACT:
            return q
        change = solve(robot, rows, -away)
        q = robot.moved(q, change * min(1.0, longest / np.max(np.abs(change))))
    return None


def _planar_configuration(robot: PlanarBiped, pose: Pose, q: Array, longest: float) -> Array | None:
    """(nv,) q of a pose by steps of at most ``longest`` [rad] from bent legs; None: not found."""
    feet, wanted = _feet(robot, pose, pose.feet)
    q[:PLANAR_DOF] = pose.com[0], 0.8 * pose.com[1], pose.pitch

    def missed(q: Array) -> tuple[Array, Array]:
        away = (robot.foot_position[feet] - wanted).ravel()
        rows = _placing_rows(robot, feet)
        # The lowest point's path, not that of the material point which touches there.
        rows[3::2] += robot.foot_radius * robot.foot_turning[feet]
        return np.concatenate((robot.com - pose.com, [q[2] - pose.pitch], away)), rows

    return _newton(robot, q, missed, _solved, longest, 50)


def _placing_rows(robot: PlanarBiped, feet: Sequence[int]) -> Array:
    """(nv, nv) Jacobians of the CoM, the trunk's pitch and these feet, x before y."""
    of_feet = robot.foot_jacobian[feet].reshape(-1, robot.nv)
    return np.vstack((robot.com_jacobian, np.eye(robot.nv)[2], of_feet))


def _feet(robot: PlanarBiped, pose: Pose, values: Array) -> tuple[list[int], Array]:
    """Feet that the robot has, rear one first, and their rows of ``values`` (2, 2)."""
    if not robot.groups[pose.rear]:
        raise RobotError(f"{robot.name} has no foot {pose.rear}: give the pose another rear one")
    both = enumerate((pose.rear, 1 - pose.rear))
    legs, feet = zip(*((leg, foot) for leg, foot in both if robot.groups[foot]), strict=True)
    return list(feet), values[list(legs)]


def _floating_configuration(
    robot: FloatingBaseBiped, pose: Pose, q: Array, longest: float
) -> Array | None:
    """As :func:`_planar_configuration`, of a floating-base robot."""
    q[:3] = pose.com[0], pose.com[1], 0.9 * pose.com[2]
    upright = pin.rpy.rpyToMatrix(0.0, pose.pitch, 0.0)
    feet = _by_contact(robot, pose, pose.feet)
    feet[:, :2] += robot.spread
    data = robot.model.createData()

    def missed(q: Array) -> tuple[Array, Array]:
        turn = pin.log3(robot.rotation @ upright.T)
        away = robot.contact_position - feet
        if robot.patches:
            axes = robot.data["contact_axes"][0, : len(feet)]
            away = np.hstack((away, [pin.log3(turned) for turned in axes]))
        rows, r = robot.placing_rows(), robot.foot_radius
        # The lowest point's path, not that of the material point which touches there.
        for i, foot in enumerate(robot.feet if r > 0.0 else ()):
            frame = foot_frame(robot.model, foot)
            turning = pin.computeFrameJacobian(robot.model, data, q, frame, WORLD_ALIGNED)[3:]
            rows[6 + 3 * i] += r * turning[1]
            rows[7 + 3 * i] -= r * turning[0]
        return np.concatenate((robot.space.com - pose.com, turn, away.ravel())), rows

    return _newton(robot, q, missed, FloatingBaseBiped.smallest_motion, longest, 100)


def _by_contact(robot: FloatingBaseBiped, pose: Pose, values: Array) -> Array:
    """(n, 3) of each contact what rear and front foot have, ``values`` (2, 3)."""
    found = np.empty((len(robot.feet), 3))
    for leg, value in zip((pose.rear, 1 - pose.rear), values, strict=True):
        found[list(robot.groups[leg])] = value
    return found


def _solved(robot: PlanarBiped, matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise RobotError(f"{robot.name}: the legs do not determine the pose; bend them") from None


def _angular_momentum_row(robot: PlanarBiped, q: Array) -> Array:
    """(nv,) row that maps v to the angular momentum about the CoM; it is linear in v."""
    row = np.zeros(robot.nv)
    for i, unit in enumerate(np.eye(robot.nv)):
        robot.update(q, unit)
        row[i] = robot.angular_momentum
    robot.update(q, np.zeros(robot.nv))
    return row
