"""A family of walking gaits by speed, without dimension: one for templates of every size."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from template_control.errors import GaitError
from template_control.slip.gaits.by_speed.nearest import nearest_gait
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

_FILE = "walking.json"
_XTOL, _RTOL = 1e-13, 8.881784197001252e-16  # of dimensionless speeds; scipy's least
_ROUNDING = 1e-6  # of a centimetre per second


@dataclass(frozen=True, eq=False)
class Chain:
    """Gaits at knots; between them is the gait nearest the monotone (PCHIP) interpolation.

    Units are l0, sqrt(l0 / g) and m g.

    Attributes:
        vlo_speed: (n,) dx/dt at VLO over sqrt(g l0), rising.
        stiffness: (n,) k l0 / (m g).
        touchdown_angle: (n,) alpha [rad].
        height: (n,) y at VLO over l0.
        mean_speed: (n,) of the whole step over sqrt(g l0), rising.
    """

    vlo_speed: Array
    stiffness: Array
    touchdown_angle: Array
    height: Array
    mean_speed: Array

    @cached_property
    def _curve(self) -> PchipInterpolator:
        columns = (np.log(self.stiffness), self.touchdown_angle, self.height)
        return PchipInterpolator(self.vlo_speed, np.column_stack(columns))

    @cached_property
    def _by_mean_speed(self) -> PchipInterpolator:
        return PchipInterpolator(
            self.mean_speed, np.column_stack((self.vlo_speed, self.height)), extrapolate=False
        )

    def vlo_at(self, mean_speed: float) -> tuple[float, float]:
        """Speed and height at VLO for a mean speed, all without dimension; ends count beyond."""
        at = np.clip(mean_speed, self.mean_speed[0], self.mean_speed[-1])
        speed, height = self._by_mean_speed(at).tolist()
        return speed, height

    def gait(self, parameters: SlipParameters, vlo_speed: float) -> WalkingGait:
        """The gait with a speed at VLO; the nearest end's coordinates serve beyond it.

        Args:
            parameters: the template; its stiffness k0 counts for nothing, the gait has its own.
            vlo_speed: dx/dt at VLO [m/s].

        Raises:
            GaitError: if there is none near the curve.
        """
        speed = np.clip(vlo_speed / parameters.speed_unit, self.vlo_speed[0], self.vlo_speed[-1])
        return nearest_gait(parameters, vlo_speed, self._curve(speed))

    def gait_for(self, parameters: SlipParameters, mean_speed: float) -> WalkingGait:
        """The gait with a mean speed that lies between those of two knots.

        Args:
            parameters: the template; its stiffness k0 counts for nothing, the gait has its own.
            mean_speed: step length over step duration [m/s].

        Raises:
            GaitError: if there is none near the curve.
        """
        p, unit = parameters, parameters.speed_unit
        wanted = mean_speed / unit
        knot = int(np.clip(np.searchsorted(self.mean_speed, wanted) - 1, 0, len(self.height) - 2))
        ends = self.vlo_speed[[knot, knot + 1]]

        def surplus(speed: float) -> float:
            return self.gait(p, speed * unit).mean_speed / unit - wanted

        misses = [surplus(float(end)) for end in ends]
        if misses[0] * misses[1] >= 0.0:  # at a knot, to rounding
            return self.gait(p, float(ends[np.argmin(np.abs(misses))]) * unit)
        return self.gait(p, float(brentq(surplus, *ends, xtol=_XTOL, rtol=_RTOL)) * unit)


@dataclass(frozen=True)
class SpeedFamily:
    """A walking gait for every mean speed of a range.

    Attributes:
        chains: from slow to fast; where two overlap, the slower one ends in the middle.
    """

    chains: tuple[Chain, ...]

    @cached_property
    def limits(self) -> Array:
        """(chains + 1,) mean speeds over sqrt(g l0) at which the chains begin and end."""
        starts = [chain.mean_speed[0] for chain in self.chains]
        ends = [chain.mean_speed[-1] for chain in self.chains]
        between = [0.5 * (a + b) for a, b in zip(ends[:-1], starts[1:], strict=True)]
        return np.array([starts[0], *between, ends[-1]])

    def range(self, parameters: SlipParameters) -> tuple[float, float]:
        """Slowest and fastest mean speed of a template [m/s], to a centimetre per second."""
        low, high = 100.0 * parameters.speed_unit * self.limits[[0, -1]]
        return float(np.ceil(low - _ROUNDING)) / 100.0, float(np.floor(high + _ROUNDING)) / 100.0

    def gait_for(self, parameters: SlipParameters, mean_speed: float) -> WalkingGait:
        """The gait with a mean speed.

        Args:
            parameters: the template; its stiffness k0 counts for nothing, the gait has its own.
            mean_speed: step length over step duration [m/s].

        Raises:
            GaitError: naming the range, if the speed is out of it.
        """
        slowest, fastest = self.range(parameters)
        if not slowest <= mean_speed <= fastest:
            raise GaitError(
                f"no walking gait at a mean speed of {mean_speed:g} m/s: give one from"
                f" {slowest:.2f} to {fastest:.2f} m/s"
            )
        return self._chain(parameters, mean_speed).gait_for(parameters, mean_speed)

    def vlo_for(self, parameters: SlipParameters, mean_speed: float) -> tuple[float, float]:
        """dx/dt and y at VLO of the gait with a mean speed, interpolated, without looking for it.

        Args:
            parameters: the template.
            mean_speed: step length over step duration [m/s]; beyond the range its end counts.

        Returns:
            dx/dt [m/s], y [m].
        """
        chain, unit = self._chain(parameters, mean_speed), parameters.speed_unit
        speed, height = chain.vlo_at(mean_speed / unit)
        return speed * unit, height * parameters.rest_length

    def chain_of(self, gait: WalkingGait) -> Chain:
        """The chain that a gait is on, by its mean speed."""
        return self._chain(gait.parameters, gait.mean_speed)

    def _chain(self, parameters: SlipParameters, mean_speed: float) -> Chain:
        inner = self.limits[1:-1]
        return self.chains[int(np.searchsorted(inner, mean_speed / parameters.speed_unit))]


def family_from(data: Mapping[str, Any]) -> SpeedFamily:
    """The family that a file's ``data`` holds."""
    chains = ({name: np.array(v) for name, v in chain.items()} for chain in data["chains"])
    return SpeedFamily(tuple(Chain(**chain) for chain in chains))


@cache
def walking_by_speed() -> SpeedFamily:
    """The library's family, as ``template-control gaits --family`` made it."""
    return family_from(json.loads(files(__package__).joinpath(_FILE).read_text(encoding="utf-8")))


def family_speeds(parameters: SlipParameters) -> tuple[float, float]:
    """Slowest and fastest dx/dt at VLO of the library's family [m/s]."""
    chains, unit = walking_by_speed().chains, parameters.speed_unit
    return float(chains[0].vlo_speed[0]) * unit, float(chains[-1].vlo_speed[-1]) * unit
