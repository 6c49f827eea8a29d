"""Figures that a page plots of a run that goes on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from template_control.run.live import Tick
from template_control.run.record import Record

Array = NDArray[np.float64]
Columns = Mapping[str, Array]


class Figures:
    """Torques and forces of some ticks; ``record`` is of the run so far."""

    def __init__(self, record: Record) -> None:
        self._weight = record.weight
        self._limit = np.asarray(record.torque_limit)
        legs = record.legs
        self._joints = [[i for foot in group for i in legs[foot]] for group in record.groups]

    def of(self, columns: Columns) -> tuple[float, float, float, float]:
        """Figures of some ticks, whose ``columns`` are of :meth:`~.Recorder.latest`.

        Returns:
            Largest torque over its limit in each template leg, and mean vertical force of the
            ground and of the template over the weight.
        """
        share = np.abs(columns["torque"]).max(axis=0) / self._limit
        left, right = (float(share[joints].max()) for joints in self._joints)
        ground = columns["contact_force"][..., 1].sum(axis=1).mean() / self._weight
        template = columns["template_force"][..., 1].sum(axis=1).mean() / self._weight
        return left, right, float(ground), float(template)


@dataclass(frozen=True)
class Step:
    """Mean speed of the last step.

    Attributes:
        number: steps that are done.
        speed: of the last one, along the heading [m/s].
        began: when the present step was seen first [s], and x and y of the CoM then [m]; None
            where no step was seen to begin.
    """

    number: int
    speed: float
    began: tuple[float, float, float] | None

    def after(self, tick: Tick, columns: Columns) -> Step:
        """The same after some more ticks, of which ``tick`` and the ``columns`` end the last."""
        if tick.steps == self.number:
            return self
        com = columns["space_com" if "space_com" in columns else "com"][-1]
        x, y = float(com[0]), float(com[1]) if len(com) > 2 else 0.0
        speed, heading = self.speed, float(columns["heading"][-1])
        if self.began is not None and tick.time > self.began[0]:
            time, x_before, y_before = self.began
            ahead = cos(heading) * (x - x_before) + sin(heading) * (y - y_before)
            speed = ahead / (tick.time - time)
        return Step(tick.steps, speed, (tick.time, x, y))
