"""Return maps between Poincaré sections (Section II-C), exact or in closed form."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from template_control.arrays import Array, IntArray
from template_control.checks.checked import checked
from template_control.compiled import compiled, constant, inner
from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import NUM_SLOTS, MapKind, Outcome, StrideKind
from template_control.slip.dynamics.closed_form import closed_form_stride
from template_control.slip.dynamics.kernel import Scratch, new_scratch, run_stride
from template_control.slip.dynamics.model import Kernel, stride_kernel
from template_control.slip.dynamics.stride import finite
from template_control.slip.dynamics.tangent import Tangents, new_tangents, stride_tangents
from template_control.slip.maps.section import PADDED, section_of
from template_control.slip.parameters import SlipParameters

_LAST_ONLY, _RECORDED = constant(False), constant(True)
EXACT = constant(MapKind.EXACT)
"""The exact map, for compiled code."""
_DIFFERENCE = 3e-6  # relative; leaves 1e-11 of the third derivative and 1e-9 of rounding

RESULTS = 9
"""Numbers a map yields: dx/dt, y, dy/dt, distance covered, legs' lengths at the bottom, the rear
leg's at touchdown; of the exact map also the times from the section to the touchdown, and from the
rear leg's liftoff to the next section [s]."""

REAR_BOTTOM, FRONT_BOTTOM = 4, 5
"""Places of the legs' lengths at the bottom among them."""
LANDING_TIME, LIFTED_TIME = 7, 8
"""Places of the times."""


class MapWorkspace(NamedTuple):
    """Arrays of strides and of their derivatives; one set a thread."""

    scratch: Scratch
    tangents: Tangents


def new_workspace(*strides: int) -> MapWorkspace:
    """Fresh arrays for one thread; with a number, so many strides are kept (`scratch_of`)."""
    return MapWorkspace(new_scratch(*strides), new_tangents())


class Derivatives(NamedTuple):
    """Result (RESULTS,) of the map and its Jacobian (RESULTS, c), by :func:`section_jacobian`."""

    result: Array
    jacobian: Array


@inner
def _begin(z: Array, scratch: Scratch) -> None:
    """Put a stride's start over the origin, where both toes are, or where it says."""
    state = scratch.state
    state[0], state[1], state[2], state[3] = 0.0, z[1], z[0], z[2]
    scratch.toes[0] = scratch.toes[1] = 0.0
    if z.shape[0] > PADDED:
        state[0], scratch.toes[0], scratch.toes[1] = z[3], z[4], z[5]
    scratch.lengths[0] = scratch.lengths[1] = scratch.lengths[2] = np.nan
    scratch.times[0] = scratch.times[1] = np.nan


@inner
def _conclude(scratch: Scratch, duration: float, result: Array) -> None:
    """Write where a stride has ended, after ``duration`` [s], into ``result`` (RESULTS,)."""
    state, lengths, times = scratch.state, scratch.lengths, scratch.times
    result[0], result[1], result[2], result[3] = state[2], state[1], state[3], state[0]
    result[4], result[5], result[6] = lengths[0], lengths[1], lengths[2]
    result[7], result[8] = times[0], duration - times[1]


@inner
def one_stride(
    kernel: Kernel,
    kind: int,
    z: Array,
    controls: Array,
    scratch: Scratch,
    result: Array,
) -> int:
    """One stride from section to section; returns the Outcome's value.

    ``z`` (3,) are dx/dt, y, dy/dt at the section [m/s, m, m/s], dy/dt is 0 at apex; within a stride
    (6,): also x of CoM, rear and front toe [m]. ``result`` (RESULTS,) is overwritten; lengths are
    NaN of legs that had no bottom or touchdown. ``kind`` is a MapKind's value.
    """
    _begin(z, scratch)
    if kind == EXACT:
        state, toes = scratch.state, scratch.toes
        ended = run_stride(kernel, state, toes, controls, _LAST_ONLY, scratch)
        outcome, duration = ended[0], ended[4]
    else:
        duration = np.nan
        outcome = closed_form_stride(kernel, kind, scratch.state, scratch.toes, controls, scratch)
    _conclude(scratch, duration, result)
    return outcome


@inner
def recorded_stride(
    kernel: Kernel, z: Array, controls: Array, scratch: Scratch, result: Array
) -> int:
    """:func:`one_stride` of the exact map, recorded for :func:`recorded_jacobian`."""
    _begin(z, scratch)
    ended = run_stride(kernel, scratch.state, scratch.toes, controls, _RECORDED, scratch)
    scratch.recorded[0], scratch.recorded[1] = ended[2], ended[3]
    _conclude(scratch, ended[4], result)
    return ended[0]


@inner
def recorded_jacobian(
    kernel: Kernel,
    controls: Array,
    columns: IntArray,
    work: MapWorkspace,
    jacobian: Array,
) -> None:
    """Derivatives (RESULTS, c) of the stride that the scratch has recorded last."""
    scratch, tangents = work
    stride_tangents(kernel, controls, scratch, tangents)
    state, lengths, times = tangents.state, tangents.lengths, tangents.times
    for c in range(columns.shape[0]):
        j = columns[c]
        jacobian[0, c], jacobian[1, c], jacobian[2, c] = state[2, j], state[1, j], state[3, j]
        jacobian[3, c] = state[0, j]
        for leg in range(3):
            jacobian[4 + leg, c] = lengths[leg, j]
        jacobian[7, c], jacobian[8, c] = times[0, j], times[2, j] - times[1, j]


