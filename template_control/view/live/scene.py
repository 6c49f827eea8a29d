"""3-D scene of a run that goes on, in viser's nodes.

All that moves is moved by the place and the turn of its node: viser's page applies these at once,
and other properties, such as a line's points, a frame later. The camera stands still, and the world
moves backward past it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, cos, sin
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.colors import to_rgb

from template_control.arrays import Array, IntArray
from template_control.plant.terrain import Terrain
from template_control.run.record import FloatingRecord, Record
from template_control.view.replay.playback import spring
from template_control.view.replay.robot_visuals import foot_sides, load_shapes, triangles
from template_control.view.replay.scene import (
    in_space,
    plates,
    raised,
    smoothed,
    strip,
    stripes,
    turned_to,
)
from template_control.view.style import COM, TEMPLATE, feet_shown

_GROUND, _LINES, _PUSH = "#dde1e6", "#b4bac2", "#c22f3d"
_SEEN = 12.0  # of l0: the ground to all sides of the robot
_RENEWED = 6.0  # of l0: so far the robot goes on a ground before it gets another one
_SHADE = 0.85  # of a shape's colour: white ones are to be seen on white
_TRUNK = 0.42  # opacity: the CoM and the template are in the trunk, and to be seen
_VISIBLE = 2e-4  # of a place [m] or a quaternion: less than a pixel of the page
_TRAIL, _TRAILED = 60, 2  # points of the CoM's trail, and frames between them
_FOOTHOLDS = 6  # of each foot
# From afar with a narrow view: little perspective, so that lengths can be compared.
_PLANAR_EYE, _FLOATING_EYE, _VIEW = (1.6, -9.0, 1.0), (4.5, -7.5, 2.6), 0.24
_MIDDLE = 0.62  # of l0: height of the middle of the picture, at the least
_SHOWN = 0.53  # of the robot's height: size of a picture that has 0.07 of it to spare


@dataclass(frozen=True)
class _Span:
    """A node of what is one metre long, straight up; ``grows`` says whether its width does too."""

    node: Any
    grows: bool

    def reach(self, begin: Array, span: Array, visible: bool) -> None:
        """Let it reach along ``span`` (3,) from ``begin`` (3,) [m]."""
        self.node.visible = visible
        if visible:
            size = float(np.linalg.norm(span))
            self.node.position = begin
            self.node.wxyz = turned_to(span[None])[0][[3, 0, 1, 2]]
            self.node.scale = size if self.grows else (1.0, 1.0, size)


class _Joint:
    """A joint's node, to whose place relative to its parent's only visible changes are sent."""

    def __init__(self, node: Any) -> None:
        self.node, self._shown = node, np.zeros(7)

    def put(self, place: pin.SE3) -> None:
        """Let the node be at a place."""
        pose = pin.SE3ToXYZQUAT(place)
        moved = abs(pose - self._shown) > _VISIBLE
        if moved[:3].any():
            self.node.position = self._shown[:3] = pose[:3]
        if moved[3:].any():
            self._shown[3:] = pose[3:]
            self.node.wxyz = pose[[6, 3, 4, 5]]


class LiveScene:
    """Scene of a robot, its template, and the ground, in viser's, of which all else is removed.

    ``sides`` (n,) is how far to the left a planar robot's feet are drawn [m].
    """

    def __init__(self, scene: Any, record: Record, ground: Terrain) -> None:
        scene.reset()
        scene.set_up_direction("+z")
        scene.configure_default_lights(cast_shadow=False)
        model, shapes = load_shapes(record)
        self._sides = foot_sides(model, record.feet)
        self._scene, self._terrain, self._record = scene, ground, record
        self._model, self._data = model, model.createData()
        self._length = length = float(record.template.rest_length)
        self._floating = isinstance(record, FloatingRecord)
        top = _top(model, shapes, record.q[0]) - float(ground.height_at(record.com[0, 0]))
        self._middle = max(_MIDDLE * length, 0.5 * top)
        self._size = max(length + _spread(record), _SHOWN * top)
        self._world = scene.add_frame("/world", show_axes=False)
        self._place: tuple[float, float] | None = None  # middle of the ground that is drawn
        hip = model.getJointId(record.joints[record.legs[0][0]])
        self.joints = self._add_robot(shapes, trunk=model.parents[hip])
        self._com = self._ball("com", 0.025, COM)
        self._template = self._ball("template", 0.016, TEMPLATE)
        self._legs = [self._add_leg(name) for name in ("rear_leg", "front_leg")]
        colors = [color for _, color in feet_shown(record)]
        self._forces = [self._add_arrow(f"force_{i}", color) for i, color in enumerate(colors)]
        self._push = self._add_arrow("push", _PUSH)
        self._holds = [self._add_holds(i, color) for i, color in enumerate(colors)]
        self._stood = np.zeros(len(colors), dtype=bool)
        self._path: deque[Array] = deque(maxlen=_TRAIL)
        self._trail = scene.add_line_segments(
            "/world/trail", np.zeros((1, 2, 3)), _rgb(COM), thickness=0.008 * length
        )
        self._frames = 0
        self.clear()

    def look(self, camera: Any) -> None:
        """Put a camera where the robot is seen from the side; from ahead too if it may turn."""
        eye = _FLOATING_EYE if self._floating else _PLANAR_EYE
        camera.position = tuple(self._size * x for x in eye)
        camera.look_at, camera.fov = (0.0, 0.0, 0.0), _VIEW

    def _add_robot(self, shapes: pin.GeometryModel, trunk: int) -> list[_Joint]:
        """Nodes of the robot's joints, each below that of its parent, and their shapes."""
        model, scene = self._model, self._scene
        paths = ["/world/robot"]
        for joint in range(1, model.njoints):
            paths.append(f"{paths[model.parents[joint]]}/{joint}")
        nodes = [_Joint(scene.add_frame(path, show_axes=False)) for path in paths[1:]]
        for shape in shapes.geometryObjects:
            joint = shape.parentJoint
            place = pin.SE3ToXYZQUAT(shape.placement)
            *color, opacity = shape.meshColor.tolist()
            look = {
                "color": tuple(round(255 * _SHADE * part) for part in color),
                # With an opacity, be it 1, the page sorts shapes by their centres only.
                "opacity": _TRUNK if joint == trunk else None if opacity >= 1.0 else opacity,
                "flat_shading": True,
                "position": place[:3],
                "wxyz": place[[6, 3, 4, 5]],
                "cast_shadow": False,
            }
            self._add_shape(f"{paths[joint]}/{shape.name}", shape.geometry, look)
        return nodes

    def _add_shape(self, path: str, shape: Any, look: dict[str, Any]) -> None:
        scene, kind = self._scene, type(shape).__name__
        if kind == "Box":
            scene.add_box(path, dimensions=tuple(2.0 * shape.halfSide), **look)
        elif kind == "Sphere":
            scene.add_icosphere(path, float(shape.radius), **look)
        elif kind == "Cylinder":
            height = float(2.0 * shape.halfLength)
            scene.add_cylinder(path, float(shape.radius), height, radial_segments=20, **look)
        else:
            scene.add_mesh_simple(path, *triangles(shape), side="double", **look)

    def _ball(self, name: str, radius: float, color: str) -> Any:
        size = radius * self._length
        return self._scene.add_icosphere(f"/world/{name}", size, _rgb(color), cast_shadow=False)

    def _add_leg(self, name: str) -> _Span:
        line = raised(spring(0.03 * self._length))
        pairs = np.stack((line[:-1], line[1:]), axis=1)
        node = self._scene.add_line_segments(
            f"/world/{name}", pairs, _rgb(TEMPLATE), thickness=0.008 * self._length
        )
        return _Span(node, grows=False)

    def _mesh(self, name: str, surface: tuple[Array, IntArray], color: str) -> Any:
        """A node of vertices and faces."""
        return self._scene.add_mesh_simple(
            f"/world/{name}", *surface, color=_rgb(color), side="double", cast_shadow=False
        )

    def _add_arrow(self, name: str, color: str) -> _Span:
        node = self._mesh(name, _arrow(), color)
        node.visible = False
        return _Span(node, grows=True)

    def _add_holds(self, foot: int, color: str) -> deque[Any]:
        """Marks of the last footholds of a foot, the oldest first."""
        plate = plates(np.zeros((1, 3)), (0.05 * self._length, 0.1 * self._length))
        names = (f"foothold_{foot}_{i}" for i in range(_FOOTHOLDS))
        return deque(self._mesh(name, plate, color) for name in names)

    def draw(self, columns: Mapping[str, Any], push: tuple[float, float] = (0.0, 0.0)) -> None:
        """Show the last of some ticks, with a push forward and to the left [N].

        Only changes are sent.
        """
        last = {name: values[-1:] for name, values in columns.items()}
        places = in_space(self._record, self._sides, last)
        frame = places.at(0)
        x, y, _ = frame.com.tolist()
        level = float(smoothed(self._terrain, np.array([x]), self._length)[0])
        self._world.position = (-x, -y, -level - self._middle)
        self._renew_ground(x, y)
        pin.forwardKinematics(self._model, self._data, last["q"][0])
        for joint, node in enumerate(self.joints, start=1):
            node.put(self._data.liMi[joint])
        self._com.position, self._template.position = frame.com, frame.template
        for leg, toe, loaded in zip(self._legs, frame.toes, frame.loaded.tolist(), strict=True):
            leg.reach(frame.template, toe - frame.template, loaded)
        feet = zip(self._forces, frame.foot, frame.arrow, frame.stands.tolist(), strict=True)
        for arrow, foot, force, stands in feet:
            arrow.reach(foot, force, stands)
        self._draw_push(frame.com, float(last["heading"][0]), push)
        for foot in np.flatnonzero(frame.stands & ~self._stood).tolist():
            marks, place = self._holds[foot], frame.foot[foot]
            marks.rotate(-1)  # its oldest mark goes where it has come down
            height = self._terrain.height_at(float(place[0])) + 0.002 * self._length
            marks[-1].position = (float(place[0]), float(place[1]), height)
            marks[-1].visible = True
        self._stood = frame.stands
        self._frames += 1
        if self._frames % _TRAILED == 0:
            self._path.append(frame.com)
            if len(self._path) > 1:
                line = np.array(self._path)
                self._trail.points = np.stack((line[:-1], line[1:]), axis=1)

    def clear(self) -> None:
        """Forget where the robot has been."""
        self._path.clear()
        for marks in self._holds:
            for mark in marks:
                mark.visible = False
        self._stood[:] = False

    def _draw_push(self, com: Array, heading: float, push: tuple[float, float]) -> None:
        size = float(np.hypot(*push))
        turn = heading + atan2(push[1], push[0])
        span = 0.5 * self._length * np.array([cos(turn), sin(turn), 0.0])
        self._push.reach(com - span, span, size > 0.0)

    def _renew_ground(self, x: float, y: float) -> None:
        """Draw the ground around a place [m], where the one that is drawn is too far away."""
        length, place = self._length, self._place
        if place and np.hypot(x - place[0], y - place[1]) < _RENEWED * length:
            return
        self._place = x, y
        line = np.array(self._terrain.line(x - _SEEN * length, x + _SEEN * length))
        wide = _SEEN * length if self._floating else 1.5 * length
        self._mesh("ground", strip(line, (y - wide, y + wide)), _GROUND)
        lines = stripes(self._terrain, (line[0, 0], line[-1, 0]), (y, 2.0 * wide), length)
        self._mesh("stripes", lines, _LINES)


