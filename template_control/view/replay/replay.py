"""Replays of a recorded run: in the browser, as one page, as a film."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from template_control.checks.checked import checked
from template_control.run.record import Record
from template_control.storage import write_text
from template_control.view.browser import PORTS
from template_control.view.replay.film import write_film
from template_control.view.replay.playback import Playback, playback
from template_control.view.style import legs_shown, moment

if TYPE_CHECKING:
    from template_control.view.replay.viewer import ReplayServer

# meshcat brings ZeroMQ and IPython along: it is imported where a replay begins, so that
# nobody who only walks a robot waits for it.

FPS = 30.0
GIF_FPS, GIF_SECONDS = 20.0, 4.0


@checked
def replay(
    record: Record,
    *,
    fps: float = FPS,
    speed: float = 1.0,
    start: float | None = None,
    end: float | None = None,
    port: Annotated[int, PORTS] | None = None,
) -> ReplayServer:
    """Serve a run to the browser, with meshcat's controls for pause, time and speed.

    Args:
        record: the run.
        fps: keyframes per second; the browser interpolates between them.
        speed: seconds of the run per second of the replay.
        start, end: part of the run [s]; negative values count from its end.
        port: of the server; None for the first free one from 7000 up.

    Returns:
        The server: ``url``, ``open_browser()``, ``wait()``, ``close()``.

    Raises:
        ParameterError: if a number is out of its range, or no port is free.
        RecordError: if the run or its robot cannot be shown.
    """
    from template_control.view.replay.viewer import ReplayServer

    frames = playback(record, fps=fps, speed=speed, start=start, end=end)
    return ReplayServer(_page(frames), port)


def _page(frames: Playback) -> str:
    """Page of a replay, with its legend."""
    from template_control.view.replay.scene import scene_commands
    from template_control.view.replay.viewer import page_of

    record = frames.record
    title = f"{record.robot_name}, gait {record.gait_name}, {record.steps} steps"
    title += ", fell" if record.fell else ""
    return page_of(title, scene_commands(frames), legs_shown(record))


@checked
def save_html(
    record: Record,
    path: str | Path,
    *,
    fps: float = FPS,
    speed: float = 1.0,
    start: float | None = None,
    end: float | None = None,
) -> Path:
    """Write a run as one page that opens without server and network.

    Arguments as for :func:`replay`; about 26 kB a second at 30 frames per second for the
    five-link robot, and 0.9 MB for the viewer. ``page.html?time=3.2`` opens paused at 3.2 s.

    Raises:
        ParameterError: if a number is out of its range.
        RecordError: if the run cannot be shown, or the file not be written.
    """
    frames = playback(record, fps=fps, speed=speed, start=start, end=end)
    return write_text(path, _page(frames))


@checked
def save_film(
    record: Record,
    path: str | Path,
    *,
    fps: float | None = None,
    speed: float = 1.0,
    start: float | None = None,
    end: float | None = None,
    progress: Callable[[int], None] | None = None,
) -> Path:
    """Draw a run from the side into a ``.gif`` or, where ffmpeg is installed, an ``.mp4``.

    Args:
        record: the run.
        path: of the film; its ending is the format.
        fps: frames per second; None for 20 in a GIF and 30 in a video.
        speed: seconds of the run per second of the film.
        start, end: part of the run [s]; negative values count from its end. Without ``start``
            a GIF begins 4 s of film before its end, a video with the run.
        progress: called with the number of frames done.

    Raises:
        ParameterError: if a number is out of its range.
        RecordError: if the run is too short, or the file cannot be written.
    """
    path = Path(path)
    is_gif = path.suffix == ".gif"
    if fps is None:
        fps = GIF_FPS if is_gif else FPS
    record.check_shown()
    if is_gif and start is None:
        last = float(record.time[-1])
        stop = min(moment(end, last, last), last)
        start = max(float(record.time[0]), stop - GIF_SECONDS * speed)
    frames = playback(record, fps=fps, speed=speed, start=start, end=end)
    return write_film(path, frames, fps, progress)
