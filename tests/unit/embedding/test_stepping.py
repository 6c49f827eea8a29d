"""Steps from a stand to a stand: forward and back, planned, and made by the robot."""

import numpy as np
import pytest

import template_control as tc
from template_control.embedding import StandingOptions, standing_planners, standing_pose
from template_control.embedding.planners.planner import Context
from template_control.embedding.recovery import ways_to_rest
from template_control.embedding.standing.curves import CLOSING, BetweenFeet
from template_control.run.options import Push
from template_control.slip import Event, gaits_by_speed
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.maps.section import REST
from template_control.slip.scenario.route import SteadyRoute
from template_control.slip.scenario.scenario import Scenario, Segment
from template_control.slip.scenario.scenario_route import ScenarioRoute

P = tc.SlipParameters()
STEPS = {"sf": 1.0, "sb": -1.0}  # and their directions
WIDE, NARROW = (0.42, 0.0), (0.1, 0.3)  # feet apart [m], speed in the step's direction [m/s]


@pytest.fixture(scope="module")
def planners():
    return standing_planners(P)


def step(planners, kind, case):
    """Decision and stride from the middle between two feet, the rear one at 0."""
    apart, speed = case
    start = np.array([[0.5 * apart, STEPS[kind] * speed, 0.0], [0.97, 0.0, 0.0]])
    first = planners[kind].decide(Context(REST.of(start[:, :2].T.ravel())))
    return planners[kind].curve(AUTOMATON.starts[kind], start, (0.0, apart), first)


@pytest.mark.parametrize("case", [WIDE, NARROW])
@pytest.mark.parametrize("kind", STEPS)
def test_a_step_leads_to_rest(planners, kind, case):
    """Over the foot that stays, without a jump, to feet at standing distance."""
    decision, stride = step(planners, kind, case)
    lifts = Event.REAR_LIFTOFF if kind == "sf" else Event.FRONT_LIFTOFF
    assert decision.feasible
    assert stride.completed
    assert [event.event for event in stride.events] == [lifts, Event.TOUCHDOWN, Event.REST]
    np.testing.assert_allclose(stride.state[2:], 0.0, atol=1e-12)
    rear, front = stride.toes
    assert rear < front, "roles are those of the feet as they stand"
    assert front - rear == pytest.approx(CLOSING, abs=0.03)
    assert stride.state[0] == pytest.approx(0.5 * (rear + front), abs=1e-9)
    assert {"sf": rear, "sb": front}[kind] == pytest.approx({"sf": case[0], "sb": 0.0}[kind])
    for event in stride.events[:2]:
        before, after = stride.sample([event.time - 1e-9, event.time + 1e-9])
        np.testing.assert_allclose(before[:4], after[:4], atol=1e-6)


@pytest.mark.parametrize("case", [WIDE, NARROW])
def test_the_centre_of_pressure_stays_between_the_feet(planners, case):
    _, stride = step(planners, "sf", case)
    liftoff, touchdown, rest = (event.time for event in stride.events)
    for begin, end, toes in ((0.0, liftoff, (0.0, case[0])), (touchdown, rest, stride.toes)):
        x, y, _, _, ax, ay = stride.sample(np.linspace(begin, end - 1e-9, 200)).T
        p = x - y * ax / (P.gravity + ay)
        assert min(toes) - 0.01 < p.min()
        assert p.max() < max(toes) + 0.01


@pytest.mark.parametrize("case", [WIDE, NARROW])
def test_a_step_back_is_the_mirror_image(planners, case):
    _, ahead = step(planners, "sf", case)
    _, back = step(planners, "sb", case)
    times = np.linspace(0.0, ahead.duration - 1e-6, 50)
    mirrored = back.sample(times)
    mirrored[:, ::2] *= -1.0
    mirrored[:, 0] += case[0]
    np.testing.assert_allclose(mirrored, ahead.sample(times), atol=1e-6)


