"""Collects a run of a free robot: its (x, z) view as any robot's, and beside it the rest."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.controller import FreeController
from template_control.errors import ParameterError
from template_control.run.kinds.free_record import FreeRecord
from template_control.run.record import Record
from template_control.run.recorder import Recorder, Truth
from template_control.slip.automaton.vocabulary import Leg
from template_control.whole_body.solver import Solution

Array = NDArray[np.float64]

_WIDTHS = {
    "space_com": (3,),
    "space_foot": (2, 3),
    "space_force": (2, 3),
    "attitude": (3,),
    "heading": (),
    "sway": (2,),
    "side_reference": (2,),
}


class FreeRecorder(Recorder):
    """See :class:`~template_control.run.recorder.Recorder`.

    Args:
        controller: of a free robot.
        every: keep every n-th tick.

    Raises:
        ParameterError: if the controller is that of a planar robot.
    """

    def __init__(self, controller: EmbeddingController, every: int = 1) -> None:
        if not isinstance(controller, FreeController):
            raise ParameterError("a FreeRecorder records a FreeController: give one")
        super().__init__(controller, every)
        self._free = controller
        self._rows: list[Array] = []
        self._first = controller.robot.nq - len(controller.robot.joint_names)
        self._least = np.full(len(controller.robot.joint_names), np.inf)
        self._most = -self._least

    def tick(self, true: Truth, solution: Solution, seconds: float) -> None:
        """See :meth:`template_control.run.recorder.Recorder.tick`."""
        c, robot = self._free, self._free.robot
        sampled = self.ticks % self.every == 0
        angles = true.q[self._first :]
        np.minimum(self._least, angles, out=self._least)
        np.maximum(self._most, angles, out=self._most)
        cosine, sine = np.cos(robot.heading), np.sin(robot.heading)
        world = true.contact_force
        planar = np.column_stack((cosine * world[:, 0] + sine * world[:, 1], world[:, 2]))
        super().tick(true._replace(contact_force=planar), solution, seconds)
        if not sampled:
            return
        side = np.full(2, np.nan)
        for leg in c.station.control.swings:
            side[c.feet.of[leg]] = c.references.side[c.feet.of[leg], 0]
        sway = c.sway() - (robot.space.foot[c.feet.of[Leg.REAR], 1], 0.0)
        feet = robot.to_world(robot.space.foot)
        parts = (robot.to_world(robot.space.com), feet, world, robot.roll_pitch_yaw())
        row = np.concatenate((*parts, robot.heading, sway, side), axis=None)
        self._rows.append(row)

    def summary(self) -> dict[str, Any]:
        """See :meth:`template_control.run.recorder.Recorder.summary`; and the joints' angles."""
        robot = self._free.robot
        rows = np.column_stack((self._least, self._most, robot.joint_range)).tolist()
        return {
            **super().summary(),
            "joint_angle": {
                name: dict(zip(("least", "most", "lower", "upper"), row, strict=True))
                for name, row in zip(robot.joint_names, rows, strict=True)
            },
        }

    def record(self, metadata: dict[str, Any]) -> FreeRecord:
        """See :meth:`template_control.run.recorder.Recorder.record`."""
        planar = super().record(metadata)
        table, first = np.array(self._rows), 0
        found: dict[str, Any] = {}
        for name, shape in _WIDTHS.items():
            width = int(np.prod(shape))
            columns = table[:, first : first + width]
            found[name] = columns.reshape(len(table), *shape).copy()
            first += width
        return FreeRecord(**{f.name: getattr(planar, f.name) for f in fields(Record)}, **found)
