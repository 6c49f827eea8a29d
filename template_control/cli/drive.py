"""``template-control drive``: a robot is driven in the browser."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from template_control.checks import option_types as values
from template_control.cli.experiment_options import add_flags, experiment_from
from template_control.cli.flags import MASSES, OWN_URDF, ROBOT, WORLD
from template_control.view.browser import PORTS
from template_control.view.live.drive import FPS, drive
from template_control.view.replay.playback import FRAME_RATES


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Drive a robot in the browser, in real time and until Ctrl-C: sliders and keys command"
        " speed, turning and friction, push the robot, halt and slow down time. The page is for"
        " this machine only. Exit status: 0, 2 for bad input."
    )
    add_flags(parser, (*ROBOT, *MASSES, *OWN_URDF, *WORLD))
    parser.add_argument(
        "--port",
        type=values.whole(PORTS),
        help="of the server; the first free one from 8080 up if not given",
    )
    parser.add_argument(
        "--fps", type=values.number(FRAME_RATES), default=FPS, help="frames per second, 30"
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="print the page's address, open no browser"
    )
    parser.add_argument(
        "--output",
        type=values.path,
        default=Path("runs/drive"),
        help="folder for the page's save: run.npz, and run.toml, which repeats it; runs/drive",
    )


def run(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    e = experiment_from(options)
    e = replace(e, motion=None, planner=None, steps=None, pushes=(), frictions=())
    drive(
        replace(e, start=None, seed=None, pose=None),
        port=options.port,
        fps=options.fps,
        folder=options.output,
        browser=not options.no_browser,
    )
    return 0
