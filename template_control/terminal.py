"""Where commands print: text as it is, whatever is in it."""

from __future__ import annotations

from rich.console import Console


def plain_console(stderr: bool = False) -> Console:
    """A console that takes no text for markup or emoji.

    The names of robots, scenarios and files are a user's: ``[/b]`` or ``:bus:`` is no order.

    Args:
        stderr: print there, not on standard output.
    """
    return Console(stderr=stderr, markup=False, emoji=False)
