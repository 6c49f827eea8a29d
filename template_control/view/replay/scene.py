"""3-D scene of a replay as meshcat's commands: objects first, then their animation.

Forward is meshcat's x, to the left its y and up its z; a floating-base robot's are the world's.
The camera stands to the right; the world moves backward past it, because meshcat's camera always
looks at its origin.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import umsgpack
from meshcat import geometry as mg

from template_control.arrays import Array, BoolArray, IntArray
from template_control.plant.terrain import Terrain
from template_control.run.record import Record
from template_control.view.replay.playback import (
    CARRYING,
    Playback,
    force_arrows,
    spring,
    stances,
)
from template_control.view.replay.robot_visuals import drawn, foot_sides, load_shapes, placements
from template_control.view.style import COM, TEMPLATE, feet_shown

_AROUND = 11  # places that a height is the mean of
Surface = tuple[Array, IntArray]  # vertices (N, 3) [m] and faces (M, 3)


def plates(centres: Array, size: tuple[float, float]) -> Surface:
    """Level rectangles of a size about centres (N, 3) [m]: vertices (4 N, 3), faces (2 N, 3)."""
    corners = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*size, 0.0]
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(centres))[:, None, None]
    return (centres[:, None] + corners).reshape(-1, 3), faces.reshape(-1, 3)


def ground_shape(line: Array, sides: tuple[float, float], length: float) -> tuple[Any, Array]:
    """The ground under a line (N, 2), a board where it is level, and its (4, 4) placement.

    ``sides`` are y of its right and its left edge [m], ``length`` is the template's rest length
    [m].
    """
    place = np.eye(4)
    (low, level), (high, _), (right, left) = line[0], line[-1], sides
    if np.all(line[:, 1] == level):
        thick = 0.02 * length
        place[:3, 3] = 0.5 * (low + high), 0.5 * (right + left), level - 0.5 * thick
        return mg.Box([high - low, left - right, thick]), place
    return mg.TriangularMeshGeometry(*strip(line, sides)), place


def strip(line: Array, sides: tuple[float, float]) -> Surface:
    """A surface across a line; see :func:`ground_shape`: (2 N, 3) vertices, (2 N - 2, 3) faces."""
    count, first = len(line), np.arange(len(line) - 1)
    edges = [np.insert(line, 1, y, axis=1) for y in sides]
    near = np.column_stack((first, first + 1, first + count))
    far = np.column_stack((first + 1, first + count + 1, first + count))
    return np.concatenate(edges), np.concatenate((near, far))


def stripes(
    ground: Terrain, ends: tuple[float, float], side: tuple[float, float], length: float
) -> Surface:
    """A line across the ground every rest ``length``, which shows that the camera travels.

    ``ends`` are along x, ``side`` is the middle along y and the lines' length [m].
    """
    x = np.arange(np.ceil(ends[0] / length), ends[1] / length) * length
    heights = np.array([ground.height_at(place) for place in x.tolist()])
    centres = np.stack((x, side[0] + 0.0 * x, heights + 0.001 * length), axis=-1)
    return plates(centres, (0.012 * length, side[1]))


def smoothed(ground: Terrain, x: Array, length: float) -> Array:
    """Mean height of the ground over ``length`` [m] around places x (N,), for a camera."""
    around = np.linspace(-0.5, 0.5, _AROUND) * length
    return np.array([np.mean([ground.height_at(p) for p in place + around]) for place in x])


_LANDED = 0.015  # [s] after its touchdown a foot rests


class Space(NamedTuple):
    """Places of CoM, legs and feet; x forward or as the world's, y to the left, z up [m].

    ``com`` (T, 3) of the robot and of the ``template``; ``toes`` (T, 2, 3) of its rear and front
    leg, and whether these are ``loaded`` (T, 2). Of each contact ``foot`` (T, n, 3), whether it
    ``stands`` (T, n), and the ground's force on it as an ``arrow`` (T, n, 3).
    """

    com: Array
    template: Array
    toes: Array
    loaded: BoolArray
    foot: Array
    stands: BoolArray
    arrow: Array

    def at(self, samples: Any) -> Space:
        """The same in some samples, or in one."""
        return Space._make(values[samples] for values in self)


def in_space(record: Record, sides: Array, columns: Mapping[str, Any] | None = None) -> Space:
    """A run in three directions, or some ticks of it; planar feet are ``sides`` (n,) to the left.

    ``columns`` are the fields of these ticks, by name.
    """
    of = vars(record) if columns is None else columns
    if "space_com" in of:
        away, heading = of["template_com"] - of["com"], of["heading"]
        ahead = np.stack((np.cos(heading), np.sin(heading)), axis=1)
        com, foot, force = of["space_com"], of["space_foot"], of["space_force"]
        template, toes = com + np.column_stack((away[:, :1] * ahead, away[:, 1])), foot
    else:
        names = "com", "template_com", "foot", "contact_force"
        com, template, toes, force = (raised(of[name]) for name in names)
        foot = toes + sides[:, None] * np.array([0.0, 1.0, 0.0])
    samples, of_legs = np.arange(len(com)), record.of_legs(toes)
    rear = np.asarray(of["rear"], dtype=np.intp)
    legs = np.stack([of_legs[samples, leg] for leg in (rear, 1 - rear)], axis=1)
    weight, length = record.weight, float(record.template.rest_length)
    stands = of["contact_force"][:, :, 1] > CARRYING * weight
    loaded = np.linalg.norm(of["template_force"], axis=2) > CARRYING * weight
    arrow = force_arrows(force, stands, weight, length)
    return Space(com, template, legs, loaded, foot, stands, arrow)


def stood(record: Record, space: Space) -> list[tuple[Array, Array]]:
    """For each foot (n, 3) where it stood in a run, and (n,) since when [s]."""
    found = []
    for foot, spans in enumerate(stances(record)):
        since = record.time[[first for first, _ in spans]]
        rows = np.searchsorted(record.time, since + _LANDED)
        places = space.foot[np.minimum(rows, len(record.time) - 1), foot]
        places[:, 2] = [record.ground.height_at(x) for x in places[:, 0].tolist()]
        found.append((places, since))
    return found


def raised(places: Array) -> Array:
    """(..., 3) places with y = 0 from (..., 2) x and height [m]."""
    return np.stack((places[..., 0], np.zeros(places.shape[:-1]), places[..., 1]), axis=-1)


def turned_to(direction: Array) -> Array:
    """(F, 4) quaternions x, y, z, w from the vertical to directions (F, 3); of zero none turns."""
    x, y, z = direction.T
    size = np.linalg.norm(direction, axis=1)
    zero = np.zeros(len(size))
    # Upward the smallest turn; downward a half turn about y and the smallest after it, so that a
    # leg that passes the vertical does not spin.
    up = np.stack((-y, x, zero, size + z), axis=1)
    down = np.stack((zero, size - z, y, x), axis=1)
    found = np.where((z < 0.0)[:, None], down, up)
    found[size == 0.0] = 0.0, 0.0, 0.0, 1.0
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


_FLOAT32 = 0x17  # the viewer's MessagePack extension for a Float32Array
_FOREVER = 1_000_000
_TYPES = {
    "position": "vector3",
    "quaternion": "quaternion",
    "scale": "vector3",
    "visible": "bool",
    "material.dashSize": "number",
}
"""Of the properties that are animated."""


class _Dashed(mg.GenericMaterial):
    _type = "LineDashedMaterial"


def _packed(numbers: Array) -> umsgpack.Ext:
    """Numbers for the viewer, a tenth of meshcat's own in size."""
    return umsgpack.Ext(_FLOAT32, np.asarray(numbers, np.float32).tobytes())


