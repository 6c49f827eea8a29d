"""The robot's state in the template's terms, and the report of a section."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2, isfinite, pi

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.planner import Decision
from template_control.embedding.swing import Feet
from template_control.errors import DivergedError
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Leg
from template_control.slip.maps.section import Section
from template_control.slip.scenario.route import StrideGoal

Array = NDArray[np.float64]


def unrolled(lowest: float, state: Array, radius: float) -> float:
    """Place of a rolling foot's lowest point as the CoM is over it.

    That point moves on by the radius times the angle that the leg turns by. So the phase would go
    on more slowly than the CoM, and the step would end later and slower than planned.

    Args:
        lowest: x of the foot's lowest point [m].
        state: (4,) x, y, dx/dt, dy/dt of the CoM.
        radius: of the foot [m].

    Returns:
        x of the template's toe [m].
    """
    return float(lowest - radius * atan2(state[0] - lowest, state[1]))


def rolled(toe: float, touchdown_angle: float, radius: float) -> float:
    """Landing place of the lowest point of a foot whose toe is to be at ``toe``.

    The inverse of :func:`unrolled`.

    Args:
        toe: x of the template's toe [m].
        touchdown_angle: from the ground to the leg [rad].
        radius: of the foot [m].
    """
    return toe - radius * (0.5 * pi - touchdown_angle)


@dataclass
class TemplateState:
    """State of the robot in the template's terms; overwritten at every tick.

    Attributes:
        state: (4,) x, y, dx/dt, dy/dt of the CoM [m, m/s], y over the template's ground. Where
            the phase says so, dx/dt includes the angular momentum about the CoM as if it moved
            the CoM, so that m y dx/dt - m x dy/dt is the robot's angular momentum about its
            stance foot.
        toes: (2,) x of the rear and the front foot [m].
        contact: (2,) whether each foot touches the ground.
        swing_time: (2,) time since each foot lifted off [s].
        feet: the foot that is the rear leg's, and the front leg's.
        acceleration: (2,) wanted of the CoM at the last tick [m/s^2]: what is planned anew goes on
            with it.
    """

    state: Array = field(default_factory=lambda: np.zeros(4))
    toes: Array = field(default_factory=lambda: np.zeros(2))
    contact: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(2, dtype=bool))
    swing_time: Array = field(default_factory=lambda: np.full(2, np.inf))
    feet: tuple[int, int] = (0, 1)
    acceleration: Array = field(default_factory=lambda: np.zeros(2))


class StateObserver:
    """Observer of the robot's state on the template's ground, that of the foot that landed last.

    Args:
        robot: the model; every tick updates it.
        feet: their roles.
        acceleration: (2,) wanted of the CoM, which others write [m/s^2].

    Attributes:
        now: what was read last.
        ground: height of the template's ground [m].
        pre_impact_velocity: (2,) dx/dt and dy/dt of this tick if nothing has hit the robot since
            the last one.
    """

    def __init__(self, robot: Biped, feet: Feet, acceleration: Array) -> None:
        self._robot, self._feet = robot, feet
        self.now = TemplateState(swing_time=feet.swing_time, acceleration=acceleration)
        self.ground = 0.0
        self.pre_impact_velocity = np.zeros(2)
        self._rear_shift = 0.0

    def begin(self, stands: bool) -> None:
        """Begin a run; where no foot stands, the ground is at height 0."""
        self.now.feet = self._feet.foot_of_leg
        self.ground = self._height(self._feet.landed) if stands else 0.0

    def read(
        self, contact: NDArray[np.bool_], stands: bool, momentum: bool, rolling_contact: bool
    ) -> None:
        """Read the state of this tick.

        Args:
            contact: (2,) whether each foot touches the ground.
            stands: whether a foot carries; the ground is under the one that landed last.
            momentum: as for :meth:`read_speed`.
            rolling_contact: whether the toes stay in one place while the feet roll.
        """
        r, s = self._robot, self.now
        if stands:
            self.ground = self._height(self._feet.landed)
        s.state[0], s.state[1] = r.com[0], r.com[1] - self.ground
        s.state[3] = r.com_velocity[1]
        self._read_toes(rolling_contact)
        s.contact = contact
        self.read_speed(momentum)

    def read_speed(self, momentum: bool) -> None:
        """Read the forward speed as the phase has it.

        The swing leg's angular momentum makes dx/dt of the CoM swing within a step while the
        momentum about the foot, which is what the template predicts, does not.

        Args:
            momentum: whether the speed includes the angular momentum about the CoM.

        Raises:
            DivergedError: if the speed is not finite.
        """
        r, s = self._robot, self.now
        s.state[2] = r.com_velocity[0]
        if momentum:
            s.state[2] += r.angular_momentum / (r.mass * s.state[1])
        if not isfinite(s.state[2]):  # the robot's own state is, but for its height over the foot
            raise DivergedError(f"the forward speed of {r.name} is not finite")

    def predict_velocity(self, dt: float) -> None:
        """Predict the velocity that the next tick has in ``dt`` if nothing hits the robot."""
        _, _, dx, dy = self.now.state.tolist()
        ddx, ddy = self.now.acceleration.tolist()
        self.pre_impact_velocity[0], self.pre_impact_velocity[1] = dx + ddx * dt, dy + ddy * dt

    def take_roles(self, rolling_contact: bool) -> None:
        """The feet have changed their roles, or one of them has lifted off.

        Args:
            rolling_contact: as for :meth:`read`.
        """
        self._rear_shift = 0.0
        self.now.feet = self._feet.foot_of_leg
        self._read_toes(rolling_contact)

    def _read_toes(self, rolling_contact: bool) -> None:
        r, s = self._robot, self.now
        for leg, foot in enumerate(self._feet.foot_of_leg):
            toe = float(r.foot_position[foot, 0])
            s.toes[leg] = unrolled(toe, s.state, r.foot_radius) if rolling_contact else toe
        s.toes[Leg.REAR] += self._rear_shift

    def stand_on(self, foot: int) -> None:
        """Put the ground under a foot: the one that landed last has lifted off."""
        self._feet.landed = foot
        self.now.state[1] -= self._rise(foot)

    def land(self, leg: Leg) -> float:
        """Put the ground under the foot which has landed.

        Where that is higher or lower than the rear foot's, the template's rear toe is moved so
        that its leg keeps its length, and with it its force.

        Returns:
            How much higher the ground is now [m].
        """
        s, foot = self.now, self._feet.foot_of_leg[leg]
        self._feet.landed = foot
        higher = self._rise(foot)
        height = s.state[1] - higher
        if leg is not Leg.REAR:
            back = s.state[0] - s.toes[Leg.REAR]
            moved = np.sqrt(max(back**2 + s.state[1] ** 2 - height**2, 0.0))
            self._rear_shift = float(back - np.copysign(moved, back))
            s.toes[Leg.REAR] += self._rear_shift
        s.state[1] = height
        return higher

    def _rise(self, foot: int) -> float:
        """Put the ground under ``foot``; how much higher it is there [m]."""
        before, self.ground = self.ground, self._height(foot)
        return self.ground - before

    def _height(self, foot: int) -> float:
        return float(self._robot.foot_position[foot, 1])


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


@dataclass(frozen=True)
class FloatingSnapshot(Snapshot):
    """Snapshot of a floating-base robot's controller.

    Attributes:
        sway: (2,) y of the CoM from the rear foot and dy/dt, in the heading frame; dy/dt has the
            angular momentum about the CoM where the phase's forward speed has it [m, m/s].
        side_reference: (2,) y of each foot's reference, NaN where it has none [m].
    """

    sway: Array
    side_reference: Array


@dataclass(frozen=True)
class EstimatorState:
    """Estimates of the controller's learners at a section.

    Attributes:
        load: the load factor.
        trim: the momentum trim [m/s^2].
        lean: what the trunk's reference adds to the wanted mean pitch [rad].
    """

    load: float
    trim: float
    lean: float


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
