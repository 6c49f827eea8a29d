"""What Ctrl-C, SIGTERM and the end of the terminal do to a command."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it."""

_AGAIN = 0.02  # [s] after which an interrupt is tried again: a callback is over by then
_STDERR = 2
_PROCESS = os.getpid()
_RECEIVED: list[int] = []  # signals that stopped the command


def stopped() -> bool:
    """Whether a signal has stopped the command."""
    return bool(_RECEIVED)


def on_signals(handler: Callable[[int, FrameType | None], None]) -> None:
    """What Ctrl-C does, SIGTERM does too, and the end of the terminal; not what nohup ignores.

    Args:
        handler: of this module.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def end_at_once(number: int, frame: FrameType | None) -> None:
    """While a command is imported, which Ctrl-C cannot end well.

    Args:
        number: the signal's.
        frame: where it came.
    """
    os.write(_STDERR, b"template-control: interrupted before anything was done\n")
    os._exit(INTERRUPTED)


def interrupt(number: int, frame: FrameType | None) -> None:
    """While a command runs: it keeps what it has done.

    Args:
        number: the signal's.
        frame: where it came.
    """
    # A process that was just forked still has the handler, but is not the command.
    if os.getpid() == _PROCESS:
        _RECEIVED.append(number)
        raise KeyboardInterrupt


def end_quietly(number: int, frame: FrameType | None) -> None:
    """When all is written and told.

    Args:
        number: the signal's.
        frame: where it came.
    """
    os._exit(INTERRUPTED)


def insist() -> None:
    """An interrupt that Python swallows comes again.

    Python goes on after an exception in a callback of C code, in a finaliser or beside a fork. A
    signal that arrives while LLVM compiles, for one, is handled in its next callback.
    """
    before = sys.unraisablehook

    def hook(unraisable: Any) -> None:
        if unraisable.exc_type is KeyboardInterrupt and os.getpid() == _PROCESS:
            threading.Timer(_AGAIN, os.kill, (_PROCESS, _RECEIVED[-1])).start()
        else:
            before(unraisable)

    sys.unraisablehook = hook
