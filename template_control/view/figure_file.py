"""A figure as a file."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from template_control.storage import replacing

DPI = 110


def save_figure(figure: Figure, path: str | Path, dpi: int = DPI) -> Path:
    """Write a figure; a file that is there is replaced by a whole one or stays.

    Args:
        figure: what to draw.
        path: of the file; its ending tells the format.
        dpi: dots per inch, of a picture made of dots.

    Raises:
        RecordError: if the file cannot be written.
    """
    with replacing(path) as place:
        figure.savefig(place, dpi=dpi)
    return Path(path)
