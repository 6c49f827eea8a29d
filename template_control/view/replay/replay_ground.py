"""The ground in the browser: its shape, what lies on it, and how high the camera is over it."""

from __future__ import annotations

from typing import Any

import numpy as np
from meshcat import geometry as mg
from numpy.typing import NDArray

from template_control.plant.terrain.terrain import Terrain

Array = NDArray[np.float64]

_AROUND = 11  # places that a height is the mean of


def plates(centres: Array, size: tuple[float, float]) -> tuple[Array, NDArray[np.int64]]:
    """Rectangles that lie level.

    Args:
        centres: (N, 3) [m].
        size: along x and y [m].

    Returns:
        Vertices (4 N, 3) and faces (2 N, 3).
    """
    corners = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*size, 0.0]
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(centres))[:, None, None]
    return (centres[:, None] + corners).reshape(-1, 3), faces.reshape(-1, 3)


def ground_shape(line: Array, sides: tuple[float, float], length: float) -> tuple[Any, Array]:
    """The ground under a line: a board where it is level, else its surface.

    Args:
        line: (N, 2) x and height of its points [m].
        sides: y of its right and its left edge [m].
        length: the template's rest length [m].

    Returns:
        The shape and its placement (4, 4).
    """
    place = np.eye(4)
    (low, level), (high, _), (right, left) = line[0], line[-1], sides
    if np.all(line[:, 1] == level):
        thick = 0.02 * length
        place[:3, 3] = 0.5 * (low + high), 0.5 * (right + left), level - 0.5 * thick
        return mg.Box([high - low, left - right, thick]), place
    count = len(line)
    edges = [np.column_stack((line[:, 0], np.full(count, y), line[:, 1])) for y in sides]
    first = np.arange(count - 1)
    near = np.column_stack((first, first + 1, first + count))
    far = np.column_stack((first + 1, first + count + 1, first + count))
    surface = mg.TriangularMeshGeometry(np.concatenate(edges), np.concatenate((near, far)))
    return surface, place


def smoothed(ground: Terrain, x: Array, length: float) -> Array:
    """Height of the ground around places, without its edges: a camera goes up and down with it.

    Args:
        ground: whose height.
        x: (N,) the places [m].
        length: over which the mean is taken [m].
    """
    around = np.linspace(-0.5, 0.5, _AROUND) * length
    return np.array([np.mean([ground.height_at(p) for p in place + around]) for place in x])
