"""Lateral motion over feet that bear a moment: as the gait's, or by a plan of their pressure.

Where both feet stand and the CoM follows a curve in time, and in a step from a stand, the lateral
motion is planned as the curve's x is: by the quadratic program of :mod:`~.planning.pressure`
through the phases that are to come, each with the feet that stand in it.

``t`` is of ``TICK``, ``r`` of ``ROBOT_DATA``, ``want`` of ``REFERENCES``, ``curve`` the path's.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.arrays import Array, Pair
from template_control.compiled import compiled
from template_control.embedding.planned_path import PlainCurve
from template_control.robot.terms import onward
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.path import sample
from template_control.slip.planning.catching import CATCHING_SHARE
from template_control.slip.planning.pressure import (
    ARRIVE,
    SMOOTH,
    UNLOADING,
    Pieces,
    pressure,
)
from template_control.whole_body.solver import SOLE_SHARE

_HOLDING = 1.5  # by which it moves beyond the capture point's distance from where a robot stands
_LUNGE = 3.0  # by which a trunk that rolls leads a capture point back, over how fast it leaves
_DEEPEST = 0.35  # roll at most: at 0.4 the leg on the other side is straight [rad]
_NEARLY = 0.99  # of that: the ground is wide enough
_RETURN = 0.5  # of the way that the pressure leads the capture point back: the trunk's return
_SPARED = 0.03  # of the CoM's height, by which it is led inside: at the edge it would stay
_LEANT = 0.1  # roll from which on it is led so far [rad]
_ROLLED = 0.09  # of the CoM's height, by which a radian of the trunk's roll moves it (G1, TALOS)
# Of it, by how far the capture point may be off the ground under both feet without a step: the
# trunk leads 15 N s to a side back.
_BORNE = 0.026
_HALVINGS = 30  # of a way between two feet
_SIDE_GAIN = 2.0  # by which the centre of pressure moves beyond the capture point's error
_SIDE_SHARE = 0.7  # of half a sole's width, by which it moves at most
_SIDE = 1
_VLO, _TOUCHDOWN, _REST = int(Event.VLO), int(Event.TOUCHDOWN), int(Event.REST)
_REAR_LIFTOFF, _FRONT_LIFTOFF = int(Event.REAR_LIFTOFF), int(Event.FRONT_LIFTOFF)
_REAR, _FRONT = 0, 1
_STAGES = 3  # both feet stand, one does, both do
_PIECES = 8  # of each
_LIGHTEST = 0.05  # of the weight: legs do not pull
LOWEST = 0.3
"""Of the legs' length: the least height of the CoM that is planned with."""
_LEAST_SHARE = 0.3  # of a step, at which a capture point is taken to be between the feet
_SPARE = 0.4  # of half a sole's length, by which it may be off the line between them
_WIDEST = 0.5  # of the legs' length: the furthest foothold to the side that catches the CoM
# For the reference template.
_AGAIN = 0.01  # a plan is made anew after this time [s]
_FAR = 1.6  # an event that is further away, or never comes, is planned for here [s]
_ROLL_TIME = 0.2  # kd / kp of the trunk's roll [s]
_HALT = 0.1  # time in which a trunk that rolls comes to rest [s]
_REST_IN = 0.5  # time in which the CoM comes to rest over both feet, at the soonest [s]


