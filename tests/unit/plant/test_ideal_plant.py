"""The ideal plant against mechanics: energy, momentum, parabola, weight; and against PyBullet."""

import numpy as np
import pinocchio as pin
import pytest

from template_control.embedding.modes import GuardOptions
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions, IdealPlant
from template_control.plant.plant import open_plant, plant_name
from template_control.robot.library import load_robot
from template_control.robot.start import state_at_vlo
from template_control.run.experiment import Experiment
from template_control.run.options import Push
from template_control.run.record import Record
from template_control.run.simulation import simulate

NOTHING = np.zeros(4)


def at_vlo(robot, height=0.98, swing=(0.0, 0.05), speed=1.1):
    return state_at_vlo(robot, np.array([speed, height, 0.0]), 0, np.array(swing), np.zeros(2))


def energy(robot, q, v):
    return pin.computeMechanicalEnergy(robot.model, robot.model.createData(), q, v)


def run(robot, q, v, steps, torque=NOTHING, **options):
    plant = IdealPlant(robot, IdealOptions(**options))
    plant.reset(q, v)
    for _ in range(steps):
        plant.step(torque)
    q, v = np.zeros(7), np.zeros(7)
    plant.read(q, v)
    return plant, q, v


def momentum_about(robot, q, v, point):
    """Angular momentum about ``point`` (2,), forward pitch positive."""
    robot.update(q, v)
    (x, y), (dx, dy) = robot.com - point, robot.com_velocity
    return robot.angular_momentum + robot.mass * (y * dx - x * dy)


def test_free_flight_is_a_parabola_and_conserves_energy_and_spin(robot, random_states):
    for q, v in random_states[:5]:
        q, v = q.copy(), v.copy()
        q[1] += 2.0
        robot.update(q, v)
        com, velocity, spin = robot.com.copy(), robot.com_velocity.copy(), robot.angular_momentum
        plant, q1, v1 = run(robot, q, v, 200)
        robot.update(q1, v1)
        t = 0.2
        np.testing.assert_allclose(robot.com, com + velocity * t - [0, 4.905 * t**2], atol=1e-8)
        assert robot.angular_momentum == pytest.approx(spin, abs=1e-6)
        assert energy(robot, q1, v1) == pytest.approx(energy(robot, q, v), abs=1e-6)
        forces = np.ones((2, 2))
        plant.contact_forces(forces)
        assert not forces.any()


def test_passive_stance_conserves_energy(robot):
    q, v = at_vlo(robot)
    plant, q1, v1 = run(robot, q, v, 100)
    assert plant.contacts == (0,)
    assert not plant.impacts
    assert energy(robot, q1, v1) == pytest.approx(energy(robot, q, v), abs=1e-7)
    assert np.abs(v1 - v).max() > 0.1, "it moved"


def test_the_integrator_is_of_order_four(robot):
    q, v = at_vlo(robot)
    torque = np.array([20.0, -40.0, 5.0, -3.0])
    _, exact, _ = run(robot, q, v, 320, torque, time_step=2.5e-4)
    errors = [
        np.abs(run(robot, q, v, n, torque, time_step=0.08 / n)[1] - exact).max() for n in (10, 20)
    ]
    assert 12.0 < errors[0] / errors[1] < 20.0


def test_stance_foot_rolls_without_drift(robot):
    q, v = at_vlo(robot)
    _, q1, v1 = run(robot, q, v, 150, np.array([30.0, -100.0, 10.0, 5.0]))
    robot.update(q1, v1)
    assert abs(robot.foot_position[0, 1]) < 1e-11
    assert np.abs(robot.foot_velocity[0]).max() < 1e-11
    turned = (q1 - q)[2] + (q1 - q)[[3, 4]].sum()
    assert robot.foot_position[0, 0] == pytest.approx(robot.foot_radius * turned, abs=1e-11)


