"""What a foot that has landed leaves to choose, and what it has fixed."""

from __future__ import annotations

from math import asin, atan2, hypot

from template_control.embedding.sensing import Sensed
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.parameters import SlipParameters

_NEWTON = 4


def free_controls(automaton: Automaton, node: Node) -> list[int]:
    """Slots of the stiffnesses that the rest of a stride depends on.

    Args:
        automaton: of the stride.
        node: that the rest begins in.
    """
    later = automaton.stride(node.name)
    return sorted({int(k) for n in later for k in (n.rear, n.front) if k is not None})


def angle_later(sensed: Sensed, parameters: SlipParameters, stiffness: float, time: float) -> float:
    """Touchdown angle of a front leg that comes to l0 some time from now [rad].

    The height then comes from its Taylor series to the second order.

    Args:
        sensed: the robot in single stance.
        parameters: the template.
        stiffness: of the leg that stands [N/m].
        time: from now [s].
    """
    x, y, _, dy = sensed.state.tolist()
    length = parameters.rest_length
    stretch = length / hypot(x - float(sensed.toes[0]), y) - 1.0
    lift = stiffness * stretch * y / parameters.mass - parameters.gravity
    later = y + time * (dy + 0.5 * time * lift)
    return asin(min(max(later / length, 0.0), 1.0))


def flown_angle(sensed: Sensed, parameters: SlipParameters) -> float:
    """Angle of the template's leg as it comes to l0 on the ballistic path through the robot [rad].

    The robot's foot meets the ground a little before or after.

    Args:
        sensed: the robot as its rear foot meets the ground.
        parameters: the template.
    """
    x, y, dx, dy = sensed.state.tolist()
    x -= float(sensed.toes[0])
    time = 0.0
    for _ in range(_NEWTON):
        px, py, speed = x + dx * time, y + dy * time - 0.5 * parameters.gravity * time**2, dy
        speed -= parameters.gravity * time
        slope = 2.0 * (px * dx + py * speed)
        if slope >= 0.0:
            break
        time -= (px**2 + py**2 - parameters.rest_length**2) / slope
    return atan2(py, -px)
