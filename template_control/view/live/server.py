"""Server of a page that steers: local, and closed to the pages of others."""

from __future__ import annotations

import io
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

from template_control.errors import MissingPackageError, ParameterError
from template_control.view.browser import HOST, free_port

PORTS = range(8080, 8180)  # tried in turn where no port is asked for
_ENDS = 10.0  # [s] that a server's thread may take to end
# A browser opens connections ahead of use, and closes those that it does not need.
_UNUSED = "opening handshake failed"
_LOCAL = ("127.0.0.1", "localhost", "::1")


def is_own(host: str, origin: str | None) -> bool:
    """True for a request of the page itself, or of a program, which sends no ``origin``.

    A browser lets any page that it shows open a websocket here, and says in ``Origin`` whose page
    it is. A page whose name was made to lead here has that name in ``Host``.
    """
    if urlsplit(f"http://{host}").hostname not in _LOCAL:
        return False
    return origin is None or urlsplit(origin).netloc == host


@contextmanager
def _closed_to_others() -> Iterator[None]:
    """Let viser's server, which has no option for it, refuse what is not :func:`is_own`."""
    import websockets.asyncio.server as server

    serve = server.serve

    def guarded(*args: Any, process_request: Callable[..., Any], **options: Any) -> Any:
        def check(connection: Any, request: Any) -> Any:
            hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
            if len(hosts) == 1 and all(is_own(hosts[0], one) for one in origins or [None]):
                return process_request(connection, request)
            return connection.respond(HTTPStatus.FORBIDDEN, "this page is driven from itself\n")

        return serve(*args, process_request=check, **options)

    server.serve = guarded
    try:
        yield
    finally:
        server.serve = serve


class PageServer:
    """A server of viser's, for this machine only, on a port or the first free one of :data:`PORTS`.

    ``url`` is where a browser finds its page. A ParameterError if no port is free.
    """

    def __init__(self, port: int | None) -> None:
        try:
            import viser
        except ImportError:
            raise MissingPackageError(
                "to drive a robot needs the package viser: pip install 'template-control[live]'"
            ) from None
        logging.getLogger("websockets.server").addFilter(_is_news)
        chosen = free_port(PORTS if port is None else [port])
        others = set(threading.enumerate())
        with _closed_to_others(), redirect_stdout(io.StringIO()):  # it prints a table
            self.viser: Any = viser.ViserServer(host=HOST, port=chosen, verbose=False)
        self._threads = set(threading.enumerate()) - others
        self.url = f"http://{HOST}:{chosen}/"
        if self.viser.get_port() != chosen:  # taken meanwhile: viser takes the next one
            self.close()
            raise ParameterError(f"port {chosen} was taken just now: start again")
        self.viser.gui.configure_theme(show_share_button=False, show_logo=False)

    def close(self) -> None:
        """End the server, which prints a line about it as its threads end."""
        with redirect_stdout(io.StringIO()):
            self.viser.stop()
            for thread in self._threads:
                thread.join(_ENDS)


def _is_news(record: logging.LogRecord) -> bool:
    return record.getMessage() != _UNUSED
