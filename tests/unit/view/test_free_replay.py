"""Replays of free runs: what is where in space."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

import template_control as tc
from template_control.cli.main import main
from template_control.view.replay.film import IN_SPACE, Stage
from template_control.view.replay.playback import playback
from template_control.view.replay.robot_visuals import load_shapes, placements
from template_control.view.replay.scene import in_space, scene_commands, stood, turned_to

RADIUS = 0.01  # of the feet


@pytest.fixture(scope="session")
def record():
    """Three steps of the robot of human size, in a turn."""
    robot = tc.load_floating_robot("five-link-3d")
    planner = tc.LqrPlanner(tc.robot_gait_for_speed(robot, 1.0), tc.embedding.FREE_PLANNER)
    course = tc.HeadingCommand(turning_rate=0.4)
    return tc.simulate(tc.Experiment(robot, planner=planner, steps=3, course=course))


def test_a_quaternion_turns_the_vertical_into_its_direction():
    directions = np.random.default_rng(2).normal(size=(40, 3))
    directions[:3] = (0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
    for quaternion, direction in zip(turned_to(directions), directions, strict=True):
        turned = pin.Quaternion(quaternion).matrix()[:, 2]
        size = np.linalg.norm(direction)
        expected = direction / size if size else (0.0, 0.0, 1.0)
        np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_a_leg_that_passes_the_vertical_does_not_spin():
    angles = np.linspace(-0.4, 0.4, 41)
    legs = np.stack((np.sin(angles), np.full(41, 0.05), -np.cos(angles)), axis=1)
    found = turned_to(legs)
    assert np.abs(np.diff(found, axis=0)).max() < 0.02


def test_up_is_up_and_forward_is_to_the_right_in_the_film():
    right, up = IN_SPACE @ np.array([0.0, 0.0, 1.0]), IN_SPACE @ np.array([1.0, 0.0, 0.0])
    assert right[0] == 0.0
    assert right[1] > 0.9
    assert up[0] > 0.9


@pytest.mark.slow(seconds=4)
def test_the_template_is_where_its_toes_are(record):
    space = in_space(record, np.zeros(2))
    np.testing.assert_array_equal(space.com, record.space_com)
    away = np.linalg.norm((space.template - space.com)[:, :2], axis=1)
    np.testing.assert_allclose(away, np.abs((record.template_com - record.com)[:, 0]), atol=1e-12)
    for foot, (places, since) in enumerate(stood(record, space)):
        assert len(places) == len(since) >= 2
        assert np.all(np.diff(since) > 0.0)
        for place, time in zip(places, since, strict=True):
            row = min(np.searchsorted(record.time, time + 0.02), len(record.time) - 1)
            np.testing.assert_allclose(place, record.space_foot[row, foot], atol=2e-3)


@pytest.mark.slow(seconds=1)
def test_visuals_are_where_the_run_recorded_the_feet(record):
    model, shapes = load_shapes(record)
    rows = np.arange(0, len(record.time), 97)
    position, _ = placements(model, shapes, record.q[rows])
    names = [shape.name for shape in shapes.geometryObjects]
    for foot, side in enumerate(("left", "right")):
        found = position[:, names.index(f"{side}_foot_0")]
        np.testing.assert_allclose(found, record.space_foot[rows, foot] + [0, 0, RADIUS], atol=1e-9)


@pytest.mark.slow(seconds=1)
def test_the_scene_follows_the_walk_in_its_turn(record):
    frames = playback(record, fps=20.0)
    tracks = {
        (animation["path"], track["name"]): track["values"]
        for animation in scene_commands(frames)[-1]["animations"]
        for track in animation["clip"]["tracks"]
    }

    def of(path, name):
        return np.frombuffer(tracks[path, name].data, np.float32).reshape(len(frames.rows), -1)

    com = record.space_com[frames.rows]
    np.testing.assert_allclose(of("/meshcat/com", ".position"), com, atol=1e-5)
    np.testing.assert_allclose(of("/meshcat", ".position")[:, :2], -com[:, :2], atol=1e-5)
    left = record.space_foot[frames.rows, 0]
    np.testing.assert_allclose(of("/meshcat/ground_force/left", ".position"), left, atol=1e-5)


@pytest.mark.slow(seconds=2)
def test_the_film_shows_the_legs_on_their_feet(record):
    frames = playback(record, fps=5.0)
    stage = Stage(frames)
    thigh = []
    for frame, row in enumerate(frames.rows):
        stage.show(frame)
        for foot, leg in enumerate(stage.legs):
            points = np.array(leg.get_data()).T
            np.testing.assert_allclose(
                points[-1], stage.seen(record.space_foot[row, foot]), atol=1e-12
            )
        body = stage.joints[frame, 0]
        thigh.append(np.linalg.norm(body[2] - body[1]))
    np.testing.assert_allclose(thigh, 0.45, atol=1e-9)


@pytest.mark.slow(seconds=3)
def test_the_command_replays_a_free_run(record, tmp_path, capfd):
    run = str(record.save(tmp_path / "run.npz"))
    film, page = tmp_path / "a.gif", tmp_path / "a.html"
    words = ["--fps", "5", "--start", "-1", "--gif", str(film), "--html", str(page)]
    assert main(["replay", run, *words]) == 0, capfd.readouterr().err
    pictures = Image.open(film)
    assert pictures.n_frames == 6
    assert "five-link-3d" in page.read_text()


@pytest.mark.slow(seconds=1)
def test_a_robot_without_shapes_is_shown_with_sticks_down_to_its_feet(record):
    text = re.sub(r"<visual.*?</visual>", "", record.urdf, flags=re.DOTALL)
    bare = replace(record, metadata={**record.metadata, "urdf": text})
    model, shapes = load_shapes(bare)
    rows = np.arange(0, len(record.time), 97)
    position, quaternion = placements(model, shapes, record.q[rows])
    names = [shape.name for shape in shapes.geometryObjects]
    assert all(name.startswith("stick_") for name in names)
    for foot, leg in enumerate(record.legs):
        i = names.index(f"stick_{record.joints[leg[-1]]}")
        half = shapes.geometryObjects[i].geometry.halfLength
        turned = Rotation.from_quat(quaternion[:, i]).apply([0.0, 0.0, half])
        away = np.minimum(
            *(
                np.linalg.norm(position[:, i] + side * turned - sole, axis=1)
                for side in (1.0, -1.0)
                for sole in [record.space_foot[rows, foot] + [0.0, 0.0, RADIUS]]
            )
        )
        np.testing.assert_allclose(away, 0.0, atol=1e-9)
