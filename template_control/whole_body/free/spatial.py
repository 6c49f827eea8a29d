"""The free robot behind the interface that all robots share."""

from __future__ import annotations

from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.free.free_biped import FreeBiped


def spatial(robot: Biped) -> FreeBiped:
    """The robot, if nothing holds it.

    Raises:
        ParameterError: if it is held in its plane.
    """
    if isinstance(robot, FreeBiped):
        return robot
    raise ParameterError(
        f"robot {robot.name} is held in its plane, and a task in space asks for a free one: take"
        " load_floating_robot, or tasks of the plane"
    )
