"""State of a tick, and its compiled parts.

``TICK`` holds what the controller knows from tick to tick, one part for each file that says what
its numbers mean. Python looks at it through the objects that own the parts; the functions
here, which are most of a tick, read and write the same memory. :func:`sense` takes in what was
measured; :func:`act` moves the references on, and solves the QP where no limit acts. Between them
Python sees to events and plans.

The arguments of all of them: ``tick`` is (1,) of ``TICK``, ``data`` (1,) of ``ROBOT_DATA``,
``references`` (1,) of ``REFERENCES``, ``qp`` (1,) of ``QP_DATA``; ``t``, ``r``, ``want`` and ``p``
are their one elements.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.arrays import Array, BoolArray
from template_control.compiled import compiled, compiled_into
from template_control.embedding import swing
from template_control.embedding.free.lateral import LATERAL, lateral_foothold
from template_control.embedding.free.sway import closing_foothold, side_speed, sway
from template_control.embedding.ground import FRAME, to_world, vector_to_world
from template_control.embedding.lean import LEAN, advance_lean
from template_control.embedding.modes import GUARDS, MODE, first_fired
from template_control.embedding.planned_path import KEPT, PATH, PlainCurve, move_clock, plan_is_due
from template_control.embedding.state import SENSED, read_state, rolled
from template_control.estimation.contacts import CONTACTS, DUE, IN_AIR, ON_GROUND, update_contacts
from template_control.estimation.friction import SLIDES, feel_slides
from template_control.robot.library import load_robot
from template_control.robot.terms import LEGS, UP, onward
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.dynamics.model import ORDER
from template_control.structured import keep, structure
from template_control.warm_up import Part
from template_control.whole_body.problem import Answer, solve_free
from template_control.whole_body.solver import WholeBodyQp
from template_control.whole_body.stack import TaskStack
from template_control.whole_body.task import References
from template_control.whole_body.task_rows import write_rows
from template_control.whole_body.tasks import PostureTask

LOAD = structure(
    sum=float,  # of the vertical acceleration's feedback over the stride [m/s]
    time=float,  # over which it was summed [s]
)
"""Load estimate, within a stride."""

TICK = structure(
    time=float,  # since the start [s]
    friction_margin=float,  # share of the friction that the cones use
    trim=float,  # acceleration that the momentum trim adds in its phases [m/s^2]
    frame=FRAME,
    mode=MODE,
    contacts=CONTACTS,
    slides=SLIDES,
    feet=swing.FEET,
    sensed=SENSED,
    guards=GUARDS,
    path=PATH,
    lean=LEAN,
    load=LOAD,
    lateral=LATERAL,
)
"""State of the controller from tick to tick."""

SNAPSHOT = structure(
    time=float,
    phase=float,
    node=np.int64,  # its number on the automaton
    rear=np.int64,
    stands=np.bool_,
    template_com=(float, (2,)),
    template_velocity=(float, (2,)),
    template_force=(float, (LEGS, 2)),
    swing_reference=(float, (LEGS, 2)),
    sway=(float, (2,)),
    side_reference=(float, (LEGS,)),
)
"""Numbers of a :class:`~.state.Snapshot`, which explains them."""

QUIET, EVENTFUL, DIVERGED = 0, 1, 2
"""Results of :func:`sense`: nothing to decide; an event, or a plan that is due; no finite state."""

_TOUCHDOWN, _VLO, _REST = int(Event.TOUCHDOWN), int(Event.VLO), int(Event.REST)
_LIFTOFFS = (int(Event.REAR_LIFTOFF), int(Event.FRONT_LIFTOFF))  # by leg
_REAR = 0
_SIDE = 1
# Largest normal force of a foot that is about to lift off, over the template's. It is over 1, as
# the robot's forces are not exactly the template's.
_UNLOADED = 1.3
_FLOOR = 0.025  # of the weight: it leaves a foot no load to lift off with, and the QP some room


@compiled
def sense(kept: Any, contact: BoolArray, force: Array, dt: float) -> int:
    """Take in what was measured, and find out whether anything is to be decided.

    ``kept`` is a :class:`.Kept` of ``tick``, ``data``, ``references`` and ``qp``.
    ``contact`` (n,) says whether each contact touches the ground, ``force`` (n, 2) is the ground's
    on each, forward and up [N], or ``NO_FORCE``; ``dt`` is the control period [s].
    """
    tick, data, references, qp = kept.value
    t, r = tick[0], data[0]
    _expect(t, r)
    update_contacts(t.contacts, contact, force, dt)
    if force.shape[0] > 0:
        feel_friction(tick, data, qp, force, dt)
    for foot in range(LEGS):
        t.feet.swing_time[foot] += dt
    for leg in range(t.mode.stances):
        foot = t.feet.roles[leg]
        for k in range(2):
            t.lateral.stood[foot, k] = r.foot_position[foot, k]
    if not read_state(t.sensed, t.feet, r, t.mode):
        return DIVERGED
    stand(tick, data, references, qp)
    if first_fired(tick) >= 0 or t.lateral.leaves:
        return EVENTFUL
    lands, deviation = t.mode.next_touchdown_leg >= 0, t.sensed.state[2] - references[0].com[2]
    kept = plan_is_due(t.path, lands, deviation, t.path.time, t.time) == KEPT
    return QUIET if kept else EVENTFUL


@compiled
def stand(tick: Any, data: Any, references: Any, qp: Any) -> None:
    """Write which contacts the QP has on the ground.

    A foot stands on those of its contacts that touch the ground; one none of which does, as its
    sensors say, on all of them, or on none in a phase that settles it.
    """
    t, r, want, p = tick[0], data[0], references[0], qp[0]
    p.contacts = 0
    for i in range(r.contacts):
        want.stands[i] = 0
    for leg in range(t.mode.stances):
        foot = t.feet.roles[leg]
        lifted = not t.mode.settles
        for i in range(r.members[foot]):
            lifted = lifted and not t.contacts.touching[r.group[foot, i]]
        for i in range(r.members[foot]):
            contact = r.group[foot, i]
            if lifted or t.contacts.touching[contact]:
                p.contact[p.contacts], want.stands[contact] = contact, 1
                p.contacts += 1


@compiled
def _expect(t: Any, r: Any) -> None:
    """Write whether each foot is to touch the ground now, or is due to land.

    An overdue foot is no longer due: where it meets the ground then, nothing has foretold.
    """
    c, mode = t.contacts, t.mode
    c.expected[0] = c.expected[1] = IN_AIR
    for leg in range(mode.stances):
        c.expected[t.feet.roles[leg]] = ON_GROUND
    if mode.next_touchdown_leg >= 0 and not t.path.without_touchdown:
        foot = t.feet.roles[mode.next_touchdown_leg]
        due = t.path.event_times[_TOUCHDOWN] - t.path.time
        if due <= c.early and r.foot_velocity[foot, UP] >= -c.sinking:
            c.expected[foot] = DUE


@compiled
def feel_friction(tick: Any, data: Any, qp: Any, force: Array, dt: float) -> None:
    """Let the cones be as narrow as the friction that sliding feet show: see ``feel_slides``."""
    t = tick[0]
    if feel_slides(t.slides, t.contacts.touching, force, data[0].contact_velocity, dt):
        qp[0].friction = t.friction_margin * t.slides.coefficient


@compiled_into
def advance(kept: Any, dt: float) -> None:
    """Move the references on, write the tasks' rows and the stance, for ``dt`` [s].

    ``kept`` is a :class:`.Kept` of ``tick``, ``data``, ``references``, ``qp`` and the robot's
    ``arrays``; the path's curve, and the plan that :func:`.lateral_foothold` reads, or None in
    the plane; ``program`` and ``table`` of the phase's tasks; and ``room`` of :func:`.solve_free`.
    """
    (tick, data, references, qp, arrays), (curve, lateral), (program, table), _ = kept.value
    t, r, want = tick[0], data[0], references[0]
    mode, s = t.mode, t.sensed
    move_clock(t.path, curve, s, mode, want, (r.com_velocity[0], dt))
    for i in range(4):
        want.com_now[i] = s.state[i]
    want.com_now[0] -= s.toes[0]
    want.com_push = t.trim if mode.trim_momentum else 0.0
    want.lead, want.ahead = t.path.offset, np.nan
    move_swings(t, r, want, dt)
    _move_in_space(t, r, want, curve, lateral, dt)
    want.pitch = advance_lean(t.lean, r.attitude[1] - t.frame.angle, dt) + t.frame.angle
    for leg in range(LEGS):
        want.feet[leg] = t.feet.roles[leg]
    _bear(t, r, qp[0], want, arrays[4].shape[1])
    write_rows(program, data, arrays, references, table)
    if mode.estimate_load:
        t.load.sum += want.lift * dt
        t.load.time += dt
    for axis in range(2):  # of the next tick, if nothing hits the robot
        s.pre_impact_velocity[axis] = s.state[2 + axis] + want.com[4 + axis] * dt
    t.time += dt


@compiled_into
def solve(kept: Any, found: Answer) -> int:
    """Solve the QP of the rows as they are, as :func:`.solve_free` returns it."""
    (_, data, _, qp, arrays), _, (_, table), room = kept.value
    return solve_free(qp, data, arrays, table, room, found)


@compiled
def act(kept: Any, found: Answer, dt: float) -> int:
    """As :func:`advance`, then as :func:`solve`."""
    advance(kept, dt)
    return solve(kept, found)


@compiled
def move_swings(t: Any, r: Any, want: Any, dt: float) -> None:
    """Move the references of the feet in the air towards their footholds, by ``dt`` [s]."""
    f, mode, path = t.feet, t.mode, t.path
    overdue = -1  # the foot that should have found the ground by now
    if mode.next_touchdown_leg >= 0 and path.without_touchdown:
        overdue = f.roles[mode.next_touchdown_leg]
    for i in range(mode.swings):
        foot = f.roles[mode.swing_leg[i]]
        x, y = want.foot[foot, 0], want.foot[foot, 1]
        foothold, due = path.landing_x[foot], path.landing_time[foot] - path.time
        if t.contacts.wall[foot] > 0.0:
            # The path goes on as if an overdue foot had time; it has none to go up again.
            aim = (foothold, 0.0 if foot == overdue else due)
            swing.meet_wall(f, foot, x, y, r.foot_position[foot], aim, dt)
        elif foot == overdue:
            swing.drop(f, foot, x, y, dt)
        else:
            foreseen = np.isfinite(foothold)
            if not foreseen:
                # The template cannot complete the stride; the gait's own foothold is the best
                # guess.
                foothold = t.sensed.toes[_REAR] + path.step_length
                due = path.step_duration - f.swing_time[foot]
            if mode.rolling_contact:
                foothold = rolled(foothold, path.touchdown_angle, r.foot_radius)
            swing.wait(f, foot, x, r.foot_position[foot, 0], r.foot_velocity[foot, 0])
            swing.swing_step(f, foot, x, y, (foothold, t.sensed.ground, due), foreseen, dt)
        hip = (r.hips[0] + onward(r.facing) * r.toe_ahead, r.hips[UP] - r.ankle_height)
        sideways = 0.0
        if np.isfinite(r.leg_lean):
            sideways = r.foot_position[foot, _SIDE] - swing.level_reach(r, foot, y[0])[0]
        want.furthest[foot] = swing.furthest(f.leg_share[foot], hip, y[0], sideways, r.leg_length)


@compiled
def _move_in_space(
    t: Any, r: Any, want: Any, curve: PlainCurve, lateral: tuple[Any, ...] | None, dt: float
) -> None:
    """Move on what only a floating-base robot has; of a planar one, whose ``lateral`` is None, not.

    The None is an argument of its own, so that Numba leaves out what is not called.
    """
    if lateral is not None:
        _swing_sideways(t, r, want, lateral, dt)
        _turn(t, want, dt)
        _place_contacts(t, r, want)
        if t.lateral.half_width > 0.0:
            sway(t, r, want, curve)


@compiled
def _swing_sideways(t: Any, r: Any, want: Any, plan: tuple[Any, ...], dt: float) -> None:
    """As :func:`move_swings`, to the left and right.

    Of two feet in the air the one that is due first goes to the next foothold, the other one to
    the one after it.
    """
    f, mode, path, lateral = t.feet, t.mode, t.path, t.lateral
    if not mode.swings:
        return
    com, stood, first = np.array((r.com[_SIDE], side_speed(t, r))), lateral.stood[:, _SIDE], np.inf
    for i in range(mode.swings):
        first = min(first, path.landing_time[f.roles[mode.swing_leg[i]]])
    feet = np.array((stood[lateral.feet[0]], stood[lateral.feet[1]]))
    foothold = lateral_foothold(lateral, plan, path.time, com, feet)
    rests = path.event_times[_REST] < path.event_times[_VLO]
    if mode.stances == 1 and (rests or np.isnan(foothold)):
        # The next touchdown leads to a stand, on no spring of the template, or nowhere.
        lasts = path.event_times[_TOUCHDOWN] - path.time
        foothold = closing_foothold(t, r, f.roles[_REAR], lasts)
    for i in range(mode.swings):
        foot = f.roles[mode.swing_leg[i]]
        due, side = path.landing_time[foot] - path.time, want.side[foot]
        later = path.landing_time[foot] > first
        target = foothold + lateral.second_step if later else foothold
        if np.isfinite(r.leg_lean):
            middle, reach = swing.level_reach(r, foot, want.foot[foot, 1, 0])
            target = min(max(target, middle - reach), middle + reach)
        # Without a touchdown on the path there is no time in which to get there.
        if not f.horizon[foot] < due < np.inf or not np.isfinite(target):
            side[1] = side[2] = 0.0
        else:
            swing.quintic_step(side, target, 0.0, max(due - f.early[foot], f.horizon[foot]), dt)


@compiled
def _turn(t: Any, want: Any, dt: float) -> None:
    """Write the trunk's roll and yaw, and its momentum about the vertical, in a run's turn.

    The heading frame turns at the apex; between two apexes the trunk turns as much.
    """
    lateral = t.lateral
    most = lateral.bank_rate * dt
    want.lean[0] += min(max(lateral.bank - want.lean[0], -most), most)
    done = min((t.time - lateral.begun) / lateral.duration, 1.0)
    want.lean[2] = lateral.turn * (done - 0.5)
    want.spin = lateral.spin


@compiled
def _place_contacts(t: Any, r: Any, want: Any) -> None:
    """Write where the contacts of a foot with several are to be, from the foot's reference.

    Those that do not touch, of a foot that stands, come straight down.
    """
    f, mode = t.feet, t.mode
    for i in range(mode.swings):
        foot = f.roles[mode.swing_leg[i]]
        if r.members[foot] > 1:
            swing.spread_contacts(
                f, foot, r, r.facing + want.lean[2], t.path.step_duration, want.offset
            )
    for leg in range(mode.stances):
        foot = f.roles[leg]
        want.furthest[foot] = np.inf
        for i in range(r.members[foot]):
            contact = r.group[foot, i]
            if want.stands[contact]:
                continue
            for axis in range(3):
                reference = want.side[foot] if axis == 1 else want.foot[foot, axis // 2]
                down = -t.contacts.settling if axis == 2 else 0.0
                away = want.offset[contact, axis]
                away[0] = r.contact_position[contact, axis] - reference[0]
                away[1], away[2] = down - reference[1], -reference[2]


@compiled
def _bear(t: Any, r: Any, qp: Any, want: Any, directions: int) -> None:
    """Write the template's forces on the contacts that stand, and how far they unload.

    Those of a foot share the leg's force.
    """
    mode, forces, at = t.mode, t.path.forces, 0
    for leg in range(mode.stances):
        foot, share, cap = t.feet.roles[leg], 0, np.inf
        for i in range(r.members[foot]):
            share += want.stands[r.group[foot, i]]
        if mode.unloads[leg]:
            load, weight = forces[leg, 1], r.mass * r.gravity
            if mode.unloading > 0.0:
                due = t.path.event_times[_LIFTOFFS[leg]] - t.path.time
                load = weight * max(due / mode.unloading, 0.0)
            cap = _UNLOADED * max(load, 0.0) + _FLOOR * weight
        for _ in range(share):
            qp.cap[at] = cap / share
            qp.force[at, 0] = forces[leg, 0] / share
            qp.force[at, directions - 1] = forces[leg, 1] / share
            if directions > UP:
                # In space a leg's force points at the CoM sideways too.
                away = r.com[_SIDE] - r.foot_position[foot, _SIDE]
                up = r.com[UP] - r.foot_position[foot, UP]
                qp.force[at, _SIDE] = forces[leg, 1] * away / up / share
            at += 1


@compiled
def look(tick: Any, data: Any, references: Any, out: Any) -> None:
    """Write where the controller is at its last tick into ``out`` (1,), of ``SNAPSHOT``."""
    t, r, want, o = tick[0], data[0], references[0], out[0]
    f, mode, path, s, frame = t.feet, t.mode, t.path, t.sensed, t.frame
    o.time, o.phase, o.node, o.rear = t.time, path.time, mode.node, f.roles[_REAR]
    o.stands = mode.stances > 0
    # Of the template's rear toe: at the foot, if that stands.
    origin = s.toes[_REAR] if mode.stances > 0 else path.toe
    to_world(frame, origin + want.com[0], s.ground + want.com[1], o.template_com)
    vector_to_world(frame, want.com[2], want.com[3], o.template_velocity)
    for leg in range(LEGS):
        vector_to_world(frame, path.forces[leg, 0], path.forces[leg, 1], o.template_force[leg])
    o.swing_reference[:], o.side_reference[:] = np.nan, np.nan
    for i in range(mode.swings):
        foot = f.roles[mode.swing_leg[i]]
        place = want.foot[foot]
        to_world(frame, place[0, 0], place[1, 0], o.swing_reference[foot])
        o.side_reference[foot] = want.side[foot, 0]
    o.sway[0] = r.com[_SIDE] - r.foot_position[f.roles[_REAR], _SIDE]
    o.sway[1] = side_speed(t, r)


def whole_tick() -> None:
    """A tick, called to compile it; only Pinocchio knows how its arrays lie."""
    robot, references, tick = load_robot("five-link"), References(), np.zeros(1, TICK)
    robot.update(robot.neutral(), np.zeros(robot.nv))
    qp, tasks = WholeBodyQp(robot), TaskStack((PostureTask(),), robot.nv)
    memory = tick, robot.data, references.data, qp.data
    sense(keep(memory), np.zeros(2, dtype=bool), np.zeros((2, 2)), 1e-3)
    stand(*memory)
    plan_is_due(tick["path"][0], True, 0.0, 0.0, 0.0)
    first_fired(tick)
    curve = np.ones((2, 1, ORDER + 1)), np.ones((1, 7)), np.ones(3)
    rows = tasks.program, tasks.table
    kept = keep(((*memory, robot.arrays), (curve, None), rows, qp.room(1.0)))
    act(kept, qp.answer_arrays(), 1e-3)


CONTROL = (Part(whole_tick, 14.5),)
"""Compiled functions of a tick."""
