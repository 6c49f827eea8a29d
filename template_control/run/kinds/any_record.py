"""A recorded run of any robot from its file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from template_control.checks.checked import checked
from template_control.run.kinds.free_record import FreeRecord
from template_control.run.record import Record


@checked
def load_record(path: str | Path) -> Record:
    """Read a run, of a planar robot or of a free one.

    Args:
        path: of the file.

    Raises:
        RecordError: if the file is missing or is no recorded run, naming what is wrong in it.
    """
    return FreeRecord.load(path) if _in_space(path) else Record.load(path)


def _in_space(path: str | Path) -> bool:
    """Whether the file has what only a run in space has; False where it cannot be read."""
    try:
        with np.load(path, allow_pickle=False) as data:
            return "space_com" in data.files
    except Exception:  # a damaged file has any of a dozen; its reader tells
        return False
