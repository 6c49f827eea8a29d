"""Modes of the robot: nodes of the automaton, the guards that end them, the phase in them.

The geometric guards are the template's own functions, evaluated at the robot's CoM and feet.
Touchdown is felt. Liftoff happens where the template lifts off (its beta_l) or in a predefined
direction (both of Section V-B).

The legs' swing makes the robot's CoM run ahead of the template and fall back behind it within
a step, while its angular momentum about the foot, on which all forces depend, stays the
template's. So in stance the phase is that of a point that moves with dx/dt + L / (m y), L the
angular momentum about the CoM: it starts in the CoM at every plan, and leads or lags it by
centimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.ranges import Range
from template_control.compiled import compiled, unfused
from template_control.embedding.com_path import at_direction, leg_forces, sample
from template_control.embedding.phases import Clock, PhaseControl, Phases, phase_control
from template_control.embedding.rollout import ReplanOptions
from template_control.embedding.supervisor import StrideSupervisor
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import (
    NUM_EVENTS,
    Event,
    Leg,
    Phase,
    Reset,
    Slot,
)
from template_control.slip.dynamics.guards import guard
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, tuned
from template_control.structured import Number
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


_F, _I = np.float64, np.int64
_OTHER_LEG = (Reset.PLACE_FRONT, Reset.SHIFT, Reset.SWAP)
_MOST_EDGES = 8  # of a node, to other nodes

GUARDS = np.dtype(
    [
        ("rest_length", _F),  # l0 [m]
        ("liftoff_angle", _F),  # of the options [rad]; NaN: the template's
        ("shortest_swing", _F),  # [s]
        ("earliest", _F),  # touchdown behind the CoM before it is due [s]
        ("overstretch", _F),  # of a rear leg that is let go [m]
    ],
    align=True,
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
    """True if an edge's event has happened.

    Args:
        g: of ``GUARDS``.
        edge: its event, and the leg that it puts on the ground.
        s: of :data:`~.state.SENSED`.
        f: of :data:`~.swing.FEET`.
        contact: (2,) whether each foot stands.
        time_to_go: time until the template's path comes to that event [s].
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
def first_fired(g: Any, mode: Any, path: Any, s: Any, f: Any, c: Any) -> int:
    """Number of the first edge of a mode that the robot fires; -1: none.

    ``mode`` is of ``MODE``, ``path`` of ``PATH``, ``c`` of :data:`~.contacts.CONTACTS`; the rest as
    for :func:`fired`.
    """
    for i in range(mode.edges):
        event = mode.event[i]
        due = path.event_times[event] - path.time
        if fired(g, (event, mode.placed[i]), s, f, c.standing, due):
            return i
        if mode.passed[i] and _value(_VLO, s.state, s.toes, g.rest_length, 0.0) >= 0.0:
            return i
    return -1


def set_guards(data: Any, parameters: SlipParameters, options: GuardOptions) -> None:
    """Write the constants of the guards of a template's robot into ``data``, of ``GUARDS``."""
    p, angle = parameters, options.liftoff_angle
    data["rest_length"] = p.rest_length
    data["liftoff_angle"] = np.nan if angle is None else angle
    data["shortest_swing"] = _SHORTEST_SWING * np.sqrt(p.rest_length / p.gravity)
    data["earliest"] = _EARLIEST * Scale.of(p).time
    data["overstretch"] = _OVERSTRETCH * p.rest_length


def _numbered(edge: Edge) -> tuple[int, int]:
    """Event of an edge, and the leg that it puts on the ground; -1: none."""
    return int(edge.event), int(PLACED.get(edge.reset, -1))


