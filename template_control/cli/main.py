"""Entry point of ``template-control``: one module a command, imported when it is asked for."""

from __future__ import annotations

import argparse
import gc
import io
import logging
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pkgutil import resolve_name
from typing import Any, NoReturn

from template_control.cli import interrupts
from template_control.cli.notices import notice, printed
from template_control.errors import ParameterError, TemplateControlError, meant

_COMMANDS = {
    "walk": "walk a robot that follows the SLIP template, headless, and report",
    "run": "run a robot that follows the SLIP template, headless, and report",
    "go": "take a robot through a scenario of gaits and speeds, and the template alone too",
    "drive": "drive a robot in the browser: command, push and watch it",
    "robots": "list the shipped robots, with the template scaled to each",
    "replay": "show a recorded run in the browser, or write it as a page or a film",
    "plots": "draw the figures of a recorded run",
    "robustness": "raise one disturbance after another until a robot's walk fails",
    "campaign": "disturb a robot by everything at once, many times, and measure the share of falls",
    "study": "run an experiment over a grid or a sample of some of its keys",
    "slip": "simulate the SLIP template through a scenario of gaits and speeds",
    "gaits": "follow a branch of periodic gaits and their stability",
    "automaton": "show the hybrid automaton that simulator, planners and robot controller read",
    "keys": "list all keys of an experiment's file, each of which is an option of walk, run and go",
    "warm-up": "compile once what all commands call; each compiles what it needs without it",
    "completion": "print a script that completes words in a shell",
    "reproduce": "reproduce a table or figure of the paper, with the paper's numbers",
}
"""Commands, with a line about each."""

# The module with a command's ``add_options(parser)`` and ``run(options)``, or after the colon the
# object of the module that has them; of the other commands the module of their name.
_PLACES = {
    "walk": "cli.motion:WALK",
    "run": "cli.motion:RUN",
    "go": "cli.motion:GO",
    "warm-up": "cli.warm_up:",
    "reproduce": "paper.command:",
}
_USER_ERROR = 2
_STDOUT, _STDERR = 1, 2
_PIPE_CLOSED = 141  # as shells have it where SIGPIPE ended a program
_NOTHING_KEPT = "interrupted, nothing is kept"


class _Version(argparse.Action):
    """``--version``; the metadata are looked up only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from template_control.version import __version__

        print(f"{parser.prog} {__version__}")
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """Takes a word like ``-20@4`` for a value, as argparse does plain negative numbers only."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._negative_number_matcher = re.compile(r"-[\d.]")

    def error(self, message: str) -> NoReturn:
        """Refuse the words in one line; those of our own types follow the option's name."""
        option, ours, reason = re.sub(r"^argument (\S+): ", r"\1: ", message).partition(": is ")
        if ours:
            raise ParameterError(f"{option} is {reason}")
        unknown = re.match(r"unrecognized arguments: (--\S+)", message)
        known = (option for action in all_actions(self) for option in action.option_strings)
        near = meant(unknown[1], known) if unknown else ""
        raise ParameterError(f"{option}{near}; {self.prog} --help lists what there is")


def all_actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Actions of a parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from all_actions(command)


def build_parser(arguments: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """The parser for ``arguments``, with the options of the one command that they name.

    None is for the options of all commands.
    """
    # Before the command there are only options without a value.
    named = [word for word in arguments or () if not word.startswith("-")][:1]
    parser = _Parser(
        prog="template-control",
        description="Bipedal SLIP templates, their control, and robots that follow them.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, about in _COMMANDS.items():
        sub_parser = commands.add_parser(name, help=about)
        if arguments is None or name in named:
            found = resolve_name(f"template_control.{_PLACES.get(name, f'cli.{name}:')}")
            found.add_options(sub_parser)
            sub_parser.set_defaults(run=found.run)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit status.

    A user's mistake is one line, status 2; Ctrl-C is status 130, and so is SIGTERM or a terminal
    that was closed. ``arguments`` None are those of this process, which then ends with it.
    """
    if arguments is not None:
        return _command(arguments)
    output = _standard_streams()
    interrupts.on_signals(interrupts.end_at_once)
    interrupts.insist()
    gc.disable()  # what is imported stays: to look through it, now and at the end, takes a quarter
    try:
        status = _command(sys.argv[1:], output)
        if interrupts.stopped():
            with suppress(OSError):
                sys.stdout.flush()
            os._exit(status)  # to take everything apart takes Python up to a second
        return status
    finally:
        interrupts.on_signals(interrupts.end_quietly)


def _command(arguments: Sequence[str], output: _Standard | None = None) -> int:
    """Run a command; with the ``output`` of the process, its signals are its affair too."""
    try:
        options = build_parser(arguments).parse_args(arguments)
        if output is not None:
            gc.freeze()
            gc.enable()
            interrupts.on_signals(interrupts.interrupt)
        with printed(logging.getLogger("template_control.robot")):  # such as missing meshes
            status = int(options.run(options))
        sys.stdout.flush()
        return status
    except KeyboardInterrupt as error:
        if output is not None:
            interrupts.on_signals(interrupts.end_quietly)
        line, status = str(error) or _NOTHING_KEPT, interrupts.INTERRUPTED
    except TemplateControlError as error:
        line, status = str(error), _USER_ERROR
    except (Exception, SystemExit):
        if interrupts.stopped():  # an import that Ctrl-C ends may end with any error
            line, status = _NOTHING_KEPT, interrupts.INTERRUPTED
        else:
            with suppress(OSError):
                sys.stdout.flush()
            failure = None if output is None else output.failure
            if failure is None:
                raise
            if isinstance(failure, BrokenPipeError):
                return _PIPE_CLOSED
            line, status = f"cannot write to standard output: {failure.strerror}", _USER_ERROR
    notice(line)
    return status


class _Standard(io.FileIO):
    """Standard output or error, which takes no more after its first failure.

    What a full device has not taken would be tried again, and fail again, when Python ends. Of
    standard error even the first failure is no reason to end a command.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self.failure: OSError | None = None

    def write(self, data: Any) -> int | None:  # type: ignore[override]
        if self.failure is None:
            try:
                return super().write(data)
            except OSError as error:
                self.failure = error
                if self.fileno() == _STDOUT:
                    raise
        return len(data)


def _standard_streams() -> _Standard:
    """Open what is closed, as a file would take its place, and replace what is not encoded."""
    for descriptor in range(_STDERR + 1):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
    streams = _Standard(_STDOUT), _Standard(_STDERR)
    sys.stdout, sys.stderr = (
        io.TextIOWrapper(
            io.BufferedWriter(stream),
            encoding=None if old is None else old.encoding,
            errors="replace",
            line_buffering=stream.isatty() or stream is streams[1],
        )
        for stream, old in zip(streams, (sys.stdout, sys.stderr), strict=True)
    )
    return streams[0]


if __name__ == "__main__":
    sys.exit(main())
