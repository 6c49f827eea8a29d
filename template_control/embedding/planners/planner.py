"""Interface of planners: section state and target in, controls of the coming stride out."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from math import inf, isfinite, nan, pi
from typing import Annotated, NamedTuple, Protocol, runtime_checkable

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.fitting import answered, answered_or_none, name_of
from template_control.checks.ranges import Shape
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Slot
from template_control.slip.control.stride_solver import StrideEnd
from template_control.slip.control.touchdown import ANY_ANGLE
from template_control.slip.dynamics.stride import Stride
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.section import PADDED
from template_control.slip.parameters import SlipParameters


@dataclass(frozen=True)
class Decision(Checked):
    """Controls for the stride that begins at a section.

    Attributes:
        controls: (NUM_SLOTS,) u by Slot.
        predicted: (3,) dx/dt, y, dy/dt that the stride should end in, offset included.
        feasible: whether the template completes the stride with these controls.
        lasting: whether it also completes the stride after that, as far as the planner looks.
        nominal: the planner follows its own law, towards the target that was asked for. Nothing
            is learnt from other strides.
        accepted: dx/dt at the stride's end that the planner leads to where it takes another one
            than the target's [m/s]; None: it takes the target's.
    """

    controls: Annotated[Array, Shape((NUM_SLOTS,), finite=False)]
    predicted: Annotated[Array, Shape((3,), finite=False)]
    feasible: bool
    lasting: bool
    nominal: bool
    accepted: float | None = None


def settled(gait: Gait) -> Decision:
    """The decision of a gait that goes on, of which nothing is learnt."""
    return Decision(gait.controls, gait.state.copy(), True, True, False)


class Cause(Enum):
    """Cause of a decision."""

    SECTION = auto()
    """A stride begins."""
    FUTURE = auto()
    """The stride after the present one, whose foothold must be known in time."""
    TOUCHDOWN = auto()
    """A foot has landed."""
    GROUND_HEIGHT = auto()
    """A foot has landed on ground that is higher or lower than expected."""
    DEVIATION = auto()
    """A disturbance has carried the robot away from its path."""
    OVERDUE = auto()
    """A touchdown has not come; no planner is asked."""
    NO_FUTURE = auto()
    """The present stride, or the one after it, cannot be completed."""
    RECOVERY = auto()
    """The stride before cannot go on: the robot would break into this one."""


class Context(NamedTuple):
    """Question for a whole stride.

    Attributes:
        z: (n,) section state that the stride begins in: dx/dt, y and, at VLO, dy/dt
            [m/s, m, m/s]. Within a stride it is the one from which the template would have come
            to where the robot is.
        target: (n,) state wanted at the section where the stride ends; None: the gait's own.
        angles: least and greatest touchdown angle that the swing foot can still reach [rad].
        cause: of the question.
        decision: what holds so far, within a stride.
        lifted: time since the swing foot has lifted off [s]; inf: as long as it takes.
        due: time in which it was to land so far [s]; inf: not known.
    """

    z: Array
    target: Array | None = None
    angles: tuple[float, float] = ANY_ANGLE
    cause: Cause = Cause.SECTION
    decision: Decision | None = None
    lifted: float = inf
    due: float = inf


class RestContext(NamedTuple):
    """Question for the rest of a stride that has begun.

    Attributes:
        ahead: where it leads.
        decision: what holds so far; of the stride that is left, where ``cause`` is RECOVERY.
        target: (m,) state wanted at the section where the stride ends.
        free: slots that the rest depends on and that can still be chosen.
        turn: how far the touchdown angle can still be changed [rad], where it is free.
        cause: of the question.
    """

    ahead: StrideEnd
    decision: Decision
    target: Array
    free: Sequence[int]
    turn: float = 0.0
    cause: Cause = Cause.DEVIATION


@runtime_checkable
class Planner(Protocol):
    """Base class of planners: choice of the controls of one kind of stride.

    A planner has :attr:`gait` and :meth:`decide`; all else has a default.

    Attributes:
        gait: that the planner leads to; the last target chose it.
        offset: (3,) estimate of the robot's section state less the template's after one stride.
        retries: a path that does not lead on is planned again and again, and not only where the
            present stride cannot be completed.
    """

    gait: Gait
    offset: Array = np.zeros(PADDED)
    retries: bool = False

    def reset(self) -> None:
        """Forget what was learnt; a run calls it before its first stride."""
        return

    @abstractmethod
    def decide(self, context: Context) -> Decision:
        """Controls for a whole stride; it may be asked several times a stride."""

    def decide_rest(self, context: RestContext) -> Decision | None:
        """Controls for the rest of a stride that has begun.

        None by a planner of whole strides: as a foot lands :meth:`decide` is asked, for the section
        state from which the template would have come there; else what was decided holds.
        """
        return None

    def observe(self, decision: Decision, z: Array) -> None:
        """Learn from a stride that has ended.

        Args:
            decision: the decision that planned the stride.
            z: (n,) section state in which it ended.
        """
        return

    def forget(self) -> None:
        """Forget what is true of another way of moving only; gait and slope stay.

        It is called where the planner's kind of stride follows another one.
        """
        return

    def cost(self, z: Array) -> float:
        """The least cost that the planner knows from section state ``z`` (n,) on; nan: none."""
        return nan

    def next_gait(self) -> Gait | None:
        """The gait that the planned stride leads to, where :attr:`gait` is none with steps."""
        return None

    def on_slope(self, slope: float) -> SlipParameters | None:
        """Plan for ground that rises from now on; :meth:`reset` makes it level.

        Args:
            slope: its angle, uphill positive [rad]. States are given in axes that are turned with
                the ground. :attr:`gait` stays the one of level ground.

        Returns:
            The template on the ground that is planned for, with its assist; None by a planner
            that knows level ground only.
        """
        return None

    def curve(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """The rest of a stride along a curve in time, where no spring carries the CoM.

        Args:
            node: of the automaton, where the robot is.
            start: (2, 3) x and y of the CoM, each position, velocity and acceleration.
            toes: x of the rear and the front foot [m].
            decision: what holds so far.

        Returns:
            What holds from now on, and the stride from here.

        Raises:
            ParameterError: by a planner that has none.
        """
        raise ParameterError(
            f"{type(self).__name__} plans no curve for node {node}: give it a method curve"
        )


def decided(planner: Planner, context: Context) -> Decision:
    """Decision of a planner for a whole stride, which it can be made with.

    A ParameterError names the planner's class, if it is no decision or its controls are not finite.
    """
    return _followable(planner.decide, answered(Decision, planner.decide, context))


def rest_decided(planner: Planner, context: RestContext) -> Decision | None:
    """Decision of a planner for the rest of a stride, checked as :func:`decided`, or None."""
    decision = answered_or_none(Decision, planner.decide_rest, context)
    return None if decision is None else _followable(planner.decide_rest, decision)


def curved(
    planner: Planner, node: str, start: Array, toes: tuple[float, float], so_far: Decision
) -> tuple[Decision, Stride]:
    """A planner's decision along a curve, and the stride from there, by its :meth:`Planner.curve`.

    A ParameterError names the planner's class, if it returns something else.
    """
    pair = answered(tuple, planner.curve, node, start, toes, so_far)
    match pair:
        case (Decision() as decision, Stride() as stride):
            return _followable(planner.curve, decision), stride
    names = ", ".join(type(part).__name__ for part in pair)
    raise ParameterError(
        f"{name_of(planner.curve)} returned a tuple of {names or 'nothing'}: return a Decision and"
        " a Stride"
    )


def _followable(method: Callable[..., object], decision: Decision) -> Decision:
    controls = decision.controls.tolist()
    if not isfinite(sum(controls)):
        raise ParameterError(
            f"{name_of(method)} returned the controls {controls}: return finite numbers"
        )
    if not 0.0 <= controls[Slot.TOUCHDOWN_ANGLE] < pi:
        raise ParameterError(
            f"{name_of(method)} returned the touchdown angle {controls[Slot.TOUCHDOWN_ANGLE]:g}:"
            " return one from 0 to pi, in rad"
        )
    return decision


def learnt(offset: Array, surprise: Array, gain: float, limits: tuple[Array, Array]) -> Array:
    """The estimate (n,) of what the robot adds to a stride, after one with a surprise (n,).

    Its share ``gain`` enters. ``limits`` are what a larger surprise counts as, and the largest
    estimate.
    """
    limit, bound = limits
    return np.clip(offset + gain * np.clip(surprise, -limit, limit), -bound, bound)


Planners = Mapping[str, Planner]
"""A planner for each kind of stride, by that kind's key in an automaton's ``starts``."""
