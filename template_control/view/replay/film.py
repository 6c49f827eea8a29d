"""Films of a run, drawn without browser or display: side view, or in space."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.quiver import Quiver
from matplotlib.text import Text
from numpy.typing import NDArray

from template_control.errors import RecordError
from template_control.run.record import FloatingRecord, Record
from template_control.storage import atomic_path
from template_control.view.replay.playback import (
    Playback,
    carrying,
    coil,
    footholds,
    force_arrows,
    spring,
    template_legs,
)
from template_control.view.replay.robot_visuals import model_of
from template_control.view.replay.scene import in_space
from template_control.view.style import COM, LEFT, RIGHT, TEMPLATE, TRUNK, as_text

Array = NDArray[np.float64]

LEGS = (LEFT, RIGHT)
"""Colours of the legs."""

WIDTH = 2.6
"""Of the picture, in rest lengths."""


def empty_picture() -> tuple[Figure, Axes]:
    """A figure that is drawn without a display, and its axes."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Axes = figure.subplots()
    return figure, axes


def force_artist(axes: Axes, zorder: int) -> Quiver:
    """The arrows of the ground's forces on both feet.

    Args:
        axes: to draw in.
        zorder: what is drawn before and behind them.
    """
    return axes.quiver(
        [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], color=LEGS, angles="xy",
        scale_units="xy", scale=1.0, width=0.007, zorder=zorder,
    )  # fmt: skip


def named(axes: Axes, robot: str) -> Text:
    """Draw the legend and the robot's name; the title that tells the time comes back.

    Args:
        axes: with all that the legend names.
        robot: its name.
    """
    for color, name in zip(LEGS, ("left", "right"), strict=True):
        axes.plot([], [], color=color, linewidth=4, label=f"{name} leg, its ground force")
    axes.legend(loc="upper left", fontsize=7, frameon=False)
    time = axes.set_title(" ", fontsize=9, loc="right")
    axes.set_title(as_text(robot), fontsize=9, loc="left")
    return time


