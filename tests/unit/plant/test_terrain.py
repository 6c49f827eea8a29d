"""Ground of any profile: what it is, how it is told, and where the plants have it."""

import dataclasses
import json
import tomllib
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import template_control as tc
from template_control import settings
from template_control.cli.main import main
from template_control.errors import ParameterError
from template_control.plant import (
    BulletPlant,
    IdealPlant,
    MujocoPlant,
    Terrain,
    read_terrain,
    terrain_from,
)
from template_control.plant.bullet import pybullet
from template_control.plant.terrain import pieces
from template_control.robustness.disturbances import with_step

SLOPE = Terrain.slope(np.radians(4.0))
GROUNDS = {
    "flat": Terrain.flat(),
    "up": Terrain.step(0.03, 1.2),
    "down": Terrain.step(-0.03, 1.2),
    "stairs": Terrain.stairs(0.04, 0.5, 4),
    "slope": SLOPE,
    "steep down": Terrain.slope(np.radians(-20.0), 1.0, 0.5),
    "random": Terrain.random_steps(0.02, seed=3, end=5.0),
    "polyline": Terrain(((0.5, 0.0), (1.0, 0.05), (1.0, -0.02), (2.0, -0.02), (3.0, 0.1))),
}


def test_heights_are_the_lines_between_the_points():
    ground = GROUNDS["polyline"]
    places = (-5.0, 0.75, 1.0 - 1e-9, 1.0, 2.5, 9.0)
    expected = (0.0, 0.025, 0.05, -0.02, 0.04, 0.1)
    assert [ground.height_at(x) for x in places] == pytest.approx(expected, abs=1e-6)
    assert SLOPE.height_at(51.0) == pytest.approx(50.0 * np.tan(np.radians(4.0)))
    stairs = GROUNDS["stairs"]
    assert [stairs.height_at(x) for x in (0.9, 1.1, 1.6, 9.0)] == pytest.approx(
        [0, 0.04, 0.08, 0.16]
    )
    waves = Terrain.of_function(lambda x: 0.03 * np.sin(3.0 * x), 10.0, 0.01)
    assert waves.height_at(4.321) == pytest.approx(0.03 * np.sin(3.0 * 4.321), abs=1e-5)


def test_random_steps_are_drawn_by_their_seed():
    made = Terrain.random_steps(0.02, (0.3, 0.6), seed=5, start=1.0, end=50.0)
    assert made == Terrain.random_steps(0.02, (0.3, 0.6), seed=5, start=1.0, end=50.0)
    assert made != Terrain.random_steps(0.02, (0.3, 0.6), seed=6, start=1.0, end=50.0)
    walls = np.array(made.points)[::2, 0]
    heights = np.array(made.points)[1::2, 1]
    runs = np.diff(walls)
    assert 0.3 <= runs.min() < 0.32 < 0.58 < runs.max() <= 0.6
    assert -0.02 <= heights.min() < -0.015 < 0.015 < heights.max() <= 0.02


def test_the_closest_point_of_the_ground_is_told():
    sine, cosine = np.sin(np.radians(4.0)), np.cos(np.radians(4.0))
    on_slope = SLOPE.height_at(20.0)
    for ground, x, y, distance, normal in (
        (SLOPE, 0.5, 0.2, 0.2, (0.0, 1.0)),
        (SLOPE, 20.0, on_slope + 0.1, 0.1 * cosine, (-sine, cosine)),
        (SLOPE, 20.0, on_slope, 0.0, (-sine, cosine)),
        (GROUNDS["up"], 1.19, 0.02, 0.01, (-1.0, 0.0)),  # beside the wall
        (GROUNDS["up"], 1.17, 0.07, 0.05, (-0.6, 0.8)),  # over the edge
        (GROUNDS["flat"], 3.0, -0.1, -0.1, (0.0, 1.0)),
    ):
        seen = ground.closest(x, y)
        assert seen.distance == pytest.approx(distance)
        assert seen.normal == pytest.approx(normal)


def balls(ground, radius):
    """Centres of a ball 1 mm above the ground at many places."""
    for x in np.r_[np.linspace(0.5, 3.0, 40), 80.0]:
        yield float(x), ground.height_at(float(x)) + radius + 1e-3


