"""How much of a gait is flight."""

from __future__ import annotations

from template_control.checks.checked import checked
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import Phase
from template_control.slip.dynamics.stride import Stride, simulate_stride
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.section import section_of


@checked
def flight_share(gait: Gait, automaton: Automaton = AUTOMATON) -> float:
    """Share of a stride's duration in which no foot is on the ground.

    Args:
        gait: any whose stride returns to its state.
        automaton: that its stride is of.
    """
    start = automaton.start(gait.stride).name
    section = section_of(automaton.sections(start)[0])
    stride = simulate_stride(
        gait.parameters, start, section.state(gait.state), gait.controls, automaton=automaton
    )
    return flying(stride, automaton)


def flying(stride: Stride, automaton: Automaton = AUTOMATON) -> float:
    """Share of a simulated stride's duration in which no foot is on the ground.

    Args:
        stride: one that was completed.
        automaton: that it is of.
    """
    flies = [node.phase is Phase.F for node in automaton.nodes]
    return float(sum(row[1] for row in stride.meta if flies[int(row[2])]) / stride.duration)
