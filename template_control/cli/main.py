"""Entry point of ``template-control``: one module a command."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from rich.console import Console

from template_control.cli import (
    automaton,
    gaits,
    plots,
    replay,
    robots,
    robustness,
    slip,
    walk,
)
from template_control.cli.output import INTERRUPTED
from template_control.compiling import compiling
from template_control.errors import TemplateControlError
from template_control.paper import command as reproduce

_COMMANDS = (walk, robots, replay, plots, robustness, slip, gaits, automaton, reproduce)
_USER_ERROR = 2


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="template-control",
        description="Bipedal SLIP templates, their control, and robots that follow them.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for module in _COMMANDS:
        module.add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit status.

    A user's mistake is told in one line, status 2; Ctrl-C is status 130.
    """
    options = build_parser().parse_args(arguments)
    try:
        with compiling(Console(stderr=True)):
            return int(options.run(options))
    except TemplateControlError as error:
        print(f"template-control: {error}", file=sys.stderr)
        return _USER_ERROR
    except KeyboardInterrupt:
        print("template-control: interrupted before anything was done", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