def _spread(record: Record) -> float:
    """Largest distance of a contact from the middle of its template leg's [m]."""
    foot = record.foot[0]
    groups = (foot[list(group)] for group in record.groups if group)
    return float(max(np.abs(places - places.mean(axis=0)).max() for places in groups))


def _top(model: pin.Model, shapes: pin.GeometryModel, q: Array) -> float:
    """Height of a robot's highest shape, taken for the ball around its box [m]."""
    data, places = model.createData(), shapes.createData()
    pin.updateGeometryPlacements(model, data, shapes, places, q)
    balls = [shape.geometry for shape in shapes.geometryObjects]
    for ball in balls:
        ball.computeLocalAABB()
    tops = zip(balls, places.oMg, strict=True)
    return float(max(place.act(b.aabb_center)[2] + b.aabb_radius for b, place in tops))


def _rgb(color: str) -> tuple[int, int, int]:
    red, green, blue = (round(255 * part) for part in to_rgb(color))
    return red, green, blue


def _arrow() -> tuple[Array, IntArray]:
    """Vertices and faces of an arrow one metre long, straight up."""
    sides = 10
    turn = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = np.stack((np.cos(turn), np.sin(turn), 0.0 * turn), axis=1)
    shaft, head = 0.06 * ring, 0.15 * ring
    up = np.array([0.0, 0.0, 1.0])
    vertices = np.concatenate((shaft, shaft + 0.7 * up, head + 0.7 * up, up[None]))
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    tip = np.full(sides, 3 * sides)
    faces = [(i, j, i + sides), (j, j + sides, i + sides), (i + 2 * sides, j + 2 * sides, tip)]
    return vertices, np.concatenate([np.stack(corners, axis=1) for corners in faces])
