"""What a simulated scenario leaves behind."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control import storage
from template_control.checks.checked import checked

Array = NDArray[np.float64]

FORMAT = "template-control scenario 2"
_LAYOUT = storage.Layout(
    fields={
        "time": "T",
        "state": "T 4",
        "node": "T <nodes",
        "toes": "T 2",
        "stiffness": "T 2",
        "foothold": "F 2",
        "stride": "S <strides",
        "section_time": "S+1",
        "section_state": "S+1 3",
        "wanted_speed": "S",
        "target": "S 3",
        "predicted": "S 3",
        "controls": "S 6",
        "residual": "S",
        "reached": "S",
        "solve_seconds": "S",
    },
    metadata={
        **dict.fromkeys(("name", "map", "failure"), (str,)),
        **dict.fromkeys(("nodes", "phases", "strides"), (list,)),
        "parameters": (dict,),
    },
)


@dataclass(frozen=True)
class ScenarioRecord:
    """A simulated scenario; T samples, S strides, F footholds; SI units, y up.

    Attributes:
        time: (T,) [s].
        state: (T, 4) x, y, dx/dt, dy/dt of the CoM on the exact model.
        node: (T,) index into ``metadata["nodes"]``.
        toes: (T, 2) x of rear and front toe.
        stiffness: (T, 2) of rear and front leg, 0 in the air [N/m].
        foothold: (F, 2) time and x of each touchdown, the first stance's included.
        stride: (S,) index into ``metadata["strides"]`` of the kind of stride.
        section_time: (S + 1,) of the section each stride starts from, and of the last.
        section_state: (S + 1, 3) dx/dt, y, dy/dt there.
        wanted_speed: (S,) the profile's speed that the stride aimed at.
        target: (S, 3) state aimed at.
        predicted: (S, 3) state the controller's map expected.
        controls: (S, NUM_SLOTS) u.
        residual: (S,) of the controller's optimisation.
        reached: (S,) whether it met its target.
        solve_seconds: (S,) wall-clock time of each controller.
        metadata: scenario, names of nodes and strides, how it ended.
    """

    time: Array
    state: Array
    node: NDArray[np.int64]
    toes: Array
    stiffness: Array
    foothold: Array
    stride: NDArray[np.int64]
    section_time: Array
    section_state: Array
    wanted_speed: Array
    target: Array
    predicted: Array
    controls: Array
    residual: Array
    reached: NDArray[np.bool_]
    solve_seconds: Array
    metadata: dict[str, Any]

    def __repr__(self) -> str:
        end = "completed" if self.completed else f"ended: {self.metadata['failure']}"
        return (
            f"<ScenarioRecord of {self.metadata['name']}: {len(self.stride)} strides in"
            f" {self.time[-1]:.2f} s, {len(self.time)} samples, {end}>"
        )

    @property
    def completed(self) -> bool:
        """Whether every segment was gone through."""
        return not self.metadata["failure"]

    @property
    def strides(self) -> list[str]:
        """Kind of each stride, a key of ``STRIDE_START``."""
        return [self.metadata["strides"][i] for i in self.stride]

    def during(self, stride: int) -> slice:
        """Samples of a stride."""
        begin, end = np.searchsorted(self.time, self.section_time[stride : stride + 2])
        return slice(int(begin), int(end))

    def energies(self) -> dict[str, Array]:
        """``forward`` and ``vertical`` kinetic, ``gravity``, ``spring``, ``total`` (T,) [J]."""
        p = self.metadata["parameters"]
        x, y, u, v = self.state.T
        length = np.hypot(x[:, None] - self.toes, y[:, None])
        spring = 0.5 * np.sum(self.stiffness * (p["rest_length"] - length) ** 2, axis=1)
        parts = {
            "forward": 0.5 * p["mass"] * u**2,
            "vertical": 0.5 * p["mass"] * v**2,
            "gravity": p["mass"] * p["gravity"] * y,
            "spring": spring,
        }
        return {**parts, "total": np.sum(list(parts.values()), axis=0)}

    def energy_phase(self, stride: int) -> float:
        """Correlation of forward kinetic and gravitational energy over a stride.

        Near -1 they are out of phase, as in walking; near +1 in phase, as in running. The
        straight line between a stride's ends is taken off first: it is acceleration.
        """
        w = self.during(stride)
        e = self.energies()
        share = np.linspace(0.0, 1.0, w.stop - w.start)
        forward, gravity = (
            x - x[0] - share * (x[-1] - x[0]) for x in (e["forward"][w], e["gravity"][w])
        )
        return float(np.corrcoef(forward, gravity)[0, 1])

    @checked
    def save(self, path: str | Path) -> Path:
        """Write it; see :func:`~template_control.storage.save`."""
        return storage.save(self, path, FORMAT)

    @classmethod
    @checked
    def load(cls, path: str | Path) -> ScenarioRecord:
        """Read it; see :func:`~template_control.storage.load`."""
        return storage.load(cls, path, FORMAT, _LAYOUT)
