"""Disturbances whose breaking points are sought: levels, and the run at a level in a trial.

Levels are those of the reference template (80 kg, 1 m), where they are round numbers; another
robot gets them scaled by dynamic similarity. They are unknown to the controller, except for
weaker motors, which is what its torque limits are for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import pi
from typing import Any

import numpy as np

from template_control import settings
from template_control.arrays import Array
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.plant import plant_name
from template_control.plant.terrain import Terrain
from template_control.run.experiment import Experiment, PreparedExperiment, perturbed_start
from template_control.run.options import Push
from template_control.run.sensing import SensorOptions
from template_control.run.simulation import simulate
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import REFERENCE, Scale


def engine(experiment: Experiment) -> PlantOptions:
    """The physics engine of an experiment; a ParameterError if it has another plant."""
    if not isinstance(experiment.world, PlantOptions):
        raise ParameterError(
            f"the world is {plant_name(experiment.world)}, whose friction cannot be disturbed: give"
            " PlantOptions or MujocoOptions"
        )
    return experiment.world


def with_step(world: PlantOptions, height: float, x: float) -> PlantOptions:
    """The world with a step of its ground [m], if it has no ground of its own."""
    if height == 0.0:
        return world
    if world.terrain is not None:
        raise ParameterError("the world has a terrain, and is to get a step too: leave one out")
    return replace(world, terrain=Terrain.step(height, x))


def footholds(where: PreparedExperiment, start: tuple[float, float, float], steps: int) -> Array:
    """Footholds of a robot in each step when nothing disturbs it.

    Args:
        where: the undisturbed experiment.
        start: (3,) dx/dt, y, dy/dt at the gait's section [m/s, m, m/s].
        steps: how many.

    Returns:
        (n,) x of the footholds [m], the last step's last; the gait's own if the robot falls, as it
        will then fall with the disturbance as well.
    """
    record = simulate(replace(where, steps=steps, start=start))
    if record.fell:
        return where.gait.step_length * np.arange(steps + 1.0)
    # The last section may round to just after the last sample.
    at = np.minimum(np.searchsorted(record.time, record.section_time), len(record.time) - 1)
    # Before the first tick the ground has not pressed yet.
    if np.all(record.contact_force[at[1:]].any(axis=(1, 2))):
        return np.asarray(record.of_legs(record.foot)[at, record.rear[at], 0])
    # No foot stands at an apex: that which bore most in between.
    load = record.contact_force[:, :, 1]
    strides = [slice(a, b) for a, b in pairwise(at)]
    most = [np.unravel_index(np.argmax(load[s]), load[s].shape) for s in strides]
    holds = [record.foot[s][i, foot, 0] for s, (i, foot) in zip(strides, most, strict=True)]
    return np.array(holds)


@dataclass(frozen=True)
class Unit:
    """Name of the unit that levels are shown in, and one SI unit in it, negative for a lack."""

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
        experiment: the disturbed one at a level [SI] and a trial's index.
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
    experiment: Callable[[PreparedExperiment, float, int], PreparedExperiment]
    passing: bool = False
    grain: float = 0.0
    kick: Callable[[PreparedExperiment, float], Array] | None = None

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


BEGIN = 10  # steps on the gait before a push comes

AFTER = 20  # steps a robot must go on after it, or with a lasting one from the start

PHASES = 10
"""Of the step in which a push begins: as many trials."""

_SOON = 4  # steps of a robot that starts off its gait before a step of the ground comes
_EDGES = (0.3, 0.4, 0.5, 0.6, 0.7)  # of the way between two footholds
_STARTS = 5  # seeds of the starts off the gait
PUSH_SECONDS = 0.1  # duration of a push on the reference template [s]


def impulse_unit(parameters: SlipParameters) -> float:
    """Factor of an impulse on the reference template: M sqrt(g l0) over that template's."""
    return parameters.mass / REFERENCE.mass * Scale.of(parameters).speed


def _ladder(step: float, count: int, start: float = 0.0) -> tuple[float, ...]:
    """``count`` levels away from ``start``, free of rounding's tails."""
    return tuple(float(x) for x in np.round(start + step * np.arange(1, count + 1), 10))


_IMPULSES = _ladder(5.0, 30)
_HEIGHTS = (0.005, *_ladder(0.01, 8))
_NEWTON_SECONDS, _CENTIMETRES, _PER_CENT = Unit("N s"), Unit("cm", 100.0), Unit("%", 100.0)


