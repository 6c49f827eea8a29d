"""Slopes: the template's gait there, what tells the slope, the axes that turn, the robot's walk."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import template_control as tc
from template_control.embedding.ground import FRAME, SlopeFrame
from template_control.embedding.planners.planner import Context
from template_control.embedding.state import TemplateState
from template_control.errors import GaitError
from template_control.estimation.slope import SlopeEstimate
from template_control.slip import MapKind, ReturnMap, on_slope, simulate_stride, with_push_off
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.gaits.gait import uncontrolled
from template_control.slip.maps.section import VLO
from template_control.slip.path import leg_forces

STEEP = np.radians([4.0, -4.0])


@pytest.fixture
def level_gait(gait):
    """That of level ground, in the paper's steps."""
    return gait


def integrate(p, state, legs, guard):
    """DOP853 until ``guard(state)`` rises through 0, in axes that lie on the slope.

    ``legs`` holds toe and stiffness of each.
    """

    def rates(_, s):
        a = -p.gravity * np.array([np.sin(p.slope), np.cos(p.slope)])
        a[0] += p.assist if len(legs) == 2 else 0.0
        for toe, k in legs:
            leg = s[:2] - [toe, 0.0]
            length = np.hypot(*leg)
            a += k * (p.rest_length - length) / (p.mass * length) * leg
        return [*s[2:], *a]

    def event(_, s):
        return guard(s)

    event.terminal, event.direction = True, 1.0
    found = solve_ivp(
        rates, (0.0, 3.0), state, method="DOP853", rtol=1e-12, atol=1e-13, events=event
    )
    return found.t_events[0][0], found.y_events[0][0]


def step_by_scipy(gait):
    """The state at the end of a step of a gait, and the time in double stance."""
    p, u = gait.parameters, gait.controls
    alpha, k1, k2 = u[[Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD]]
    _, s = integrate(
        p, VLO.state(gait.vlo), [(0.0, k1)], lambda s: p.rest_length * np.sin(alpha) - s[1]
    )
    toe = s[0] + p.rest_length * np.cos(alpha)
    t1, s = integrate(
        p, s, [(0.0, k1), (toe, k1)], lambda s: (s[0] - 0.5 * toe) * s[2] + s[1] * s[3]
    )
    t2, s = integrate(p, s, [(0.0, k2), (toe, k2)], lambda s: np.hypot(s[0], s[1]) - p.rest_length)
    _, s = integrate(p, s, [(toe, k2)], lambda s: s[0] - toe)
    return s, t1 + t2


@pytest.mark.parametrize("slope", STEEP)
def test_the_gait_on_a_slope_returns_to_its_state(level_gait, slope):
    gait = on_slope(level_gait, slope)
    end, _ = step_by_scipy(gait)
    np.testing.assert_allclose(VLO.of(end), gait.vlo, atol=1e-8)
    assert end[0] == pytest.approx(gait.step_length, abs=1e-8)
    # It is nearly the gait of level ground.
    assert gait.vlo[0] == level_gait.vlo[0]
    np.testing.assert_allclose(gait.vlo, level_gait.vlo, atol=0.003)
    np.testing.assert_allclose(gait.controls, level_gait.controls, rtol=0.025)


@pytest.mark.parametrize("slope", STEEP)
def test_two_legs_give_what_the_climb_takes(level_gait, slope):
    """Over a step the assist does the work of the climb, but for what unequal stiffnesses do."""
    gait = on_slope(level_gait, slope)
    p = gait.parameters
    stride = simulate_stride(p, STRIDE_START["w"], VLO.state(gait.vlo), gait.controls)
    both = (stride.meta[:, 5] > 0.0) & (stride.meta[:, 6] > 0.0)
    begin, end = stride.meta[both, 0].min(), stride.meta[both, :2].sum(axis=1).max()
    travelled = np.diff(stride.sample([begin, end])[:, 0])[0]
    climb = p.gravity * np.sin(slope) * gait.step_length
    assert p.assist * travelled == pytest.approx(climb, rel=0.03)


