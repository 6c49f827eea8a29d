"""The robot's state in the template's terms, and the report of a section."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.embedding.planners.planner import Decision
from template_control.embedding.swing import Feet
from template_control.errors import DivergedError
from template_control.robot.biped import Biped
from template_control.robot.terms import UP
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.maps.section import Section
from template_control.slip.scenario.route import StrideGoal
from template_control.structured import Number, structure


@compiled
def unrolled(lowest: float, state: Array, radius: float) -> float:
    """x of the template's toe [m] by x of a rolling foot's lowest point, and the CoM's state (4,).

    That point moves on by the radius times the angle that the leg turns by. So the phase would go
    on more slowly than the CoM, and the step would end later and slower than planned.
    """
    return lowest - radius * np.arctan2(state[0] - lowest, state[1])


@compiled
def rolled(toe: float, touchdown_angle: float, radius: float) -> float:
    """Inverse of :func:`unrolled` at landing, with the touchdown angle from the ground [rad]."""
    return toe - radius * (0.5 * np.pi - touchdown_angle)


SENSED = structure(
    state=(float, (4,)),  # x, y, dx/dt, dy/dt of the CoM, y over the template's ground
    toes=(float, (2,)),  # x of the rear and the front foot [m]
    ground=float,  # height of the template's ground [m]
    rear_shift=float,  # of the template's rear toe from the foot [m]
    pre_impact_velocity=(float, (2,)),  # this tick's, if nothing has hit the robot [m/s]
)
"""The robot in the template's terms; :class:`TemplateState` explains the first two."""


@compiled
def read_state(s: Any, f: Any, r: Any, mode: Any) -> bool:
    """Read the state of this tick; True if the forward speed is finite.

    ``s`` is of ``SENSED``, ``f`` of ``FEET``, ``r`` of ``ROBOT_DATA``, ``mode`` of ``MODE``.
    """
    if mode.stances > 0:
        s.ground = r.foot_position[f.landed, UP]
    s.state[0], s.state[1] = r.com[0], r.com[UP] - s.ground
    s.state[3] = r.com_velocity[UP]
    read_toes(s, f, r, mode)
    return read_speed(s, r, mode)


@compiled
def read_speed(s: Any, r: Any, mode: Any) -> bool:
    """Read the forward speed as the phase has it; True if it is finite.

    The swing leg's angular momentum makes dx/dt of the CoM swing within a step while the momentum
    about the foot, which is what the template predicts, does not.
    """
    s.state[2] = r.com_velocity[0]
    if mode.momentum_speed:
        s.state[2] += r.momentum[1] / (r.mass * s.state[1])
    return np.isfinite(s.state[2])


@compiled
def read_toes(s: Any, f: Any, r: Any, mode: Any) -> None:
    """Read x of the template's toes."""
    for leg in range(2):
        toe = r.foot_position[f.roles[leg], 0]
        s.toes[leg] = unrolled(toe, s.state, r.foot_radius) if mode.rolling_contact else toe
    s.toes[0] += s.rear_shift


@dataclass
class TemplateState:
    """State of the robot in the template's terms; overwritten at every tick."""

    # (4,) x, y, dx/dt, dy/dt of the CoM [m, m/s], y over the template's ground. Where the phase
    # says so, dx/dt includes the angular momentum about the CoM as if it moved the CoM, so that
    # m y dx/dt - m x dy/dt is the robot's angular momentum about its stance foot.
    state: Array = field(default_factory=lambda: np.zeros(4))
    toes: Array = field(default_factory=lambda: np.zeros(2))  # (2,) x of rear and front foot [m]
    feet: tuple[int, int] = (0, 1)  # the foot that is the rear leg's, and the front leg's
    # (2,) time since each foot has lifted off [s], of one in the air
    swung: Array = field(default_factory=lambda: np.full(2, np.inf))
    # (2,) wanted of the CoM at the last tick [m/s^2]: what is planned anew goes on with it
    acceleration: Array = field(default_factory=lambda: np.zeros(2))


