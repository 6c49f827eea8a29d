"""Recorder of a run in progress; whatever was recorded can be had at any time."""

from __future__ import annotations

from dataclasses import fields
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.free.controller import FreeController
from template_control.errors import ParameterError
from template_control.run.record import FloatingRecord, Record
from template_control.slip.automaton.vocabulary import Leg
from template_control.whole_body.solver import Solution

Array = NDArray[np.float64]

_BLOCK = 1024  # ticks
# Columns of one or two numbers, and their widths.
_NUMBERS = {
    "time": 1,
    "angular_momentum": 1,
    "template_com": 2,
    "template_velocity": 2,
    "node": 1,
    "rear": 1,
    "solved": 1,
    "push": 1,
    "stands": 1,
    "interval": 1,
    "tick_seconds": 1,
    "solve_seconds": 1,
}
# Columns that no field of the record holds as they are.
_OTHERWISE = ("node", "rear", "solved", "stands", "interval", "tick_seconds", "solve_seconds")


class Truth(NamedTuple):
    """The robot and what acts on it at a tick.

    Attributes:
        time: [s].
        q: (nq,) true configuration.
        v: (nv,) true velocity.
        contact_force: (2, 2) the ground's force on each foot [N].
        push: disturbance on the trunk; of a free robot its size, negative backward [N].
    """

    time: float
    q: Array
    v: Array
    contact_force: Array
    push: float


class _Counted(NamedTuple):
    """Statistics over some ticks.

    Attributes:
        torque, speed: (nu,) largest size of each joint's torque and speed [N m, rad/s].
        torque_square: (nu,) sum of squares.
        work: of all joints, taken without its sign [J].
        saturated, failures: ticks with a torque at its limit, and without a solved QP.
        ticks: (2,) in stance, in flight.
        error: (2, 2) template less robot, in stance and in flight, x and y: largest [m].
        error_square: (2, 2) sum of squares.
    """

    torque: Array
    speed: Array
    torque_square: Array
    work: float
    saturated: int
    failures: int
    ticks: NDArray[np.int64]
    error: Array
    error_square: Array


def _count(block: dict[str, Array], speed: Array, torque_limit: Array) -> _Counted:
    """Statistics over the rows of a block, whose columns are given by name."""
    torque = block["torque"]
    size = np.abs(torque)
    errors, stands = block["template_com"] - block["com"], block["stands"][:, 0] > 0.0
    sorts = errors[stands], errors[~stands]
    return _Counted(
        torque=size.max(axis=0, initial=0.0),
        speed=np.abs(speed).max(axis=0, initial=0.0),
        torque_square=(torque * torque).sum(axis=0),
        work=float(np.abs(torque * speed).sum(axis=1) @ block["interval"][:, 0]),
        saturated=int((size >= 0.999 * torque_limit).any(axis=1).sum()),
        failures=int((block["solved"] == 0.0).sum()),
        ticks=np.array([len(some) for some in sorts]),
        error=np.array([np.abs(some).max(axis=0, initial=0.0) for some in sorts]),
        error_square=np.array([(some * some).sum(axis=0) for some in sorts]),
    )


def _together(counted: list[_Counted]) -> _Counted:
    """Statistics over all ticks of several blocks."""
    fields = dict(zip(_Counted._fields, map(np.array, zip(*counted, strict=True)), strict=True))
    largest = {name: fields.pop(name).max(axis=0) for name in ("torque", "speed", "error")}
    sums = {name: values.sum(axis=0) for name, values in fields.items()}
    return _Counted(**largest, **sums)


