"""What two legs give or take where a foot has landed off, for the speed at the step's end.

Near a symmetric gait neither the touchdown angle nor a stiffness changes the speed. Forces of two
feet do, as the assist of a template on a slope.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from template_control.embedding.learners.momentum_trim import uncontrolled
from template_control.embedding.planning.rest_of_stride import RestOfStride
from template_control.embedding.section_report import SectionReport
from template_control.embedding.sensing import Sensed
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Outcome
from template_control.slip.gaits.gait import Gait

_ROUNDS = 3  # of interpolation


def steady(
    rest: RestOfStride, node: Node, sensed: Sensed, report: SectionReport, bound: float
) -> None:
    """Let the template run on with the assist that its step needs from here.

    Args:
        rest: of the present stride; it keeps the assist until it stands on other ground.
        node: of the automaton, the robot's.
        sensed: the robot's state.
        report: of the present stride.
        bound: of the change of the assist [m/s^2].
    """
    gait: Gait = rest.planners.of(report.goal).gait
    ground, left_alone = rest.ground, uncontrolled(gait)
    controls = report.decision.controls

    def drift(change: float) -> float | None:
        """Of the step with another assist, as a forward speed [m/s]; None if it does not end."""
        rest.stand_on(replace(ground, assist=ground.assist + change))
        end, outcome = rest.ahead(node, sensed)(controls)
        return float(left_alone @ (end - gait.state)) if outcome is Outcome.SECTION else None

    rest.stand_on(replace(ground, assist=ground.assist + _change(drift, bound)))


def _change(drift: Callable[[float], float | None], bound: float) -> float:
    """Where the drift is zero by the rule of false position, or as small as the bound allows."""
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
