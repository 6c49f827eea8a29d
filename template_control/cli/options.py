"""Options that several commands have."""

from __future__ import annotations

import argparse

from template_control.robot.library import ROBOTS


def add_robot(parser: argparse.ArgumentParser) -> None:
    """``--robot``."""
    parser.add_argument(
        "--robot",
        default="five-link",
        metavar="NAME|URDF",
        help=f"a shipped robot ({', '.join(ROBOTS)}) or the path of a planar URDF",
    )
