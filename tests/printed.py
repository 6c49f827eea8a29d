"""Commands that the README prints and that a test of their own runs as printed."""

import shlex

from places import ROOT

from template_control.cli.main import main
from template_control.run.record import Record

WALK_SPEEDS = "template-control walk --scenario examples/walk_speeds.toml --no-figures"
EXAMPLE_ONE = "template-control go examples/example_one.toml --robot runner"
ZERO_FIVE_ZERO = "template-control go examples/zero_five_zero.toml --robot runner --no-figures"


def words(line):
    """Of a command, wherever it is run."""
    return [str(ROOT / w) if w.startswith("examples/") else w for w in shlex.split(line)]


def go(line, folder, monkeypatch):
    """The record that such a command leaves in a folder."""
    monkeypatch.chdir(folder)
    _, command, *more = words(line)
    assert main([command, *more]) == 0
    return Record.load(folder / "runs" / command / "run.npz")
