"""Numbers with a decimal point for C code that reads them by the locale."""

from __future__ import annotations

import ctypes
import locale
from collections.abc import Iterator
from contextlib import contextmanager

# POSIX has a mask for each category; glibc, musl and macOS number its bits as the categories.
_NUMERIC = 1 << locale.LC_NUMERIC


@contextmanager
def decimal_points() -> Iterator[None]:
    """Let this thread's C code read and write numbers with a point within the ``with`` block.

    A program that has set a locale with decimal commas, as Qt does, makes PyBullet read "0.7" as
    0. Only the calling thread is changed: setlocale would change all, and other threads may be
    printing.
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