@compiled
def map_many(
    kernel: Kernel,
    kind: int,
    z: Array,
    controls: Array,
    scratch: Scratch,
    result: Array,
    outcome: IntArray,
) -> None:
    """As :func:`one_stride`, for each row of all arrays; ``outcome`` (n,) is overwritten too."""
    for i in range(z.shape[0]):
        outcome[i] = one_stride(kernel, kind, z[i], controls[i], scratch, result[i])


@inner
def _differences(
    kernel: Kernel,
    kind: int,
    z: Array,
    controls: Array,
    columns: IntArray,
    work: MapWorkspace,
    found: Derivatives,
) -> int:
    """:func:`section_jacobian` of a closed form, by central differences."""
    result, jacobian = found
    for c in range(columns.shape[0]):
        j = columns[c]
        inputs, i = (z, j) if j < PADDED else (controls, j - PADDED)
        at = inputs[i]
        # Stiffnesses (1e4 N/m) move by as large a share as speeds do.
        h = _DIFFERENCE * max(abs(at), 1.0)
        inputs[i] = at - h
        before = one_stride(kernel, kind, z, controls, work.scratch, result)
        for k in range(RESULTS):
            jacobian[k, c] = result[k]
        inputs[i] = at + h
        after = one_stride(kernel, kind, z, controls, work.scratch, result)
        inputs[i] = at
        width = 2.0 * h if before == after else np.nan
        for k in range(RESULTS):
            jacobian[k, c] = (result[k] - jacobian[k, c]) / width
    return int(one_stride(kernel, kind, z, controls, work.scratch, result))


@compiled
def section_jacobian(
    kernel: Kernel,
    kind: int,
    z: Array,
    controls: Array,
    columns: IntArray,
    work: MapWorkspace,
    found: Derivatives,
) -> int:
    """:func:`one_stride` with its derivatives, event times included.

    Those of the exact map are exact to rounding (:mod:`~.dynamics.tangent`), those of a closed
    form to about 1e-9 of the value (central differences). ``columns`` (c,) are what to
    differentiate by: 0 to 2 the state, 3 + slot the controls.
    """
    if kind != EXACT:
        return _differences(kernel, kind, z, controls, columns, work, found)
    outcome = recorded_stride(kernel, z, controls, work.scratch, found.result)
    recorded_jacobian(kernel, controls, columns, work, found.jacobian)
    return outcome


class Mapped(NamedTuple):
    """Ends of strides; NaN where one fails.

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
        kernel, work: for compiled code, what a stride is run with and its arrays.

    Raises:
        ParameterError: if there is no such stride.
    """

    @checked
    def __init__(
        self,
        parameters: SlipParameters,
        stride: str = StrideKind.WALK,
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
        self.kernel = stride_kernel(parameters, stride, automaton), int(self.kind)
        self.work = new_workspace()

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
        outcome = one_stride(*self.kernel, self.sections[0].padded(z), u, self.work.scratch, result)
        return result, Outcome(outcome)

    def step(self, z: Array, u: Array) -> tuple[Array, Outcome]:
        """As :meth:`evaluate`, but only the (m,) state at the next section."""
        result, outcome = self.evaluate(z, u)
        return result[: self.dimensions[1]], outcome

    def derivatives(self, z: Array, u: Array, columns: IntArray) -> tuple[Array, Array, Outcome]:
        """As :meth:`evaluate`, with the (RESULTS, c) derivatives of the result after it.

        ``columns`` (c,) are what to differentiate by: 0 to 2 the state, 3 + slot the controls.
        """
        found = Derivatives(np.empty(RESULTS), np.empty((RESULTS, len(columns))))
        # A closed form moves both to and fro.
        padded, controls = np.array(self.sections[0].padded(z)), np.array(u)
        outcome = section_jacobian(*self.kernel, padded, controls, columns, self.work, found)
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
        flat_u = np.array(np.broadcast_to(inputs, (*shape, NUM_SLOTS)), order="C")
        full, flat_u = full.reshape(count, PADDED), flat_u.reshape(count, NUM_SLOTS)
        result, outcome = np.empty((count, RESULTS)), np.empty(count, dtype=np.int64)
        map_many(*self.kernel, full, flat_u, self.work.scratch, result, outcome)
        result[outcome != Outcome.SECTION] = np.nan
        result = result.reshape(*shape, RESULTS)
        return Mapped(
            result[..., : self.dimensions[1]],
            outcome.reshape(shape),
            result[..., PADDED],
            result[..., PADDED + 1 : PADDED + 3],
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
        n, m = self.dimensions
        columns = np.array([*range(n), *range(PADDED, PADDED + NUM_SLOTS)])
        state, controls = finite("state", z, n), finite("controls", u, NUM_SLOTS)
        result, jacobian, outcome = self.derivatives(state, controls, columns)
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
