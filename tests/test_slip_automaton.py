"""The automaton's tables: Fig. 2 and Table I, whole and consistent."""

import numpy as np
import pytest

from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.tables import TABLES
from template_control.slip.automaton.vocabulary import Event, Outcome, Phase, Reset


def path(start, events):
    """Names of the nodes that ``events`` lead through from ``start``."""
    names = [start]
    for event in events:
        names.append(AUTOMATON.successor(names[-1], event))
    return names


def test_walking_cycle_is_that_of_section_two():
    assert path(
        STRIDE_START["w"],
        [Event.TOUCHDOWN, Event.VIRTUAL_BOTTOM, Event.REAR_LIFTOFF, Event.VLO],
    ) == ["SS_av^w", "DS_sc^w", "DS_sd^w", "SS_bv^w", "SS_av^w"]


def test_running_cycle_is_that_of_section_two():
    assert path(
        STRIDE_START["r"], [Event.TOUCHDOWN, Event.BOTTOM, Event.REAR_LIFTOFF, Event.APEX]
    ) == ["F_aa^r", "SS_sc^r", "SS_sd^r", "F_ba^r", "F_aa^r"]


def test_walk_to_run_stride_follows_equation_40():
    events = [
        Event.TOUCHDOWN,
        Event.VIRTUAL_BOTTOM,
        Event.REAR_LIFTOFF,
        Event.BOTTOM,
        Event.REAR_LIFTOFF,
        Event.APEX,
    ]
    assert path(STRIDE_START["wr"], events)[-1] == STRIDE_START["r"]


def test_run_to_walk_stride_follows_equation_43():
    events = [Event.TOUCHDOWN, Event.BOTTOM, Event.VLO]
    assert path(STRIDE_START["rw"], events)[-1] == STRIDE_START["w"]


@pytest.mark.parametrize("node", AUTOMATON.nodes, ids=lambda n: n.name)
def test_legs_match_the_phase(node):
    legs = (node.rear is not None) + (node.front is not None)
    assert legs == {Phase.F: 0, Phase.SS: 1, Phase.DS: 2}[node.phase]
    for edge in node.edges:
        if isinstance(edge.target, Outcome):
            assert edge.target is not Outcome.SECTION
            continue
        if node.name.endswith("*"):
            continue  # the simplified stride forgets a leg that still stands
        target = AUTOMATON.node(edge.target)
        change = {Reset.PLACE_REAR: 1, Reset.PLACE_FRONT: 1, Reset.SHIFT: -1}.get(edge.reset, 0)
        if node.phase is Phase.SS and target.phase is Phase.F:
            change = -1
        order = [Phase.F, Phase.SS, Phase.DS]
        assert order.index(target.phase) - order.index(node.phase) == change


def test_unknown_successor_is_refused():
    with pytest.raises(KeyError, match="VLO leads nowhere from F_aa"):
        AUTOMATON.successor("F_aa^r", Event.VLO)


def test_tables_repeat_the_nodes():
    assert TABLES.first_edge[-1] == sum(len(n.edges) for n in AUTOMATON.nodes)
    for i, node in enumerate(AUTOMATON.nodes):
        rows = slice(TABLES.first_edge[i], TABLES.first_edge[i + 1])
        assert list(TABLES.event[rows]) == [e.event for e in node.edges]
        ends = [isinstance(e.target, Outcome) or e.section for e in node.edges]
        assert list(TABLES.outcome[rows] >= 0) == ends
    assert np.all(TABLES.target < len(AUTOMATON.nodes))
