"""Poincaré sections (Section II-C): which numbers of the CoM's state each keeps, and its energy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from template_control.arrays import Array, IntArray
from template_control.errors import ParameterError
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.parameters import SlipParameters

PADDED = 3
"""Size of a padded state: dx/dt, y, dy/dt."""

_MIRROR = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True)
class Section:
    """Section at which a stride ends and the next begins: :data:`VLO`, :data:`APEX`, :data:`REST`.

    A state z at the section is (n,): dx/dt, y, dy/dt [m/s, m, m/s] at VLO (8), where the
    stance leg is vertical, and at :data:`REST`; dx/dt, y [m/s, m] at apex (4), where dy/dt is 0.

    Attributes:
        event: the guard that fires there.
        order: which of x, y, dx/dt, dy/dt the state keeps, in order.
    """

    event: Event
    order: tuple[int, ...]

    @property
    def dimension(self) -> int:
        """Size n of the section's state."""
        return len(self.order)

    @cached_property
    def _places(self) -> IntArray:
        """:attr:`order` as an array, which NumPy need not make of it each time."""
        return np.array(self.order)

    @property
    def name(self) -> str:
        """``"VLO"``, ``"APEX"`` or ``"REST"``."""
        return self.event.name

    def of(self, state: ArrayLike) -> Array:
        """The section's (n,) state of ``state`` (4 or more,) x, y, dx/dt, dy/dt; a copy."""
        return np.asarray(state, dtype=float)[self._places]

    def state(self, z: ArrayLike, x: float = 0.0) -> Array:
        """The CoM's state (4,) x, y, dx/dt, dy/dt at section state ``z`` (n,).

        Args:
            z: state at the section.
            x: of the CoM, which no section keeps [m].
        """
        full = np.array([x, 0.0, 0.0, 0.0])
        full[self._places] = z
        return full

    def padded(self, z: ArrayLike) -> Array:
        """States ``z`` (..., n) as (..., 3) dx/dt, y, dy/dt, the form every map takes."""
        states = np.asarray(z, dtype=float)
        full = np.zeros((*states.shape[:-1], PADDED))
        full[..., : self.dimension] = states
        return full

    def energy(
        self, parameters: SlipParameters, z: ArrayLike, stiffness: ArrayLike | None = None
    ) -> float | Array:
        """E = m v^2 / 2 + m g y, at VLO with k (l0 - y)^2 / 2 of the stance leg's spring [J].

        Args:
            parameters: the template.
            z: (..., n) states at the section.
            stiffness: k of the stance leg at VLO, (...) or one [N/m]; None is the nominal k0.

        Returns:
            A number for one state, else (...).
        """
        p = parameters
        states = np.asarray(z, dtype=float)
        dx, y, *dy = np.moveaxis(states, -1, 0)
        squared = dx**2 + dy[0] ** 2 if dy else dx**2
        energy = 0.5 * p.mass * squared + p.mass * p.gravity * y + self._spring(p, y, stiffness)
        return float(energy) if states.ndim == 1 else np.asarray(energy)

    def speed(self, parameters: SlipParameters, y: ArrayLike, energy: ArrayLike) -> Array:
        """Speed of the CoM where a height and an energy are given; shapes broadcast.

        Args:
            parameters: the template; at VLO the stance leg has its stiffness k0.
            y: (...) height of the CoM [m].
            energy: (...) mechanical energy [J].

        Returns:
            (...) speeds [m/s], NaN where the energy does not suffice.
        """
        p = parameters
        height = np.asarray(y, dtype=float)
        potential = p.mass * p.gravity * height + self._spring(p, height, None)
        squared = 2.0 * (np.asarray(energy, dtype=float) - potential) / p.mass
        return np.sqrt(np.where(squared >= 0.0, squared, np.nan))

    def mirror(self, z: ArrayLike) -> Array:
        """States (..., n) backward in time: the template walks there as it came, the other way.

        dx/dt changes its sign twice, by the time and by the direction; dy/dt once.
        """
        return np.asarray(z, dtype=float) * _MIRROR[: self.dimension]

    def damped(self, z: Array, share: float, highest: float) -> Array:
        """State (n,) with damped dy/dt, from which the template can go on more easily.

        At apex dy/dt is 0 already, and no leg limits the height: there it is ``z``.

        Args:
            z: (n,) state at the section.
            share: of dy/dt that is left.
            highest: height that it may have at most [m].
        """
        calm = np.array(z, dtype=float)
        if self.dimension == PADDED:
            calm[1:] = min(calm[1], highest), share * calm[2]
        return calm

    def _spring(self, p: SlipParameters, y: Array, stiffness: ArrayLike | None) -> Array | float:
        """Energy of the stance leg, vertical and as long as the CoM is high [J]."""
        if self.event is not Event.VLO:
            return 0.0
        k = p.leg_stiffness if stiffness is None else np.asarray(stiffness, dtype=float)
        return 0.5 * k * (p.rest_length - y) ** 2


VLO = Section(Event.VLO, (2, 1, 3))
"""Vertical leg orientation in single stance: where walking strides begin and end."""

APEX = Section(Event.APEX, (2, 1))
"""Highest point of the flight: where running strides begin and end."""

REST = Section(Event.REST, (2, 1, 3))
"""Both feet on the ground and the CoM at rest, as far as it is: where standing begins and ends."""

_SECTIONS = {section.event: section for section in (VLO, APEX, REST)}


def section_of(event: Event) -> Section:
    """The section that ``event`` is; a ParameterError if it is none."""
    if event not in _SECTIONS:
        names = " or ".join(section.name for section in _SECTIONS.values())
        raise ParameterError(f"{event.name} is no section: give {names}")
    return _SECTIONS[event]
