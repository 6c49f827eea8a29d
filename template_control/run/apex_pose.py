"""Feet and trunk at the apex of a gait whose legs take turns, and their velocities.

The trunk turns against the legs, so that the robot flies without angular momentum. Joint
velocities that do not fit the gait cost a start far more torque than the gait itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Pair
from template_control.embedding.swing import FEET, SwingOptions, begin_swing, swing_step
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.start import Pose, state_in
from template_control.robot.terms import UP
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import Event, Reset
from template_control.slip.gaits.gait import Gait, gait_stride

_NEAR = 0.9  # of l0: a distance from the CoM that any leg reaches
_LEVEL = 1.0  # the same of a leg with a level sole: more bent, its ankle comes to its stop
_REACH = 0.96  # of the leg: a straight knee may bend either way
_TICK = 1e-3  # over which the references move on [s]; finer ones end in the same place


@dataclass(frozen=True)
class ApexStart(Checked):
    """Start of a run at an apex.

    Attributes:
        state: (2,) dx/dt and y [m/s, m].
        gait: its legs' swings are half over there.
        swing: shape of the swings.
        pitch: of the trunk [rad].
        automaton: that the gait's stride is of.
    """

    state: Pair
    gait: Gait
    swing: SwingOptions
    pitch: float = 0.0
    automaton: Automaton = AUTOMATON


@checked
def apex_pose(
    robot: Biped, start: ApexStart, place: Callable[[Any, Pose], object] = state_in
) -> Pose:
    """The pose at an apex, with both feet where the references of their swings are.

    A foot that stood in one stride swings through the next and lands in the one after that. So
    one swing passes two apexes: at the first it is the foot that has just stood, at the second the
    foot that is about to land.

    Args:
        robot: the model; its last update is overwritten.
        start: what is wanted, scaled to the robot.
        place: brings the robot into a pose of its sagittal plane.

    Raises:
        RobotError: if the legs do not reach the pose.
        ParameterError: if the gait's legs do not take turns in the air.
    """
    gait, z = start.gait, start.state
    stride = gait_stride(gait, start.automaton)
    if not any(event.reset is Reset.SWAP for event in stride.events):
        raise ParameterError(
            f"the legs of gait {gait.name!r} do not take turns: give the Experiment a pose"
        )
    landing, liftoff = stride.time_of(Event.TOUCHDOWN), stride.time_of(Event.REAR_LIFTOFF)
    # The liftoff's exchange of roles has made the stance toe the front leg's.
    toe, period = float(stride.toes[1]), stride.duration
    swing, reference = np.zeros(1, FEET), np.zeros((2, 3))
    begin_swing(swing, 0, start.swing, reference, np.array([toe, 0.0]), np.zeros(2))
    feet, velocities = [], []
    now, due = liftoff, 2.0 * period + landing
    for apex in (1, 2):
        ticks = ceil((apex * period - now) / _TICK)
        dt = (apex * period - now) / ticks
        for _ in range(ticks):
            foothold = toe + 2.0 * gait.step_length, 0.0, due - now
            swing_step(swing[0], 0, *reference, foothold, True, dt)
            now += dt
        (x, speed, _), (y, rise, _) = reference.tolist()
        feet.append([x - apex * gait.step_length, y])
        velocities.append([speed, rise])
    pose = Pose(
        com=np.array([0.0, z[1]]),
        com_velocity=np.array([z[0], 0.0]),
        feet=np.array(feet[::-1]),
        feet_velocity=np.array(velocities[::-1]),
        swung=(2.0 * period - liftoff, period - liftoff),
        pitch=start.pitch,
        angular_momentum=0.0,
    )
    # Fast references run ahead of what the legs reach. Where the feet are hardly moves the hips.
    reach = (_LEVEL if robot.patches else _NEAR) * gait.parameters.rest_length
    place(robot, replace(pose, feet=_within(pose, pose.com, reach)))
    hips = robot.data["hips"][0, [0, UP]] + (robot.toe_ahead, -robot.ankle_height)
    return replace(pose, feet=_within(pose, hips, _REACH * robot.leg_length))


def _within(pose: Pose, centre: Array, reach: float) -> Array:
    """(2, 2) the pose's feet, drawn to within ``reach`` of ``centre`` [m]."""
    away = pose.feet - centre
    length = np.linalg.norm(away, axis=1, keepdims=True)
    return np.asarray(centre + away * np.minimum(reach / length, 1.0))
