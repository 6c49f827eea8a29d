"""Keeps what C libraries print off standard output."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

_STDOUT, _STDERR = 1, 2


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Within it, everything written to standard output, by C code too, goes to stderr."""
    with _redirected(_STDERR):
        yield


@contextmanager
def stdout_discarded() -> Iterator[None]:
    """Within it, everything written to standard output, by C code too, is lost."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        with _redirected(nowhere):
            yield
    finally:
        os.close(nowhere)


@contextmanager
def _redirected(descriptor: int) -> Iterator[None]:
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    libc.fflush(None)
    saved = os.dup(_STDOUT)
    os.dup2(descriptor, _STDOUT)
    try:
        yield
    finally:
        sys.stdout.flush()
        libc.fflush(None)  # C's buffer still holds what was printed meanwhile
        os.dup2(saved, _STDOUT)
        os.close(saved)
