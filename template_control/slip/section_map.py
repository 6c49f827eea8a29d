"""Compiled return maps from section to section, exact or in closed form, and their Jacobians."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from template_control.slip.closed_form import closed_form_stride
from template_control.slip.compiled import inner
from template_control.slip.kernel import Model, Scratch, run_stride
from template_control.slip.tables import Tables
from template_control.slip.vocabulary import MapKind

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

_EXACT = int(MapKind.EXACT)
_STEP = 1e-20  # of a complex step: its square vanishes against 1


@inner
def section_map(
    tables: Tables,
    model: Model,
    kind: int,
    node: int,
    z: Array,
    controls: Array,
    scratch: Scratch,
    z_next: Array,
) -> int:
    """One stride from section to section; returns the Outcome's value.

    Args:
        tables: the packed automaton.
        model: the template.
        kind: value of the MapKind.
        node: index of the stride's first node.
        z: (3,) dx/dt, y, dy/dt at VLO, or (2,) dx/dt, y at apex [m/s, m, m/s].
        controls: (NUM_SLOTS,) u by Slot.
        scratch: overwritten.
        z_next: (3,) or (2,) overwritten with the state at the next section.
    """
    state, toes = scratch.state, scratch.toes
    state[0], state[1], state[2], state[3] = 0.0, z[1], z[0], 0.0
    if z.shape[0] == 3:
        state[3] = z[2]
    toes[0] = toes[1] = 0.0
    if kind == _EXACT:
        outcome = run_stride(tables, model, node, state, toes, controls, False, scratch)[0]
    else:
        outcome = closed_form_stride(tables, model, kind, node, state, toes, controls, scratch)
    z_next[0], z_next[1] = state[2], state[1]
    if z_next.shape[0] == 3:
        z_next[2] = state[3]
    return outcome


@njit(cache=True)
def map_many(
    tables: Tables,
    model: Model,
    kind: int,
    node: int,
    z: Array,
    controls: Array,
    scratch: Scratch,
    z_next: Array,
    advance: Array,
    outcome: IntArray,
) -> None:
    """:func:`section_map` for rows of ``z`` (n, 3 or 2) and ``controls`` (n, NUM_SLOTS).

    ``advance`` (n,) is overwritten with the distance covered [m].
    """
    for i in range(z.shape[0]):
        outcome[i] = section_map(tables, model, kind, node, z[i], controls[i], scratch, z_next[i])
        advance[i] = scratch.state[0]


@njit(cache=True)
def section_jacobian(
    tables: Tables,
    model: Model,
    kind: int,
    node: int,
    z: Array,
    controls: Array,
    scratch: Scratch,
    z_next: Array,
    state_jacobian: Array,
    control_jacobian: Array,
) -> int:
    """:func:`section_map` with its derivatives, exact to rounding, by complex steps.

    The imaginary part of each event's time is the derivative that the saltation matrix
    accounts for; nothing is differenced.

    Args:
        scratch: complex, from ``new_scratch(complex)``.
        z_next: (m,) overwritten.
        state_jacobian: (m, n) overwritten with d z_next / d z.
        control_jacobian: (m, NUM_SLOTS) overwritten with d z_next / d u.
        The rest as in :func:`section_map`.
    """
    n, m = z.shape[0], z_next.shape[0]
    zc, uc = z.astype(np.complex128), controls.astype(np.complex128)
    out = np.empty(m, np.complex128)
    outcome = 0
    for j in range(n + controls.shape[0]):
        # Scaled so that stiffnesses (1e4 N/m) move as much as speeds do.
        value = z[j] if j < n else controls[j - n]
        h = _STEP * max(abs(value), 1.0)
        if j < n:
            zc[j] += 1j * h
        else:
            uc[j - n] += 1j * h
        outcome = section_map(tables, model, kind, node, zc, uc, scratch, out)
        if j < n:
            zc[j] = z[j]
        else:
            uc[j - n] = controls[j - n]
        for i in range(m):
            if j < n:
                state_jacobian[i, j] = out[i].imag / h
            else:
                control_jacobian[i, j - n] = out[i].imag / h
    for i in range(m):
        z_next[i] = out[i].real
    return outcome
