"""Swing of the feet in the air: shapes, references, and which foot plays which leg.

A foot follows a quintic to its next foothold, re-aimed at every tick from the present reference in
the time the template still needs to get there: a foothold or a touchdown time that moves leaves no
step in the reference. The foot rises to its clearance early, keeps it while it travels, and comes
down late, so that unknown ground is met from above. One that meets a wall all the same goes up
along it. A high foot rises and comes down faster, and the rest of the robot moves by as much as the
leg is heavy: only light legs swing high. One that comes down and is due later than it was brakes
first, and does not rise anew.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import inf
from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array, Pair
from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive, Share
from template_control.compiled import compiled
from template_control.robot.biped import Biped
from template_control.robot.terms import MOST_CONTACTS, UP, onward
from template_control.slip.automaton.vocabulary import Reset
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.similarity import ACCELERATION, LENGTH, SPEED, TIME, Scale, scaled, tuned
from template_control.structured import structure


@dataclass(frozen=True)
class SwingOptions(Checked):
    """Shape of the swing.

    Attributes:
        clearance: height of the foot from its highest point on [m].
        rise: share of the swing in which the foot rises to its clearance.
        descent: the foot keeps its clearance until this long before touchdown [s]; None: it comes
            down as soon as it is up.
        landing_speed: downward at touchdown [m/s]: the ground is met for certain, and not hard.
        horizon: below this time to go [s] the path is no longer re-aimed; the quintic's
            accelerations would grow beyond bounds.
        early: the foot is above its foothold this long before touchdown [s], and comes down at rest
            relative to the ground.
        late: a foot that meets a wall less than this before its touchdown [s] is set down before
            it; earlier it goes up and over.
        near: so is one that comes down already with less than this to go to its foothold [m]: it
            would be late for the sake of little way.
        lift_speed: upwards, of a foot that has met a wall [m/s].
        margin: height over the place where it met the wall last that it then keeps [m].
        drop_acceleration: downwards, of a foot that finds no ground where it is due [m/s^2].
        leg_share: the foot is kept within this share of the leg's length from the hip; a knee
            that goes straight hits its stop with tens of kilonewtons.
        lag: the reference waits for a foot that is further from it than this, forward or back [m],
            as hips at their limits cannot catch up at once; None: it does not.
        start: acceleration forward with which it begins, over the way to go by the time for it
            squared. A quintic from 0 has its largest, 5.8, after a fifth of the time; with 6 from
            the first moment on it is never faster than 1.74 times the mean, instead of 1.88.
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
    lag: Positive | None = tuned(None, LENGTH)
    start: NotNegative = tuned(0.0)


_SHAPE = tuple(f.name for f in fields(SwingOptions))

FEET = structure(
    roles=(np.int64, (2,)),  # the foot that is the rear leg's, and the front leg's
    landed=np.int64,  # the foot that landed last; the template's ground is there
    swing_time=(float, (2,)),  # time since each foot lifted off [s]
    elapsed=(float, (2,)),  # duration of the reference's swing so far [s]
    over=(float, (2,)),  # height that the reference keeps, above a wall it met [m]
    spread=(float, (MOST_CONTACTS, 2)),  # of each contact from its foot, as the trunk faces [m]
    lifted=(float, (MOST_CONTACTS, 3)),  # the same where the foot lifted off [m]
    **dict.fromkeys(_SHAPE, (float, (2,))),  # of each foot's ``SwingOptions``
)
"""Roles and swings of the feet; the references themselves are among those of the tasks."""


@compiled
def _coefficients(
    state: Array, target: float, speed: float, time: float
) -> tuple[float, float, float, float, float]:
    """c1 to c5 of a quintic p + c1 s + ... + c5 s^5 in s = t / T, from a state to its target."""
    p, v, a = state[0], state[1], state[2]
    c1, c2 = v * time, 0.5 * a * time * time
    d = target - p - c1 - c2
    e = speed * time - c1 - 2.0 * c2
    f = -2.0 * c2
    c3 = 10.0 * d - 4.0 * e + 0.5 * f
    c4 = -15.0 * d + 7.0 * e - f
    c5 = 6.0 * d - 3.0 * e + 0.5 * f
    return c1, c2, c3, c4, c5


