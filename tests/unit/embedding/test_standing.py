"""Standing, starting to walk, changing speed and stopping: curves, planners, and the robot."""

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.planners.default import default_planners
from template_control.embedding.planners.planner import Context
from template_control.embedding.standing.curves import StandingOptions, standing_pose
from template_control.embedding.standing.passes import PassTable
from template_control.embedding.standing.planners import BEAT, standing_planners
from template_control.errors import ParameterError, ScenarioError
from template_control.run.options import Push
from template_control.slip import Event, Slot, walking_gait
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.dynamics.timed import Quintic, polynomial
from template_control.slip.gaits.walking_by_speed import paper_walks
from template_control.slip.maps.section import REST, VLO
from template_control.slip.path import leg_forces
from template_control.slip.scenario.route import SteadyRoute
from template_control.slip.scenario.scenario import Scenario, Segment
from template_control.slip.scenario.scenario_route import ScenarioRoute

P = tc.SlipParameters()
OPTIONS = StandingOptions()
FAMILY = paper_walks(P)
BODY = np.array([P.mass, P.gravity, 0.0, P.rest_length, 0.0, 0.0])
STAND, WALK = Segment("stand", duration=1.0), Segment("walk", speed=0.8, duration=2.0)


@pytest.fixture(scope="module")
def passes():
    return PassTable(P, OPTIONS, FAMILY)


@pytest.fixture(scope="module")
def planners():
    return standing_planners(P)


def pressure(stride, times):
    """Centre of pressure of a stride's path, x - y x'' / (g + y'') [m]."""
    x, y, _, _, ax, ay = stride.sample(times).T
    return x - y * ax / (P.gravity + ay)


def outside(p, toes):
    return max(float((p - max(toes)).max()), float((min(toes) - p).max()), 0.0)


# ---- curves


def test_a_quintic_begins_and_ends_as_told():
    draw = np.random.default_rng(0)
    for duration in draw.uniform(1, 2, 5):
        start, end = draw.normal(size=(2, 2, 3))
        found = Quintic.between(start, end, duration)
        np.testing.assert_allclose([polynomial(c, 0.0) for c in found.coefficients], start)
        np.testing.assert_allclose(found.end(), end, atol=1e-12)


def test_forces_without_springs_carry_the_com_along_the_legs():
    """Their sum is m (a + g), and each points from its foot to the CoM."""
    toe, feet = 0.3, np.array([0.3, 0.6])
    com, forces = np.array([0.12, 0.97, 0.1, 0.0, 0.4, -0.3]), np.empty((2, 2))
    leg_forces(np.array([0.0, 1.0, 0.0, *feet, np.nan, np.nan]), toe, com, BODY, forces)
    np.testing.assert_allclose(
        forces.sum(axis=0), P.mass * (com[4:] + [0.0, P.gravity]), rtol=1e-12
    )
    np.testing.assert_allclose(forces[:, 0] / forces[:, 1], (com[0] + toe - feet) / com[1])


def test_a_curve_over_one_foot_is_all_on_it():
    forces = np.full((2, 2), np.nan)
    com = np.array([0.12, 0.97, 0.1, 0.0, 0.4, -0.3])
    leg_forces(np.array([0.0, 1.0, 0.0, 0.3, *3 * [np.nan]]), 0.3, com, BODY, forces)
    assert forces[0, 1] == pytest.approx(P.mass * (P.gravity - 0.3))
    assert not forces[1].any()


def test_no_foot_pulls_where_the_centre_of_pressure_would_leave_it():
    forces = np.empty((2, 2))
    com = np.array([0.1, 0.97, 0.0, 0.0, -5.0, 0.0])
    leg_forces(np.array([0.0, 1.0, 0.0, 0.0, 0.2, np.nan, np.nan]), 0.0, com, BODY, forces)
    np.testing.assert_allclose(forces[0], 0.0, atol=1e-12)
    assert forces[1, 1] == pytest.approx(P.mass * P.gravity)


@pytest.mark.parametrize("speed", [-0.12, 0.0, 0.12])
@pytest.mark.parametrize("spacing", [0.1, 0.3])
def test_a_stand_comes_to_rest_between_the_feet(planners, spacing, speed):
    """From any speed whose capture point x + dx/dt sqrt(y / g) is between them."""
    planner, toes = planners["s"], (1.0, 1.0 + spacing)
    start = np.array([[1.0 + 0.5 * spacing, speed, 0.0], [0.97, 0.0, 0.0]])
    decision = planner.decide(Context(REST.of(start[:, :2].T.ravel())))
    decision, stride = planner.curve("DS_ar^s", start, toes, decision)
    end = stride.state
    np.testing.assert_allclose(end, [1.0 + 0.5 * spacing, OPTIONS.height, 0.0, 0.0], atol=1e-12)
    assert stride.duration >= BEAT - 1e-12
    assert stride.events[-1].event is Event.REST
    times = np.linspace(0.0, stride.duration, 400)
    if decision.feasible:
        assert outside(pressure(stride, times), toes) < OPTIONS.slack + 1e-3
    assert decision.feasible or spacing == 0.1