@compiled
def sway(t: Any, r: Any, want: Any, curve: PlainCurve) -> None:
    """Write how a robot on soles, or on pairs of feet, is to sway.

    Along a planner's curve the centre of pressure is planned:

        s' = (z'' + g) / h (y - p).

    Else as the template, in single stance held to its gait. The capture point xi = y + a s / w
    diverges with w = sqrt(a g / h), s the lateral speed with the momentum, a the sway ratio. In the
    gait's periodic motion it is at X*_y + X*_v / w from the stance foot at the section. A sole's
    centre of pressure moves beyond it where it is off; a pair's would move forward or back too:

        s' = sum_i f_i (y - y_i) / (m h) - (z'' + g) / h clip(k e),
        e = xi - y_i - (X*_y + X*_v / w) exp(w t), t since the section, or -t until it.
    """
    mode, lateral, forces, due = t.mode, t.lateral, t.path.forces, t.path.event_times
    height, lateral.leaves = _height(t, r), 0
    rests = due[_REST] < min(due[_REAR_LIFTOFF], due[_FRONT_LIFTOFF], due[_VLO])
    if mode.follow_curve and mode.stances > 1 and _on_soles(t, r) and rests:
        _stand(t, r, want)
        return
    if mode.follow_curve:
        if mode.stances == 1:  # a step needs no roll, and with one its leg is straight
            want.lean[0] = lateral.bank
        if np.isnan(lateral.pressure) or t.time - lateral.pressure_at >= _AGAIN * lateral.unit:
            lateral.pressure, lateral.pressure_at = _planned(t, r, curve), t.time
        want.sway = (want.com[5] + r.gravity) / height * (r.com[_SIDE] - lateral.pressure)
        return
    lateral.pressure = np.nan
    want.sway = 0.0
    for leg in range(mode.stances):
        foot = t.feet.roles[leg]
        away = r.com[_SIDE] - r.foot_position[foot, _SIDE]
        want.sway += forces[leg, 1] * away / (r.mass * height)
    if mode.stances != 1:
        return
    foot, rate, since = t.feet.roles[_REAR], _rate(t, r), t.time - lateral.section_began
    if mode.next_touchdown_leg < 0:
        since = t.path.time - due[_VLO]
    point = r.com[_SIDE] + side_speed(t, r) / rate - r.foot_position[foot, _SIDE]
    wanted = (lateral.cycle[0] + lateral.cycle[1] / rate) * np.exp(rate * since)
    if not np.isfinite(wanted):
        return  # the path comes to no section
    bound = _SIDE_SHARE * r.sole_half[r.group[foot, 0], _SIDE]
    moved = min(max(_SIDE_GAIN * (point - wanted), -bound), bound)
    want.sway -= (want.com[5] + r.gravity) / height * moved


@compiled
def _on_soles(t: Any, r: Any) -> bool:
    """True if the feet are soles, not pairs of feet, which enclose other ground."""
    return bool(r.sole_half[r.group[t.feet.roles[_REAR], 0], 0] > 0.0)


@compiled
def _stand(t: Any, r: Any, want: Any) -> None:
    """Write how the CoM of a robot that stays on both feet is to move, forward and to the left.

    Its capture point comes to the middle of the feet, straight: the centre of pressure is beyond
    it, within the ground that both feet enclose, or where that is nearest to a point outside:

        p = xi + k (xi - middle), k up to 1.5; s' = (z'' + g) / h (x - p), in both directions.
    """
    lift = max(want.com[5] + r.gravity, _LIGHTEST * r.gravity) / _height(t, r)
    rear, uphill = t.feet.roles[_REAR], t.path.body[2]
    here, half = r.foot_position[rear, :2], np.array((t.path.body[5], t.lateral.half_width))
    way, half = r.foot_position[1 - rear, :2] - here, SOLE_SHARE * half
    com, point = np.array((t.sensed.state[0], r.com[_SIDE])), np.empty(2)
    # On a slope the CoM rests uphill of the centre of pressure.
    point[0] = com[0] + t.sensed.state[2] / np.sqrt(lift) - uphill / lift
    point[_SIDE] = com[_SIDE] + side_speed(t, r) / np.sqrt(r.sway * lift)
    point -= here
    off, gap = point[_SIDE] - 0.5 * way[_SIDE], point[_SIDE]
    if hold(way, half, point) > _BORNE * _height(t, r):
        t.lateral.leaves = 1
    gap -= point[_SIDE]
    _lunge(t, r, want, off, gap)
    point += here
    t.lateral.pressure, t.lateral.pressure_at = point[_SIDE], -np.inf
    want.ahead = lift * (com[0] - point[0]) - uphill
    want.sway = lift * (com[_SIDE] - point[_SIDE])