@compiled
def quintic_step(state: Array, target: float, speed: float, time: float, dt: float) -> None:
    """Advance (position, velocity, acceleration) by ``dt`` [s] along the quintic to its target.

    ``target`` and ``speed`` are those at the quintic's end, ``time`` [s] from now; the acceleration
    there is 0.
    """
    p = state[0]
    c1, c2, c3, c4, c5 = _coefficients(state, target, speed, time)
    s = dt / time
    state[0] = p + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    state[1] = (c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / time
    state[2] = (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / time**2


_SAMPLES = 16  # of a descent, between which it does not dip below its end by much
# Least time for what is left of a rise, over its share of the height times the whole rise's time.
# Along the rise's own quintic it is 0.83 at the least.
_HASTE = 0.5
_SHORTEST_BRAKE = 0.25  # of the horizon
_FLAT = 1e-6  # height of a swing that does not rise [m]


@compiled
def _arrives_early(state: Array, target: float, speed: float, time: float) -> bool:
    """True if a quintic from above its target, which moves down, comes below it before its end."""
    if not (state[0] > target and state[1] < 0.0):
        return False
    c1, c2, c3, c4, c5 = _coefficients(state, target, speed, time)
    for i in range(1, _SAMPLES):
        s = i / _SAMPLES
        if state[0] + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))) < target:
            return True
    return False


@compiled
def swing_step(
    f: Any,
    foot: int,
    x: Array,
    y: Array,
    foothold: tuple[float, float, float],
    foreseen: bool,
    dt: float,
) -> None:
    """Advance a foot's reference by ``dt`` [s] towards its foothold.

    ``f`` is of ``FEET``; ``x``, ``y`` (3,) are position, velocity, acceleration [m, m/s, m/s^2];
    ``foothold`` is its x and y [m], and the time until the foot is due there [s]. Where the
    template lands there, that is ``foreseen``; no foot brakes for a guess.
    """
    place, ground, to_go = foothold
    horizon, landing_speed, elapsed = f.horizon[foot], f.landing_speed[foot], f.elapsed[foot]
    f.elapsed[foot] += dt
    if to_go <= horizon or not np.isfinite(place):
        # Nearly there: hold the horizontal position, keep coming down.
        x[1] = x[2] = y[2] = 0.0
        y[1] = -landing_speed
        y[0] -= landing_speed * dt
        return
    till = max(to_go - f.early[foot], horizon)
    if elapsed == 0.0 and f.start[foot] > 0.0:
        x[2] = f.start[foot] * (place - x[0]) / till**2
    quintic_step(x, place, 0.0, till, dt)
    top = max(ground + f.clearance[foot], f.over[foot])
    rising = f.rise[foot] * to_go - (1.0 - f.rise[foot]) * elapsed
    # A foot that comes down does not rise anew where its touchdown is put off.
    fast = max(landing_speed, (top - ground) / (elapsed + to_go))
    descends = y[0] > ground and y[1] < -fast
    rises, stays = rising > horizon and not descends, to_go > f.descent[foot] and not descends
    if rises:
        left = (top - y[0]) / max(top - ground, _FLAT)
        least = _HASTE * left * f.rise[foot] * (elapsed + to_go)
        quintic_step(y, top, 0.0, max(rising, least), dt)
    elif stays:
        # Up: stay there, and come to rest where the rise was cut short.
        quintic_step(y, top, 0.0, max(2.0 * horizon, dt), dt)
    elif foreseen and _arrives_early(y, ground, -landing_speed, to_go):
        # It was to land sooner: brake half-way down to the ground, and come down from there.
        slow = max((ground - y[0]) / y[1], _SHORTEST_BRAKE * horizon)
        quintic_step(y, y[0] + 0.5 * y[1] * slow, 0.0, slow, dt)
    else:
        quintic_step(y, ground, -landing_speed, to_go, dt)


