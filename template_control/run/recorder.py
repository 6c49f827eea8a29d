"""Recorder of a controller's run, simulated or real; it can be asked at any time."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate, pairwise
from math import prod
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from template_control import structured
from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.ranges import Count
from template_control.compiled import compiled
from template_control.embedding.controller import EmbeddingController
from template_control.embedding.tick import SNAPSHOT, TICK, look
from template_control.errors import ParameterError
from template_control.robot.biped import Biped
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import load_robot
from template_control.robot.terms import LEGS, PATCH, UP
from template_control.run.metadata import about, outcome
from template_control.run.record import FloatingRecord, Record, SoleRecord
from template_control.run.statistics import Counts, Statistics, count, statistics
from template_control.run.tables import quantities
from template_control.warm_up import Part, ready
from template_control.whole_body.solver import Solution
from template_control.whole_body.task import References

_BLOCK = 1024  # ticks
_CLOCKS = ("tick_seconds", "solve_seconds")  # kept of all ticks
_KINDS = {"node": np.int64, "rear": np.int64, "solved": np.bool_}


# Columns of a row, in the order in which write_row fills them; a record has some of its own.
_ORDER = (
    *("time", "push", "interval", "tick_seconds", "solve_seconds", "solved", "heading"),
    *("q", "v", "torque", "joint", "foot", "contact_force", "com", "com_velocity"),
    *("angular_momentum", "node", "rear", "stands", "template_com", "template_velocity"),
    *("template_force", "swing_reference", "space_com", "space_foot", "space_force", "attitude"),
    *("sway", "side_reference", "sole_wrench"),
)
_HELPERS = ("interval", "heading", "stands")  # numbers that no planar record has


def _kind_of(robot: Biped) -> type[Record]:
    """Kind of a robot's record."""
    if robot.patches:
        return SoleRecord
    return FloatingRecord if isinstance(robot, FloatingBaseBiped) else Record


def _columns(robot: Biped) -> dict[str, tuple[int, ...]]:
    """Shapes of the columns of a robot's rows, in their order."""
    nu, contacts = len(robot.joint_names), len(robot.feet)
    sizes = {"nq": robot.nq, "nv": robot.nv, "nu": nu, "n": contacts}
    layouts = {name: of.layout.split() for name, of in quantities(_kind_of(robot)).items()}
    return {
        name: tuple(
            sizes.get(axis) or int(axis) for axis in layouts.get(name, "T")[1:] if axis[0] != "<"
        )
        for name in _ORDER
        if name in (*layouts, *_HELPERS)
    }


@compiled
def _put(row: Array, at: int, values: Array) -> int:
    """Write some numbers into a row from a place on; the place after them."""
    for value in values:
        row[at] = value
        at += 1
    return at


@compiled
def write_row(
    kept: Any,
    row: Array,
    numbers: tuple[float, ...],
    state: tuple[Array, Array, Array, Array],
    looks: bool,
) -> None:
    """Write the row of a tick, of :func:`_columns`; ``numbers`` are the first seven.

    ``kept`` is a :class:`.Kept` of the controller's ``memory``, the robot's ``joint_places`` and
    ``heading_frame``, and (1,) of ``SNAPSHOT``, which is of this tick, unless it ``looks`` first.
    ``state`` are q, v, torques, and the ground's forces in the world (n, d) [N], of soles (n, 6)
    with their moments about its origin [N m].
    """
    memory, (joints, frame), seen = kept.value
    if looks:
        look(*memory, seen)
    (q, v, torque, force), r, s, at = state, memory[1][0], seen[0], 0
    x, y, c, sine = frame[0], frame[1], frame[2], frame[3]
    for number in numbers:
        row[at] = number
        at += 1
    at = _put(row, _put(row, _put(row, at, q), v), torque)
    for i in range(joints.shape[0]):
        row[at] = c * (joints[i, 0] - x) + sine * (joints[i, 1] - y)
        row[at + 1] = joints[i, UP]
        at += 2
    contacts, up = force.shape[0], min(force.shape[1], UP + 1) - 1
    for i in range(contacts):
        row[at], row[at + 1] = r.contact_position[i, 0], r.contact_position[i, UP]
        row[at + 2 * contacts], row[at + 2 * contacts + 1] = force[i, 0], force[i, up]
        if up == UP:
            row[at + 2 * contacts] = c * force[i, 0] + sine * force[i, 1]
        at += 2
    at += 2 * contacts
    row[at], row[at + 1] = r.com[0], r.com[UP]
    row[at + 2], row[at + 3] = r.com_velocity[0], r.com_velocity[UP]
    row[at + 4], row[at + 5], row[at + 6], row[at + 7] = r.momentum[1], s.node, s.rear, s.stands
    at = _put(row, _put(row, at + 8, s.template_com), s.template_velocity)
    for leg in range(LEGS):
        at = _put(row, at, s.template_force[leg])
    for leg in range(LEGS):
        at = _put(row, at, s.swing_reference[leg])
    if up < UP:
        return
    at = _to_world(frame, r.com, row, at)
    for i in range(contacts):
        at = _to_world(frame, r.contact_position[i], row, at)
    for i in range(contacts):
        at = _put(row, at, force[i, : UP + 1])
    at = _put(row, _put(row, _put(row, at, r.attitude), s.sway), s.side_reference)
    for i in range(contacts if force.shape[1] == PATCH else 0):
        _write_wrench(r, i, force[i], frame, row[at : at + PATCH])
        at += PATCH


