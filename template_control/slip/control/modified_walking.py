"""The paper's modified walking controller (Section IV-B): kappa_2 from energy, then alpha.

kappa_1 is given. Equation (38) finds the kappa_2 that brings the template to the wanted
energy at the next VLO for whatever touchdown angle is tried; the angle is searched for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.slip.automaton.vocabulary import NUM_SLOTS, MapKind, Outcome, Slot, StrideKind
from template_control.slip.dynamics.kernel import Scratch
from template_control.slip.dynamics.model import Kernel, Model, model_of, stride_kernel
from template_control.slip.maps.return_map import (
    RESULTS,
    Derivatives,
    closed_form,
    new_workspace,
    one_stride,
    section_jacobian,
)
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_K_SC = int(Slot.K_SC)
_K_SD = int(Slot.K_SD)
_SECTION = int(Outcome.SECTION)


class Aim(NamedTuple):
    """Target (3,) of a step, dx/dt, y, dy/dt at the next VLO, and bounds (2,) of kappa_2."""

    target: Array
    stiffness_range: Array


class AngleSearch(NamedTuple):
    """Parameters of :func:`search_angle`.

    Attributes:
        nominal: angle of the step after the first [rad].
        least, greatest: angles to try [rad].
        kappa_1: stiffness before the virtual bottom [N/m].
        coarse, fine: angles of the first grid, over all of the range, and of each later one.
        grids: how many, each about the best angle of the one before.
        narrowing: half-width of a grid over the spacing of the one before: under 1, so that its
            outer angles are not those just tried.
        second_weight: of the squared residual after the second step, the first's counting 1; small,
            as the first is to reach the target.
        failure: counts in place of it where the second step fails [m^2/s^2]; more than any
            residual, so that a step after which the template walks on goes before.
        fall: added where the first step itself fails [m^2/s^2].
    """

    nominal: float
    least: float
    greatest: float
    kappa_1: float
    coarse: int = 9
    fine: int = 5
    grids: int = 3
    narrowing: float = 0.75
    second_weight: float = 0.1
    failure: float = 10.0
    fall: float = 1e6


@compiled
def energy_stiffness(
    z: Array,
    target: Array,
    front_length: float,
    rear_length: float,
    kappa_1: float,
    model: Model,
) -> float:
    """Stiffness kappa_2 after the virtual bottom, equation (38) [N/m].

    ``z``, ``target`` (3,) are dx/dt, y, dy/dt at this VLO and wanted at the next; lengths are the
    legs' at the virtual bottom [m], before which the stiffness is ``kappa_1`` [N/m].
    """
    rest_length = model.rest_length
    mu_1 = (rest_length - target[1]) ** 2
    mu_2 = (rest_length - z[1]) ** 2
    mu_3 = (rest_length - front_length) ** 2 + (rest_length - rear_length) ** 2
    kinetic = target[0] ** 2 + target[2] ** 2 - z[0] ** 2 - z[2] ** 2
    mu_4 = model.mass * (kinetic + 2.0 * model.gravity * (target[1] - z[1]))
    return (mu_4 + (mu_3 - mu_2) * kappa_1) / (mu_3 - mu_1)


@compiled
def modified_step(
    kernel: Kernel,
    kind: int | None,
    z: Array,
    aim: Aim,
    controls: Array,
    scratch: Scratch,
    result: Array,
) -> int:
    """One step with kappa_2 of (38), kept within its bounds; returns the Outcome's value.

    As :func:`~template_control.slip.maps.return_map.one_stride`; ``controls`` have touchdown angle
    and kappa_1, and kappa_2 is overwritten.
    """
    stiffness_range = aim.stiffness_range
    # The first pass finds the virtual bottom, which kappa_2 does not influence.
    controls[_K_SD] = controls[_K_SC]
    outcome = one_stride(kernel, kind, z, controls, scratch, result)
    rear, front = result[4], result[5]
    if not np.isfinite(rear):
        return outcome
    wanted = energy_stiffness(z, aim.target, front, rear, controls[_K_SC], model_of(kernel))
    controls[_K_SD] = min(max(wanted, stiffness_range[0]), stiffness_range[1])
    return one_stride(kernel, kind, z, controls, scratch, result)


@compiled
def modified_many(
    kernel: Kernel, kind: int | None, z: Array, aim: Aim, controls: Array, scratch: Scratch
) -> tuple[Array, IntArray]:
    """As :func:`modified_step`, from one state with rows of ``controls`` (n, NUM_SLOTS).

    Returns (n, RESULTS) results and (n,) values of the outcomes.
    """
    count = controls.shape[0]
    result, outcome = np.empty((count, RESULTS)), np.empty(count, np.int64)
    for i in range(count):
        outcome[i] = modified_step(kernel, kind, z, aim, controls[i], scratch, result[i])
    return result, outcome


@compiled
def search_angle(
    kernel: Kernel,
    kind: int | None,
    z: Array,
    aim: Aim,
    search: AngleSearch,
    scratch: Scratch,
    z_next: Array,
) -> tuple[int, float, float, float]:
    """Touchdown angle whose step ends nearest ``target``, equations (36) and (37).

    A step is judged with the one after it (at the nominal angle), so that of two poor steps the one
    is taken from which the gait can be reached. ``z_next`` (3,) is overwritten with the VLO state
    after the step; the rest as in :func:`modified_step`. Returns outcome, alpha [rad], kappa_2
    [N/m] and the squared residual of the first step.
    """
    z1, z2, u = np.empty(RESULTS), np.empty(RESULTS), np.zeros(NUM_SLOTS)
    target, nominal, kappa_1 = aim.target, search.nominal, search.kappa_1
    best_cost, best_alpha, best_kappa, best_residual = np.inf, nominal, kappa_1, np.inf
    best_outcome = -1
    low, high = search.least, search.greatest
    for grid in range(search.grids):
        count = search.coarse if grid == 0 else search.fine
        for i in range(count):
            alpha = low + (high - low) * i / (count - 1)
            u[0], u[_K_SC] = alpha, kappa_1
            outcome = modified_step(kernel, kind, z, aim, u, scratch, z1)
            kappa_2 = u[_K_SD]
            residual = np.sum((z1[:3] - target) ** 2)
            if outcome != _SECTION:
                cost = search.fall + residual
            else:
                u[0] = nominal
                following = modified_step(kernel, kind, z1[:3], aim, u, scratch, z2)
                second = search.second_weight * np.sum((z2[:3] - target) ** 2)
                cost = residual + (second if following == _SECTION else search.failure)
            if cost < best_cost or best_outcome < 0:
                best_cost, best_alpha, best_kappa = cost, alpha, kappa_2
                best_residual, best_outcome = residual, outcome
                for j in range(3):
                    z_next[j] = z1[j]
        width = (high - low) / (count - 1)
        low = max(search.least, best_alpha - search.narrowing * width)
        high = min(search.greatest, best_alpha + search.narrowing * width)
    return best_outcome, best_alpha, best_kappa, best_residual


class ModifiedMap:
    """The VLO return map with kappa_2 by (38), as a :class:`~.stride_solver.Step`.

    The methods overwrite kappa_2 [N/m], kept in ``stiffness_range``, in the controls they are
    given; it aims at the energy of ``target``, a (3,) VLO state.
    """

    dimensions = (3, 3)

    def __init__(
        self, parameters: SlipParameters, kind: MapKind, stiffness_range: tuple[float, float]
    ) -> None:
        self.parameters = parameters
        self.target = np.zeros(3)
        self._range = np.array(stiffness_range)
        self._kernel = stride_kernel(parameters, StrideKind.WALK), closed_form(kind)
        self._work = new_workspace()

    @property
    def _aim(self) -> Aim:
        return Aim(self.target, self._range)

    def evaluate(self, z: Array, u: Array) -> tuple[Array, Outcome]:
        """See :meth:`~.stride_solver.Step.evaluate`."""
        result = np.empty(RESULTS)
        outcome = modified_step(*self._kernel, z, self._aim, u, self._work.scratch, result)
        return result, Outcome(outcome)

    def evaluate_many(self, z: Array, u: Array) -> tuple[Array, IntArray]:
        """See :meth:`~.stride_solver.Step.evaluate_many`."""
        found: tuple[Array, IntArray] = modified_many(
            *self._kernel, z, self._aim, u, self._work.scratch
        )
        return found

    def derivatives(self, z: Array, u: Array, columns: IntArray) -> tuple[Array, Array, Outcome]:
        """See :meth:`~.stride_solver.Step.derivatives`; kappa_2 of (38) varies along with u.

        dkappa_2 = ((kappa_1 - kappa_2) dmu_3 + (mu_3 - mu_2) dkappa_1) / (mu_3 - mu_1).
        """
        result, outcome = self.evaluate(z, u)
        if outcome is not Outcome.SECTION:
            return result, np.full((RESULTS, len(columns)), np.nan), outcome
        # kappa_2 comes last: how it varies follows from the legs' lengths at the bottom.
        every = np.append(columns, 3 + _K_SD)
        found = Derivatives(np.empty(RESULTS), np.empty((RESULTS, len(every))))
        section_jacobian(*self._kernel, np.array(z), np.array(u), every, self._work, found)
        jacobian = found.jacobian[:, :-1]
        low, high = self._range
        if low < u[_K_SD] < high:
            compressed = self.parameters.rest_length - result[4:6]
            released = self.parameters.rest_length - np.array([z[1], self.target[1]])
            mu_2, mu_1 = np.square(released)
            mu_3, mu_3_slopes = compressed @ compressed, -2.0 * compressed @ jacobian[4:6]
            slopes = (u[_K_SC] - u[_K_SD]) * mu_3_slopes + (mu_3 - mu_2) * (columns == 3 + _K_SC)
            jacobian = jacobian + np.outer(found.jacobian[:, -1], slopes / (mu_3 - mu_1))
        return result, jacobian, outcome
