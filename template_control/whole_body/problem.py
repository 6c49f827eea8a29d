"""The whole-body QP in its only unknowns, the joint torques.

Torques are scaled by their limits and forces by the robot's weight; f_n is a foot's normal force,
f_t each of its tangential ones, of which there is one in the plane and two in space:

    min  1/2 z^T H z + g^T z      z = tau / tau_max
    s.t. -1 <= z <= 1                           torque limits
         0 <= mu f_n -+ f_t                     linearised friction cone, each stance foot
         0 <= f_n <= cap                        unilateral contact, unloading foot
         low <= a_joint <= high                 only where a joint is near its speed limit

H is badly conditioned (tasks against regularisers), and a proximal solver is slow along
its soft directions. So the solver gets the same problem in w = L^T z with H = L L^T, whose
Hessian is the identity, and constraint rows of unit length.

Without constraints the minimum is w = -L^-1 g. Where it keeps all of them it is the answer, and
there is nothing left to solve: so it is in about 19 of 20 ticks of a walk or a run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.whole_body.elimination import cholesky, eliminate
from template_control.whole_body.task import BIAS, DESIRED, WEIGHT

Array = NDArray[np.float64]

_FAR = 1e20  # ProxQP's infinity
_GRID = 2.0**24  # steps of a torque up to its limit

SINGULAR, BOUNDED, FREE = 0, 1, 2
"""What :func:`assemble` finds: no problem, one whose constraints act, one where none does."""


@compiled
def rows_per_foot(directions: int) -> int:
    """Constraints of a stance foot: two for each tangential direction, one for the normal one.

    Args:
        directions: of its force, 2 in the plane, 3 in space.
    """
    return 2 * directions - 1


class Matrices(NamedTuple):
    """The QP in w, and how it is mapped back; :func:`assemble` overwrites all.

    Attributes:
        a_map: (nv, nu + 1) accelerations as an affine function of the torques.
        f_map: (d c, nu + 1) contact forces as an affine function of the torques, d the directions.
        factor: (nu, nu) L in its lower triangle.
        gradient: (nu,) L^-1 g.
        constraint: (nu + (2 d - 1) c, nu) rows of unit length; nu more where accelerations are
            bounded.
        lower, upper: bounds of the rows times w.
        minimum: (nu,) the w of least cost, constraints left aside.
    """

    a_map: Array
    f_map: Array
    factor: Array
    gradient: Array
    constraint: Array
    lower: Array
    upper: Array
    minimum: Array

    @classmethod
    def zeros(cls, nv: int, nu: int, forces: int, rows: int) -> Matrices:
        """All zero.

        Args:
            nv, nu: degrees of freedom, and actuated ones.
            forces: d c, numbers of all contact forces.
            rows: constraints.
        """
        shapes = ((nv, nu + 1), (forces, nu + 1), (nu, nu), (nu,), (rows, nu), (rows,), (rows,))
        return cls(*(np.zeros(shape) for shape in (*shapes, (nu,))))


@compiled
def assemble(
    mass_matrix: Array,
    nonlinear_effects: Array,
    contact: Array,
    tasks: Array,
    costs: Array,
    limits: Array,
    out: tuple[Array, ...],
) -> int:
    """Fill the QP's matrices in place.

    Args:
        mass_matrix, nonlinear_effects: (nv, nv) M and (nv,) h.
        contact: (c, d, nv + 2) a row for each direction of each stance foot, the last one normal
            to the ground: Jacobian J, bias dJ/dt v, wanted force [N].
        tasks: (t, nv + 3), the table of a :class:`~.task.TaskStack`.
        costs: (2,) of the contact forces' distance from the wanted ones, per (m g)^2, and of
            the joint torques, per squared limit.
        limits: (nu + c + 2,) largest joint torques [N m], largest normal force of each stance foot
            [N] (inf: none), coefficient of the friction cones, m g [N]. Where the joints'
            accelerations are bounded, (2 nu,) more: the least and the greatest [rad/s^2]. One
            array, as each one that a compiled function is handed costs time.
        out: the arrays of :class:`Matrices`, overwritten; a plain tuple, as a compiled function
            is called with a named one in twice the time.

    Returns:
        ``SINGULAR``, ``BOUNDED``, or ``FREE`` where ``minimum`` keeps all constraints. They are
        then left in z.
    """
    a_map, f_map, factor, gradient, constraint, lower, upper, minimum = out
    nv = mass_matrix.shape[0]
    nu = gradient.shape[0]
    feet, directions = contact.shape[0], contact.shape[1]
    per_foot = rows_per_foot(directions)
    torque_limit, force_cap = limits[:nu], limits[nu : nu + feet]
    friction, weight = limits[nu + feet], limits[nu + feet + 1]
    # Copies without gaps, which the elimination reads faster.
    jacobian, bias = np.empty((directions * feet, nv)), np.empty(directions * feet)
    for foot in range(feet):
        for d in range(directions):
            for k in range(nv):
                jacobian[foot * directions + d, k] = contact[foot, d, k]
            bias[foot * directions + d] = contact[foot, d, nv]
    if not eliminate(mass_matrix, nonlinear_effects, jacobian, bias, nv - nu, a_map, f_map):
        return SINGULAR
    factor[:] = 0.0
    gradient[:] = 0.0
    row = np.empty(nu + 1)
    for i in range(nu):
        factor[i, i] = costs[1]
    for t in range(tasks.shape[0]):
        if tasks[t, nv + WEIGHT] == 0.0:
            continue
        for j in range(nu + 1):
            total = 0.0
            for k in range(nv):
                total += tasks[t, k] * a_map[k, j]
            row[j] = total
        row[nu] += tasks[t, nv + BIAS] - tasks[t, nv + DESIRED]
        _add_square(row, tasks[t, nv + WEIGHT], torque_limit, factor, gradient)
    for foot in range(feet):
        for d in range(directions):
            for j in range(nu + 1):
                row[j] = f_map[foot * directions + d, j] / weight
            row[nu] -= contact[foot, d, nv + 1] / weight
            _add_square(row, costs[0], torque_limit, factor, gradient)

    constraint[:] = 0.0
    for i in range(nu):
        constraint[i, i] = 1.0
        lower[i], upper[i] = -1.0, 1.0
    for foot in range(feet):
        top, normal = nu + per_foot * foot, directions * foot + directions - 1
        for d in range(directions - 1):
            along = directions * foot + d
            for side in range(2):
                sign, at = 1.0 - 2.0 * side, top + 2 * d + side
                for j in range(nu):
                    constraint[at, j] = (
                        (friction * f_map[normal, j] + sign * f_map[along, j])
                        * torque_limit[j]
                        / weight
                    )
                lower[at] = -(friction * f_map[normal, nu] + sign * f_map[along, nu]) / weight
                upper[at] = _FAR
        at = top + per_foot - 1
        for j in range(nu):
            constraint[at, j] = f_map[normal, j] * torque_limit[j] / weight
        lower[at] = -f_map[normal, nu] / weight
        upper[at] = min(_FAR, (force_cap[foot] - f_map[normal, nu]) / weight)
    least = nu + feet + 2
    for i in range((limits.shape[0] - least) // 2):
        row_of, joint = nu + per_foot * feet + i, nv - nu + i
        for j in range(nu):
            constraint[row_of, j] = a_map[joint, j] * torque_limit[j]
        lower[row_of] = limits[least + i] - a_map[joint, nu]
        upper[row_of] = limits[least + nu + i] - a_map[joint, nu]

    if not cholesky(factor, nu):
        return SINGULAR
    _forward(factor, gradient)
    for i in range(nu):  # Numba compiles the copy of a whole array for seconds
        minimum[i] = row[i] = -gradient[i]
    _backward(factor, row[:nu])
    if _keeps(constraint, lower, upper, row):
        return FREE
    for i in range(constraint.shape[0]):
        _forward(factor, constraint[i])
        length = 0.0
        for j in range(nu):
            length += constraint[i, j] * constraint[i, j]
        scale = 1.0 / np.sqrt(max(length, 1e-300))
        for j in range(nu):
            constraint[i, j] *= scale
        lower[i] *= scale
        if upper[i] < _FAR:
            upper[i] *= scale
    return BOUNDED


@compiled
def _keeps(constraint: Array, lower: Array, upper: Array, z: Array) -> bool:
    """Whether lower <= constraint z <= upper; ``z`` may be longer."""
    for i in range(constraint.shape[0]):
        value = 0.0
        for j in range(constraint.shape[1]):
            value += constraint[i, j] * z[j]
        if not lower[i] <= value <= upper[i]:
            return False
    return True


@compiled
def _forward(factor: Array, vector: Array) -> None:
    """vector = L^-1 vector, in place."""
    for i in range(vector.shape[0]):
        for k in range(i):
            vector[i] -= factor[i, k] * vector[k]
        vector[i] /= factor[i, i]


@compiled
def _backward(factor: Array, vector: Array) -> None:
    """vector = L^-T vector, in place."""
    for i in range(vector.shape[0] - 1, -1, -1):
        for k in range(i + 1, vector.shape[0]):
            vector[i] -= factor[k, i] * vector[k]
        vector[i] /= factor[i, i]


@compiled
def torques(factor: Array, w: Array, torque_limit: Array, out: Array) -> None:
    """Write the joint torques of the QP's solution, tau_max * (L^-T w), into ``out``.

    They are kept within tau_max and rounded to 2^-24 of it, which is near ProxQP's tolerance.
    Where a process has loaded another build of ProxQP than :func:`.solver.load_proxqp` does, the
    last digits of the solution depend on where its workspace happens to lie in memory; without the
    rounding such a walk would not be the same twice.

    Args:
        factor: (nu, nu) L in its lower triangle, from :func:`assemble`.
        w: (nu,) solution of the QP.
        torque_limit: (nu,) tau_max [N m].
        out: (nu,) overwritten with the torques [N m].
    """
    for i in range(w.shape[0]):
        out[i] = w[i]
    _backward(factor, out)
    for i in range(w.shape[0]):
        # The solver's tolerance may leave a torque a hair beyond its limit.
        share = np.round(min(1.0, max(-1.0, out[i])) * _GRID) / _GRID
        out[i] = share * torque_limit[i]


@compiled
def _add_square(
    row: Array, row_weight: float, scale: Array, hessian: Array, gradient: Array
) -> None:
    """Add the square of (row[:-1] tau + row[-1]), tau = scale * z, to H and g."""
    nu = gradient.shape[0]
    for i in range(nu):
        left = row_weight * row[i] * scale[i]
        gradient[i] += left * row[nu]
        for j in range(nu):
            hessian[i, j] += left * row[j] * scale[j]


@compiled
def follow(a_map: Array, f_map: Array, tau: Array, acceleration: Array, force: Array) -> None:
    """Write the accelerations and contact forces that joint torques bring about.

    Args:
        a_map, f_map: affine maps that :func:`assemble` has filled.
        tau: (nu,) joint torques [N m].
        acceleration: (nv,) overwritten with the generalised accelerations [m/s^2, rad/s^2].
        force: (d c,) overwritten with the force on each stance foot [N].
    """
    _affine(a_map, tau, acceleration)
    _affine(f_map, tau, force)


@compiled
def _affine(matrix: Array, tau: Array, out: Array) -> None:
    """out = matrix[:, :-1] tau + matrix[:, -1]."""
    n = tau.shape[0]
    for i in range(out.shape[0]):
        total = matrix[i, n]
        for j in range(n):
            total += matrix[i, j] * tau[j]
        out[i] = total