@compiled
def wait(f: Any, foot: int, x: Array, place: float, speed: float) -> None:
    """Let a foot's reference wait for the foot, at x ``place`` with a ``speed`` [m, m/s]."""
    ahead = x[0] - place
    if abs(ahead) > f.lag[foot]:
        x[0] = place + np.copysign(f.lag[foot], ahead)
        x[1] = speed


@compiled
def meet_wall(f: Any, foot: int, x: Array, y: Array, at: Array, aim: Pair, dt: float) -> None:
    """Go up along a wall that a foot has met, and stay above it from then on; or down.

    ``at`` (3,) is the foot, forward first and up last [m]; ``aim`` is x of the foothold [m], not
    finite where there is none, and the time until the foot is due [s].
    """
    x[0], x[1], x[2] = at[0], 0.0, 0.0
    near = y[1] < 0.0 and abs(aim[0] - at[0]) < f.near[foot]
    if near or aim[1] < f.late[foot]:
        drop(f, foot, x, y, dt)
        return
    y[0] = max(y[0], at[UP]) + f.lift_speed[foot] * dt
    y[1], y[2] = f.lift_speed[foot], 0.0
    f.over[foot] = y[0] + f.margin[foot]
    f.elapsed[foot] += dt


@compiled
def drop(f: Any, foot: int, x: Array, y: Array, dt: float) -> None:
    """Let an overdue foot fall: the ground is lower than was thought."""
    x[1], x[2] = 0.0, 0.0
    y[2] = -f.drop_acceleration[foot]
    y[0] += (y[1] + 0.5 * y[2] * dt) * dt
    y[1] += y[2] * dt


@compiled
def furthest(share: float, hip: Pair, height: float, sideways: float, leg_length: float) -> float:
    """The furthest x that a share of a straight leg's length reaches at a foot's height [m].

    ``hip`` is its x and y, ``sideways`` how far the leg leans to a side [m].
    """
    below, reach = hip[1] - height, share * leg_length
    return hip[0] + np.sqrt(max(reach * reach - below * below - sideways * sideways, 0.0))


@compiled
def level_reach(r: Any, foot: int, height: float) -> Pair:
    """y below the hip of a flat foot, and how far to either side of it its sole is level [m].

    ``r`` is of ``ROBOT_DATA``, ``height`` the foot's [m]. Where the leg leans further, the ankle
    is at its stop, and the sole tilts with it.
    """
    below = max(r.hips[UP] - r.ankle_height - height, 0.0)
    return r.hips[1] + onward(r.facing) * r.hip_side[foot], r.leg_lean * below


@compiled
def spread_contacts(f: Any, foot: int, r: Any, yaw: float, duration: float, offset: Array) -> None:
    """Write where the contacts of a foot in the air are to be, as ``offset`` of ``REFERENCES``.

    They stand around their foot as the trunk faces, at ``yaw`` [rad]. How far they were off when
    the foot lifted fades over half a ``duration`` of a step [s] along a quintic.
    """
    half = 0.5 * duration
    s = min(f.swing_time[foot] / half, 1.0)
    fade = 1.0 - s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    rate = -30.0 * (s * (1.0 - s)) ** 2 / half
    bend = -60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / half**2
    c, sine = np.cos(yaw), np.sin(yaw)
    for i in range(r.members[foot]):
        contact = r.group[foot, i]
        x, y = f.spread[contact, 0], f.spread[contact, 1]
        places = c * x - sine * y, c * y + sine * x, 0.0
        for axis in range(3):
            place = places[axis]
            off = f.lifted[contact, axis] - place
            offset[contact, axis, 0] = place + fade * off
            offset[contact, axis, 1], offset[contact, axis, 2] = rate * off, bend * off


def begin_swing(
    data: Any,
    foot: int,
    options: SwingOptions,
    reference: Array,
    position: Array,
    velocity: Array,
    elapsed: float = 0.0,
) -> None:
    """Begin a swing of a shape, which it keeps, with the foot's position and velocity (2,).

    ``data`` (1,) is of ``FEET``, ``reference`` (2, 3) the foot's x and y; the foot left the ground
    ``elapsed`` [s] ago.
    """
    now = data[0]
    for name in _SHAPE:
        value = getattr(options, name)
        now[name][foot] = inf if value is None else value
    now["elapsed"][foot], now["over"][foot] = elapsed, -inf
    reference[:, 0], reference[:, 1], reference[:, 2] = position, velocity, 0.0


