"""Replays: which frames they show, and what is where in them."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import template_control as tc
from template_control.view.replay.playback import (
    carrying,
    force_arrows,
    playback,
    spring,
)
from template_control.view.replay.robot_visuals import drawn, load_shapes, placements
from template_control.view.replay.scene import in_space, scene_commands, stood

FOOT_RADIUS = 0.01


@pytest.fixture
def record(short_walk):
    return short_walk


def with_urdf(record, old, new):
    text = record.urdf.replace(" />", "/>")  # as it stands in the file
    assert old in text
    return replace(record, metadata={**record.metadata, "urdf": text.replace(old, new)})


# Which frames.


def test_frames_are_equally_spaced_and_show_the_nearest_sample(record):
    frames = playback(record, fps=25.0, speed=0.5, start=0.4, end=1.4)
    assert np.allclose(np.diff(frames.clock), 0.04)
    assert frames.clock[-1] == pytest.approx(2.0)
    assert np.allclose(record.time[frames.rows], 0.4 + 0.5 * frames.clock, atol=0.51e-3)


def test_negative_times_count_from_the_end(record):
    frames = playback(record, fps=30.0, start=-1.0)
    assert record.time[frames.rows[0]] == pytest.approx(record.time[-1] - 1.0, abs=1e-3)


def test_the_shortest_run_has_two_frames(record):
    short = replace(record, time=record.time[:2])
    frames = playback(short, fps=30.0)
    assert len(frames.rows) == 2
    assert frames.clock[1] > frames.clock[0]


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        ({"speed": 0.0}, "speed is 0"),
        ({"speed": np.nan}, "speed is nan"),
        ({"fps": 1e4}, "fps is 10000"),
        ({"start": 99.0}, "start 99"),
        ({"start": 1.0, "end": 0.5}, "start 1 s and end 0.5 s"),
        ({"end": np.inf}, "inf"),
        ({"speed": 0.01, "fps": 120.0}, None),
    ],
)
def test_numbers_out_of_range_are_named(record, arguments, culprit):
    if culprit is None:  # a small run may be slow; a long one may not
        record = replace(record, time=100.0 * record.time)
        culprit = "more than 100000"
    with pytest.raises(tc.errors.ParameterError, match=culprit):
        playback(record, **{"fps": 30.0, **arguments})


# What is where.


def test_visuals_are_where_the_run_recorded_joints_and_feet(record):
    model, shapes = load_shapes(record)
    rows = np.arange(0, len(record.time), 37)
    position, quaternion = placements(model, shapes, record.q[rows])
    assert np.allclose(np.linalg.norm(quaternion, axis=2), 1.0)
    names = [shape.name for shape in shapes.geometryObjects]
    for foot, side in enumerate(("left", "right")):
        hip, knee = record.joint[rows][:, record.legs[foot]].transpose(1, 0, 2)
        sole = record.foot[rows, foot] + [0.0, FOOT_RADIUS]
        for link, middle in (("thigh", (hip + knee) / 2), ("shank", (knee + sole) / 2)):
            found = position[:, names.index(f"{side}_{link}_0")]
            assert np.allclose(found[:, [0, 2]], middle, atol=1e-9)
        assert np.allclose(position[:, names.index(f"{side}_foot_0")][:, [0, 2]], sole, atol=1e-9)


def tracks(commands):
    """Every animated property as floats, by path and name."""
    found = {}
    for animation in commands[-1]["animations"]:
        for track in animation["clip"]["tracks"]:
            values = track["values"]
            if not isinstance(values, list):
                values = np.frombuffer(values.data, np.float32)
            times = np.frombuffer(track["times"].data, np.float32)
            found[animation["path"], track["name"]] = times, np.asarray(values)
    return found


def test_the_scene_moves_with_the_run(record):
    frames = playback(record, fps=30.0)
    found = tracks(scene_commands(frames))
    rows = frames.rows
    for (_, name), (times, values) in found.items():
        # All alike, or loops would drift apart.
        assert times[0] == frames.clock[0]
        assert times[-1] == pytest.approx(frames.clock[-1])
        if name != ".visible":
            assert np.allclose(times, frames.clock, atol=1e-5)
        assert len(values) % len(times) == 0
    world = found["/meshcat", ".position"][1].reshape(-1, 3)
    assert np.allclose(world[:, 0], -record.com[rows, 0], atol=1e-6)
    com = found["/meshcat/com", ".position"][1].reshape(-1, 3)
    assert np.allclose(com[:, [0, 2]], record.com[rows], atol=1e-6)
    foot = found["/meshcat/robot/right_foot_0", ".position"][1].reshape(-1, 3)
    assert np.allclose(foot[:, 0], record.foot[rows, 1, 0], atol=1e-6)
    space = in_space(record, np.zeros(2))
    loaded, toes = space.loaded, space.toes[..., [0, 2]]
    for leg, name in enumerate(("rear_leg", "front_leg")):
        path = f"/meshcat/template/{name}"
        times, shown = found[path, ".visible"]
        held = shown[np.searchsorted(times, frames.clock.astype(np.float32), side="right") - 1]
        assert np.array_equal(held, loaded[rows, leg])
        # Turned and stretched, the leg's (0, 0, 1) lies on the toe.
        x, y, z, w = found[path, ".quaternion"][1].reshape(-1, 4).T
        size = found[path, ".scale"][1].reshape(-1, 3)[:, 2]
        tip = np.stack((2 * (x * z + w * y), 1 - 2 * (x * x + y * y)), axis=1) * size[:, None]
        assert np.allclose(record.template_com[rows] + tip, toes[rows, leg], atol=1e-5)


def test_arrows_follow_the_force_only_where_a_foot_carries(record):
    force = record.contact_force
    length = record.template.rest_length
    arrows = force_arrows(force, carrying(record), record.weight, length)
    idle = force[:, :, 1] <= 0.0
    assert np.all(arrows[idle] == 0.0)
    carries = force[:, :, 1] > 100.0
    cross = arrows[..., 0] * force[..., 1] - arrows[..., 1] * force[..., 0]
    assert np.allclose(cross[carries], 0.0, atol=1e-9)
    weight = 80.0 * 9.81
    usual = carries & (np.linalg.norm(force, axis=2) < 1.9 * weight)
    length = np.linalg.norm(arrows, axis=2)[usual]
    assert np.allclose(length, 0.4 * np.linalg.norm(force, axis=2)[usual] / weight)
    assert np.linalg.norm(arrows, axis=2).max() <= 0.8 + 1e-12


def test_footholds_are_where_feet_stood(record):
    of_feet = enumerate(stood(record, in_space(record, np.zeros(2))))
    found = [(t, i, *x) for i, feet in of_feet for x, t in zip(*feet, strict=True)]
    found.sort()
    assert [foot for _, foot, *_ in found] == [i % 2 for i in range(len(found))]
    assert len(found) in (record.steps + 1, record.steps + 2)
    for time, foot, x, _, height in found:
        row = np.searchsorted(record.time, time)
        assert height == 0.0
        assert record.foot[row, foot, 1] == pytest.approx(0.0, abs=5e-3)
        assert record.foot[row, foot, 0] == pytest.approx(x, abs=0.01)


def test_foothold_plates_appear_when_their_foot_has_landed(record):
    frames = playback(record, fps=30.0)
    objects = {c["path"]: c for c in scene_commands(frames)[:-1]}
    for foot, name in enumerate(("left", "right")):
        (geometry,) = objects[f"/meshcat/footholds/{name}"]["object"]["geometries"]
        attributes = {
            key: np.frombuffer(value["array"].data, np.float32)
            for key, value in geometry["data"]["attributes"].items()
        }
        corners = attributes["position"].reshape(-1, 4, 3)
        places, landed = stood(record, in_space(record, np.array([0.1, -0.1])))[foot]
        assert np.allclose(corners.mean(axis=1)[:, 0], places[:, 0], atol=1e-6)
        assert np.allclose(corners.mean(axis=1)[:, 1], (0.1, -0.1)[foot])  # where its leg is
        frame = attributes["lineDistance"].reshape(-1, 4)[:, 0].astype(int)
        assert np.all(record.time[frames.rows[frame]] >= landed)
        assert np.all(record.time[frames.rows[np.maximum(frame - 1, 0)]] <= landed)


def test_the_spring_runs_from_end_to_end():
    points = spring(0.03)
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1].tolist() == [0.0, 1.0]
    assert np.all(np.diff(points[:, 1]) >= 0.0)
    assert np.abs(points[:, 0]).max() == pytest.approx(0.03)


# Robots of other shapes.


def write_stl(path):
    corners = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]], np.float32)
    text = "solid t\n"
    for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)):
        text += "facet normal 0 0 0\nouter loop\n"
        text += "".join("vertex {} {} {}\n".format(*corners[i]) for i in face)
        text += "endloop\nendfacet\n"
    path.write_text(text + "endsolid t\n")


BOX = '<box size="0.25 0.30 0.65"/></geometry>\n      <material'


def test_a_mesh_is_shown(record, tmp_path):
    path = tmp_path / "trunk.stl"
    write_stl(path)
    meshed = with_urdf(record, BOX, f'<mesh filename="{path}"/></geometry>\n      <material')
    _, shapes = load_shapes(meshed)
    mesh, _ = drawn(shapes.geometryObjects[0].geometry)
    assert mesh.vertices.shape[1] == 3
    assert len(mesh.faces) == 4
    assert tc.save_html(meshed, tmp_path / "mesh.html", end=0.2).is_file()


def shown(record):
    """Names of the shapes, and where each of them is in the middle of the run."""
    model, shapes = load_shapes(record)
    row = len(record.time) // 2
    positions, _ = placements(model, shapes, record.q[[row]])
    names = (shape.name for shape in shapes.geometryObjects)
    return row, dict(zip(names, positions[0], strict=True))


def without_visuals(record):
    text = re.sub(r"<visual.*?</visual>", "", record.urdf, flags=re.DOTALL)
    return replace(record, metadata={**record.metadata, "urdf": text})


@pytest.mark.slow(seconds=1)
def test_a_robot_without_shapes_is_shown_with_sticks(record, tmp_path):
    bare = without_visuals(record)
    row, places = shown(bare)
    assert len(places) == 5
    for foot, leg in enumerate(record.legs):
        ends = [*record.joint[row, leg], record.foot[row, foot] + [0.0, FOOT_RADIUS]]
        for joint, (begin, end) in zip(leg, pairwise(ends), strict=True):
            name = f"stick_{record.joints[joint]}"
            assert np.allclose(places[name][[0, 2]], 0.5 * (begin + end), atol=1e-9)
    pitch, height = record.q[row, 2], record.trunk_com
    middle = record.q[row, :2] + height * np.array([np.sin(pitch), np.cos(pitch)])
    assert np.allclose(places["stick_base_pitch"][[0, 2]], middle, atol=1e-9)
    assert tc.save_html(bare, tmp_path / "bare.html", end=0.2).is_file()
    assert tc.save_film(bare, tmp_path / "bare.gif", end=0.2).is_file()


@pytest.mark.parametrize("content", [None, "", "no mesh", "solid t\nfacet"])
def test_a_mesh_that_is_missing_or_cannot_be_read_leaves_its_link_a_stick(
    record, tmp_path, content
):
    path = tmp_path / "trunk.stl"
    if content is not None:
        path.write_text(content)
    bad = with_urdf(record, BOX, f'<mesh filename="{path}"/></geometry>\n      <material')
    whole, left = shown(record)[1], shown(bad)[1]
    assert whole.keys() - left.keys() == {"trunk_0"}
    assert left.keys() - whole.keys() == {"stick_base_pitch"}
    assert tc.save_html(bad, tmp_path / "mesh.html", end=0.2).is_file()


def test_a_run_without_urdf_is_refused(record, tmp_path):
    old = replace(record, metadata={**record.metadata, "urdf": ""})
    with pytest.raises(tc.errors.RecordError, match="no URDF"):
        tc.save_html(old, tmp_path / "a.html")
