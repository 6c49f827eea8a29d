"""A replay as one page that needs neither server nor network."""

from __future__ import annotations

import base64
import html
from pathlib import Path
from string import Template
from typing import Any

import meshcat
import umsgpack

from template_control.storage import replacing
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
        commands: as :func:`~template_control.view.replay.replay_scene.scene_commands` makes them.

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
    with replacing(path) as place:
        place.write_text(page, encoding="utf-8")
    return path