class StateObserver:
    """Observer of the robot's state on the template's ground, that of the foot that landed last.

    Others write ``acceleration`` (2,), wanted of the CoM [m/s^2], and ``mode`` (1,), of ``MODE``;
    ``data`` (1,) is of ``SENSED``, and ``now`` was read last.
    """

    ground = Number("ground")
    _rear_shift = Number("rear_shift")

    def __init__(self, robot: Biped, feet: Feet, acceleration: Array, data: Any, mode: Any) -> None:
        self._robot, self._feet, self.data = robot, feet, data
        self.now = TemplateState(
            data["state"][0], data["toes"][0], swung=feet.swing_time, acceleration=acceleration
        )
        self.pre_impact_velocity: Array = data["pre_impact_velocity"][0]
        self._terms = data[0], feet.data[0], robot.data[0], mode[0]

    def begin(self, stands: bool) -> None:
        """Begin a run; where no foot stands, the ground is at height 0."""
        self.now.feet = self._feet.foot_of_leg
        self.ground = 0.0
        if stands:
            self._rise(self._feet.landed)

    def read(self) -> None:
        """Read the state of this tick; a DivergedError if the speed is not finite."""
        if not read_state(*self._terms):
            raise self.diverged()

    def read_speed(self) -> None:
        """Read the forward speed as the phase has it; see :meth:`read`."""
        sensed, _, robot, mode = self._terms
        if not read_speed(sensed, robot, mode):
            raise self.diverged()

    def diverged(self) -> DivergedError:
        """The error of a forward speed that is not finite, as the height over the foot may be 0."""
        return DivergedError(f"the forward speed of {self._robot.name} is not finite")

    def take_roles(self) -> None:
        """The feet have changed their roles, or one of them has lifted off."""
        self._rear_shift = 0.0
        self.now.feet = self._feet.foot_of_leg
        read_toes(*self._terms)

    def stand_on(self, foot: int) -> None:
        """Put the ground under a foot: the one that landed last has lifted off."""
        self._feet.landed = foot
        self.now.state[1] -= self._rise(foot)

    def land(self, leg: Leg, springs: bool = True) -> float:
        """Put the ground under the foot which has landed; how much higher it is now [m].

        Where that is higher or lower than the rear foot's, the template's rear toe is moved so that
        its leg keeps its length, and with it its force, where ``springs`` carry.
        """
        s, foot = self.now, self._feet.foot_of_leg[leg]
        self._feet.landed = foot
        higher = self._rise(foot)
        height = s.state[1] - higher
        if springs and leg is not Leg.REAR:
            back = s.state[0] - s.toes[Leg.REAR]
            moved = np.sqrt(max(back**2 + s.state[1] ** 2 - height**2, 0.0))
            self._rear_shift = float(back - np.copysign(moved, back))
            s.toes[Leg.REAR] += self._rear_shift
        s.state[1] = height
        return higher

    def _rise(self, foot: int) -> float:
        """Put the ground under ``foot``; how much higher it is there [m]."""
        before, self.ground = self.ground, float(self._robot.foot_position[foot, 1])
        return self.ground - before


@dataclass(frozen=True)
class Snapshot:
    """Controller at its last tick: where on the automaton and on the path, and what it follows.

    Positions, velocities and forces are in the world, of a floating-base robot in the heading
    frame. The arrays are its own: a later tick leaves them.

    Attributes:
        time: at which the next tick begins [s].
        node: name of the automaton's node.
        phase: time along the path since the last plan [s].
        rear: the foot that plays the rear leg.
        stands: whether a leg carries in this node.
        template_com, template_velocity: (2,) of the template at the robot's phase [m, m/s].
        template_force: (2, 2) its leg forces, rear and front [N].
        swing_reference: (2, 2) position of each foot's reference, NaN where it has none [m].
        sway: (2,) y of the CoM from the rear foot and dy/dt, with the angular momentum where the
            phase's forward speed has it [m, m/s]; zero in the plane.
        side_reference: (2,) y of each foot's reference, NaN where it has none [m]; zero in the
            plane.
    """

    time: float
    node: str
    phase: float
    rear: int
    stands: bool
    template_com: Array
    template_velocity: Array
    template_force: Array
    swing_reference: Array
    sway: Array
    side_reference: Array


@dataclass(frozen=True)
class EstimatorState:
    """Estimates of the controller's learners at a section."""

    load: float  # the load factor
    trim: float  # the momentum trim [m/s^2]
    lean: float  # what the trunk's reference adds to the wanted mean pitch [rad]


@dataclass(frozen=True)
class SectionReport:
    """Knowledge and choice of the controller at a section.

    Attributes:
        time: at which the section was reached [s].
        section: VLO or APEX.
        state: (3,) dx/dt (as the phase before senses it), y, dy/dt [m/s, m, m/s].
        goal: the stride that begins, and where it is to lead.
        target: (3,) dx/dt, y, dy/dt where it is to lead.
        decision: the planner's choice for it.
        offset: (3,) the planner's offset estimate.
        estimators: what the learners knew.
        plan_seconds: wall-clock time of the plan.
    """

    time: float
    section: Section
    state: Array
    goal: StrideGoal
    target: Array
    decision: Decision
    offset: Array
    estimators: EstimatorState
    plan_seconds: float

    @property
    def accepted(self) -> float:
        """dx/dt that the planner took for the target's [m/s]."""
        taken = self.decision.accepted
        return float(self.target[0]) if taken is None else taken