class _Scene:
    """Collects commands, and tracks of keyframes by path; all last as long as the clock.

    ``space`` is of the frames.
    """

    def __init__(self, playback: Playback, space: Space) -> None:
        self.record, self.rows, self.clock = playback.record, playback.rows, playback.clock
        self.space, self.length = space, float(self.record.template.rest_length)
        self._commands: list[dict[str, Any]] = []
        self._tracks: dict[str, list[dict[str, Any]]] = {}

    def _command(self, kind: str, path: str, **what: Any) -> None:
        self._commands.append({"type": kind, "path": path, **what})

    def add(self, path: str, geometry: mg.Geometry, material: mg.Material) -> dict[str, Any]:
        lowered: dict[str, Any] = mg.Mesh(geometry, material).lower()
        self._command("set_object", path, object=lowered)
        return lowered

    def place(self, path: str, matrix: Array) -> None:
        self._command("set_transform", path, matrix=matrix.T.ravel().tolist())

    def set(self, path: str, name: str, value: Any) -> None:
        self._command("set_property", path, property=name, value=value)

    def animate(self, path: str, **values: Array) -> None:
        """Values of a path's properties by frame."""
        for name, of in values.items():
            self._track(path, name, self.clock, _packed(of))

    def show(self, path: str, visible: BoolArray) -> None:
        """Keys only where it changes, and at both ends: a switch is not interpolated."""
        keys = np.flatnonzero(np.diff(visible, prepend=~visible[:1]))
        keys = np.unique(np.append(keys, len(visible) - 1))
        self._track(path, "visible", self.clock[keys], visible[keys].tolist())

    def _track(self, path: str, name: str, times: Array, values: Any) -> None:
        track = {"name": f".{name}", "type": _TYPES[name], "times": _packed(times)}
        self._tracks.setdefault(path, []).append({**track, "values": values})

    def stretch(self, path: str, begin: Array, span: Array, visible: BoolArray) -> None:
        """Let what stands from 0 to 1 on the vertical reach along ``span`` from ``begin``."""
        size = np.insert(np.ones((len(span), 2)), 2, np.linalg.norm(span, axis=1), axis=1)
        self.animate(path, position=begin, quaternion=turned_to(span), scale=size)
        self.show(path, visible)

    def reveal(
        self, path: str, surface: Surface, frame: Array | IntArray, color: str, **look: Any
    ) -> None:
        """Let vertices appear, each in its ``frame``: a dashed material draws up to its dash."""
        frames = np.arange(float(len(self.clock)))
        dash = {"dashSize": 0.0, "gapSize": 10.0 * len(frames), "transparent": True}
        mesh = mg.TriangularMeshGeometry(*surface)
        shown = self.add(path, mesh, _Dashed(_rgb(color), **dash, **look))
        distance = mg.pack_numpy_array(frame.astype(np.float32))
        shown["geometries"][0]["data"]["attributes"]["lineDistance"] = distance
        self.animate(f"{path}/<object>", **{"material.dashSize": frames})

    def finished(self) -> list[dict[str, Any]]:
        """All commands; the tracks are of one clip a path, with a frame a second."""
        clips = [
            {"path": path, "clip": {"fps": 1, "name": "default", "tracks": tracks}}
            for path, tracks in self._tracks.items()
        ]
        options = {"play": True, "repetitions": _FOREVER}
        return [*self._commands, {"type": "set_animation", "animations": clips, "options": options}]


