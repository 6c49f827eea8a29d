"""Frame of a run that goes on: what a page shows of its last tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.robot.biped import leg_means
from template_control.run.record import Record
from template_control.view.replay.playback import CARRYING, force_arrows
from template_control.view.replay.scene import points

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Frame:
    """A moment of a run; x forward or as the world's, y to the left, z up [m].

    Attributes:
        q: (nq,) configuration.
        heading: of a floating-base robot [rad].
        com: (3,) of the robot.
        template: (3,) of the template.
        toes: (2, 3) of its rear and front leg.
        loaded: (2,) whether these push.
        foot: (n, 3) of each.
        stands: (n,) whether the ground carries it.
        arrow: (n, 3) the ground's force on it, drawn.
    """

    q: Array
    heading: float
    com: Array
    template: Array
    toes: Array
    loaded: NDArray[np.bool_]
    foot: Array
    stands: NDArray[np.bool_]
    arrow: Array


@dataclass(frozen=True)
class Body:
    """What all frames of a run have in common.

    Attributes:
        groups: contacts of each template leg.
        sides: (n,) how far to the left a planar robot's feet are [m].
        weight: [N].
        length: the template's rest length [m].
    """

    groups: tuple[tuple[int, ...], ...]
    sides: Array
    weight: float
    length: float

    @classmethod
    def of(cls, record: Record, sides: Array) -> Body:
        """That of a recorded run."""
        return cls(record.groups, sides, record.weight, float(record.template.rest_length))

    def frame(self, columns: Mapping[str, Any]) -> Frame:
        """The last of some ticks; ``columns`` are of :meth:`~.recorder.Recorder.latest`."""
        last = {name: values[-1:] for name, values in columns.items()}
        com, template, toes, foot, force = (found[0] for found in points(last, self.sides))
        rear = int(last["rear"][0])
        stands = last["contact_force"][0, :, 1] > CARRYING * self.weight
        pushes = np.linalg.norm(last["template_force"][0], axis=1) > CARRYING * self.weight
        return Frame(
            q=last["q"][0],
            heading=float(last["heading"][0]),
            com=com,
            template=template,
            toes=leg_means(toes, [self.groups[leg] for leg in (rear, 1 - rear)]),
            loaded=pushes,
            foot=foot,
            stands=stands,
            arrow=force_arrows(force, stands, self.weight, self.length),
        )
