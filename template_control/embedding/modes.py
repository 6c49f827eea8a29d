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

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import Range
from template_control.embedding.com_path import LOCATE, Locate
from template_control.embedding.leg_forces import leg_forces
from template_control.embedding.phases import Clock, PhaseControl, Phases, phase_control
from template_control.embedding.state import TemplateState
from template_control.embedding.supervisor import StrideSupervisor
from template_control.embedding.swing import SwingOptions
from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Event, Leg, Phase, Reset
from template_control.slip.dynamics.guards import guard
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale, tuned
from template_control.whole_body.task import TaskStack
from template_control.whole_body.tasks import ComTask

Array = NDArray[np.float64]

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


@dataclass(frozen=True)
class RobotGuards:
    """The automaton's guards, as the robot feels them.

    Attributes:
        parameters: the template.
        options: tuning.
    """

    parameters: SlipParameters
    options: GuardOptions

    @cached_property
    def _shortest_time(self) -> float:
        """Of a swing [s]."""
        p = self.parameters
        return float(_SHORTEST_SWING * np.sqrt(p.rest_length / p.gravity))

    @cached_property
    def _earliest(self) -> float:
        """Of a touchdown, before it is due [s]."""
        return _EARLIEST * Scale.of(self.parameters).time

    def fired(self, edge: Edge, sensed: TemplateState, time_to_go: float) -> bool:
        """Whether the edge's event has happened.

        Args:
            edge: a way out of the present node.
            sensed: the robot now.
            time_to_go: time until the template's path comes to that event [s].
        """
        felt = _FELT[edge.event]
        if felt is not None:
            return felt(self, edge, sensed, time_to_go)
        return self._value(edge.event, sensed) >= 0.0

    def _value(self, event: Event, sensed: TemplateState) -> float:
        # In Python, on its own numbers: quicker than passing arrays to compiled code.
        state, toes = sensed.state.tolist(), sensed.toes.tolist()
        return float(guard.py_func(int(event), state, toes, self.parameters.rest_length, 0.0))

    def _touchdown(self, edge: Edge, sensed: TemplateState, time_to_go: float) -> bool:
        leg = PLACED[edge.reset]
        foot = sensed.feet[leg]
        if not sensed.contact[foot] or sensed.swing_time[foot] <= self._shortest_time:
            return False
        return bool(sensed.toes[leg] > sensed.state[0]) or time_to_go <= self._earliest

    def _rear_liftoff(self, edge: Edge, sensed: TemplateState, time_to_go: float) -> bool:
        stretch = self._value(edge.event, sensed)
        if stretch > _OVERSTRETCH * self.parameters.rest_length:
            return True
        if stretch > 0.0 and time_to_go == np.inf:
            return True  # the template's leg would not push any more
        angle = self.options.liftoff_angle
        if angle is None:
            return time_to_go <= 0.0
        beta = np.arctan2(sensed.state[1], sensed.state[0] - sensed.toes[0])
        return bool(beta <= angle)

    def _due(self, edge: Edge, sensed: TemplateState, time_to_go: float) -> bool:
        return time_to_go <= 0.0


_NOT_GEOMETRIC: dict[Event, Callable[[RobotGuards, Edge, TemplateState, float], bool]] = {
    Event.TOUCHDOWN: RobotGuards._touchdown,
    Event.REAR_LIFTOFF: RobotGuards._rear_liftoff,
    Event.FRONT_LIFTOFF: RobotGuards._due,
    Event.REST: RobotGuards._due,
}
_FELT = [_NOT_GEOMETRIC.get(event) for event in Event]
"""By Event: how the robot feels what it does not read off the template's geometry."""