def keep_layout(figure: Figure) -> None:
    """Once: a layout that follows the tick labels would make the picture tremble.

    Args:
        figure: with its first frame.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")


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
        self.body = _Body(record)
        length = record.template.rest_length
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
        self._title = named(axes, record.robot_name)
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
        self._model = model_of(record)
        self._data = self._model.createData()
        names = [[record.joints[i] for i in leg] for leg in record.legs]
        self._joints = [[self._model.getJointId(name) for name in leg] for leg in names]
        self._trunk = self._model.parents[self._joints[0][0]]
        self._top = np.array([0.0, 0.0, 2.0 * record.trunk_com])

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


_MOST_GIF_FRAMES = 1000  # a GIF is held in memory until its last frame


class _Stage:
    """The picture, whose artists each frame moves."""

    def __init__(self, playback: Playback) -> None:
        record, rows = playback.record, playback.rows
        self.playback = playback
        length = record.template.rest_length
        self.top = 2.0 * record.trunk_com
        self.toes, self.loaded = template_legs(record)
        self.arrows, self.on = force_arrows(record), carrying(record)
        self.spring = spring(0.03 * length)
        self.figure, axes = empty_picture()
        self.axes, self.half = axes, 0.5 * WIDTH * length
        axes.set_aspect("equal")
        self.ground = record.ground
        ends = record.com[rows, 0].min() - self.half, record.com[rows, 0].max() + self.half
        line = np.transpose(self.ground.line(*map(float, ends)))
        over = record.q[rows, 1] - [self.ground.height_at(x) for x in record.q[rows, 0].tolist()]
        low, high = line[1].min() - 0.12 * length, 1.06 * (float(np.max(over)) + self.top)
        axes.set(xlabel="x [m]", ylabel="y [m]", ylim=(low, line[1].max() + high))
        axes.fill_between(line[0], line[1], low - length, color="0.9", linewidth=0)
        axes.plot(*line, color="0.3", linewidth=0.8)
        stood = footholds(record)
        self.foothold_time = [np.array([f.time for f in stood if f.foot == i]) for i in (0, 1)]
        self.foothold_x = [np.array([f.x for f in stood if f.foot == i]) for i in (0, 1)]
        self.marks = [axes.plot([], [], "^", color=c, markersize=5)[0] for c in LEGS]
        self.trunk = axes.plot([], [], color=TRUNK, linewidth=7, solid_capstyle="round")[0]
        self.legs = [
            axes.plot([], [], color=c, linewidth=4, solid_capstyle="round", alpha=0.85)[0]
            for c in LEGS
        ]
        self.trail = axes.plot([], [], color=COM, linewidth=1.2)[0]
        self.com = axes.plot([], [], "o", color=COM, markersize=7, label="CoM")[0]
        self.springs = [axes.plot([], [], color=TEMPLATE, linewidth=1.1)[0] for _ in (0, 1)]
        self.template = axes.plot([], [], "o", color=TEMPLATE, markersize=3, label="template")[0]
        self.forces = force_artist(axes, 5)
        self.title = named(axes, record.robot_name)
        self.show(0)
        keep_layout(self.figure)

    def show(self, frame: int) -> None:
        record, rows = self.playback.record, self.playback.rows
        row = rows[frame]
        pitch = record.q[row, 2]
        hip = record.q[row, :2]
        top = hip + self.top * np.array([np.sin(pitch), np.cos(pitch)])
        self.trunk.set_data(*np.stack((hip, top)).T)
        for foot, leg in enumerate(record.legs):
            self.legs[foot].set_data(*np.vstack((record.joint[row, leg], record.foot[row, foot])).T)
            seen = self.foothold_time[foot] <= record.time[row]
            places = self.foothold_x[foot][seen]
            heights = [self.ground.height_at(x) for x in places.tolist()]
            self.marks[foot].set_data(places, heights)
        for number, line in enumerate(self.springs):
            if self.loaded[row, number]:
                ends = (record.template_com[row], self.toes[row, number])
                line.set_data(*coil(self.spring, *ends))
            else:
                line.set_data([], [])
        self.trail.set_data(*record.com[rows[0] : row + 1].T)
        self.com.set_data(*record.com[row][:, None])
        self.template.set_data(*record.template_com[row][:, None])
        self.forces.set_offsets(record.foot[row])
        self.forces.set_UVC(*self.arrows[row].T)
        self.axes.set_xlim(record.com[row, 0] - self.half, record.com[row, 0] + self.half)
        self.title.set_text(f"{record.time[row]:.2f} s")


def write_film(
    path: Path,
    playback: Playback,
    fps: float,
    progress: Callable[[int], None] | None = None,
    dpi: int = 100,
) -> Path:
    """Draw every frame into a ``.gif`` or ``.mp4``.

    Args:
        path: of the film; its ending tells the format.
        playback: the frames.
        fps: frames per second, as the frames were chosen with.
        progress: called with the number of frames done.
        dpi: dots per inch of the 6.4 x 4.4 inch picture.

    Raises:
        RecordError: if the ending is another, ffmpeg is missing, or the file cannot be written.
    """
    writer = _writer(path, fps, len(playback.rows))
    with atomic_path(path) as place:
        free = isinstance(playback.record, FloatingRecord)
        stage = SpaceStage(playback) if free else _Stage(playback)
        try:
            with writer.saving(stage.figure, str(place), dpi):
                for frame in range(len(playback.rows)):
                    stage.show(frame)
                    writer.grab_frame()
                    if progress is not None:
                        progress(frame + 1)
        except subprocess.CalledProcessError as error:
            raise RecordError(f"cannot write {path}: {error}; give another file") from None
    return path


def _writer(path: Path, fps: float, frames: int) -> AbstractMovieWriter:
    if path.suffix == ".gif":
        if frames > _MOST_GIF_FRAMES:
            raise RecordError(
                f"{path} would have {frames} frames, more than {_MOST_GIF_FRAMES}: give a shorter"
                " part by start and end, a lower fps, or an .mp4"
            )
        return PillowWriter(fps=fps)  # type: ignore[arg-type]
    if path.suffix == ".mp4":
        if not FFMpegWriter.isAvailable():
            raise RecordError(
                f"cannot write {path}: there is no ffmpeg here; install it, or write a .gif"
            )
        # Players that know only 4:2:0 show nothing of ffmpeg's default for such pictures.
        return FFMpegWriter(fps=fps, extra_args=["-pix_fmt", "yuv420p"])  # type: ignore[arg-type]
    raise RecordError(f"{path} is no film by its name: let it end in .gif or .mp4")
