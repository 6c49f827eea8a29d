"""The robot in MuJoCo: against Pinocchio, against mechanics, and as a world to walk and run in."""

import sys

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from places import EXAMPLES

import template_control as tc
from template_control.cli.main import main
from template_control.errors import ParameterError
from template_control.plant import MujocoPlant
from template_control.robot.library import ROBOTS
from template_control.robot.terms import PLANAR_DOF

G = 9.81


def high_states(robot, count=10):
    """Random states above the ground, away from the stops of the joints."""
    rng = np.random.default_rng(7)
    low, high = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    for _ in range(count):
        q, v = rng.uniform(-0.5, 0.5, robot.nv), rng.uniform(-2.0, 2.0, robot.nv)
        share = rng.uniform(0.2, 0.8, robot.nv - PLANAR_DOF)
        bottom = np.maximum(low[PLANAR_DOF:], -2.0)
        q[PLANAR_DOF:] = bottom + share * (np.minimum(high[PLANAR_DOF:], 2.0) - bottom)
        q[1] += 4.0 * robot.leg_length
        yield q, v


def state(plant, robot):
    q, v = np.zeros(robot.nv), np.zeros(robot.nv)
    plant.read(q, v)
    return q, v


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("scale", [1.0, 1.1])
def test_its_dynamics_are_pinocchios(name, scale):
    robot = tc.load_robot(name)
    plant = MujocoPlant(robot, tc.MujocoOptions(mass_scale=scale))
    data = robot.model.createData()
    order = [plant.model.joint(joint).dofadr[0] for joint in list(robot.model.names)[1:]]
    for q, v in high_states(robot):
        plant.reset(q, v)
        mujoco.mj_forward(plant.model, plant.data)
        unit, mass = np.zeros(robot.nv), np.zeros((robot.nv, robot.nv))
        for i, column in enumerate(order):
            unit[:] = np.eye(robot.nv)[column]
            mujoco.mj_mulM(plant.model, plant.data, mass[i], unit)
        expected = pin.crba(robot.model, data, q)
        expected = np.triu(expected) + np.triu(expected, 1).T
        np.testing.assert_allclose(mass[:, order], scale * expected, atol=1e-8)
        bias = pin.nonLinearEffects(robot.model, data, q, v)
        np.testing.assert_allclose(plant.data.qfrc_bias[order], scale * bias, atol=1e-8)


def test_a_flight_is_pinocchios_step_by_step(robot):
    dt = 1e-3
    plant = MujocoPlant(robot, tc.MujocoOptions(time_step=dt))
    data = robot.model.createData()
    rng = np.random.default_rng(3)
    q, v = next(high_states(robot))
    plant.reset(q, v)
    for _ in range(50):
        torque = rng.uniform(-5.0, 5.0, robot.nv - PLANAR_DOF)
        plant.step(torque)
        v = v + dt * pin.aba(robot.model, data, q, v, np.r_[np.zeros(PLANAR_DOF), torque])
        q = q + dt * v
    np.testing.assert_allclose(np.r_[state(plant, robot)], np.r_[q, v], atol=1e-10)


def test_a_push_gives_its_impulse_to_the_whole_robot(robot):
    plant = MujocoPlant(robot, tc.MujocoOptions())
    q, _ = next(high_states(robot))
    plant.reset(q, np.zeros(robot.nv))
    nothing = np.zeros(robot.nv - PLANAR_DOF)
    for _ in range(100):
        plant.step(nothing, 200.0)
    robot.update(*state(plant, robot))
    # A semi-implicit step in joint coordinates keeps the momentum to its own order only.
    assert robot.com_velocity[0] == pytest.approx(20.0 / robot.mass, rel=1e-4)
    plant.step(nothing)
    before = robot.com_velocity[0]
    robot.update(*state(plant, robot))
    assert robot.com_velocity[0] == pytest.approx(before, rel=1e-4), "a push ends when it ends"


@pytest.fixture(scope="module")
def walk(default_gait):
    return tc.simulate(
        tc.Experiment(
            tc.load_robot("five-link"),
            planner=tc.LqrPlanner(default_gait),
            steps=8,
            world=tc.MujocoOptions(),
        )
    )


def test_the_robot_walks_as_it_does_in_pybullet(walk, short_walk):
    assert not walk.fell
    assert walk.plant == "mujoco"
    assert walk.solved.all()
    there = short_walk.section_state
    here = walk.section_state[: len(there)]
    np.testing.assert_allclose(here[:, :2], there[: len(here), :2], atol=0.02)