class Recorder:
    """Records a run in blocks of rows, one row for each tick.

    A tick only writes its row. Statistics, and the choice of the rows that are kept, wait until a
    block is full or somebody asks.

    Args:
        controller: whose references and steps are recorded.
        every: keep every n-th tick (timings and statistics use all of them).
    """

    def __init__(self, controller: EmbeddingController, every: int = 1) -> None:
        self.controller = controller
        self.every = every
        robot = controller.robot
        nu = len(robot.joint_names)
        # In the order in which a tick writes them; single numbers are written together.
        shapes: dict[str, tuple[int, ...]] = {
            "q": (robot.nq,),
            "v": (robot.nv,),
            "torque": (nu,),
            "com": (2,),
            "com_velocity": (2,),
            "foot": (2, 2),
            "contact_force": (2, 2),
            "template_force": (2, 2),
            "joint": (nu, 2),
            "swing_reference": (2, 2),
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
        *self._whole, self._joint, self._swing = self._arrays.values()
        self._block_start = 0  # tick of the block
        # By the block's first tick: closing it once more, after an interruption, changes nothing.
        self._kept: dict[int, Array] = {}
        self._clocks: dict[int, Array] = {}
        self._counted: dict[int, _Counted] = {}
        self._before = 0.0
        self._node_index = controller.supervisor.automaton.index
        self.ticks = 0

    def tick(self, true: Truth, solution: Solution, seconds: float) -> None:
        """Record one tick.

        Args:
            true: the robot as it is, without the noise of the sensors.
            solution: that the controller has just computed.
            seconds: wall-clock time of the controller's tick.
        """
        time, q, v, contact_force, push = true
        c, r = self.controller, self.controller.robot
        template_x, template_y = c.template_com
        feet, mode = c.feet.foot_of_leg, c.mode
        row = self.ticks - self._block_start
        self._numbers[row] = (
            time,
            r.angular_momentum,
            template_x,
            template_y,
            *c.frame.outward(c.path_clock.reference[2:4]).tolist(),
            self._node_index[c.node.name],
            feet[Leg.REAR],
            solution.solved,
            push,
            bool(mode.stance),
            time - self._before,
            seconds,
            solution.solve_seconds,
        )
        forces = contact_force, c.frame.outward(c.path_clock.forces)
        state = (q, v, solution.torque, r.com, r.com_velocity, r.foot_position, *forces)
        for column, value in zip(self._whole, state, strict=True):
            column[row] = value
        r.joint_positions(self._joint[row])
        swing = self._swing[row]
        swing[:] = np.nan
        for leg in mode.control.swings:
            swing[feet[leg]] = c.frame.world(c.references.foot[feet[leg], :, 0])
        self._before = time
        self.ticks += 1
        if self.ticks - self._block_start == _BLOCK:
            self._close_block()

    def _close_block(self) -> None:
        """Count the ticks of the block, keep its samples, and begin anew."""
        first = self._block_start
        block = self._block[: self.ticks - first]
        named = {name: block[:, columns] for name, columns in self._columns.items()}
        speed = named["v"][:, self.controller.robot.base_dof :]
        self._counted[first] = _count(named, speed, self.controller.qp.torque_limit)
        self._kept[first] = block[-first % self.every :: self.every].copy()
        self._clocks[first] = np.hstack((named["tick_seconds"], named["solve_seconds"]))
        self._block_start = self.ticks

    def summary(self) -> dict[str, Any]:
        """Statistics over all ticks, sampled or not."""
        self._close_block()
        robot, limits = self.controller.robot, self.controller.qp.torque_limit
        found = _together(list(self._counted.values()))
        ticks = max(self.ticks, 1)
        squares = found.error_square / np.maximum(found.ticks, 1)[:, None]
        (stance, flight), most = np.sqrt(squares).tolist(), found.error[0].tolist()
        rms = np.sqrt(found.torque_square / ticks).tolist()
        torques = zip(found.torque.tolist(), rms, limits.tolist(), strict=True)
        speeds = zip(found.speed.tolist(), robot.velocity_limit.tolist(), strict=True)
        return {
            "joint_torque": {
                name: dict(zip(("peak", "rms", "limit"), row, strict=True))
                for name, row in zip(robot.joint_names, torques, strict=True)
            },
            "joint_speed": {
                name: dict(zip(("peak", "limit"), row, strict=True))
                for name, row in zip(robot.joint_names, speeds, strict=True)
            },
            "joint_work": float(found.work),
            "saturated_share": float(found.saturated / ticks),
            "qp_failures": int(found.failures),
            "com_error_rms": dict(zip("xy", stance, strict=True)),
            "com_error_max": dict(zip("xy", most, strict=True)),
            "com_error_flight_rms": (
                dict(zip("xy", flight, strict=True)) if found.ticks[1] else None
            ),
        }

    def record(self, metadata: dict[str, Any]) -> Record:
        """The run so far."""
        self._close_block()
        table, clocks = (
            np.concatenate(list(parts.values())) for parts in (self._kept, self._clocks)
        )
        data = {name: table[:, columns].copy() for name, columns in self._columns.items()}
        for name in ("time", "angular_momentum", "node", "rear", "solved", "push"):
            data[name] = data[name][:, 0]
        for name, rows in self._arrays.items():
            data[name] = data[name].reshape(-1, *rows.shape[1:])
        reports = self.controller.reports
        sections, strides = self.section_names(), self.stride_names()
        return Record(
            **{k: x for k, x in data.items() if k not in _OTHERWISE},
            node=data["node"].astype(np.int64),
            rear=data["rear"].astype(np.int64),
            solved=data["solved"].astype(bool),
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
            metadata={**metadata, "sections": sections, "strides": strides},
        )

    def section_names(self) -> list[str]:
        """Sections of the run, each once."""
        return list(dict.fromkeys(r.section.name for r in self.controller.reports))

    def stride_names(self) -> list[str]:
        """Kinds of stride of the run, each once."""
        return list(dict.fromkeys(r.goal.stride for r in self.controller.reports))


_WIDTHS = {
    "space_com": (3,),
    "space_foot": (2, 3),
    "space_force": (2, 3),
    "attitude": (3,),
    "heading": (),
    "sway": (2,),
    "side_reference": (2,),
}


class FloatingRecorder(Recorder):
    """See :class:`~template_control.run.recorder.Recorder`.

    Args:
        controller: of a free robot.
        every: keep every n-th tick.

    Raises:
        ParameterError: if the controller is that of a planar robot.
    """

    def __init__(self, controller: EmbeddingController, every: int = 1) -> None:
        if not isinstance(controller, FreeController):
            raise ParameterError("a FloatingRecorder records a FreeController: give one")
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
        for leg in c.mode.control.swings:
            side[c.feet.foot_of_leg[leg]] = c.references.side[c.feet.foot_of_leg[leg], 0]
        sway = c.lateral_state() - (robot.space.foot[c.feet.foot_of_leg[Leg.REAR], 1], 0.0)
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

    def record(self, metadata: dict[str, Any]) -> FloatingRecord:
        """See :meth:`template_control.run.recorder.Recorder.record`."""
        planar = super().record(metadata)
        table, first = np.array(self._rows), 0
        found: dict[str, Any] = {}
        for name, shape in _WIDTHS.items():
            width = int(np.prod(shape))
            columns = table[:, first : first + width]
            found[name] = columns.reshape(len(table), *shape).copy()
            first += width
        return FloatingRecord(**{f.name: getattr(planar, f.name) for f in fields(Record)}, **found)