@compiled
def _write_wrench(r: Any, patch: int, force: Array, frame: Array, out: Array) -> None:
    """Write a sole's (6,) force in the world in its own axes, about its toe [N, N m]."""
    c, sine, toe, heading = frame[2], frame[3], np.empty(3), np.empty(PATCH)
    _to_world(frame, r.contact_position[patch], toe, 0)
    moment = force[3:] - np.cross(toe, force[:3])
    for half, part in enumerate((force[:3], moment)):
        heading[3 * half] = c * part[0] + sine * part[1]
        heading[3 * half + 1] = c * part[1] - sine * part[0]
        heading[3 * half + 2] = part[2]
        for k in range(3):
            out[3 * half + k] = 0.0
            for i in range(3):
                out[3 * half + k] += r.contact_axes[patch, i, k] * heading[3 * half + i]


@compiled
def _to_world(frame: Array, point: Array, row: Array, at: int) -> int:
    """Write a point (3,) of the heading frame in the world [m]; the place after it."""
    x, y, c, s = frame[0], frame[1], frame[2], frame[3]
    row[at] = x + c * point[0] - s * point[1]
    row[at + 1] = y + s * point[0] + c * point[1]
    row[at + 2] = point[2]
    return at + 3


def record_row() -> None:
    """A row of the record."""
    robot, tick, seen = load_robot("five-link"), np.zeros(1, TICK), np.zeros(1, SNAPSHOT)
    memory, views = (tick, robot.data, References().data), (robot.joint_places, robot.heading_frame)
    look(*memory, seen)
    row = np.zeros(sum(map(prod, _columns(robot).values())))
    state = robot.neutral(), np.zeros(robot.nv), np.zeros(len(robot.joint_names)), np.zeros((2, 2))
    write_row(structured.keep((memory, views, seen)), row, (0.0,) * 7, state, True)


RECORD = (Part(record_row, 2.0),)  # compiled functions of a recorder


