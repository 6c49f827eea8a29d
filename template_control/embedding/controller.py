"""Controller that makes the robot move like the template (Fig. 11).

It moves along the automaton's edges when the robot fires them, changes roles and swings of the
feet, plans at every section and again where a foot has landed or a disturbance came, and turns the
plan into references for the whole-body QP. What a phase needs, which tasks, which feet, which
clock, is looked up in the table of phases: the controller knows no gait.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.embedding.contacts import EARLY, SINKING, ContactMonitor
from template_control.embedding.ground import SlopingGround
from template_control.embedding.learners.learners import Learners
from template_control.embedding.leg_forces import unload_cap
from template_control.embedding.modes import PLACED, Mode, PathClock, RobotGuards, modes
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.planner import Cause, Planner, Planners
from template_control.embedding.planners.walk_kernels import CONTROL
from template_control.embedding.recovery import NEEDED, Recovery
from template_control.embedding.state import SectionReport, Snapshot, StateObserver, rolled
from template_control.embedding.supervisor import StrideSupervisor
from template_control.embedding.swing import Feet
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Event, Leg, Slot
from template_control.slip.maps.section import Section, section_of
from template_control.slip.scenario.route import Route, SteadyRoute
from template_control.slip.similarity import Scale, scaled
from template_control.warm_up import ready
from template_control.whole_body.solver import Solution, Stance, WholeBodyQp
from template_control.whole_body.task import References

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
        mode: where on the automaton the robot is, and what that asks for.
        supervisor: the stride's decision and the path that follows it.
        swings: shapes of the swings in phases that have none of their own.
        feet: roles and swings of the feet.
        place: the robot's place on that path, and the template there.
        learners: what is learnt from stride to stride.
        contacts: which feet stand.
        ground: its slope, as the feet tell it.
        frame: axes that lean with the ground.
        observer: the robot's state in the template's terms.
        references: what the tasks read.
        time: since the start [s].
        qp: the whole-body problem.
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
        if isinstance(planners, Planner):
            gait = planners.gait
            route = route or SteadyRoute.of(gait, automaton)
            planners = {gait.stride: planners}
        if route is None:
            raise ParameterError("several planners and no route: say which stride comes next")
        scale = Scale.of(route.parameters)
        given = options or EmbeddingOptions()
        o = scaled(replace(given, phases=given.phase_table(), tasks={}), scale)
        self.robot, self.options, self.parameters = robot, o, route.parameters
        self.learners = Learners(o, self.parameters, robot)
        self.ground = SlopingGround(robot, self.parameters.rest_length)
        self.frame = self.ground.frame
        self.references = References(pitch=o.trunk_pitch)
        self.swings = o.swings(robot, scale)
        self.feet = Feet(self.swings.other, self.references.foot)
        self.path_clock = PathClock(self.parameters, self.references.com)
        self.time = 0.0
        self.observer = StateObserver(robot, self.feet, self.references.com[4:])
        self._early, self._sinking = EARLY * scale.time, SINKING * scale.speed
        self.contacts = ContactMonitor(o.contacts, robot.mass * robot.gravity)
        self._guards = RobotGuards(self.parameters, o.guards)
        self._modes = modes(automaton, robot.nv, o.phases)
        curved = {name for name, mode in self._modes.items() if mode.control.follow_curve}
        recovers = o.catches and automaton is AUTOMATON and planners.keys() >= NEEDED
        recovery = Recovery(self.parameters) if recovers else None
        self.supervisor = StrideSupervisor(route, planners, o.replan, automaton, curved, recovery)
        self.mode = next(iter(self._modes.values()))
        self._slope_unknown = False  # the ground under feet that both stand where a run begins
        self.qp = WholeBodyQp(robot, o)
        self._swing_controller = SwingController(robot, self.feet, self.contacts, self.references)

    @property
    def node(self) -> Node:
        """The automaton's node the robot is in."""
        return self.mode.node

    @property
    def planner(self) -> Planner:
        """Chooses the present stride's controls."""
        return self.supervisor.planner

    @property
    def reports(self) -> list[SectionReport]:
        """One report a section, the start's included."""
        return self.supervisor.reports

    def snapshot(self) -> Snapshot:
        """Node, phase, template and swing references of the last tick."""
        clock, frame, feet = self.path_clock, self.frame, self.feet.foot_of_leg
        x, y = clock.reference.tolist()[:2]
        swing = np.full((2, 2), np.nan)
        for leg in self.mode.swings:
            swing[feet[leg]] = frame.world(self.references.foot[feet[leg], :, 0])
        return Snapshot(
            time=self.time,
            node=self.mode.node.name,
            phase=clock.time,
            rear=feet[Leg.REAR],
            stands=bool(self.mode.stance),
            template_com=np.array(frame.point(self._origin + x, self.observer.ground + y)),
            template_velocity=frame.outward(clock.reference[2:4]).copy(),
            template_force=frame.outward(clock.forces).copy(),
            swing_reference=swing,
        )

    @property
    def _origin(self) -> float:
        """x of the template's rear toe in the world: at the foot, if that stands [m]."""
        return float(self.observer.now.toes[0]) if self.mode.stance else self.supervisor.toe

    def first_pitch(self) -> float:
        """Of the trunk where the route begins [rad]."""
        goal = self.supervisor.first_goal()
        return self.options.lean.pitch(goal, self.options.trunk_pitch)

    def start(
        self,
        rear: int = 0,
        swung: tuple[float, float] | None = None,
        *,
        first: tuple[Planner, Node] | None = None,
    ) -> None:
        """Begin where the route begins; the robot's model must be up to date.

        Args:
            rear: the foot that is the rear leg's.
            swung: time since rear and front foot left the ground [s], for those in the air; None:
                they are in the middle of their swings.
            first: planner and node that ``supervisor.begin`` has returned for this run; None: it is
                called here.

        Raises:
            ParameterError: if the route begins with a stride for which there is no planner.
        """
        section = self.supervisor.route.section
        planner, node = first or self.supervisor.begin(section)
        self.learners.lean.reset()
        self.frame.reset()
        self._enter(node.name)
        self.feet.begin(rear)
        half = 0.5 * planner.gait.step_duration
        for leg in self.mode.swings:
            self._lift(self.feet.foot_of_leg[leg], (swung or (half, half))[leg])
        if node.stance:
            # Of two feet on the ground the front one landed last.
            self.feet.landed = self.feet.foot_of_leg[self.mode.stance[-1]]
        self.observer.begin(bool(node.stance))
        self.ground.begin(self.feet.landed)
        self.contacts.begin()
        self._sense()
        self._decide(section)
        self._slope_unknown = len(self.mode.stance) > 1

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
            contact: (2,) whether each foot touches the ground, as its sensor says.
            dt: control period [s].
            force: (2, d) the ground's force on each foot, forward first and up last [N], by which
                a foot in the air tells a wall, and one that slides how slippery the ground is;
                None: they tell neither.

        Raises:
            DivergedError: if the state is not finite.
            ParameterError: if a planner, the route or a task answers with nonsense.
        """
        self.robot.update(*self.ground.enter(q, v))
        if force is not None:
            force = self.frame.inward(force)
        self.contacts.update(contact, force, self._expected(), dt)
        if force is not None:
            self._update_friction(force, dt)
        self.feet.swing_time += dt
        self._sense()
        if self._slope_unknown:
            self._find_first_slope()
        self._advance()
        q, v = self.frame.enter(q, v)
        self._replan()
        speed = self.robot.com_velocity[0]
        self.path_clock.move(self.mode, self.supervisor, self.observer.now, speed, dt)
        self._swing(q, v, dt)
        self._track(q, v, dt)
        self.observer.predict_velocity(dt)
        self.time += dt
        solution = self.qp.solve(self.mode.tasks, self._stance(), self.learners.load.factor)
        if self.frame.angle != 0.0:
            outward = self.frame.outward(solution.acceleration)
            solution = solution._replace(acceleration=outward)
        return solution

    # -- modes and plans ----

    def _find_first_slope(self) -> None:
        """Both feet stand where a run begins: the line through them is the ground."""
        self._slope_unknown = False
        other, landed = (self.feet.foot_of_leg[leg] for leg in self.mode.stance)
        self.ground.stand(other, landed)
        if self._tilt_axes(self.ground.slope.slope, landed):
            self.supervisor.follow(self.node, self.observer.now, self.time)
            self.path_clock.restart()

    def _expected(self) -> list[bool | None]:
        """Whether each foot is to touch the ground now; None: it is due to land.

        An overdue foot is no longer due: where it meets the ground then, nothing has foretold.
        """
        expected: list[bool | None] = [False, False]
        for stance in self.mode.stance:
            expected[self.feet.foot_of_leg[stance]] = True
        supervisor, leg = self.supervisor, self.mode.next_touchdown_leg
        if leg is not None and not supervisor.without_touchdown:
            foot = self.feet.foot_of_leg[leg]
            due = supervisor.time_of(Event.TOUCHDOWN) - self.path_clock.time
            if due <= self._early and self.robot.foot_velocity[foot, 1] >= -self._sinking:
                expected[foot] = None
        return expected

    def _sense(self) -> None:
        control, standing = self.mode.control, self.contacts.standing
        stands = bool(self.mode.stance)
        self.observer.read(standing, stands, control.momentum_speed, control.rolling_contact)

    def _advance(self) -> None:
        """Take the first edge of the present node that the robot fires."""
        for edge in self.mode.outgoing_edges:
            due = self.supervisor.event_times[edge.event] - self.path_clock.time
            if self._guards.fired(edge, self.observer.now, due):
                self._traverse(edge)
                return

    def _traverse(self, edge: Edge) -> None:
        """Go along an edge: roles and swings of the feet, plan, node."""
        before, stood, roles = self.mode, self._standing(), self.feet.foot_of_leg
        self.supervisor.pass_event(edge.event)
        self._enter(str(edge.target))
        self.feet.apply(edge.reset)
        lifted = stood - self._standing()
        # What the ground does next is not known; the best guess is its slope so far.
        leans = bool(lifted and self.mode.stance) and self._tilt_axes(
            self.ground.slope.slope, self.feet.foot_of_leg[self.mode.stance[0]]
        )
        for foot in lifted:
            self._lift(foot)
        observer, stance = self.observer, self.mode.stance
        if self.feet.landed in lifted and stance:
            # A step back: the other foot is the one on the ground.
            observer.stand_on(self.feet.foot_of_leg[stance[0]])
        if lifted or self.feet.foot_of_leg != roles:
            observer.take_roles(self.mode.control.rolling_contact)
            self.supervisor.set_rear_toe(self.feet.foot_of_leg[Leg.REAR])
        momentum = self.mode.control.momentum_speed
        if momentum is not before.control.momentum_speed:
            observer.read_speed(momentum)
        if leans or (lifted and not stance):
            # In flight no force moves the CoM: its path, and all footholds on it, are certain.
            self.supervisor.follow(self.node, observer.now, self.time)
            self.path_clock.restart()
        placed = PLACED.get(edge.reset)
        if placed is not None:
            self._touch_down(placed)
        if edge.section:
            self._decide(section_of(edge.event))

    def _enter(self, node: str) -> None:
        self.mode = self._modes[node]

    def _lift(self, foot: int, swung: float = 0.0) -> None:
        """A swing keeps the shape with which it began, whatever the next stride's is."""
        supervisor = self.supervisor
        goal = supervisor.goal if supervisor.deciding else supervisor.first_goal()
        self.feet.swing[foot].options = self.mode.swing or self.swings.towards(goal)
        self.feet.lift(foot, self.robot, swung)

    def _standing(self) -> set[int]:
        return {self.feet.foot_of_leg[leg] for leg in self.mode.stance}

    def _touch_down(self, leg: Leg) -> None:
        """The template's ground is now that of the foot which has landed.

        Where the table says ``use_pre_impact_velocity``, the path goes on with the speed before it.
        """
        leans = self._update_slope(self.feet.foot_of_leg[leg])
        higher, s = self.observer.land(leg), self.observer.now
        if leans:
            self.supervisor.choose_assist(self.node, s)
        if self.mode.control.use_pre_impact_velocity:
            s = replace(s, state=np.concatenate((s.state[:2], self.observer.pre_impact_velocity)))
        chooses = self.mode.control.replan_at_touchdown
        cause = Cause.TOUCHDOWN if chooses else Cause.GROUND_HEIGHT
        replan = self.supervisor.replan
        self._enter(replan(cause, self.node, s, self.time, height_error=higher).name)
        self.path_clock.restart()

    def _update_slope(self, foot: int) -> bool:
        """A foot has landed: learn the slope; if it is off, take the line through both feet."""
        off = self.robot.foot_position[foot, 1] - self.observer.ground
        self.ground.land(foot)
        leans = abs(off) > self.supervisor.height_error
        return leans and self._tilt_axes(self.ground.slope.last, foot)

    def _tilt_axes(self, slope: float, foot: int) -> bool:
        """Turn the axes about a foot, as far as the planner knows slopes; whether they turned."""
        leans = self.ground.tilt(slope, foot, self.supervisor, self.observer)
        if leans:
            self._sense()
        return leans

    def _decide(self, section: Section) -> None:
        s, learners = self.observer.now, self.learners
        if self.supervisor.deciding:
            learners.end_stride(section, s.state, self.supervisor.decision.nominal)
        self._enter(self.supervisor.decide(section, s, self.time, learners.state).name)
        learners.begin_stride(self.supervisor, self.mode.trimmed)
        self.path_clock.restart()

    def _replan(self) -> None:
        """Plan from here where a touchdown is overdue or the robot has left its path."""
        s, supervisor, clock = self.observer.now, self.supervisor, self.path_clock
        deviation = s.state[2] - clock.reference[2]
        cause = supervisor.surprise(self.node, deviation, clock.time, self.time)
        if cause is None:
            return
        node = supervisor.replan(cause, self.node, s, self.time, phase_time=clock.time)
        self._enter(node.name)
        self.learners.lean.aim(supervisor.goal)
        self.path_clock.restart()

    # -- references and forces ----

    def _update_friction(self, force: Array, dt: float) -> None:
        """Let the cones be as narrow as the friction that sliding feet have felt."""
        friction = self.learners.friction
        if friction.update(self.contacts.standing, force, self.robot.contact_velocity, dt):
            self.qp.friction = replace(self.options, friction=friction.coefficient).cone

    def _swing(self, q: Array, v: Array, dt: float) -> None:
        """Move the references of the feet in the air towards their footholds."""
        hips, self.references.hip_speed = self.robot.hips(q, v)
        mode, time = self.mode, self.path_clock.time
        self._swing_controller.advance(mode, self.supervisor, self.observer, time, hips, dt)

    def _track(self, q: Array, v: Array, dt: float) -> None:
        """Let the phase's tasks write what they ask for."""
        s, references, mode = self.observer.now, self.references, self.mode
        references.com_now[:] = s.state
        references.com_now[0] -= s.toes[0]
        references.com_push = self.learners.trim.acceleration if mode.control.trim_momentum else 0.0
        pitch, turning = self.robot.trunk(q, v)
        references.pitch_now[0], references.pitch_now[1] = pitch, turning
        tilt = self.frame.angle  # the trunk is held by the vertical
        references.pitch = self.learners.lean.advance(pitch - tilt, dt) + tilt
        references.feet = self.feet.foot_of_leg
        mode.tasks.write(self.robot, references)
        if mode.control.estimate_load and mode.com is not None:
            self.learners.load.observe(mode.com.lift(references), dt)

    def _stance(self) -> Stance:
        """The feet on the ground, the template's forces on them, and how far they unload."""
        mode, forces, feet = self.mode, self.path_clock.forces, self.feet.foot_of_leg
        for leg in mode.control.unload_legs:
            weight = self.robot.mass * self.robot.gravity
            mode.cap[leg] = unload_cap(forces[leg, 1], weight)
        legs = mode.stance
        return Stance(tuple([feet[leg] for leg in legs]), forces[: len(legs)].ravel(), mode.cap)


