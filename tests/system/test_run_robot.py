"""The five-link robot runs in PyBullet within its motors' torques."""

from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import PHASES
from template_control.embedding.planners.default import default_planners
from template_control.embedding.planners.planner import Cause
from template_control.embedding.planners.running import RunningPlanner
from template_control.embedding.state import TemplateState
from template_control.errors import ParameterError
from template_control.robot.start import state_in
from template_control.robustness.disturbances import footholds
from template_control.run.apex_pose import ApexStart, apex_pose
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Event, Outcome, Phase, Reset, Slot
from template_control.slip.gaits.gait import flight_share
from template_control.slip.gaits.running_gait import running_gait
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import SteadyRoute

P = SlipParameters()
SWING = PHASES[Phase.F].swing


@pytest.fixture(scope="session")
def gait():
    return running_gait(P, 3.0)


def run(speed, steps, name="five-link", **options):
    """A recorded run at a speed over that of the five-link robot by similarity."""
    robot = tc.load_robot(name)
    parameters = tc.template_for(robot)
    unit = np.sqrt(parameters.gravity * parameters.rest_length / (P.gravity * P.rest_length))
    planner = RunningPlanner(running_gait(parameters, speed * unit))
    return simulate(Experiment(robot, planner=planner, steps=steps, **options))


@pytest.fixture(scope="module")
def record():
    return run(3.0, 20)


def stance(record):
    """(T,) whether a foot carries, by the controller."""
    return ~record.in_phase(Phase.F)


def test_robot_runs_at_three_metres_a_second(record, gait):
    assert record.fall_reason == ""
    assert record.steps == 20
    speed, height, _ = record.section_state[-8:].T
    assert speed.mean() == pytest.approx(3.0, rel=0.01)
    assert height.mean() == pytest.approx(gait.apex[1], abs=5e-3)
    assert record.solved.all()
    assert record.section_feasible.all()
    error = record.com_error[stance(record)]
    assert np.sqrt(np.mean(error**2, axis=0)) == pytest.approx([0.0, 0.0], abs=3e-3)
    assert np.max(np.abs(record.torque)) < 320.0, "the start costs no more"


def test_it_flies_and_lands_on_either_foot_in_turn(record, gait):
    flying = ~stance(record)
    force = record.contact_force[:, :, 1]
    assert flying.mean() == pytest.approx(flight_share(gait), abs=0.06)
    assert force[flying].max(axis=1).mean() < 20.0, "nothing carries in flight"
    landings = np.flatnonzero(np.diff(flying.astype(int)) < 0) + 1
    assert record.rear[landings].tolist() == [0, 1] * 10
    begin, end = np.searchsorted(record.time, record.section_time[[2, -1]])
    assert force[begin:end].sum(axis=1).mean() == pytest.approx(80.0 * 9.81, rel=0.02)


def test_the_trunk_leans_as_much_as_is_wanted_on_average(record):
    last = record.time > record.section_time[10]
    wanted = EmbeddingOptions().lean.strides["r"].at(3.0)
    assert record.q[last, 2].mean() == pytest.approx(wanted, abs=0.03)
    assert np.ptp(record.q[last, 2]) < 0.4


def test_a_run_begins_with_the_feet_of_the_gait(robot, gait):
    pose = apex_pose(robot, ApexStart(gait.apex, gait, SWING, 0.3))
    q, v = state_in(robot, pose)
    robot.update(q, v)
    np.testing.assert_allclose(robot.com, [0.0, gait.apex[1]], atol=1e-9)
    np.testing.assert_allclose(robot.com_velocity, [3.0, 0.0], atol=1e-9)
    assert robot.angular_momentum == pytest.approx(0.0, abs=1e-8)
    landing, left = pose.feet
    assert landing[0] > 0.25, "about to land ahead"
    assert landing[1] < 0.08
    assert pose.feet_velocity[0, 1] < 0.0
    assert left[0] < -0.25, "behind, and rising"
    assert pose.feet_velocity[1, 1] > 0.0
    assert pose.swung[0] == pytest.approx(pose.swung[1] + gait.step_duration)


@pytest.mark.parametrize("speed", np.linspace(1.25, 4.95, 12))
def test_legs_reach_the_start_at_every_speed(robot, speed):
    there = running_gait(P, float(speed))
    pitch = EmbeddingOptions().lean.strides["r"].at(float(speed))
    pose = apex_pose(robot, ApexStart(there.apex, there, SWING, pitch))
    q, _ = state_in(robot, pose)
    assert np.all(q >= robot.model.lowerPositionLimit)
    assert np.all(q <= robot.model.upperPositionLimit)
    np.testing.assert_allclose(robot.foot_position, pose.feet, atol=1e-9)


def test_a_gait_that_lands_on_one_leg_only_needs_a_pose(robot, gait):
    hopping = replace(AUTOMATON, nodes=tuple(_without_swap(node) for node in AUTOMATON.nodes))
    with pytest.raises(ParameterError, match="'run' do not take turns: give the Experiment"):
        apex_pose(robot, ApexStart(gait.apex, gait, SWING, automaton=hopping))


def _without_swap(node):
    edges = tuple(
        replace(edge, reset=Reset.NONE) if edge.event is Event.REAR_LIFTOFF else edge
        for edge in node.edges
    )
    return replace(node, edges=edges)


def test_a_route_at_an_apex_finds_its_planner():
    route = SteadyRoute(P, "r", running_gait(P, 2.5).apex)
    planners = default_planners(route)
    assert list(planners) == ["r"]
    assert planners["r"].gait.apex[0] == 2.5


