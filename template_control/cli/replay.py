"""``template-control replay``: a recorded run in the browser, as a page or as a film."""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import Any

from rich.text import Text

from template_control.checks import option_types as values
from template_control.checks.ranges import Range
from template_control.errors import ParameterError
from template_control.run.record import Record, load_record
from template_control.terminal import plain_console
from template_control.view.browser import PORTS
from template_control.view.replay.playback import FRAME_RATES, SPEEDS
from template_control.view.replay.replay import (
    GIF_FPS,
    GIF_SECONDS,
    replay,
    save_film,
    save_html,
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Replay a run: robot, centre of mass and its trail, the template's loaded legs,"
        " ground forces and footholds. Without --html, --gif or --video a server shows it in"
        " the browser until Ctrl-C. Exit status: 0, 2 for bad input."
    )
    parser.add_argument("run_file", type=values.path, metavar="RUN", help="run.npz of a walk")
    parser.add_argument(
        "--speed",
        type=values.number(SPEEDS),
        default=1.0,
        help="1 (default) is real time, 0.25 a quarter of it",
    )
    parser.add_argument(
        "--fps",
        type=values.number(FRAME_RATES),
        help=f"frames per second, by default 30, and {GIF_FPS:g} in a GIF",
    )
    parser.add_argument(
        "--start",
        type=values.number(Range()),
        metavar="S",
        help="show from here [s]; negative values count from the run's end. By default from the"
        f" beginning, in a GIF the last {GIF_SECONDS:g} s",
    )
    parser.add_argument(
        "--end", type=values.number(Range()), metavar="S", help="show up to here [s]"
    )
    parser.add_argument(
        "--html",
        type=values.path,
        metavar="FILE",
        help="write one page that needs no server or network",
    )
    parser.add_argument("--gif", type=values.path, metavar="FILE", help="write an animated GIF")
    parser.add_argument(
        "--video", type=values.path, metavar="FILE", help="write an .mp4; needs ffmpeg installed"
    )
    parser.add_argument(
        "--port",
        type=values.whole(PORTS),
        help="of the server; the first free one from 7000 up if not given",
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="print the server's address, open no browser"
    )


def run(options: argparse.Namespace) -> int:
    """Write what is asked for, or serve until Ctrl-C."""
    films = [(options.gif, ".gif"), (options.video, ".mp4")]
    for path, ending in films:
        if path is not None and path.suffix != ending:
            raise ParameterError(f"{path} does not end in {ending}: give such a name")
    record = load_record(options.run_file)
    part = {"speed": options.speed, "start": options.start, "end": options.end}
    if options.fps is not None:
        part["fps"] = options.fps
    written = []
    if options.html is not None:
        written.append(save_html(record, options.html, **part))
    for path, _ in films:
        if path is not None:
            written.append(_film(record, path, part))
    for path in written:
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")
    if not written:
        with suppress(KeyboardInterrupt), replay(record, **part, port=options.port) as server:
            print(f"replay at {server.url}, until Ctrl-C", flush=True)
            if not options.no_browser:
                server.open_browser()
            server.wait()
    return 0


def _film(record: Record, path: Path, part: dict[str, Any]) -> Path:
    with plain_console(stderr=True).status(Text(f"drawing {path}")) as status:
        return save_film(
            record,
            path,
            progress=lambda n: status.update(Text(f"drawing {path}, frame {n}")),
            **part,
        )
