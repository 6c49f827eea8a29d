"""``template-control completion``: what a shell needs to complete commands and options."""

from __future__ import annotations

import argparse

import shtab

_PROGRAM = "template-control"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Print a script that completes commands, options and their choices. For bash: "
        f"{_PROGRAM} completion bash > ~/.local/share/bash-completion/completions/{_PROGRAM}; for"
        f" zsh, into a file _{_PROGRAM} of a folder in $fpath."
    )
    parser.add_argument("shell", choices=shtab.SUPPORTED_SHELLS, help="that completes")


def run(options: argparse.Namespace) -> int:
    """Print the script; returns 0."""
    from template_control.cli.main import full_parser

    parser = full_parser()
    _show_all(parser)
    print(shtab.complete(parser, options.shell))
    return 0


def _show_all(parser: argparse.ArgumentParser) -> None:
    """Let the keys be completed too, which no help lists."""
    for action in parser._actions:
        if action.help == argparse.SUPPRESS:
            action.help = ""
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _show_all(command)