MODE = np.dtype(
    [
        ("node", _I),  # its number on the automaton
        ("stances", _I),  # legs that carry: the rear one, or both
        ("swings", _I),  # legs in the air that have a foothold to go to
        ("swing_leg", _I, (2,)),  # which
        ("next_touchdown_leg", _I),  # the leg that is to touch down; -1: none
        ("edges", _I),  # to other nodes
        ("event", _I, (_MOST_EDGES,)),  # of each
        ("placed", _I, (_MOST_EDGES,)),  # the leg that each puts on the ground; -1: none
        ("passed", _I, (_MOST_EDGES,)),  # whether each has been taken where VLO has come
        ("by_direction", _I),  # whether the clock is the direction of the CoM, not the time
        ("momentum_speed", _I),  # flags of the phase's entry in the table
        ("rolling_contact", _I),
        ("trim_momentum", _I),
        ("follow_curve", _I),
        ("settles", _I),
        ("estimate_load", _I),  # and a task gives the feedback
        ("unloads", _I, (2,)),  # whether each leg has its normal force kept near the template's
        ("unloading", _F),  # time over which it gives its load up before it lifts off [s]; 0: none
    ],
    align=True,
)
"""A mode, as compiled code reads it."""


@dataclass(frozen=True)
class Mode:
    """Mode of the robot: a node of the automaton with all that the controller looks up for it.

    ``outgoing_edges`` lead to other nodes, in order. ``stance`` are legs that carry, ``swings``
    legs in the air that have a foothold to go to. ``trimmed``: the momentum trim acts somewhere in
    the stride. ``data`` is of ``MODE``.
    """

    node: Node
    control: PhaseControl
    tasks: TaskStack
    outgoing_edges: tuple[Edge, ...]
    stance: tuple[int, ...]
    swings: tuple[int, ...]
    trimmed: bool
    data: Any


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
        data["event"][i], data["placed"][i] = _numbered(edge)
        then = automaton.nodes[automaton.index[str(edge.target)]]
        # At the bottom of a leg that is let go soon the robot's guard may graze zero.
        data["passed"][i] = edge.reset is Reset.NONE and then.edge(Event.VLO) is not None
    data["by_direction"] = control.clock is Clock.DIRECTION
    flags = ("momentum_speed", "rolling_contact", "trim_momentum", "follow_curve", "settles")
    for name in flags:
        data[name] = getattr(control, name)
    data["estimate_load"] = control.estimate_load and tasks.follows_com
    data["unloads"][list(control.unload_legs)] = 1
    data["unloading"] = control.unloading
    return Mode(
        node=node,
        control=control,
        tasks=tasks,
        outgoing_edges=edges,
        # Plain numbers: an enumeration's members are slow to index with.
        stance=tuple(int(leg) for leg in node.stance),
        swings=tuple(int(leg) for leg in control.swings),
        trimmed=trimmed,
        data=data,
    )


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

    Entries for nodes of the library's automaton may stand in ``phases``, whatever ``automaton`` is.
    A ParameterError if a node has no entry, or an entry is for no node.
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


PATH = np.dtype(
    [
        # -- the robot's place on it --
        ("time", _F),  # along the path [s]
        ("offset", _F),  # of the point whose direction is the phase, ahead of the CoM [m]
        ("fresh", _I),  # whether the path begins at this tick
        ("forces", _F, (2, 2)),  # leg forces of the template there, rear and front [N]
        # -- the plan, written when it changes --
        # m, g towards the ground and back along it, l0, assist of two legs, half a foot's length
        ("body", _F, (6,)),
        ("event_times", _F, (NUM_EVENTS,)),  # of each event's next occurrence [s]; inf: none
        ("landing_x", _F, (2,)),  # of each foot's next foothold [m]; NaN: none
        ("landing_time", _F, (2,)),  # [s]; inf: never
        ("toe", _F),  # x of the template's rear toe [m]
        ("touchdown_angle", _F),  # of the stride [rad]
        ("step_length", _F),  # of the planner's gait [m]
        ("step_duration", _F),  # of it [s]
        ("planned_at", _F),  # when the path began [s]
        ("viable", _I),  # whether the template completes the path's strides
        ("without_touchdown", _I),  # whether an overdue touchdown has been taken off the path
        # -- when it is planned anew --
        ("patience", _F),  # with a touchdown [s]
        ("interval", _F),  # between plans [s]
        ("speed", _F),  # deviation of the forward speed [m/s]
    ],
    align=True,
)
"""The path, and the robot's place on it."""


