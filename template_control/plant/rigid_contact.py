"""Rigid unilateral contacts of rolling feet: which press, with what force, and impacts.

A contact sticks or leaves; it does not slide. All functions solve one linear system, with
the rows J of the contacts that press,

    [M  -J^T] [x]   [right-hand side]
    [J    0 ] [f] = [    -gamma     ]

for accelerations (generalised forces, dJ/dt v), velocities after an impact (M v, 0) and
corrections of a configuration (0, distances).

A foot that has landed rolls on the plane that touches the ground where it landed. On a straight
piece of ground that is the ground itself, on an edge the plane at right angles to the line from
the edge to the sphere's centre.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain, combinations

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.plant.terrain import Terrain
from template_control.robot.planar_biped import PlanarBiped
from template_control.whole_body.elimination import eliminate

_ROUNDING = 1e-9  # relative: forces and accelerations this small have no sign


def solve(
    mass_matrix: Array, right: Array, jacobian: Array, gamma: Array, pressed: tuple[int, ...]
) -> tuple[Array, Array]:
    """Solve the system with some contacts held: x (nv,), and f (n, 2), zero for the others.

    ``jacobian`` (n, 2, nv) and ``gamma`` (n, 2) have two rows of each contact. A LinAlgError if
    those of the held ones depend on each other.
    """
    nv, held = len(right), list(pressed)
    rows = jacobian[held].reshape(-1, nv)
    x, force, found = np.empty((nv, 1)), np.empty((len(rows), 1)), np.zeros_like(gamma)
    if not eliminate(mass_matrix, -right, rows, gamma[held].ravel(), nv, x, force):
        # What is not finite has no solution, and is no fault of the contacts.
        if np.isfinite(mass_matrix).all() and np.isfinite(rows).all():
            raise np.linalg.LinAlgError("the contacts' rows depend on each other")
        x[:] = force[:] = np.nan
    found[held] = force.reshape(-1, 2)
    return x[:, 0], found


def pressing(
    mass_matrix: Array,
    right: Array,
    jacobian: Array,
    gamma: Array,
    touching: Iterable[int],
) -> tuple[tuple[int, ...], Array, Array, bool]:
    """Contacts among the touching ones that press: none of them pulls, none of the others sinks.

    As many as possible are kept, with x and f of :func:`solve`. The last result is False where
    every choice would pull or sink: all contacts are then held, whatever they pull.
    """
    touching = tuple(touching)
    sizes = range(len(touching), -1, -1)
    for held in chain.from_iterable(combinations(touching, size) for size in sizes):
        x, force = solve(mass_matrix, right, jacobian, gamma, held)
        normal = jacobian[:, 1] @ x + gamma[:, 1]
        pulls = any(force[i, 1] < -_ROUNDING * np.abs(force).max() for i in held)
        sinks = any(
            normal[i] < -_ROUNDING * np.abs(normal).max() for i in touching if i not in held
        )
        if not (pulls or sinks):
            return held, x, force, True
    x, force = solve(mass_matrix, right, jacobian, gamma, touching)
    return touching, x, force, False


class RollingFeet:
    """The feet of a robot over a terrain, at the robot's last update."""

    def __init__(self, robot: PlanarBiped, terrain: Terrain) -> None:
        self._robot = robot
        self._terrain = terrain
        feet = len(robot.feet)
        self._axes = np.tile(np.eye(2), (feet, 1, 1))  # by foot: along its plane, and out of it
        self._anchor = np.zeros((feet, 2))  # where each foot holds, along both axes

    def gaps(self) -> Array:
        """(n,) distance of each foot from the ground, negative where it is inside [m]."""
        r = self._robot
        if len(self._terrain.points) == 1:
            return np.array(r.contact_position[:, 1])
        radius = r.foot_radius
        found = (self._terrain.closest(x, y + radius) for x, y in r.contact_position.tolist())
        return np.array([closest.distance - radius for closest in found])

    def meet(self, foot: int, q: Array) -> None:
        """Let a foot hold where it is now, at the configuration q (nv,)."""
        closest = self._terrain.closest(*self._centre(foot).tolist())
        x, y = closest.normal
        self._axes[foot] = (y, -x), (x, y)
        self._anchor[foot] = self._held(foot, q) - (0.0, closest.distance)

    def rows(self) -> tuple[Array, Array]:
        """Jacobians (n, 2, nv) of the points that touch, along and out of planes, and dJ/dt v."""
        r = self._robot
        return _rows(self._axes, r.foot_radius, r.contact_jacobian, r.foot_turning, r.contact_bias)

    def errors(self, foot: int, q: Array) -> Array:
        """(2,) distance of a foot from where it holds, along and out of its plane [m]."""
        return self._held(foot, q) - (0.0, self._robot.foot_radius) - self._anchor[foot]

    def in_world(self, force: Array) -> Array:
        """(n, 2) x and y of what is given (n, 2) along and out of each foot's plane."""
        return np.einsum("fi,fij->fj", force, self._axes)

    def _centre(self, foot: int) -> Array:
        r = self._robot
        return r.contact_position[foot] + (0.0, r.foot_radius)

    def _held(self, foot: int, q: Array) -> Array:
        """(2,) a sphere's centre along its plane, less what it rolled, and out of it [m]."""
        r = self._robot
        rolled = r.foot_radius * float(r.foot_turning[foot] @ q)
        return self._axes[foot] @ self._centre(foot) - (rolled, 0.0)


@compiled
def _rows(
    axes: Array, radius: float, lowest: Array, turning: Array, bias: Array
) -> tuple[Array, Array]:
    """Rows as of :meth:`RollingFeet.rows`, from the Jacobians and bias of the lowest points."""
    jacobian, rates = np.empty_like(lowest), np.empty_like(bias)
    for foot in range(len(axes)):
        # From the sphere's lowest point, which is the model's, to the one that touches.
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