@dataclass(frozen=True)
class Mode:
    """Mode of the robot: a node of the automaton with all that the controller looks up for it.

    Attributes:
        node: the automaton's node.
        control: the phase's entry in the table.
        tasks: the rows of the phase's tasks.
        com: the task that follows the template's CoM; None where there is none.
        outgoing_edges: edges to other nodes, in order.
        stance: legs that carry.
        swings: legs in the air that have a foothold to go to.
        swing: shape of their swings; None: the robot's.
        locate: finds the robot's place on the path.
        cap: (len(stance),) largest normal force of each stance foot, inf without [N]; the
            controller overwrites those of the legs that unload.
        next_touchdown_leg: the leg that is to touch down; None where none is.
        trimmed: whether the momentum trim acts somewhere in the stride.
    """

    node: Node
    control: PhaseControl
    tasks: TaskStack
    com: ComTask | None
    outgoing_edges: tuple[Edge, ...]
    stance: tuple[int, ...]
    swings: tuple[int, ...]
    swing: SwingOptions | None
    locate: Locate
    cap: Array
    next_touchdown_leg: Leg | None
    trimmed: bool


def modes(automaton: Automaton, nv: int, phases: Phases) -> dict[str, Mode]:
    """A mode for each node, by its name.

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
        if any(phase_control(phases, other).trim_momentum for other in automaton.stride(start))
        for node in automaton.stride(start)
    }
    found = {}
    for node in automaton.nodes:
        control = phase_control(phases, node)
        touchdown = node.edge(Event.TOUCHDOWN)
        found[node.name] = Mode(
            node=node,
            control=control,
            tasks=TaskStack(control.tasks, nv),
            com=next((task for task in control.tasks if isinstance(task, ComTask)), None),
            outgoing_edges=tuple(edge for edge in node.edges if isinstance(edge.target, str)),
            # Plain numbers: an enumeration's members are slow to index with.
            stance=tuple(int(leg) for leg in node.stance),
            swings=tuple(int(leg) for leg in control.swings),
            swing=control.swing,
            locate=LOCATE[control.clock],
            cap=np.full(len(node.stance), np.inf),
            next_touchdown_leg=PLACED[touchdown.reset] if touchdown is not None else None,
            trimmed=node.name in trimmed,
        )
    return found


class PathClock:
    """Place of the robot on the path; it persists from tick to tick.

    Args:
        parameters: the template.
        reference: (6,) which is overwritten.

    Attributes:
        time: along the path [s].
        offset: the point whose direction is the phase is this far ahead of the CoM [m].
        reference: (6,) template CoM x (relative to its rear toe), y, and two derivatives.
        forces: (2, 2) leg forces of the template there [N], rear and front.
    """

    def __init__(self, parameters: SlipParameters, reference: Array) -> None:
        p = parameters
        self.reference = reference
        self.forces = np.zeros((2, 2))
        self._ground = p
        self._body = np.array([p.mass, *p.gravity_parts, p.rest_length, p.assist])
        self.restart()

    def restart(self) -> None:
        """A new path starts where the robot is."""
        self.time = self.offset = 0.0
        self._fresh = True

    def move(
        self,
        mode: Mode,
        supervisor: StrideSupervisor,
        sensed: TemplateState,
        speed: float,
        dt: float,
    ) -> None:
        """Go on to where the robot is now.

        Args:
            mode: of the robot.
            supervisor: whose path is followed.
            sensed: the robot's state.
            speed: dx/dt of its CoM [m/s].
            dt: since the last tick [s].
        """
        s, path, toe = sensed, supervisor.path, supervisor.toe
        x, y = s.state[0] + self.offset - s.toes[0], s.state[1]
        # Since the last tick, unless the path begins at this one. A direction needs a guess only.
        passed = 0.0 if self._fresh and mode.control.clock is Clock.TIME else dt
        self._fresh = False
        self.time, row = mode.locate(*path.curve, x, y, self.time + passed, self.reference)
        self.offset += (s.state[2] - speed) * dt
        segment = path.curve.meta[row]
        if supervisor.ground is not self._ground:
            self._ground = ground = supervisor.ground
            self._body[1:3], self._body[4] = ground.gravity_parts, ground.assist
        leg_forces(segment, toe, self.reference, self._body, self.forces)
        if segment[3] != toe:
            # Template and robot are on either side of liftoff: to each foot its own force.
            self.forces[:] = np.flipud(self.forces.copy())