def test_the_ground_carries_the_robot(walk, robot):
    first, last = walk.section_time[2], walk.section_time[-1]
    during = (walk.time >= first) & (walk.time < last)
    lift = walk.contact_force[during, :, 1].sum(axis=1).mean()
    z = walk.section_state
    change = robot.mass * (z[-1, 2] - z[2, 2]) / (last - first)
    assert lift == pytest.approx(robot.mass * robot.gravity + change, rel=0.01)
    assert walk.contact_force[during, :, 1].min() >= 0.0


@pytest.mark.slow(seconds=2)
@pytest.mark.parametrize("height", [0.02, -0.02])
def test_a_step_of_the_ground_is_where_it_is_told(robot, default_gait, height):
    step = tc.Terrain.at_step(default_gait, height, 2)
    world = tc.MujocoOptions(terrain=step)
    record = tc.simulate(
        tc.Experiment(robot, planner=tc.LqrPlanner(default_gait), steps=5, world=world)
    )
    assert not record.fell
    beyond = record.time > record.section_time[-2]
    lowest = []
    for q, v in zip(record.q[beyond], record.v[beyond], strict=True):
        robot.update(q, v)
        lowest.append(robot.foot_position[:, 1].min())
    assert np.median(lowest) == pytest.approx(height, abs=1e-3)


def test_a_robot_that_lies_down_is_seen(robot):
    plant = MujocoPlant(robot, tc.MujocoOptions())
    q = np.zeros(robot.nv)
    q[1], q[2] = 0.3, 1.5
    plant.reset(q, np.zeros(robot.nv))
    assert not plant.trunk_touches_ground()
    for _ in range(400):
        plant.step(np.zeros(robot.nv - PLANAR_DOF))
    assert plant.trunk_touches_ground()


def test_without_the_package_it_says_what_to_install(robot, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ParameterError, match=r"template-control\[mujoco\]"):
        MujocoPlant(robot, tc.MujocoOptions())


def test_a_contact_quicker_than_mujoco_takes_is_refused():
    with pytest.raises(ParameterError, match=r"at least two time steps, 0\.002 s"):
        tc.MujocoOptions(contact_time=1e-3)


def test_the_command_walks_in_it_and_repeats_the_run(tmp_path, capsys):
    folder = tmp_path / "walk"
    line = ["walk", "--steps", "2", "--no-figures", "--friction", "0.6", "--output", str(folder)]
    assert main([*line, "--plant", "mujoco"]) == 0
    assert tc.Experiment.load(folder / "run.toml").world == tc.MujocoOptions(friction=0.6)
    again = tmp_path / "again"
    repeat = ["walk", "--config", str(folder / "run.toml"), "--no-figures", "--output", str(again)]
    assert main(repeat) == 0
    capsys.readouterr()
    records = [tc.Record.load(place / "run.npz") for place in (folder, again)]
    np.testing.assert_array_equal(records[0].q, records[1].q)


@pytest.mark.slow(seconds=4)
@pytest.mark.parametrize("impulse", [-20.0, 20.0])
def test_pushed_walks_go_on(robot, default_gait, impulse):
    push = tc.Push(impulse, 3, 0.25)
    record = tc.simulate(
        tc.Experiment(
            robot,
            planner=tc.LqrPlanner(default_gait),
            steps=18,
            world=tc.MujocoOptions(),
            pushes=(push,),
        )
    )
    assert not record.fell
    speed = record.section_state[-5:, 0].mean()
    assert speed == pytest.approx(default_gait.vlo[0], rel=0.02)


@pytest.mark.slow(seconds=4)
def test_a_scenario_of_walking_and_running_goes_through():
    """As ``runner`` goes through one to 5 m/s in test_stand_to_run.py."""
    scenario = tc.load_scenario(EXAMPLES / "walk_run_walk.toml")
    robot = tc.load_robot("five-link")
    record = tc.simulate(tc.Experiment(robot, scenario, world=tc.MujocoOptions(), record_every=4))
    assert not record.fell
    assert record.arrived
    error = record.section_state[1:, 0] - record.section_target[:-1, 0]
    assert np.sqrt(np.mean(error**2)) < 0.2, "0.03 m/s was measured"
    limit = record.torque_limit
    assert np.all(np.abs(record.torque) <= limit)
