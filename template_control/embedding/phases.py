"""What the controller does in each phase of the automaton: a table, not code.

The controller looks a node's entry up here, first by the node's name, then by its phase. A new
gait brings entries of its own where the ones below do not serve it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from template_control.checked import Checked
from template_control.errors import ParameterError
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.whole_body.com_task import ComTask
from template_control.whole_body.foot_task import FootTask
from template_control.whole_body.posture_task import PostureTask
from template_control.whole_body.task import Task


class Clock(StrEnum):
    """How the robot's place on the template's path is found."""

    DIRECTION = "direction"
    """By the direction from the rear foot to the CoM (beta of Section V-B)."""
    TIME = "time"
    """By the time that has passed."""


@dataclass(frozen=True)
class PhaseControl(Checked):
    """What a phase needs.

    Attributes:
        tasks: the tasks of the whole-body QP.
        swings: legs whose feet are in the air and follow a reference to their next foothold.
        clock: how the robot is located on the path.
        momentum_speed: whether the sensed speed includes the angular momentum about the CoM;
            this needs a stance foot.
        unloads: legs whose normal force is kept near the template's, so that they have no load
            left to lift off with.
        weighs: whether the load estimate observes this phase.
        trims: whether the momentum trim acts in this phase.
    """

    tasks: tuple[Task, ...]
    swings: tuple[Leg, ...] = ()
    clock: Clock = Clock.DIRECTION
    momentum_speed: bool = True
    unloads: tuple[Leg, ...] = ()
    weighs: bool = True
    trims: bool = False


Phases = Mapping[Phase | str, PhaseControl]
"""What each phase needs. A key is a phase or a node's name; the node's entry comes first."""

PHASES: Phases = {
    Phase.F: PhaseControl(
        # The CoM is ballistic, and the trunk can only be turned against the legs.
        tasks=(PostureTask(0.01), FootTask(Leg.REAR), FootTask(Leg.FRONT)),
        swings=(Leg.REAR, Leg.FRONT),
        clock=Clock.TIME,
        momentum_speed=False,
        weighs=False,
    ),
    Phase.SS: PhaseControl(
        # Height before the swing foot: near VLO its pull on the ground would need more normal
        # force than the template has there. A point foot cannot change the momentum about
        # itself: the CoM's x is left nearly free.
        tasks=(ComTask((0.01, 10.0)), PostureTask(), FootTask(Leg.FRONT)),
        swings=(Leg.FRONT,),
    ),
    Phase.DS: PhaseControl(
        tasks=(ComTask((1.0, 3.0)), PostureTask()), unloads=(Leg.REAR,), trims=True
    ),
}
"""What walking needs in each phase; running and transitions may start from it."""


def phase_control(phases: Phases, node: Node) -> PhaseControl:
    """The entry of a node.

    Args:
        phases: the table.
        node: of the automaton.

    Raises:
        ParameterError: if the table has none for it.
    """
    if node.name in phases:
        return phases[node.name]
    if node.phase not in phases:
        raise ParameterError(
            f"no entry of the phases serves node {node.name}: give one for it or for"
            f" Phase.{node.phase.name}"
        )
    return phases[node.phase]