def test_a_touchdown_conserves_the_momentum_about_the_contact(robot):
    """A landing on one foot: its impulse has no moment about the (rolling) contact point."""
    q, v = at_vlo(robot)
    q, v = q.copy(), v.copy()
    q[1] += 0.05
    v[1] = -0.3
    before = energy(robot, q, v)
    plant, q1, v1 = IdealPlant(robot, IdealOptions()), np.zeros(7), np.zeros(7)
    plant.reset(q, v)
    last = q, v
    while not plant.impacts:
        plant.read(q1, v1)
        last = q1.copy(), v1.copy()
        plant.step(NOTHING)
    # A step as short as wanted around the event: the impact alone changes the momentum.
    fine = IdealPlant(robot, IdealOptions(time_step=1e-6))
    fine.reset(*last)
    while not fine.impacts:
        fine.read(q1, v1)
        fine.step(NOTHING)
    q2, v2 = np.zeros(7), np.zeros(7)
    fine.read(q2, v2)
    robot.update(q2, v2)
    point = robot.foot_position[0].copy()
    assert fine.contacts == (0,)
    kept = momentum_about(robot, q1, v1, point)
    # Gravity's moment acts for a microsecond.
    assert momentum_about(robot, q2, v2, point) == pytest.approx(kept, abs=1e-3)
    assert np.abs(v2 - v1).max() > 0.1, "it was an impact"
    assert energy(robot, q2, v2) < before - 1.0
    robot.update(q1, v1)
    momentum = robot.mass * robot.com_velocity
    robot.update(q2, v2)
    change = robot.mass * robot.com_velocity - momentum
    np.testing.assert_allclose(change, fine.impacts[0][0], atol=2e-3)
    assert fine.impacts[0][0, 1] > 0.0


def test_touchdown_is_found_within_a_step(robot):
    """With steps of 1 and 4 ms the foot lands at the same moment and nowhere in the ground."""
    q, v = at_vlo(robot)
    q = q.copy()
    q[1] += 0.05
    ends = []
    for step in (1e-3, 4e-3):
        plant, q1, v1 = run(robot, q, v, round(0.12 / step), time_step=step)
        assert len(plant.impacts) >= 1
        ends.append(q1)
        robot.update(q1, v1)
        assert robot.foot_position[:, 1].min() > -1e-8
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)


def test_standing_forces_carry_the_weight(robot):
    """Held still by the torques that the equations of statics give."""
    q, _ = at_vlo(robot, 0.95, (0.3, 0.0), 0.0)
    q[:] = _over_both_feet(robot)
    zero = np.zeros(7)
    robot.update(q, zero)
    rows = robot.foot_jacobian.reshape(4, 7)
    # tau and f from S tau + J^T f = h, the least-squares one of many.
    system = np.hstack((np.vstack((np.zeros((3, 4)), np.eye(4))), rows.T))
    torque = np.linalg.lstsq(system, robot.nonlinear_effects.copy(), rcond=None)[0][:4]
    plant, q1, _ = run(robot, q, zero, 20, torque)
    assert plant.contacts == (0, 1)
    np.testing.assert_allclose(q1, q, atol=1e-7)
    forces = np.zeros((2, 2))
    plant.contact_forces(forces)
    np.testing.assert_allclose(forces.sum(axis=0), [0.0, robot.mass * robot.gravity], atol=1e-4)
    assert np.all(forces[:, 1] > 0.0)


def _over_both_feet(robot):
    """Both feet on the ground, 0.3 m apart, the CoM about between them."""
    q, v = state_at_vlo(robot, np.array([0.0, 0.95, 0.0]), 0, np.array([0.3, 0.0]), np.zeros(2))
    shifted = q.copy()
    for _ in range(30):
        robot.update(shifted, v)
        error = np.concatenate(
            (
                robot.com - [0.15, 0.95],
                [shifted[2]],
                robot.foot_position[0],
                robot.foot_position[1] - [0.3, 0.0],
            )
        )
        rows = np.vstack(
            (robot.com_jacobian, np.eye(7)[2], robot.foot_jacobian[0], robot.foot_jacobian[1])
        )
        shifted -= np.linalg.solve(rows, error)
    return shifted


def test_a_foot_that_would_pull_is_released(robot):
    q, v = at_vlo(robot, speed=0.0)
    # Flexing the stance knee hard pulls the foot off the ground.
    plant, q1, v1 = run(robot, q, v, 20, np.array([-200.0, 300.0, 0.0, 0.0]))
    robot.update(q1, v1)
    assert plant.contacts == ()
    assert robot.foot_position[0, 1] > 1e-4


