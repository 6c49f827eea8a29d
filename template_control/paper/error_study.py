"""How wrong the closed-form walking maps are: Section III-D on a stated grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.slip.automaton.vocabulary import NUM_SLOTS, MapKind, Outcome, Slot
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Grid:
    """Numbers of points over Table II's ranges, ends included.

    Attributes:
        stiffness: of k0 from 10 to 25 kN/m.
        angle: of alpha from 60 to 80 degrees.
        speed: of dx/dt at VLO from 0.5 to 2 m/s.
        height: of y at VLO strictly between l0 sin(alpha) and l0 (cell centres).
    """

    stiffness: int = 10
    angle: int = 21
    speed: int = 12
    height: int = 12

    def states(self, parameters: SlipParameters) -> tuple[Array, Array]:
        """VLO states (n, 3) and controls (n, NUM_SLOTS) of the grid, dy/dt = 0."""
        share = (np.arange(self.height) + 0.5) / self.height
        k, a, u, f = np.meshgrid(
            np.linspace(10e3, 25e3, self.stiffness),
            np.radians(np.linspace(60.0, 80.0, self.angle)),
            np.linspace(0.5, 2.0, self.speed),
            share,
            indexing="ij",
        )
        lowest = parameters.rest_length * np.sin(a)
        y = lowest + f * (parameters.rest_length - lowest)
        z = np.stack((u, y, np.zeros_like(u)), axis=-1).reshape(-1, 3)
        controls = np.zeros((len(z), NUM_SLOTS))
        controls[:, Slot.TOUCHDOWN_ANGLE] = a.ravel()
        controls[:, Slot.K_SC] = controls[:, Slot.K_SD] = k.ravel()
        return z, controls


@dataclass(frozen=True)
class MapErrors:
    """Errors of one map over the valid runs; NaN where the map says the step fails.

    Attributes:
        position: (n,) e of (31) at the next VLO [%].
        velocity: (n,) script E of (32) [%].
        failed: number of valid runs in which the map's step fails.
    """

    position: Array
    velocity: Array
    failed: int

    def statistics(self) -> dict[str, dict[str, float]]:
        """Mean, sd and max of both, as in Table III."""
        return {
            name: {
                "mean": float(np.nanmean(e)),
                "sd": float(np.nanstd(e)),
                "max": float(np.nanmax(e)),
            }
            for name, e in (("position", self.position), ("velocity", self.velocity))
        }


@dataclass(frozen=True)
class ErrorStudy:
    """Result of :func:`study`.

    Attributes:
        tried: states on the grid.
        distance: (n,) d_v of (33) of the valid runs.
        errors: by map.
    """

    tried: int
    distance: Array
    errors: dict[MapKind, MapErrors]

    @property
    def valid(self) -> int:
        """Number of valid runs."""
        return len(self.distance)


def study(grid: Grid | None = None, parameters: SlipParameters | None = None) -> ErrorStudy:
    """Compare the closed-form VLO maps with the exact one over a grid.

    A run is valid if the exact step completes and its energy allows the next touchdown,
    (29) and (30).

    Args:
        grid: numbers of points; None for the default ones.
        parameters: the template, whose stiffness the grid replaces; None for Table IV's.
    """
    p = parameters or SlipParameters()
    z, u = (grid or Grid()).states(p)
    tried = len(z)
    true = ReturnMap(p, "w")(z, u)
    valid = (true.outcome == Outcome.SECTION) & _may_touch_down(p, z, u)
    z, u = z[valid], u[valid]
    state, advance = true.state[valid], true.advance[valid]
    position, velocity = np.column_stack((advance, state[:, 1])), state[:, [0, 2]]
    speed = np.linalg.norm(velocity, axis=1)
    errors = {}
    for kind in (MapKind.PAPER, MapKind.IMPROVED, MapKind.GEYER):
        mapped = ReturnMap(p, "w", kind)(z, u)
        guess = np.column_stack((mapped.advance, mapped.state[:, 1]))
        e = np.linalg.norm(guess - position, axis=1) / np.linalg.norm(position, axis=1)
        ev = np.linalg.norm(mapped.state[:, [0, 2]] - velocity, axis=1) / np.ptp(speed)
        failed = int(np.sum(mapped.outcome != Outcome.SECTION))
        errors[kind] = MapErrors(100.0 * e, 100.0 * ev, failed)
    relative = np.abs((state[:, :2] - z[:, :2]) / z[:, :2])
    return ErrorStudy(tried, relative.sum(axis=1), errors)


def _may_touch_down(p: SlipParameters, z: Array, u: Array) -> NDArray[np.bool_]:
    """(29) and (30): the energy is enough for the next touchdown."""
    k, low = u[:, Slot.K_SC], p.rest_length * np.sin(u[:, Slot.TOUCHDOWN_ANGLE])
    at_rest = np.column_stack((np.zeros_like(low), low, np.zeros_like(low)))
    return np.asarray(VLO.energy(p, z, k) >= VLO.energy(p, at_rest, k))
