"""Interface of planners: section state and target in, controls of the coming stride out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Annotated, ParamSpec, Protocol, TypeGuard, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.fitting import answered, name_of
from template_control.checks.ranges import Shape
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Outcome
from template_control.slip.dynamics.stride import Stride
from template_control.slip.gaits.gait import Gait
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]
P = ParamSpec("P")


ANY_ANGLE = (-np.inf, np.inf)
"""Range of angles that leaves the touchdown angle free."""


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


@runtime_checkable
class Planner(Protocol):
    """Choice of the controls of one kind of stride at its section."""

    @property
    def gait(self) -> Gait:
        """The gait that the planner leads to; the last target chose it."""

    @property
    def offset(self) -> Array:
        """(3,) estimate of the robot's section state less the template's after one stride."""

    def reset(self) -> None:
        """Forget what was learnt; a run calls it before its first stride."""

    def decide(
        self, z: Array, target: Array | None = None, angles: tuple[float, float] = ANY_ANGLE
    ) -> Decision:
        """Controls for a stride from section state ``z``.

        Args:
            z: (n,) the state: dx/dt, y and, at VLO, dy/dt [m/s, m, m/s].
            target: (n,) state wanted at the section where the stride ends; None: the gait's own.
            angles: least and greatest touchdown angle that the swing foot can still reach [rad].
        """

    def observe(self, decision: Decision, z: Array) -> None:
        """Learn from a stride that has ended.

        Args:
            decision: the decision that planned the stride.
            z: (n,) section state in which it ended, as for :meth:`decide`.
        """


class EndOfStride(Protocol):
    """Map from the controls of a stride that has begun to its end."""

    def __call__(self, u: Array) -> tuple[Array, Outcome]:
        """(m,) state at the section where it ends, and how, with (NUM_SLOTS,) controls ``u``."""


@dataclass(frozen=True)
class FreeControls:
    """Controls that can still be chosen within a stride.

    Attributes:
        slots: that the rest of the stride depends on.
        turn: how far the touchdown angle can still be changed [rad].
    """

    slots: Sequence[int]
    turn: float


@runtime_checkable
class LandingPlanner(Planner, Protocol):
    """A planner that knows how to choose again where a foot has landed.

    Of any other, :meth:`Planner.decide` is asked, for the section state from which the template
    would have come there.
    """

    def land(
        self, ahead: EndOfStride, decision: Decision, target: Array, free: Sequence[int]
    ) -> Decision:
        """Controls for the rest of a stride.

        Args:
            ahead: where it leads.
            decision: what holds so far.
            target: (m,) state wanted at the section where the stride ends.
            free: slots of the stiffnesses that the rest depends on.
        """


def lands(planner: Planner) -> TypeGuard[LandingPlanner]:
    """Whether a planner is a :class:`LandingPlanner`.

    ``isinstance`` goes through all members of a protocol, which is long in a tick.
    """
    return hasattr(planner, "land")


@runtime_checkable
class PricingPlanner(Planner, Protocol):
    """A planner that tells what a state is worth to its next strides."""

    def price(self, z: Array) -> float:
        """The least cost that the planner knows from section state ``z`` (n,) on."""


@runtime_checkable
class SlopePlanner(Planner, Protocol):
    """A planner that knows slopes; of any other the ground is level."""

    def on_slope(self, slope: float) -> SlipParameters:
        """Plan for ground that rises from now on; :meth:`~Planner.reset` makes it level.

        Args:
            slope: its angle, uphill positive [rad]. States are told in axes that are turned with
                the ground. :attr:`~Planner.gait` stays the one of level ground.

        Returns:
            The template on the ground that is planned for, with its assist.
        """


@runtime_checkable
class ForgettingPlanner(Planner, Protocol):
    """A planner that learns anew, in part, where its kind of stride follows another one."""

    def forget(self) -> None:
        """Forget what was true of another way of moving only; gait and slope stay."""


@runtime_checkable
class CurvePlanner(Planner, Protocol):
    """A planner that leads the CoM along a curve in time where no spring carries it."""

    def curve(
        self, node: str, start: Array, toes: tuple[float, float], decision: Decision
    ) -> tuple[Decision, Stride]:
        """The rest of a stride.

        Args:
            node: of the automaton, where the robot is.
            start: (2, 3) x and y of the CoM, each position, velocity and acceleration.
            toes: x of the rear and the front foot [m].
            decision: what holds so far.

        Returns:
            What holds from now on, and the stride from here.
        """


@runtime_checkable
class BreakingPlanner(Planner, Protocol):
    """A planner of a stride that the robot can break into within another one."""

    def break_into(
        self, ahead: EndOfStride, controls: Array, target: Array, free: FreeControls
    ) -> Decision:
        """Controls for a stride from within.

        Args:
            ahead: where it leads.
            controls: (NUM_SLOTS,) u of the stride that is left.
            target: (m,) state wanted at the section where the stride ends.
            free: what of u can still be chosen.
        """


def decided(method: Callable[P, Decision], *args: P.args, **kwargs: P.kwargs) -> Decision:
    """A planner's decision, which a stride can be made with.

    Args:
        method: of the planner.
        args, kwargs: its arguments.

    Raises:
        ParameterError: naming the planner's class, if it is no decision or its controls are not
            finite.
    """
    decision = answered(Decision, method, *args, **kwargs)
    _check_controls(method, decision)
    return decision


def curved(
    method: Callable[P, tuple[Decision, Stride]], *args: P.args, **kwargs: P.kwargs
) -> tuple[Decision, Stride]:
    """A planner's decision along a curve, and the stride from there.

    Args:
        method: :meth:`CurvePlanner.curve` of the planner.
        args, kwargs: its arguments.

    Raises:
        ParameterError: naming the planner's class, if it returns something else.
    """
    pair = answered(tuple, method, *args, **kwargs)
    kinds = tuple(type(part) for part in pair)
    if len(kinds) != 2 or not (issubclass(kinds[0], Decision) and issubclass(kinds[1], Stride)):
        names = ", ".join(kind.__name__ for kind in kinds)
        raise ParameterError(
            f"{name_of(method)} returned a tuple of {names or 'nothing'}: return a Decision and a"
            " Stride"
        )
    _check_controls(method, pair[0])
    return pair


def _check_controls(method: Callable[..., object], decision: Decision) -> None:
    controls = decision.controls.tolist()
    if not isfinite(sum(controls)):
        raise ParameterError(
            f"{name_of(method)} returned the controls {controls}: return finite numbers"
        )


Planners = Mapping[str, Planner]
"""A planner for each kind of stride, by that kind's key in an automaton's ``starts``."""
