"""A recorded run of a free robot: that of its (x, z) view, and what is beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from template_control import storage
from template_control.checks.checked import checked
from template_control.run.record import LAYOUT, Record

Array = NDArray[np.float64]

FORMAT = "template-control free run 1"
_LAYOUT = storage.Layout(
    fields={
        **LAYOUT.fields,
        "q": "T nq",
        "space_com": "T 3",
        "space_foot": "T 2 3",
        "space_force": "T 2 3",
        "attitude": "T 3",
        "heading": "T",
        "sway": "T 2",
        "side_reference": "T 2",
    },
    metadata=LAYOUT.metadata,
)


@dataclass(frozen=True, repr=False)
class FreeRecord(Record):
    """A run of a robot that nothing holds.

    The fields of :class:`~template_control.run.record.Record` are those of its view in the heading
    frame: x there is the way walked, as the frame turns about the stance foot. ``q`` and ``v`` are
    Pinocchio's of a free flyer.

    Attributes:
        space_com: (T, 3) of the CoM in the world, x, y to the left, z up [m].
        space_foot: (T, 2, 3) lowest points of the feet in the world [m].
        space_force: (T, 2, 3) the ground's force on each foot in the world [N].
        attitude: (T, 3) roll, pitch and yaw of the trunk in the heading frame [rad].
        heading: (T,) angle from the world's x to the heading frame's [rad].
        sway: (T, 2) y of the CoM from the rear foot and dy/dt, in the heading frame; dy/dt has the
            angular momentum about the CoM as ``section_state`` has it [m, m/s].
        side_reference: (T, 2) y of each foot's reference in the heading frame, NaN where it has
            none [m].
    """

    layout: ClassVar[storage.Layout] = _LAYOUT

    space_com: Array
    space_foot: Array
    space_force: Array
    attitude: Array
    heading: Array
    sway: Array
    side_reference: Array

    @checked
    def save(self, path: str | Path) -> Path:
        """See :meth:`template_control.run.record.Record.save`."""
        return storage.save(self, path, FORMAT, quick=bool(self.metadata.get("interrupted")))

    @classmethod
    @checked
    def load(cls, path: str | Path) -> FreeRecord:
        """See :meth:`template_control.run.record.Record.load`."""
        return storage.load(cls, path, FORMAT, cls.layout)
