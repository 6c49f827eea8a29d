"""The compiled code of a free robot's tick, beside that of any robot's."""

from __future__ import annotations

import numpy as np

from template_control.slip.lateral.placing import LATERAL
from template_control.warm_up import Part
from template_control.whole_body.tasks import follow_foot


def foot_in_plane() -> None:
    """A foot's rows, of arrays that are parts of those in space: every second of their numbers."""
    places, jacobian = np.zeros((2, 3))[:, ::2], np.zeros((2, 3, 2))[:, ::2]
    wish = np.zeros((2, 2, 3)), np.zeros(2)
    feels = places, places, jacobian, places
    follow_foot(0, feels, wish, 0.0, (1.0,) * 4, np.zeros((2, 5)))


FREE = (*LATERAL, Part(foot_in_plane, 0.3))
"""What a tick of a free robot's controller calls, and its planner aside."""
