"""The robot on the automaton: in which node it stands, and which way it goes from there.

It moves along the automaton's edges when the robot fires them, changes roles and swings of the
feet, plans at every section, and plans again where a foot has landed or a disturbance came.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.contacts import ContactMonitor
from template_control.embedding.following.place import Place
from template_control.embedding.following.sloping_ground import SlopingGround
from template_control.embedding.guards import PLACED, RobotGuards
from template_control.embedding.learners.learners import Learners
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.references.feet import Feet
from template_control.embedding.section_report import SectionReport
from template_control.embedding.sensing import Sensing
from template_control.embedding.station import stations
from template_control.embedding.stride_planning import StridePlanning
from template_control.robot.biped import Biped
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Event, Leg
from template_control.slip.maps.section import Section, section_of
from template_control.slip.scenario.route import Route
from template_control.whole_body.task import References

Array = NDArray[np.float64]


class AutomatonFollower:
    """Where the robot is on the automaton and on the template's path, tick by tick.

    Args:
        robot: the (nominal) model; every tick updates it.
        planners: one for each kind of stride of the route.
        options: tuning, scaled to the robot.
        route: which stride comes next, and towards which state.
        automaton: of the route's strides.

    Attributes:
        station: where on the automaton the robot is, and what that asks for.
        planning: the stride's decision and the path that follows it.
        swings: shapes of the swings in phases that have none of their own.
        feet: roles and swings of the feet.
        place: the robot's place on that path, and the template there.
        learners: what is learnt from stride to stride.
        contacts: which feet stand.
        ground: its slope, as the feet tell it.
        frame: axes that lean with the ground.
        sensing: the robot's state in the template's terms.
        references: what the tasks read.
        time: since the start [s].
    """

    def __init__(
        self,
        robot: Biped,
        planners: Planners,
        options: EmbeddingOptions,
        route: Route,
        automaton: Automaton = AUTOMATON,
    ) -> None:
        o = options
        self.robot, self.options, self.parameters = robot, o, route.parameters
        self.learners = Learners(o, self.parameters, robot)
        self.ground = SlopingGround(robot, o.slope, self.parameters.rest_length)
        self.frame = self.ground.frame
        self.references = References(pitch=o.trunk_pitch)
        self.swings = o.swings(robot)
        self.feet = Feet(self.swings.other, self.references.foot)
        self.place = Place(self.parameters, self.references.com)
        self.time = 0.0
        self.sensing = Sensing(robot, self.feet, self.references.com[4:])
        self.contacts = ContactMonitor(o.contacts, robot.mass * robot.gravity)
        self._guards = RobotGuards(self.parameters, o.guards)
        self._stations = stations(automaton, robot.nv, o.phases)
        curved = {name for name, station in self._stations.items() if station.control.curved}
        self.planning = StridePlanning(route, planners, o.replan, automaton, curved)
        self.station = next(iter(self._stations.values()))
        self._unfelt = False  # the ground under feet that both stand where a run begins

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
        x, y = self.place.reference.tolist()[:2]
        return self.frame.point(self._origin + x, self.sensing.ground + y)

    @property
    def _origin(self) -> float:
        """Where the template's rear toe is in the world: at the foot, if that stands [m]."""
        return float(self.sensing.now.toes[0]) if self.station.stance else self.planning.toe

    def first_pitch(self) -> float:
        """Of the trunk where the route begins [rad]."""
        goal = self.planning.first_goal()
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
            first: planner and node that ``planning.begin`` has returned for this run; None: it is
                called here.

        Raises:
            ParameterError: if the route begins with a stride for which there is no planner.
        """
        section = self.planning.route.section
        planner, node = first or self.planning.begin(section)
        self.learners.lean.reset()
        self.frame.reset()
        self._enter(node.name)
        self.feet.begin(rear)
        half = 0.5 * planner.gait.step_duration
        for leg in self.station.swings:
            self._lift(self.feet.of[leg], (swung or (half, half))[leg])
        if node.stance:
            # Of two feet on the ground the front one landed last.
            self.feet.landed = self.feet.of[self.station.stance[-1]]
        self.sensing.begin(bool(node.stance))
        self.ground.begin(self.feet.landed)
        self.contacts.begin()
        self._sense()
        self._decide(section)
        self._unfelt = len(self.station.stance) > 1

    def _feel_ground(self) -> None:
        """Both feet stand where a run begins: the line through them is the ground."""
        self._unfelt = False
        other, landed = (self.feet.of[leg] for leg in self.station.stance)
        self.ground.stand(other, landed)
        if self._lean(self.ground.slope.slope, landed):
            self.planning.follow(self.node, self.sensing.now, self.time)
            self.place.restart()

    def _expected(self) -> list[bool | None]:
        """Whether each foot is to touch the ground now; None: it is due to land.

        An overdue foot is no longer due: where it meets the ground then, nothing has foretold.
        """
        expected: list[bool | None] = [False, False]
        for leg in self.station.stance:
            expected[self.feet.of[leg]] = True
        o, planning, awaited = self.options.contacts, self.planning, self.station.awaited
        if awaited is not None and not planning.reaching:
            foot, due = self.feet.of[awaited], planning.due(Event.TOUCHDOWN) - self.place.time
            if due <= o.early and self.robot.foot_velocity[foot, 1] >= -o.sinking:
                expected[foot] = None
        return expected

    def _sense(self) -> None:
        control, standing = self.station.control, self.contacts.standing
        stands = bool(self.station.stance)
        self.sensing.read(standing, stands, control.momentum_speed, control.rolls)

    def _advance(self) -> None:
        """Take the first edge of the present node that the robot fires."""
        for edge in self.station.ways:
            due = self.planning.dues[edge.event] - self.place.time
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
        # What the ground does next is not known; the best guess is its slope so far.
        leans = bool(lifted and self.station.stance) and self._lean(
            self.ground.slope.slope, self.feet.of[self.station.stance[0]]
        )
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
        if leans or (lifted and not stance):
            # In flight no force moves the CoM: its path, and all footholds on it, are certain.
            self.planning.follow(self.node, sensing.now, self.time)
            self.place.restart()
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
        leans = self._feel_slope(self.feet.of[leg])
        higher, s = self.sensing.land(leg), self.sensing.now
        if leans:
            self.planning.steady(self.node, s)
        if self.station.control.unhit:
            s = replace(s, state=np.concatenate((s.state[:2], self.sensing.unhit)))
        if self.station.control.lands:
            self.planning.land(self.node, s, self.time)
        else:
            self._enter(self.planning.land_off(self.node, s, self.time, higher).name)
        self.place.restart()

    def _feel_slope(self, foot: int) -> bool:
        """A foot has landed: learn the slope; if it is off, take the line through both feet."""
        off = self.robot.foot_position[foot, 1] - self.sensing.ground
        self.ground.land(foot)
        leans = abs(off) > self.options.replan.ground.height
        return leans and self._lean(self.ground.slope.last, foot)

    def _lean(self, slope: float, foot: int) -> bool:
        """Turn the axes about a foot, as far as the planner knows slopes; whether they turned."""
        leans = self.ground.lean(slope, foot, self.planning, self.sensing)
        if leans:
            self._sense()
        return leans

    def _decide(self, section: Section) -> None:
        s, learners = self.sensing.now, self.learners
        if self.reports:
            learners.end_stride(section, s.state, self.reports[-1].decision.nominal)
        self._enter(self.planning.decide(section, s, self.time, learners.learnt).name)
        learners.begin_stride(self.planning, self.station.trimmed)
        self.place.restart()

    def _plan_again(self) -> None:
        """Plan from here where a touchdown is overdue or the robot has left its path."""
        s, planning, place = self.sensing.now, self.planning, self.place
        if planning.overdue(self.node, place.time):
            planning.reach_on(self.node, s, self.time)
        elif planning.surprised(s.state[2] - place.reference[2], place.time, self.time):
            self._enter(planning.reconsider(self.node, s, place.time, self.time).name)
            self.learners.lean.aim(self.reports[-1].goal)
        else:
            return
        self.place.restart()
