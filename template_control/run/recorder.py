"""Recorder of a controller's run, simulated or real; it can be asked at any time."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.checks.ranges import Count
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.state import FloatingSnapshot
from template_control.errors import ParameterError
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.terms import LEGS
from template_control.run.metadata import about, outcome
from template_control.run.record import FloatingRecord, Record
from template_control.run.statistics import Counts, Statistics, count, statistics
from template_control.whole_body.solver import Solution

Array = NDArray[np.float64]

_BLOCK = 1024  # ticks
# Columns of one or two numbers, and their widths.
_NUMBERS = {
    "time": 1,
    "angular_momentum": 1,
    "node": 1,
    "rear": 1,
    "solved": 1,
    "push": 1,
    "stands": 1,
    "interval": 1,
    "tick_seconds": 1,
    "solve_seconds": 1,
}
# Of these, what no field of the record holds.
_OTHERWISE = ("stands", "interval", "tick_seconds", "solve_seconds")
_KINDS = {"node": np.int64, "rear": np.int64, "solved": np.bool_}


class Recorder:
    """Records a controller's run in blocks of rows, one row for each tick.

    A tick only writes its row. Statistics, and the choice of the rows that are kept, wait until a
    block is full or somebody asks::

        recorder = Recorder(controller)  # which has started
        ...
        solution = controller.tick(q, v, contact, dt, force)
        recorder.tick(q, v, force, solution)
        ...
        record = recorder.record()

    Args:
        controller: whose ticks are recorded; it has started.
        every: keep every n-th tick (timings and statistics use all of them).
        conditions: plain data for the record's metadata, such as ``plant``, the world's name.

    Raises:
        ParameterError: if the controller has not started.

    Attributes:
        controller: whose ticks are recorded.
        ticks: recorded so far.
    """

    @checked
    def __init__(
        self,
        controller: EmbeddingController,
        every: Count = 1,
        conditions: Mapping[str, Any] | None = None,
    ) -> None:
        if not controller.reports:
            raise ParameterError("a Recorder records a controller that has started: start it first")
        self.controller, self.every = controller, every
        robot = controller.robot
        self._floating = robot if isinstance(robot, FloatingBaseBiped) else None
        nu, contacts = len(robot.joint_names), len(robot.feet)
        # In the order in which a tick writes them; single numbers are written together.
        shapes: dict[str, tuple[int, ...]] = {
            "q": (robot.nq,),
            "v": (robot.nv,),
            "torque": (nu,),
            "com": (2,),
            "com_velocity": (2,),
            "foot": (contacts, 2),
            "contact_force": (contacts, 2),
            "template_com": (2,),
            "template_velocity": (2,),
            "template_force": (LEGS, 2),
            "swing_reference": (LEGS, 2),
            "joint": (nu, 2),
        }
        if self._floating is not None:
            shapes |= {
                "space_com": (3,),
                "space_foot": (contacts, 3),
                "space_force": (contacts, 3),
                "attitude": (3,),
                "heading": (),
                "sway": (2,),
                "side_reference": (LEGS,),
            }
        widths = {**_NUMBERS, **{name: prod(shape) for name, shape in shapes.items()}}
        ends = np.cumsum(list(widths.values()))
        starts = ends - list(widths.values())
        self._columns = {
            name: slice(int(a), int(b)) for name, a, b in zip(widths, starts, ends, strict=True)
        }
        self._block = np.empty((_BLOCK, int(ends[-1])))
        self._numbers = self._block[:, : self._columns["q"].start]
        self._arrays = {
            name: self._block[:, self._columns[name]].reshape(_BLOCK, *shape)
            for name, shape in shapes.items()
        }
        self._written = [array for name, array in self._arrays.items() if name != "joint"]
        self._block_start = 0  # tick of the block
        # By the block's first tick: closing it once more, after an interruption, changes nothing.
        self._kept: dict[int, Array] = {}
        self._clocks: dict[int, Array] = {}
        self._counted: dict[int, Counts] = {}
        self._first = self._before = self._begins = controller.time  # [s]
        self._step = 0.0  # of the last tick [s]
        self._node_index = controller.supervisor.automaton.index
        self.ticks = 0
        # Before the run, which would be lost if this failed after it.
        self._about = {**about(controller), **(conditions or {})}
        self._begun = perf_counter()

    def tick(
        self,
        q: Array,
        v: Array,
        force: Array,
        solution: Solution,
        *,
        time: float | None = None,
        push: float = 0.0,
        seconds: float = 0.0,
    ) -> None:
        """Record one tick, after the controller's.

        Where ``q`` and ``v`` are not what the controller was given, the robot's model is updated
        with them: what is recorded is true, and in the world's axes.

        Args:
            q: (nq,) configuration, without the noise of the sensors where that is known.
            v: (nv,) velocity.
            force: (n, d) the ground's force on each contact, forward first and up last [N]; NaN
                where nobody knows it.
            solution: that the controller has just computed.
            time: of the tick [s]; None: the controller's.
            push: disturbance on the trunk; of a free robot its size, negative backward [N].
            seconds: wall-clock time of the controller's tick.
        """
        c, robot, s = self.controller, self.controller.robot, self.controller.snapshot()
        seen = c.ground.raw_state
        if c.frame.angle != 0.0 or not (np.array_equal(q, seen[0]) and np.array_equal(v, seen[1])):
            robot.update(q, v)
        now = self._begins if time is None else time
        self._step, self._begins = s.time - self._begins, s.time
        if not self.ticks:
            self._first = self._before = now
        row = self.ticks - self._block_start
        self._numbers[row] = (
            now,
            robot.angular_momentum,
            self._node_index[s.node],
            s.rear,
            solution.solved,
            push,
            s.stands,
            now - self._before,
            seconds,
            solution.solve_seconds,
        )
        floating, more = self._floating, ()
        if floating is not None and isinstance(s, FloatingSnapshot):
            more = _in_space(floating, s, force)
            cosine, sine = np.cos(floating.heading), np.sin(floating.heading)
            force = np.column_stack((cosine * force[:, 0] + sine * force[:, 1], force[:, 2]))
        places = robot.contact_position[:, :: robot.directions - 1]
        planar = (q, v, solution.torque, robot.com, robot.com_velocity, places, force)
        template = s.template_com, s.template_velocity, s.template_force, s.swing_reference
        for column, value in zip(self._written, (*planar, *template, *more), strict=True):
            column[row] = value
        robot.joint_positions(self._arrays["joint"][row])
        self._before = now
        self.ticks += 1
        if self.ticks - self._block_start == _BLOCK:
            self._close_block()

    def _close_block(self) -> None:
        """Count the ticks of the block, keep its samples, and begin anew."""
        first = self._block_start
        block = self._block[: self.ticks - first]
        named = {name: block[:, columns] for name, columns in self._columns.items()}
        self._counted[first] = count(named, self.controller.qp.torque_limit)
        self._kept[first] = block[-first % self.every :: self.every].copy()
        self._clocks[first] = np.hstack((named["tick_seconds"], named["solve_seconds"]))
        self._block_start = self.ticks

    def statistics(self) -> Statistics:
        """Statistics over all ticks, sampled or not."""
        self._close_block()
        limits = self.controller.qp.torque_limit
        return statistics(list(self._counted.values()), self.controller.robot, limits)

    def record(
        self, fall_reason: str = "", *, interrupted: bool = False, error: str = ""
    ) -> Record:
        """The run so far.

        Args:
            fall_reason: why the robot fell; "" where it did not.
            interrupted: whether Ctrl-C ended the run.
            error: that ended it, on one line.
        """
        self._close_block()
        table, clocks = (
            np.concatenate(list(parts.values())) for parts in (self._kept, self._clocks)
        )
        data: dict[str, Any] = {}
        for name, columns in self._columns.items():
            if name not in _OTHERWISE:
                shape = self._arrays[name].shape[1:] if name in self._arrays else ()
                data[name] = table[:, columns].reshape(-1, *shape).astype(_KINDS.get(name, float))
        c, reports = self.controller, self.controller.reports
        sections = list(dict.fromkeys(r.section.name for r in reports))
        strides = list(dict.fromkeys(r.goal.stride for r in reports))
        metadata = {
            **self._about,
            **outcome(c, self.statistics()),
            "fall_reason": fall_reason,
            "interrupted": interrupted,
            "error": error,
            "wall_seconds": perf_counter() - self._begun,
            "duration": round(self._before + self._step - self._first, 9),
            "ticks": self.ticks,
            "sections": sections,
            "strides": strides,
        }
        kind = FloatingRecord if self._floating is not None else Record
        return kind(
            **data,
            section=np.array([sections.index(r.section.name) for r in reports], dtype=np.int64),
            section_time=np.array([r.time for r in reports]),
            section_state=np.array([r.state for r in reports]),
            stride=np.array([strides.index(r.goal.stride) for r in reports], dtype=np.int64),
            section_target=np.array([r.target for r in reports]),
            section_accepted=np.array([r.accepted for r in reports]),
            section_predicted=np.array([r.decision.predicted for r in reports]),
            section_controls=np.array([r.decision.controls for r in reports]),
            section_offset=np.array([r.offset for r in reports]),
            section_nominal=np.array([r.decision.nominal for r in reports]),
            section_feasible=np.array([r.decision.feasible for r in reports]),
            section_load=np.array([r.estimators.load for r in reports]),
            section_trim=np.array([r.estimators.trim for r in reports]),
            tick_seconds=clocks[:, 0].copy(),
            solve_seconds=clocks[:, 1].copy(),
            plan_seconds=np.array([r.plan_seconds for r in reports]),
            metadata=metadata,
        )


def _in_space(robot: FloatingBaseBiped, s: FloatingSnapshot, force: Array) -> tuple[Any, ...]:
    """Columns that only a floating-base robot has, in their order."""
    space = robot.space
    feet = robot.to_world(space.contact)
    angles = robot.roll_pitch_yaw()
    return robot.to_world(space.com), feet, force, angles, robot.heading, s.sway, s.side_reference