@pytest.mark.parametrize("name", GROUNDS)
def test_a_ball_in_pybullet_is_as_far_from_the_ground_as_is_told(robot, name):
    ground, radius = GROUNDS[name], 0.01
    with BulletPlant(robot, tc.PlantOptions(terrain=ground)) as plant:
        c = plant.client
        shape = pybullet().createCollisionShape(
            pybullet().GEOM_SPHERE, radius=radius, physicsClientId=c
        )
        ball = pybullet().createMultiBody(1.0, shape, physicsClientId=c)
        bodies = range(1 + len(pieces(ground)[1]))
        for x, y in balls(ground, radius):
            pybullet().resetBasePositionAndOrientation(
                ball, (x, 0.0, y), (0.0, 0.0, 0.0, 1.0), physicsClientId=c
            )
            found = [
                point
                for body in bodies
                for point in pybullet().getClosestPoints(ball, body, 0.1, physicsClientId=c)
            ]
            nearest = min(found, key=lambda point: point[8])
            expected = ground.closest(x, y)
            # Bullet rounds the edges of a box by its margin of 1 mm.
            corners = np.array(ground.points) - (x, y)
            rounded = np.linalg.norm(corners, axis=1).min() < expected.distance + 1e-3
            within = 5e-4 if rounded else 1e-6
            assert nearest[8] == pytest.approx(expected.distance - radius, abs=within)
            if not rounded:
                normal = (nearest[7][0], nearest[7][2])
                assert normal == pytest.approx(expected.normal, abs=1e-6)


@pytest.mark.parametrize("name", GROUNDS)
def test_a_foot_in_mujoco_is_as_far_from_the_ground_as_is_told(robot, name):
    ground = GROUNDS[name]
    plant = MujocoPlant(robot, tc.MujocoOptions(terrain=ground))
    foot = plant.model.geom("foot0_0").id
    shapes = [i for i in range(plant.model.ngeom) if plant.model.geom(i).bodyid[0] == 0]
    q = np.zeros(robot.nv)
    robot.update(q, q)
    x0, y0 = robot.foot_position[0]
    for x, y in balls(ground, robot.foot_radius):
        q[:2] = x - x0, y - robot.foot_radius - y0
        plant.reset(q, 0.0 * q)
        mujoco.mj_forward(plant.model, plant.data)
        found = [
            mujoco.mj_geomDistance(plant.model, plant.data, foot, i, 0.1, np.zeros(6))
            for i in shapes
        ]
        expected = ground.closest(x, y).distance - robot.foot_radius
        assert min(found) == pytest.approx(expected, abs=1e-6)


def stand_on(robot, plant, x, ground, ticks=2):
    """Mean force on each foot, with a robot at rest and both feet together, in the ground."""
    q = np.zeros(robot.nv)
    robot.update(q, q)
    q[:2] = x - robot.foot_position[0, 0], -robot.foot_position[0, 1]
    q[1] += ground.height_at(x) - 2e-4
    forces = np.zeros((2, 2))
    plant.reset(q, np.zeros(robot.nv))
    for _ in range(ticks):
        plant.step(np.zeros(robot.nv - 3))
    plant.contact_forces(forces)
    return forces


@pytest.mark.parametrize("angle", [4.0, -4.0])
def test_a_slope_pushes_out_of_itself_in_both_engines(robot, angle):
    """Without friction the force is along the normal."""
    ground = Terrain.slope(np.radians(angle))
    world = {"terrain": ground, "friction": 1e-6}
    with BulletPlant(robot, tc.PlantOptions(**world)) as plant:
        bullet = stand_on(robot, plant, 5.0, ground)
    other = stand_on(robot, MujocoPlant(robot, tc.MujocoOptions(**world)), 5.0, ground)
    for forces in (bullet, other):
        assert forces[:, 1].min() > 1.0
        expected = np.full(2, -np.tan(np.radians(angle)))
        np.testing.assert_allclose(forces[:, 0] / forces[:, 1], expected, atol=1e-4)


