"""What the controller of a free robot does in each phase: the table of walking, in space."""

from __future__ import annotations

from dataclasses import replace

from template_control.embedding.phases import Clock, PhaseControl, Phases
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.whole_body.tasks import (
    ComTask,
    FootTask,
    OrientationTask,
    SideFootTask,
    SpareJointTask,
)

# Two point feet bear no torque about the line between them: with the height and the trunk held
# there is one freedom left for x and y, and with the weights of the plane the robot loses speed in
# every double stance.
_DOUBLE = PhaseControl(
    tasks=(ComTask((30.0, 30.0)), OrientationTask((4.0, 4.0, 0.4)), SpareJointTask()),
    unload_legs=(Leg.REAR,),
)

FREE_PHASES: Phases = {
    Phase.F: PhaseControl(
        tasks=(
            OrientationTask((0.01, 0.01, 0.001)),
            FootTask(Leg.REAR),
            SideFootTask(Leg.REAR),
            FootTask(Leg.FRONT),
            SideFootTask(Leg.FRONT),
            SpareJointTask(),
        ),
        swings=(Leg.REAR, Leg.FRONT),
        clock=Clock.TIME,
        momentum_speed=False,
        estimate_load=False,
    ),
    Phase.SS: PhaseControl(
        # As in the plane; and the CoM's y is left to the place of the feet.
        tasks=(
            ComTask((0.01, 10.0)),
            OrientationTask(),
            FootTask(),
            SideFootTask(),
            SpareJointTask(),
        ),
        swings=(Leg.FRONT,),
    ),
    Phase.DS: replace(_DOUBLE, trim_momentum=True),
    # A planner with push-off leaves the trim nothing to do.
    "DS_sc^wp": _DOUBLE,
    "DS_sd^wp": _DOUBLE,
}
"""Walking. Nodes of other gaits find the entry of their phase."""
