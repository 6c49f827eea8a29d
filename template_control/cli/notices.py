"""Lines of a command on standard error."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress


def notice(line: str) -> None:
    """Print a line; nothing where standard error takes none."""
    with suppress(OSError):
        print(f"template-control: {line}", file=sys.stderr, flush=True)


class _Notices(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        notice(record.getMessage())


@contextmanager
def printed(log: logging.Logger) -> Iterator[None]:
    """Print a log's warnings at once, for as long as a ``with`` block lasts."""
    handler = _Notices(logging.WARNING)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
