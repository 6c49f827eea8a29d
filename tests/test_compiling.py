"""What is said while functions are compiled."""

import io
import logging

import pytest
from numba import njit
from rich.console import Console

from template_control import compiled, compiling


@pytest.fixture
def teller(monkeypatch):
    """A process that has compiled nothing yet, and a clock that is set by hand."""
    clock = [100.0]
    monkeypatch.setattr(compiling.time, "monotonic", lambda: clock[0])
    fresh = compiling.Teller()
    monkeypatch.setattr(compiling, "TELLER", fresh)
    monkeypatch.setattr(compiling, "_USUAL", 100)

    def compile_one(seconds):
        fresh.begin()
        clock[0] += seconds
        fresh.end()

    return compile_one


def told(terminal, run):
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=terminal, width=60, color_system=None)
    with compiling.compiling(console):
        run()
    return stream.getvalue()


def test_short_compiling_is_not_worth_a_word(teller, caplog):
    caplog.set_level(logging.INFO, "template_control")
    assert told(True, lambda: teller(0.5)) == ""
    assert caplog.messages == []


def test_long_compiling_is_told_once_where_lines_stay(teller, caplog):
    caplog.set_level(logging.INFO, "template_control")
    text = told(False, lambda: [teller(0.2) for _ in range(20)])
    assert text == "compiling once, about 20 s\n"
    assert caplog.messages == ["compiling once, about 20 s"]


def test_a_terminal_sees_one_line_that_goes_away(teller):
    text = told(True, lambda: [teller(0.2) for _ in range(22)])
    assert "\n" not in text
    lines = text.split("\r")
    assert lines[0].startswith("compiling once, about 20 s: ")
    assert lines[-3].endswith(" 22%")
    assert lines[-2].strip() == ""


def test_without_a_command_the_logger_is_told(teller, caplog):
    caplog.set_level(logging.INFO, "template_control")
    teller(2.0)
    assert len(caplog.messages) == 1


def test_numba_tells_of_what_it_compiles():
    @njit  # never from the cache
    def double(x):
        return 2 * x

    assert compiled.TELLER is compiling.TELLER
    before = compiling.TELLER.done
    assert double(2.0) == 4.0
    assert compiling.TELLER.done == before + 1
    assert double(3.0) == 6.0
    assert compiling.TELLER.done == before + 1


def test_what_others_compile_counts(teller):
    """One function of a hundred takes each of two processes 2 s: 50 s are left."""

    def run():
        others = []
        with compiling.TELLER.helped(2, lambda: len(others)):
            others.append("theirs")
            teller(2.0)
            others += ["theirs"] * 47
            teller(2.0)
        teller(2.0)

    lines = told(True, run).split("\r")
    assert lines[0] == "compiling once, about 50 s:   2%"
    assert lines[1].endswith(" 50%")
    assert lines[2].endswith(" 51%")


def test_waiting_for_others_is_told_of(teller, monkeypatch):
    def run():
        with compiling.TELLER.helped(2, lambda: 10), compiling.TELLER.waiting():
            now = compiling.time.monotonic()
            monkeypatch.setattr(compiling.time, "monotonic", lambda: now + 2.0)
            compiling.TELLER.look()

    assert told(False, run) == "compiling once, about 10 s\n"