@compiled
def _lunge(t: Any, r: Any, want: Any, off: float, gap: float) -> None:
    """Let the trunk roll where the ground is too narrow for the capture point.

    ``off`` is how far it is to the left of the middle of the feet, ``gap`` of the centre of
    pressure [m]. With z the CoM's height and an angular momentum of m z rho roll' it has

        xi' = w (xi - p) + rho roll'.

    So it is led back over the ground, and the trunk returns as the pressure leaves it room.
    """
    roll, lateral = r.attitude[0], t.lateral
    want.lean[0] = lateral.bank
    if gap * off <= 0.0 and abs(gap) >= _NEARLY * _HOLDING * abs(off):
        return
    time, rolled = _ROLL_TIME * lateral.unit, _ROLLED * _height(t, r)
    side = np.copysign(1.0, off)
    spared = _SPARED * _height(t, r) * min(max(-side * roll / _LEANT, 0.0), 1.0)
    rate = side * _rate(t, r) * (side * gap + spared) / rolled
    if side * rate > 0.0:
        room = max(_DEEPEST + side * roll, 0.0) / (_HALT * lateral.unit)
        rate = -min(max(_LUNGE * rate, -room), room)
    else:
        most = max(_RETURN * abs(rate), lateral.bank_rate)
        rate = side * min(-side * roll / time, most)
    want.lean[0] = roll + time * rate


@compiled
def hold(way: Array, half: Array, point: Array) -> float:
    """Turn a capture point (2,) into the centre of pressure that leads it between two equal feet.

    They enclose what a rectangle with half the sides ``half`` (2,), its middle at 0, covers on its
    way ``way`` (2,) to the other one's [m]: a hexagon about the middle. Returns how far outside the
    capture point is [m].
    """
    x, y = point[0] - 0.5 * way[0], point[1] - 0.5 * way[1]
    beyond = 1.0 + _HOLDING
    for side in range(3):
        across = 1.0 if side == 0 else 0.0 if side == 1 else -way[1]
        along = 0.0 if side == 0 else 1.0 if side == 1 else way[0]
        most = abs(across) * half[0] + abs(along) * half[1]
        most += 0.5 * abs(across * way[0] + along * way[1])
        off = abs(across * x + along * y)
        if most < beyond * off:
            beyond = most / off
    if beyond >= 1.0:
        point[0], point[1] = 0.5 * way[0] + beyond * x, 0.5 * way[1] + beyond * y
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share, slope = 0.5 * (low + high), 0.0
        for axis in range(2):
            off = point[axis] - share * way[axis]
            slope += (off - min(max(off, -half[axis]), half[axis])) * way[axis]
        if slope > 0.0:
            low = share
        elif slope < 0.0:
            high = share
        else:
            break
    for axis in range(2):
        middle = share * way[axis]
        point[axis] = min(max(point[axis], middle - half[axis]), middle + half[axis])
    x, y = x + 0.5 * way[0] - point[0], y + 0.5 * way[1] - point[1]
    return np.sqrt(x * x + y * y)


@compiled
def _height(t: Any, r: Any) -> float:
    """Height of the CoM over the ground [m]; of a robot that falls it may be below its feet."""
    return max(t.sensed.state[1], LOWEST * r.leg_length)


@compiled
def closing_foothold(t: Any, r: Any, stands: int, lasts: float) -> float:
    """y of the foothold of a stride that ends at rest [m].

    The foot ``stands`` bears the CoM for ``lasts`` from now on [s]. Of a robot whose feet land in
    one line it is y of that foot.
    """
    lateral, rate, stance = t.lateral, _rate(t, r), r.foot_position[stands]
    if lateral.step == 0.0:
        return float(stance[_SIDE])
    lasts = min(lasts, _FAR * lateral.unit)
    swings = onward(r.facing) * r.hip_side[1 - stands]
    if swings == 0.0:
        swings = r.foot_position[1 - stands, _SIDE] - stance[_SIDE]
    side = np.copysign(1.0, swings)
    point = side * (r.com[_SIDE] + side_speed(t, r) / rate - stance[_SIDE])
    edge, step = SOLE_SHARE * lateral.half_width, abs(lateral.step)
    narrowest = min(abs(lateral.steps[0]), abs(lateral.steps[1]))
    shares = _shares_ahead(t, r, stands, lasts)
    if lateral.catches:
        shares = _LEAST_SHARE, CATCHING_SHARE
        beyond = (point + edge) * np.exp(rate * lasts) - edge
        if beyond < 0.0:  # of the foot that stands: next to it, or across it
            return float(stance[_SIDE] + side * beyond)
    apart = distance_aside(point, np.exp(rate * lasts), edge, shares, (step, narrowest))
    return float(stance[_SIDE] + side * min(apart, max(_WIDEST * r.leg_length, step)))


