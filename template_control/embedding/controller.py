"""The controller that makes the robot move like the template (Fig. 11).

It follows the automaton, and turns the plan into references for the whole-body QP. What a phase
needs, which tasks, which feet, which clock, is looked up in the table of phases: the controller
knows no gait.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.embedding.following.automaton_follower import AutomatonFollower
from template_control.embedding.following.feet_in_air import FeetInAir
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.planner import Planner, Planners
from template_control.embedding.planners.walking.walk_kernels import CONTROL
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.scenario.route import Route, SteadyRoute
from template_control.slip.similarity import Scale, scaled
from template_control.warm_up import ready
from template_control.whole_body.solver import Solution, Stance, WholeBodyQp

Array = NDArray[np.float64]


class EmbeddingController(AutomatonFollower):
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

    Attributes: those of :class:`~.following.automaton_follower.AutomatonFollower`, and
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
        o = scaled(options or EmbeddingOptions(), Scale.of(route.parameters))
        super().__init__(robot, planners, o, route, automaton)
        self.qp = WholeBodyQp(robot, o)
        self._in_air = FeetInAir(robot, self.feet, self.contacts, self.references)

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
            self._feel_friction(force, dt)
        self.feet.swing_time += dt
        self._sense()
        if self._unfelt:
            self._feel_ground()
        self._advance()
        q, v = self.frame.enter(q, v)
        self._plan_again()
        speed = self.robot.com_velocity[0]
        self.place.move(self.station, self.planning, self.sensing.now, speed, dt)
        self._swing(q, v, dt)
        self._track(q, v, dt)
        self.sensing.foresee(dt)
        self.time += dt
        solution = self.qp.solve(self.station.tasks, self._stance(), self.learners.load.factor)
        if self.frame.angle != 0.0:
            outward = self.frame.outward(solution.acceleration)
            solution = solution._replace(acceleration=outward)
        return solution

    def _feel_friction(self, force: Array, dt: float) -> None:
        """Let the cones be as narrow as the friction that sliding feet have felt."""
        friction = self.learners.friction
        if friction.feel(self.contacts.standing, force, self.robot.contact_velocity, dt):
            self.qp.friction = replace(self.options, friction=friction.coefficient).cone

    def _swing(self, q: Array, v: Array, dt: float) -> None:
        """Move the references of the feet in the air towards their footholds."""
        hips, self.references.hip_speed = self.robot.hips(q, v)
        station, time = self.station, self.place.time
        self._in_air.advance(station, self.planning, self.sensing, time, hips, dt)

    def _track(self, q: Array, v: Array, dt: float) -> None:
        """Let the phase's tasks write what they ask for."""
        s, references, station = self.sensing.now, self.references, self.station
        references.com_now[:] = s.state
        references.com_now[0] -= s.toes[0]
        references.com_push = self.learners.trim.acceleration if station.control.trims else 0.0
        pitch, turning = self.robot.trunk(q, v)
        references.pitch_now[0], references.pitch_now[1] = pitch, turning
        tilt = self.frame.angle  # the trunk is held by the vertical
        references.pitch = self.learners.lean.advance(pitch - tilt, dt) + tilt
        references.feet = self.feet.of
        station.tasks.write(self.robot, references)
        if station.control.weighs and station.com is not None:
            self.learners.load.observe(station.com.lift(references), dt)

    def _stance(self) -> Stance:
        """The feet on the ground, the template's forces on them, and how far they unload."""
        station, forces, feet = self.station, self.place.forces, self.feet.of
        for leg in station.control.unloads:
            weight = self.robot.mass * self.robot.gravity
            station.cap[leg] = self.options.unload.cap(forces[leg, 1], weight)
        legs = station.stance
        return Stance(tuple([feet[leg] for leg in legs]), forces[: len(legs)].ravel(), station.cap)
