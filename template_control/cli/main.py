"""Entry point of ``template-control``: one module a command, imported when it is asked for."""

from __future__ import annotations

import argparse
import importlib
import re
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

from template_control.cli.output import INTERRUPTED
from template_control.errors import TemplateControlError


class _Command(NamedTuple):
    """A command of the command line.

    Attributes:
        module: where its ``add_options(parser)`` and its ``run(options)`` are.
        about: one line.
    """

    module: str
    about: str


_COMMANDS = {
    "walk": _Command(
        "template_control.cli.walk",
        "walk a robot that follows the SLIP template, headless, and report",
    ),
    "robots": _Command(
        "template_control.cli.robots",
        "list the shipped robots, with the template scaled to each",
    ),
    "replay": _Command(
        "template_control.cli.replay",
        "show a recorded run in the browser, or write it as a page or a film",
    ),
    "plots": _Command("template_control.cli.plots", "draw the figures of a recorded run"),
    "robustness": _Command(
        "template_control.cli.robustness",
        "raise disturbances until a robot's walk breaks, and tell how much it takes",
    ),
    "slip": _Command(
        "template_control.cli.slip",
        "simulate the SLIP template through a scenario of gaits and speeds",
    ),
    "gaits": _Command(
        "template_control.cli.gaits",
        "follow a branch of periodic gaits and tell its stability",
    ),
    "automaton": _Command(
        "template_control.cli.automaton",
        "show the hybrid automaton that simulator, planners and robot controller read",
    ),
    "reproduce": _Command(
        "template_control.paper.command",
        "reproduce a table or figure of the paper, ours beside the paper's",
    ),
}
_USER_ERROR = 2


class _Version(argparse.Action):
    """``--version``; the metadata are looked up only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from template_control.version import __version__

        print(f"{parser.prog} {__version__}")
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """Takes a word like ``-20@4`` for an option's value: no option begins with a digit.

    argparse does so with plain negative numbers only.
    """

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As :meth:`argparse.ArgumentParser.parse_known_args`.

        Args:
            args: the words; None: of the process.
            namespace: to fill.
        """
        return super().parse_known_args(_with_values(args), namespace)


def build_parser(arguments: Sequence[str]) -> argparse.ArgumentParser:
    """The parser for ``arguments``.

    It lists every command, but has the options of the one command that ``arguments`` name:
    importing them all would take seconds, even for ``--help``.
    """
    parser = _Parser(
        prog="template-control",
        description="Bipedal SLIP templates, their control, and robots that follow them.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    # Before the command there are only options without a value.
    wanted = next((word for word in arguments if not word.startswith("-")), None)
    for name, command in _COMMANDS.items():
        sub_parser = commands.add_parser(name, help=command.about)
        if name == wanted:
            module = importlib.import_module(command.module)
            module.add_options(sub_parser)
            sub_parser.set_defaults(run=module.run)
    return parser


def _with_values(arguments: Sequence[str] | None) -> list[str]:
    """The words, an option joined with a value that begins with a minus and a digit."""
    words: list[str] = []
    for word in sys.argv[1:] if arguments is None else arguments:
        if words and re.match(r"-[\d.]", word) and re.fullmatch(r"--[a-z-]+", words[-1]):
            words[-1] += f"={word}"
        else:
            words.append(word)
    return words


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit status.

    A user's mistake is told in one line, status 2; Ctrl-C is status 130.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        options = build_parser(arguments).parse_args(arguments)
        # Not before: whoever asks for help need not wait for it.
        from rich.console import Console

        from template_control.compiling import compiling

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
