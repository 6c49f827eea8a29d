"""Table of the walking gaits by speed, with what a planner needs of each gait."""

from __future__ import annotations

from functools import cache
from typing import Final, NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.control.lqr import (
    CONTROL_WEIGHT,
    SETTLED_TOLERANCE,
    lqr,
    settling_map,
)
from template_control.slip.dynamics.stride import controls
from template_control.slip.gaits.gait import WALKING_SLOTS
from template_control.slip.gaits.walking_by_speed import Chain, walking_by_speed
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale

CONTROLS = 4
"""Controls of a step: alpha, kappa_1, kappa_2, kappa_p."""
STIFFNESS, STATE, CONTROL = 0, 1, 4
"""Places in a row: k [N/m]; (3,) VLO state; (4,) alpha and shares of k."""
FACTOR, SETTLING = 8, 17
"""Places in a row: (3, 3) L, L L' the cost-to-go; (7, 3) shift of state, controls by an offset."""
STEP_DURATION, STEP_LENGTH = 38, 39
"""Places in a row: duration [s] and length [m] of a step."""
WIDTH = 40


class GaitTable(NamedTuple):
    """Gaits at rising speeds; where one chain of the family ends and the next begins, two.

    ``speed`` (n,) is dx/dt at VLO [m/s]; ``rows`` (n, WIDTH) are what belongs to each.
    """

    speed: Array
    rows: Array


@compiled
def gait_row(table: GaitTable, speed: float, row: Array) -> None:
    """Row of a speed dx/dt at VLO [m/s], interpolated, into ``row`` (WIDTH,).

    Beyond the ends it is the end's own.
    """
    low, high = 0, table.speed.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table.speed[middle] <= speed:
            low = middle
        else:
            high = middle
    width = table.speed[high] - table.speed[low]
    share = (speed - table.speed[low]) / width if width > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    for i in range(row.shape[0]):
        row[i] = (1.0 - share) * table.rows[low, i] + share * table.rows[high, i]


STATE_TOLERANCE = np.array([0.06, 0.006, 0.04])
"""Differences of dx/dt, y, dy/dt from a gait's that cost 1 [m/s, m, m/s], for the reference."""
CONTROL_TOLERANCE = np.array([0.08, 0.3, 0.3, 0.3])
"""Differences of alpha [rad], kappa_1, kappa_2 and kappa_p from a gait's that cost 1."""
STRIDE: Final = StrideKind.WALK_PUSH_OFF
"""The steps of these gaits."""
SLOTS = np.array([int(slot) for slot in WALKING_SLOTS[STRIDE]])
"""Their controls."""
COLUMNS = np.concatenate((np.arange(PADDED), PADDED + SLOTS))
"""States and controls among what the step's map is differentiated by."""


def row_at(table: GaitTable, speed: float) -> Array:
    """Row (WIDTH,) of a speed dx/dt at VLO [m/s]; see :func:`~.gait_table.gait_row`."""
    row = np.empty(WIDTH)
    gait_row(table, speed, row)
    return row


@cache
def gait_table(parameters: SlipParameters) -> GaitTable:
    """The library's family on a template, whose k0 is not used: each gait has its own stiffness."""
    family = walking_by_speed()
    unit = parameters.speed_unit
    parts = [_rows(chain, parameters) for chain in family.chains]
    speeds = [chain.vlo_speed * unit for chain in family.chains]
    _, *between, _ = family.vlo_limits(parameters)
    for i, middle in enumerate(between):
        ends = [row_at(GaitTable(speeds[j], parts[j]), middle) for j in (i, i + 1)]
        before, after = speeds[i] < middle, speeds[i + 1] > middle
        parts[i] = np.vstack((parts[i][before], ends[0]))
        parts[i + 1] = np.vstack((ends[1], parts[i + 1][after]))
        speeds[i] = np.append(speeds[i][before], middle)
        speeds[i + 1] = np.append(middle, speeds[i + 1][after])
    return GaitTable(np.concatenate(speeds), np.vstack(parts))


def _rows(chain: Chain, p: SlipParameters) -> Array:
    """(n, WIDTH) of a chain's knots, which are gaits to rounding."""
    scale = Scale.of(p)
    tolerance = np.array(SETTLED_TOLERANCE) * scale.state
    unit, weight = p.speed_unit, p.mass * p.gravity / p.rest_length
    step, q = ReturnMap(p, STRIDE), np.diag(1.0 / np.square(STATE_TOLERANCE * scale.state))
    r = np.diag(1.0 / CONTROL_TOLERANCE**2)
    rows = np.zeros((len(chain.height), WIDTH))
    for i, row in enumerate(rows):
        k = float(chain.stiffness[i]) * weight
        u = controls(float(chain.touchdown_angle[i]), k, k, k_push=k)
        z = np.array([chain.vlo_speed[i] * unit, chain.height[i] * p.rest_length, 0.0])
        result, slopes, _ = step.derivatives(z, u, COLUMNS)
        units = np.array([1.0, *[k] * (CONTROLS - 1)])
        a, b = slopes[:3, :3].copy(), slopes[:3, 3:] * units
        row[STIFFNESS], row[STATE:CONTROL], row[CONTROL:FACTOR] = k, z, u[SLOTS] / units
        row[STEP_LENGTH] = result[PADDED]
        row[STEP_DURATION] = row[STEP_LENGTH] / (chain.mean_speed[i] * unit)
        row[FACTOR:SETTLING] = np.linalg.cholesky(lqr(a, b, q, r)[0]).ravel()
        row[SETTLING:STEP_DURATION] = settling_map(a, b, tolerance, CONTROL_WEIGHT).ravel()
    return rows
