"""Tables keep all their words, in a pipe and in a terminal of any width."""

import io
from collections import Counter

import pytest
from rich.console import Console

from template_control import terminal

WORDS = [f"column-{i} of a table with long words" for i in range(12)]


def table():
    return terminal.table("a table", WORDS, [WORDS])


def test_in_a_pipe_no_line_is_wrapped(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    terminal.plain_console().print(table())
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) < 1000, "as wide as its words, and no wider"
    assert all(out.count(word) == 2 for word in WORDS)


@pytest.mark.parametrize("width", [80, 120, 400])
def test_in_a_terminal_no_letter_is_left_out(width):
    out = io.StringIO()
    Console(file=out, width=width, force_terminal=True, color_system=None).print(table())
    found = Counter(c for c in out.getvalue().partition("a table")[2] if c.isalnum())
    assert found == Counter(c for word in 2 * WORDS for c in word if c.isalnum())
