"""What may disturb a walk: an unseen step of the ground, noisy sensors, late torques."""

from functools import cache

import numpy as np
import pytest

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.errors import ParameterError
from template_control.estimation.imu import ImuOptions
from template_control.plant.bullet import BulletPlant, PlantOptions, pybullet
from template_control.plant.terrain import Terrain
from template_control.robot.library import load_robot
from template_control.robot.start import state_at_vlo
from template_control.run.experiment import Experiment
from template_control.run.record import Record
from template_control.run.sensing import ContactSensors, SensorOptions, Sensors
from template_control.run.simulation import simulate
from template_control.slip.parameters import SlipParameters
from template_control.view.figures import stick_diagram
from template_control.view.style import Look


def walk(robot, gait, **options):
    options = {"world": PlantOptions(), **options}
    return simulate(Experiment(robot, planner=LqrPlanner(gait), **options))


@pytest.fixture(scope="session")
def on_step(gait):
    """Nine steps over a step of the ground of this height before the fifth foothold."""

    @cache
    def walked(height):
        step = Terrain.at_step(gait, height, 5)
        options = PlantOptions(terrain=step)
        return step, walk(load_robot("five-link"), gait, steps=9, world=options)

    return walked


@pytest.mark.parametrize("height", [0.04, -0.07])
@pytest.mark.parametrize("edge", [2.0, 900.0])
def test_rays_meet_the_ground_where_it_is_said_to_be(robot, height, edge):
    options = PlantOptions(terrain=Terrain.step(height, edge))
    with BulletPlant(robot, options) as plant:
        for x in (-20.0, edge - 1e-3, edge + 1e-3, edge + 500.0):
            ((_, _, _, hit, _),) = pybullet().rayTest(
                [x, 0.4, 3.0], [x, 0.4, -3.0], physicsClientId=plant.client
            )
            assert hit[2] == pytest.approx(height if x > edge else 0.0, abs=1e-6)
            assert options.ground_height(x) == (height if x > edge else 0.0)


@pytest.mark.slow(seconds=3)
@pytest.mark.parametrize("height", [0.005, -0.005])
def test_a_step_nobody_told_of_moves_the_feet(on_step, robot, height):
    step, record = on_step(height)
    assert not record.fell
    at = np.searchsorted(record.time, record.section_time)[1:]
    foot = record.foot[at, record.rear[at]]
    beyond = foot[:, 0] > step.points[0][0]
    # The first foot beyond the edge is about the fifth.
    assert 3 <= np.argmax(beyond) <= 5
    np.testing.assert_allclose(foot[:, 1], np.where(beyond, height, 0.0), atol=1e-4)
    force = record.contact_force[at, record.rear[at], 1]
    assert np.all(force > 0.3 * robot.mass * robot.gravity)


@pytest.mark.slow(seconds=2)
def test_momentum_changes_by_the_forces_on_both_levels(on_step, robot):
    """Weight and reported contact forces; a body of ground not counted would show."""
    _, record = on_step(0.005)
    force = record.contact_force[1:].sum(axis=1)
    force[:, 1] -= robot.mass * robot.gravity
    dt = record.time[1] - record.time[0]
    residual = robot.mass * np.diff(record.com_velocity, axis=0) / dt - force
    assert np.all(np.abs(residual.mean(axis=0)) < 0.5)  # N, of 785
    assert np.quantile(np.abs(residual), 0.99) < 10.0


@pytest.mark.slow(seconds=2)
def test_an_edge_out_of_reach_changes_nothing(robot, default_gait, short_walk):
    def towards(height):
        plant = PlantOptions(terrain=Terrain.step(height, 50.0))
        return walk(robot, default_gait, steps=short_walk.steps, world=plant)

    np.testing.assert_array_equal(towards(0.05).q, short_walk.q)
    # Before a step down the ground is another kind of body, which carries as well.
    np.testing.assert_allclose(towards(-0.05).section_state, short_walk.section_state, atol=1e-3)


