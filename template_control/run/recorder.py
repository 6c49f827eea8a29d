"""Collects a run while it goes on; whatever was recorded can be had at any time."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.controller import EmbeddingController
from template_control.run.record import Record
from template_control.slip.automaton.vocabulary import Leg
from template_control.whole_body.solver import Solution

Array = NDArray[np.float64]

_FIRST_CAPACITY = 4096


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


class _Errors:
    """Template less robot, over the ticks of one sort [m]."""

    def __init__(self) -> None:
        self.ticks = 0
        self._squares = [0.0, 0.0]
        self._most = [0.0, 0.0]

    def add(self, x: float, y: float) -> None:
        self.ticks += 1
        for axis, error in enumerate((x, y)):
            self._squares[axis] += error * error
            self._most[axis] = max(self._most[axis], abs(error))

    @property
    def rms(self) -> dict[str, float]:
        x, y = (sqrt(square / max(self.ticks, 1)) for square in self._squares)
        return {"x": x, "y": y}

    @property
    def most(self) -> dict[str, float]:
        return {"x": float(self._most[0]), "y": float(self._most[1])}


class Recorder:
    """Records a run in a table, one row for each sample, that grows by doubling.

    Args:
        controller: whose references and steps are recorded.
        every: keep every n-th tick (timings and statistics use all of them).
    """

    def __init__(self, controller: EmbeddingController, every: int = 1) -> None:
        self.controller = controller
        self.every = every
        robot = controller.robot
        nu = len(robot.joint_names)
        widths = {
            # Single numbers first: they are written together, and so are the arrays.
            "time": 1,
            "angular_momentum": 1,
            "template_com": 2,
            "template_velocity": 2,
            "node": 1,
            "rear": 1,
            "solved": 1,
            "push": 1,
            "q": robot.nq,
            "v": robot.nv,
            "torque": nu,
            "com": 2,
            "com_velocity": 2,
            "foot": 4,
            "joint": 2 * nu,
            "contact_force": 4,
            "template_force": 4,
            "swing_reference": 4,
        }
        ends = np.cumsum(list(widths.values()))
        starts = ends - list(widths.values())
        self._numbers = int(starts[list(widths).index("q")])
        self._columns = {
            name: slice(int(a), int(b)) for name, a, b in zip(widths, starts, ends, strict=True)
        }
        self._table = np.empty((_FIRST_CAPACITY, int(ends[-1])))
        self._times = np.empty((_FIRST_CAPACITY, 2))
        self._joint = np.zeros((nu, 2))
        self._swing = np.empty((2, 2))
        self._node_index = controller.planning.automaton.index
        self.rows = 0
        self.ticks = 0
        self.peak_torque = np.zeros(nu)
        self.peak_speed = np.zeros(nu)
        self._work = 0.0
        self._before = 0.0
        self._torque_square = np.zeros(nu)
        self._errors = {"stance": _Errors(), "flight": _Errors()}
        self._nearly = 0.999 * controller.qp.torque_limit
        self.saturated = 0
        self.failures = 0

    def tick(self, true: Truth, solution: Solution, seconds: float) -> None:
        """Record one tick.

        Args:
            true: the robot as it is, without the noise of the sensors.
            solution: that the controller has just computed.
            seconds: wall-clock time of the controller's tick.
        """
        time, q, v, contact_force, push = true
        c, r = self.controller, self.controller.robot
        torque = solution.torque
        size = np.abs(torque)
        np.maximum(self.peak_torque, size, out=self.peak_torque)
        self._torque_square += torque * torque
        speed = v[r.base_dof :]
        np.maximum(self.peak_speed, np.abs(speed), out=self.peak_speed)
        self._work += float(np.abs(torque * speed).sum()) * (time - self._before)
        self._before = time
        self.saturated += bool((size >= self._nearly).any())
        self.failures += not solution.solved
        template_x, template_y = c.template_com
        x, y = r.com.tolist()
        self._errors["stance" if c.station.stance else "flight"].add(template_x - x, template_y - y)
        if self.ticks == len(self._times):
            self._times = np.concatenate((self._times, np.empty_like(self._times)))
        self._times[self.ticks] = seconds, solution.solve_seconds
        if self.ticks % self.every == 0:
            if self.rows == len(self._table):
                self._table = np.concatenate((self._table, np.empty_like(self._table)))
            r.joint_positions(self._joint)
            swing = self._swing
            swing[:] = np.nan
            for leg in c.station.control.swings:
                swing[c.feet.of[leg]] = c.wanted.foot[c.feet.of[leg], :, 0]
            row, numbers = self._table[self.rows], self._numbers
            row[:numbers] = (
                time,
                r.angular_momentum,
                template_x,
                template_y,
                c.reference[2],
                c.reference[3],
                self._node_index[c.node.name],
                c.feet.of[Leg.REAR],
                solution.solved,
                push,
            )
            state = (q, v, torque, r.com, r.com_velocity, r.foot_position, self._joint)
            forces = (contact_force, c.template_forces, swing)
            np.concatenate((*state, *forces), axis=None, out=row[numbers:])
            self.rows += 1
        self.ticks += 1

    def summary(self) -> dict[str, Any]:
        """Statistics over all ticks, sampled or not."""
        names = self.controller.robot.joint_names
        rms = np.sqrt(self._torque_square / max(self.ticks, 1)).tolist()
        limit = self.controller.qp.torque_limit
        stance, flight = self._errors["stance"], self._errors["flight"]
        return {
            "joint_torque": {
                name: {"peak": float(p), "rms": t, "limit": float(lim)}
                for name, p, t, lim in zip(names, self.peak_torque, rms, limit, strict=True)
            },
            "joint_speed": {
                name: {"peak": float(p), "limit": float(lim)}
                for name, p, lim in zip(
                    names, self.peak_speed, self.controller.robot.velocity_limit, strict=True
                )
            },
            "joint_work": self._work,
            "saturated_share": self.saturated / max(self.ticks, 1),
            "qp_failures": self.failures,
            "com_error_rms": stance.rms,
            "com_error_max": stance.most,
            "com_error_flight_rms": flight.rms if flight.ticks else None,
        }

    def record(self, metadata: dict[str, Any]) -> Record:
        """The run so far."""
        table = self._table[: self.rows]
        data = {name: table[:, columns].copy() for name, columns in self._columns.items()}
        for name in ("time", "angular_momentum", "node", "rear", "solved", "push"):
            data[name] = data[name][:, 0]
        for name in ("foot", "joint", "contact_force", "template_force", "swing_reference"):
            data[name] = data[name].reshape(len(data[name]), -1, 2)
        reports = self.controller.reports
        sections, strides = self.section_names(), self.stride_names()
        return Record(
            **{k: x for k, x in data.items() if k not in ("node", "rear", "solved")},
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
            section_load=np.array([r.learnt.load for r in reports]),
            section_trim=np.array([r.learnt.trim for r in reports]),
            tick_seconds=self._times[: self.ticks, 0].copy(),
            solve_seconds=self._times[: self.ticks, 1].copy(),
            plan_seconds=np.array([r.plan_seconds for r in reports]),
            metadata={**metadata, "sections": sections, "strides": strides},
        )

    def section_names(self) -> list[str]:
        """Sections of the run, each once."""
        return list(dict.fromkeys(r.section.name for r in self.controller.reports))

    def stride_names(self) -> list[str]:
        """Kinds of stride of the run, each once."""
        return list(dict.fromkeys(r.goal.stride for r in self.controller.reports))
