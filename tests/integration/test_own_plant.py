"""A plant of the user's own in ``simulate``."""

import numpy as np
import pytest

import template_control as tc
from template_control.errors import ParameterError
from template_control.plant import BulletPlant, IdealPlant, Plant


class Wrapped:
    """The ideal plant behind another class, with a time step of its own."""

    time_step = 5e-4

    def __init__(self, robot):
        self.inner = IdealPlant(robot, tc.IdealOptions(time_step=self.time_step))
        self.closed = False
        self.steps = 0

    def reset(self, q, v):
        self.inner.reset(q, v)

    def read(self, q, v):
        self.inner.read(q, v)

    def contact_forces(self, out):
        self.inner.contact_forces(out)

    def trunk_touches_ground(self):
        return self.inner.trunk_touches_ground()

    def step(self, torque, push=0.0):
        self.steps += 1
        self.inner.step(torque, push)

    def ground_height(self, x):
        return 0.0

    def close(self):
        self.closed = True


@pytest.mark.slow(seconds=4)
def test_a_plant_of_ones_own_is_the_same_world(robot, default_gait, tmp_path):
    mine = Wrapped(robot)
    planner = tc.LqrPlanner(default_gait)
    record = tc.simulate(tc.Experiment(robot, planner=planner, steps=2, world=mine, delay=5e-4))
    expected = tc.simulate(
        tc.Experiment(
            robot, planner=planner, steps=2, world=tc.IdealOptions(time_step=5e-4), delay=5e-4
        )
    )
    np.testing.assert_array_equal(record.q, expected.q)
    np.testing.assert_array_equal(record.torque, expected.torque)
    assert record.time[1] == pytest.approx(5e-4)
    assert mine.steps == len(record.time)
    assert not mine.closed
    back = tc.Record.load(record.save(tmp_path / "run.npz"))
    assert back.plant == "Wrapped"
    assert tc.save_figures(back, tmp_path)


def test_the_librarys_plants_are_plants(robot):
    with BulletPlant(robot, tc.PlantOptions()) as bullet, IdealPlant(robot, tc.IdealOptions()) as i:
        for plant in (bullet, i):
            assert isinstance(plant, Plant)
            assert plant.time_step == 1e-3
            assert plant.ground_height(0.3) == 0.0
    step = tc.PlantOptions(terrain=tc.Terrain.step(0.02, 1.0))
    with BulletPlant(robot, step) as bullet:
        assert bullet.ground_height(1.5) == 0.02


def test_what_a_plant_lacks_is_told():
    class Half:
        time_step = 1e-3

        def reset(self, q, v):
            pass

    with pytest.raises(ParameterError, match=r"world is a Half, which lacks ground_height, read,"):
        tc.Experiment(world=Half())


@pytest.mark.parametrize("step", [0.0, -1e-3, np.nan, np.inf, "1"])
def test_a_time_step_that_is_none_is_told(robot, step):
    mine = Wrapped(robot)
    mine.time_step = step
    with pytest.raises(ParameterError, match=r"time_step is .*: give a positive number of seconds"):
        tc.Experiment(world=mine)


def test_a_plant_of_ones_own_cannot_be_written_down(robot, tmp_path):
    experiment = tc.Experiment(world=Wrapped(robot))
    with pytest.raises(ParameterError, match=r"^world is Wrapped, which TOML cannot say"):
        experiment.save(tmp_path / "run.toml")
