"""A node of the automaton with all that the controller looks up for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.guards import PLACED
from template_control.embedding.phases import PhaseControl, Phases, phase_control
from template_control.embedding.references.swing_foot import SwingOptions
from template_control.embedding.references.template_path import LOCATE, Locate
from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Event, Leg, Phase
from template_control.whole_body.task import TaskStack
from template_control.whole_body.tasks import ComTask

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Station:
    """Where the robot is on the automaton, and what that asks for.

    Attributes:
        node: the automaton's node.
        control: the phase's entry in the table.
        tasks: the rows of the phase's tasks.
        com: the task that follows the template's CoM; None where there is none.
        ways: edges to other nodes, in order.
        stance: legs that carry.
        swings: legs in the air that have a foothold to go to.
        swing: shape of their swings; None: the robot's.
        locate: finds the robot's place on the path.
        cap: (len(stance),) largest normal force of each stance foot, inf without [N]; the
            controller overwrites those of the legs that unload.
        awaited: the leg that is to touch down; None where none is.
        trimmed: whether the momentum trim acts somewhere in the stride.
    """

    node: Node
    control: PhaseControl
    tasks: TaskStack
    com: ComTask | None
    ways: tuple[Edge, ...]
    stance: tuple[int, ...]
    swings: tuple[int, ...]
    swing: SwingOptions | None
    locate: Locate
    cap: Array
    awaited: Leg | None
    trimmed: bool


def stations(automaton: Automaton, nv: int, phases: Phases) -> dict[str, Station]:
    """Make a station for each node, by its name.

    Args:
        automaton: whose nodes.
        nv: degrees of freedom of the robot.
        phases: what the controller does in each phase. Entries for nodes of the library's
            automaton may stand in it, whatever ``automaton`` is.

    Raises:
        ParameterError: if a node has no entry, or an entry is for no node.
    """
    known = {*automaton.index, *AUTOMATON.index}
    strangers = [key for key in phases if key not in known and key not in list(Phase)]
    if strangers:
        raise ParameterError(
            f"the phases have an entry for {strangers[0]!r}, which is no node and no Phase: nodes"
            f" are {', '.join(automaton.index)}"
        )
    trimmed = {
        node.name
        for start in automaton.starts.values()
        if any(phase_control(phases, other).trims for other in automaton.stride(start))
        for node in automaton.stride(start)
    }
    found = {}
    for node in automaton.nodes:
        control = phase_control(phases, node)
        touchdown = node.edge(Event.TOUCHDOWN)
        found[node.name] = Station(
            node=node,
            control=control,
            tasks=TaskStack(control.tasks, nv),
            com=next((task for task in control.tasks if isinstance(task, ComTask)), None),
            ways=tuple(edge for edge in node.edges if isinstance(edge.target, str)),
            # Plain numbers: an enumeration's members are slow to index with.
            stance=tuple(int(leg) for leg in node.stance),
            swings=tuple(int(leg) for leg in control.swings),
            swing=control.swing,
            locate=LOCATE[control.clock],
            cap=np.full(len(node.stance), np.inf),
            awaited=PLACED[touchdown.reset] if touchdown is not None else None,
            trimmed=node.name in trimmed,
        )
    return found
