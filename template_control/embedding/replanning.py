"""Decisions between two sections: what of a stride is chosen again, and what of it is still free.

Until a leg lands these are all its controls, from then on the stiffnesses of what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import inf, isnan, pi
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, Pair
from template_control.embedding.planners.planner import (
    Cause,
    Context,
    Decision,
    RestContext,
    decided,
    rest_decided,
    settled,
)
from template_control.embedding.recovery import TO_REST, Recovery, entry, ways_to_rest
from template_control.embedding.rollout import TemplateRollout
from template_control.embedding.state import TemplateState
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome, Slot
from template_control.slip.control.least_squares import Search
from template_control.slip.control.stride_solver import Prior, StrideEnd, solve_stride
from template_control.slip.control.touchdown import (
    ballistic_touchdown_angle,
    touchdown_angle_after,
)
from template_control.slip.dynamics.stride import Stride
from template_control.slip.gaits.gait import Gait, uncontrolled
from template_control.slip.maps.section import REST, section_of
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.similarity import ACCELERATION, RATE_SQUARED, Scale

_AT_ONCE = 2e-3  # [s] from its start: no path comes to an event at which it begins
_ROUNDS = 3  # of interpolation

# Lengths, times and speeds are those of the reference template.

# A touchdown in t seconds can still be planned anew with an angle that differs from the old one by
# this times t^2 [rad/s^2]; the swing foot cannot do more.
AGILITY = 8.0
_FORESIGHT = 1.0  # t counts as this at most [s]; where no touchdown is due it has no bound
# A touchdown is not planned anew to come earlier than this from now [s], nor earlier than it was
# due where that is less: a foot that is up has to come down.
SOONEST = 0.06
# Of the gait's step duration, which counts instead where it is less: a fast walk that is pushed
# needs its foot at once.
SOONEST_SHARE = 0.08

# Stiffnesses where the ground is not where it was expected. A template that steps up ends its
# stride slow and sinking. Legs that push longer give back some of the energy that the climb took.
# One that steps down ends it fast, and a step can brake only from some of the states that it may
# end in: a planner knows them by their price.
END_TOLERANCE = np.array((0.1, 0.02, 0.1))
"""Errors of dx/dt, y, dy/dt where such a stride ends that count as 1 [m/s, m, m/s]."""
_CHANGE = 0.5  # of a stiffness, over the gait's, that counts as 1
_BOUNDS = (0.5, 2.0)  # of the stiffnesses over the gait's
_SOLVER_ROUNDS = 5  # Gauss-Newton steps
TRIES = 36
"""Points of the grid of stiffnesses whose ends the planner prices."""
_EFFORT = 0.1  # what a change that counts as 1 adds to the planner's price
_ASSIST = 1.5  # largest change of the forward acceleration that two legs add in such a step [m/s^2]

_Price = Callable[[Array], float]  # of an end, to the planner of the next stride; nan: none known


def free_controls(automaton: Automaton, node: Node) -> list[int]:
    """Slots of the stiffnesses on which the rest of a stride depends, from a node on."""
    later = automaton.stride(node.name)
    return sorted({int(k) for n in later for k in (n.rear, n.front) if k is not None})


def choose_legs(
    ahead: StrideEnd,
    decision: Decision,
    target: Array,
    free: Sequence[int],
    nominal: Array,
    scale: Scale,
    price: _Price | None = None,
) -> Decision:
    """The decision with the stiffnesses that lead the rest of a stride to the cheapest end.

    Without a price that is the end nearest to the target. ``ahead`` is the end by the controls,
    ``target`` (n,) the wanted one; ``free`` are slots of the stiffnesses that the rest of the
    stride depends on, ``nominal`` (NUM_SLOTS,) the gait's controls.
    """
    stiff = [slot for slot in free if slot != Slot.TOUCHDOWN_ANGLE and nominal[slot] > 0.0]
    base = nominal[stiff]
    lower, upper = (share * base for share in _BOUNDS)
    now = np.clip(decision.controls[stiff], lower, upper)
    table = np.array([now, _CHANGE * base, lower, upper])
    prior = Prior(decision.controls, stiff, table, Search(_SOLVER_ROUNDS))
    weights = np.diag(1.0 / (END_TOLERANCE * scale.state))
    u, end = solve_stride(ahead, target, prior, weights)
    if price is not None:
        u, end = _cheapest(u, end, prior, ahead, price, base)
    if end is None:
        return decision
    return replace(decision, controls=u, predicted=end, nominal=False)


def _cheapest(
    u: Array, end: Array | None, prior: Prior, ahead: StrideEnd, price: _Price, gait: Array
) -> tuple[Array, Array | None]:
    """The cheapest of a grid within the bounds, and of controls ``u`` that lead to ``end``.

    An end has its price, stiffnesses that of their distance from the ``gait``'s (f,).
    """

    def effort(x: Array) -> float:
        change = (x / gait - 1.0) / _CHANGE
        return float(_EFFORT * (change @ change))

    stiff = prior.slots
    least = np.inf if end is None else price(end) + effort(u[stiff])
    if isnan(least):
        return u, end
    for x in prior.grid(max(2, round(TRIES ** (1.0 / max(len(stiff), 1))))):
        if effort(x) >= least:
            continue
        tried = prior.controls.copy()
        tried[stiff] = x
        there, outcome = ahead(tried)
        if outcome is Outcome.SECTION and (cost := effort(x) + price(there)) < least:
            least, u, end = cost, tried, there
    return u, end


def reachable_turn(scale: Scale, time_to_go: float) -> float:
    """Change of the touchdown angle that the swing foot can still make [rad].

    ``time_to_go`` is until the touchdown is due [s].
    """
    rate = AGILITY * scale.factor(RATE_SQUARED)
    return rate * min(max(time_to_go, 0.0), _FORESIGHT * scale.time) ** 2


class Situation(NamedTuple):
    """A robot within a stride, and what holds for it."""

    node: Node
    sensed: TemplateState
    goal: StrideGoal
    decision: Decision
    whole: bool = False  # nothing of the stride has been used yet: in its first node, on springs
    to_go: float = inf  # time until the touchdown is due [s]
    cause: Cause = Cause.DEVIATION
    height_error: float = 0.0  # of the ground under the foot that has landed over the other's [m]


def reachable_angles(rollout: TemplateRollout, s: Situation) -> Pair:
    """Least and greatest touchdown angle that the swing foot can still land with [rad]."""
    planners, u = rollout.planners, s.decision.controls
    change, angle = reachable_turn(rollout.scale, s.to_go), float(u[Slot.TOUCHDOWN_ANGLE])
    most = angle + change
    if s.node.rear is not None and s.node.edge(Event.TOUCHDOWN) is not None:
        step = planners.of(s.goal).gait.step_duration
        soonest = min(SOONEST * rollout.scale.time, SOONEST_SHARE * step)
        time, stiffness = max(min(s.to_go, soonest), _AT_ONCE), float(u[s.node.rear])
        where = s.sensed.state, s.sensed.toes, planners.route.parameters
        most = min(most, touchdown_angle_after(*where, stiffness, time))
    return min(angle - change, most), most


def choose_all_controls(rollout: TemplateRollout, s: Situation, angles: Pair) -> Decision | None:
    """Decide anew at the section state from which the template would have come to here.

    Where no stride goes on from there, the gait's legs may have led to here from another one. The
    robot is in the first node of a stride; ``angles`` are the least and greatest touchdown angle
    that the swing foot can still reach [rad]. None where the template cannot have come from a
    section.
    """
    planner, decision = rollout.planners.of(s.goal), None
    # The template would have flown or sunk with the legs so far; the robot's motors are weaker.
    for so_far in (s.decision.controls, planner.gait.controls):
        z = rollout.backward_to_section(s.node, so_far, s.sensed)
        if z is not None:
            context = Context(z, s.goal.target, angles, s.cause, s.decision)
            decision = decided(planner, context)
            if decision.feasible:
                break
    return decision


def choose_rest(rollout: TemplateRollout, s: Situation) -> Decision | None:
    """Let the planner choose the stiffnesses on which the rest of the stride depends.

    In a stride that is broken into, the angle too, until a leg lands. None of a planner of whole
    strides.
    """
    free, turn = free_controls(rollout.automaton, s.node), 0.0
    if s.cause is Cause.RECOVERY and s.node.edge(Event.TOUCHDOWN) is not None:
        free = [int(Slot.TOUCHDOWN_ANGLE), *free]
        turn = reachable_turn(rollout.scale, s.to_go)
    ahead = rollout.ahead(s.node, s.sensed)
    context = RestContext(ahead, s.decision, s.goal.target, free, turn, s.cause)
    return rest_decided(rollout.planners.of(s.goal), context)


def _after_touchdown(rollout: TemplateRollout, s: Situation) -> Decision | None:
    decision = choose_rest(rollout, s)
    if decision is not None:
        return decision
    p = rollout.planners.route.parameters
    angle = ballistic_touchdown_angle(s.sensed.state, s.sensed.toes, p)
    if not 0.0 < angle < pi:
        return None  # of a robot that falls: the CoM is below the foot
    start = rollout.automaton.start(s.goal.stride)
    return choose_all_controls(rollout, s._replace(node=start), (angle, angle))


def _on_unexpected_ground(rollout: TemplateRollout, s: Situation) -> Decision | None:
    if abs(s.height_error) <= rollout.height_error or s.node.name in rollout.curved:
        return None
    planner, ahead = rollout.planners.of(s.goal), rollout.ahead(s.node, s.sensed)
    free, nominal = free_controls(rollout.automaton, s.node), planner.gait.controls
    # After a step up the end nearest to the gait is the best: three steps later the walk is
    # back. The cheapest one goes on with a stride of half the speed.
    cost = planner.cost if s.height_error < 0.0 else None
    return choose_legs(ahead, s.decision, s.goal.target, free, nominal, rollout.scale, cost)


def _after_deviation(rollout: TemplateRollout, s: Situation) -> Decision | None:
    decision = None
    if s.whole:
        decision = choose_all_controls(rollout, s, reachable_angles(rollout, s))
    return decision or choose_rest(rollout, s)


class Rule(NamedTuple):
    """Row of the table of causes."""

    # Makes what can still be chosen, None where what was decided holds.
    choose: Callable[[TemplateRollout, Situation], Decision | None]
    recovers: bool = False  # the robot may break into another stride
    angle_drop: float = 0.0  # how much lower the touchdown angle is than decided [rad]


RULES: Mapping[Cause, Rule] = {
    # The stiffnesses, from here; by a planner of whole strides all but the angle, from the section.
    Cause.TOUCHDOWN: Rule(_after_touchdown),
    # The stiffnesses, from here, near the gait's or by the cost of where they lead.
    Cause.GROUND_HEIGHT: Rule(_on_unexpected_ground),
    # Until a leg lands all, from the section state that would have led here; then the stiffnesses.
    Cause.DEVIATION: Rule(_after_deviation, recovers=True),
    Cause.NO_FUTURE: Rule(_after_deviation, recovers=True),
    # Nothing: the template goes on without a touchdown, on ground that is lower than thought.
    Cause.OVERDUE: Rule(lambda rollout, s: None, angle_drop=0.15),
}
"""By the cause of a new plan within a stride: what is free, from where, and what else there is."""


def choose_assist(rollout: TemplateRollout, s: Situation) -> None:
    """Let the template run on with the assist that its step needs from here.

    For the speed at the step's end, where a foot has landed off: near a symmetric gait neither the
    touchdown angle nor a stiffness changes it. Forces of two feet do, as the assist of a template
    on a slope. The rollout keeps the assist until it stands on other ground.
    """
    bound = _ASSIST * rollout.scale.factor(ACCELERATION)
    gait: Gait = rollout.planners.of(s.goal).gait
    ground, left_alone = rollout.ground, uncontrolled(gait)
    controls = s.decision.controls

    def drift(change: float) -> float | None:
        """Of the step with another assist, as a forward speed [m/s]; None if it does not end."""
        rollout.set_ground(replace(ground, assist=ground.assist + change))
        end, outcome = rollout.ahead(s.node, s.sensed)(controls)
        return float(left_alone @ (end - gait.state)) if outcome is Outcome.SECTION else None

    rollout.set_ground(replace(ground, assist=ground.assist + _change(drift, bound)))


def _change(drift: Callable[[float], float | None], bound: float) -> float:
    """Change that makes the drift zero, by false position, or as small as the bound allows."""
    none = drift(0.0)
    if none is None:
        return 0.0
    far = -bound if none > 0.0 else bound
    most = drift(far)
    if most is None:
        return 0.0
    if most * none > 0.0:
        return far if abs(most) < abs(none) else 0.0
    ends, change = [(0.0, none), (far, most)], 0.0
    for _ in range(_ROUNDS):
        (a, at_a), (b, at_b) = ends
        change = a - at_a * (b - a) / (at_b - at_a)
        value = drift(change)
        if value is None:
            return 0.0
        ends[0 if value * at_a > 0.0 else 1] = change, value
    return change


# Stiffnesses over k0 with which a slow walk is tried before the robot comes to a stand.
_LEGS = (0.4, 0.6, 0.8, 1.1)


def find_recovery(
    rollout: TemplateRollout, s: Situation, recovery: Recovery, excess: float
) -> Situation | None:
    """The robot in another stride from here, one that the recovery may break into.

    ``excess`` is how far off the robot's speed is [m/s]. None where there is no such stride, or the
    template does not complete it.
    """
    automaton, speed = rollout.automaton, float(s.sensed.state[2])
    for goal in recovery.ways(s.goal, speed, excess):
        name = entry(s.node.name, s.goal.stride, goal.stride)
        if name not in automaton.index or goal.stride not in rollout.planners.planners:
            continue
        if section_of(automaton.sections(name)[1]) is REST and _goes_on(rollout, s):
            continue  # a stand is for a walk that gets no further
        other = s._replace(node=automaton.node(name), goal=goal, cause=Cause.RECOVERY)
        decision = _break_into(rollout, other)
        if decision is not None and decision.feasible:
            recovery.take(goal)
            return other._replace(decision=decision)
    return None


def _goes_on(rollout: TemplateRollout, s: Situation) -> bool:
    """True if the template completes the present stride from here, with these legs or others."""
    ahead, free = rollout.ahead(s.node, s.sensed), free_controls(rollout.automaton, s.node)
    legs = np.tile(s.decision.controls, (1 + len(_LEGS), 1))
    legs[1:, free] = np.array(_LEGS)[:, None] * rollout.ground.leg_stiffness
    return any(ahead(u)[1] is Outcome.SECTION for u in legs)


def _break_into(rollout: TemplateRollout, s: Situation) -> Decision | None:
    """Decision of another stride, that of the one which is left so far; None: there is none."""
    planner, name = rollout.planners.of(s.goal), s.node.name
    if name not in rollout.curved:
        return choose_rest(rollout, s)
    wanted = section_of(rollout.automaton.sections(name)[1]).padded(s.goal.target)
    begun = replace(s.decision, predicted=wanted, nominal=False, controls=np.zeros(NUM_SLOTS))
    decision, stride = rollout.curve(name, s.sensed, s.sensed.state, planner, begun)
    return replace(decision, feasible=decision.feasible and stride.completed, lasting=True)


def curve_or_step(
    rollout: TemplateRollout, s: Situation, state: Array
) -> tuple[StrideGoal, Decision, Stride]:
    """The curve of the stride's planner from here, or else the first one that leads to rest.

    The robot is in a node where a curve carries it; ``state`` (4,) is x, y, dx/dt, dy/dt. Returns
    goal and decision that hold from now on, and the stride from here: where another one is made
    instead, such as a step, the goal's stride and the first node are that one's.
    """
    planners = rollout.planners
    node, planner = s.node.name, planners.of(s.goal)
    decision, stride = rollout.curve(node, s.sensed, state, planner, s.decision)
    # A curve to a liftoff that is not quite feasible leads there all the same, if it is lasting.
    leads = decision.feasible or (decision.lasting and node not in TO_REST)
    for kind, begins in () if leads else ways_to_rest(node):
        other = planners.planners.get(kind)
        if other is None:
            continue
        instead, rest = rollout.curve(begins, s.sensed, state, other, settled(other.gait))
        if instead.feasible:
            goal = replace(s.goal, stride=kind, target=other.gait.state)
            return goal, instead, rest
    return s.goal, decision, stride
