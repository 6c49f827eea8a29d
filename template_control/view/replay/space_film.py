"""The picture of a free robot's film: seen from the right, from behind and from above at once."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from template_control.run.record import Record
from template_control.view.replay.film_picture import (
    LEGS,
    WIDTH,
    empty_picture,
    force_artist,
    keep_layout,
    named,
)
from template_control.view.replay.playback import Playback, coil, spring, template_legs
from template_control.view.replay.replay_space import in_space
from template_control.view.replay.robot_visuals import model_of
from template_control.view.style import COM, TEMPLATE, TRUNK

Array = NDArray[np.float64]

_BELOW = 0.22  # share of the picture's height under the ground beneath the CoM
_AROUND = 3.0  # rest lengths of ground that are drawn beside the path
_ASIDE, _ABOVE = np.radians(-25.0), np.radians(18.0)  # the camera's, from a view from the right

# Rows: to the right and upward in the picture; without perspective, so that lengths compare.
_CAMERA = np.array(
    [
        [np.cos(_ASIDE), np.sin(_ASIDE), 0.0],
        [-np.sin(_ASIDE) * np.sin(_ABOVE), np.cos(_ASIDE) * np.sin(_ABOVE), np.cos(_ABOVE)],
    ]
)


def seen(points: Array) -> Array:
    """(..., 3) of the world to (..., 2) of the picture [m].

    Args:
        points: x, y to the left, z up [m].
    """
    return np.asarray(points @ _CAMERA.T)


class SpaceStage:
    """The picture, whose artists each frame moves.

    Args:
        playback: of a free robot's run.

    Attributes:
        figure: it.
        legs: the lines of the left and the right one, down to the foot.
        body: where joints and trunk are in the frame that is shown.
    """

    def __init__(self, playback: Playback) -> None:
        record = playback.record
        self.playback, self._space = playback, in_space(record, np.zeros(2))
        m = record.metadata
        self.body = _Body(record)
        length = m["template"]["rest_length"]
        _, self._loaded = template_legs(record)
        self._spring = spring(0.03 * length)
        self.figure, axes = empty_picture()
        self._axes, self._half = axes, 0.5 * WIDTH * length
        axes.set(xticks=[], yticks=[])
        axes.set_aspect("equal", adjustable="box")
        axes.add_collection(LineCollection(self._ground(length), colors="0.82", linewidths=0.8))
        self._trail = axes.plot([], [], color=COM, linewidth=1.2)[0]
        self._marks = [axes.plot([], [], "^", color=c, markersize=5)[0] for c in LEGS]
        # The left leg is behind the trunk, the right one before it.
        self.legs = [
            axes.plot([], [], color=c, linewidth=4, solid_capstyle="round", zorder=order)[0]
            for c, order in zip(LEGS, (2, 4), strict=True)
        ]
        self._trunk = Polygon(np.zeros((4, 2)), color=TRUNK, linewidth=3, alpha=0.55, zorder=3)
        axes.add_patch(self._trunk)
        springs = [axes.plot([], [], color=TEMPLATE, linewidth=1.1, zorder=5)[0] for _ in (0, 1)]
        self._springs = springs
        self._com = axes.plot([], [], "o", color=COM, markersize=7, label="CoM", zorder=6)[0]
        self._template = axes.plot(
            [], [], "o", color=TEMPLATE, markersize=3, label="template", zorder=7
        )[0]
        self._forces = force_artist(axes, 8)
        self._title = named(axes, m["robot"])
        self.show(0)
        keep_layout(self.figure)

    def _ground(self, length: float) -> list[Array]:
        """A net of lines on the ground around the path, one every rest length."""
        record = self.playback.record
        place = self._space.com[self.playback.rows, :2] / length
        low, high = np.floor(place.min(axis=0) - _AROUND), np.ceil(place.max(axis=0) + _AROUND)
        (x0, y0), (x1, y1) = (length * low).tolist(), (length * high).tolist()
        along = np.array(record.ground.line(x0, x1))
        lines = [
            seen(np.column_stack((along[:, 0], np.full(len(along), length * y), along[:, 1])))
            for y in np.arange(low[1], high[1] + 0.5)
        ]
        for x in (length * np.arange(low[0], high[0] + 0.5)).tolist():
            height = record.ground.height_at(x)
            lines.append(seen(np.array([[x, y0, height], [x, y1, height]])))
        return lines

    def show(self, frame: int) -> None:
        """Draw a frame.

        Args:
            frame: its number.
        """
        record, space, rows = self.playback.record, self._space, self.playback.rows
        row = rows[frame]
        com, feet = space.com[row], space.foot[row]
        self.body.place(record.q[row])
        self._trunk.set_xy(seen(self.body.trunk()))
        for foot, leg in enumerate(self.legs):
            leg.set_data(*seen(np.vstack((self.body.leg(foot), feet[foot]))).T)
            places, since = space.stood[foot]
            self._marks[foot].set_data(*seen(places[since <= record.time[row]]).T)
        template = seen(space.template[row])
        for end, line in enumerate(self._springs):
            pushes = self._loaded[row, end]
            ends = (template, seen(space.toes[row, end]))
            line.set_data(*(coil(self._spring, *ends) if pushes else ([], [])))
        self._trail.set_data(*seen(space.com[rows[: frame + 1]]).T)
        self._com.set_data(*seen(com)[:, None])
        self._template.set_data(*template[:, None])
        self._forces.set_offsets(seen(feet))
        self._forces.set_UVC(*seen(space.arrow[row]).T)
        beneath = record.ground.height_at(float(com[0]))
        x, y = seen(np.array([com[0], com[1], beneath])).tolist()
        high = 2.0 * self._half * 0.75
        self._axes.set_xlim(x - self._half, x + self._half)
        self._axes.set_ylim(y - _BELOW * high, y + (1.0 - _BELOW) * high)
        self._title.set_text(f"{record.time[row]:.2f} s")


class _Body:
    """Where joints and trunk are in a configuration, by Pinocchio."""

    def __init__(self, record: Record) -> None:
        m = record.metadata
        self._model = model_of(record)
        self._data = self._model.createData()
        names = [[m["joints"][i] for i in leg] for leg in m["legs"]]
        self._joints = [[self._model.getJointId(name) for name in leg] for leg in names]
        self._trunk = self._model.parents[self._joints[0][0]]
        self._top = np.array([0.0, 0.0, 2.0 * m["trunk_com"]])

    def place(self, q: Array) -> None:
        pin.forwardKinematics(self._model, self._data, q)

    def leg(self, foot: int) -> Array:
        """(joints, 3) from the trunk on [m]."""
        return np.array([self._data.oMi[joint].translation for joint in self._joints[foot]])

    def trunk(self) -> Array:
        """(4, 3) corners between the hips and twice the height of its centre of mass [m]."""
        left, right = (self.leg(foot)[0] for foot in (0, 1))
        up = self._data.oMi[self._trunk].rotation @ self._top
        return np.array([left, right, right + up, left + up])