def test_no_gait_climbs_a_wall(level_gait):
    with pytest.raises(GaitError, match="on a slope of 40 deg: take a gentler slope"):
        on_slope(level_gait, np.radians(40.0))
    assert on_slope(level_gait, 0.0) is level_gait


def test_a_gait_with_push_off_has_slopes_too(level_gait):
    gait = on_slope(with_push_off(level_gait), np.radians(3.0))
    end, outcome = ReturnMap(gait.parameters, "wp").step(gait.vlo, gait.controls)
    assert outcome is tc.slip.Outcome.SECTION
    np.testing.assert_allclose(end, gait.vlo, atol=1e-8)


@pytest.mark.parametrize("slope", STEEP)
def test_the_improved_map_knows_slopes(level_gait, slope):
    gait = on_slope(level_gait, slope)
    exact, _ = ReturnMap(gait.parameters).step(gait.vlo, gait.controls)
    fast, _ = ReturnMap(gait.parameters, "w", MapKind.IMPROVED).step(gait.vlo, gait.controls)
    level = replace(gait.parameters, slope=0.0, assist=0.0)
    flat, _ = ReturnMap(level, "w", MapKind.IMPROVED).step(level_gait.vlo, level_gait.controls)
    assert np.abs(fast - exact).max() < 3.0 * max(np.abs(flat - level_gait.vlo).max(), 1e-3)


def test_feet_bear_the_assist_between_them(level_gait):
    gait = on_slope(level_gait, np.radians(2.0))
    p = gait.parameters
    stride = simulate_stride(p, STRIDE_START["w"], VLO.state(gait.vlo), gait.controls)
    body, forces = np.array([p.mass, *p.gravity_parts, p.rest_length, p.assist]), np.empty((2, 2))
    for row in stride.meta:
        s = stride.sample(row[0] + 0.5 * row[1])[0]
        leg_forces(row, 0.0, s, body, forces)
        down = p.mass * p.gravity * np.array([np.sin(p.slope), np.cos(p.slope)])
        np.testing.assert_allclose(forces.sum(axis=0), p.mass * s[4:] + down, rtol=1e-9)


def walk_over(estimate, heights, length=0.64):
    estimate.begin((0.0, heights[0]))
    told = []
    for i, height in enumerate(heights[1:]):
        estimate.land(((i + 1) * length, height), (i * length, heights[i]))
        told.append(estimate.slope)
    return np.array(told)


def test_a_slope_is_known_after_its_second_foothold():
    rise = 0.64 * np.tan(0.07)
    told = walk_over(SlopeEstimate(1.0), [0.0, 0.0, 0.0, rise, 2.0 * rise, 3.0 * rise])
    np.testing.assert_allclose(told[:2], 0.0)
    assert 0.02 < told[2] < 0.05
    np.testing.assert_allclose(told[3:], 0.07, atol=1e-12)


def test_a_single_step_is_no_slope_for_long():
    estimate = SlopeEstimate(1.0)
    told = walk_over(estimate, [0.0, 0.0, 0.03, 0.03, 0.03])
    assert abs(told).max() < 0.6 * np.arctan(0.03 / 0.64)
    assert told[-1] == 0.0
    estimate.land((6.0 * 0.64, 0.03), (5.0 * 0.64, 0.0))  # the other foot has slid off an edge
    assert estimate.last == pytest.approx(np.arctan(0.03 / 0.64))
    estimate.begin((0.0, 0.5))
    assert estimate.slope == estimate.last == 0.0


def test_level_ground_that_feet_press_into_is_level():
    draw = np.random.default_rng(1)
    told = walk_over(SlopeEstimate(1.0), draw.uniform(-2e-4, 2e-4, 50))
    np.testing.assert_array_equal(told, 0.0)


