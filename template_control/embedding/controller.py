"""The controller that makes the robot move like the template (Fig. 11).

It stands in a node of the automaton, moves along the automaton's edges when the robot fires
them, plans at every section (and plans again where a foot has landed), and turns the plan into
references for the whole-body QP. What a phase needs, which tasks, which feet, which clock, is
looked up in the table of phases: the controller knows no gait.

The legs' swing makes the robot's CoM run ahead of the template and fall back behind it within
a step, while its angular momentum about the foot, on which all forces depend, stays the
template's. So in stance the phase is that of a point that moves with dx/dt + L / (m y), L the
angular momentum about the CoM: it starts in the CoM at every plan, and leads or lags it by
centimetres.
"""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.embedding.guards import PLACED, RobotGuards
from template_control.embedding.learners.lean import TrunkLean
from template_control.embedding.learners.load import LoadEstimate
from template_control.embedding.learners.momentum_trim import MomentumTrim
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import Clock
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.planners.walking.walk_kernels import CONTROL
from template_control.embedding.references.feet import Feet
from template_control.embedding.references.leg_forces import leg_forces
from template_control.embedding.references.rolling import rolled
from template_control.embedding.references.stumble import Stumble
from template_control.embedding.section_report import Learnt, SectionReport
from template_control.embedding.sensing import Sensing
from template_control.embedding.station import stations
from template_control.embedding.stride_planning import StridePlanning
from template_control.errors import ParameterError
from template_control.parts import ready
from template_control.robot.biped import Biped
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Leg, Slot
from template_control.slip.maps.section import Section, section_of
from template_control.slip.scenario.route import Route, SteadyRoute
from template_control.slip.similarity import Scale, scaled
from template_control.whole_body.solver import Solution, Stance, WholeBodyQp
from template_control.whole_body.wanted import Wanted

Array = NDArray[np.float64]