@pytest.fixture
def supervisor(robot, gait):
    """Planning of a run whose first stride is decided."""
    controller = EmbeddingController(robot, RunningPlanner(gait))
    state_in(robot, apex_pose(robot, ApexStart(gait.apex, gait, SWING)))
    controller.start()
    return controller.supervisor


def test_in_flight_the_path_knows_where_both_feet_land(supervisor, gait):
    sensed = TemplateState(state=np.array([0.0, gait.apex[1] - 0.004, 3.0, 0.28]))
    supervisor.follow(AUTOMATON.node("F_ba^r"), sensed, 0.1)
    first, second = (supervisor.path.landings[supervisor.feet.index(foot)] for foot in (0, 1))
    assert second.x - first.x == pytest.approx(gait.step_length, abs=0.02)
    assert second.time - first.time == pytest.approx(gait.step_duration, abs=0.02)


@pytest.mark.parametrize("early", [-0.004, 0.006])
def test_stiffnesses_follow_from_where_the_foot_has_landed(supervisor, gait, early):
    angle = gait.controls[Slot.TOUCHDOWN_ANGLE] - 0.01
    height = P.rest_length * np.sin(angle)
    fall = np.sqrt(2.0 * P.gravity * (gait.apex[1] - height))
    # The foot lands where the leg would come to l0, this much sooner.
    x = -P.rest_length * np.cos(angle) - early * 3.0
    y = height + early * fall - 0.5 * P.gravity * early**2
    sensed = TemplateState(state=np.array([x, y, 3.0, -fall + P.gravity * early]))
    before = supervisor.decision.controls
    node = AUTOMATON.node("SS_sc^r")
    supervisor.replan(Cause.TOUCHDOWN, node, sensed, 0.05)
    after = supervisor.decision.controls
    assert after[Slot.TOUCHDOWN_ANGLE] == pytest.approx(angle, abs=1e-9)
    # From a flatter leg a stiffer one would throw the CoM over its apex.
    assert after[Slot.K_SC] < 0.97 * before[Slot.K_SC]
    assert supervisor.path.strides[0].outcome is Outcome.SECTION
    np.testing.assert_allclose(supervisor.path.section_state, [*gait.apex, 0.0], atol=0.03)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("speed", [1.3, 2.0, 4.0])
def test_robot_runs_at_other_speeds(speed):
    record = run(speed, 40)
    assert record.fall_reason == ""
    assert record.section_state[-20:, 0].mean() == pytest.approx(speed, rel=0.01)
    assert record.solved.all()


@pytest.mark.slow(seconds=7)
def test_robot_runs_at_five_metres_a_second_with_stronger_motors():
    record = run(5.0, 40, controller=EmbeddingOptions(qp=tc.QpOptions(torque_scale=1.3)))
    assert record.fall_reason == ""
    assert record.section_state[-20:, 0].mean() == pytest.approx(5.0, rel=0.01)


@pytest.mark.slow(seconds=3)
@pytest.mark.parametrize(("impulse", "phase"), [(20.0, 0.1), (-20.0, 0.6)])
def test_robot_runs_on_after_a_push(impulse, phase):
    record = run(3.0, 20, pushes=(tc.Push(impulse, 8, phase),))
    assert record.fall_reason == ""
    speed = record.section_state[:, 0]
    assert abs(speed[9] - 3.0) > 0.15
    assert np.max(np.abs(speed[18:] / 3.0 - 1.0)) < 0.02


@pytest.mark.slow(seconds=4)
def test_runner_is_back_ten_steps_after_a_hard_push():
    pushes = (tc.Push(40.0, 6, 0.9), tc.Push(-40.0, 18, 0.0))
    record = run(3.0, 30, "runner", pushes=pushes)
    assert record.fall_reason == ""
    assert record.solved.all()
    error = np.abs(record.section_state[:, 0] / record.gait_state[0] - 1.0)
    for push in pushes:
        assert np.max(error[push.step : push.step + 10]) > 0.15
        assert error[push.step + 10] < 0.02


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("mass_scale", [0.9, 1.1])
def test_robot_runs_with_another_mass_than_its_model_has(mass_scale):
    record = run(3.0, 30, world=tc.PlantOptions(mass_scale=mass_scale))
    assert record.fall_reason == ""
    assert record.section_state[-10:, 0].mean() == pytest.approx(3.0, rel=0.01)


@pytest.mark.slow(seconds=3)
@pytest.mark.parametrize("height", [0.03, -0.03])
def test_robot_runs_on_over_a_step_that_it_does_not_see(robot, gait, height):
    where = tc.Experiment(robot, planner=tc.RunningPlanner(gait)).prepare()
    before, beyond = footholds(where, (*gait.apex, 0.0), 5)[-2:]
    step = tc.Terrain.step(height, 0.5 * (before + beyond))
    record = run(3.0, 17, world=tc.PlantOptions(terrain=step))
    assert record.fall_reason == ""
    assert record.foot[-1, :, 1].min() > height - 0.01
    assert np.max(np.abs(record.section_state[14:, 0] / 3.0 - 1.0)) < 0.02


@pytest.mark.slow(seconds=5)
@pytest.mark.parametrize(("name", "steps"), [("human", 30), ("bolt", 60)])
def test_other_robots_run_by_similarity(name, steps):
    record = run(2.0, steps, name)
    assert record.fall_reason == ""
    wanted = record.gait_state[0]
    assert record.section_state[-10:, 0].mean() == pytest.approx(wanted, rel=0.01)