def _push(name: str, title: str, sign: float = 1.0, direction: float = 0.0) -> Disturbance:
    """A push to ``direction`` [rad], in a phase of the step by the trial's number."""

    def pushed(where: PreparedExperiment, level: float, trial: int) -> PreparedExperiment:
        seconds = PUSH_SECONDS * Scale.of(where.gait.parameters).time
        push = Push(sign * level, BEGIN, trial / PHASES, seconds, direction)
        return replace(where, steps=BEGIN + 1 + AFTER, pushes=(push,))

    def kick(where: PreparedExperiment, level: float) -> Array:
        return np.array([sign * level / where.gait.parameters.mass, 0.0, 0.0])

    levels, kicks = (_IMPULSES, PHASES, impulse_unit), None if direction else kick
    return Disturbance(name, title, _NEWTON_SECONDS, *levels, pushed, passing=True, kick=kicks)


def _step(name: str, title: str, sign: float) -> Disturbance:
    """A step of the ground, its edge between two footholds by the trial's number."""

    def stepped(where: PreparedExperiment, level: float, trial: int) -> PreparedExperiment:
        start = perturbed_start(where.gait, trial)
        before, beyond = footholds(where, start, _SOON + 1)[-2:]
        edge = float(before + _EDGES[trial] * (beyond - before))
        world = with_step(engine(where), sign * level, edge)
        return replace(where, steps=_SOON + 1 + AFTER, world=world, start=start)

    levels = _HEIGHTS, len(_EDGES), lambda p: Scale.of(p).length
    return Disturbance(name, title, _CENTIMETRES, *levels, stepped, passing=True)


def _lasting(
    name: str,
    title: str,
    unit: Unit,
    levels: tuple[float, ...],
    changes: Callable[[PreparedExperiment, float, int], dict[str, Any]],
    size: Callable[[SlipParameters], float] = lambda _: 1.0,
    grain: float = 0.0,
) -> Disturbance:
    """What lasts from a start off the gait on: fields of the experiment that it changes."""

    def disturbed(where: PreparedExperiment, level: float, trial: int) -> PreparedExperiment:
        start = perturbed_start(where.gait, trial)
        return replace(where, steps=AFTER, start=start, **changes(where, level, trial))

    return Disturbance(name, title, unit, levels, _STARTS, size, disturbed, grain=grain)


def _other_mass(where: PreparedExperiment, level: float, _: int) -> dict[str, Any]:
    return {"world": replace(engine(where), mass_scale=1.0 + level)}


DISTURBANCES: tuple[Disturbance, ...] = (
    _push("push-forward", "push forward"),
    _push("push-backward", "push backward", -1.0),
    _step("step-up", "step up", 1.0),
    _step("step-down", "step down", -1.0),
    _lasting(
        "friction", "friction", Unit(""), _ladder(-0.05, 13, 0.7),
        lambda where, level, _: {"world": replace(engine(where), friction=level)},
    ),
    _lasting("heavier", "heavier", _PER_CENT, _ladder(0.1, 15), _other_mass),
    _lasting("lighter", "lighter", Unit("%", -100.0), _ladder(-0.1, 9), _other_mass),
    _lasting(
        "torque", "torque limits", _PER_CENT, _ladder(-0.05, 19, 1.0),
        lambda where, level, _: {
            "controller": settings.changed(where.tuning, {"qp.torque_scale": level})
        },
    ),
    _lasting(
        "noise", "sensor noise", Unit("mrad", 1e3), _ladder(5e-4, 20),
        lambda _, level, trial: {"sensors": SensorOptions(noise=level, seed=trial)},
    ),
    _lasting(
        "delay", "control delay", Unit("ms", 1e3), _ladder(2e-3, 25),
        lambda _, level, __: {"delay": level}, lambda p: Scale.of(p).time,
        PlantOptions().time_step,
    ),
)  # fmt: skip
"""All that are measured, in the order they are shown in."""

LATERAL_PUSHES: tuple[Disturbance, ...] = (
    _push("push-left", "push to the left", direction=0.5 * pi),
    _push("push-right", "push to the right", direction=-0.5 * pi),
)
"""In the step they come in the left foot stands, and then the right one."""

ALL = (*DISTURBANCES, *LATERAL_PUSHES)
"""Disturbances of a floating-base robot, in the order shown; of a planar one ``DISTURBANCES``."""
