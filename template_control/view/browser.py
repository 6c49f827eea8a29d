"""The user's browser."""

from __future__ import annotations

import os
import webbrowser

from template_control.checks.ranges import Range

PORTS = Range(1, 65535)
"""Of a server."""


def show_in_browser(url: str) -> bool:
    """Show a page in the user's browser; False where there is no display.

    Args:
        url: of the page.
    """
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    return webbrowser.open(url, new=2)
