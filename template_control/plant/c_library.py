"""Standard output and the locale of C libraries."""

from __future__ import annotations

import ctypes
import locale
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

_STDOUT, _STDERR = 1, 2
# POSIX has a mask for each category; glibc, musl and macOS number its bits as the categories.
_NUMERIC = 1 << locale.LC_NUMERIC


def stdout_to_stderr() -> AbstractContextManager[None]:
    """Send everything that is written to standard output, also by C code, to stderr."""
    return _redirected((_STDOUT,), _STDERR)


@contextmanager
def silenced() -> Iterator[None]:
    """Hold back everything that is written to standard output and stderr, also by C code.

    If an error ends the ``with`` block, it is written to stderr after all: it may hold the reason.
    """
    with tempfile.TemporaryFile() as held:
        try:
            with _redirected((_STDOUT, _STDERR), held.fileno()):
                yield
        except Exception:
            held.seek(0)
            with os.fdopen(os.dup(_STDERR), "wb") as stderr:
                shutil.copyfileobj(held, stderr)
            raise


@contextmanager
def decimal_points() -> Iterator[None]:
    """Let this thread's C code read and write numbers with a point within the ``with`` block.

    In a program with a locale of decimal commas, as Qt sets it, PyBullet reads "0.7" as 0. Other
    threads may be printing, so setlocale, which changes all of them, would not do.
    """
    libc = ctypes.CDLL(None)
    for function in (libc.newlocale, libc.uselocale):
        function.restype = ctypes.c_void_p
    points = ctypes.c_void_p(libc.newlocale(_NUMERIC, b"C", None))
    before = ctypes.c_void_p(libc.uselocale(points))
    try:
        yield
    finally:
        libc.uselocale(before)
        libc.freelocale(points)


@contextmanager
def _redirected(descriptors: tuple[int, ...], to: int) -> Iterator[None]:
    libc = ctypes.CDLL(None)
    _flush(libc)
    saved = [os.dup(descriptor) for descriptor in descriptors]
    for descriptor in descriptors:
        os.dup2(to, descriptor)
    try:
        yield
    finally:
        _flush(libc)  # the buffers still hold what was printed meanwhile
        for descriptor, copy in zip(descriptors, saved, strict=True):
            os.dup2(copy, descriptor)
            os.close(copy)


def _flush(libc: ctypes.CDLL) -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    libc.fflush(None)
