"""Return maps between Poincaré sections (Section II-C), exact or in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from template_control.checks.checked import checked
from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import NUM_SLOTS, MapKind, Outcome
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import stride_kernel
from template_control.slip.maps.section import PADDED, section_of
from template_control.slip.maps.section_map import (
    RESULTS,
    Derivatives,
    closed_form,
    map_many,
    section_jacobian,
    section_map,
)
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Mapped(NamedTuple):
    """Where strides end; NaN where one fails.

    Attributes:
        state: (..., m) at the next section.
        outcome: (...) values of the :class:`~template_control.slip.automaton.vocabulary.Outcome`.
        advance: (...) horizontal distance covered by the CoM [m].
        bottom: (..., 2) length of rear and front leg at the (virtual) bottom [m].
    """

    state: Array
    outcome: IntArray
    advance: Array
    bottom: Array


class Linearisation(NamedTuple):
    """A return map at one state, to first order.

    Attributes:
        state: (m,) at the next section.
        outcome: how the stride ended.
        state_jacobian: (m, n) derivative with respect to the state.
        control_jacobian: (m, NUM_SLOTS) derivative with respect to the controls.
    """

    state: Array
    outcome: Outcome
    state_jacobian: Array
    control_jacobian: Array


class ReturnMap:
    """The map of one kind of stride from its section to the next: (5), (7), (39), (42).

    One object serves one thread: it owns the compiled kernel's scratch arrays.

    Args:
        parameters: the template.
        stride: key of the automaton's ``starts``: "w" and, with push-off, "wp" (VLO to VLO),
            "r" (apex to apex), "wr" (VLO to apex), "rw" (apex to VLO), or "wr*", the walk-to-run
            stride as its controller simplifies it.
        kind: exact, or one of the closed forms.
        automaton: that the stride is of.

    Attributes:
        sections: the sections that a stride starts from and ends at.
        dimensions: sizes n and m of the states at these sections.

    Raises:
        ParameterError: if there is no such stride.
    """

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        stride: str = "w",
        kind: MapKind = MapKind.EXACT,
        automaton: Automaton = AUTOMATON,
    ) -> None:
        start = automaton.start(stride).name
        self.parameters = parameters
        self.stride = stride
        self.kind = MapKind(kind)
        begin, end = automaton.sections(start)
        self.sections = section_of(begin), section_of(end)
        self.dimensions = self.sections[0].dimension, self.sections[1].dimension
        self._kernel = stride_kernel(parameters, stride, automaton), closed_form(self.kind)
        self._scratch = new_scratch()
        self._complex_scratch = new_scratch(complex)

    def evaluate(self, z: Array, u: Array) -> tuple[Array, Outcome]:
        """One stride without checks, for inner loops.

        Args:
            z: (n,) state at the section.
            u: (NUM_SLOTS,) controls.

        Returns:
            (RESULTS,) dx/dt, y, dy/dt at the next section, where the outcome is SECTION,
            distance covered, legs' lengths at the bottom; the outcome.
        """
        result = np.empty(RESULTS)
        outcome = section_map(*self._kernel, self.sections[0].padded(z), u, self._scratch, result)
        return result, Outcome(outcome)

    def step(self, z: Array, u: Array) -> tuple[Array, Outcome]:
        """As :meth:`evaluate`, but only the (m,) state at the next section."""
        result, outcome = self.evaluate(z, u)
        return result[: self.dimensions[1]], outcome

    def evaluate_many(self, z: Array, u: Array) -> tuple[Array, IntArray]:
        """As :meth:`evaluate` for controls ``u`` (n, NUM_SLOTS) from one state ``z``."""
        return self._many(np.tile(self.sections[0].padded(z), (len(u), 1)), u)

    def _many(self, z: Array, u: Array) -> tuple[Array, IntArray]:
        result, outcome = np.empty((len(z), RESULTS)), np.empty(len(z), dtype=np.int64)
        map_many(*self._kernel, z, u, self._scratch, result, outcome)
        return result, outcome

    def derivatives(self, z: Array, u: Array, columns: IntArray) -> tuple[Array, Array, Outcome]:
        """One stride and chosen derivatives without checks, for inner loops.

        Args:
            z: (n,) state at the section.
            u: (NUM_SLOTS,) controls.
            columns: (c,) what to differentiate by: 0 to 2 the state, 3 + slot the controls.

        Returns:
            (RESULTS,) as :meth:`evaluate`; its (RESULTS, c) derivatives; the outcome.
        """
        found = Derivatives(np.empty(RESULTS), np.empty((RESULTS, len(columns))))
        try:
            outcome = section_jacobian(
                *self._kernel, self.sections[0].padded(z), u, columns, self._complex_scratch, found
            )
        except ZeroDivisionError:
            # Where a real division gives NaN, Numba's complex one raises. It happens in strides
            # that fail, such as on a leg without stiffness; there is no derivative to lose.
            result, ended = self.evaluate(z, u)
            return result, np.full_like(found.jacobian, np.nan), ended
        return *found, Outcome(outcome)

    def __call__(self, z: ArrayLike, u: ArrayLike) -> Mapped:
        """Strides from one state or many, with the same controls or each its own.

        Args:
            z: (..., n) states at the section.
            u: (..., NUM_SLOTS) controls; the leading shapes broadcast.

        Raises:
            ParameterError: for a wrong shape or a number that is not finite.
        """
        states = _checked("state", z, self.dimensions[0])
        inputs = _checked("controls", u, NUM_SLOTS)
        shape = np.broadcast_shapes(states.shape[:-1], inputs.shape[:-1])
        count = int(np.prod(shape, dtype=np.int64))
        full = self.sections[0].padded(np.broadcast_to(states, (*shape, states.shape[-1])))
        flat_u = np.empty((*shape, NUM_SLOTS))
        flat_u[...] = inputs
        result, outcome = self._many(full.reshape(count, PADDED), flat_u.reshape(count, NUM_SLOTS))
        result[outcome != Outcome.SECTION] = np.nan
        result = result.reshape(*shape, RESULTS)
        return Mapped(
            result[..., : self.dimensions[1]],
            outcome.reshape(shape),
            result[..., PADDED],
            result[..., PADDED + 1 :],
        )

    def linearise(self, z: ArrayLike, u: ArrayLike) -> Linearisation:
        """One stride and its derivatives, event times included, exact to rounding.

        The derivatives of a stride that fails mean nothing, and may be NaN.

        Args:
            z: (n,) state at the section.
            u: (NUM_SLOTS,) controls.

        Raises:
            ParameterError: for a wrong shape or a number that is not finite.
        """
        states = _checked("state", z, self.dimensions[0])
        inputs = _checked("controls", u, NUM_SLOTS)
        if states.ndim != 1 or inputs.ndim != 1:
            raise ParameterError("linearise takes one state and one control vector")
        n, m = self.dimensions
        columns: Sequence[int] = [*range(n), *range(PADDED, PADDED + NUM_SLOTS)]
        result, jacobian, outcome = self.derivatives(states, inputs, np.array(columns))
        return Linearisation(result[:m], outcome, jacobian[:m, :n], jacobian[:m, n:])


def _checked(name: str, values: ArrayLike, size: int) -> Array:
    array = np.array(values, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != size:
        raise ParameterError(
            f"{name} has shape {array.shape}: the last axis must hold {size} numbers"
        )
    if not np.all(np.isfinite(array)):
        raise ParameterError(f"{name} holds a number that is not finite: give finite ones")
    return array