@compiled
def distance_aside(point: float, growth: float, edge: float, shares: Pair, steps: Pair) -> float:
    """Distance of a foothold to the side, with the capture point on the line between both feet [m].

    There is no ground off that line to hold the CoM on. It is the gait's, the first of
    ``steps``, or the nearest for which, at touchdown, the capture point is as large a share of the
    step to the side as ahead,

        xi_near / most <= d <= xi_far / least, xi_near, xi_far = (xi -+ Y) exp(w T) +- Y,

    but no less than the second of ``steps``. ``point`` is xi now, from the foot that stands
    towards the other one [m], ``growth`` exp(w T), ``edge`` Y, by how far the centre of pressure
    may be to either side [m]; ``shares`` are the least and the most ahead.
    """
    least, most = shares
    near, far = (point - edge) * growth + edge, (point + edge) * growth - edge
    return min(max(steps[0], near / most), max(far / least, steps[1]))


@compiled
def _shares_ahead(t: Any, r: Any, stands: int, lasts: float) -> Pair:
    """Least and largest share of the next step's length at which the capture point may be taken.

    That is as the foot which is in the air lands, ahead of the one that ``stands``.
    """
    x, speed, rate = t.sensed.state[0], t.sensed.state[2], np.sqrt(r.gravity / _height(t, r))
    ahead = t.path.landing_x[1 - stands] - r.foot_position[stands, 0]
    if not abs(ahead) > 0.0:
        return _LEAST_SHARE, 1.0
    point = (x + speed / rate - r.foot_position[stands, 0]) * np.exp(rate * lasts) / ahead
    spare = _SPARE * t.path.body[5] / abs(ahead)
    least = min(max(point - spare, _LEAST_SHARE), 1.0)
    return least, min(max(point + spare, least), 1.0)


@compiled
def _rate(t: Any, r: Any) -> float:
    """w = sqrt(a g / h), at which the capture point leaves the centre of pressure [1/s]."""
    return np.sqrt(r.sway * r.gravity / _height(t, r))


@compiled
def front_shares(along: float, apart: float, half: float) -> Pair:
    """Least and largest share of the load that the front foot can bear.

    The centre of pressure is ``along`` ahead of the rear foot's middle, the front foot's is
    ``apart`` ahead, and both bear it by ``half`` to either side of their middles [m].
    """
    if not abs(apart) > 0.0:
        return 0.0, 1.0
    one, other = (along - half) / apart, (along + half) / apart
    least, most = min(one, other), max(one, other)
    return min(max(least, 0.0), 1.0), min(max(most, 0.0), 1.0)


@compiled
def _shares_of_lifting(t: Any, r: Any, curve: PlainCurve, stays: int, after: float) -> Pair:
    """Least and largest share that the foot which lifts off can bear, ``after`` some time [s].

    By the centre of pressure that the curve has ahead: of two soles, one ahead of the other, the
    loads say both where it is ahead and where to the side.
    """
    if not _on_soles(t, r):
        return 0.0, 1.0
    com, rear = np.empty(6), t.feet.roles[_REAR]
    sample(curve, t.path.time + after, com)
    lift = max(com[5] + r.gravity, _LIGHTEST * r.gravity)
    along = com[0] - com[4] * max(com[1], LOWEST * r.leg_length) / lift
    apart = r.foot_position[1 - rear, 0] - r.foot_position[rear, 0]
    least, most = front_shares(along, apart, SOLE_SHARE * t.path.body[5])
    return (1.0 - most, 1.0 - least) if stays != rear else (least, most)


