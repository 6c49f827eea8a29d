"""Spheres that roll on a terrain: how far each foot is from it, and the rows of its contact.

A foot that has landed rolls on the plane that touches the ground where it landed. On a straight
piece of ground that is the ground itself, on an edge the plane at right angles to the line from
the edge to the sphere's centre.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.plant.terrain.terrain import Terrain
from template_control.robot.planar_biped import PlanarBiped

Array = NDArray[np.float64]


class RollingFeet:
    """The feet of a robot over a terrain, at the robot's last update.

    Args:
        robot: whose feet.
        terrain: below them.
    """

    def __init__(self, robot: PlanarBiped, terrain: Terrain) -> None:
        self._robot = robot
        self._terrain = terrain
        self._axes = np.tile(np.eye(2), (2, 1, 1))  # by foot: along its plane, and out of it
        self._anchor = np.zeros((2, 2))  # where each foot holds, along both axes

    def gaps(self) -> Array:
        """(2,) distance of each foot from the ground, negative where it is inside [m]."""
        r = self._robot
        if len(self._terrain.points) == 1:
            return np.array(r.foot_position[:, 1])
        radius = r.foot_radius
        found = (self._terrain.closest(x, y + radius) for x, y in r.foot_position.tolist())
        return np.array([closest.distance - radius for closest in found])

    def meet(self, foot: int, q: Array) -> None:
        """Let a foot hold where it is now.

        Args:
            foot: its index.
            q: (nv,) the robot's configuration.
        """
        closest = self._terrain.closest(*self._centre(foot).tolist())
        x, y = closest.normal
        self._axes[foot] = (y, -x), (x, y)
        self._anchor[foot] = self._held(foot, q) - (0.0, closest.distance)

    def rows(self) -> tuple[Array, Array]:
        """Jacobians (2, 2, nv) of the material points that touch, along and out of the plane of
        each foot, and their dJ/dt v (2, 2) [m/s^2].
        """
        r = self._robot
        found: tuple[Array, Array] = _rows(
            self._axes, r.foot_radius, r.foot_jacobian, r.foot_turning, r.foot_bias
        )
        return found

    def errors(self, foot: int, q: Array) -> Array:
        """(2,) how far a foot is from where it holds, along and out of its plane [m].

        Args:
            foot: its index.
            q: (nv,) the robot's configuration.
        """
        return self._held(foot, q) - (0.0, self._robot.foot_radius) - self._anchor[foot]

    def in_world(self, force: Array) -> Array:
        """(2, 2) x and y of what is given along and out of each foot's plane.

        Args:
            force: (2, 2) along and out of it.
        """
        return np.einsum("fi,fij->fj", force, self._axes)

    def _centre(self, foot: int) -> Array:
        r = self._robot
        return np.asarray(r.foot_position[foot] + (0.0, r.foot_radius))

    def _held(self, foot: int, q: Array) -> Array:
        """(2,) where a sphere's centre is along its plane, less what it has rolled, and out of it.

        Arguments as for :meth:`errors`.
        """
        r = self._robot
        rolled = r.foot_radius * float(r.foot_turning[foot] @ q)
        return np.asarray(self._axes[foot] @ self._centre(foot) - (rolled, 0.0))


@compiled
def _rows(
    axes: Array, radius: float, lowest: Array, turning: Array, bias: Array
) -> tuple[Array, Array]:
    """Rows as :meth:`RollingFeet.rows` returns them.

    ``axes`` (2, 2, 2) are along and out of each foot's plane; ``lowest`` (2, 2, nv) is the
    Jacobian of each sphere's lowest point, ``turning`` (2, nv) of its angle, and ``bias`` (2, 2)
    the point's dJ/dt v.
    """
    jacobian, rates = np.empty_like(lowest), np.empty((2, 2))
    for foot in range(2):
        # From the sphere's lowest point, which the model tells, to the one that touches.
        x = radius * (1.0 - axes[foot, 1, 1])
        y = radius * axes[foot, 1, 0]
        for axis in range(2):
            along, up = axes[foot, axis]
            rates[foot, axis] = along * bias[foot, 0] + up * bias[foot, 1]
            for k in range(lowest.shape[2]):
                point_x = lowest[foot, 0, k] + x * turning[foot, k]
                point_y = lowest[foot, 1, k] + y * turning[foot, k]
                jacobian[foot, axis, k] = along * point_x + up * point_y
    return jacobian, rates
