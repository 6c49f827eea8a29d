"""Where the feet are at the apex of a gait whose legs take turns, and how they move.

Joint velocities that do not fit the gait cost a start far more torque than the gait itself.
"""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.references.swing_foot import SwingFoot, SwingOptions
from template_control.errors import ParameterError
from template_control.robot.start import Pose
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import Event, Reset
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.section import APEX

Array = NDArray[np.float64]

_TICK = 1e-3  # over which the references move on [s]; finer ones end in the same place


def apex_pose(
    gait: Gait, swing: SwingOptions, pitch: float = 0.0, automaton: Automaton = AUTOMATON
) -> Pose:
    """The pose at an apex of the gait, with both feet where their swing references have them.

    A foot that stood in one stride swings through the next and lands in the one after that. So
    one swing passes two apexes: at the first it is the foot that has just stood, at the second the
    foot that is about to land.

    Args:
        gait: from apex to apex.
        swing: shape of its swings, scaled to the robot.
        pitch: of the trunk [rad].
        automaton: that its stride is of.

    Raises:
        ParameterError: if the gait's legs do not take turns in the air.
    """
    start = automaton.start(gait.stride).name
    stride = simulate_stride(
        gait.parameters, start, APEX.state(gait.state), gait.controls, automaton=automaton
    )
    if not any(event.reset is Reset.SWAP for event in stride.events):
        raise ParameterError(
            f"the legs of gait {gait.name!r} do not take turns: give SimulationOptions a pose"
        )
    landing, liftoff = stride.time_of(Event.TOUCHDOWN), stride.time_of(Event.REAR_LIFTOFF)
    # The liftoff's exchange of roles has made the stance toe the front leg's.
    toe, period = float(stride.toes[1]), stride.duration
    foot = SwingFoot(swing)
    foot.start(np.array([toe, 0.0]), np.zeros(2))
    feet, velocities = [], []
    now, due = liftoff, 2.0 * period + landing
    for apex in (1, 2):
        ticks = ceil((apex * period - now) / _TICK)
        dt = (apex * period - now) / ticks
        for _ in range(ticks):
            foot.advance(toe + 2.0 * gait.step_length, due - now, dt, 0.0)
            now += dt
        feet.append([foot.x[0] - apex * gait.step_length, foot.y[0]])
        velocities.append([foot.x[1], foot.y[1]])
    return Pose(
        com=np.array([0.0, gait.state[1]]),
        com_velocity=np.array([gait.state[0], 0.0]),
        feet=np.array(feet[::-1]),
        feet_velocity=np.array(velocities[::-1]),
        pitch=pitch,
    )
