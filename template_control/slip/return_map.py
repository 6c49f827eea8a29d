"""Return maps between Poincaré sections (Section II-C), exact or in closed form."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from template_control.errors import ParameterError
from template_control.slip.automaton import AUTOMATON, STRIDE_START
from template_control.slip.kernel import new_scratch
from template_control.slip.parameters import SlipParameters
from template_control.slip.section_map import map_many, section_jacobian, section_map
from template_control.slip.stride import kernel_model
from template_control.slip.tables import TABLES
from template_control.slip.vocabulary import NUM_SLOTS, Event, MapKind, Outcome

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

DIMENSION = {Event.VLO: 3, Event.APEX: 2}
"""Size of a section's state: dx/dt, y, dy/dt at VLO (8), dx/dt, y at apex (4)."""


class Mapped(NamedTuple):
    """Where strides end; NaN where one fails.

    Attributes:
        state: (..., m) at the next section.
        outcome: (...) values of the :class:`~.vocabulary.Outcome`.
        advance: (...) horizontal distance covered by the CoM [m].
    """

    state: Array
    outcome: IntArray
    advance: Array


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

    Args:
        parameters: the template.
        stride: key of :data:`~.automaton.STRIDE_START`: "w" (VLO to VLO), "r" (apex to
            apex), "wr" (VLO to apex), "rw" (apex to VLO), or "wr*", the walk-to-run stride
            as its controller simplifies it.
        kind: exact, or one of the closed forms.

    Attributes:
        dimensions: sizes of the state at the section it starts from and it ends at.

    Raises:
        ParameterError: if there is no such stride.

    One object serves one thread: it owns the compiled kernel's scratch arrays.
    """

    def __init__(
        self, parameters: SlipParameters, stride: str = "w", kind: MapKind = MapKind.EXACT
    ) -> None:
        if stride not in STRIDE_START:
            raise ParameterError(f"no stride {stride!r}: give one of {', '.join(STRIDE_START)}")
        self.parameters = parameters
        self.stride = stride
        self.kind = kind
        begin, end = AUTOMATON.sections(STRIDE_START[stride])
        self.dimensions = DIMENSION[begin], DIMENSION[end]
        self._node = AUTOMATON.index[STRIDE_START[stride]]
        self._model = kernel_model(parameters)
        self._scratch = new_scratch()
        self._complex_scratch = new_scratch(complex)

    def step(self, z: Array, u: Array) -> tuple[Array, Outcome]:
        """One stride without checks, for inner loops.

        Args:
            z: (n,) state at the section.
            u: (NUM_SLOTS,) controls.

        Returns:
            (m,) state at the next section, where the outcome is SECTION; the outcome.
        """
        z_next = np.empty(self.dimensions[1])
        outcome = section_map(
            TABLES, self._model, self.kind, self._node, z, u, self._scratch, z_next
        )
        return z_next, Outcome(outcome)

    def __call__(self, z: ArrayLike, u: ArrayLike) -> Mapped:
        """Strides from one state or many, with the same controls or each its own.

        Args:
            z: (..., n) states at the section.
            u: (..., NUM_SLOTS) controls; the leading shapes broadcast.

        Raises:
            ParameterError: for a wrong shape or a number that is not finite.
        """
        states = self._checked("state", z, self.dimensions[0])
        inputs = self._checked("controls", u, NUM_SLOTS)
        shape = np.broadcast_shapes(states.shape[:-1], inputs.shape[:-1])
        count = int(np.prod(shape, dtype=np.int64))
        flat_z = np.broadcast_to(states, (*shape, states.shape[-1])).reshape(count, -1)
        flat_u = np.broadcast_to(inputs, (*shape, NUM_SLOTS)).reshape(count, -1)
        z_next = np.empty((count, self.dimensions[1]))
        advance = np.empty(count)
        outcome = np.empty(count, dtype=np.int64)
        map_many(
            TABLES,
            self._model,
            self.kind,
            self._node,
            np.ascontiguousarray(flat_z),
            np.ascontiguousarray(flat_u),
            self._scratch,
            z_next,
            advance,
            outcome,
        )
        failed = outcome != Outcome.SECTION
        z_next[failed], advance[failed] = np.nan, np.nan
        return Mapped(z_next.reshape(*shape, -1), outcome.reshape(shape), advance.reshape(shape))

    def linearise(self, z: ArrayLike, u: ArrayLike) -> Linearisation:
        """One stride and its derivatives, event times included, exact to rounding.

        Args:
            z: (n,) state at the section.
            u: (NUM_SLOTS,) controls.

        Raises:
            ParameterError: for a wrong shape or a number that is not finite.
        """
        states = self._checked("state", z, self.dimensions[0])
        inputs = self._checked("controls", u, NUM_SLOTS)
        if states.ndim != 1 or inputs.ndim != 1:
            raise ParameterError("linearise takes one state and one control vector")
        n, m = self.dimensions
        z_next, a, b = np.empty(m), np.empty((m, n)), np.empty((m, NUM_SLOTS))
        outcome = section_jacobian(
            TABLES,
            self._model,
            self.kind,
            self._node,
            states,
            inputs,
            self._complex_scratch,
            z_next,
            a,
            b,
        )
        return Linearisation(z_next, Outcome(outcome), a, b)

    @staticmethod
    def _checked(name: str, values: ArrayLike, size: int) -> Array:
        array = np.array(values, dtype=np.float64)
        if array.ndim == 0 or array.shape[-1] != size:
            raise ParameterError(
                f"{name} has shape {array.shape}: the last axis must hold {size} numbers"
            )
        if not np.all(np.isfinite(array)):
            raise ParameterError(f"{name} holds a number that is not finite: give finite ones")
        return array