class _Block(NamedTuple):
    """What is kept of a block of ticks; ``start`` is the time of its first one [s]."""

    samples: Array
    clocks: Array
    counts: Counts
    start: float


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
        keep: forget ticks when so many later ones, and a block of 1024, are recorded; None: none.

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
        keep: Count | None = None,
    ) -> None:
        if not controller.reports:
            raise ParameterError("a Recorder records a controller that has started: start it first")
        self.controller, self.every = controller, every
        robot = controller.robot
        self._floating = robot if isinstance(robot, FloatingBaseBiped) else None
        ready(RECORD)
        self._shapes = _columns(robot)
        *self._ends, width = accumulate(map(prod, self._shapes.values()))
        self._keep = keep
        self._block, self._full = np.empty((2, _BLOCK, width))
        self._rows = 0  # of the block that is full
        self._seen = np.zeros(1, SNAPSHOT)
        views = robot.joint_places, robot.heading_frame
        self._kept = structured.keep((controller.memory, views, self._seen))
        self._block_start = 0  # tick of the block
        # By the block's first tick: closing it once more, after an interruption, changes nothing.
        self._blocks: dict[int, _Block] = {}
        self._first = self._before = self._begins = controller.time  # [s]
        self._step = 0.0  # of the last tick [s]
        self.ticks = self._forgotten = 0
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
                where nobody knows it. Of soles (n, 6), as plants give it.
            solution: that the controller has just computed.
            time: of the tick [s]; None: the controller's.
            push: disturbance on the trunk; of a free robot its size, negative backward [N].
            seconds: wall-clock time of the controller's tick.
        """
        c, (seen_q, seen_v) = self.controller, self.controller.frame.raw_state
        force, torque = np.ascontiguousarray(force, dtype=np.float64), solution.torque
        known = q is seen_q and v is seen_v
        if not known:
            q, v = (np.ascontiguousarray(values, dtype=np.float64) for values in (q, v))
            known = np.array_equal(q, seen_q) and np.array_equal(v, seen_v)
        known = known and c.frame.of_world
        if not known:
            look(*c.memory, self._seen)  # before the model is updated
            self._update_in_world(q, v)
        after = c.time
        now = self._begins if time is None else time
        self._step, self._begins = after - self._begins, after
        if not self.ticks:
            self._first = self._before = now
        row, interval = self._block[self.ticks - self._block_start], now - self._before
        clocks = float(seconds), solution.solve_seconds
        heading = 0.0 if self._floating is None else self._floating.heading + self._floating.facing
        numbers = float(now), float(push), interval, *clocks, float(solution.solved), heading
        write_row(self._kept, row, numbers, (q, v, torque, force), known)
        self._before = now
        self.ticks += 1
        if self.ticks - self._block_start == _BLOCK:
            self._close_block()

    def _update_in_world(self, q: Array, v: Array) -> None:
        """Update the robot; the terms of a planar one are the world's, wherever it goes."""
        robot = self.controller.robot
        facing = robot.facing
        if self._floating is None:
            robot.facing = 0.0
        robot.update(q, v)
        robot.facing = facing

    def _close_block(self) -> None:
        """Count the ticks of the block, keep its samples, and begin anew."""
        first = self._block_start
        if first == self.ticks and self._blocks:
            return
        rows = self._block[: self.ticks - first]
        named = self._named(rows)
        self._blocks[first] = _Block(
            samples=rows[-first % self.every :: self.every].copy(),
            clocks=np.column_stack([named[name] for name in _CLOCKS]),
            counts=count(named, self.controller.qp.torque_limit),
            start=float(rows[0, 0]) if len(rows) else self._first,
        )
        self._block_start = self.ticks
        self._block, self._full, self._rows = self._full, self._block, len(rows)
        if self._keep is not None:
            self._forget(self.ticks - self._keep)

    def _forget(self, tick: int) -> None:
        """Forget the blocks that end before a tick."""
        for first, after in pairwise(list(self._blocks)):
            if after > tick:
                break
            del self._blocks[first]
            self._forgotten, self._first = after, self._blocks[after].start

    def _named(self, rows: Array) -> dict[str, Array]:
        """Columns of some rows by their names, each in its shape."""
        columns = zip(self._shapes.items(), np.split(rows, self._ends, axis=1), strict=True)
        return {name: values.reshape(-1, *shape) for (name, shape), values in columns}

    def latest(self, count: int) -> dict[str, Array]:
        """The last ``count`` ticks, sampled or not, as the record's fields name their columns.

        They are 1024 at most; there may be fewer.
        """
        rows = self._block[: self.ticks - self._block_start][-count:]
        if len(rows) < count:
            rows = np.concatenate((self._full[: self._rows][len(rows) - count :], rows))
        return self._named(rows)

    def statistics(self) -> Statistics:
        """Statistics over all ticks, sampled or not."""
        self._close_block()
        counts = [block.counts for block in self._blocks.values()]
        return statistics(counts, self.controller.robot, self.controller.qp.torque_limit)

    def record(
        self, fall_reason: str = "", *, interrupted: bool = False, error: str = ""
    ) -> Record:
        """The run so far.

        Arguments as for :class:`~.facts.Facts`; the error is on one line.
        """
        self._close_block()
        kind = _kind_of(self.controller.robot)
        blocks = self._blocks.values()
        table = np.concatenate([block.samples for block in blocks])
        clocks = np.concatenate([block.clocks for block in blocks])
        fields = kind.__dataclass_fields__
        data: dict[str, Any] = {
            name: values.astype(_KINDS.get(name, float))
            for name, values in self._named(table).items()
            if name in fields and name not in _CLOCKS
        }
        c, reports = self.controller, self.controller.reports
        if self._forgotten:
            reports = [r for r in reports if r.time >= self._first] or reports[-1:]
        sections = list(dict.fromkeys(r.section.name for r in reports))
        strides = list(dict.fromkeys(r.goal.stride for r in reports))
        courses = c.courses[-len(reports) :]
        metadata = {
            **self._about,
            **outcome(c, self.statistics()),
            "fall_reason": fall_reason,
            "interrupted": interrupted,
            "error": error,
            "wall_seconds": perf_counter() - self._begun,
            "duration": round(self._before + self._step - self._first, 9),
            "ticks": self.ticks - self._forgotten,
            "sections": sections,
            "strides": strides,
            "courses": [
                [r.goal.wanted_speed + (r.accepted - float(r.target[0])), *course]
                for r, course in zip(reports, courses, strict=True)
            ],
        }
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
