"""Broyden's update: derivatives of a map from where it leads, in place of new ones."""

from __future__ import annotations

from typing import NamedTuple

from template_control.arrays import Array
from template_control.compiled import inner

_ERROR = 0.1  # in units of the results, up to which a linear map has foretold them
_SHARE = 0.02  # of the change that it has foretold, the same


class LinearMap(NamedTuple):
    """A map to first order about a place."""

    jacobian: Array  # (r, f)
    place: Array  # (f,)
    result: Array  # (r,) there


@inner
def carried(linear: LinearMap, place: Array, result: Array, unit: Array, close: Array) -> bool:
    """Carry a linear map to another place, if it has foretold the result there; whether it has.

    J += (dr - J dx) dx' / |dx|^2, with the changes dx (f,) of the place in units of ``unit`` and dr
    (r,) of the result. ``close`` (m,) are errors of the first m results that count as 1. A map that
    is not carried means nothing any more.
    """
    jacobian, before, error = linear
    squared = off = way = 0.0
    for j in range(place.shape[0]):
        before[j] = (place[j] - before[j]) / unit[j]  # dx, until the end of this function
        squared += before[j] * before[j]
    for r in range(result.shape[0]):
        foretold = 0.0
        for j in range(place.shape[0]):
            foretold += jacobian[r, j] * before[j] * unit[j]
        error[r] = result[r] - error[r] - foretold  # as well
        if r < close.shape[0]:
            off += (error[r] / close[r]) ** 2
            way += (foretold / close[r]) ** 2
    if not off <= max(_ERROR**2, _SHARE**2 * way):  # nor where it is no number
        return False
    for r in range(result.shape[0]):
        for j in range(place.shape[0]):
            if squared > 0.0:
                jacobian[r, j] += error[r] * before[j] / (squared * unit[j])
        error[r] = result[r]
    for j in range(place.shape[0]):
        before[j] = place[j]
    return True
