"""The user's browser, and where it finds a page."""

from __future__ import annotations

import os
import socket
import webbrowser
from collections.abc import Sequence

from template_control.checks.ranges import Range
from template_control.errors import ParameterError

HOST = "127.0.0.1"  # of all pages: they are for this machine only
PORTS = Range(1, 65535)  # of a server


def show_in_browser(url: str) -> bool:
    """Show a page in the user's browser; False where there is no display."""
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    return webbrowser.open(url, new=2)


def free_port(ports: Sequence[int]) -> int:
    """The first of some ports of this machine that is free; a ParameterError if none is."""
    for port in ports:
        with socket.socket() as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                trial.bind((HOST, port))
                return port
            except OSError as error:
                reason = error.strerror
    where = f"port {ports[0]}" if len(ports) == 1 else f"ports {ports[0]} to {ports[-1]}"
    raise ParameterError(f"the page does not start on {where} ({reason}): give another --port")