def scene_commands(playback: Playback) -> list[dict[str, Any]]:
    """Commands that build and animate the scene, as meshcat's viewer takes them."""
    record = playback.record
    model, shapes = load_shapes(record)
    space = in_space(record, foot_sides(model, record.feet))
    scene = _Scene(playback, space.at(playback.rows))
    _surroundings(scene)
    _robot(scene, model, shapes)
    _trail(scene)
    _template(scene)
    _forces(scene)
    _footholds(scene, stood(record, space))
    return scene.finished()


def _rgb(color: str) -> int:
    return int(color.removeprefix("#"), 16)


def _overlay(color: str) -> mg.Material:
    """A flat colour in front of the robot, whose trunk would hide it otherwise."""
    return mg.MeshBasicMaterial(color=_rgb(color), transparent=True, depthTest=False)


def _ribbon(points: Array, width: float) -> Surface:
    """Two crossed strips along (N, 3) points; four blocks of N vertices."""
    steps = np.diff(points, axis=0, append=points[-1:])
    steps[-1] = points[-1] - points[-2]
    in_plane = np.stack((-steps[:, 2], 0.0 * steps[:, 1], steps[:, 0]), axis=-1)
    in_plane /= np.maximum(np.linalg.norm(in_plane, axis=1, keepdims=True), 1e-12)
    across = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
    sides = (0.5 * width * side for side in (in_plane, -in_plane, across, -across))
    vertices, count = np.concatenate([points + side for side in sides]), len(points)
    a = np.arange(count - 1)[:, None] + np.array([0, 2 * count])  # each step of both strips
    faces = np.stack((a, a + count, a + 1, a + count, a + count + 1, a + 1), axis=-1)
    return vertices, faces.reshape(-1, 3)


