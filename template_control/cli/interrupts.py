"""Effect of Ctrl-C, SIGTERM and the end of the terminal on a command."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

INTERRUPTED = 130  # exit status after Ctrl-C, as shells have it

_AGAIN = 0.02  # [s] after which an interrupt is tried again: a callback is over by then
_STDERR = 2
_PROCESS = os.getpid()
_RECEIVED: list[int] = []  # signals that stopped the command


def stopped() -> bool:
    """True if a signal has stopped the command."""
    return bool(_RECEIVED)


def on_signals(handler: Callable[[int, FrameType | None], None]) -> None:
    """Set the handler of Ctrl-C, SIGTERM and the end of the terminal; not of what nohup ignores."""
    if threading.current_thread() is not threading.main_thread():
        return
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def end_at_once(number: int, frame: FrameType | None) -> None:
    """Handler while a command is imported, which Ctrl-C cannot end well."""
    os.write(_STDERR, b"template-control: interrupted before anything was done\n")
    os._exit(INTERRUPTED)


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handler while a command runs: it keeps what it has done."""
    # A process that was just forked still has the handler, but is not the command.
    if os.getpid() == _PROCESS:
        _RECEIVED.append(number)
        raise KeyboardInterrupt


def end_quietly(number: int, frame: FrameType | None) -> None:
    """Handler when all is written and printed."""
    os._exit(INTERRUPTED)


def insist() -> None:
    """Send an interrupt that Python swallows in a callback of C code or a finaliser once more."""
    before = sys.unraisablehook

    def hook(unraisable: Any) -> None:
        if unraisable.exc_type is KeyboardInterrupt and os.getpid() == _PROCESS:
            threading.Timer(_AGAIN, os.kill, (_PROCESS, _RECEIVED[-1])).start()
        else:
            before(unraisable)

    sys.unraisablehook = hook