def test_axes_turn_about_a_place_and_back():
    robot = tc.load_robot("five-link")
    q, v = np.array([0.3, 0.9, 0.1, 0.4, -0.5, -0.2, -0.3]), np.linspace(-1.0, 1.0, 7)
    robot.update(q, v)
    com, hinges = robot.com.copy(), robot.nonlinear_effects[3:].copy()
    energy = 0.5 * v @ robot.mass_matrix @ v
    place = robot.foot_position[0].copy()
    frame = SlopeFrame(robot, np.zeros(1, FRAME))
    frame.tilt(0.1, place)
    inside, speed = frame.enter(q, v)
    robot.update(inside, speed)
    np.testing.assert_allclose(frame.world(robot.com.copy()), com, atol=1e-12)
    np.testing.assert_allclose(robot.nonlinear_effects[3:], hinges, atol=1e-9)
    assert 0.5 * speed @ robot.mass_matrix @ speed == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(frame.leave(speed), [*v[:2], *speed[2:]], atol=1e-12)
    np.testing.assert_allclose(frame.outward(speed[:2]), v[:2], atol=1e-12)
    np.testing.assert_allclose(frame.world(place), place, atol=1e-12)
    robot.update(q, v)
    weight = robot.nonlinear_effects[:2].copy()
    frame.reset()
    robot.update(q, v)
    turned = [[np.cos(0.1), np.sin(0.1)], [-np.sin(0.1), np.cos(0.1)]]
    bias = robot.mass * np.array([0.0, robot.gravity])
    np.testing.assert_allclose(
        weight - turned @ bias, robot.nonlinear_effects[:2] - bias, atol=1e-9
    )


def test_a_robot_that_goes_backward_is_seen_from_behind():
    robot = tc.load_robot("five-link")
    q, v = np.array([0.3, 0.9, 0.1, 0.4, -0.5, -0.2, -0.3]), np.linspace(-1.0, 1.0, 7)
    frame = SlopeFrame(robot, np.zeros(1, FRAME))
    frame.tilt(0.1, np.zeros(2))
    robot.update(*frame.enter(q, v))
    names = ("com", "com_velocity", "com_bias", "foot_position", "foot_velocity", "foot_bias")
    names += ("hips", "angular_momentum", "angular_momentum_bias", "pitch", "pitch_rate")
    before = {name: np.copy(getattr(robot, name)) for name in names}
    rows = robot.com_jacobian.copy(), robot.angular_momentum_jacobian.copy()
    feet, places = robot.foot_jacobian.copy(), frame.world(robot.foot_position.copy())
    frame.turn_round()
    assert frame.angle == -0.1
    robot.update(*frame.enter(q, v))
    for name in names:
        planar = before[name].ndim > 0
        turned = before[name] * ((-1.0, 1.0) if planar else -1.0)
        np.testing.assert_array_equal(getattr(robot, name), turned)
    np.testing.assert_array_equal(robot.com_jacobian, rows[0] * [[-1.0], [1.0]])
    np.testing.assert_array_equal(robot.angular_momentum_jacobian, -rows[1])
    np.testing.assert_array_equal(robot.foot_jacobian, feet * [[-1.0], [1.0]])
    np.testing.assert_allclose(frame.world(robot.foot_position.copy()), places, atol=1e-12)
    # A slope that falls on the way back, and another one about a place that keeps its coordinates.
    place = robot.com.copy()
    world = frame.world(place)
    frame.tilt(0.05, place)
    np.testing.assert_allclose(frame.world(place), world, atol=1e-12)
    robot.update(*frame.enter(q, v))
    np.testing.assert_allclose(robot.com, place, atol=1e-12)
    np.testing.assert_allclose(frame.inward(frame.outward(place)), place, atol=1e-12)
    frame.reset()
    assert frame.of_world