def test_a_wall_pushes_sideways(robot):
    """The swing foot 1 mm inside the wall of a step up, at half its height."""
    q, v = state_at_vlo(robot, np.array([0.0, 0.97, 0.0]), 0, np.array([0.2, 0.1]), np.zeros(2))
    q[1] -= 5e-4  # the stance foot touches the ground
    edge = 0.2 + robot.foot_radius - 1e-3
    forces = np.zeros((2, 2))
    with BulletPlant(robot, PlantOptions(terrain=Terrain.step(0.25, edge))) as plant:
        plant.reset(q, v)
        plant.step(np.zeros(robot.nv - 3))
        plant.contact_forces(forces)
    assert forces[1, 0] < 0.0
    assert abs(forces[1, 1]) <= 0.7 * abs(forces[1, 0]) + 1e-9
    assert forces[0, 1] > 0.0


def test_the_hip_is_measured_from_the_ground_below_it(robot, gait, monkeypatch):
    monkeypatch.setattr(PlantOptions, "ground_height", lambda _, x: 0.6 if x > 1.0 else 0.0)
    record = walk(robot, gait, steps=9)
    assert "the hip was 0." in record.fall_reason
    assert record.q[-2, 0] <= 1.0 < record.q[-1, 0]


@pytest.mark.slow(seconds=1)
def test_the_stick_diagram_draws_the_step(on_step, short_walk, tmp_path):
    step, record = on_step(0.005)
    record = Record.load(record.save(tmp_path / "run.npz"))
    (axes,) = stick_diagram(record, Look(start=-4.0)).axes
    ground = axes.lines[-1].get_xydata()
    np.testing.assert_allclose(ground[:, 1], [0.0, 0.0, 0.005, 0.005])
    np.testing.assert_allclose(ground[1:3, 0], step.points[0][0])
    (axes,) = stick_diagram(short_walk).axes
    assert np.all(axes.lines[-1].get_ydata() == 0.0)


class Spy:
    """Notes what the controller is given and what the plant is driven with."""

    def __init__(self, monkeypatch):
        self.measured, self.true, self.torque = [], [], []
        tick, read, step = EmbeddingController.tick, BulletPlant.read, BulletPlant.step

        def ticked(controller, q, v, contact, dt, force):
            self.measured.append(np.concatenate((q, v)))
            return tick(controller, q, v, contact, dt, force)

        def was_read(plant, q, v):
            read(plant, q, v)
            self.true.append(np.concatenate((q, v)))

        def stepped(plant, torque, push=0.0):
            self.torque.append(np.array(torque))
            step(plant, torque, push)

        monkeypatch.setattr(EmbeddingController, "tick", ticked)
        monkeypatch.setattr(BulletPlant, "read", was_read)
        monkeypatch.setattr(BulletPlant, "step", stepped)


def test_the_controller_gets_noise_and_the_record_the_truth(robot, gait, monkeypatch):
    spy = Spy(monkeypatch)
    sensors = SensorOptions(position_noise=1e-4, velocity_noise=2e-3, seed=3)
    record = walk(robot, gait, steps=3, sensors=sensors)
    true, measured = np.array(spy.true), np.array(spy.measured)
    np.testing.assert_array_equal(np.hstack((record.q, record.v)), true)
    noise = measured - true
    assert len(noise) > 1000
    expected = np.repeat([1e-4, 2e-3], robot.nv)
    # Five standard errors of a mean, of a deviation and of a correlation.
    n = len(noise)
    assert np.all(np.abs(noise.mean(axis=0)) < 5.0 * expected / np.sqrt(n))
    assert np.all(np.abs(noise.std(axis=0) / expected - 1.0) < 5.0 / np.sqrt(2.0 * n))
    unit = noise / expected
    assert np.all(np.abs((unit[1:] * unit[:-1]).mean(axis=0)) < 5.0 / np.sqrt(n))
    across = unit.T @ unit / n - np.eye(2 * robot.nv)
    assert np.abs(across - np.diag(np.diag(across))).max() < 5.0 / np.sqrt(n)
    for row in (0, 400, 1000):
        robot.update(record.q[row], record.v[row])
        np.testing.assert_array_equal(record.com[row], robot.com)
        np.testing.assert_array_equal(record.foot[row], robot.foot_position)