HIGH_SWING = SwingOptions(clearance=0.06, rise=0.3, descent=0.12, early=0.02)
"""The foot is high while it travels, and comes down nearly vertically."""
SOLE_SWING = SwingOptions(lag=0.003)
"""Of a walk on flat feet. At 0.9 m/s G1's hips are at their limits as a swing begins. Where its
foot, 40 mm behind by then, was caught up with, the centre of pressure went to the heel, and the
walk got no slower."""

SLOW_SWING = SwingOptions(lag=0.003, clearance=0.03, start=6.0)
"""The same of hips that come to their limit of speed. The foot is low, and moves at once."""

# Limit of speed below which hips are slow [rad/s], for the reference template: TALOS, with 5.4, had
# its hips at it in a tenth of a walk at 0.9 m/s, and was 2 % too fast. G1 has 26.
_SLOW_HIPS = 10.0

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
    def of(cls, robot: Biped, scale: Scale, shape: SwingOptions | None = None) -> Swings:
        """The shapes for a robot: the high one in steady strides if its legs are light enough.

        On flat feet it is one for all strides, by how fast the hips are.

        Args:
            robot: the model.
            scale: units of its template.
            shape: of all swings, scaled to it; None: the library chooses.
        """
        if shape is not None:
            return cls(shape, shape)
        if robot.patches:
            slowest = min(float(robot.velocity_limit[leg[0]]) for leg in robot.hinges)
            flat = scaled(SLOW_SWING if slowest < _SLOW_HIPS / scale.time else SOLE_SWING, scale)
            return cls(flat, flat)
        low, light = SwingOptions(), robot.leg_mass <= _HEAVIEST * robot.mass
        steady, other = (scaled(shape, scale) for shape in (HIGH_SWING if light else low, low))
        return cls(steady, other)

    def towards(self, goal: StrideGoal) -> SwingOptions:
        """The shape of a swing that begins in a stride with this goal."""
        return self.steady if goal.then is None else self.other


class Feet:
    """Roles of the two feet, which the automaton's resets change, and their swings.

    ``reference`` (2, 2, 3) has each foot's x and y, as for :func:`swing_step`; ``data`` (1,) is of
    ``FEET``.
    """

    def __init__(self, reference: Array, data: Any) -> None:
        self.reference, self.data = reference, data
        self.swing_time: Array = data["swing_time"][0]
        self.swing_time[:] = inf
        self.begin(0)

    @property
    def landed(self) -> int:
        """The foot that landed last; the template's ground is there."""
        return int(self.data["landed"][0])

    @landed.setter
    def landed(self, foot: int) -> None:
        """A foot has landed."""
        self.data["landed"] = foot

    @property
    def foot_of_leg(self) -> tuple[int, int]:
        """Feet of the rear and the front leg."""
        rear, front = self.data["roles"][0].tolist()
        return rear, front

    def begin(self, rear: int) -> None:
        """Make foot ``rear`` the rear leg's, and put the template's ground under it."""
        self.data["roles"] = rear, 1 - rear
        self.landed = rear

    def lift(self, foot: int, robot: Biped, shape: SwingOptions, swung: float = 0.0) -> None:
        """Begin the swing of a foot of the robot, which leaves the ground, or left it ago [s]."""
        self.swing_time[foot] = swung
        now = robot.data[0]
        for contact in robot.groups[foot]:
            away = now["contact_position"][contact] - now["foot_position"][foot]
            self.data["spread"][0, contact] = robot.spread[contact]
            self.data["lifted"][0, contact] = away
        motion = robot.foot_position[foot], robot.foot_velocity[foot]
        begin_swing(self.data, foot, shape, self.reference[foot], *motion, swung)

    def apply(self, reset: Reset) -> None:
        """Change the roles as the automaton's reset does."""
        if reset in (Reset.SHIFT, Reset.SWAP):
            self.data["roles"] = self.foot_of_leg[::-1]
