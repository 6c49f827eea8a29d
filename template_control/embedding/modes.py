"""Modes of the robot: nodes of the automaton, and the guards that end them.

The geometric guards are the template's own functions, evaluated at the robot's CoM and feet.
Touchdown is felt. Liftoff happens where the template lifts off (its beta_l) or in a predefined
direction (both of Section V-B).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import Range
from template_control.compiled import compiled, unfused
from template_control.embedding.phases import Clock, PhaseControl, Phases, phase_control
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Event, Leg, Phase, Reset
from template_control.slip.dynamics.guards import guard
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, tuned
from template_control.structured import structure
from template_control.whole_body.stack import TaskStack

PLACED = {Reset.PLACE_REAR: Leg.REAR, Reset.PLACE_FRONT: Leg.FRONT}
"""The leg that a reset puts on the ground."""

# Shortest time in the air, over sqrt(l0 / g). An earlier contact is the foot that scuffs.
_SHORTEST_SWING = 0.3
# A foot that is not in front of the CoM lands this long before its touchdown is due at the earliest
# [s, of the reference template]. An earlier contact is one that scuffs.
_EARLIEST = 0.05
# Share of l0. A rear leg that is longer than l0 by it is let go, whatever the path says.
_OVERSTRETCH = 0.03


@dataclass(frozen=True)
class GuardOptions(Checked):
    """Touchdown and liftoff, by contacts that are believed.

    Attributes:
        liftoff_angle: direction beta from the rear foot to the CoM [rad, from forward
            horizontal] at which that foot lifts off; beta decreases from pi to 0 as the robot
            moves forward. None: "at the same configuration (namely, the same beta_l) as that
            of SLIP", Fig. 13(b); an angle: "the leg lifts off at a predefined configuration",
            whatever the template does, Fig. 13(c).

    Raises:
        ParameterError: if the angle is not between 0 and pi.
    """

    liftoff_angle: Annotated[float, Range(0.0, np.pi, above=True, below=True)] | None = tuned(None)


_OTHER_LEG = (Reset.PLACE_FRONT, Reset.SHIFT, Reset.SWAP)
_MOST_EDGES = 8  # of a node, to other nodes

GUARDS = structure(
    rest_length=float,  # l0 [m]
    liftoff_angle=float,  # of the options [rad]; NaN: the template's
    shortest_swing=float,  # [s]
    earliest=float,  # touchdown behind the CoM before it is due [s]
    overstretch=float,  # of a rear leg that is let go [m]
)
"""Constants of the robot's guards."""

# The template's may fuse a product with a sum. Here its sign alone decides, the same one as in
# Python.
_value = unfused(guard)

_TOUCHDOWN, _REAR_LIFTOFF = int(Event.TOUCHDOWN), int(Event.REAR_LIFTOFF)
_FRONT_LIFTOFF, _REST, _VLO = int(Event.FRONT_LIFTOFF), int(Event.REST), int(Event.VLO)


@compiled
def fired(
    g: Any, edge: tuple[int, int], s: Any, f: Any, contact: NDArray[np.uint8], time_to_go: float
) -> bool:
    """True if the event of an edge, which may put a leg on the ground, has happened.

    ``g`` is of ``GUARDS``, ``s`` of ``SENSED``, ``f`` of ``FEET``; ``contact`` (2,) says whether
    each foot stands, ``time_to_go`` is until the template's path comes to that event [s].
    """
    event, leg = edge
    if event == _TOUCHDOWN:
        foot = f.roles[leg]
        if not contact[foot] or f.swing_time[foot] <= g.shortest_swing:
            return False
        return s.toes[leg] > s.state[0] or time_to_go <= g.earliest
    if event in (_FRONT_LIFTOFF, _REST):
        return time_to_go <= 0.0
    value = _value(event, s.state, s.toes, g.rest_length, 0.0)
    if event != _REAR_LIFTOFF:
        return value >= 0.0
    if value > g.overstretch:
        return True
    if value > 0.0 and time_to_go == np.inf:
        return True  # the template's leg would not push any more
    if np.isnan(g.liftoff_angle):
        return time_to_go <= 0.0
    return np.arctan2(s.state[1], s.state[0] - s.toes[0]) <= g.liftoff_angle


@compiled
def first_fired(tick: Any) -> int:
    """Number of the first edge of the mode that the robot fires; -1: none.

    ``tick`` is (1,) of ``TICK``.
    """
    t = tick[0]
    g, mode, s = t.guards, t.mode, t.sensed
    for i in range(mode.edges):
        event = mode.event[i]
        due = t.path.event_times[event] - t.path.time
        if fired(g, (event, mode.placed[i]), s, t.feet, t.contacts.standing, due):
            return i
        if mode.passed[i] and _value(_VLO, s.state, s.toes, g.rest_length, 0.0) >= 0.0:
            return i
    return -1


