"""What a disturbance is: whom it meets, which levels it has, and the run at each of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.planners.planner import Planner
from template_control.plant.bullet import PlantOptions
from template_control.robot.biped import Biped
from template_control.run.options import SimulationOptions
from template_control.run.simulation import simulate
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.gaits.running_gait import RunningGait
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale


@dataclass(frozen=True)
class Situation:
    """Where a disturbance meets the robot.

    Attributes:
        robot: the model; its last update is overwritten.
        gait: the gait that is kept.
        planner: that keeps it.
        plant: the world without a disturbance.
    """

    robot: Biped
    gait: WalkingGait | RunningGait
    planner: Planner
    plant: PlantOptions = field(default_factory=PlantOptions)

    @property
    def scale(self) -> Scale:
        """Units of the gait's template."""
        return Scale.of(self.gait.parameters)

    def footholds(self, start: tuple[float, float, float], steps: int) -> NDArray[np.float64]:
        """Where the robot treads in each step when nothing disturbs it.

        Args:
            start: (3,) dx/dt, y, dy/dt at the gait's section [m/s, m, m/s].
            steps: how many.

        Returns:
            (n,) x of the footholds [m], the last step's last; the gait's own if the robot falls,
            as it will then fall with the disturbance as well.
        """
        options = SimulationOptions(steps=steps, start=start, plant=self.plant)
        record = simulate(self.robot, self.planner, options)
        if record.fell:
            return self.gait.step_length * np.arange(steps + 1.0)
        # The last section may round to just after the last sample.
        at = np.minimum(np.searchsorted(record.time, record.section_time), len(record.time) - 1)
        # Before the first tick the ground has not pressed yet.
        if np.all(record.contact_force[at[1:]].any(axis=(1, 2))):
            return np.asarray(record.foot[at, record.rear[at], 0])
        # No foot stands at an apex: that which bore most in between.
        load = record.contact_force[:, :, 1]
        strides = [slice(a, b) for a, b in pairwise(at)]
        most = [np.unravel_index(np.argmax(load[s]), load[s].shape) for s in strides]
        holds = [record.foot[s][i, foot, 0] for s, (i, foot) in zip(strides, most, strict=True)]
        return np.array(holds)


@dataclass(frozen=True)
class Unit:
    """The unit that levels are shown in.

    Attributes:
        name: stands after the number; "" for a coefficient.
        factor: one SI unit in this unit; negative where a level is a share taken away.
    """

    name: str
    factor: float = 1.0


@dataclass(frozen=True)
class Disturbance:
    """One kind of disturbance.

    Attributes:
        name: on the command line.
        title: in tables and figures.
        unit: that levels are shown in.
        levels: for the reference template [SI], from mild to severe.
        trials: number of trials at each level.
        size: factor from the reference template's levels to a template's.
        options: of the run at a level [SI] and a trial's index.
        passing: whether it comes only once: the robot must then be back on its gait at the end.
            Otherwise it lasts from the start, and the robot must only go on.
        grain: levels are whole multiples of it, at least one; 0 for any levels [SI].
        kick: what a level adds at once to dx/dt, y, dy/dt of the template at its section; None
            where it is no change of the state.
    """

    name: str
    title: str
    unit: Unit
    levels: tuple[float, ...]
    trials: int
    size: Callable[[SlipParameters], float]
    options: Callable[[Situation, float, int], SimulationOptions]
    passing: bool = False
    grain: float = 0.0
    kick: Callable[[Situation, float], NDArray[np.float64]] | None = None

    def levels_for(self, parameters: SlipParameters) -> list[float]:
        """The levels for a template [SI]."""
        levels = [self.size(parameters) * level for level in self.levels]
        if self.grain:
            grains = (max(1, round(level / self.grain)) for level in levels)
            levels = [self.grain * n for n in dict.fromkeys(grains)]
        return levels

    def shown(self, level: float) -> str:
        """A level with its unit."""
        return f"{self.unit.factor * level:.3g} {self.unit.name}".strip()
