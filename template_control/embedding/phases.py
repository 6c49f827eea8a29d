"""Table of what the controller does in each phase of the automaton.

The controller looks a node's entry up here, first by the node's name, then by its phase. A new
gait brings entries of its own where the ones below do not serve it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.embedding.swing import SwingOptions
from template_control.errors import ParameterError
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Leg, Phase
from template_control.slip.similarity import TIME, tuned
from template_control.whole_body.task import Task
from template_control.whole_body.tasks import ComTask, FootTask, MomentumTask, PostureTask


class Clock(StrEnum):
    """Clock of the robot's place on the template's path."""

    DIRECTION = "direction"
    """By the direction from the rear foot to the CoM (beta of Section V-B)."""
    TIME = "time"
    """By the time that has passed."""


@dataclass(frozen=True)
class PhaseControl(Checked):
    """Tasks, feet, clock and learners of a phase.

    Attributes:
        tasks: the tasks of the whole-body QP.
        swings: legs whose feet are in the air and follow a reference to their next foothold.
        clock: how the robot is located on the path.
        momentum_speed: whether the sensed speed includes the angular momentum about the CoM;
            this needs a stance foot.
        unload_legs: legs whose normal force is kept near the template's: they lift off unloaded.
        unloading: time over which these legs give up a load that is not the template's, before
            they lift off [s]; 0: their load is the template's.
        estimate_load: whether the load estimate observes this phase.
        trim_momentum: whether the momentum trim acts in this phase.
        swing: shape of the swings that begin in this phase; None: the robot's.
        follow_curve: whether the CoM follows the planner's curve in time, and not the template's
            springs.
        replan_at_touchdown: whether the stiffnesses that are still free are chosen again as the
            phase begins, from where the foot has landed.
        rolling_contact: whether the template's toe stays in one place while the foot rolls
            (:func:`~template_control.embedding.state.unrolled`); else it moves with the foot's
            lowest point.
        use_pre_impact_velocity: whether the path from a touchdown begins with the velocity before
            it. How much of the impact is over when it is felt varies; the template has none.
        settles: whether a foot that is to stand, and does not touch the ground, bears nothing, and
            its tasks bring it down; else it bears as if it touched.
    """

    tasks: tuple[Task, ...]
    swings: tuple[Leg, ...] = ()
    clock: Clock = Clock.DIRECTION
    momentum_speed: bool = True
    unload_legs: tuple[Leg, ...] = ()
    unloading: NotNegative = tuned(0.0, TIME)
    estimate_load: bool = True
    trim_momentum: bool = False
    swing: SwingOptions | None = None
    replan_at_touchdown: bool = False
    rolling_contact: bool = False
    use_pre_impact_velocity: bool = False
    follow_curve: bool = False
    settles: bool = False


Phases = Mapping[Phase | str, PhaseControl]
"""Control of each phase. A key is a phase or a node's name; the node's entry comes first."""

# A running leg folds high and comes down late: a foot that sinks all the way touches early, while
# the CoM still rises, and straightens the knee into its stop.
RUNNING_SWING = SwingOptions(
    clearance=0.15, rise=0.4, descent=0.14, landing_speed=0.6, leg_share=0.975
)
# Ground forces are several times the weight: the trunk is turned by angular momentum.
_RUNNING_STANCE = PhaseControl(
    tasks=(ComTask((0.01, 10.0)), MomentumTask(130.0, 20.0, 0.26), FootTask(Leg.FRONT)),
    swings=(Leg.FRONT,),
    swing=RUNNING_SWING,
)

# A stride that is made once has nothing to be trimmed by, and a planner with push-off leaves the
# trim nothing to do.
_UNTRIMMED = PhaseControl(tasks=(ComTask((1.0, 3.0)), PostureTask()), unload_legs=(Leg.REAR,))

_SINGLE_STANCE = PhaseControl(
    # Height before the swing foot: near VLO its pull on the ground would need more normal
    # force than the template has there. A point foot cannot change the momentum about
    # itself: the CoM's x is left nearly free.
    tasks=(ComTask((0.01, 10.0)), PostureTask(), FootTask(Leg.FRONT)),
    swings=(Leg.FRONT,),
)


def running_phases(
    flight: tuple[Task, ...],
    stance: PhaseControl,
    double: PhaseControl,
    hop: PhaseControl | None = None,
) -> dict[Phase | str, PhaseControl]:
    """Entries of a run, and of the strides between walking and running.

    By the tasks in flight, the control of a run's stances, whose swings begin in flight, of the
    double stance that leads into a run, and of a hop's stances; None: as a run's.
    """
    landed = replace(stance, replan_at_touchdown=True)
    # A CoM that hardly moves forward shows no time by its direction.
    hop = replace(hop or stance, clock=Clock.TIME)
    return {
        Phase.F: PhaseControl(
            tasks=flight,
            swings=(Leg.REAR, Leg.FRONT),
            clock=Clock.TIME,
            momentum_speed=False,
            estimate_load=False,
            swing=stance.swing,
        ),
        "SS_sc^r": landed,
        "SS_sd^r": stance,
        "SS_sc^hr": replace(hop, replan_at_touchdown=True),
        "SS_sd^hr": hop,
        "DS_sc^wr": replace(double, replan_at_touchdown=True),
        "DS_sd^wr": double,
        "SS_sc^wr": landed,
        "SS_sd^wr": stance,
        "SS_sc^rw": landed,
        "SS_sd^rw": stance,
    }


def standing_phases(
    double: PhaseControl, single: PhaseControl, unloading: float = 0.0
) -> dict[Phase | str, PhaseControl]:
    """Entries of a stand, and of the strides to it, from it, and between two speeds of a walk.

    By the tasks of both feet on the ground, and the control of a walk's single stance;
    ``unloading`` is that of :class:`PhaseControl`.
    """
    # Nobody walks: time passes, and both feet carry.
    standing = replace(double, unload_legs=(), clock=Clock.TIME, follow_curve=True)
    # A step from a stand may go back, and nearly rest over its foot: directions give no time.
    stepping = replace(single, clock=Clock.TIME, follow_curve=True)
    resting = replace(standing, estimate_load=False)
    lifting = replace(resting, unload_legs=(Leg.REAR,), unloading=unloading)
    return {
        "DS_ar^s": standing,
        "DS_br^ws": resting,
        "DS_ar^sw": lifting,
        "DS_bl^ww": lifting,
        "DS_al^sf": lifting,
        "SS_bt^sf": stepping,
        "DS_br^sf": resting,
        "DS_al^sb": replace(lifting, unload_legs=(Leg.FRONT,)),
        "SS_bt^sb": stepping,
        "DS_br^sb": resting,
    }


PHASES: Phases = {
    # In flight the CoM is ballistic, and the trunk can only be turned against the legs.
    **running_phases(
        (PostureTask(0.01), FootTask(Leg.REAR), FootTask(Leg.FRONT)), _RUNNING_STANCE, _UNTRIMMED
    ),
    Phase.SS: _SINGLE_STANCE,
    Phase.DS: replace(_UNTRIMMED, trim_momentum=True),
    "SS_av^wp": replace(_SINGLE_STANCE, rolling_contact=True),
    "DS_sc^wp": replace(_UNTRIMMED, rolling_contact=True, use_pre_impact_velocity=True),
    "DS_sd^wp": replace(_UNTRIMMED, rolling_contact=True),
    "SS_bv^wp": replace(_SINGLE_STANCE, rolling_contact=True),
    **standing_phases(_UNTRIMMED, _SINGLE_STANCE),
}
"""Control of walking and running in each phase; transitions may start from it."""


def phase_control(phases: Phases, node: Node) -> PhaseControl:
    """The entry of a node; a ParameterError if the table has none for it."""
    found = phases.get(node.name) or phases.get(node.phase)
    if found is None:
        raise ParameterError(
            f"no entry of the phases serves node {node.name}: give one for it or for"
            f" Phase.{node.phase.name}"
        )
    return found
