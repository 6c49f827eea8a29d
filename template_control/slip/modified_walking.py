"""The paper's modified walking controller (Section IV-B): kappa_2 from energy, then alpha.

kappa_1 is given. Equation (38) finds the kappa_2 that brings the template to the wanted
energy at the next VLO for whatever touchdown angle is tried; the angle is searched for.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from template_control.slip.kernel import MAX_EVENTS, Model, Scratch, run_stride
from template_control.slip.tables import Tables
from template_control.slip.vocabulary import Event, Outcome

Array = NDArray[np.float64]

_VIRTUAL_BOTTOM = int(Event.VIRTUAL_BOTTOM)
_SECTION = int(Outcome.SECTION)


@njit(cache=True)
def energy_stiffness(
    z: Array,
    target: Array,
    front_length: float,
    rear_length: float,
    kappa_1: float,
    model: Model,
) -> float:
    """Stiffness kappa_2 after the virtual bottom, equation (38) [N/m].

    Args:
        z, target: (3,) dx/dt, y, dy/dt at this VLO and wanted at the next.
        front_length, rear_length: of the legs at the virtual bottom [m].
        kappa_1: stiffness before the virtual bottom [N/m].
        model: the template.
    """
    rest_length = model.rest_length
    mu_1 = (rest_length - target[1]) ** 2
    mu_2 = (rest_length - z[1]) ** 2
    mu_3 = (rest_length - front_length) ** 2 + (rest_length - rear_length) ** 2
    kinetic = target[0] ** 2 + target[2] ** 2 - z[0] ** 2 - z[2] ** 2
    mu_4 = model.mass * (kinetic + 2.0 * model.gravity * (target[1] - z[1]))
    return (mu_4 + (mu_3 - mu_2) * kappa_1) / (mu_3 - mu_1)


@njit(cache=True)
def modified_step(
    tables: Tables,
    model: Model,
    node: int,
    z: Array,
    target: Array,
    alpha: float,
    kappa_1: float,
    stiffness_range: Array,
    scratch: Scratch,
    z_next: Array,
) -> tuple[int, float]:
    """One step with angle ``alpha`` and kappa_2 of (38), kept within ``stiffness_range``.

    Args:
        stiffness_range: (2,) bounds of kappa_2 [N/m].
        z_next: (3,) overwritten with the next VLO state.
        The rest as in :func:`energy_stiffness` and :func:`~.kernel.run_stride`.

    Returns:
        Outcome, kappa_2 [N/m].
    """
    events = scratch.events
    state, toes, controls = np.empty(4), np.zeros(2), np.zeros(5)
    controls[0], controls[1] = alpha, kappa_1
    kappa_2 = kappa_1
    for attempt in range(2):
        # The first pass finds the virtual bottom, which kappa_2 does not influence.
        controls[2] = kappa_2
        state[0], state[1], state[2], state[3] = 0.0, z[1], z[0], z[2]
        toes[:] = 0.0
        outcome, _, _, count, _ = run_stride(
            tables, model, node, state, toes, controls, True, scratch
        )
        if attempt == 1:
            break
        toe = -1.0
        for i in range(min(count, MAX_EVENTS)):
            x, y = events[i, 4], events[i, 5]
            if i == 0:
                toe = x + model.rest_length * np.cos(alpha)
            if events[i, 1] == _VIRTUAL_BOTTOM:
                front, rear = np.hypot(x - toe, y), np.hypot(x, y)
                wanted = energy_stiffness(z, target, front, rear, kappa_1, model)
                kappa_2 = min(max(wanted, stiffness_range[0]), stiffness_range[1])
        if kappa_2 == kappa_1 and outcome != _SECTION:
            break
    z_next[0], z_next[1], z_next[2] = state[2], state[1], state[3]
    return outcome, kappa_2


@njit(cache=True)
def search_angle(
    tables: Tables,
    model: Model,
    node: int,
    z: Array,
    target: Array,
    nominal_alpha: float,
    angles: Array,
    kappa_1: float,
    stiffness_range: Array,
    scratch: Scratch,
    z_next: Array,
) -> tuple[int, float, float, float]:
    """Touchdown angle whose step ends nearest ``target``, equations (36) and (37).

    A step is judged with the one after it (at ``nominal_alpha``), so that of two poor steps
    the one is taken from which the gait can be reached.

    Args:
        angles: (2,) least and greatest angle to try [rad].
        The rest as in :func:`modified_step`.

    Returns:
        Outcome, alpha [rad], kappa_2 [N/m], squared residual of the first step.
    """
    z1, z2 = np.empty(3), np.empty(3)
    best_cost, best_alpha, best_kappa, best_residual = np.inf, nominal_alpha, kappa_1, np.inf
    best_outcome = -1
    low, high = angles[0], angles[1]
    for level in range(3):
        count = 9 if level == 0 else 5
        for i in range(count):
            alpha = low + (high - low) * i / (count - 1)
            outcome, kappa_2 = modified_step(
                tables, model, node, z, target, alpha, kappa_1, stiffness_range, scratch, z1
            )
            residual = np.sum((z1 - target) ** 2)
            if outcome != _SECTION:
                cost = 1e6 + residual
            else:
                following, _ = modified_step(
                    tables,
                    model,
                    node,
                    z1,
                    target,
                    nominal_alpha,
                    kappa_1,
                    stiffness_range,
                    scratch,
                    z2,
                )
                second = np.sum((z2 - target) ** 2)
                cost = residual + (0.1 * second if following == _SECTION else 10.0)
            if cost < best_cost or best_outcome < 0:
                best_cost, best_alpha, best_kappa = cost, alpha, kappa_2
                best_residual, best_outcome = residual, outcome
                z_next[:] = z1
        width = (high - low) / (count - 1)
        low = max(angles[0], best_alpha - 0.75 * width)
        high = min(angles[1], best_alpha + 0.75 * width)
    return best_outcome, best_alpha, best_kappa, best_residual
