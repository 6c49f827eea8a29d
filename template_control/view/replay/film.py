"""Films of a run, drawn without browser or display: side view, or in space."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from template_control.arrays import Array, BoolArray, IntArray
from template_control.errors import RecordError
from template_control.run.record import FloatingRecord, Record
from template_control.storage import atomic_path
from template_control.view.replay.playback import Playback, coil, spring
from template_control.view.replay.robot_visuals import model_of
from template_control.view.replay.scene import in_space, smoothed, stood
from template_control.view.style import COM, SIDES, TEMPLATE, TRUNK, as_text, feet_shown, legs_shown

_WIDTH = 2.6  # of the picture, in rest lengths, at the least
_FLATTER = 0.75  # height of the picture over its width
_OVER = 1.3  # height over the ground that is shown, over the robot's, at the least
_BELOW = 0.08, 0.22  # share of the picture's height under the ground, planar and in space
_AROUND = 3.0  # rest lengths of ground that are drawn next to the path
_LEFTWARD, _ABOVE = np.radians(-25.0), np.radians(18.0)  # the camera's, from a view from the right

# Rows: to the right and upward in the picture; without perspective, so that lengths compare.
_X, _Y = np.cos(_LEFTWARD), np.sin(_LEFTWARD)
IN_SPACE = np.array([[_X, _Y, 0.0], [-_Y * np.sin(_ABOVE), _X * np.sin(_ABOVE), np.cos(_ABOVE)]])
"""Camera of a floating-base run: from the right and from behind."""
FROM_THE_SIDE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # camera of a planar run


class Stage:
    """The picture of a run, whose artists each frame moves.

    ``camera`` (2, 3) leads from the world to the picture; ``legs`` are the lines of each, through
    its ``joints`` (F, n, joints, 3), ``corners`` (F, 4, 3) those of the trunk [m].
    """

    def __init__(self, playback: Playback) -> None:
        record = playback.record
        space = in_space(record, np.zeros(len(record.feet)))
        self._stood, self._space = stood(record, space), space.at(playback.rows)
        self._record, self._times = record, record.time[playback.rows]
        self.joints, self.corners, on_left = _bodies(record, playback.rows)
        self._length = length = record.template.rest_length
        flat = not isinstance(record, FloatingRecord)
        self.camera = FROM_THE_SIDE if flat else IN_SPACE
        self._below = _BELOW[0 if flat else 1]
        self._spring = spring(0.03 * length)
        self.figure = Figure(figsize=(6.4, 4.4), layout="constrained")
        FigureCanvasAgg(self.figure)
        self._axes = axes = self.figure.subplots()
        axes.set_aspect("equal", adjustable="box")
        self._draw_ground(flat)
        self._level = smoothed(record.ground, self._space.com[:, 0], length)
        tall = float(self.corners[0, :, 2].max() - self._level[0]) * self.camera[1, 2]
        high = max(_FLATTER * _WIDTH * length, _OVER * tall / (1.0 - self._below))
        self._size = high / _FLATTER, high

        def line(marker: str, zorder: float, **look: Any) -> Line2D:
            return axes.plot([], [], marker, zorder=zorder, **look)[0]

        self._trail = line("", 2, color=COM, linewidth=1.2)
        shown = feet_shown(record)
        self._marks = [line("^", 2, color=c, markersize=5) for _, c in shown]
        # The left legs are behind the trunk, the right ones before it.
        thick: dict[str, Any] = {"linewidth": 4, "solid_capstyle": "round"}
        self.legs = [
            line("", 2 if left else 4, color=c, **thick)
            for (_, c), left in zip(shown, on_left, strict=True)
        ]
        width = 7 if flat else 3
        self._trunk = Polygon(
            np.zeros((4, 2)), color=TRUNK, linewidth=width, alpha=0.55, zorder=3, joinstyle="round"
        )
        axes.add_patch(self._trunk)
        self._springs = [line("", 5, color=TEMPLATE, linewidth=1.1) for _ in SIDES]
        self._com = line("o", 6, color=COM, markersize=7, label="CoM")
        self._template = line("o", 7, color=TEMPLATE, markersize=3, label="template")
        self._forces = axes.quiver(
            *np.zeros((4, len(shown))), color=[c for _, c in shown], angles="xy",
            scale_units="xy", scale=1.0, width=0.007, zorder=8,
        )  # fmt: skip
        for name, color in legs_shown(record):
            legs = name.replace(" foot", " leg")
            line("", 0, color=color, linewidth=4, label=f"{legs}, its ground force")
        axes.legend(loc="upper left", fontsize=7, frameon=False)
        self._time = axes.set_title(" ", fontsize=9, loc="right")
        axes.set_title(as_text(record.robot_name), fontsize=9, loc="left")
        self.show(0)
        # Once: a layout that follows the tick labels would make the picture tremble.
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")

    def seen(self, points: Array) -> Array:
        """(..., 3) of the world to (..., 2) of the picture [m]."""
        return np.asarray(points @ self.camera.T)

    def _draw_ground(self, flat: bool) -> None:
        """The ground around the path: its profile, or a net of lines every rest length."""
        record, length = self._record, self._length
        place = self._space.com[:, :2] / length
        low, high = np.floor(place.min(axis=0) - _AROUND), np.ceil(place.max(axis=0) + _AROUND)
        (x0, y0), (x1, y1) = (length * low).tolist(), (length * high).tolist()
        along = np.array(record.ground.line(x0, x1))
        if flat:
            self._axes.set(xlabel="x [m]", ylabel="y [m]")
            depth = along[:, 1].min() - length
            self._axes.fill_between(along[:, 0], along[:, 1], depth, color="0.9", linewidth=0)
            self._axes.plot(*along.T, color="0.3", linewidth=0.8)
            return
        self._axes.set(xticks=[], yticks=[])
        lines = [
            self.seen(np.insert(along, 1, length * y, axis=1))
            for y in np.arange(low[1], high[1] + 0.5)
        ]
        for x in (length * np.arange(low[0], high[0] + 0.5)).tolist():
            height = record.ground.height_at(x)
            lines.append(self.seen(np.array([[x, y0, height], [x, y1, height]])))
        self._axes.add_collection(LineCollection(lines, colors="0.82", linewidths=0.8))

    def show(self, frame: int) -> None:
        """Draw a frame."""
        now, time, seen = self._space.at(frame), self._times[frame], self.seen
        self._trunk.set_xy(seen(self.corners[frame]))
        for foot, leg in enumerate(self.legs):
            leg.set_data(*seen(np.vstack((self.joints[frame, foot], now.foot[foot]))).T)
            places, since = self._stood[foot]
            self._marks[foot].set_data(*seen(places[since <= time]).T)
        template = seen(now.template)
        for line, toe, loaded in zip(self._springs, now.toes, now.loaded, strict=True):
            line.set_data(*(coil(self._spring, template, seen(toe)) if loaded else ([], [])))
        self._trail.set_data(*seen(self._space.com[: frame + 1]).T)
        self._com.set_data(*seen(now.com)[:, None])
        self._template.set_data(*template[:, None])
        self._forces.set_offsets(seen(now.foot))
        self._forces.set_UVC(*seen(now.arrow).T)
        x, y = seen(np.array([*now.com[:2], self._level[frame]])).tolist()
        wide, high = self._size
        self._axes.set_xlim(x - 0.5 * wide, x + 0.5 * wide)
        self._axes.set_ylim(y - self._below * high, y + (1.0 - self._below) * high)
        self._time.set_text(f"{time:.2f} s")


def _bodies(record: Record, rows: IntArray) -> tuple[Array, Array, BoolArray]:
    """The robot in samples ``rows`` (F,), by Pinocchio.

    Returns:
        (F, n, joints, 3) joints of each leg from the trunk on, (F, 4, 3) corners of the trunk [m]:
        four hips, or those of two and twice as high as its CoM; (n,) whether a leg is a left one.
    """
    model = model_of(record)
    data = model.createData()
    joints = [[model.getJointId(record.joints[i]) for i in leg] for leg in record.legs]
    trunk, top = model.parents[joints[0][0]], np.array([0.0, 0.0, 2.0 * record.trunk_com])
    legs, up = [], []
    for q in (pin.neutral(model), *record.q[rows]):
        pin.forwardKinematics(model, data, q)
        legs.append([[data.oMi[joint].translation.copy() for joint in leg] for leg in joints])
        up.append(data.oMi[trunk].rotation @ top)
    found = np.array(legs)
    first, hips = found[0, :, 0], found[1:, :, 0]
    if len(joints) > len(SIDES):
        away = first - first.mean(axis=0)
        corners = hips[:, np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
    else:
        corners = np.concatenate((hips, hips[:, ::-1] + np.array(up[1:])[:, None]), axis=1)
    return found[1:], corners, first[:, 1] > first[:, 1].mean()


_DPI = 100
_MOST_GIF_FRAMES = 1000  # a GIF is held in memory until its last frame


def write_film(
    path: Path,
    playback: Playback,
    fps: float,
    progress: Callable[[int], None] | None = None,
) -> Path:
    """Draw every frame into a ``.gif`` or ``.mp4``, 640 x 440 dots large."""
    writer = _writer(path, fps, len(playback.rows))
    with atomic_path(path) as place:
        stage = Stage(playback)
        try:
            with writer.saving(stage.figure, str(place), _DPI):
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