@pytest.mark.parametrize(
    ("made", "options"), [(BulletPlant, tc.PlantOptions), (MujocoPlant, tc.MujocoOptions)]
)
def test_friction_changes_along_the_ground(robot, made, options):
    ground = dataclasses.replace(Terrain.step(0.02, 6.0), friction=((3.0, 0.1), (4.0, 0.5)))
    q, sliding = np.zeros(robot.nv), np.zeros(robot.nv)
    sliding[0] = 1.0
    robot.update(q, sliding)
    height, x0 = robot.foot_position[0, 1], robot.foot_position[0, 0]

    def felt(world, x):
        q[:2] = x - x0, world.ground_height(x) - height - 2e-4
        forces = np.zeros((2, 2))
        with made(robot, world) as plant:
            plant.reset(q, sliding)
            plant.step(np.zeros(robot.nv - 3))
            plant.contact_forces(forces)
        return forces.sum(axis=0)

    for x, friction in ((2.0, 0.7), (3.5, 0.1), (5.0, 0.5), (7.0, 0.5)):
        expected = felt(options(terrain=Terrain.step(0.02, 6.0), friction=friction), x)
        assert expected[0] < -0.05 * expected[1]
        np.testing.assert_allclose(felt(options(terrain=ground), x), expected, rtol=1e-3)


@pytest.mark.parametrize("angle", [4.0, -4.0])
def test_an_ideal_foot_rolls_on_a_slope_and_sticks(robot, angle):
    ground = Terrain.slope(np.radians(angle))
    plant = IdealPlant(robot, tc.IdealOptions(terrain=ground))
    forces = stand_on(robot, plant, 5.0, ground, ticks=40)
    assert plant.contacts
    q, v = np.zeros(robot.nv), np.zeros(robot.nv)
    plant.read(q, v)
    robot.update(q, v)
    for foot in plant.contacts:
        x, y = robot.foot_position[foot]
        seen = ground.closest(x, y + robot.foot_radius)
        assert seen.distance == pytest.approx(robot.foot_radius, abs=1e-9)
        # Out of the ground, and more than half of what acts is.
        assert forces[foot] @ seen.normal > 0.5 * np.linalg.norm(forces[foot])


def test_an_ideal_foot_that_hits_a_wall_stops(robot):
    ground = Terrain.step(0.3, 0.6)
    plant = IdealPlant(robot, tc.IdealOptions(terrain=ground))
    q, v = np.zeros(robot.nv), np.zeros(robot.nv)
    robot.update(q, v)
    q[:2] = -robot.foot_position[0] + (0.55, 0.1)
    v[0] = 2.0
    plant.reset(q, v)
    pushed = 0.0
    forces = np.zeros((2, 2))
    for _ in range(40):
        plant.step(np.zeros(robot.nv - 3))
        plant.contact_forces(forces)
        pushed = min(pushed, forces[:, 0].min())
    assert pushed < -100.0
    plant.read(q, v)
    robot.update(q, v)
    assert robot.foot_position[:, 0].max() < 0.6 - robot.foot_radius + 1e-6


@pytest.mark.parametrize("kind", ["pybullet", "mujoco", "ideal"])
def test_every_plant_tells_the_ground_below(robot, kind):
    options = {"pybullet": tc.PlantOptions, "mujoco": tc.MujocoOptions, "ideal": tc.IdealOptions}
    world = options[kind](terrain=GROUNDS["stairs"])
    assert world.ground_height(1.7) == pytest.approx(0.08)
    assert options[kind]().ground_height(1.7) == 0.0


def test_a_step_goes_into_level_ground_only():
    world = tc.PlantOptions(friction=0.5)
    assert with_step(world, 0.02, 1.5) == replace(world, terrain=Terrain.step(0.02, 1.5))
    assert with_step(replace(world, terrain=SLOPE), 0.0, 1.5).terrain == SLOPE
    with pytest.raises(ParameterError, match="has a terrain, and is to get a step too"):
        with_step(replace(world, terrain=SLOPE), 0.02, 1.5)


