"""The paper's modified walking controller (Section IV-B): kappa_2 from energy, then alpha.

kappa_1 is given. Equation (38) finds the kappa_2 that brings the template to the wanted
energy at the next VLO for whatever touchdown angle is tried; the angle is searched for.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.tables import Tables
from template_control.slip.automaton.vocabulary import NUM_SLOTS, MapKind, Outcome, Slot
from template_control.slip.dynamics.kernel import Model, Scratch, new_scratch
from template_control.slip.dynamics.stride import kernel_model
from template_control.slip.maps.section_map import RESULTS, section_map
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_K_SC = int(Slot.K_SC)
_K_SD = int(Slot.K_SD)
_STEP = 1e-20  # of a complex step
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
    kind: int,
    node: int,
    z: Array,
    target: Array,
    stiffness_range: Array,
    controls: Array,
    scratch: Scratch,
    result: Array,
) -> int:
    """One step with kappa_2 of (38), kept within ``stiffness_range``.

    Args:
        kind: value of the MapKind.
        target: (3,) the state wanted at the next VLO.
        stiffness_range: (2,) bounds of kappa_2 [N/m].
        controls: (NUM_SLOTS,) touchdown angle and kappa_1; kappa_2 is overwritten.
        The rest as in :func:`~template_control.slip.maps.section_map.section_map`.

    Returns:
        The Outcome's value.
    """
    # The first pass finds the virtual bottom, which kappa_2 does not influence.
    controls[_K_SD] = controls[_K_SC]
    outcome = section_map(tables, model, kind, node, z, controls, scratch, result)
    rear, front = result[4], result[5]
    if not np.isfinite(rear.real):
        return outcome
    wanted = energy_stiffness(z, target, front, rear, controls[_K_SC], model)
    if wanted.real < stiffness_range[0]:
        wanted = stiffness_range[0] + 0.0 * wanted
    elif wanted.real > stiffness_range[1]:
        wanted = stiffness_range[1] + 0.0 * wanted
    controls[_K_SD] = wanted
    return section_map(tables, model, kind, node, z, controls, scratch, result)


@njit(cache=True)
def modified_many(
    tables: Tables,
    model: Model,
    kind: int,
    node: int,
    z: Array,
    target: Array,
    stiffness_range: Array,
    controls: Array,
    scratch: Scratch,
    result: Array,
    outcome: IntArray,
) -> None:
    """:func:`modified_step` from one state for rows of ``controls`` (n, NUM_SLOTS)."""
    for i in range(controls.shape[0]):
        outcome[i] = modified_step(
            tables, model, kind, node, z, target, stiffness_range, controls[i], scratch, result[i]
        )


@njit(cache=True)
def search_angle(
    tables: Tables,
    model: Model,
    kind: int,
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
    z1, z2, u = np.empty(RESULTS), np.empty(RESULTS), np.zeros(NUM_SLOTS)
    best_cost, best_alpha, best_kappa, best_residual = np.inf, nominal_alpha, kappa_1, np.inf
    best_outcome = -1
    low, high = angles[0], angles[1]
    for level in range(3):
        count = 9 if level == 0 else 5
        for i in range(count):
            alpha = low + (high - low) * i / (count - 1)
            u[0], u[_K_SC] = alpha, kappa_1
            outcome = modified_step(
                tables, model, kind, node, z, target, stiffness_range, u, scratch, z1
            )
            kappa_2 = u[_K_SD]
            residual = np.sum((z1[:3] - target) ** 2)
            if outcome != _SECTION:
                cost = 1e6 + residual
            else:
                u[0] = nominal_alpha
                following = modified_step(
                    tables, model, kind, node, z1[:3], target, stiffness_range, u, scratch, z2
                )
                second = np.sum((z2[:3] - target) ** 2)
                cost = residual + (0.1 * second if following == _SECTION else 10.0)
            if cost < best_cost or best_outcome < 0:
                best_cost, best_alpha, best_kappa = cost, alpha, kappa_2
                best_residual, best_outcome = residual, outcome
                z_next[:] = z1[:3]
        width = (high - low) / (count - 1)
        low = max(angles[0], best_alpha - 0.75 * width)
        high = min(angles[1], best_alpha + 0.75 * width)
    return best_outcome, best_alpha, best_kappa, best_residual


class ModifiedMap:
    """The VLO return map with kappa_2 by (38), for :class:`~.step_solver.StepProblem`.

    Args:
        parameters: the template.
        kind: of return map.
        stiffness_range: bounds of kappa_2 [N/m].

    Attributes:
        target: (3,) VLO state whose energy kappa_2 aims at.

    The methods overwrite kappa_2 in the controls they are given.
    """

    dimensions = (3, 3)

    def __init__(
        self, parameters: SlipParameters, kind: MapKind, stiffness_range: tuple[float, float]
    ) -> None:
        self.parameters = parameters
        self.target = np.zeros(3)
        self._range = np.array(stiffness_range)
        node = AUTOMATON.index[STRIDE_START["w"]]
        self._kernel = AUTOMATON.tables, kernel_model(parameters), int(kind), node
        self._scratch, self._complex_scratch = new_scratch(), new_scratch(complex)

    def evaluate(self, z: Array, u: Array) -> tuple[Array, Outcome]:
        """See :meth:`~template_control.slip.maps.return_map.ReturnMap.evaluate`."""
        result = np.empty(RESULTS)
        outcome = modified_step(
            *self._kernel, z, self.target, self._range, u, self._scratch, result
        )
        return result, Outcome(outcome)

    def evaluate_many(self, z: Array, u: Array) -> tuple[Array, IntArray]:
        """See :meth:`~template_control.slip.maps.return_map.ReturnMap.evaluate_many`."""
        result, outcome = np.empty((len(u), RESULTS)), np.empty(len(u), dtype=np.int64)
        modified_many(*self._kernel, z, self.target, self._range, u, self._scratch, result, outcome)
        return result, outcome

    def derivatives(self, z: Array, u: Array, columns: IntArray) -> tuple[Array, Array, Outcome]:
        """See ``derivatives``; kappa_2 varies along with u."""
        jacobian = np.empty((RESULTS, len(columns)))
        result, outcome = self.evaluate(z, u)
        if outcome is not Outcome.SECTION:
            return result, np.full_like(jacobian, np.nan), outcome
        zc = np.array(z, dtype=complex)
        for c, column in enumerate(columns):
            uc = u.astype(complex)
            uc[column - 3] += 1j * _STEP
            step = np.empty(RESULTS, dtype=complex)
            modified_step(
                *self._kernel, zc, self.target, self._range, uc, self._complex_scratch, step
            )
            jacobian[:, c] = step.imag / _STEP
        return result, jacobian, outcome
