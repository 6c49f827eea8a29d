"""``template-control reproduce``: a table or figure of the paper, with ours."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager, nullcontext

from template_control.checks import option_types as values
from template_control.errors import ParameterError
from template_control.paper.reproduction import LONG, REPRODUCTIONS
from template_control.storage import Files, writing
from template_control.terminal import plain_console, report, table
from template_control.view.style import save_figure


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's description and options."""
    parser.description = (
        "Compute a table or figure of the paper again and print it with the paper's numbers."
    )
    parser.formatter_class = argparse.ArgumentDefaultsHelpFormatter
    parser.add_argument("name", metavar="NAME", help=f"one of {', '.join(REPRODUCTIONS)}")
    values.add_folder(parser, "runs/reproduce", "folder for the figures")
    values.add_json(parser, "the numbers as JSON")


def run(options: argparse.Namespace) -> int:
    """Reproduce what was asked for."""
    if options.name not in REPRODUCTIONS:
        raise ParameterError(
            f"no reproduction {options.name!r}: give one of {', '.join(REPRODUCTIONS)}"
        )
    files, paths = Files(), []
    with nullcontext() if options.no_figures else writing(options.output) as folder:
        with _announced(options.name):
            result = REPRODUCTIONS[options.name]()
        if folder is not None:
            drawn = [(figure, folder / f"{n}.png") for n, figure in result.figures.items()]
            paths = files.write(lambda: [save_figure(*one) for one in drawn]) or []
    data = {"name": options.name, **result.data, "figures": [str(p) for p in paths]}
    lines = [*(f"- {note}" for note in result.notes), *(f"figure: {path}" for path in paths)]
    report(options.json, data, table(result.title, result.columns, result.rows), lines=lines)
    files.raise_pending()
    return 0


def _announced(name: str) -> AbstractContextManager[object]:
    """A line or a spinner on standard error; what lasts long has progress bars of its own."""
    console = plain_console(stderr=True)
    if name not in LONG:
        return console.status(f"computing {name}")
    console.print(f"computing {name}: about {LONG[name]} s on two cores", highlight=False)
    return nullcontext()
