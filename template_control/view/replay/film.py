"""A replay as a film, drawn without browser or display: from the side, a free robot in space."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from numpy.typing import NDArray

from template_control.errors import RecordError
from template_control.run.record import FloatingRecord
from template_control.storage import replacing
from template_control.view.replay.film_picture import (
    LEGS,
    WIDTH,
    empty_picture,
    force_artist,
    keep_layout,
    named,
)
from template_control.view.replay.playback import (
    Playback,
    carrying,
    coil,
    footholds,
    force_arrows,
    spring,
    template_legs,
)
from template_control.view.replay.space_film import SpaceStage
from template_control.view.style import COM, TEMPLATE, TRUNK

Array = NDArray[np.float64]

_MOST_GIF_FRAMES = 1000  # a GIF is held in memory until its last frame


class _Stage:
    """The picture, whose artists each frame moves."""

    def __init__(self, playback: Playback) -> None:
        record, rows = playback.record, playback.rows
        self.playback = playback
        length = record.metadata["template"]["rest_length"]
        self.top = 2.0 * record.metadata["trunk_com"]
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
        self.title = named(axes, record.metadata["robot"])
        self.show(0)
        keep_layout(self.figure)

    def show(self, frame: int) -> None:
        record, rows = self.playback.record, self.playback.rows
        row = rows[frame]
        pitch = record.q[row, 2]
        hip = record.q[row, :2]
        top = hip + self.top * np.array([np.sin(pitch), np.cos(pitch)])
        self.trunk.set_data(*np.stack((hip, top)).T)
        for foot, leg in enumerate(record.metadata["legs"]):
            self.legs[foot].set_data(*np.vstack((record.joint[row, leg], record.foot[row, foot])).T)
            seen = self.foothold_time[foot] <= record.time[row]
            places = self.foothold_x[foot][seen]
            heights = [self.ground.height_at(x) for x in places.tolist()]
            self.marks[foot].set_data(places, heights)
        for leg, line in enumerate(self.springs):
            if self.loaded[row, leg]:
                ends = (record.template_com[row], self.toes[row, leg])
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
    with replacing(path) as place:
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
