"""``template-control keys``: all keys of an experiment's file."""

from __future__ import annotations

import argparse
import json

from template_control import settings
from template_control.errors import ParameterError
from template_control.run.experiment import Experiment
from template_control.storage import to_jsonable


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "List the keys of an experiment's file (run.toml) with their defaults for the reference"
        " template, and a word about each. Each is an option of walk, run and go too, as in"
        " --world.friction 0.5."
    )
    parser.add_argument("word", nargs="?", default="", help="only keys with this word in them")
    parser.add_argument("--json", action="store_true", help="print defaults by key as JSON")


def run(options: argparse.Namespace) -> int:
    """Print the keys; returns 0."""
    found = [leaf for leaf in settings.leaves(Experiment) if options.word in leaf.path]
    if not found:
        raise ParameterError(f"no key has {options.word!r} in it: keys alone lists all of them")
    if options.json:
        print(json.dumps({leaf.path: to_jsonable(leaf.default, str) for leaf in found}))
        return 0
    for leaf in found:
        default = "" if leaf.default is None else settings.literal(leaf.default)
        about = leaf.about.partition(". ")[0].rstrip(".")
        print(f"{leaf.path} = {default}".rstrip() + f"  # {about}" * bool(about))
    return 0
