"""A run in three directions: that of a free robot in the world, a planar one's beside its plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.run.record import FloatingRecord, Record
from template_control.view.replay.playback import (
    arrows_of,
    carrying,
    footholds,
    force_arrows,
    template_legs,
)

Array = NDArray[np.float64]

_LANDED = 0.015  # [s] after its touchdown a foot rests


@dataclass(frozen=True)
class Space:
    """Where things are; x forward or as the world's, y to the left, z up [m].

    Attributes:
        com: (T, 3) of the robot.
        template: (T, 3) the template's CoM.
        toes: (T, 2, 3) of the template's rear and front leg.
        foot: (T, 2, 3) left and right.
        arrow: (T, 2, 3) the ground's force on each foot, drawn.
        stood: for each foot (n, 3) where it stood, and (n,) since when [s].
    """

    com: Array
    template: Array
    toes: Array
    foot: Array
    arrow: Array
    stood: tuple[tuple[Array, Array], tuple[Array, Array]]


def in_space(record: Record, sides: Array) -> Space:
    """A run in three directions.

    Args:
        record: the run.
        sides: (2,) how far to the left a planar robot's feet are [m]; not asked of a free one.
    """
    if isinstance(record, FloatingRecord):
        return _free(record)
    ground, aside = record.ground, np.array([0.0, 1.0, 0.0])
    found = footholds(record)
    stood = []
    for foot, side in enumerate(sides.tolist()):
        own = [f for f in found if f.foot == foot]
        places = [[f.x, side, ground.height_at(f.x)] for f in own]
        stood.append((np.array(places).reshape(-1, 3), np.array([f.time for f in own])))
    toes, _ = template_legs(record)
    return Space(
        com=raised(record.com),
        template=raised(record.template_com),
        toes=raised(toes),
        foot=raised(record.foot) + sides[:, None] * aside,
        arrow=raised(force_arrows(record)),
        stood=(stood[0], stood[1]),
    )


def _free(record: FloatingRecord) -> Space:
    away = record.template_com - record.com
    ahead = np.stack((np.cos(record.heading), np.sin(record.heading)), axis=1)
    template = record.space_com + np.column_stack((away[:, :1] * ahead, away[:, 1]))
    samples = np.arange(len(record.time))
    toes = np.stack(
        (record.space_foot[samples, record.rear], record.space_foot[samples, 1 - record.rear]),
        axis=1,
    )
    found = footholds(record)
    stood = []
    for foot in range(2):
        since = np.array([f.time for f in found if f.foot == foot])
        rows = np.searchsorted(record.time, since + _LANDED)
        stood.append((record.space_foot[np.minimum(rows, len(samples) - 1), foot], since))
    arrow = arrows_of(record.space_force, record)
    arrow[~carrying(record)] = 0.0
    return Space(record.space_com, template, toes, record.space_foot, arrow, (stood[0], stood[1]))


def raised(points: Array) -> Array:
    """Points of the plane in space.

    Args:
        points: (..., 2) x and height [m].

    Returns:
        (..., 3) with y = 0 [m].
    """
    return np.stack((points[..., 0], np.zeros(points.shape[:-1]), points[..., 1]), axis=-1)


def turned_to(direction: Array) -> Array:
    """Quaternions that turn the vertical z into directions.

    Args:
        direction: (F, 3); where it is zero nothing turns.

    Returns:
        (F, 4) x, y, z, w.
    """
    x, y, z = direction.T
    size = np.linalg.norm(direction, axis=1)
    zero = np.zeros(len(size))
    # Upward the smallest turn; downward a half turn about y and the smallest after it, so that a
    # leg that passes the vertical does not spin.
    up = np.stack((-y, x, zero, size + z), axis=1)
    down = np.stack((zero, size - z, y, x), axis=1)
    found = np.where((z < 0.0)[:, None], down, up)
    found[size == 0.0] = 0.0, 0.0, 0.0, 1.0
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))
