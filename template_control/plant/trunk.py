"""State of a floating trunk, from that of its centre of mass in its axes of inertia."""

from __future__ import annotations

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.warm_up import Part

_Three = tuple[float, float, float]
_Four = tuple[float, float, float, float]


@compiled
def read_trunk(
    place: tuple[_Three, _Four],
    velocity: tuple[_Three, _Three],
    turn: Array,
    shift: Array,
    q: Array,
    moving: Array,
) -> None:
    """Write the trunk's place and quaternion x y z w into ``q``, by ``place`` of its CoM.

    ``turn`` and ``shift`` are the frame of the trunk in its axes of inertia. ``moving`` (5, 3) is
    overwritten with the world's axes in the trunk's, and the velocity of the trunk's origin and its
    angular velocity, in the world's axes.
    """
    (at, (x, y, z, w)), (linear, angular) = place, velocity
    own, away = np.empty((3, 3)), np.empty(3)
    own[0, 0], own[1, 1] = 1.0 - (2.0 * y * y + 2.0 * z * z), 1.0 - (2.0 * x * x + 2.0 * z * z)
    own[2, 2] = 1.0 - (2.0 * x * x + 2.0 * y * y)
    own[0, 1], own[1, 0] = 2.0 * y * x - 2.0 * z * w, 2.0 * y * x + 2.0 * z * w
    own[0, 2], own[2, 0] = 2.0 * z * x + 2.0 * y * w, 2.0 * z * x - 2.0 * y * w
    own[1, 2], own[2, 1] = 2.0 * z * y - 2.0 * x * w, 2.0 * z * y + 2.0 * x * w
    for i in range(3):
        for j in range(3):
            moving[j, i] = own[i, 0] * turn[0, j] + own[i, 1] * turn[1, j] + own[i, 2] * turn[2, j]
        q[i] = at[i] + (own[i, 0] * shift[0] + own[i, 1] * shift[1] + own[i, 2] * shift[2])
        away[i] = at[i] - q[i]
        moving[4, i] = angular[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        moving[3, i] = linear[i] - (angular[j] * away[k] - angular[k] * away[j])
    _near_quaternion(moving, q)


@compiled
def _near_quaternion(inverse: Array, q: Array) -> None:
    """Write the quaternion of a rotation, given by its inverse, nearer to that in ``q``."""
    m, found, i = inverse.T, np.empty(4), 3
    trace = m[0, 0] + (m[1, 1] + m[2, 2])
    if trace > 0.0:
        root = np.sqrt(trace + 1.0)
        half = 0.5 / root
        found[3] = 0.5 * root
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            found[i] = (m[k, j] - m[j, k]) * half
    else:
        i = 1 if m[1, 1] > m[0, 0] else 0
        i = 2 if m[2, 2] > m[i, i] else i
        j, k = (i + 1) % 3, (i + 2) % 3
        root = np.sqrt(m[i, i] - m[j, j] - m[k, k] + 1.0)
        half = 0.5 / root
        found[i], found[3] = 0.5 * root, (m[k, j] - m[j, k]) * half
        found[j], found[k] = (m[j, i] + m[i, j]) * half, (m[k, i] + m[i, k]) * half
    near = 0.0
    for n in range(4):
        near += found[n] * q[3 + n]
    for n in range(4):
        q[3 + n] = found[n] if near >= 0.0 else -found[n]


def read_base() -> None:
    """The state of a floating base in PyBullet."""
    three = (0.0, 0.0, 0.0)
    place, velocity = (three, (*three, 1.0)), (three, three)
    read_trunk(place, velocity, np.eye(3), np.zeros(3), np.zeros(9), np.zeros((5, 3)))


READ = (Part(read_base, 1.0),)
"""Compiled functions of a floating base in PyBullet."""
