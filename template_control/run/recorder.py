"""Collects a run while it goes on; whatever was recorded can be had at any time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.controller import EmbeddingController
from template_control.robot.requirements import BASE_DOF
from template_control.run.record import Record
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.whole_body.solver import Solution

Array = NDArray[np.float64]

_FIRST_CAPACITY = 4096
_NODE_INDEX = {node.name: i for i, node in enumerate(AUTOMATON.nodes)}


class Recorder:
    """One row a sample in a table that grows by doubling.

    Args:
        controller: whose references and steps are recorded.
        every: keep every n-th tick (timings and statistics use all of them).
    """

    def __init__(self, controller: EmbeddingController, every: int = 1) -> None:
        self.controller = controller
        self.every = every
        nv = controller.robot.nv
        nu = nv - BASE_DOF
        widths = {
            "time": 1,
            "q": nv,
            "v": nv,
            "torque": nu,
            "com": 2,
            "com_velocity": 2,
            "angular_momentum": 1,
            "template_com": 2,
            "template_velocity": 2,
            "foot": 4,
            "joint": 2 * nu,
            "contact_force": 4,
            "template_force": 4,
            "node": 1,
            "rear": 1,
            "solved": 1,
            "swing_reference": 2,
            "push": 1,
        }
        ends = np.cumsum(list(widths.values()))
        starts = ends - list(widths.values())
        self._columns = {
            name: slice(int(a), int(b)) for name, a, b in zip(widths, starts, ends, strict=True)
        }
        self._table = np.empty((_FIRST_CAPACITY, int(ends[-1])))
        self._times = np.empty((_FIRST_CAPACITY, 2))
        self._joint = np.zeros((nu, 2))
        self.rows = 0
        self.ticks = 0
        self.peak_torque = np.zeros(nu)
        self._torque_square = np.zeros(nu)
        self._error_square = np.zeros(2)
        self.error_max = np.zeros(2)
        self.saturated = 0
        self.failures = 0

    def tick(
        self,
        time: float,
        q: Array,
        v: Array,
        contact_force: Array,
        solution: Solution,
        push: float,
        seconds: float,
    ) -> None:
        """Record one tick; the controller must just have computed ``solution``."""
        c, r = self.controller, self.controller.robot
        torque = solution.torque
        size = np.abs(torque)
        np.maximum(self.peak_torque, size, out=self.peak_torque)
        self._torque_square += torque * torque
        self.saturated += bool(np.any(size >= 0.999 * c.qp.torque_limit))
        self.failures += not solution.solved
        template_x, template_y = c.template_com
        for axis, error in enumerate((template_x - r.com[0], template_y - r.com[1])):
            self._error_square[axis] += error * error
            self.error_max[axis] = max(self.error_max[axis], abs(error))
        if self.ticks == len(self._times):
            self._times = np.concatenate((self._times, np.empty_like(self._times)))
        self._times[self.ticks] = seconds, solution.solve_seconds
        if self.ticks % self.every == 0:
            if self.rows == len(self._table):
                self._table = np.concatenate((self._table, np.empty_like(self._table)))
            foot = r.foot_position
            r.joint_positions(self._joint)
            swing = c.swing
            self._table[self.rows] = (
                time,
                *q,
                *v,
                *torque,
                *r.com,
                *r.com_velocity,
                r.angular_momentum,
                template_x,
                template_y,
                c.reference[2],
                c.reference[3],
                *foot[0],
                *foot[1],
                *self._joint.ravel(),
                *contact_force[0],
                *contact_force[1],
                *c.template_forces[0],
                *c.template_forces[1],
                _NODE_INDEX[c.node.name],
                c.rear,
                solution.solved,
                swing.x[0],
                swing.y[0],
                push,
            )
            self.rows += 1
        self.ticks += 1

    def _rms(self, squares: Array) -> list[float]:
        return [float(x) for x in np.sqrt(squares / max(self.ticks, 1))]

    def summary(self) -> dict[str, Any]:
        """Statistics over all ticks, sampled or not."""
        names = self.controller.robot.joint_names
        rms = self._rms(self._torque_square)
        limit = self.controller.qp.torque_limit
        error_rms = self._rms(self._error_square)
        return {
            "joint_torque": {
                name: {"peak": float(p), "rms": t, "limit": float(lim)}
                for name, p, t, lim in zip(names, self.peak_torque, rms, limit, strict=True)
            },
            "saturated_share": self.saturated / max(self.ticks, 1),
            "qp_failures": self.failures,
            "com_error_rms": {"x": error_rms[0], "y": error_rms[1]},
            "com_error_max": {"x": float(self.error_max[0]), "y": float(self.error_max[1])},
        }

    def record(self, metadata: dict[str, Any]) -> Record:
        """The run so far."""
        table = self._table[: self.rows]
        data = {name: table[:, columns].copy() for name, columns in self._columns.items()}
        for name in ("time", "angular_momentum", "node", "rear", "solved", "push"):
            data[name] = data[name][:, 0]
        for name in ("foot", "joint", "contact_force", "template_force"):
            data[name] = data[name].reshape(len(data[name]), -1, 2)
        steps = self.controller.steps
        return Record(
            **{k: x for k, x in data.items() if k not in ("node", "rear", "solved")},
            node=data["node"].astype(np.int64),
            rear=data["rear"].astype(np.int64),
            solved=data["solved"].astype(bool),
            vlo_time=np.array([s.time for s in steps]),
            vlo_state=np.array([s.state for s in steps]),
            vlo_predicted=np.array([s.decision.predicted for s in steps]),
            vlo_controls=np.array([s.decision.controls for s in steps]),
            vlo_offset=np.array([s.offset for s in steps]),
            vlo_reached=np.array([s.decision.reached for s in steps]),
            vlo_feasible=np.array([s.decision.feasible for s in steps]),
            vlo_load=np.array([s.load for s in steps]),
            vlo_trim=np.array([s.trim for s in steps]),
            tick_seconds=self._times[: self.ticks, 0].copy(),
            solve_seconds=self._times[: self.ticks, 1].copy(),
            plan_seconds=np.array([s.plan_seconds for s in steps]),
            metadata=metadata,
        )
