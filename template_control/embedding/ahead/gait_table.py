"""The family of walking gaits as a table by speed, with what a planner needs of each gait."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from template_control.embedding.ahead.gait_row import (
    CONTROL,
    CONTROLS,
    COST,
    DURATION,
    GAIN,
    LENGTH,
    SETTLING,
    STATE,
    STIFFNESS,
    WIDTH,
    GaitTable,
    gait_row,
)
from template_control.embedding.ahead.options import AheadOptions
from template_control.embedding.planners.walking.lqr import settling_map
from template_control.slip.automaton.vocabulary import Slot, StrideKind
from template_control.slip.dynamics.stride import controls
from template_control.slip.gaits.gait import WALKING_SLOTS
from template_control.slip.gaits.walking_by_speed import Chain, walking_by_speed
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import PADDED
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

STRIDE = StrideKind.WALK_PUSH_OFF
"""The steps of these gaits."""
SLOTS = np.array([int(slot) for slot in WALKING_SLOTS[STRIDE]])
"""Their controls."""
COLUMNS = np.concatenate((np.arange(PADDED), PADDED + SLOTS))
"""States and controls among what the step's map is differentiated by."""


def row_at(table: GaitTable, speed: float) -> Array:
    """(WIDTH,) what belongs to a speed; see :func:`~.gait_row.gait_row`.

    Args:
        table: the gaits.
        speed: dx/dt at VLO [m/s].
    """
    row = np.empty(WIDTH)
    gait_row(table, speed, row)
    return row


@cache
def gait_table(parameters: SlipParameters, options: AheadOptions) -> GaitTable:
    """The library's family on a template.

    Args:
        parameters: the template; its stiffness k0 counts for nothing, each gait has its own.
        options: tolerances that the costs come from, scaled to the template.
    """
    family = walking_by_speed()
    unit = parameters.speed_unit
    parts = [_rows(chain, parameters, options) for chain in family.chains]
    speeds = [chain.vlo_speed * unit for chain in family.chains]
    for i in range(len(parts) - 1):
        # Chains overlap; each serves up to the middle.
        middle = 0.5 * (speeds[i][-1] + speeds[i + 1][0])
        ends = [row_at(GaitTable(speeds[j], parts[j]), middle) for j in (i, i + 1)]
        before, after = speeds[i] < middle, speeds[i + 1] > middle
        parts[i] = np.vstack((parts[i][before], ends[0]))
        parts[i + 1] = np.vstack((ends[1], parts[i + 1][after]))
        speeds[i] = np.append(speeds[i][before], middle)
        speeds[i + 1] = np.append(middle, speeds[i + 1][after])
    return GaitTable(np.concatenate(speeds), np.vstack(parts))


def _rows(chain: Chain, p: SlipParameters, o: AheadOptions) -> Array:
    """(n, WIDTH) of a chain's knots, which are gaits to rounding."""
    unit, weight = p.speed_unit, p.mass * p.gravity / p.rest_length
    step = ReturnMap(p, STRIDE)
    rows = np.zeros((len(chain.height), WIDTH))
    a, b = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3, CONTROLS))
    for i, row in enumerate(rows):
        k = float(chain.stiffness[i]) * weight
        u = controls(float(chain.touchdown_angle[i]), k, k)
        u[Slot.K_PUSH] = k
        z = np.array([chain.vlo_speed[i] * unit, chain.height[i] * p.rest_length, 0.0])
        result, slopes, _ = step.derivatives(z, u, COLUMNS)
        units = np.array([1.0, *[k] * (CONTROLS - 1)])
        a[i], b[i] = slopes[:3, :3], slopes[:3, 3:] * units
        row[STIFFNESS], row[STATE:CONTROL], row[CONTROL:COST] = k, z, u[SLOTS] / units
        row[LENGTH] = result[PADDED]
        row[DURATION] = row[LENGTH] / (chain.mean_speed[i] * unit)
        shift = settling_map(a[i], b[i], np.array(o.lqr.tolerance), o.lqr.control_weight)
        row[SETTLING:GAIN] = shift.ravel()
    q, r = np.diag(1.0 / np.square(o.tolerance)), 1.0 / control_tolerance(o) ** 2
    p_ahead = np.array([solve_discrete_are(*at, q, np.diag(r)) for at in zip(a, b, strict=True)])
    weighted = np.swapaxes(b, 1, 2) @ p_ahead
    gain = np.linalg.solve(np.diag(r) + weighted @ b, weighted @ a)
    rows[:, COST:SETTLING] = p_ahead.reshape(-1, 9)
    rows[:, GAIN:DURATION] = gain.reshape(len(rows), -1)
    return rows


def control_tolerance(options: AheadOptions) -> Array:
    """(4,) differences of alpha and the stiffnesses over k that cost 1."""
    return np.array([options.angle_tolerance, *[options.stiffness_tolerance] * (CONTROLS - 1)])