def test_a_foot_that_lands_late_finds_a_template_that_falls(planners):
    planner = planners["ws"]
    start = np.array([[0.1, 0.5, 0.0], [0.95, -0.2, -P.gravity]])
    decision = planner.decide(Context(np.array([0.3, 0.98, 0.0])))
    _, stride = planner.curve("DS_br^ws", start, (0.0, 0.4), decision)
    np.testing.assert_allclose(stride.state[2:], 0.0, atol=1e-12)
    assert np.isfinite(pressure(stride, np.linspace(0.0, stride.duration, 100))).all()


@pytest.mark.parametrize("spacing", [0.1, 0.2, 0.3, 0.4, 0.45])
def test_a_start_leads_to_vlo(planners, spacing):
    """Along a path without a step in place or speed, to a VLO from which a walk can go on."""
    planner, toes = planners["sw"], (0.0, spacing)
    start = np.array([[0.5 * spacing, 0.0, 0.0], [0.97, 0.0, 0.0]])
    decision = planner.decide(Context(np.array([0.0, 0.97, 0.0]), np.array([0.8, 0.96, 0.0])))
    decision, stride = planner.curve("DS_ar^sw", start, toes, decision)
    assert stride.completed
    assert [event.event for event in stride.events] == [Event.REAR_LIFTOFF, Event.VLO]
    assert stride.state[0] == pytest.approx(spacing, abs=1e-9)
    assert 0.1 < stride.state[2] <= 0.8 + 1e-9
    liftoff = stride.time_of(Event.REAR_LIFTOFF)
    before, after = stride.sample([liftoff - 1e-9, liftoff + 1e-9])
    np.testing.assert_allclose(before, after, atol=1e-6)
    p = pressure(stride, np.linspace(0.0, liftoff - 1e-9, 400))
    assert outside(p, toes) < (0.02 if spacing == 0.1 else OPTIONS.slack + 1e-3)
    assert p[-1] == pytest.approx(spacing, abs=1e-3)
    u = decision.controls
    again = tc.simulate_stride(P, "SS_bv^w", before[:4], u, (spacing, spacing))
    np.testing.assert_allclose(again.state, stride.state, atol=1e-6)
    gait = planner.next_gait()
    assert gait.state[0] == pytest.approx(max(stride.state[2], FAMILY.speeds[0]))
    assert planners["ws"].next_gait() is None


def test_wider_feet_start_faster(planners):
    speeds = []
    for spacing in (0.1, 0.2, 0.3, 0.4):
        start = np.array([[0.5 * spacing, 0.0, 0.0], [0.97, 0.0, 0.0]])
        planner = planners["sw"]
        decision = planner.decide(Context(np.array([0.0, 0.97, 0.0]), np.array([0.8, 0.96, 0.0])))
        _, stride = planner.curve("DS_ar^sw", start, (0.0, spacing), decision)
        speeds.append(stride.state[2])
    assert np.all(np.diff(speeds) > 0.0)


