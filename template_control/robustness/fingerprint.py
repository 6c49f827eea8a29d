"""What trials' results depend on, so that a file of other results is never gone on with."""

from __future__ import annotations

import hashlib
from pathlib import Path

from template_control.robot.biped import Biped

_PACKAGE = Path(__file__).resolve().parents[1]
_LETTERS = 10


def fingerprint(model: Biped, *trials: object) -> str:
    """Ten letters of a digest of this package's code, the robot's URDF and the trials.

    Args:
        model: the robot.
        trials: what else the results depend on; known by its ``repr``.
    """
    digest = hashlib.sha256(model.urdf.encode())
    for path in sorted(_PACKAGE.rglob("*.py")):
        digest.update(path.read_bytes())
    digest.update(repr(trials).encode())
    return digest.hexdigest()[:_LETTERS]
