"""The paper's modified walking controller (Section IV-B): kappa_2 from energy, then alpha.

kappa_1 is given. Equation (38) finds the kappa_2 that brings the template to the wanted
energy at the next VLO for whatever touchdown angle is tried; the angle is searched for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.arrays import Array, IntArray
from template_control.compiled import compiled
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Outcome, Slot
from template_control.slip.dynamics.kernel import Scratch
from template_control.slip.dynamics.model import Kernel
from template_control.slip.maps.return_map import (
    FRONT_BOTTOM,
    REAR_BOTTOM,
    RESULTS,
    Derivatives,
    MapWorkspace,
    one_stride,
    section_jacobian,
)
from template_control.slip.maps.section import PADDED

_GRIDS, _COARSE, _FINE = 3, 9, 5  # of angles; points of the first grid, and of each later one
_NARROWING = 0.75  # half-width of a grid over the spacing before: its outer angles are new ones
_SECOND_WEIGHT = 0.1  # of the second step's squared residual: the first is to reach the target
_FAILURE = 10.0  # in place of it, where that step fails [m^2/s^2]: more than any residual
_FALL = 1e6  # added where the first step itself fails [m^2/s^2]


class Aim(NamedTuple):
    """Target (3,) of a step, dx/dt, y, dy/dt at the next VLO, and bounds (2,) of kappa_2."""

    target: Array
    stiffness_range: Array
    chooses: bool = True  # False: kappa_2 is given; a None would be compiled for itself


NO_AIM = Aim(np.zeros(3), np.zeros(2), chooses=False)
"""Of a step whose kappa_2 is given."""


@compiled
def modified_step(
    kernel: Kernel,
    kind: int,
    z: Array,
    aim: Aim,
    controls: Array,
    scratch: Scratch,
    result: Array,
) -> int:
    """One step with kappa_2 of (38), kept within its bounds; returns the Outcome's value.

    As :func:`~template_control.slip.maps.return_map.one_stride`; kappa_2 of the controls is
    overwritten, if the ``aim`` chooses it.
    """
    if aim.chooses:
        # The first pass finds the virtual bottom, which kappa_2 does not influence.
        controls[Slot.K_SD] = controls[Slot.K_SC]
    outcome = one_stride(kernel, kind, z, controls, scratch, result)
    rear, front = result[REAR_BOTTOM], result[FRONT_BOTTOM]
    if not (aim.chooses and np.isfinite(rear)):
        return outcome
    target, rest_length, kappa_1 = aim.target, kernel.rest_length, controls[Slot.K_SC]
    mu_1 = (rest_length - target[1]) ** 2
    mu_2 = (rest_length - z[1]) ** 2
    mu_3 = (rest_length - front) ** 2 + (rest_length - rear) ** 2
    kinetic = target[0] ** 2 + target[2] ** 2 - z[0] ** 2 - z[2] ** 2
    mu_4 = kernel.mass * (kinetic + 2.0 * kernel.gravity * (target[1] - z[1]))
    wanted = (mu_4 + (mu_3 - mu_2) * kappa_1) / (mu_3 - mu_1)
    controls[Slot.K_SD] = min(max(wanted, aim.stiffness_range[0]), aim.stiffness_range[1])
    return one_stride(kernel, kind, z, controls, scratch, result)


@compiled
def search_angle(
    kernel: Kernel,
    kind: int,
    z: Array,
    aim: Aim,
    search: tuple[float, float, float, float],
    scratch: Scratch,
    z_next: Array,
) -> tuple[int, float, float, float]:
    """Touchdown angle whose step ends nearest ``target``, equations (36) and (37).

    A step is judged with the one after it (at the nominal angle), so that of two poor steps the one
    is taken from which the gait can be reached; ``z_next`` (3,) is overwritten with its end.
    ``search`` are the nominal angle, the least and the greatest one to try [rad], and kappa_1
    [N/m]. Returns outcome, alpha, kappa_2 and the squared residual of the first step.
    """
    z1, z2, u = np.empty(RESULTS), np.empty(RESULTS), np.zeros(NUM_SLOTS)
    target, (nominal, least, greatest, kappa_1) = aim.target, search
    best_cost, best_alpha, best_kappa, best_residual = np.inf, nominal, kappa_1, np.inf
    best_outcome = -1
    low, high = least, greatest
    for grid in range(_GRIDS):
        count = _COARSE if grid == 0 else _FINE
        for i in range(count):
            alpha = low + (high - low) * i / (count - 1)
            u[0], u[Slot.K_SC] = alpha, kappa_1
            outcome = modified_step(kernel, kind, z, aim, u, scratch, z1)
            kappa_2 = u[Slot.K_SD]
            residual = np.sum((z1[:3] - target) ** 2)
            if outcome != Outcome.SECTION:
                cost = _FALL + residual
            else:
                u[0] = nominal
                following = modified_step(kernel, kind, z1[:3], aim, u, scratch, z2)
                second = _SECOND_WEIGHT * np.sum((z2[:3] - target) ** 2)
                cost = residual + (second if following == Outcome.SECTION else _FAILURE)
            if cost < best_cost or best_outcome < 0:
                best_cost, best_alpha, best_kappa = cost, alpha, kappa_2
                best_residual, best_outcome = residual, outcome
                for j in range(3):
                    z_next[j] = z1[j]
        width = (high - low) / (count - 1)
        low = max(least, best_alpha - _NARROWING * width)
        high = min(greatest, best_alpha + _NARROWING * width)
    return best_outcome, best_alpha, best_kappa, best_residual


@compiled
def modified_jacobian(
    at: tuple[Kernel, int, Array],
    aim: Aim,
    controls: Array,
    columns: IntArray,
    work: MapWorkspace,
    found: Derivatives,
) -> int:
    """As :func:`~template_control.slip.maps.return_map.section_jacobian`, with kappa_2 of (38).

    ``at`` are kernel, kind and z. The column of kappa_2 is the last one; along with the others it
    varies by

        dkappa_2 = ((kappa_1 - kappa_2) dmu_3 + (mu_3 - mu_2) dkappa_1) / (mu_3 - mu_1).
    """
    kernel, kind, z = at
    outcome = section_jacobian(kernel, kind, z, controls, columns, work, found)
    if not aim.chooses:
        return outcome
    result, jacobian, last = found.result, found.jacobian, columns.shape[0] - 1
    rest, kappa_1, kappa_2 = kernel.rest_length, controls[Slot.K_SC], controls[Slot.K_SD]
    if not aim.stiffness_range[0] < kappa_2 < aim.stiffness_range[1]:
        return outcome
    mu_1, mu_2, mu_3 = (rest - aim.target[1]) ** 2, (rest - z[1]) ** 2, 0.0
    for leg in range(REAR_BOTTOM, REAR_BOTTOM + 2):
        mu_3 += (rest - result[leg]) ** 2
    for c in range(last):
        slope = mu_3 - mu_2 if columns[c] == PADDED + Slot.K_SC else 0.0
        for leg in range(REAR_BOTTOM, REAR_BOTTOM + 2):
            slope -= 2.0 * (kappa_1 - kappa_2) * (rest - result[leg]) * jacobian[leg, c]
        for i in range(RESULTS):
            jacobian[i, c] += jacobian[i, last] * slope / (mu_3 - mu_1)
    return outcome
