"""A gait's sideways step map, the law that returns to its periodic motion, and that motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from scipy.linalg import solve_discrete_are

from template_control.arrays import Array, ComplexArray
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Interval, NotNegative, Positive, Share
from template_control.errors import GaitError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.gaits.gait import Gait, gait_stride
from template_control.slip.lateral.path import NEXT, lateral_path, transition
from template_control.slip.similarity import (
    LENGTH,
    PER_LENGTH_SQUARED,
    PER_SPEED_SQUARED,
    SPEED,
    TIME,
    Scale,
    scaled,
    tuned,
)


@dataclass(frozen=True)
class LateralLearningOptions(Checked):
    """Gains and bounds of what is learnt of the sideways motion.

    Attributes:
        gain: share of a step's surprise that enters the offset of y and dy/dt.
        one_sided: how far a step from one side teaches that side alone. At 0 the other side learns
            the mirror image: a sideways drift, which is the walk's own and no offset, is not
            learnt.
        offset_bound: largest offsets of y and dy/dt [m, m/s].
        surprise_bound: a larger surprise counts as this much: a push is no offset [m, m/s].
    """

    gain: Share = tuned(0.2)
    one_sided: Share = tuned(0.0)
    offset_bound: tuple[NotNegative, NotNegative] = tuned((0.04, 0.15), LENGTH, SPEED)
    surprise_bound: tuple[NotNegative, NotNegative] = tuned((0.02, 0.08), LENGTH, SPEED)


@dataclass(frozen=True)
class LateralOptions(Checked):
    """Tuning of the footholds' y.

    Attributes:
        state_cost: on y and dy/dt at a section, over those of the periodic gait
            [1/m^2, s^2/m^2]: equal for both where dy/dt is measured by sqrt(g / l0).
        step_cost: on the next foot's distance to the stance foot, over the gait's [1/m^2].
        widths: least and largest lateral distance between two footholds [m]: feet do not cross,
            and legs open so far only.
        step_width: lateral distance between left and right footholds [m]. Wider, and the robot
            sways more than its slow steps bear; narrower, and a push leaves less room.
        running_width: of a gait that begins in flight, over the wanted lateral distance of the
            footholds. Nearer to the line below the CoM, heavy legs turn the trunk less.
        reach: largest lateral distance between CoM and foot at touchdown [m].
        hold: a foothold is not changed so shortly before touchdown [s]: the foot cannot follow.
        learning: how the robot's own part is learnt.
    """

    state_cost: tuple[NotNegative, NotNegative] = tuned(
        (1.0, 0.102), PER_LENGTH_SQUARED, PER_SPEED_SQUARED
    )
    step_cost: Positive = tuned(0.02, PER_LENGTH_SQUARED)
    widths: Interval = tuned((0.08, 0.6), LENGTH)
    step_width: NotNegative = tuned(0.22, LENGTH)
    running_width: Share = tuned(1.0)
    reach: Positive = tuned(0.4, LENGTH)
    hold: NotNegative = tuned(0.042, TIME)
    learning: LateralLearningOptions = field(default_factory=LateralLearningOptions)


class Side(IntEnum):
    """Of the body a foot is on; +1 is where y is positive."""

    LEFT = 1
    RIGHT = -1

    @property
    def other(self) -> Side:
        """The other side."""
        return Side(-self)

    @property
    def row(self) -> int:
        """Place in arrays with a row for each side: left, right."""
        return 0 if self is Side.LEFT else 1


@dataclass(frozen=True)
class LateralGait:
    """The sideways step map of a gait, from section to section, and its cost-to-go.

    A state X is (2,): y of the CoM from the stance foot and dy/dt [m, m/s]. At an apex the stance
    foot is the one that stood last. With the next foothold at d from the stance foot [m],
    X' = a X + b d at the next section, from the next foot.

    Attributes:
        a: (2, 2) of the state.
        b: (2,) of the next foothold.
        cost: (2, 2) P of the cost-to-go e' P e of an error e of the state; the next step's cost
            on the state is part of it.
        gain: (2,) K of d = d_s - K e.
        speed: dx/dt at the section [m/s].
        width: of its footholds, over the wanted one.
        length: of its steps [m].
        ahead: x at an apex, from the foot that stood last [m]; 0 where the section is over it.
    """

    a: Array
    b: Array
    cost: Array
    gain: Array
    speed: float
    width: float
    length: float
    ahead: float

    @property
    def open_loop(self) -> ComplexArray:
        """Eigenvalues of a step with d = d_s, states of the left mirrored to those of the right."""
        return np.linalg.eigvals(-self.a).astype(np.complex128)

    @property
    def closed_loop(self) -> ComplexArray:
        """Eigenvalues of a step by the law, states of the left mirrored to those of the right."""
        return np.linalg.eigvals(np.outer(self.b, self.gain) - self.a).astype(np.complex128)


@checked
def lateral_gait(
    gait: Gait,
    options: LateralOptions | None = None,
    automaton: Automaton = AUTOMATON,
    ratio: Positive = 1.0,
) -> LateralGait:
    """The sideways step map along a planar gait.

    Args:
        gait: the planar one.
        options: what errors and steps cost, for the reference template; scaled to the gait's.
        automaton: of the gait's stride.
        ratio: of dy/dt to that with the angular momentum about the CoM, as a robot sways.

    Raises:
        GaitError: if the gait's stride is not completed, or no foot lands in it.
    """
    p, start = gait.parameters, automaton.start(gait.stride)
    stride = gait_stride(gait, automaton)
    path = lateral_path((stride,), p.gravity, ratio)
    if not np.isfinite(path.section):
        raise GaitError(
            f"gait {gait.name!r} has no sideways step: {stride.outcome.reason or 'no foot lands'}"
        )
    m = transition(path, 0.0, path.section)
    a, b = m[:, :2], m[:, 2 + NEXT] - (1.0, 0.0)
    o = scaled(options or LateralOptions(), Scale.of(p))
    try:
        cost = solve_discrete_are(a, b[:, None], np.diag(o.state_cost), np.array([[o.step_cost]]))
    except np.linalg.LinAlgError:
        raise GaitError(
            "no law brings the sideways motion of this gait back: choose another gait"
        ) from None
    gain = (b @ cost @ a) / (o.step_cost + b @ cost @ b)
    width = 1.0 if start.stance else o.running_width
    ahead = 0.0 if start.stance else float(stride.state[0] - max(stride.toes))
    return LateralGait(
        a.copy(), b, cost, gain, float(gait.state[0]), width, length=gait.step_length, ahead=ahead
    )


@dataclass(frozen=True)
class LateralWish(Checked):
    """Wanted sideways motion of the feet.

    Attributes:
        width: lateral distance between left and right footholds [m].
        left: distance to the left that each step moves the walk [m].
        turn: angle by which the heading turns to the left at each section [rad].
    """

    width: NotNegative
    left: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True)
class LateralCycle:
    """The periodic motion of a wish, two steps long; rows are :attr:`Side.row`.

    Attributes:
        states: (2, 2) X at a section with the foot of that side as stance foot, before a turn.
        steps: (2,) distance from that foot to the next foothold, to the left [m].
    """

    states: Array
    steps: Array


def lateral_cycle(
    lateral: LateralGait, wish: LateralWish, offset: Array | None = None
) -> LateralCycle:
    """The periodic motion: from section to section the mirror image, where nothing is one-sided.

    At a turn by psi the velocity turns in the heading frame: dy/dt changes by -v psi. The walk's
    circle is the one that its mirror image in time goes along too: dy/dt is v psi / 2 before.

    Args:
        lateral: the step map.
        wish: width, lateral motion and turn.
        offset: (2, 2) what the robot adds to X' after a step from the left and from the right
            foot; None: nothing.
    """
    a, b, one, width = lateral.a, lateral.b, np.eye(2), lateral.width * wish.width
    added = np.zeros((2, 2)) if offset is None else offset
    mirrored = np.linalg.solve(one + a, width * b - 0.5 * (added[0] - added[1]))
    half = 0.5 * lateral.speed * wish.turn
    to_left = one - a
    turning, moved = np.linalg.solve(
        np.column_stack((to_left[:, 0], -b)), -2.0 * half * a[:, 1] - half * to_left[:, 1]
    )
    left = np.linalg.solve(to_left, wish.left * b + 0.5 * (added[0] + added[1]))
    left += (turning, half)
    step = wish.left + moved
    return LateralCycle(
        states=np.array([left + mirrored, left - mirrored]),
        steps=np.array([step - width, step + width]),
    )
