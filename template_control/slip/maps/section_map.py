"""Compiled return maps from section to section, exact or in closed form, and their Jacobians."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from template_control.compiled import compiled, inner, inner_by_type
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.dynamics.closed_form import closed_form_stride
from template_control.slip.dynamics.kernel import Scratch, run_stride
from template_control.slip.dynamics.model import Kernel

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Numba would compile the stride once more for a literal False.
_LAST_ONLY = np.bool_(False)
_STEP = 1e-20  # of a complex step: its square vanishes against 1

RESULTS = 6
"""Numbers a map yields: dx/dt, y, dy/dt, distance covered, legs' lengths at the bottom."""


class Derivatives(NamedTuple):
    """What :func:`section_jacobian` writes.

    Attributes:
        result: (RESULTS,) of the map.
        jacobian: (RESULTS, c) its derivatives.
    """

    result: Array
    jacobian: Array


def closed_form(kind: MapKind) -> int | None:
    """``kind`` as the compiled maps take it: its value, or None for the exact map.

    None is a type of its own, so that only the maps which are asked for are compiled.
    """
    return None if kind is MapKind.EXACT else int(kind)


def _stride(
    kernel: Kernel, kind: int | None, state: Array, toes: Array, controls: Array, scratch: Scratch
) -> int:
    """One stride from ``state``, which is overwritten; returns the Outcome's value."""
    if kind is None:
        return int(run_stride(kernel, state, toes, controls, _LAST_ONLY, scratch)[0])
    return int(closed_form_stride(kernel, kind, state, toes, controls, scratch))


@inner_by_type(_stride)
def _branch(kernel: Any, kind: Any, state: Any, toes: Any, controls: Any, scratch: Any) -> Any:
    """The branch of :func:`_stride` that the type of ``kind`` takes: Numba would compile both."""

    def exact(kernel: Any, kind: Any, state: Any, toes: Any, controls: Any, scratch: Any) -> Any:
        return run_stride(kernel, state, toes, controls, _LAST_ONLY, scratch)[0]

    def closed(kernel: Any, kind: Any, state: Any, toes: Any, controls: Any, scratch: Any) -> Any:
        return closed_form_stride(kernel, kind, state, toes, controls, scratch)

    return exact if isinstance(kind, types.NoneType) else closed


@inner
def one_stride(
    kernel: Kernel,
    kind: int | None,
    z: Array,
    controls: Array,
    scratch: Scratch,
    result: Array,
) -> int:
    """One stride from section to section; returns the Outcome's value.

    Args:
        kernel: automaton, template and the stride's first node.
        kind: from :func:`closed_form`.
        z: (3,) dx/dt, y, dy/dt at the section [m/s, m, m/s]; dy/dt is 0 at apex.
        controls: (NUM_SLOTS,) u by Slot.
        scratch: overwritten.
        result: (RESULTS,) overwritten: dx/dt, y, dy/dt at the next section, the distance
            covered [m], lengths of rear and front leg at the (virtual) bottom [m], NaN if
            there was none.
    """
    state, toes, bottom = scratch.state, scratch.toes, scratch.bottom
    state[0], state[1], state[2], state[3] = 0.0, z[1], z[0], z[2]
    toes[0] = toes[1] = 0.0
    bottom[0] = bottom[1] = np.nan
    outcome = _stride(kernel, kind, state, toes, controls, scratch)
    result[0], result[1], result[2], result[3] = state[2], state[1], state[3], state[0]
    result[4], result[5] = bottom[0], bottom[1]
    return outcome


@inner
def section_map(
    kernel: Kernel,
    kind: int | None,
    z: Array,
    controls: Array,
    scratch: Scratch,
    result: Array,
) -> int:
    """:func:`one_stride` for Python; compiled functions call that.

    Args:
        The rest as in :func:`one_stride`.
    """
    return one_stride(kernel, kind, z, controls, scratch, result)


@compiled
def map_many(
    kernel: Kernel,
    kind: int | None,
    z: Array,
    controls: Array,
    scratch: Scratch,
    result: Array,
    outcome: IntArray,
) -> None:
    """As :func:`one_stride`, stride by stride.

    Args:
        kernel, kind, scratch: as for :func:`one_stride`.
        z: (n, 3) states at the section.
        controls: (n, NUM_SLOTS) u of each stride.
        result: (n, RESULTS) overwritten.
        outcome: (n,) overwritten with the Outcomes' values.
    """
    for i in range(z.shape[0]):
        outcome[i] = one_stride(kernel, kind, z[i], controls[i], scratch, result[i])


@compiled
def section_jacobian(
    kernel: Kernel,
    kind: int | None,
    z: Array,
    controls: Array,
    columns: IntArray,
    scratch: Scratch,
    found: Derivatives,
) -> int:
    """:func:`one_stride` with its derivatives, exact to rounding, by complex steps.

    The imaginary part of each event's time is the derivative that the saltation matrix
    accounts for; nothing is differenced.

    Args:
        columns: (c,) what to differentiate by: 0 to 2 the state, 3 + slot the controls.
        scratch: complex, from ``new_scratch(complex)``.
        found: overwritten.
        The rest as in :func:`one_stride`.
    """
    result, jacobian = found
    zc, uc = np.empty(z.shape[0], np.complex128), np.empty(controls.shape[0], np.complex128)
    for i in range(z.shape[0]):
        zc[i] = z[i]
    for i in range(controls.shape[0]):
        uc[i] = controls[i]
    out = np.empty(RESULTS, np.complex128)
    outcome = 0
    for c in range(columns.shape[0]):
        j = columns[c]
        # Scaled so that stiffnesses (1e4 N/m) move as much as speeds do.
        h = _STEP * max(abs(z[j] if j < 3 else controls[j - 3]), 1.0)
        if j < 3:
            zc[j] += 1j * h
        else:
            uc[j - 3] += 1j * h
        outcome = one_stride(kernel, kind, zc, uc, scratch, out)
        if j < 3:
            zc[j] = z[j]
        else:
            uc[j - 3] = controls[j - 3]
        for i in range(RESULTS):
            jacobian[i, c] = out[i].imag / h
    for i in range(RESULTS):
        result[i] = out[i].real
    return outcome
