"""Decisions between two sections: what of a stride is chosen again, and what of it is still free.

Until a leg lands these are all its controls, from then on the stiffnesses of what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from math import asin, atan2, hypot, isnan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.learners.momentum import uncontrolled
from template_control.embedding.planners.planner import (
    Cause,
    Context,
    Decision,
    EndOfStride,
    RestContext,
    decided,
    rest_decided,
)
from template_control.embedding.planners.stride_solver import FromHere, Prior, solve_stride
from template_control.embedding.rollout import TemplateRollout
from template_control.embedding.state import SectionReport, TemplateState
from template_control.slip.automaton.hybrid import Automaton, Node
from template_control.slip.automaton.vocabulary import Event, Outcome, Slot
from template_control.slip.gaits.gait import Gait
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import ACCELERATION, RATE_SQUARED, Scale

Array = NDArray[np.float64]

_NEWTON = 4
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
HEIGHT_ERROR = 0.008
"""Height of the ground under the foot that has landed over that under the other one, from which on
the stiffnesses are chosen again [m]."""
END_TOLERANCE = (0.1, 0.02, 0.1)
"""Errors of dx/dt, y, dy/dt where such a stride ends that count as 1 [m/s, m, m/s]."""
_CHANGE = 0.5  # of a stiffness, over the gait's, that counts as 1
_BOUNDS = (0.5, 2.0)  # of the stiffnesses over the gait's
_SOLVER_ROUNDS = 5  # Gauss-Newton steps
TRIES = 36
"""Points of the grid of stiffnesses whose ends the planner prices."""
_EFFORT = 0.1  # what a change that counts as 1 adds to the planner's price
_ASSIST = 1.5  # largest change of the forward acceleration that two legs add in such a step [m/s^2]


def free_controls(automaton: Automaton, node: Node) -> list[int]:
    """Slots of the stiffnesses that the rest of a stride depends on.

    Args:
        automaton: of the stride.
        node: that the rest begins in.
    """
    later = automaton.stride(node.name)
    return sorted({int(k) for n in later for k in (n.rear, n.front) if k is not None})


def touchdown_angle_after(
    sensed: TemplateState, parameters: SlipParameters, stiffness: float, time: float
) -> float:
    """Touchdown angle of a front leg that comes to l0 some time from now [rad].

    The height then comes from its Taylor series to the second order.

    Args:
        sensed: the robot in single stance.
        parameters: the template.
        stiffness: of the leg that stands [N/m].
        time: from now [s].
    """
    x, y, _, dy = sensed.state.tolist()
    length = parameters.rest_length
    stretch = length / hypot(x - float(sensed.toes[0]), y) - 1.0
    lift = stiffness * stretch * y / parameters.mass - parameters.gravity
    later = y + time * (dy + 0.5 * time * lift)
    return asin(min(max(later / length, 0.0), 1.0))


def ballistic_touchdown_angle(sensed: TemplateState, parameters: SlipParameters) -> float:
    """Angle of the template's leg as it comes to l0 on the ballistic path through the robot [rad].

    The robot's foot meets the ground a little before or after.

    Args:
        sensed: the robot as its rear foot meets the ground.
        parameters: the template.
    """
    x, y, dx, dy = sensed.state.tolist()
    x -= float(sensed.toes[0])
    time = 0.0
    for _ in range(_NEWTON):
        px, py, speed = x + dx * time, y + dy * time - 0.5 * parameters.gravity * time**2, dy
        speed -= parameters.gravity * time
        slope = 2.0 * (px * dx + py * speed)
        if slope >= 0.0:
            break
        time -= (px**2 + py**2 - parameters.rest_length**2) / slope
    return atan2(py, -px)


class _Pricing(NamedTuple):
    """Price of a choice: of the state that it leads to, and of its distance from the gait's.

    Attributes:
        price: of a state.
        gait: (f,) the gait's stiffnesses [N/m].
    """

    price: Callable[[Array], float]
    gait: Array

    def effort(self, x: Array) -> float:
        """Of stiffnesses ``x`` (f,) [N/m]."""
        change = (x / self.gait - 1.0) / _CHANGE
        return float(_EFFORT * (change @ change))


def choose_legs(
    ahead: EndOfStride,
    decision: Decision,
    target: Array,
    free: Sequence[int],
    nominal: Array,
    scale: Scale,
    price: Callable[[Array], float] | None = None,
) -> Decision:
    """The decision with the stiffnesses that lead the rest of a stride to the cheapest end.

    Without a price that is the end nearest to the target.

    Args:
        ahead: where the stride ends from here, by its controls.
        decision: what holds so far.
        target: (n,) state that the stride is to end in.
        free: slots of the stiffnesses that the rest of the stride depends on.
        nominal: (NUM_SLOTS,) the gait's controls.
        scale: units of the template.
        price: of the state where a stride ends, to the planner of the next one; nan: it knows none.
    """
    stiff = [slot for slot in free if slot != Slot.TOUCHDOWN_ANGLE and nominal[slot] > 0.0]
    base = nominal[stiff]
    lower, upper = (share * base for share in _BOUNDS)
    now = np.clip(decision.controls[stiff], lower, upper)
    table = np.array([now, _CHANGE * base, lower, upper])
    prior = Prior(decision.controls.copy(), stiff, table, _SOLVER_ROUNDS)
    speed, length, _ = END_TOLERANCE
    tolerance = np.array([speed * scale.speed, length * scale.length, speed * scale.speed])
    u, end = solve_stride(FromHere(ahead, stiff), target, prior, tolerance)
    if price is not None:
        u, end = _cheapest(u, end, prior, ahead, _Pricing(price, nominal[stiff]))
    if end is None:
        return decision
    return replace(decision, controls=u, predicted=end, nominal=False)


def _cheapest(
    u: Array, end: Array | None, prior: Prior, ahead: EndOfStride, pricing: _Pricing
) -> tuple[Array, Array | None]:
    """The cheapest of a grid within the bounds, and of controls ``u`` that lead to ``end``."""
    stiff = prior.slots
    least = np.inf if end is None else pricing.price(end) + pricing.effort(u[stiff])
    if isnan(least):
        return u, end
    points = max(2, round(TRIES ** (1.0 / max(len(stiff), 1))))
    axes = [np.linspace(*ends, points) for ends in zip(prior.lower, prior.upper, strict=True)]
    for x in np.array(list(product(*axes))):
        effort = pricing.effort(x)
        if effort >= least:
            continue
        tried = prior.controls.copy()
        tried[stiff] = x
        there, outcome = ahead(tried)
        if outcome is not Outcome.SECTION:
            continue
        cost = effort + pricing.price(there)
        if cost < least:
            least, u, end = cost, tried, there
    return u, end


def reachable_turn(scale: Scale, time_to_go: float) -> float:
    """Change of the touchdown angle that the swing foot can still make [rad].

    Args:
        scale: units of the template.
        time_to_go: until the touchdown is due [s].
    """
    rate = AGILITY * scale.factor(RATE_SQUARED)
    return rate * min(max(time_to_go, 0.0), _FORESIGHT * scale.time) ** 2


def reachable_angles(
    rollout: TemplateRollout,
    node: Node,
    sensed: TemplateState,
    report: SectionReport,
    time_to_go: float,
) -> tuple[float, float]:
    """Least and greatest touchdown angle that the swing foot can still land with [rad].

    Args:
        rollout: of the present stride.
        node: of the automaton, the robot's.
        sensed: the robot's state.
        report: of the present stride.
        time_to_go: until the touchdown is due [s].
    """
    planners, u = rollout.planners, report.decision.controls
    change, angle = reachable_turn(rollout.scale, time_to_go), float(u[Slot.TOUCHDOWN_ANGLE])
    most = angle + change
    if node.rear is not None and node.edge(Event.TOUCHDOWN) is not None:
        step = planners.of(report.goal).gait.step_duration
        soonest = min(SOONEST * rollout.scale.time, SOONEST_SHARE * step)
        time = max(min(time_to_go, soonest), _AT_ONCE)
        stiffness = float(u[node.rear])
        most = min(most, touchdown_angle_after(sensed, planners.route.parameters, stiffness, time))
    return min(angle - change, most), most


def choose_all_controls(
    rollout: TemplateRollout,
    node: Node,
    sensed: TemplateState,
    report: SectionReport,
    angles: tuple[float, float],
    cause: Cause,
) -> Decision | None:
    """Decide anew at the section state from which the template would have come to here.

    Where no stride goes on from there, the gait's legs may have led to here from another one.

    Args:
        rollout: of the present stride.
        node: of the automaton, the first one of a stride.
        sensed: the robot's state.
        report: of the present stride.
        angles: least and greatest touchdown angle that the swing foot can still reach [rad].
        cause: of the new decision.

    Returns:
        None where the template cannot have come from a section.
    """
    planner = rollout.planners.of(report.goal)

    def decide(so_far: Array) -> Decision | None:
        z = rollout.backward_to_section(node, so_far, sensed)
        if z is None:
            return None
        return decided(planner.decide, Context(z, report.goal.target, angles, cause))

    decision = decide(report.decision.controls)
    if decision is not None and decision.feasible:
        return decision
    # The template would have flown or sunk with the legs so far; the robot's motors are weaker.
    other = decide(planner.gait.controls)
    return decision if other is None else other


def choose_stiffnesses(
    rollout: TemplateRollout,
    node: Node,
    sensed: TemplateState,
    report: SectionReport,
    cause: Cause,
) -> Decision | None:
    """Let the planner choose the stiffnesses that the rest of the stride depends on.

    Args:
        rollout: of the present stride.
        node: of the automaton, the robot's.
        sensed: the robot's state.
        report: of the present stride.
        cause: of the new decision.

    Returns:
        None of a planner of whole strides.
    """
    free = free_controls(rollout.automaton, node)
    ahead, target = rollout.ahead(node, sensed), report.goal.target
    context = RestContext(ahead, report.decision, target, free, cause=cause)
    return rest_decided(rollout.planners.of(report.goal), context)


def choose_after_touchdown(
    rollout: TemplateRollout, node: Node, sensed: TemplateState, report: SectionReport
) -> Decision | None:
    """Choice of what is still free as a foot lands, from where it did.

    Arguments as for :func:`choose_stiffnesses`.

    Returns:
        None where what was decided holds on.
    """
    decision = choose_stiffnesses(rollout, node, sensed, report, Cause.TOUCHDOWN)
    if decision is not None:
        return decision
    angle = ballistic_touchdown_angle(sensed, rollout.planners.route.parameters)
    start = rollout.automaton.start(report.goal.stride)
    return choose_all_controls(rollout, start, sensed, report, (angle, angle), Cause.TOUCHDOWN)


def choose_on_unexpected_ground(
    rollout: TemplateRollout,
    node: Node,
    sensed: TemplateState,
    report: SectionReport,
    height_error: float,
) -> Decision:
    """The stiffnesses after a foot has landed on ground that is higher or lower than expected.

    Args:
        rollout: of the present stride.
        node: of the automaton, the robot's.
        sensed: the robot's state.
        report: of the present stride.
        height_error: of the ground over the other foot's [m].
    """
    planner = rollout.planners.of(report.goal)
    free = free_controls(rollout.automaton, node)
    nominal, ahead = planner.gait.controls, rollout.ahead(node, sensed)
    target = report.target[: len(report.goal.target)]
    # After a step up the end nearest to the gait is the best: three steps later the walk is
    # back. The cheapest one goes on with a stride of half the speed.
    price = planner.cost if height_error < 0.0 else None
    return choose_legs(ahead, report.decision, target, free, nominal, rollout.scale, price)


def choose_assist(
    rollout: TemplateRollout, node: Node, sensed: TemplateState, report: SectionReport
) -> None:
    """Let the template run on with the assist that its step needs from here.

    For the speed at the step's end, where a foot has landed off: near a symmetric gait neither the
    touchdown angle nor a stiffness changes it. Forces of two feet do, as the assist of a template
    on a slope.

    Args:
        rollout: of the present stride; it keeps the assist until it stands on other ground.
        node: of the automaton, the robot's.
        sensed: the robot's state.
        report: of the present stride.
    """
    bound = _ASSIST * rollout.scale.factor(ACCELERATION)
    gait: Gait = rollout.planners.of(report.goal).gait
    ground, left_alone = rollout.ground, uncontrolled(gait)
    controls = report.decision.controls

    def drift(change: float) -> float | None:
        """Of the step with another assist, as a forward speed [m/s]; None if it does not end."""
        rollout.set_ground(replace(ground, assist=ground.assist + change))
        end, outcome = rollout.ahead(node, sensed)(controls)
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