def test_the_approach_to_vlo_is_the_templates(passes):
    """From each of its states the template comes to that VLO."""
    over = passes.at(0.35)
    for state in over.way + [[0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]:
        u = tc.slip.controls(1.4, over.stiffness, over.stiffness)
        stride = tc.simulate_stride(P, "SS_bv^w", state[:, :2].T.ravel(), u, (0.5, 0.5))
        np.testing.assert_allclose(VLO.of(stride.state), over.vlo, atol=1e-9)


def test_a_vault_is_the_gait_where_there_is_one(passes):
    gait = walking_gait(P, 0.9)
    np.testing.assert_array_equal(passes.at(0.9).vlo, gait.vlo)
    assert passes.at(0.9).stiffness == gait.controls[Slot.K_SD]
    slow = passes.at(0.3)
    lift = slow.stiffness * (P.rest_length - slow.vlo[1]) / P.mass
    assert lift == pytest.approx(P.gravity - 0.3**2 / P.rest_length)


@pytest.mark.parametrize(("speed", "wanted"), [(0.3, 0.8), (0.9, 0.35), (1.1, 0.64)])
def test_a_step_changes_the_speed(planners, passes, speed, wanted):
    """The template lands as planned, and the curve from there leads to the wanted speed."""
    planner, z = planners["ww"], passes.at(speed).vlo
    decision = planner.decide(Context(z, np.array([wanted, 0.96, 0.0])))
    assert decision.feasible
    down = tc.simulate_stride(P, "SS_av^ww", VLO.state(z), decision.controls)
    touchdown = next(event for event in down.events if event.event is Event.TOUCHDOWN)
    a = down.sample(touchdown.time - 1e-9)[0]
    toes = (0.0, touchdown.state[0] + P.rest_length * np.cos(decision.controls[0]))
    decision, stride = planner.curve("DS_bl^ww", a.reshape(3, 2).T, toes, decision)
    assert decision.feasible
    assert stride.state[2] == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("speed", [0.2, 0.35, 0.5])
def test_a_last_step_comes_to_rest(planners, passes, speed):
    planner, z = planners["ws"], passes.at(speed).vlo
    decision = planner.decide(Context(z))
    down = tc.simulate_stride(P, "SS_av^ws", VLO.state(z), decision.controls)
    touchdown = next(event for event in down.events if event.event is Event.TOUCHDOWN)
    a = down.sample(touchdown.time - 1e-9)[0]
    toes = (0.0, touchdown.state[0] + P.rest_length * np.cos(decision.controls[0]))
    decision, stride = planner.curve("DS_br^ws", a.reshape(3, 2).T, toes, decision)
    assert decision.feasible
    np.testing.assert_allclose(stride.state[2:], 0.0, atol=1e-12)
    assert 0.15 <= toes[1] <= 0.5


def test_a_planner_without_a_curve_is_named():
    route = SteadyRoute(P, "s", [0.0, 0.97, 0.0])
    walk = tc.LqrPlanner(walking_gait(P, 0.9))
    with pytest.raises(ParameterError, match="LqrPlanner plans no curve for node DS_ar"):
        tc.simulate(tc.Experiment(tc.load_robot("five-link"), route, planner={"s": walk}))


# ---- scenarios


def asked(segments, *sections):
    """Kinds of stride and wanted speeds at sections of (section, dx/dt, time)."""
    route = ScenarioRoute(Scenario(segments=segments))
    goals = [route.next(s, np.array([v, 0.97, 0.0]), t) for s, v, t in sections]
    return [None if goal is None else (goal.stride, round(goal.wanted_speed, 3)) for goal in goals]


def test_a_route_stands_starts_walks_and_stops():
    found = asked(
        (STAND, WALK, STAND),
        (REST, 0.0, 0.0),
        (REST, 0.0, 0.5),
        (REST, 0.0, 1.0),
        (VLO, 0.3, 2.0),  # too slow for the walk
        (VLO, 0.8, 2.7),
        (VLO, 0.72, 3.3),  # the walking planner makes it good
        (VLO, 0.8, 4.8),  # two seconds after it came to its speed
        (VLO, 0.4, 5.5),
        (REST, 0.0, 6.2),
        (REST, 0.0, 7.5),  # its feet are nearer to each other now
        (REST, 0.0, 8.5),
    )
    kinds = [stride for stride, _ in found[:-1]]
    assert kinds == ["s", "s", "sw", "ww", "w", "w", "ww", "ws", "sf", "s"]
    assert found[-1] is None
    assert [speed for _, speed in found[3:8]] == [0.8, 0.8, 0.8, pytest.approx(0.345, abs=0.01), 0]


def test_a_route_walks_in_the_steps_it_is_told():
    """Its other strides stay what they are."""
    told = ScenarioRoute(Scenario(segments=(WALK, STAND)), walks="wp")
    z = np.array([0.8, 0.97, 0.0])
    assert [told.next(VLO, z, t).stride for t in (0.0, 1.0, 3.0)] == ["wp", "wp", "ww"]


def test_a_route_begins_where_its_scenario_does():
    standing = ScenarioRoute(Scenario(segments=(STAND, WALK)))
    assert standing.section is REST
    np.testing.assert_array_equal(standing.start, [0.0, 0.97, 0.0])
    assert ScenarioRoute(Scenario(segments=(WALK, STAND))).section is VLO


@pytest.mark.parametrize(
    ("segments", "message"),
    [
        ((STAND, Segment("walk", duration=1.0)), "segment 2 walks after a stand: give it a speed"),
        ((WALK, Segment("run", speed=2.0, duration=1.0), STAND), "segments 2 and 3 run and stand"),
        ((Segment("stand", speed=1.0, duration=1.0),), "segment 1 stands and has speed"),
        ((Segment("stand"),), "segment 1 never ends"),
        ((Segment("run", speed=2.0, duration=1.0),), "segment 1 must stand, or walk"),
    ],
)
def test_a_stand_in_the_wrong_place_is_refused(segments, message):
    with pytest.raises(ScenarioError, match=message):
        Scenario(segments=segments)


def test_the_template_leaves_stands_out():
    record = tc.simulate_scenario(Scenario(segments=(STAND, Segment("walk", 1.1, steps=2), STAND)))
    assert record.strides == ["w", "w"]
    with pytest.raises(ScenarioError, match="the template cannot stand"):
        tc.simulate_scenario(Scenario(segments=(STAND,)))


def test_standing_belongs_to_a_scenario_that_stands():
    route = ScenarioRoute(Scenario(segments=(WALK,)))
    standing = {"s", "sw", "ws", "ww", "sf", "sb"}
    caught = {"ww", "ws", "sb", "sw"}
    assert standing & set(tc.embedding.default_planners(route)) == caught, "of a slow walk"
    route = ScenarioRoute(Scenario(segments=(STAND, WALK)))
    assert standing < set(tc.embedding.default_planners(route))


def test_every_kind_of_stride_leads_on():
    """A stride that ends at a section is followed by one that begins there."""
    for start in ("s", "sw", "ws", "ww", "sf", "sb"):
        begin, end = AUTOMATON.sections(AUTOMATON.start(start).name)
        assert (begin is Event.REST) == (start in ("s", "sw", "sf", "sb"))
        assert (end is Event.REST) == (start in ("s", "ws", "sf", "sb"))


# ---- the robot


def stand(spacing, impulse, beats):
    robot = tc.load_robot("five-link")
    p = tc.robot.template_for(robot)
    pushes = (Push(impulse, step=1),) if impulse else ()
    route = SteadyRoute(p, "s", [0.0, 0.97, 0.0])
    return tc.simulate(
        tc.Experiment(
            robot,
            route,
            planner=standing_planners(p),
            steps=beats,
            pose=standing_pose(p, spacing),
            pushes=pushes,
            world=tc.PlantOptions(),
        )
    )


def test_the_robot_stands_still():
    record = stand(0.3, 0.0, 4)
    assert not record.fell
    assert np.ptp(record.com, axis=0).max() < 1e-4
    assert np.abs(record.com_velocity).max() < 1e-3
    assert record.solved.all()


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("spacing", "impulse"), [(0.3, 10.0), (0.3, -10.0), (0.1, 10.0)])
def test_the_robot_takes_a_push_without_a_step(spacing, impulse):
    record = stand(spacing, impulse, 6)
    assert not record.fell
    assert np.abs(record.foot[-1] - record.foot[0]).max() < 2e-3
    last = record.time > record.time[-1] - 0.5
    assert np.abs(record.com[last, 0] - 0.5 * spacing).max() < 1e-3
    assert np.abs(record.com_velocity[last]).max() < 1e-3


