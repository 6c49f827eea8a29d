"""The automaton's tables: Fig. 2 and Table I, whole and consistent."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import (
    MAX_EDGES,
    Event,
    Leg,
    Outcome,
    Phase,
    Reset,
    Slot,
    StrideKind,
)
from template_control.slip.dynamics.stride import StrideSimulator, controls, simulate_stride
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import APEX
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.scenario import example_one
from template_control.slip.scenario.scenario_route import ScenarioRoute

HOP = Automaton(
    (
        Node("F_aa^h", Phase.F, None, None, (Edge(Event.TOUCHDOWN, "SS_sc^h", Reset.PLACE_REAR),)),
        Node("SS_sc^h", Phase.SS, Slot.K_SC, None, (Edge(Event.BOTTOM, "SS_sd^h"),)),
        Node(
            "SS_sd^h",
            Phase.SS,
            Slot.K_SD,
            None,
            (Edge(Event.REAR_LIFTOFF, "F_ba^h"), Edge(Event.FALL, Outcome.FALL)),
        ),
        Node("F_ba^h", Phase.F, None, None, (Edge(Event.APEX, "F_aa^h", section=True),)),
    ),
    {"h": "F_aa^h"},
)
"""Hopping on one leg: running without a change of legs."""


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
    # A double stance without springs follows a curve.
    assert legs in {Phase.F: {0}, Phase.SS: {1}, Phase.DS: {0, 2}}[node.phase]
    for edge in node.edges:
        if isinstance(edge.target, Outcome):
            assert edge.target is not Outcome.SECTION
            continue
        if node.name.endswith("*"):
            continue  # the simplified stride forgets a leg that still stands
        target = AUTOMATON.node(edge.target)
        change = {Reset.PLACE_REAR: 1, Reset.PLACE_FRONT: 1, Reset.SHIFT: -1}.get(edge.reset, 0)
        lifts_ahead = edge.event is Event.FRONT_LIFTOFF
        if lifts_ahead or (node.phase is Phase.SS and target.phase is Phase.F):
            change = -1
        order = [Phase.F, Phase.SS, Phase.DS]
        assert order.index(target.phase) - order.index(node.phase) == change


def test_unknown_successor_is_refused():
    with pytest.raises(KeyError, match="VLO leads nowhere from F_aa"):
        AUTOMATON.successor("F_aa^r", Event.VLO)


@pytest.mark.parametrize("automaton", [AUTOMATON, HOP], ids=["library", "hop"])
def test_tables_repeat_the_nodes(automaton):
    tables = automaton.tables
    assert tables.first_edge[-1] == sum(len(n.edges) for n in automaton.nodes)
    for i, node in enumerate(automaton.nodes):
        rows = slice(tables.first_edge[i], tables.first_edge[i + 1])
        assert list(tables.event[rows]) == [e.event for e in node.edges]
        ends = [isinstance(e.target, Outcome) or e.section for e in node.edges]
        assert list(tables.outcome[rows] >= 0) == ends
    assert np.all(tables.target < len(automaton.nodes))


def test_starts_are_found_and_others_refused():
    assert AUTOMATON.starts == STRIDE_START
    for stride, name in STRIDE_START.items():
        assert AUTOMATON.start(stride).name == name
        assert AUTOMATON.start(stride).gait == stride
    with pytest.raises(ParameterError, match=r"no stride 'trot': give one of w, r, wr, rw, wr\*"):
        AUTOMATON.start("trot")


def test_legs_on_the_ground_are_the_phases():
    stance = {n.phase: n.stance for n in AUTOMATON.nodes}
    assert stance == {Phase.F: (), Phase.SS: (Leg.REAR,), Phase.DS: (Leg.REAR, Leg.FRONT)}


@pytest.mark.parametrize(
    ("start", "before"),
    [
        ("SS_av^w", "SS_bv^w"),
        ("F_aa^r", "F_ba^r"),
        ("SS_av^wr", "SS_bv^w"),
        ("F_aa^rw", "F_ba^r"),
        ("SS_av^wr*", "SS_bv^w"),
    ],
)
def test_the_node_before_a_stride_ends_at_its_section(start, before):
    assert AUTOMATON.before(start).name == before


def test_no_node_is_before_one_within_a_stride():
    with pytest.raises(ParameterError, match=r"no section leads to DS_sc\^w"):
        AUTOMATON.before("DS_sc^w")


def test_legs_change_roles_where_a_flight_begins():
    """The toes are exchanged; the next touchdown places the rear one."""
    parameters, u = SlipParameters(), controls(np.radians(70.0), 26e3, 30e3)
    stride = simulate_stride(parameters, STRIDE_START["r"], APEX.state([4.8, 0.98]), u, (0.0, -1.0))
    resets = [(e.event, e.reset) for e in stride.events]
    assert resets == [
        (Event.TOUCHDOWN, Reset.PLACE_REAR),
        (Event.BOTTOM, Reset.NONE),
        (Event.REAR_LIFTOFF, Reset.SWAP),
        (Event.APEX, Reset.NONE),
    ]
    landed = stride.events[0].state[0] + np.cos(u[Slot.TOUCHDOWN_ANGLE])
    np.testing.assert_allclose(stride.toes, [-1.0, landed])
    taken = {(n.name, e.target) for n in AUTOMATON.nodes for e in n.edges if e.reset is Reset.SWAP}
    expected = {(f"SS_sd^{kind}", f"F_ba^{kind}") for kind in ("r", "wr", "hr")}
    expected |= {("SS_av^wr", "F_aa^wr")}
    assert taken == expected | {("DS_br^sb", "DS_ar^s")}  # and where one has landed behind


def test_another_automaton_needs_nothing_of_the_librarys():
    parameters, u = SlipParameters(), controls(np.radians(70.0), 26e3, 30e3)
    hop, run = ReturnMap(parameters, "h", automaton=HOP), ReturnMap(parameters, "r")
    np.testing.assert_array_equal(hop([4.8, 0.98], u).state, run([4.8, 0.98], u).state)
    with pytest.raises(ParameterError, match="no stride 'w': give one of h"):
        ReturnMap(parameters, "w", automaton=HOP)
    stride = StrideSimulator(parameters, HOP).run("F_aa^h", APEX.state([4.8, 0.98]), u)
    names = dict.fromkeys(stride.nodes(stride.meta[:, 0]))
    assert list(names) == [n.name for n in HOP.nodes]
    assert stride.node == "F_aa^h"
    assert stride.completed


def test_an_automaton_travels_to_other_processes():
    again = pickle.loads(pickle.dumps(AUTOMATON))
    assert again == AUTOMATON
    assert hash(again) == hash(AUTOMATON)


def test_its_starts_are_its_own():
    starts = {"h": "F_aa^h"}
    automaton = Automaton(HOP.nodes, starts)
    starts["h"] = "gone"
    assert automaton.starts == HOP.starts


def changed(name, *edges):
    return tuple(replace(n, edges=edges) if n.name == name else n for n in HOP.nodes)


@pytest.mark.parametrize(
    ("nodes", "starts", "message"),
    [
        (HOP.nodes, {"h": "F_x"}, "stride 'h' starts at F_x, which is no node"),
        ((), {"h": "F_x"}, "stride 'h' starts at F_x, which is no node"),
        (changed("F_aa^h"), {}, r"node F_aa\^h has no way out: give it an edge"),
        (
            changed("F_aa^h", Edge(Event.APEX, "F_x")),
            {},
            r"APEX of node F_aa\^h leads to F_x, which is no node",
        ),
        (
            changed("F_aa^h", Edge(Event.APEX, "F_aa^h"), Edge(Event.APEX, Outcome.FALL)),
            {},
            r"APEX of node F_aa\^h has two edges",
        ),
        (
            changed("F_aa^h", Edge(Event.APEX, Outcome.FALL, section=True)),
            {},
            r"APEX of node F_aa\^h ends at a section",
        ),
        (
            changed("F_aa^h", Edge(Event.APEX, Outcome.SECTION)),
            {},
            r"APEX of node F_aa\^h fails with SECTION",
        ),
        (
            changed("F_aa^h", *(Edge(event, "F_aa^h") for event in Event)),
            {},
            rf"node F_aa\^h has 11 edges: give it at most {MAX_EDGES}",
        ),
        ((*HOP.nodes, HOP.nodes[0]), {}, r"two nodes are called F_aa\^h"),
    ],
)
def test_what_leads_nowhere_is_refused_at_once(nodes, starts, message):
    with pytest.raises(ParameterError, match=message):
        Automaton(nodes, starts)


def test_a_stride_without_a_section_has_no_map():
    endless = Automaton(changed("F_ba^h", Edge(Event.APEX, "F_aa^h")), HOP.starts)
    with pytest.raises(ParameterError, match=r"no section ends a stride from F_aa\^h"):
        ReturnMap(SlipParameters(), "h", automaton=endless)


targets = st.sampled_from(["a", "b", "c", "d", Outcome.FALL, Outcome.SECTION])
edges = st.builds(Edge, st.sampled_from(Event), targets, section=st.booleans())
nodes = st.builds(
    Node,
    st.sampled_from("abc"),
    st.sampled_from(Phase),
    st.none(),
    st.none(),
    st.lists(edges, max_size=3).map(tuple),
)


@given(
    st.lists(nodes, max_size=3).map(tuple),
    st.dictionaries(st.sampled_from("wr"), st.sampled_from("abcd"), max_size=2),
)
def test_what_is_not_refused_can_be_followed(nodes, starts):
    try:
        automaton = Automaton(nodes, starts)
    except ParameterError:
        return
    tables = automaton.tables
    assert np.all((tables.target >= 0) | (tables.outcome > Outcome.SECTION))
    for stride in starts:
        start = automaton.start(stride)
        passed = automaton.stride(start.name)
        for node in passed:
            ways = [e for e in node.edges if isinstance(e.target, str) and not e.section]
            assert all(automaton.node(e.target) in passed for e in ways)
            assert node.edges


def test_the_kinds_of_stride_are_their_keys():
    """Files and users' planners keep the keys; messages show them, and JSON holds them."""
    assert set(StrideKind) == STRIDE_START.keys()
    for kind in StrideKind:
        key = kind.value
        assert (kind, repr(kind), str(kind)) == (key, repr(key), key)
        assert STRIDE_START[kind] == STRIDE_START[key]
        assert json.loads(json.dumps({kind: kind})) == {key: key}
    with pytest.raises(ParameterError, match=r"walks is 'x': give one of 'w', 'wp'$"):
        ScenarioRoute(example_one(), walks="x")