@compiled
def move_clock(
    path: Any, curve: tuple[Array, Array, Array], s: Any, mode: Any, want: Any, motion: Array
) -> None:
    """Go on along the path to where the robot is now.

    ``path``, of ``PATH``, is overwritten, and so is ``com`` of ``want``, of ``REFERENCES``; ``s``
    is of :data:`~.state.SENSED`, ``mode`` of ``MODE``. ``motion`` is dx/dt of the CoM [m/s], and
    the time since the last tick [s].
    """
    speed, dt = motion
    coefficients, meta, look = curve
    x, y = s.state[0] + path.offset - s.toes[0], s.state[1]
    # Since the last tick, unless the path begins at this one. A direction needs a guess only.
    guess = path.time + (0.0 if path.fresh and not mode.by_direction else dt)
    path.fresh = 0
    if mode.by_direction:
        path.time, row = at_direction(coefficients, meta, look, x, y, guess, want.com)
    else:
        path.time, row = guess, sample(coefficients, meta, look, guess, want.com)
    path.offset += (s.state[2] - speed) * dt
    toe, forces = look[0], path.forces
    leg_forces(meta[row], toe, want.com, path.body, forces)
    if meta[row, 3] != toe:
        # Template and robot are on either side of liftoff: to each foot its own force.
        for axis in range(2):
            forces[0, axis], forces[1, axis] = forces[1, axis], forces[0, axis]


@compiled
def plan_is_due(path: Any, mode: Any, speed: float, reference: float, now: float) -> bool:
    """True if the supervisor is to be asked for a new plan, at the time ``now`` [s].

    ``path`` is of ``PATH``, ``mode`` of ``MODE``; ``speed`` is forward, as the phase senses it,
    ``reference`` the path's [m/s].
    """
    if path.without_touchdown:
        return False
    late = path.time > path.event_times[_TOUCHDOWN] + path.patience
    if late and mode.next_touchdown_leg >= 0:
        return True
    if now - path.planned_at <= path.interval:
        return False
    off = abs(speed - reference) > path.speed and path.time > path.interval
    return off or not path.viable


class PathClock:
    """Place of the robot on the path; it persists from tick to tick.

    ``time`` is along the path [s]. Ticks write ``reference`` (6,), the template's CoM x (relative
    to its rear toe), y, and two derivatives; ``forces`` (2, 2) are its leg forces there [N], rear
    and front. ``data`` (1,) are of ``PATH``, ``half_length`` is a foot's [m].
    """

    time = Number("time")

    def __init__(
        self,
        parameters: SlipParameters,
        options: ReplanOptions,
        reference: Array,
        data: Any,
        half_length: float,
    ) -> None:
        self.reference, self.data = reference, data
        self.forces: Array = data["forces"][0]
        self._body: Array = data["body"][0]
        self._body[0], self._body[3] = parameters.mass, parameters.rest_length
        self._body[5] = half_length
        for name in ("patience", "interval", "speed"):
            data[name] = getattr(options, name)
        self.restart()

    def restart(self) -> None:
        """A new path starts where the robot is."""
        for name, value in (("time", 0.0), ("offset", 0.0), ("fresh", 1)):
            self.data[name] = value

    def take(self, supervisor: StrideSupervisor) -> None:
        """Take what the supervisor has planned, whose path is followed."""
        now, s = self.data[0], supervisor
        gait, controls = s.planner.gait, s.decision.controls
        now["event_times"] = s.event_times
        for foot in range(2):
            now["landing_x"][foot], now["landing_time"][foot] = s.landing(foot)
        now["toe"] = s.toe
        now["touchdown_angle"] = controls[Slot.TOUCHDOWN_ANGLE]
        now["step_length"], now["step_duration"] = gait.step_length, gait.step_duration
        now["planned_at"], now["viable"] = s.planned_at, s.viable
        now["without_touchdown"] = s.without_touchdown
        self._body[1:3], self._body[4] = s.ground.gravity_parts, s.ground.assist
