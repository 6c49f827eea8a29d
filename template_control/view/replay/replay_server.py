"""A replay in the browser: meshcat's server, started with the scene."""

from __future__ import annotations

import contextlib
import io
import os
import time
import webbrowser
from typing import Any

import umsgpack
from meshcat.visualizer import ViewerWindow

from template_control.errors import RecordError


class ReplayServer:
    """A running server; ends with :meth:`close`, the ``with`` block, or the process.

    Args:
        commands: as :func:`~template_control.view.replay.replay_scene.scene_commands` makes them.

    Attributes:
        url: where a browser finds the replay.

    Raises:
        RecordError: if the server does not start.
    """

    def __init__(self, commands: list[Any]) -> None:
        try:
            # meshcat prints the address itself, in its own words.
            with contextlib.redirect_stdout(io.StringIO()) as said:
                self._window = ViewerWindow(zmq_url=None, start_server=True, server_args=[])
        except RuntimeError as error:
            raise RecordError(f"{error}: {said.getvalue().strip()[-200:]}") from None
        self.url: str = self._window.web_url
        for command in commands:
            lowered = command.lower()
            head = [lowered["type"].encode(), lowered["path"].encode()]
            self._window.zmq_socket.send_multipart([*head, umsgpack.packb(lowered)])
            self._window.zmq_socket.recv()

    def open_browser(self) -> bool:
        """Show the replay in the user's browser; False where there is no display."""
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            return False
        return webbrowser.open(self.url, new=2)

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                time.sleep(3600.0)

    def close(self) -> None:
        """End the server."""
        self._window.server_proc.terminate()
        self._window.server_proc.wait()

    def __enter__(self) -> ReplayServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