@compiled
def _planned(t: Any, r: Any, curve: PlainCurve) -> float:
    """y of the first centre of pressure [m] of the plan to the end of the stride.

    Both feet stand until a liftoff, if there is one; then one does, until the touchdown or the
    section; then both. At VLO the CoM is to move as in the gait's periodic motion, at rest it is
    to be in the middle of the feet. In the middle of its bounds the pressure has room to both sides
    for what is not foreseen.
    """
    mode, path, lateral = t.mode, t.path, t.lateral
    due = np.minimum(np.maximum(path.event_times - path.time, 0.0), _FAR * lateral.unit)
    lifts, ends = min(due[_REAR_LIFTOFF], due[_FRONT_LIFTOFF]), min(due[_REST], due[_VLO])
    stays = t.feet.roles[_REAR]
    if mode.stances > 1 and due[_REAR_LIFTOFF] <= due[_FRONT_LIFTOFF]:
        stays = t.feet.roles[_FRONT]
    here, half = r.foot_position[stays, _SIDE], SOLE_SHARE * lateral.half_width
    now = other = r.foot_position[1 - stays, _SIDE]
    rests, soles = due[_REST] <= due[_VLO], _on_soles(t, r)
    lasts = np.zeros(_STAGES)
    if mode.stances == 1 or lifts < ends:
        lasts[0] = lifts if mode.stances > 1 else 0.0
        lasts[1] = max(min(due[_TOUCHDOWN], ends) - lasts[0], 0.0)
        if rests:
            other = closing_foothold(t, r, stays, lasts[1])
    middle = 0.5 * (here + other)
    if rests:
        lasts[2] = max(ends - lasts[0] - lasts[1], _REST_IN * lateral.unit)
    n = _PIECES * np.count_nonzero(lasts > 0.0)
    found = np.empty(n)
    pieces = Pieces(np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n))
    rate, at = _rate(t, r), 0
    for stage in range(_STAGES):
        if lasts[stage] <= 0.0:
            continue
        for k in range(_PIECES):
            pieces.duration[at], pieces.rate[at] = lasts[stage] / _PIECES, rate
            least, load = 0.0, 1.0 if stage == 2 else 0.0
            if stage == 0:
                # The foot that lifts off gives up its load before.
                left = (_PIECES - k - 1) * lasts[0] / _PIECES
                then = (k + 0.5) * lasts[0] / _PIECES
                least, load = _shares_of_lifting(t, r, curve, stays, then)
                load = min(left / (UNLOADING * lateral.unit), load)
                least = min(least, load)
            apart = (now if stage == 0 else other) - here
            pieces.low[at] = here + min(least * apart, load * apart) - half
            pieces.high[at] = here + max(least * apart, load * apart) + half
            pieces.wish[at] = 0.5 * (pieces.low[at] + pieces.high[at])
            if stage == 0 and not soles:
                # With the middle Go2 fell in 2 of 32 random commands, as it started; so in one.
                pieces.wish[at] = here
            at += 1
    start, end = np.array((r.com[_SIDE], side_speed(t, r))), np.array((middle, 0.0))
    if not rests:
        end[0], end[1] = here + lateral.cycle[0], lateral.cycle[1]
    prices = (SMOOTH * lateral.unit, ARRIVE * lateral.unit)
    pressure(pieces, start, end, lateral.pressure, prices, found)
    return found[0]


@compiled
def side_speed(t: Any, r: Any) -> float:
    """Speed of a floating-base robot's CoM to the left, as the phase has the forward one [m/s]."""
    speed = r.com_velocity[_SIDE]
    if t.mode.momentum_speed:
        speed -= r.momentum[0] / (r.mass * t.sensed.state[1])
        speed *= r.sway
    return speed
