"""Viewers of a replay's scene: one page without network, as a file or served to the browser."""

from __future__ import annotations

import base64
import html
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from string import Template
from threading import Thread
from typing import Any

import meshcat
import umsgpack

from template_control.view.browser import HOST, free_port, show_in_browser
from template_control.view.style import COM, TEMPLATE

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


def page_of(title: str, commands: list[Any], legs: Sequence[tuple[str, str]]) -> str:
    """Meshcat's viewer as one HTML page, with commands, and legs by name and colour."""
    shown = [(COM, "CoM and its trail"), (TEMPLATE, "template: CoM and loaded legs")]
    shown += [(color, f"{name}: ground force, footholds") for name, color in legs]
    signs = (f'<b style="color: {color}">&#9632;</b> {text}' for color, text in shown)
    packed = (base64.b64encode(umsgpack.packb(c)).decode() for c in commands)
    return _PAGE.substitute(
        title=html.escape(title),
        legend="<br>".join(signs),
        viewer=_VIEWER.read_text(encoding="utf-8"),
        commands=",\n".join(f'"{text}"' for text in packed),
    )


_PORTS = range(7000, 7100)


class ReplayServer(AbstractContextManager["ReplayServer"]):
    """A running server of a replay's page; ends with :meth:`close` or the ``with`` block."""

    def __init__(self, page: str, port: int | None = None) -> None:
        text = page.encode()

        class Answer(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(text)))
                self.end_headers()
                self.wfile.write(text)

            def log_message(self, *_: object) -> None:
                """Nothing: the terminal is the user's."""

        chosen = free_port(_PORTS if port is None else [port])
        self._server = _Server((HOST, chosen), Answer)
        self.url = f"http://{HOST}:{chosen}/"
        Thread(target=self._server.serve_forever, daemon=True).start()

    def open_browser(self) -> bool:
        """Show the replay in the user's browser; False where there is no display."""
        return show_in_browser(self.url)

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        with suppress(KeyboardInterrupt):
            while True:
                time.sleep(3600.0)

    def close(self) -> None:
        """End the server."""
        self._server.shutdown()
        self._server.server_close()

    def __exit__(self, *_: object) -> None:
        self.close()


class _Server(ThreadingHTTPServer):
    def handle_error(self, *_: object) -> None:
        """Nothing: a browser that goes away while it loads is no error."""