def test_a_planner_goes_back_to_level_ground(level_gait):
    planner = tc.LqrPlanner(level_gait)
    before = planner.decide(Context(level_gait.vlo))
    there = on_slope(level_gait, 0.05)
    assert planner.on_slope(0.05) == there.parameters
    uphill = planner.decide(Context(there.vlo, level_gait.vlo))
    assert uphill.nominal
    np.testing.assert_allclose(uphill.predicted, there.vlo, atol=1e-6)
    planner.reset()
    assert planner.gait is level_gait
    np.testing.assert_array_equal(planner.decide(Context(level_gait.vlo)).controls, before.controls)


@pytest.fixture
def standing(level_gait):
    """A function that makes a controller which has begun to walk with a planner."""

    def begin(planner):
        robot = tc.load_robot("five-link")
        controller = tc.EmbeddingController(robot, planner)
        robot.update(robot.neutral(), np.zeros(robot.nv))
        controller.start()
        return controller

    return begin


@pytest.mark.parametrize("speed", [1.0, 1.2])
def test_two_legs_take_a_drift_away(level_gait, standing, speed):
    """From a touchdown that is too slow or fast, without another angle or stiffness."""
    supervisor = standing(tc.LqrPlanner(level_gait)).supervisor
    z = level_gait.vlo * [speed / level_gait.vlo[0], 1.0, 1.0]
    p, u = level_gait.parameters, level_gait.controls
    landed = simulate_stride(p, STRIDE_START["w"], VLO.state(z), u).events[0].state
    toe = landed[0] + p.rest_length * np.cos(u[Slot.TOUCHDOWN_ANGLE])
    sensed = TemplateState(state=landed, toes=np.array([0.0, toe]))
    supervisor.decision = replace(supervisor.decision, controls=u)
    rollout, node = supervisor._rollout, AUTOMATON.node("DS_sc^w")
    before, _ = rollout.ahead(node, sensed)(u)
    supervisor.on_slope(0.0)
    supervisor.choose_assist(node, sensed)
    after, _ = rollout.ahead(node, sensed)(u)
    assert np.sign(supervisor.ground.assist) == np.sign(level_gait.vlo[0] - speed)
    drifts = uncontrolled(level_gait) @ np.array([before, after] - level_gait.vlo).T
    assert abs(drifts[1]) < 0.1 * abs(drifts[0])


class Level(tc.embedding.Planner):
    """A planner that knows no slope."""

    def __init__(self, planner):
        self._planner, self.gait = planner, planner.gait

    def decide(self, context):
        return self._planner.decide(context)


def test_a_planner_that_knows_no_slope_keeps_the_axes(level_gait, standing):
    planner = tc.LqrPlanner(level_gait)
    assert standing(planner).supervisor.on_slope(0.05) == 0.05
    level = Level(planner)
    assert standing(level).supervisor.on_slope(0.05) == 0.0


def walked(gait, ground, steps):
    """A record of five-link's walk over a ground."""
    robot, planner, world = tc.load_robot("five-link"), tc.LqrPlanner(gait), tc.PlantOptions
    return tc.simulate(
        tc.Experiment(
            robot, planner=planner, steps=steps, world=world(terrain=ground), record_every=5
        )
    )


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("slope", STEEP)
def test_a_slope_is_walked_at_the_speed_of_level_ground(default_gait, slope):
    ground = tc.Terrain.slope(slope, start=default_gait.parameters.rest_length)
    record = walked(default_gait, ground, 20)
    assert not record.fell
    last = record.section_state[-4:]
    assert last[:, 0] == pytest.approx(default_gait.vlo[0], rel=0.02)
    assert np.abs(last[:, 2]).max() < 0.02
    assert record.section_nominal[-4:].all()


@pytest.mark.slow(seconds=4)
def test_treads_that_fell_the_robot_before_are_walked(default_gait):
    """Its foothold heights are drawn from +-2 cm; with stiffnesses alone it fell in step 19."""
    ground = tc.Terrain.random_steps(0.02, (0.3, 0.6), 1, start=1.0, end=25.0)
    record = walked(default_gait, ground, 22)
    assert not record.fell
    assert np.abs(record.section_state[:, 0] - default_gait.vlo[0]).max() < 0.25