def test_noise_is_seeded_and_scales_with_the_template(robot):
    q, v, contact = np.zeros(robot.nv), np.zeros(robot.nv), np.ones(2, dtype=bool)
    options = SensorOptions(position_noise=1e-3, velocity_noise=0.1, seed=5)
    tall, small = SlipParameters(), SlipParameters(rest_length=0.5)
    first, again = Sensors(options, robot, tall), Sensors(options, robot, small)
    other = Sensors(SensorOptions(1e-3, 0.1, seed=6), robot, tall)
    for _ in range(3):
        a, b, c = (s.measure(q, v, contact) for s in (first, again, other))
        for i in range(2):
            np.testing.assert_allclose(b[i][:2], 0.5 * a[i][:2])
            np.testing.assert_array_equal(b[i][2:], a[i][2:])
            assert not np.any(c[i] == a[i])
    assert not q.any()
    assert not v.any()


@pytest.mark.parametrize("options", [SensorOptions, ImuOptions])
def test_wrong_flags_are_seeded_and_come_with_their_forces(options):
    share, ticks, threshold = 0.02, 20_000, 4.0
    true = np.array([[30.0, 0.0, 500.0], [0.0, 0.0, 0.0]])
    flags = []
    for seed in (3, 3, 4):
        sensors = ContactSensors(options(contact_errors=share, seed=seed), threshold)
        felt = [sensors.measure(true) for _ in range(ticks)]
        flags.append(np.array([flag for flag, _ in felt]))
    forces = np.array([force for _, force in felt])
    np.testing.assert_array_equal(flags[0], flags[1])
    assert np.any(flags[0] != flags[2])
    wrong = flags[2] != [True, False]
    five = 5.0 * np.sqrt(share * (1.0 - share) / ticks)
    assert wrong.mean(axis=0) == pytest.approx(share, abs=five)
    both = share**2
    assert wrong.all(axis=1).mean() == pytest.approx(both, abs=5.0 * np.sqrt(both / ticks))
    np.testing.assert_array_equal(
        forces[~wrong[:, 0], 0], np.broadcast_to(true[0], (sum(~wrong[:, 0]), 3))
    )
    assert not forces[wrong[:, 0], 0].any(), "in the air, it seems"
    assert np.all(forces[wrong[:, 1], 1] == [0.0, 0.0, threshold])
    np.testing.assert_array_equal(true[0], [30.0, 0.0, 500.0])


def test_without_errors_flags_and_forces_are_the_true_ones():
    forces = np.array([[1.0, 5.0], [0.0, 4.0]])
    flags, felt = ContactSensors(SensorOptions(), 4.0).measure(forces)
    assert felt is forces
    np.testing.assert_array_equal(flags, [True, False])


@pytest.mark.parametrize("ticks", [0, pytest.param(1, marks=pytest.mark.slow), 4])
def test_torques_act_that_many_ticks_later(robot, gait, monkeypatch, ticks):
    spy = Spy(monkeypatch)
    record = walk(robot, gait, steps=2, delay=ticks * 1e-3)
    applied = np.array(spy.torque)
    # The last sample's torques are not applied any more: the run is over.
    sources = np.maximum(np.arange(len(applied)) - ticks, 0)
    np.testing.assert_array_equal(applied, record.torque[sources])


@pytest.mark.parametrize(
    ("make", "culprit"),
    [
        (lambda: Terrain.step(np.nan, 1.0), "height"),
        (lambda: Terrain.step(1e4, 1.0), "height"),
        (lambda: Terrain.step(0.1, 0.0), "x is .*above 0"),
        (lambda: Terrain.step(0.1, 2e3), "x is "),
        (lambda: SensorOptions(position_noise=-1.0), "position_noise"),
        (lambda: SensorOptions(velocity_noise=np.inf), "velocity_noise"),
        (lambda: SensorOptions(seed=-1), "seed"),
        (lambda: SensorOptions(contact_errors=1.01), "contact_errors"),
        (lambda: Experiment(delay=-1e-3), "delay"),
        (lambda: Experiment(delay=1.5e-3), "delay.*multiple.*0.001 s"),
        (lambda: Experiment(delay=np.nan), "delay"),
        (lambda: Experiment(delay=2.0), "delay"),
    ],
)
def test_bad_disturbances_are_named(make, culprit):
    with pytest.raises(ParameterError, match=culprit):
        make()


def test_bad_footholds_are_named(gait):
    with pytest.raises(ParameterError, match="step is 0"):
        Terrain.at_step(gait, 0.1, 0)
    with pytest.raises(ParameterError, match="share"):
        Terrain.at_step(gait, 0.1, 3, share=1.1)
    assert Terrain.at_step(gait, 0.1, 3).points[0][0] == pytest.approx(2.5 * gait.step_length)