class EmbeddingController:
    """Joint torques from measured state and foot contacts, one tick at a time.

    Args:
        robot: the (nominal) model; every tick updates it.
        planners: one for each kind of stride of the route; or one planner, whose gait is kept.
        options: tuning.
        route: which stride comes next, and towards which state; None: the gait of the one
            planner for ever.
        automaton: of the route's strides.

    Raises:
        ParameterError: if there are several planners and no route.

    Attributes:
        station: where on the automaton the robot is, and what that asks for.
        planning: the stride's decision and the path that follows it.
        swings: shapes of the swings in phases that have none of their own.
        feet: roles and swings of the feet.
        reference: (6,) template CoM x (relative to its rear toe), y, and two derivatives.
        sensing: the robot's state in the template's terms.
        phase_offset: the point whose direction is the phase is this far ahead of the CoM [m].
        template_forces: (2, 2) leg forces of the template at this phase [N], rear and front.
    """

    @checked
    def __init__(
        self,
        robot: Biped,
        planners: Planners | Planner,
        options: EmbeddingOptions | None = None,
        route: Route | None = None,
        automaton: Automaton = AUTOMATON,
    ) -> None:
        ready(CONTROL)
        self.robot = robot
        if isinstance(planners, Planner):
            gait = planners.gait
            route = route or SteadyRoute.of(gait, automaton)
            planners = {gait.stride: planners}
        if route is None:
            raise ParameterError("several planners and no route: say which stride comes next")
        self.parameters = route.parameters
        self.options = scaled(options or EmbeddingOptions(), Scale.of(self.parameters))
        o = self.options
        self.qp = WholeBodyQp(robot, o)
        self.load = LoadEstimate(o.load, robot.gravity)
        self.trim = MomentumTrim(self.parameters, o.trim)
        self.lean = TrunkLean(o.lean, o.trunk_pitch)
        self.wanted = Wanted(pitch=o.trunk_pitch)
        self.swings = o.swings(robot)
        self.feet = Feet(self.swings.other, self.wanted.foot)
        self.reference = self.wanted.com
        self.template_forces = np.zeros((2, 2))
        self.phase_time = 0.0
        self.phase_offset = 0.0
        self.time = 0.0
        self._fresh = True
        self.sensing = Sensing(robot, self.feet, self.reference[4:])
        self._stumble = Stumble(o.stumble, robot.mass * robot.gravity)
        self._guards = RobotGuards(self.parameters, o.guards)
        self._stations = stations(automaton, robot.nv, o.phases)
        curved = {name for name, station in self._stations.items() if station.control.curved}
        self.planning = StridePlanning(route, planners, o.replan, automaton, curved)
        p = self.parameters
        self._body = np.array([p.mass, p.gravity, p.rest_length])
        self.station = next(iter(self._stations.values()))

    @property
    def node(self) -> Node:
        """The automaton's node the robot is in."""
        return self.station.node

    @property
    def planner(self) -> Planner:
        """Chooses the present stride's controls."""
        return self.planning.planner

    @property
    def reports(self) -> list[SectionReport]:
        """One report a section, the start's included."""
        return self.planning.reports

    @property
    def template_com(self) -> tuple[float, float]:
        """The template's CoM at the robot's phase, in the world [m]."""
        x, y = self.reference[:2]
        return float(self._origin + x), float(self.sensing.ground + y)

    @property
    def _origin(self) -> float:
        """Where the template's rear toe is in the world: at the foot, if that stands [m]."""
        return float(self.sensing.now.toes[0]) if self.station.stance else self.planning.toe

    def first_pitch(self) -> float:
        """Of the trunk where the route begins [rad]."""
        goal = self.planning.first_goal()
        return self.options.lean.pitch(goal, self.options.trunk_pitch)

    def start(self, rear: int = 0, swung: tuple[float, float] | None = None) -> None:
        """Begin where the route begins; the robot's model must be up to date.

        Args:
            rear: the foot that is the rear leg's.
            swung: time since rear and front foot left the ground [s], for those in the air; None:
                they are in the middle of their swings.

        Raises:
            ParameterError: if the route begins with a stride for which there is no planner.
        """
        section = self.planning.route.section
        planner, node = self.planning.begin(section)
        self.lean.reset()
        self._enter(node.name)
        self.feet.begin(rear)
        half = 0.5 * planner.gait.step_duration
        for leg in self.station.swings:
            self._lift(self.feet.of[leg], (swung or (half, half))[leg])
        if node.stance:
            # Of two feet on the ground the front one landed last.
            self.feet.landed = self.feet.of[self.station.stance[-1]]
        self.sensing.begin(bool(node.stance))
        self._sense(np.zeros(2, dtype=bool))
        self._decide(section)

    def tick(
        self,
        q: Array,
        v: Array,
        contact: NDArray[np.bool_],
        dt: float,
        force: Array | None = None,
    ) -> Solution:
        """Torques for the next ``dt`` seconds.

        Args:
            q: (nq,) measured configuration.
            v: (nv,) measured velocity.
            contact: (2,) whether each foot touches the ground.
            dt: control period [s].
            force: (2, d) the ground's force on each foot, forward first and up last [N], by which
                a foot in the air tells a wall; None: it tells none.

        Raises:
            ParameterError: if the state is not finite.
        """
        self.robot.update(q, v)
        if force is not None:
            self._stumble.feel(force, self.robot.foot_velocity[:, 1], dt)
            contact = contact & ~self._stumble.slipping
        self.feet.swing_time += dt
        self._sense(contact)
        self._advance()
        self._plan_again()
        self._locate(dt)
        self._swing(q, v, dt)
        self._track(q, v, dt)
        self.sensing.foresee(dt)
        self.time += dt
        return self.qp.solve(self.station.tasks, self._stance(), self.load.factor)

    # -- the automaton ----------------------------------------------------------------

    def _sense(self, contact: NDArray[np.bool_]) -> None:
        control = self.station.control
        stands = bool(self.station.stance)
        self.sensing.read(contact, stands, control.momentum_speed, control.rolls)

    def _advance(self) -> None:
        """Take the first edge of the present node that the robot fires."""
        for edge in self.station.ways:
            due = self.planning.dues[edge.event] - self.phase_time
            if self._guards.fired(edge, self.sensing.now, due):
                self._take(edge)
                return

    def _take(self, edge: Edge) -> None:
        """Go along an edge: roles and swings of the feet, plan, node."""
        before, stood, roles = self.station, self._standing(), self.feet.of
        self.planning.pass_event(edge.event)
        self._enter(str(edge.target))
        self.feet.apply(edge.reset)
        lifted = stood - self._standing()
        for foot in lifted:
            self._lift(foot)
        sensing, stance = self.sensing, self.station.stance
        if self.feet.landed in lifted and stance:
            # A step back: the other foot is the one on the ground.
            sensing.stand_on(self.feet.of[stance[0]])
        if lifted or self.feet.of != roles:
            sensing.take_roles(self.station.control.rolls)
            self.planning.stand_on(self.feet.of[Leg.REAR])
        momentum = self.station.control.momentum_speed
        if momentum is not before.control.momentum_speed:
            sensing.read_speed(momentum)
        if lifted and not stance:
            # No force moves the CoM now: its path, and all footholds on it, are certain.
            self.planning.follow(self.node, sensing.now, self.time)
            self._on_new_path()
        placed = PLACED.get(edge.reset)
        if placed is not None:
            self._land(placed)
        if edge.section:
            self._decide(section_of(edge.event))

    def _enter(self, node: str) -> None:
        self.station = self._stations[node]

    def _lift(self, foot: int, swung: float = 0.0) -> None:
        """A swing keeps the shape with which it began, whatever the next stride's is."""
        goal = self.reports[-1].goal if self.reports else self.planning.first_goal()
        self.feet.swing[foot].options = self.station.swing or self.swings.towards(goal)
        self.feet.lift(foot, self.robot, swung)

    def _standing(self) -> set[int]:
        return {self.feet.of[leg] for leg in self.station.stance}

    def _land(self, leg: Leg) -> None:
        """The template's ground is now that of the foot which has landed.

        Where the table says ``unhit``, the path goes on with the speed before it hit the ground.
        """
        higher, s = self.sensing.land(leg), self.sensing.now
        measured = s.state[2:].copy()
        if self.station.control.unhit:
            s.state[2:] = self.sensing.unhit
        if self.station.control.lands:
            self.planning.land(self.node, s, self.time)
        else:
            self._enter(self.planning.land_off(self.node, s, self.time, higher).name)
        s.state[2:] = measured
        self._on_new_path()

    def _decide(self, section: Section) -> None:
        s = self.sensing.now
        if self.reports:
            nominal = self.reports[-1].decision.nominal
            self.load.end_stride(nominal)
            self.trim.end_stride(section.padded(section.of(s.state)), nominal)
            self.lean.end_stride(nominal)
        learnt = Learnt(self.load.factor, self.trim.acceleration, self.lean.correction)
        node = self.planning.decide(section, s, self.time, learnt)
        self._enter(node.name)
        if len({report.goal.stride for report in self.reports[-2:]}) > 1:
            # A walk after a run stands up; one that leant had other drifts.
            self.trim.forget()
        self.lean.aim(self.reports[-1].goal)
        self.trim.expect(self.planning.path if self.station.trimmed else None, self.planner.gait)
        self._on_new_path()

    def _plan_again(self) -> None:
        """Plan from here where a touchdown is overdue or the robot has left its path."""
        s, planning = self.sensing.now, self.planning
        if planning.overdue(self.node, self.phase_time):
            planning.reach_on(self.node, s, self.time)
        elif planning.surprised(s.state[2] - self.reference[2], self.phase_time, self.time):
            self._enter(planning.reconsider(self.node, s, self.phase_time, self.time).name)
            self.lean.aim(self.reports[-1].goal)
        else:
            return
        self._on_new_path()

    def _on_new_path(self) -> None:
        """The path starts where the robot is."""
        self.phase_time = self.phase_offset = 0.0
        self._fresh = True

    # -- control ----------------------------------------------------------------------

    def _locate(self, dt: float) -> None:
        """The template's state and forces at the robot's phase."""
        s, path, toe = self.sensing.now, self.planning.path, self.planning.toe
        x, y = s.state[0] + self.phase_offset - s.toes[0], s.state[1]
        # Since the last tick, unless the path begins at this one. A direction needs a guess only.
        passed = 0.0 if self._fresh and self.station.control.clock is Clock.TIME else dt
        self._fresh = False
        self.phase_time, row = self.station.locate(
            *path.curve, x, y, self.phase_time + passed, self.reference
        )
        self.phase_offset += (s.state[2] - self.robot.com_velocity[0]) * dt
        segment = path.curve.meta[row]
        leg_forces(segment, toe, self.reference, self._body, self.template_forces)
        if segment[3] != toe:
            # Template and robot are on either side of liftoff: to each foot its own force.
            self.template_forces[:] = np.flipud(self.template_forces.copy())

    def _swing(self, q: Array, v: Array, dt: float) -> None:
        """Move the references of the feet in the air towards their footholds."""
        station, planning, wanted = self.station, self.planning, self.wanted
        hips, wanted.hip_speed = self.robot.hips(q, v)
        for leg in station.swings:
            foot = self.feet.of[leg]
            swing = self.feet.swing[foot]
            landing = planning.landing(foot)
            foothold, due = landing.x, landing.time - self.phase_time
            if self._stumble.blocked[foot]:
                swing.meet_wall(self.robot.foot_position[foot], due, dt)
            elif planning.reaching and leg == station.awaited:
                swing.drop(dt)
            else:
                if not isfinite(foothold):
                    # The template cannot complete the stride; the gait's own foothold is the
                    # best guess.
                    gait = self.planner.gait
                    foothold = self.sensing.now.toes[Leg.REAR] + gait.step_length
                    due = gait.step_duration - self.feet.swing_time[foot]
                if station.control.rolls:
                    angle = float(self.reports[-1].decision.controls[Slot.TOUCHDOWN_ANGLE])
                    foothold = rolled(foothold, angle, self.robot.foot_radius)
                swing.advance(foothold, due, dt, self.sensing.ground)
            wanted.furthest[foot] = swing.furthest(hips, self.robot.leg_length)

    def _track(self, q: Array, v: Array, dt: float) -> None:
        """Let the phase's tasks write what they ask for."""
        s, wanted, station = self.sensing.now, self.wanted, self.station
        wanted.com_now[:] = s.state
        wanted.com_now[0] -= s.toes[0]
        wanted.com_push = self.trim.acceleration if station.control.trims else 0.0
        pitch, turning = self.robot.trunk(q, v)
        wanted.pitch_now[0], wanted.pitch_now[1] = pitch, turning
        wanted.pitch = self.lean.advance(pitch, dt)
        wanted.feet = self.feet.of
        station.tasks.write(self.robot, wanted)
        if station.control.weighs and station.com is not None:
            self.load.observe(station.com.lift(wanted), dt)

    def _stance(self) -> Stance:
        """The feet on the ground, the template's forces on them, and how far they unload."""
        station, forces = self.station, self.template_forces
        for leg in station.control.unloads:
            weight = self.robot.mass * self.robot.gravity
            station.cap[leg] = self.options.unload.cap(forces[leg, 1], weight)
        legs = station.stance
        return Stance(
            tuple(self.feet.of[leg] for leg in legs), forces[: len(legs)].ravel(), station.cap
        )
