"""Controller that makes the robot move like the template (Fig. 11).

It moves along the automaton's edges when the robot fires them, plans at every section and again
where a foot has landed or a disturbance came, and turns the plan into references for the whole-body
QP. What a phase needs is looked up in the table of phases: the controller knows no gait.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np

from template_control.arrays import Array, BoolArray
from template_control.checks.checked import checked
from template_control.embedding import tick
from template_control.embedding.free.motion import Course, LateralMotion
from template_control.embedding.ground import SlopeFrame
from template_control.embedding.learners import Learners
from template_control.embedding.modes import PLACED, check_legs, first_fired, modes, set_guards
from template_control.embedding.options import EmbeddingOptions, robot_kind
from template_control.embedding.planners.planner import Cause, Planner, Planners
from template_control.embedding.recovery import NEEDED, Recovery
from template_control.embedding.state import SectionReport, Snapshot, StateObserver
from template_control.embedding.supervisor import StrideSupervisor
from template_control.embedding.swing import Feet, Swings
from template_control.errors import ParameterError
from template_control.estimation.contacts import NO_FORCE, forget_contacts, set_contacts
from template_control.estimation.slope import SlopeEstimate
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.terms import onward
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Leg, Reset
from template_control.slip.maps.section import REST, VLO, Section, section_of
from template_control.slip.scenario.route import Route, SteadyRoute
from template_control.slip.similarity import Scale, scaled
from template_control.structured import keep
from template_control.warm_up import ready
from template_control.whole_body.problem import Matrices
from template_control.whole_body.solver import Solution, WholeBodyQp
from template_control.whole_body.task import References


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
        ParameterError: if there are several planners and no route, or if the options are those of a
            robot with another base.

    Attributes:
        mode: where on the automaton the robot is, and what that asks for.
        supervisor: the stride's decision and the path that follows it.
        swings: shapes of the swings in phases that have none of their own.
        feet: roles and swings of the feet.
        learners: what is learnt from stride to stride.
        slope: the ground's, by the footholds, uphill along the world's x.
        frame: axes that lean with the ground.
        observer: the robot's state in the template's terms.
        references: what the tasks read.
        time: since the start [s].
        qp: the whole-body problem.
        lateral: heading, and footholds to the left and right; None in the plane.
        course: where the robot is to go, by time [s].
        courses: what was taken of it, and where the trunk is to face, one a section.
        memory: (1,) each of ``TICK``, ``ROBOT_DATA`` and ``REFERENCES``, of the last tick.
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
        ready(tick.CONTROL)
        if isinstance(planners, Planner):
            gait = planners.gait
            route = route or SteadyRoute.of(gait, automaton)
            planners = {gait.stride: planners}
        if route is None:
            raise ParameterError("several planners and no route: say which stride comes next")
        scale = Scale.of(route.parameters)
        kind = robot_kind(robot)
        given = options or EmbeddingOptions.of_kind(kind)
        floats = isinstance(robot, FloatingBaseBiped)
        if floats is (given.lateral is None):
            base = "has a floating base" if floats else "is held in its plane"
            raise ParameterError(
                f"{robot.name} {base}, and its embedding has options of kind {given.kind!r}"
                f" {'with' if given.lateral else 'without'} lateral ones: give"
                f" EmbeddingOptions.of_kind({kind!r})"
            )
        o = scaled(replace(given, phases=given.phase_table(), tasks={}), scale)
        self.robot, self.options, self.parameters = robot, o, route.parameters
        self._tick = now = np.zeros(1, tick.TICK)
        now["friction_margin"] = o.qp.friction_margin
        self.learners = Learners(o, self.parameters, robot, now)
        self.slope = SlopeEstimate(self.parameters.rest_length)
        self.frame = SlopeFrame(robot, now["frame"])
        self.references = References(pitch=o.trunk_pitch)
        self.swings = Swings.of(robot, scale, o.swing)
        self.feet = Feet(self.references.foot, now["feet"])
        weight = robot.mass * robot.gravity
        set_contacts(now["contacts"], o.contacts, weight, scale, robot.groups)
        wanted = self.references.com[4:]
        self.observer = StateObserver(robot, self.feet, wanted, now["sensed"], now["mode"])
        set_guards(now["guards"], self.parameters, o.guards)
        check_legs(automaton, robot)
        self._modes = modes(automaton, robot.nv, o.phase_table())
        for mode in self._modes.values():
            mode.tasks.check(robot)
        curved = {name for name, mode in self._modes.items() if mode.control.follow_curve}
        recovers = o.catches and automaton is AUTOMATON and planners.keys() >= NEEDED
        recovery = Recovery(self.parameters) if recovers else None
        rules = o.replan, automaton, curved, recovery
        self.supervisor = StrideSupervisor(route, planners, *rules, now["path"])
        now["path"]["body"][0, 5] = robot.half_length
        self._enter(next(iter(self._modes)))
        self._slope_unknown = False  # the ground under feet that both stand where a run begins
        self.qp = WholeBodyQp(robot, o.qp)
        self.course: Callable[[float], Course] = lambda time: Course()
        self.courses: list[Course] = []
        self.lateral: LateralMotion | None = None
        if isinstance(robot, FloatingBaseBiped) and given.lateral is not None:
            keeps = self.observer.now, self.feet, self.references, now["lateral"]
            self.lateral = LateralMotion(robot, given.lateral, self.supervisor, *keeps)
        self.memory = now, robot.data, self.references.data
        self._memory = *self.memory, self.qp.data
        self._sensed = keep(self._memory)

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return float(self._tick["time"].item())

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
        seen = np.zeros(1, tick.SNAPSHOT)
        tick.look(*self.memory, seen)
        found = dict(zip(tick.SNAPSHOT.names or (), seen[0].item(), strict=True))
        return Snapshot(**{**found, "node": self.node.name})

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
        self.courses.clear()
        if self.lateral is not None:
            gaits = (each.gait for each in (planner, *self.supervisor.planners.values()))
            self.lateral.begin(gaits, self.course(0.0), in_flight=not node.stance)
        self._enter(node.name)
        self.feet.begin(rear)
        half = 0.5 * planner.gait.step_duration
        for leg in self.mode.control.swings:
            self._lift(self.feet.foot_of_leg[leg], (swung or (half, half))[leg])
        if node.stance:
            # Of two feet on the ground the front one landed last.
            self.feet.landed = self.feet.foot_of_leg[self.node.stance[-1]]
        self.observer.begin(bool(node.stance))
        self.slope.begin(self.frame.foothold(self.feet.landed))
        if not node.stance:
            # The liftoff before has made the foot that stood the front leg's.
            self.feet.landed = self.feet.foot_of_leg[Leg.FRONT]
        forget_contacts(self._tick["contacts"])
        self.observer.read()
        self._decide(section)
        self._slope_unknown = len(self.node.stance) > 1 and self.frame.turns
        self._publish()

    def tick(
        self,
        q: Array,
        v: Array,
        contact: BoolArray,
        dt: float,
        force: Array | None = None,
    ) -> Solution:
        """Torques for the next ``dt`` seconds.

        Args:
            q: (nq,) measured configuration.
            v: (nv,) measured velocity.
            contact: (n,) whether each contact touches the ground, as its sensor says.
            dt: control period [s].
            force: (n, d) the ground's force on each, forward first and up last [N], by which
                a foot in the air shows a wall, and one that slides how slippery the ground is;
                None: they show neither. Feet that also swing sideways show no walls.

        Raises:
            DivergedError: if the state is not finite.
            ParameterError: if a planner, the route or a task answers with nonsense.
        """
        self.robot.update(*self.frame.enter(q, v))
        felt = NO_FORCE if force is None or self.lateral is not None else force
        found = tick.sense(self._sensed, contact, self.frame.inward(felt), dt)
        if found == tick.DIVERGED:
            raise self.observer.diverged()
        if found != tick.QUIET or self._slope_unknown:
            self._decide_anew()
        solution = self._act(dt)
        if self.frame.angle != 0.0:
            solution = solution._replace(acceleration=self.frame.leave(solution.acceleration))
        if force is not None and self.lateral is not None:
            felt = force @ self.lateral.robot.axes
            tick.feel_friction(self._tick, self.robot.data, self.qp.data, felt, dt)
        return solution

    def lateral_state(self) -> Array:
        """(2,) y of a floating-base robot's CoM, and dy/dt as the forward speed has it."""
        assert self.lateral is not None
        flag = self.mode.control.momentum_speed
        return self.lateral.state(self.observer.now.state[1], flag)

    def _decide_anew(self) -> None:
        """See to what has happened: an edge of the present node, or a plan that is due."""
        if self._slope_unknown:
            self._find_first_slope()
        edge = first_fired(self._tick)
        if edge >= 0:
            self._traverse(self.mode.outgoing_edges[edge])
        self._replan()
        self._publish()

    def _publish(self) -> None:
        """Write the plan to where ticks read it."""
        tick.stand(*self._memory)
        self._tick["trim"] = self.learners.trim.acceleration
        path, sideways = self.supervisor.path, None
        if self.lateral is not None:
            sideways = self.lateral.planner.follow(path, self.supervisor.feet)
        self._plan: tuple[Any, ...] = tuple(path.curve), sideways
        self._room: Matrices | None = None  # all of ``_kept`` is to be kept anew

    def _act(self, dt: float) -> Solution:
        """References, rows and torques."""
        qp, tasks = self.qp, self.mode.tasks
        room, found = qp.room(self.learners.load.factor), qp.answer_arrays()
        if room is not self._room:
            memory, rows = (*self._memory, self.robot.arrays), (tasks.program, tasks.table)
            self._room, self._kept = room, keep((memory, self._plan, rows, room))
        if tasks.others:
            tick.advance(self._kept, dt)
            tasks.write_others(self.robot, self.references)
            kind = tick.solve(self._kept, found)
        else:
            kind = tick.act(self._kept, found, dt)
        return qp.finish(kind, tasks, found)

    def _find_first_slope(self) -> None:
        """Both feet stand where a run begins: the line through them is the ground."""
        self._slope_unknown = False
        rear, front = (self.feet.foot_of_leg[leg] for leg in self.node.stance)
        self.slope.stand(self.frame.foothold(rear), self.frame.foothold(front))
        if self._tilt_axes(self.slope.slope, front):
            self.supervisor.follow(self.node, self.observer.now, self.time)
            self._publish()

    def _traverse(self, edge: Edge) -> None:
        """Go along an edge: roles and swings of the feet, plan, node."""
        before, stood, roles = self.mode, self._standing(), self.feet.foot_of_leg
        self.supervisor.pass_event(edge.event)
        self._enter(str(edge.target))
        self.feet.apply(edge.reset)
        stands, observer = self._standing(), self.observer
        lifted = stood - stands
        rear = self.feet.foot_of_leg[Leg.REAR]
        # What the ground does next is not known; the best guess is its slope so far.
        leans = bool(lifted and stands) and self._tilt_axes(self.slope.slope, rear)
        for foot in lifted:
            self._lift(foot)
        if self.feet.landed in lifted and stands:
            # A step back: the other foot is the one on the ground.
            observer.stand_on(rear)
        if lifted or self.feet.foot_of_leg != roles:
            observer.take_roles()
            self.supervisor.set_rear_toe(rear)
        if self.mode.control.momentum_speed is not before.control.momentum_speed:
            observer.read_speed()
        if leans or (lifted and not stands):
            # In flight no force moves the CoM: its path, and all footholds on it, are certain.
            self.supervisor.follow(self.node, observer.now, self.time)
        placed = PLACED.get(edge.reset)
        if placed is not None:
            self._touch_down(placed)
        if edge.section:
            self._decide(section_of(edge.event))

    def _enter(self, node: str) -> None:
        self.mode = self._modes[node]
        self._tick["mode"] = self.mode.data

    def _lift(self, foot: int, swung: float = 0.0) -> None:
        """A swing keeps the shape with which it began, whatever the next stride's is."""
        shape = self.mode.control.swing or self.swings.towards(self.supervisor.goal)
        self.feet.lift(foot, self.robot, shape, swung)
        if self.lateral is not None:
            self.lateral.lift(foot)

    def _standing(self) -> set[int]:
        return {self.feet.foot_of_leg[leg] for leg in self.node.stance}

    def _touch_down(self, leg: Leg) -> None:
        """The template's ground is now that of the foot which has landed.

        Where the table says ``use_pre_impact_velocity``, the path goes on with the speed before it.
        """
        foot = self.feet.foot_of_leg[leg]
        if self.lateral is not None:
            self.lateral.touch_down(foot, self.time - self.supervisor.begun_at)
        off = self.robot.foot_position[foot, 1] - self.observer.ground
        self.slope.land(self.frame.foothold(foot), self.frame.foothold(1 - foot))
        # Off the template's ground, the slope is that of the line through both feet.
        leans = abs(off) > self.supervisor.height_error and self._tilt_axes(self.slope.last, foot)
        # A pressure that is planned over both feet has nothing to do with the legs' lengths.
        springs = not (self.mode.control.follow_curve and self.robot.half_length)
        higher, s = self.observer.land(leg, springs), self.observer.now
        if leans:
            self.supervisor.choose_assist(self.node, s)
        if self.mode.control.use_pre_impact_velocity:
            s = replace(s, state=np.concatenate((s.state[:2], self.observer.pre_impact_velocity)))
        chooses = self.mode.control.replan_at_touchdown
        cause = Cause.TOUCHDOWN if chooses else Cause.GROUND_HEIGHT
        node = self.supervisor.replan(cause, self.node, s, self.time, height_error=higher)
        self._enter(node.name)

    def _tilt_axes(self, slope: float, foot: int) -> bool:
        """Turn the axes about a foot, as far as the planner knows slopes; whether they turned."""
        robot, frame, before = self.robot, self.frame, self.observer.pre_impact_velocity
        known = self.supervisor.on_slope(onward(robot.facing) * slope) if frame.turns else 0.0
        if known == frame.angle:
            return False
        in_world = frame.outward(before)
        frame.tilt(known, robot.foot_position[foot].copy())
        before[:] = frame.inward(in_world)
        robot.update(*frame.enter(*frame.raw_state))
        self.observer.read()
        return True

    def _decide(self, section: Section) -> None:
        s, learners, lateral = self.observer.now, self.learners, self.lateral
        supervisor, reached = self.supervisor, None
        # In the plane a robot turns round only where it rests.
        asks = lateral is not None or section is REST
        course = self.course(self.time) if asks else Course()
        if supervisor.reports:
            nominal, ended = supervisor.decision.nominal, section.of(s.state)
            if self._turn(section, course, nominal):
                self.robot.update(*self.frame.enter(*self.frame.raw_state))
                self.observer.read()
                if section is REST:
                    self._face_ahead()
                reached = ended if section is VLO else None
            learners.end_stride(section, s.state, nominal)
        if section is REST and self.robot.patches:
            self._face_ahead()  # a foot may have been set down behind the other one
        node = supervisor.decide(section, s, self.time, learners.state, reached)
        self._enter(node.name)
        learners.begin_stride(supervisor, self.mode.trimmed)
        taken = Course()
        if lateral is not None:
            now, com = self.time, self.lateral_state()
            self._enter(lateral.begin_stride(section, course, self.node, com, now).name)
            taken = lateral.taken
        self.courses.append(taken._replace(facing=self.robot.facing))

    def _turn(self, section: Section, course: Course, nominal: bool) -> bool:
        """Turn the axes to where the robot is to go; whether it has to be read again.

        The step that closes the feet after a walk goes on where the walk went.
        """
        if section is REST and self.supervisor.goal.closes:
            course = course._replace(facing=nan)
        if self.lateral is not None:
            return self.lateral.end_stride(course, self.lateral_state(), nominal, section)
        turns = section is REST and course.turns_round(self.robot)
        if turns:
            self.frame.turn_round()
            self.observer.pre_impact_velocity[0] *= -1.0
            self.learners.lean.turn_round()
        return turns

    def _face_ahead(self) -> None:
        """Of two feet that stand, the one that is ahead where the robot now goes is the front's."""
        rear, front = self.feet.foot_of_leg
        ahead = self.robot.foot_position[:, 0]
        if ahead[front] < ahead[rear]:
            self.feet.apply(Reset.SWAP)
            self.observer.stand_on(rear)
            self.observer.take_roles()

    def _replan(self) -> None:
        """Plan from here where a touchdown is overdue or the robot has left its path."""
        s, supervisor, now = self.observer.now, self.supervisor, self.time
        deviation = s.state[2] - self.references.com[2]
        along, node = supervisor.phase_time, None
        cause = supervisor.surprise(self.node, deviation, along, now)
        if self.lateral is not None:
            node = self.lateral.catch(cause, self.mode, now)
        if node is None and cause is not None:
            node = supervisor.replan(cause, self.node, s, now, phase_time=along)
        if node is not None:
            self._enter(node.name)
            self.learners.lean.aim(supervisor.goal)
