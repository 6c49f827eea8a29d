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
    from template_control.cli.main import all_actions, build_parser

    parser = build_parser()
    for action in all_actions(parser):
        if action.help == argparse.SUPPRESS:
            action.help = ""  # a key, which no help lists and which is completed all the same
    print(shtab.complete(parser, options.shell))
    return 0
