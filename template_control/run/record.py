"""A recorded run: what it holds, how it is written and read.

``run.npz`` holds one array a field of :class:`Record` and the metadata as JSON text.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control import storage

Array = NDArray[np.float64]

FORMAT = "template-control run 2"


@dataclass(frozen=True)
class Record:
    """A run of a robot; T samples, S VLO states, SI units, world frame with y up.

    Attributes:
        time: (T,) [s].
        q, v: (T, nv) true configuration and velocity, without the noise of the sensors.
        torque: (T, nu) joint torques computed at the sample, applied right after it, or the
            options' ``delay`` later [N m].
        com, com_velocity: (T, 2).
        angular_momentum: (T,) about the CoM, forward pitch positive [kg m^2/s].
        template_com, template_velocity: (T, 2) the template at the robot's phase.
        foot: (T, 2, 2) lowest points of the feet.
        joint: (T, nu, 2) positions of the actuated joints.
        contact_force: (T, 2, 2) the ground's force on each foot during the step before the
            sample, averaged over the physics step [N].
        template_force: (T, 2, 2) the template's leg forces, rear and front [N].
        node: (T,) index into ``metadata["nodes"]``.
        rear: (T,) index of the rear stance foot.
        solved: (T,) False where the QP was not solved.
        swing_reference: (T, 2) position of the swing foot's reference.
        push: (T,) disturbance on the trunk [N].
        vlo_time: (S,) time of each VLO, the start's included.
        vlo_state: (S, 3) dx/dt (angular-momentum based), y over the stance foot, dy/dt, as
            measured.
        vlo_predicted: (S, 3) state the planner expected at the next VLO.
        vlo_controls: (S, 5) controls of the step that begins, by Slot.
        vlo_offset: (S, 3) the planner's offset estimate.
        vlo_reached: (S,) False where the planner took the best reachable step instead.
        vlo_feasible: (S,) False where the template cannot complete the step at all.
        vlo_load: (S,) load factor.
        vlo_trim: (S,) momentum trim [m/s^2].
        tick_seconds, solve_seconds: (ticks,) wall-clock time of every control tick and QP.
        plan_seconds: (S,) wall-clock time of every plan.
        metadata: robot, gait, options, joint names, limits, outcome and summary figures.
    """

    time: Array
    q: Array
    v: Array
    torque: Array
    com: Array
    com_velocity: Array
    angular_momentum: Array
    template_com: Array
    template_velocity: Array
    foot: Array
    joint: Array
    contact_force: Array
    template_force: Array
    node: NDArray[np.int64]
    rear: NDArray[np.int64]
    solved: NDArray[np.bool_]
    swing_reference: Array
    push: Array
    vlo_time: Array
    vlo_state: Array
    vlo_predicted: Array
    vlo_controls: Array
    vlo_offset: Array
    vlo_reached: NDArray[np.bool_]
    vlo_feasible: NDArray[np.bool_]
    vlo_load: Array
    vlo_trim: Array
    tick_seconds: Array
    solve_seconds: Array
    plan_seconds: Array
    metadata: dict[str, Any]

    @property
    def steps(self) -> int:
        """Completed steps."""
        return len(self.vlo_time) - 1

    @property
    def fell(self) -> bool:
        """True where the run ended in a fall."""
        return bool(self.metadata["fall_reason"])

    @property
    def com_error(self) -> Array:
        """(T, 2) template less robot at the robot's phase [m]."""
        return self.template_com - self.com

    def save(self, path: str | Path) -> Path:
        """Write the run as a compressed ``.npz``.

        Raises:
            RecordError: if the file cannot be written.
        """
        return storage.save(self, path, FORMAT)

    @classmethod
    def load(cls, path: str | Path) -> Record:
        """Read a run that :meth:`save` wrote.

        Raises:
            RecordError: if the file is missing or is no recorded run.
        """
        return storage.load(cls, path, FORMAT)