def set_guards(data: Any, parameters: SlipParameters, options: GuardOptions) -> None:
    """Write the constants of the guards of a template's robot into ``data`` (1,)."""
    p, angle = parameters, options.liftoff_angle
    data["rest_length"] = p.rest_length
    data["liftoff_angle"] = np.nan if angle is None else angle
    data["shortest_swing"] = _SHORTEST_SWING * np.sqrt(p.rest_length / p.gravity)
    data["earliest"] = _EARLIEST * Scale.of(p).time
    data["overstretch"] = _OVERSTRETCH * p.rest_length


_FLAGS = ("momentum_speed", "rolling_contact", "trim_momentum", "follow_curve", "settles")
MODE = structure(
    node=np.int64,  # its number on the automaton
    stances=np.int64,  # legs that carry: the rear one, or both
    swings=np.int64,  # legs in the air that have a foothold to go to
    swing_leg=(np.int64, (2,)),  # which
    next_touchdown_leg=np.int64,  # the leg that is to touch down; -1: none
    edges=np.int64,  # to other nodes
    event=(np.int64, (_MOST_EDGES,)),  # of each
    placed=(np.int64, (_MOST_EDGES,)),  # the leg that each puts on the ground; -1: none
    passed=(np.int64, (_MOST_EDGES,)),  # whether each has been taken where VLO has come
    by_direction=np.int64,  # whether the clock is the direction of the CoM, not the time
    **dict.fromkeys(_FLAGS, np.int64),  # of the phase's entry in the table
    estimate_load=np.int64,  # and a task gives the feedback
    unloads=(np.int64, (2,)),  # whether each leg has its normal force kept near the template's
    unloading=float,  # time over which it gives its load up before it lifts off [s]; 0: none
)
"""A mode, as compiled code reads it."""


@dataclass(frozen=True)
class Mode:
    """Mode of the robot: a node of the automaton with all that the controller looks up for it."""

    node: Node
    control: PhaseControl
    tasks: TaskStack
    outgoing_edges: tuple[Edge, ...]  # to other nodes, in order
    trimmed: bool  # the momentum trim acts somewhere in the stride
    data: Any  # of ``MODE``


def _mode(node: Node, automaton: Automaton, control: PhaseControl, nv: int, trimmed: bool) -> Mode:
    """The mode of an automaton's node."""
    touchdown, tasks = node.edge(Event.TOUCHDOWN), TaskStack(control.tasks, nv)
    edges = tuple(edge for edge in node.edges if isinstance(edge.target, str))
    if len(edges) > _MOST_EDGES:
        raise ParameterError(
            f"node {node.name} has {len(edges)} edges to other nodes: give at most {_MOST_EDGES}"
        )
    data = np.zeros(1, MODE)[0]
    data["node"] = automaton.index[node.name]
    data["stances"], data["swings"], data["edges"] = map(len, (node.stance, control.swings, edges))
    data["swing_leg"][: len(control.swings)] = control.swings
    data["next_touchdown_leg"] = -1 if touchdown is None else PLACED[touchdown.reset]
    for i, edge in enumerate(edges):
        data["event"][i], data["placed"][i] = edge.event, PLACED.get(edge.reset, -1)
        then = automaton.nodes[automaton.index[str(edge.target)]]
        # At the bottom of a leg that is let go soon the robot's guard may graze zero.
        data["passed"][i] = edge.reset is Reset.NONE and then.edge(Event.VLO) is not None
    data["by_direction"] = control.clock is Clock.DIRECTION
    for flag in _FLAGS:
        data[flag] = getattr(control, flag)
    data["estimate_load"] = control.estimate_load and tasks.follows_com
    data["unloads"][list(control.unload_legs)] = 1
    data["unloading"] = control.unloading
    return Mode(node, control, tasks, edges, trimmed, data)


def check_legs(automaton: Automaton, robot: Biped) -> None:
    """Check that a robot with one leg has gaits of the rear leg alone; a ParameterError if not."""
    if all(robot.groups):
        return
    for node in automaton.nodes:
        if node.front is not None or any(edge.reset in _OTHER_LEG for edge in node.edges):
            raise ParameterError(
                f"{robot.name} has one leg, and node {node.name} of the automaton wants two: give"
                " an automaton whose gaits have the rear leg alone"
            )


def modes(automaton: Automaton, nv: int, phases: Phases) -> dict[str, Mode]:
    """A mode for each node, by its name, for a robot with ``nv`` degrees of freedom.

    ``phases`` may have entries for nodes of the library's automaton, whatever ``automaton`` is. A
    ParameterError if a node has no entry, or an entry is for no node.
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
        if any(phase_control(phases, other).trim_momentum for other in automaton.stride(start))
        for node in automaton.stride(start)
    }
    return {
        node.name: _mode(node, automaton, phase_control(phases, node), nv, node.name in trimmed)
        for node in automaton.nodes
    }
