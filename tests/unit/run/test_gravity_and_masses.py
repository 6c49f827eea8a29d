"""Gravity and masses, of the controller's model and of the world, in all engines."""

import re
from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.errors import ParameterError, RobotError
from template_control.plant.plant import open_plant
from template_control.robot import RobotSpec
from template_control.robot.library import robot_path

WORLDS = [tc.PlantOptions(), tc.MujocoOptions(), tc.IdealOptions()]
KINDS = [world.kind for world in WORLDS]
MOON = 1.62


def test_model_and_template_have_the_gravity_that_is_asked_for():
    robot = RobotSpec(gravity=MOON).load()
    own, moon = tc.template_for(tc.load_robot("five-link")), tc.template_for(robot)
    assert (robot.gravity, moon.gravity) == (MOON, MOON)
    assert moon.leg_stiffness == pytest.approx(own.leg_stiffness * MOON / own.gravity)
    robot.update(robot.neutral(), np.zeros(robot.nv))
    assert robot.nonlinear_effects[1] == pytest.approx(robot.mass * MOON)


@pytest.mark.parametrize("free", [False, True])
def test_masses_of_links_are_those_that_are_asked_for(free):
    base = RobotSpec("bolt", free=free)
    robot = base.load()
    trunk = "base_link"
    heavy = replace(base, masses={trunk: 2.0}).load()
    before = sum(inertia.mass for inertia in robot.model.inertias)
    assert heavy.mass == pytest.approx(before + 2.0 - _mass(robot.urdf, trunk))
    assert heavy.leg_mass == robot.leg_mass
    again = replace(base, masses={trunk: _mass(robot.urdf, trunk)}).load()
    q = robot.neutral()
    for one in (robot, again):
        one.update(q, np.zeros(robot.nv))
    np.testing.assert_allclose(again.mass_matrix, robot.mass_matrix, rtol=1e-9, atol=1e-12)


def _mass(urdf, link):
    text = re.search(rf'<link name="{link}".*?</link>', urdf, re.DOTALL).group(0)
    return float(re.search(r'<mass value="([^"]+)"', text).group(1))


def test_a_link_that_is_none_is_named():
    with pytest.raises(RobotError, match="no link wing with a mass: give some of trunk, "):
        RobotSpec(masses={"wing": 1.0}).load()


@pytest.mark.parametrize("world", WORLDS, ids=KINDS)
@pytest.mark.slow(seconds=3)
def test_a_walk_on_the_moon_is_the_walk_here_by_similarity(world):
    ideal = isinstance(world, tc.IdealOptions)
    moon = tc.simulate(tc.Experiment(RobotSpec(gravity=MOON), world=world, steps=3))
    here = tc.simulate(tc.Experiment(world=world, steps=3))
    assert not moon.fell
    speeds = [r.section_state[1:, 0] / np.sqrt(g) for r, g in ((moon, MOON), (here, 9.81))]
    np.testing.assert_allclose(*speeds, rtol=0.01)
    times = [r.section_time[1:] * np.sqrt(g) for r, g in ((moon, MOON), (here, 9.81))]
    np.testing.assert_allclose(*times, rtol=0.005 if ideal else 0.01)
    assert moon.contact_force[:, :, 1].sum(axis=1).mean() == pytest.approx(
        moon.mass * MOON, rel=0.02
    )


@pytest.mark.parametrize("world", WORLDS, ids=KINDS)
def test_a_world_has_a_gravity_and_a_robot_of_its_own(world, robot):
    """A robot in the air falls with the world's gravity, whatever its controller knows."""
    own = replace(world, gravity=3.0, robot=RobotSpec(masses={"trunk": 90.0}))
    q, v = robot.neutral(), np.zeros(robot.nv)
    q[1] += 1.0
    with open_plant(robot, own) as plant:
        plant.reset(q, v)
        for _ in range(10):
            plant.step(np.zeros(4))
        plant.read(q, v)
        assert v[1] == pytest.approx(-3.0 * 0.01, rel=1e-3)
        simulated = plant.robot if hasattr(plant, "robot") else None
        mass = plant.model.body_mass.sum() if simulated is None else simulated.mass
    expected = robot.mass + 90.0 - _mass(robot.urdf, "trunk")
    assert mass == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("world", WORLDS, ids=KINDS)
@pytest.mark.slow(seconds=2)
def test_a_robot_walks_whose_urdf_is_not_the_controllers(world, tmp_path):
    text = robot_path("five-link").read_text()
    path = tmp_path / "loaded.urdf"
    mass = _mass(text, "trunk")
    path.write_text(text.replace(f'<mass value="{mass:g}"', f'<mass value="{1.05 * mass:g}"', 1))
    assert path.read_text() != text
    experiment = tc.Experiment(world=replace(world, robot=RobotSpec(str(path))), steps=3)
    record, known = tc.simulate(experiment), tc.simulate(tc.Experiment(world=world, steps=3))
    assert not record.fell
    assert record.mass == known.mass, "the controller's"
    carried = [r.contact_force[:, :, 1].sum(axis=1).mean() for r in (record, known)]
    heavier = 1.0 + 0.05 * mass / known.mass
    assert carried[0] / carried[1] == pytest.approx(heavier, rel=0.01)
    again = tc.Experiment.load(experiment.save(tmp_path / "run.toml"))
    np.testing.assert_array_equal(tc.simulate(again).q, record.q)


@pytest.mark.parametrize(
    ("spec", "told"),
    [
        (RobotSpec("bolt"), "the robot of the world has the joints FL_HFE, FL_KFE"),
        (RobotSpec("five-link-3d", free=True), "has another base than five-link"),
    ],
)
def test_a_robot_of_the_world_with_other_joints_is_refused(spec, told):
    with pytest.raises(ParameterError, match=told):
        tc.simulate(tc.Experiment(world=tc.PlantOptions(robot=spec), steps=1))


@pytest.mark.parametrize("change", [{"gravity": MOON}, {"masses": {"trunk": 90.0}}])
def test_a_gait_of_another_gravity_or_mass_is_refused(change, default_gait):
    other = RobotSpec(**change)
    with pytest.raises(ParameterError, match=r"is for a template of .*: give one"):
        tc.simulate(tc.Experiment(other, planner=tc.LqrPlanner(default_gait), steps=1))


def test_a_floating_base_robot_walks_under_another_gravity_with_a_payload():
    bolt = RobotSpec("bolt", free=True, gravity=5.0)
    loaded = replace(bolt, masses={"base_link": 0.65})
    world = tc.PlantOptions(robot=loaded)
    record = tc.simulate(tc.Experiment(bolt, world=world, steps=2))
    assert not record.fell
    assert record.contact_force[:, :, 1].sum(axis=1).mean() == pytest.approx(
        loaded.load().mass * 5.0, rel=0.05
    )
