"""When a stride is planned anew between two sections."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive, Range, Share
from template_control.embedding.planning.unexpected_ground import UnexpectedGroundOptions
from template_control.embedding.references.template_path import PathOptions
from template_control.slip.similarity import RATE_SQUARED, SPEED, TIME, tuned


@dataclass(frozen=True)
class ReplanOptions(Checked):
    """When a stride is planned anew between two sections, and from where.

    Attributes:
        speed: deviation of the forward speed from the path's [m/s].
        interval: shortest time between such plans [s].
        patience: a touchdown that is later than this [s] is not waited for on the same path.
        angle_drop: the touchdown angle is then taken to be lower by this [rad].
        agility: a touchdown in t seconds can still be planned anew with an angle that differs
            from the old one by this times t^2 [rad/s^2]; the swing foot cannot do more.
        foresight: t counts as this at most [s]; where no touchdown is due it has no bound.
        soonest: a touchdown is not planned anew to come earlier than this from now [s], nor earlier
            than it was due where that is less: a foot that is up has to come down.
        soonest_share: of the gait's step duration, which counts in place of ``soonest`` where it
            is less: a fast walk that is pushed needs its foot at once.
        calmer: shares of dy/dt, tried in turn, of the states that a path starts from where the
            template cannot go on from the robot's: its leg cannot pull, the robot's can.
        highest: height over l0 above which no such path starts.
        legs: stiffnesses over k0 with which a slow walk is tried before the robot comes to a stand.
        ground: how the legs are chosen where a foot lands higher or lower than it was to.
        path: how the robot's place on the path is looked for.
    """

    speed: Annotated[float, Range(0.0, endless=True)] = tuned(0.05, SPEED)
    interval: NotNegative = tuned(0.02, TIME)
    patience: Annotated[float, Range(0.0, endless=True)] = tuned(0.01, TIME)
    angle_drop: NotNegative = tuned(0.15)
    agility: NotNegative = tuned(8.0, RATE_SQUARED)
    foresight: NotNegative = tuned(1.0, TIME)
    soonest: NotNegative = tuned(0.06, TIME)
    soonest_share: Share = tuned(0.08)
    calmer: tuple[Share, ...] = tuned((0.5, 0.0))
    highest: Positive = tuned(0.99)
    legs: tuple[Positive, ...] = tuned((0.4, 0.6, 0.8, 1.1))
    ground: UnexpectedGroundOptions = field(default_factory=UnexpectedGroundOptions)
    path: PathOptions = field(default_factory=PathOptions)