def test_a_push_is_a_force_on_the_trunk(robot):
    q, v = at_vlo(robot)
    q = q.copy()
    q[1] += 1.0
    robot.update(q, v)
    speed = robot.com_velocity[0]
    plant = IdealPlant(robot, IdealOptions(mass_scale=1.1))
    plant.reset(q, v)
    for _ in range(50):
        plant.step(NOTHING, 100.0)
    plant.read(q, v)
    robot.update(q, v)
    assert robot.com_velocity[0] - speed == pytest.approx(100.0 * 0.05 / 88.0, rel=1e-9)


def test_agrees_with_pybullet_over_a_short_stance(robot):
    """50 ms of torque-driven stance: PyBullet, of first order, comes nearer with its step."""
    q, v = at_vlo(robot)
    torque = np.array([20.0, -100.0, 10.0, 5.0])
    _, ideal, _ = run(robot, q, v, 50, torque)
    errors = []
    for step in (1e-3, 1e-4):
        with open_plant(robot, PlantOptions(time_step=step)) as plant:
            plant.reset(q, v)
            for _ in range(round(0.05 / step)):
                plant.step(torque)
            q1, v1 = np.zeros(7), np.zeros(7)
            plant.read(q1, v1)
        errors.append(np.abs(q1 - ideal).max())
    assert errors[0] < 0.01
    assert errors[1] < 0.2 * errors[0]


@pytest.fixture(scope="module")
def record(gait):
    return simulate(
        Experiment(load_robot("five-link"), planner=LqrPlanner(gait), steps=4, world=IdealOptions())
    )


def test_the_robot_walks_on_it(record):
    assert record.plant == "ideal"
    assert record.steps == 4
    assert not record.fell
    assert record.summary.qp_failures == 0


def test_forces_and_momentum_balance_at_every_tick(record):
    """Impacts, releases and all: the change of momentum is weight and the reported forces."""
    dt = record.time[1] - record.time[0]
    force = record.contact_force[1:].sum(axis=1)
    force[:, 1] -= 80.0 * 9.81
    residual = 80.0 * np.diff(record.com_velocity, axis=0) - force * dt
    assert np.abs(residual).max() < 1e-4  # N s
    assert record.contact_force[..., 1].min() > -1e-3


def test_stance_feet_stick_and_none_is_in_the_ground(record):
    assert record.foot[..., 1].min() > -1e-8
    single = np.char.startswith(np.array(record.nodes)[record.node], "SS")
    rear = record.foot[np.arange(len(record.time)), record.rear]
    moved = np.abs(np.diff(rear[:, 0]))[single[1:] & single[:-1] & (np.diff(record.rear) == 0)]
    assert moved.max() < 1e-4  # rolling of a 1 cm sphere


def test_joints_stay_within_their_limits(record):
    """Joint stops are not modelled; a walk does not need them."""
    assert record.q[:, [4, 6]].min() > 0.0
    assert record.q[:, [4, 6]].max() < 2.5
    assert np.abs(record.q[:, [3, 5]]).max() < 1.5


@pytest.mark.slow(seconds=7)
def test_a_fall_ends_the_run(robot, gait):
    record = simulate(
        Experiment(
            robot,
            planner=LqrPlanner(gait),
            steps=10,
            world=IdealOptions(),
            pushes=(Push(-200.0, step=1),),
            record_every=10,
        )
    )
    assert record.fell


def test_a_state_that_is_not_finite_is_named(robot):
    q, v = at_vlo(robot)
    plant = IdealPlant(robot, IdealOptions())
    plant.reset(q, v)
    with pytest.raises(ParameterError, match="not finite"):
        plant.step(np.full(4, np.nan))


def test_a_saved_run_names_its_plant(record, tmp_path):
    assert Record.load(record.save(tmp_path / "run.npz")).plant == "ideal"
    assert plant_name(PlantOptions()) == "pybullet"


def test_bad_options_are_named():
    with pytest.raises(ParameterError, match="time_step"):
        IdealOptions(time_step=0.0)
    with pytest.raises(ParameterError, match="mass_scale"):
        IdealOptions(mass_scale=float("nan"))
    with pytest.raises(ParameterError, match="liftoff_angle"):
        GuardOptions(liftoff_angle=4.0)