class SwingController:
    """Moves the swings' references from tick to tick.

    Args:
        robot: the model; every tick updates it.
        feet: their roles and swings.
        contacts: which walls they have met.
        references: where it is kept how far each foot may be moved.
    """

    def __init__(
        self, robot: Biped, feet: Feet, contacts: ContactMonitor, references: References
    ) -> None:
        self._robot, self._feet = robot, feet
        self._contacts, self._references = contacts, references

    def advance(
        self,
        mode: Mode,
        supervisor: StrideSupervisor,
        observer: StateObserver,
        time: float,
        hips: Array,
        dt: float,
    ) -> None:
        """Move the references of the feet that swing.

        Args:
            mode: of the robot.
            supervisor: which knows where the feet land.
            observer: the robot's state, and the ground's height.
            time: along the path [s].
            hips: (2,) x and y [m].
            dt: duration of the tick [s].
        """
        robot, feet = self._robot, self._feet
        late, hip = self._late_foot(mode, supervisor), hips.tolist()
        for leg in mode.swings:
            foot = feet.foot_of_leg[leg]
            swing = feet.swing[foot]
            landing = supervisor.landing(foot)
            foothold, due = landing.x, landing.time - time
            overdue = foot == late
            if self._contacts.blocked(foot):
                # The path goes on as if an overdue foot had time; it has none to go up again.
                swing.meet_wall(robot.foot_position[foot], foothold, 0.0 if overdue else due, dt)
            elif overdue:
                swing.drop(dt)
            else:
                if not isfinite(foothold):
                    # The template cannot complete the stride; the gait's own foothold is the
                    # best guess.
                    gait = supervisor.planner.gait
                    foothold = observer.now.toes[Leg.REAR] + gait.step_length
                    due = gait.step_duration - feet.swing_time[foot]
                if mode.control.rolling_contact:
                    angle = float(supervisor.decision.controls[Slot.TOUCHDOWN_ANGLE])
                    foothold = rolled(foothold, angle, robot.foot_radius)
                swing.advance(foothold, due, dt, observer.ground)
            self._references.furthest[foot] = swing.furthest(hip, robot.leg_length)

    def _late_foot(self, mode: Mode, supervisor: StrideSupervisor) -> int | None:
        """The foot that should have found the ground by now."""
        leg = mode.next_touchdown_leg
        return (
            None if leg is None or not supervisor.without_touchdown else self._feet.foot_of_leg[leg]
        )
