"""A replay in the browser: meshcat's server, started with the scene."""

from __future__ import annotations

import atexit
import contextlib
import os
import sys
import time
import webbrowser
from subprocess import PIPE, Popen
from typing import Any

import umsgpack
import zmq

from template_control.errors import RecordError

# meshcat's own main program has no option for the port.
_SERVER = """
import sys
from meshcat.servers.zmqserver import ZMQWebSocketBridge
try:
    bridge = ZMQWebSocketBridge(port=int(sys.argv[1]) if sys.argv[1:] else None)
except OSError as error:
    sys.exit(error.strerror)
print(bridge.zmq_url, bridge.web_url, flush=True)
bridge.run()
"""


class ReplayServer:
    """A running server; ends with :meth:`close`, the ``with`` block, or the process.

    Args:
        commands: as :func:`~template_control.view.replay.replay_scene.scene_commands` makes them.
        port: of the server; None for the first free one from 7000 up.

    Attributes:
        url: where a browser finds the replay.

    Raises:
        RecordError: if the server does not start.
    """

    def __init__(self, commands: list[Any], port: int | None = None) -> None:
        words = [sys.executable, "-c", _SERVER, *([] if port is None else [str(port)])]
        # In a session of its own: Ctrl-C in the terminal is for us alone.
        self._process = Popen(words, stdout=PIPE, stderr=PIPE, text=True, start_new_session=True)
        atexit.register(self.close)
        assert self._process.stdout is not None
        queue, _, self.url = self._process.stdout.readline().strip().partition(" ")
        if not self.url:
            _, why = self._process.communicate()
            self.close()
            where = "" if port is None else f" on port {port}"
            reason = (why.strip().splitlines() or ["no reason given"])[-1]
            raise RecordError(
                f"the replay's server does not start{where} ({reason}): give another --port, or"
                " write a page with --html"
            )
        with zmq.Context() as context, context.socket(zmq.REQ) as socket:
            socket.connect(queue)
            for command in commands:
                lowered = command.lower()
                head = [lowered["type"].encode(), lowered["path"].encode()]
                socket.send_multipart([*head, umsgpack.packb(lowered)])
                socket.recv()

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
        atexit.unregister(self.close)
        self._process.kill()
        self._process.communicate()

    def __enter__(self) -> ReplayServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
