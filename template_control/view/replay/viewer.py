"""Viewers of a replay's scene: meshcat's server, and one page without server or network."""

from __future__ import annotations

import atexit
import base64
import contextlib
import html
import os
import sys
import time
import webbrowser
from pathlib import Path
from string import Template
from subprocess import PIPE, Popen
from typing import Any

import meshcat
import umsgpack
import zmq

from template_control.errors import RecordError
from template_control.storage import atomic_path
from template_control.view.style import COM, LEFT, RIGHT, TEMPLATE

_VIEWER = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"

# The policy forbids every request: a page that works needs none. Commands run in order;
# meshcat's own static page hands each to a fetch of its own, and an animation that overtakes
# its object moves nothing.
_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline';
  script-src 'unsafe-inline' 'unsafe-eval'; img-src data: blob:; worker-src blob:">
<title>$title</title>
<style>
body { margin: 0; }
#meshcat-pane { width: 100vw; height: 100vh; overflow: hidden; }
#legend { position: absolute; left: 1em; top: 0.8em; font: 14px sans-serif; color: #333;
  pointer-events: none; }
#legend b { font-weight: bold; }
</style>
</head>
<body>
<div id="meshcat-pane"></div>
<div id="legend">$title<br>$legend</div>
<script>$viewer</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const text of [$commands]) {
  viewer.handle_command_bytearray(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));
}
viewer.gui.open();
viewer.gui.__folders["Scene"].close();
// walk.html?time=3.2 opens paused at 3.2 s.
const time = new URLSearchParams(location.search).get("time");
if (time !== null) {
  viewer.animator.pause();
  viewer.animator.seek(Number(time));
  viewer.animator.display_progress(Number(time));
}
</script>
</body>
</html>
""")

_LEGEND = (
    (COM, "CoM and its trail"),
    (TEMPLATE, "template: CoM and loaded legs"),
    (LEFT, "left foot: ground force, footholds"),
    (RIGHT, "right foot: ground force, footholds"),
)


def write_page(path: Path, title: str, commands: list[Any]) -> Path:
    """Write meshcat's viewer with the commands of a scene into one HTML file.

    Args:
        path: of the file.
        title: of the page.
        commands: as :func:`~template_control.view.replay.scene.scene_commands` makes them.

    Raises:
        RecordError: if the file cannot be written.
    """
    packed = (base64.b64encode(umsgpack.packb(c.lower())).decode() for c in commands)
    page = _PAGE.substitute(
        title=html.escape(title),
        legend="<br>".join(f'<b style="color: {c}">&#9632;</b> {text}' for c, text in _LEGEND),
        viewer=_VIEWER.read_text(encoding="utf-8"),
        commands=",\n".join(f'"{text}"' for text in packed),
    )
    with atomic_path(path) as place:
        place.write_text(page, encoding="utf-8")
    return path


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
        commands: as :func:`~template_control.view.replay.scene.scene_commands` makes them.
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
