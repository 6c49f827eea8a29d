"""``--workers``: how many processes run trials."""

from __future__ import annotations

import argparse
import os

from template_control.errors import ParameterError

_MOST = 1000


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add ``--workers``."""
    parser.add_argument(
        "--workers",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes that run trials",
    )


def worker_count(options: argparse.Namespace) -> int:
    """How many processes were asked for.

    Args:
        options: as parsed.

    Raises:
        ParameterError: if the number is out of its range.
    """
    if not 1 <= options.workers <= _MOST:
        raise ParameterError(f"--workers is {options.workers}: give a number from 1 to {_MOST}")
    return int(options.workers)