def walked(spacing, speed):
    """A robot that stood, walked a second with ``speed`` at VLO, and stood for a second again."""
    robot = tc.load_robot("five-link")
    still = Segment("stand", duration=1.0)
    scenario = Scenario(segments=(still, Segment("walk", speed=speed, duration=1.0), still))
    pose = standing_pose(tc.robot.template_for(robot), spacing)
    return tc.simulate(tc.Experiment(robot, scenario, pose=pose))


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize(("spacing", "speed"), [(0.1, 0.8), (0.3, 1.1)])
def test_the_robot_stands_walks_and_stands(spacing, speed):
    record = walked(spacing, speed)
    assert record.fall_reason == ""
    assert record.arrived
    assert record.solved.all()
    strides = record.kinds_of_stride
    walks = [z[0] for z, stride in zip(record.section_state, strides, strict=True) if stride == "w"]
    assert np.abs(np.array(walks) - speed).max() < 0.05
    last = record.time > record.section_time[-2]
    assert np.ptp(record.com[last], axis=0).max() < 1e-4
    assert np.abs(record.com_velocity[last]).max() < 2e-4
    assert 0.2 < np.ptp(record.foot[-1, :, 0]) < 0.3


def test_a_route_that_stands_has_its_planners(robot):
    p = tc.template_for(robot)
    height = 0.96 * p.rest_length
    route = SteadyRoute(p, StrideKind.STAND, (0.0, height, 0.0))
    assert default_planners(route)[StrideKind.STAND].gait.state[1] == pytest.approx(height)
    record = tc.simulate(tc.Experiment(robot, route, steps=1))
    assert not record.fell
    assert record.com[-1, 1] == pytest.approx(height, abs=2e-3)
