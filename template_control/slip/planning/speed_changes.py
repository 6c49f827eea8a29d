"""Table of changes of speed: walking steps from gait to gait, that a plan stays near.

They are found off line by :mod:`~.planning.change_search`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.gait_table import STATE_TOLERANCE
from template_control.slip.similarity import Scale

_NEAR = 0.05  # difference of the aimed speeds that counts as one tolerance of the state


class SpeedChange(NamedTuple):
    """N steps from a gait to another one."""

    states: Array  # (N + 1, 3) at VLO
    controls: Array  # (N, 4) alpha and shares of the stiffness
    stiffness: Array  # (N,) [N/m]


class SpeedChanges(NamedTuple):
    """Ends of all changes of a template, each from one of its steps on, by row.

    ``start`` (n, 3) are the states that they begin with, ``speed`` (n,) those that they lead to,
    ``length`` (n,) their steps, ``speeds`` the least and the greatest one [m/s].
    """

    start: Array
    speed: Array
    length: Array
    rest: tuple[SpeedChange, ...]
    tolerance: Array
    near: float
    speeds: tuple[float, float]

    def towards(self, z: Array, speed: float, count: int) -> Iterator[SpeedChange]:
        """The best so many changes from a VLO state ``z`` (3,) to a speed [m/s], best first.

        They begin near the state, lead near the speed, and are short.
        """
        price = (
            np.sum(np.square((self.start - z) / self.tolerance), axis=1)
            + np.square((self.speed - speed) / self.near)
            + self.length
        )
        for i in np.argsort(price)[:count]:
            yield self.rest[i]


@cache
def speed_changes(parameters: SlipParameters) -> SpeedChanges:
    """The library's changes on a template, as ``template-control gaits --changes`` made them."""
    text = files(__package__).joinpath("speed_changes.json").read_text(encoding="utf-8")
    scale, unit = Scale.of(parameters), parameters.speed_unit
    weight = parameters.mass * parameters.gravity / parameters.rest_length
    rest = []
    for change in json.loads(text)["changes"]:
        states = np.array(change["states"]) * [unit, parameters.rest_length, unit]
        free, stiffness = np.array(change["controls"]), np.array(change["stiffness"]) * weight
        rest += [SpeedChange(states[i:], free[i:], stiffness[i:]) for i in range(len(free))]
    speed = np.array([change.states[-1, 0] for change in rest])
    return SpeedChanges(
        start=np.array([change.states[0] for change in rest]),
        speed=speed,
        length=np.array([len(change.controls) for change in rest], dtype=np.float64),
        rest=tuple(rest),
        tolerance=STATE_TOLERANCE * scale.state,
        near=_NEAR * scale.speed,
        speeds=(speed.min(), speed.max()),
    )