def _surroundings(scene: _Scene) -> None:
    ground, length = scene.record.ground, scene.length
    for end in ("top_color", "bottom_color"):
        scene.set("/Background", end, [0.96, 0.97, 0.98])
    for path in ("/Grid", "/Axes"):
        scene.set(path, "visible", False)
    x, y = scene.space.com[:, :2].T
    sides = float(y.min()) - 1.5 * length, float(y.max()) + 1.5 * length
    ends = float(x.min()) - 6.0 * length, float(x.max()) + 6.0 * length
    shape, place = ground_shape(np.array(ground.line(*ends)), sides, length)
    scene.add("/meshcat/ground", shape, mg.MeshBasicMaterial(color=0xDDE1E6, side="DoubleSide"))
    scene.place("/meshcat/ground", place)
    lines = stripes(ground, ends, (0.5 * (sides[0] + sides[1]), sides[1] - sides[0]), length)
    material = mg.MeshBasicMaterial(color=0xB4BAC2)
    scene.add("/meshcat/ground_lines", mg.TriangularMeshGeometry(*lines), material)
    travel = np.stack((x, y, smoothed(ground, x, length) + 0.72 * length), axis=-1)
    scene.animate("/meshcat", position=-travel)
    # From afar with a narrow view: little perspective, so that lengths can be compared.
    eye = [0.7 * length, 0.45 * length, 4.0 * length]
    scene.set("/Cameras/default/rotated/<object>", "position", eye)
    scene.set("/Cameras/default/rotated/<object>", "zoom", 2.4)


def _robot(scene: _Scene, model: pin.Model, shapes: pin.GeometryModel) -> None:
    positions, quaternions = placements(model, shapes, scene.record.q[scene.rows])
    for i, shape in enumerate(shapes.geometryObjects):
        path = f"/meshcat/robot/{shape.name}"
        geometry, place = drawn(shape.geometry)
        *rgb, opacity = shape.meshColor.tolist()
        color = sum(round(255 * part) << bits for part, bits in zip(rgb, (16, 8, 0), strict=True))
        material = mg.MeshPhongMaterial(color=color, opacity=opacity, flatShading=True)
        scene.add(f"{path}/shape", geometry, material)
        scene.place(f"{path}/shape", place)
        scene.animate(path, position=positions[:, i], quaternion=quaternions[:, i])


def _trail(scene: _Scene) -> None:
    com, length = scene.space.com, scene.length
    ribbon, frame = _ribbon(com, 0.008 * length), np.tile(np.arange(len(com)), 4)
    scene.reveal("/meshcat/com_trail", ribbon, frame, COM, depthTest=False)
    scene.add("/meshcat/com", mg.Sphere(0.025 * length), _overlay(COM))
    scene.animate("/meshcat/com", position=com)


def _template(scene: _Scene) -> None:
    space, length = scene.space, scene.length
    scene.add("/meshcat/template/com/dot", mg.Sphere(0.014 * length), _overlay(TEMPLATE))
    # Nearer to the camera than the robot's CoM, or it would be drawn below that.
    nearer = np.eye(4)
    nearer[1, 3] = -0.03 * length
    scene.place("/meshcat/template/com/dot", nearer)
    scene.animate("/meshcat/template/com", position=space.template)
    coil = mg.TriangularMeshGeometry(*_ribbon(raised(spring(0.03 * length)), 0.01 * length))
    for leg, name in enumerate(("rear_leg", "front_leg")):
        path = f"/meshcat/template/{name}"
        scene.add(path, coil, _overlay(TEMPLATE))
        span = space.toes[:, leg] - space.template
        scene.stretch(path, space.template, span, space.loaded[:, leg])


def _forces(scene: _Scene) -> None:
    space, radius = scene.space, 0.013 * scene.length
    cone = mg.Cylinder(0.15, radiusTop=0.0, radiusBottom=3.0 * radius)
    parts = ("shaft", mg.Cylinder(0.85, radius), 0.425), ("head", cone, 0.925)
    for foot, (name, color) in enumerate(feet_shown(scene.record)):
        path = f"/meshcat/ground_force/{name.removesuffix(' foot')}"
        for part, geometry, height in parts:
            upright = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, height], [0, 0, 0, 1]])
            scene.add(f"{path}/{part}", geometry, _overlay(color))
            scene.place(f"{path}/{part}", upright)
        scene.stretch(path, space.foot[:, foot], space.arrow[:, foot], space.stands[:, foot])


def _footholds(scene: _Scene, feet: list[tuple[Array, Array]]) -> None:
    length, times = scene.length, scene.record.time[scene.rows]
    for (name, color), (places, since) in zip(feet_shown(scene.record), feet, strict=True):
        shown = since <= times[-1]
        if not shown.any():
            continue
        centres = places[shown] + np.array([0.0, 0.0, 0.002 * length])
        marks = plates(centres, (0.05 * length, 0.1 * length))
        frame = np.repeat(np.searchsorted(times, since[shown]), 4)
        scene.reveal(f"/meshcat/footholds/{name.removesuffix(' foot')}", marks, frame, color)