def test_text_tells_every_kind(tmp_path):
    assert terrain_from("flat") == Terrain.flat()
    assert terrain_from("step:height=-0.03,x=2.5") == Terrain.step(-0.03, 2.5)
    assert terrain_from("stairs:rise=0.02,run=0.6,count=5") == Terrain.stairs(0.02, 0.6, 5)
    assert terrain_from("slope:angle=4") == SLOPE
    drawn = Terrain.random_steps(0.02, (0.2, 0.6), 3)
    assert terrain_from("random:height=0.02,shortest=0.2,seed=3") == drawn
    path = tmp_path / "ground.csv"
    path.write_text("# x, height\n1.0, 0.0\n2.0, 0.1  # up\n\n2.0 0.05\n")
    assert terrain_from(str(path)) == Terrain(((1.0, 0.0), (2.0, 0.1), (2.0, 0.05)))
    path = tmp_path / "ground.toml"
    path.write_text("points = [[1.0, 0.0], [1.0, 0.02]]\nfriction = [[2.0, 0.4]]\n")
    assert read_terrain(path) == Terrain(((1.0, 0.0), (1.0, 0.02)), ((2.0, 0.4),))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("hills", "no terrain 'hills': give flat, step"),
        ("step:height=0.03", "lacks a number: step takes height, x"),
        ("step:height=high,x=1", "height is 'high': give a number"),
        ("slope:angel=4", "slope takes angle, start, length, and not 'angel'"),
        ("slope:angle=80", "angle"),
        ("flat:height=1", "flat takes no number"),
        ("none.csv", "cannot read none.csv"),
        ("none.toml", "cannot read none.toml"),
    ],
)
def test_text_that_tells_no_ground_is_refused(text, told):
    with pytest.raises(ParameterError, match=told) as caught:
        terrain_from(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1 2 3", "other than two columns"),
        ("1 high", "could not convert.*two columns"),
        ("1 0\n0.5 0", "x falls from 1 to 0.5 m"),
        ("", "points is empty"),
        ("-1 0.1", "at x = 0 is at height 0.1 m: take 0.1 from all"),
        ("1 0\n1 1\n1 2", "three are at x = 1 m"),
    ],
)
def test_a_file_that_holds_no_ground_is_refused(text, told, tmp_path):
    path = tmp_path / "ground.txt"
    path.write_text(text)
    with pytest.raises(ParameterError, match=told) as caught:
        read_terrain(path)
    assert str(path) in str(caught.value)


def test_options_keep_their_terrain_in_a_file():
    plant = tc.MujocoOptions(terrain=GROUNDS["random"])
    options = tc.Experiment(world=plant)
    table = tomllib.loads(settings.text(settings.to_table(options)))
    assert settings.from_table(tc.Experiment, table) == options


@pytest.fixture(scope="module")
def up_the_slope(default_gait):
    ground = Terrain.slope(np.radians(4.0), start=0.7)
    return tc.simulate(
        tc.Experiment(
            tc.load_robot("five-link"),
            planner=tc.LqrPlanner(default_gait),
            steps=5,
            world=tc.PlantOptions(terrain=ground),
        )
    )


def test_feet_stand_on_the_slope(up_the_slope):
    record = up_the_slope
    assert not record.fell
    ground = record.ground
    assert ground == Terrain.slope(np.radians(4.0), start=0.7)
    at = np.searchsorted(record.time, record.section_time)[1:-1]
    for x, y in record.foot[at, record.rear[at]].tolist():
        seen = ground.closest(x, y + 0.01)
        assert seen.distance == pytest.approx(0.01, abs=3e-4)


def test_figures_and_replay_show_the_ground(up_the_slope, tmp_path):
    record = up_the_slope
    figure = tc.plot(record, "stick_diagram")
    lines = [line.get_xydata() for line in figure.axes[0].lines]
    assert any(np.array_equal(line[1:-1], record.ground.points[:1]) for line in lines)
    assert tc.save_html(record, tmp_path / "run.html").stat().st_size > 0
    assert tc.save_film(record, tmp_path / "run.gif", start=-0.1).stat().st_size > 0


@pytest.mark.slow
def test_the_command_walks_on_it_and_its_file_repeats_it(tmp_path, capsys):
    folder = tmp_path / "first"
    spec = "random:height=0.01,seed=2,start=0.9"
    common = ["--steps", "3", "--no-figures", "--json"]
    assert main(["walk", "--terrain", spec, "--output", str(folder), *common]) == 0
    first = json.loads(capsys.readouterr().out)
    again = tmp_path / "again"
    config = str(folder / "run.toml")
    assert main(["walk", "--config", config, "--output", str(again), *common]) == 0
    second = json.loads(capsys.readouterr().out)
    assert tc.Record.load(again / "run.npz").ground == terrain_from(spec)
    ignored = {"run", "output", "wall_seconds"}
    for key in first.keys() - ignored:
        if "second" not in key and "real" not in key and not isinstance(first[key], str | dict):
            assert first[key] == second[key], key