@pytest.mark.parametrize(
    ("speed", "holds", "kind"), [(0.08, True, ""), (0.3, False, "sf"), (-0.3, False, "sb")]
)
def test_a_step_is_made_where_the_feet_do_not_hold(planners, speed, holds, kind):
    """And in the direction in which the robot falls."""
    start, toes = np.array([[0.05, speed, 0.0], [0.97, 0.0, 0.0]]), (0.0, 0.1)
    z, node = REST.of(start[:, :2].T.ravel()), "DS_ar^s"
    stand, _ = planners["s"].curve(node, start, toes, planners["s"].decide(Context(z)))
    assert stand.feasible == holds
    fit = [
        other
        for other, _ in ways_to_rest(node)
        if planners[other]
        .curve(AUTOMATON.starts[other], start, toes, planners[other].decide(Context(z)))[0]
        .feasible
    ]
    assert holds or fit == [kind]


def test_in_the_air_the_foot_lands_where_the_com_comes_to_rest(planners):
    """A faster CoM makes it land further ahead."""
    planner = planners["sf"]
    decision, _ = step(planners, "sf", NARROW)
    landed = []
    for speed in (0.25, 0.4, 0.55):
        start = np.array([[0.12, speed, 0.0], [0.98, 0.0, 0.0]])
        chosen, stride = planner.curve("SS_bt^sf", start, (0.1, 0.05), decision)
        assert chosen.feasible
        landed.append(stride.toes[1])
    assert np.all(np.diff(landed) > 0.0)


# ---- the robot


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("impulse", [22.0, -22.0])
def test_a_robot_that_is_pushed_steps_and_stands(impulse):
    robot = tc.load_robot("five-link")
    p = tc.template_for(robot)
    route = SteadyRoute(p, "s", [0.0, 0.97, 0.0])
    record = tc.simulate(
        tc.Experiment(
            robot,
            route,
            planner=standing_planners(p),
            steps=7,
            pose=standing_pose(p, 0.1),
            pushes=(Push(impulse, step=1),),
            record_every=5,
        )
    )
    assert not record.fell
    kinds = set(record.kinds_of_stride)
    assert kinds == {"s", "sf" if impulse > 0.0 else "sb"}
    rear = int(record.rear[-1])
    assert record.foot[-1, rear, 0] < record.foot[-1, 1 - rear, 0]
    last = record.time > record.time[-1] - 0.8
    assert np.ptp(record.com[last], axis=0).max() < 1e-3
    assert 0.2 < np.ptp(record.foot[-1, :, 0]) < 0.3


@pytest.mark.slow(seconds=4)
def test_a_robot_walks_slowly_with_the_family_by_speed_and_closes_its_feet():
    robot = tc.load_robot("five-link")
    p = tc.template_for(robot)
    gait = tc.gait_for_speed(p, 0.5)
    still = Segment("stand", duration=1.0)
    walk = Segment("walk", speed=float(gait.vlo[0]), steps=2)
    route = ScenarioRoute(Scenario(segments=(still, walk, still)).on(p), walks="wp")
    planners = standing_planners(p, family=gaits_by_speed(p)) | {"wp": tc.LqrPlanner(gait)}
    record = tc.simulate(
        tc.Experiment(robot, route, planner=planners, pose=standing_pose(p, 0.1), record_every=5)
    )
    assert (record.fall_reason, record.arrived) == ("", True)
    kinds = record.kinds_of_stride
    assert kinds[-5:-2] == ["ws", "sf", "s"]
    walks = record.section_state[[kind == "wp" for kind in kinds], 0]
    assert np.abs(walks - gait.vlo[0]).max() < 0.05
    assert 0.2 < np.ptp(record.foot[-1, :, 0]) < 0.3


@pytest.mark.filterwarnings("error")
def test_a_robot_that_falls_has_no_capture_point_ahead():
    """Its CoM may be below where its foot was to stand."""
    height, speed = 0.9, 0.5
    capture = BetweenFeet((0.0, 0.3), P, StandingOptions()).capture
    above = np.array([[0.2, speed, 0.0], [height, 0.0, 0.0]])
    assert capture(above) == pytest.approx(0.2 + speed * np.sqrt(height / P.gravity))
    below = np.array([[0.2, speed, 0.0], [-0.1, 0.0, 0.0]])
    assert capture(below) == 0.2
