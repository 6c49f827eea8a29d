"""The controller that makes the robot walk like the template (Fig. 11).

It stands in a node of the automaton, moves along the automaton's edges when the robot
fires them, plans at VLO (and re-plans where a foot has landed), and turns the plan into
references for the whole-body QP, parameterised by the direction from the rear stance foot
to the CoM (beta of Section V-B).

The legs' swing makes the robot's CoM run ahead of the template and fall back behind it within
a step, while its angular momentum about the foot, on which all forces depend, stays the
template's. So beta is taken to the point that moves with dx/dt + L / (m y), L the angular
momentum about the CoM: it starts in the CoM at every plan, and leads or lags it by centimetres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.guards import Sensed, fired
from template_control.embedding.load import LoadEstimate
from template_control.embedding.momentum_trim import MomentumTrim
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.plan import at_phase
from template_control.embedding.planners.planner import Planner
from template_control.embedding.references import leg_forces, pd, unloading_cap
from template_control.embedding.scaling import Scale
from template_control.embedding.step_planning import VLO_STATE, StepPlanning, StepReport
from template_control.embedding.swing_foot import SwingFoot
from template_control.robot.planar_biped import PlanarBiped
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.hybrid import Node
from template_control.slip.automaton.vocabulary import Phase, Reset
from template_control.whole_body.solver import Solution, WholeBodyQp
from template_control.whole_body.tasks import Row, TaskStack

Array = NDArray[np.float64]

_NO_CAP = np.full(1, np.inf)


class EmbeddingController:
    """Joint torques from measured state and foot contacts, one tick at a time.

    Args:
        robot: the (nominal) model; every tick updates it.
        planner: chooses each step's controls and owns the gait.
        options: tuning.

    Attributes:
        node: the automaton's node the robot is in.
        rear, front: indices of the feet; in single stance the rear one carries.
        planning: the step's decision and the path that follows it.
        reference: (6,) template CoM x (relative to its rear toe), y, and two derivatives.
        ground: height of the template's ground: of the foot that landed last [m].
        lead: of the point whose direction is the phase over the CoM [m].
        template_forces: (2, 2) leg forces of the template at this phase [N], rear and front.
        swing: reference of the swing foot.
    """

    def __init__(
        self, robot: PlanarBiped, planner: Planner, options: EmbeddingOptions | None = None
    ) -> None:
        self.robot = robot
        self.options = (options or EmbeddingOptions()).scaled(Scale.of(planner.gait.parameters))
        o = self.options
        self.planning = StepPlanning(planner, o.replan)
        self.parameters = planner.gait.parameters
        self.qp = WholeBodyQp(robot, o.friction, o.torque_scale, o.contact_damping)
        self.tasks = TaskStack(robot.nv)
        self.swing = SwingFoot(o.swing)
        self.load = LoadEstimate(o.load, robot.gravity)
        self.trim = MomentumTrim(planner.gait, o.trim)
        self.rear, self.front = 0, 1
        self.node: Node = AUTOMATON.node(STRIDE_START["w"])
        self.reference = np.zeros(6)
        self.template_forces = np.zeros((2, 2))
        self.phase_time = 0.0
        self.lead = 0.0
        self.ground = 0.0
        self._rear_shift = 0.0
        self.time = 0.0
        self._sensed = Sensed(np.zeros(4), np.zeros(2))
        self._rows = {
            Phase.SS: np.array(o.single_stance.rows),
            Phase.DS: np.array(o.double_stance.rows),
        }

    @property
    def planner(self) -> Planner:
        """Chooses each step's controls."""
        return self.planning.planner

    @property
    def steps(self) -> list[StepReport]:
        """One report a VLO, the start's included."""
        return self.planning.steps

    @property
    def template_com(self) -> tuple[float, float]:
        """The template's CoM at the robot's phase, in the world [m]."""
        x, y = self.reference[:2]
        return float(self._sensed.toes[0] + x), float(self.ground + y)

    def start(self, rear: int) -> None:
        """Begin at a VLO over foot ``rear``; the robot's model must be up to date.

        The other foot is taken to be in the middle of its swing.
        """
        self.rear, self.front = rear, 1 - rear
        self.node = AUTOMATON.node(STRIDE_START["w"])
        r = self.robot
        swung = 0.5 * (self.planner.gait.step_duration)
        self.swing.start(r.foot_position[self.front], r.foot_velocity[self.front], swung)
        self._sensed.swing_time = swung
        self._sense(np.zeros(2, dtype=bool))
        self._decide()

    def tick(self, q: Array, v: Array, contact: NDArray[np.bool_], dt: float) -> Solution:
        """Torques for the next ``dt`` seconds.

        Args:
            q, v: (nv,) measured configuration and velocity.
            contact: (2,) whether each foot touches the ground.
            dt: control period [s].

        Raises:
            ParameterError: if the state is not finite.
        """
        r = self.robot
        r.update(q, v)
        self._sensed.swing_time += dt
        self._sense(contact)
        self._advance()
        s = self._sensed
        if self.planning.overdue(self.node, self.phase_time):
            self.planning.reach_on(self.node, s, self.time)
            self._on_new_path()
        elif self.planning.surprised(s.state[2] - self.reference[2], self.phase_time, self.time):
            self.planning.reconsider(self.node, s, self.phase_time, self.time)
            self._on_new_path()
        x, y = s.state[0] + self.lead - s.toes[0], s.state[1]
        path, toe = self.planning.path, self.planning.toe
        self.phase_time, row = at_phase(
            path.cx, path.cy, path.meta, toe, x, y, self.phase_time + dt, self.reference
        )
        self.lead += (s.state[2] - r.com_velocity[0]) * dt
        self._track_com(s.state[0] - s.toes[0], y, dt)
        trunk = self.options.gains.trunk
        self.tasks.desired[Row.TRUNK] = pd(
            0.0, self.options.trunk_pitch, 0.0, q[2], v[2], trunk[0], trunk[1]
        )
        leg_forces(
            path.meta[row],
            self.reference[0] + toe,
            self.reference[1],
            self.parameters.rest_length,
            self.template_forces,
        )
        if path.meta[row, 3] != toe:
            # Template and robot are on either side of liftoff: to each foot its own force.
            self.template_forces[:] = np.flipud(self.template_forces.copy())
        self.time += dt
        if self.node.phase is Phase.DS:
            return self._solve_double()
        return self._solve_single(q, v, dt)

    # -- the automaton ----------------------------------------------------------------

    def _sense(self, contact: NDArray[np.bool_]) -> None:
        r, s = self.robot, self._sensed
        landed = self.front if self.node.phase is Phase.DS else self.rear
        self.ground = float(r.foot_position[landed, 1])
        height = r.com[1] - self.ground
        s.toes[0] = r.foot_position[self.rear, 0] + self._rear_shift
        s.toes[1] = r.foot_position[self.front, 0]
        s.state[0], s.state[1] = r.com[0], height
        # The swing leg's angular momentum makes dx/dt of the CoM swing within a step while
        # the momentum about the foot, which is what the template predicts, does not.
        s.state[2] = r.com_velocity[0] + r.angular_momentum / (r.mass * height)
        s.state[3] = r.com_velocity[1]
        s.front_contact = bool(contact[self.front])

    def _advance(self) -> None:
        """Take the first edge of the present node that the robot fires."""
        p = self.parameters
        for edge in self.node.edges:
            if not isinstance(edge.target, str):
                continue
            if not fired(
                edge.event,
                self._sensed,
                self.phase_time,
                self.planning.path.liftoff,
                p.rest_length,
                p.gravity,
                self.options.liftoff_angle,
            ):
                continue
            self.node = AUTOMATON.node(edge.target)
            if edge.reset is Reset.SHIFT:
                self._lift_off()
            elif edge.reset is Reset.PLACE_FRONT:
                self._touch_down()
            if edge.section:
                self._decide()
            return

    def _touch_down(self) -> None:
        """The template's ground is now the front foot's.

        Where that is higher or lower than the rear foot's, the template's rear toe is moved so
        that the leg keeps its length, and with it its force.
        """
        s = self._sensed
        ground = float(self.robot.foot_position[self.front, 1])
        back, height = s.state[0] - s.toes[0], s.state[1] + self.ground - ground
        self._rear_shift = float(back - np.sqrt(max(back**2 + s.state[1] ** 2 - height**2, 0.0)))
        s.toes[0] += self._rear_shift
        self.ground, s.state[1] = ground, height
        self.planning.follow(self.node, s, self.time)
        self._on_new_path()

    def _lift_off(self) -> None:
        """The front foot becomes the rear one; the plan goes on from its toe."""
        self._rear_shift = 0.0
        self.planning.toe = self.planning.path.front_toe
        self.rear, self.front = self.front, self.rear
        r, s = self.robot, self._sensed
        s.toes[0], s.toes[1] = s.toes[1], r.foot_position[self.front, 0]
        s.swing_time = 0.0
        self.swing.start(r.foot_position[self.front], r.foot_velocity[self.front])

    def _decide(self) -> None:
        if self.steps:
            trusted = self.steps[-1].decision.reached
            self.load.end_step(trusted)
            self.trim.end_step(self._sensed.state[VLO_STATE], trusted)
        learnt = (self.load.factor, self.trim.acceleration)
        self.planning.decide(self.node, self._sensed, self.time, *learnt)
        self.trim.expect(self.planning.path)
        self._on_new_path()

    def _on_new_path(self) -> None:
        """The path starts where the robot is."""
        self.phase_time = self.lead = 0.0

    # -- control ----------------------------------------------------------------------

    def _track_com(self, x: float, y: float, dt: float) -> None:
        ref, s, d = self.reference, self._sensed, self.tasks.desired
        kp, kd = self.options.gains.com
        self.tasks.read(self.robot, self.front, y)
        d[Row.COM_X] = pd(ref[4], ref[0], ref[2], x, s.state[2], kp, kd)
        if self.node.phase is Phase.DS:
            d[Row.COM_X] += self.trim.acceleration
        d[Row.COM_Y] = pd(ref[5], ref[1], ref[3], y, s.state[3], kp, kd)
        self.load.observe(d[Row.COM_Y] - ref[5], dt)

    def _solve_double(self) -> Solution:
        r, o = self.robot, self.options
        forces = self.template_forces
        cap = np.array([unloading_cap(forces[0, 1], r.mass * r.gravity), np.inf])
        return self.qp.solve(
            self.tasks,
            o.double_stance,
            self._rows[Phase.DS],
            (self.rear, self.front),
            forces.ravel(),
            cap,
            self.load.factor,
        )

    def _solve_single(self, q: Array, v: Array, dt: float) -> Solution:
        r, o, swing, d = self.robot, self.options, self.swing, self.tasks.desired
        path = self.planning.path
        foothold, due = path.foothold, path.touchdown - self.phase_time
        if not np.isfinite(foothold):
            # The template cannot complete the step; the gait's own foothold is the best guess.
            gait = self.planner.gait
            foothold = self._sensed.toes[0] + gait.step_length
            due = gait.step_duration - self._sensed.swing_time
        if self.planning.reaching:
            swing.reach_down(dt)
        else:
            swing.advance(foothold, due, dt, self.ground)
        position, velocity = r.foot_position[self.front], r.foot_velocity[self.front]
        kp, kd = o.gains.swing
        for row, axis, i in ((Row.SWING_X, swing.x, 0), (Row.SWING_Y, swing.y, 1)):
            d[row] = pd(axis[2], axis[0], axis[1], position[i], velocity[i], kp, kd)
        limit = swing.furthest(q[:2], r.leg_length)
        held = pd(0.0, limit, v[0], position[0], velocity[0], *o.gains.reach)
        d[Row.SWING_X] = min(d[Row.SWING_X], held)
        return self.qp.solve(
            self.tasks,
            o.single_stance,
            self._rows[Phase.SS],
            (self.rear,),
            self.template_forces[0],
            _NO_CAP,
            self.load.factor,
        )
