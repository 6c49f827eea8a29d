"""Swing of the feet in the air: shapes, references, and which foot plays which leg.

A foot follows a quintic to its next foothold, re-aimed at every tick: from the present reference
(position, velocity, acceleration) to the foothold in the time the template still needs to get
there, so a foothold or a touchdown time that moves leaves no step in the reference. The foot rises
to its clearance early, keeps it while it travels, and comes down late, with a small downward speed
at the end, so that it meets the ground for certain. Unknown ground is then met from above. A foot
that meets a wall all the same goes up along it.

Which shape a robot walks with depends on its legs. A foot that is high while it travels clears
unknown ground, rises faster and comes down faster, and the rest of the robot moves by as much as
the leg is heavy: only light legs swing high.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive, Share
from template_control.compiled import compiled
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Leg, Reset
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.similarity import ACCELERATION, LENGTH, SPEED, TIME, Scale, scaled, tuned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SwingOptions(Checked):
    """Shape of the swing.

    Attributes:
        clearance: height of the foot from its highest point on [m].
        rise: share of the swing in which the foot rises to its clearance.
        descent: the foot keeps its clearance until this long before touchdown [s]; None: it comes
            down as soon as it is up.
        landing_speed: downward speed at touchdown [m/s]. The foot meets the ground for certain
            and not hard.
        horizon: below this time to go [s] the path is no longer re-aimed; the quintic's
            accelerations would grow beyond bounds.
        early: the foot is above its foothold this long before touchdown [s], so that it
            comes down at rest relative to the ground.
        late: a foot that meets a wall less than this before its touchdown [s] is set down before
            it; earlier it goes up and over.
        near: so is one that comes down already with less than this to go to its foothold [m]: it
            would be late for the sake of little way.
        lift_speed: upwards, of a foot that has met a wall [m/s].
        margin: height over the place where it met the wall last that it then keeps [m].
        drop_acceleration: downwards, of a foot that finds no ground where it is due [m/s^2].
        leg_share: the foot is kept within this share of the leg's length from the hip; a knee
            that goes straight hits its stop with tens of kilonewtons.
    """

    clearance: NotNegative = tuned(0.05, LENGTH)
    rise: Share = tuned(0.5)
    descent: NotNegative | None = tuned(None, TIME)
    landing_speed: NotNegative = tuned(0.2, SPEED)
    horizon: Positive = tuned(0.02, TIME)
    early: NotNegative = tuned(0.01, TIME)
    late: NotNegative = tuned(0.06, TIME)
    near: NotNegative = tuned(0.05, LENGTH)
    lift_speed: Positive = tuned(1.0, SPEED)
    margin: NotNegative = tuned(0.02, LENGTH)
    drop_acceleration: Positive = tuned(10.0, ACCELERATION)
    leg_share: Share = tuned(0.98)

    @cached_property
    def shape(self) -> tuple[float, float, float, float, float, float]:
        """Numbers for :func:`swing_step`: a tuple, which is quick to hand over."""
        descent = inf if self.descent is None else self.descent
        return self.clearance, self.rise, descent, self.landing_speed, self.horizon, self.early


@compiled
def quintic_step(state: Array, target: float, speed: float, time: float, dt: float) -> None:
    """Advance (position, velocity, acceleration) by ``dt`` along the quintic to its target.

    Args:
        state: (3,) position, velocity, acceleration now [m, m/s, m/s^2]; overwritten.
        target, speed: position [m] and velocity [m/s] at the quintic's end; the acceleration
            there is 0.
        time: from now to the quintic's end [s].
        dt: how far to advance [s].
    """
    _advance(state, target, speed, time, dt)


@compiled
def swing_step(
    x: Array,
    y: Array,
    foothold: tuple[float, float, float],
    shape: tuple[float, float, float, float, float, float],
    so_far: tuple[float, float],
    dt: float,
) -> None:
    """Advance a foot's reference by ``dt`` towards its foothold.

    Args:
        x, y: (3,) position, velocity, acceleration of either [m, m/s, m/s^2]; overwritten.
        foothold: x and y of the foothold [m], and the time until the foot is due there [s].
        shape: of the swing, from :attr:`SwingOptions.shape`.
        so_far: time since the foot left the ground [s]; the height that it keeps at least [m].
        dt: how far to advance [s].
    """
    place, ground, to_go = foothold
    clearance, rise, descent, landing_speed, horizon, early = shape
    if to_go <= horizon or not np.isfinite(place):
        # Nearly there: hold the horizontal position, keep coming down.
        x[1] = x[2] = y[2] = 0.0
        y[1] = -landing_speed
        y[0] -= landing_speed * dt
        return
    _advance(x, place, 0.0, max(to_go - early, horizon), dt)
    top = max(ground + clearance, so_far[1])
    rising = rise * to_go - (1.0 - rise) * so_far[0]
    if rising > horizon:
        _advance(y, top, 0.0, rising, dt)
    elif to_go > descent:
        # Up: stay there, and come to rest where the rise was cut short.
        _advance(y, top, 0.0, max(2.0 * horizon, dt), dt)
    else:
        _advance(y, ground, -landing_speed, to_go, dt)


@compiled
def _advance(state: Array, target: float, speed: float, time: float, dt: float) -> None:
    p, v, a = state[0], state[1], state[2]
    # In tau = t / time: c0..c5 with c0 = p, c1 = v T, c2 = a T^2 / 2.
    c1, c2 = v * time, 0.5 * a * time * time
    d = target - p - c1 - c2
    e = speed * time - c1 - 2.0 * c2
    f = -2.0 * c2
    c3 = 10.0 * d - 4.0 * e + 0.5 * f
    c4 = -15.0 * d + 7.0 * e - f
    c5 = 6.0 * d - 3.0 * e + 0.5 * f
    s = dt / time
    state[0] = p + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    state[1] = (c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / time
    state[2] = (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / time**2


class SwingFoot:
    """Reference of a foot in the air; it persists from liftoff to touchdown.

    Args:
        options: shape of the swing.
        reference: (2, 3) where it is kept; own memory if not given.

    Attributes:
        options: shape of the swing from now on.
        x, y: (3,) position, velocity, acceleration [m, m/s, m/s^2] in the world.
    """

    def __init__(self, options: SwingOptions, reference: Array | None = None) -> None:
        self.options = options
        self.x, self.y = np.zeros((2, 3)) if reference is None else reference
        self._elapsed = 0.0
        self._over = -inf

    def start(self, position: Array, velocity: Array, elapsed: float = 0.0) -> None:
        """Begin a swing where the foot is now.

        Args:
            position: (2,) x and y of the foot in the world [m].
            velocity: (2,) its velocity [m/s].
            elapsed: time since the foot left the ground [s].
        """
        self.x[:] = position[0], velocity[0], 0.0
        self.y[:] = position[1], velocity[1], 0.0
        self._elapsed = elapsed
        self._over = -inf

    def advance(self, foothold: float, time_to_go: float, dt: float, ground: float) -> None:
        """Move the reference by ``dt`` towards its foothold.

        Args:
            foothold: x of the foothold in the world [m].
            time_to_go: time until the foot is due there [s].
            dt: control period [s].
            ground: height of the foothold [m].
        """
        aim, so_far = (foothold, ground, time_to_go), (self._elapsed, self._over)
        swing_step(self.x, self.y, aim, self.options.shape, so_far, dt)
        self._elapsed += dt

    def meet_wall(self, position: Array, foothold: float, time_to_go: float, dt: float) -> None:
        """Go up along a wall that the foot has met, and stay above it from then on; or down.

        Args:
            position: (2,) of the foot [m].
            foothold: x of the foothold in the world [m]; not finite where there is none.
            time_to_go: time until the foot is due [s].
            dt: control period [s].
        """
        o = self.options
        self.x[:] = position[0], 0.0, 0.0
        near = self.y[1] < 0.0 and abs(foothold - position[0]) < o.near
        if near or time_to_go < o.late:
            self.drop(dt)
            return
        self.y[0] = max(self.y[0], position[1]) + o.lift_speed * dt
        self.y[1], self.y[2] = o.lift_speed, 0.0
        self._over = self.y[0] + o.margin
        self._elapsed += dt

    def drop(self, dt: float) -> None:
        """Let an overdue foot fall: the ground is lower than was thought."""
        self.x[1], self.x[2] = 0.0, 0.0
        self.y[2] = -self.options.drop_acceleration
        self.y[0] += (self.y[1] + 0.5 * self.y[2] * dt) * dt
        self.y[1] += self.y[2] * dt

    def furthest(self, hip: Sequence[float], leg_length: float) -> float:
        """The furthest x that the leg reaches at the reference's height [m].

        Args:
            hip: (2,) position of the hip [m]; numbers, as arithmetic on an array's is slow.
            leg_length: of the straight leg [m].
        """
        height = hip[1] - float(self.y[0])
        reach = self.options.leg_share * leg_length
        return hip[0] + sqrt(max(reach**2 - height**2, 0.0))


HIGH_SWING = SwingOptions(clearance=0.06, rise=0.3, descent=0.12, early=0.02)
"""The foot is high while it travels, and comes down nearly vertically."""


# Leg's share of the robot's mass up to which the foot swings high in steady strides. Robots with
# 0.09 walk as well with the high swing; those with 0.14 and more settle worse, and one with 0.31
# falls.
_HEAVIEST = 0.12


class Swings(NamedTuple):
    """Shapes of a robot's swings.

    Attributes:
        steady: while the route keeps its kind of stride.
        other: where another kind comes: what it makes of a step depends on how the leg moves.
    """

    steady: SwingOptions
    other: SwingOptions

    @classmethod
    def of(cls, robot: Biped, scale: Scale) -> Swings:
        """The shapes for a robot: the high one in steady strides if its legs are light enough.

        Args:
            robot: the model.
            scale: units of its template.
        """
        low, light = SwingOptions(), robot.leg_mass <= _HEAVIEST * robot.mass
        steady, other = (scaled(shape, scale) for shape in (HIGH_SWING if light else low, low))
        return cls(steady, other)

    def towards(self, goal: StrideGoal) -> SwingOptions:
        """The shape of a swing that begins in a stride with this goal."""
        return self.steady if goal.then is None else self.other


class Feet:
    """Roles of the two feet; the automaton's resets change them.

    Args:
        options: shape of the swings.
        reference: (2, 2, 3) where the swings' references are kept, by foot.

    Attributes:
        of: the foot that is the rear leg's, and the front leg's.
        swing: each foot's reference in the air.
        swing_time: (2,) time since each foot lifted off [s].
        landed: the foot that landed last; the template's ground is there.
    """

    def __init__(self, options: SwingOptions, reference: Array) -> None:
        self.foot_of_leg: tuple[int, int] = (0, 1)
        self.swing = tuple(SwingFoot(options, place) for place in reference)
        self.swing_time = np.full(2, np.inf)
        self.landed = 0

    def begin(self, rear: int) -> None:
        """Make foot ``rear`` the rear leg's, and put the template's ground under it."""
        self.foot_of_leg = (rear, 1 - rear)
        self.landed = rear

    def lift(self, foot: int, robot: Biped, swung: float = 0.0) -> None:
        """Begin the swing of a foot that leaves the ground, or has left it already.

        Args:
            foot: its index, 0 or 1, in the order of the robot's ``feet``.
            robot: the model, updated; the swing begins at the foot's position and velocity there.
            swung: time since the foot left the ground [s].
        """
        self.swing_time[foot] = swung
        self.swing[foot].start(robot.foot_position[foot], robot.foot_velocity[foot], swung)

    def apply(self, reset: Reset) -> None:
        """Change the roles as the automaton's reset does."""
        if reset in _EXCHANGES:
            self.foot_of_leg = (self.foot_of_leg[Leg.FRONT], self.foot_of_leg[Leg.REAR])


_EXCHANGES = (Reset.SHIFT, Reset.SWAP)
