"""The whole-body QP in its only unknowns, the joint torques.

Torques are scaled by their limits and forces by the robot's weight; f_n is the normal force at a
contact, f_t each of its tangential ones, of which there is one in the plane and two in space:

    min  1/2 z^T H z + g^T z      z = tau / tau_max
    s.t. -1 <= z <= 1                           torque limits
         0 <= mu f_n -+ f_t                     linearised friction cone, each contact
         0 <= f_n <= cap                        unilateral contact, unloading leg
         low <= a_joint <= high                 only where a joint is near its speed limit

A contact that is a patch, the sole of a flat foot, has six rows: force and moment at its toe. Its
constraints are those of a wrench that a rectangle bears (:func:`patch_cone`); its moments cost too.

H is badly conditioned (tasks against regularisers), and a proximal solver is slow along
its soft directions. So the solver gets the same problem in w = L^T z with H = L L^T, whose
Hessian is the identity, and constraint rows of unit length.

Without constraints the minimum is w = -L^-1 g. Where it keeps all of them it is the answer, and
there is nothing left to solve: so it is in about 19 of 20 ticks of a walk or a run.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.cholesky import cholesky
from template_control.compiled import compiled, compiled_into
from template_control.robot.terms import MOST_CONTACTS, PATCH, UP
from template_control.structured import structure
from template_control.whole_body.elimination import eliminate
from template_control.whole_body.task import BIAS, DESIRED, WEIGHT

_FAR = 1e20  # ProxQP's infinity
_GRID = 2.0**24  # steps of a torque up to its limit

SINGULAR, BOUNDED, FREE, BRAKED = 0, 1, 2, 3
"""No problem; one whose constraints act; one where none does; one that bounds accelerations."""

QP_DATA = structure(
    force_cost=float,  # of the contact forces' distance from the wanted ones, per (m g)^2
    sole_share=float,  # share of a sole in which its centre of pressure is kept
    torque_cost=float,  # of the joint torques, per squared limit
    friction=float,  # coefficient that the cones are built with
    contact_damping=float,  # brings a foot that landed sliding to rest [1/s]
    speed_share=float,  # share of its limit from which on a joint's speed is bounded
    stop_share=float,  # share of its limit from which on a joint slows down before its stop
    stop_time=float,  # by which a stop is looked at before a joint is there [s]
    load=float,  # ratio of the real to the modelled inertia
    contacts=np.int64,  # number of contacts on the ground
    contact=(np.int64, (MOST_CONTACTS,)),  # which
    force=(float, (MOST_CONTACTS, PATCH)),  # to stay near, of each, by row [N, N m]
    cap=(float, (MOST_CONTACTS,)),  # largest normal force of each; inf: none [N]
)
"""The stance of a tick, and the constants of the QP."""


CONE = 16
"""Constraints of the wrench that a patch can bear, beyond the range of its normal force."""

_CROOKED = 10.0
"""Cost of a moment about a sole's x or y, per its half side and weight, over that of a force.

The centre of pressure stays at the toe where nothing asks for more. With 1 and 100 G1 walks too.
"""


@compiled
def rows_per_contact(rows: int) -> int:
    """Constraints of a contact: two a tangential direction, or ``CONE`` of a patch; one normal."""
    return CONE + 1 if rows == PATCH else 2 * rows - 1


@compiled
def patch_cone(friction: float, half: Array, centre: Array, out: Array) -> None:
    """Write the cone of the wrenches w that a rectangle can bear: ``out`` w >= 0.

    w is force and moment at a point of the rectangle, in its axes; its ``centre`` is from there
    [m]. With half sides X, Y and the moment m about the centre, these are the rows of Caron, Pham
    and Nakamura (ICRA 2015, equations 12 to 16):

        |f_x| <= mu f_z,  |f_y| <= mu f_z,  |m_x| <= Y f_z,  |m_y| <= X f_z,
        m_z <=  mu (X + Y) f_z - |Y f_x + mu m_x| - |X f_y + mu m_y|,
        m_z >= -mu (X + Y) f_z + |Y f_x - mu m_x| + |X f_y - mu m_y|.
    """
    x, y, mu, row = half[0], half[1], friction, 0
    out[:] = 0.0
    for axis in range(2):
        for side in (1.0, -1.0):
            out[row, axis], out[row, 2] = side, mu
            out[row + 1, 3 + axis], out[row + 1, 2] = side, y if axis == 0 else x
            row += 2
    for turn in (1.0, -1.0):
        for one in (1.0, -1.0):
            for other in (1.0, -1.0):
                out[row, 2], out[row, 5] = mu * (x + y), -turn
                out[row, 0], out[row, 3] = one * y, one * turn * mu
                out[row, 1], out[row, 4] = other * x, other * turn * mu
                row += 1
    for row in range(CONE):  # from the moment about the centre to that about the point
        out[row, 2] += centre[0] * out[row, 4] - centre[1] * out[row, 3]
        out[row, 0] += centre[1] * out[row, 5]
        out[row, 1] -= centre[0] * out[row, 5]


Answer = tuple[Array, Array, Array]
"""Torques, forces of the contacts on the ground, accelerations: as of :class:`.solver.Solution`."""


class Matrices(NamedTuple):
    """The QP in w, and how it is mapped back; :func:`assemble` overwrites all from ``a_map`` on.

    The last three are of the contacts on the ground, and work space.
    """

    torque_limit: Array  # (nu,) of the model [N m]
    torque: Array  # (nu,) of the model's joints, as they were solved last [N m]
    bounds: Array  # (2, nu) least and greatest accelerations of the joints; (2, 0): none [rad/s^2]
    a_map: Array  # (nv, nu + 1) accelerations as an affine function of the torques
    f_map: Array  # (rows, nu + 1) the same of the contact forces, or wrenches of patches
    factor: Array  # (nu, nu) L in its lower triangle
    gradient: Array  # (nu,) L^-1 g
    constraint: Array  # (rows, nu) of unit length; nu more where accelerations are bounded
    lower: Array  # bounds of the rows times w
    upper: Array
    minimum: Array  # (nu,) the w of least cost without the constraints
    jacobian: Array  # (forces, nv) maps v to their velocities
    bias: Array  # (forces,) their accelerations without those of v, and what damps sliding
    row: Array  # (nu + 1,)


@compiled
def assemble(qp: Any, data: Any, arrays: tuple[Any, ...], tasks: Array, m: Matrices) -> int:
    """Fill the QP's matrices; ``SINGULAR``, ``BOUNDED``, or ``FREE``.

    ``FREE`` where ``minimum`` keeps all constraints, which are then left in z. ``qp`` is (1,) of
    ``QP_DATA``, ``data`` of ``ROBOT_DATA``; ``tasks`` (t, nv + 3) a stack's table.
    """
    p, r = qp[0], data[0]
    contact, nv, nu = arrays[4], m.a_map.shape[0], m.torque_limit.shape[0]
    contacts, directions = p.contacts, contact.shape[1]
    up = min(directions, UP + 1) - 1
    for i in range(contacts):
        point = p.contact[i]
        for d in range(directions):
            axis = UP if d == up else d
            for k in range(nv):
                m.jacobian[i * directions + d, k] = contact[point, d, k]
            sliding = p.contact_damping * r.contact_velocity[point, axis]
            m.bias[i * directions + d] = r.contact_bias[point, axis] + sliding
    if not eliminate(arrays[0], arrays[1], m.jacobian, m.bias, nv - nu, m.a_map, m.f_map):
        return SINGULAR
    m.factor[:], m.gradient[:], m.constraint[:] = 0.0, 0.0, 0.0
    for i in range(nu):
        m.factor[i, i] = p.torque_cost
        m.constraint[i, i] = 1.0
        m.lower[i], m.upper[i] = -1.0, 1.0
    _add_tasks(m, tasks)
    _add_contacts(p, r.mass * r.gravity, m, directions)
    if directions == PATCH:
        _add_patches(p, r, m)
    first = m.constraint.shape[0] - m.bounds.shape[1]
    for i in range(m.bounds.shape[1]):
        _constrain(m, first + i, m.a_map[nv - nu + i], 1.0, m.bounds[0, i], m.bounds[1, i])
    if not cholesky(m.factor, nu):
        return SINGULAR
    return _substitute(m)


@compiled
def _add_tasks(m: Matrices, tasks: Array) -> None:
    """Add the costs of the tasks' rows."""
    nv, row = m.a_map.shape[0], m.row
    for t in range(tasks.shape[0]):
        if tasks[t, nv + WEIGHT] == 0.0:
            continue
        row[:] = 0.0
        for k in range(nv):
            if tasks[t, k] != 0.0:  # a foot moves with few of the joints
                for j in range(row.shape[0]):
                    row[j] += tasks[t, k] * m.a_map[k, j]
        row[-1] += tasks[t, nv + BIAS] - tasks[t, nv + DESIRED]
        _add_square(m, tasks[t, nv + WEIGHT])


@compiled
def _add_contacts(p: Any, weight: float, m: Matrices, directions: int) -> None:
    """Add the costs of the contacts' forces, the cones of points, and the normal forces' ranges."""
    up, rows, row = min(directions, UP + 1) - 1, rows_per_contact(directions), m.row
    for i in range(p.contacts):
        force, top = m.f_map[directions * i :], m.torque_limit.shape[0] + rows * i
        for d in range(up + 1):
            for j in range(row.shape[0]):
                row[j] = force[d, j] / weight
            row[-1] -= p.force[i, d] / weight
            _add_square(m, p.force_cost)
        for side in range(2 * up if directions < PATCH else 0):
            sign = 1.0 - 2.0 * (side % 2)
            for j in range(row.shape[0]):
                row[j] = p.friction * force[up, j] + sign * force[side // 2, j]
            _constrain(m, top + side, row, weight, 0.0, _FAR)
        _constrain(m, top + rows - 1, force[up], weight, 0.0, p.cap[i])


@compiled
def _add_patches(p: Any, r: Any, m: Matrices) -> None:
    """Add the costs of the soles' moments about their toes, and the cones of those that stand."""
    nu, weight, row = m.torque_limit.shape[0], r.mass * r.gravity, m.row
    wrench, cone, half = np.empty((PATCH, nu + 1)), np.empty((CONE, PATCH)), np.empty(2)
    for i in range(p.contacts):
        patch, top = p.contact[i], nu + (CONE + 1) * i
        _in_sole(r.contact_axes[patch], m.f_map, PATCH * i, wrench)
        for axis in range(3):
            side = r.sole_half[patch, 1 if axis == 0 else 0]
            for j in range(nu + 1):
                row[j] = wrench[3 + axis, j] / (weight * side)
            _add_square(m, p.force_cost if axis == UP else _CROOKED * p.force_cost)
        for k in range(2):
            half[k] = p.sole_share * r.sole_half[patch, k]
        patch_cone(p.friction, half, r.sole_centre[patch], cone)
        for k in range(CONE):
            row[:] = 0.0
            for j in range(nu + 1):
                for d in range(PATCH):
                    row[j] += cone[k, d] * wrench[d, j]
            _constrain(m, top + k, row, weight, 0.0, _FAR)


@compiled
def _in_sole(axes: Array, f_map: Array, first: int, out: Array) -> None:
    """Write a patch's rows of ``f_map``, from row ``first`` on, in the sole's axes (3, 3)."""
    for half in range(0, PATCH, 3):
        for k in range(3):
            for j in range(f_map.shape[1]):
                total = 0.0
                for i in range(3):
                    total += axes[i, k] * f_map[first + half + i, j]
                out[half + k, j] = total


@compiled
def _constrain(m: Matrices, at: int, row: Array, unit: float, low: float, high: float) -> None:
    """Write the constraint low <= row[:-1] tau + row[-1] <= high, over a ``unit``, in z."""
    nu = m.torque_limit.shape[0]
    for j in range(nu):
        m.constraint[at, j] = row[j] * m.torque_limit[j] / unit
    m.lower[at] = (low - row[nu]) / unit
    m.upper[at] = _FAR if high >= _FAR else (high - row[nu]) / unit


@compiled
def _substitute(m: Matrices) -> int:
    """Take the QP from z to w, with the factor of H, but for constraints where none acts."""
    nu, row = m.torque_limit.shape[0], m.row
    _forward(m.factor, m.gradient)
    for i in range(nu):  # Numba compiles the copy of a whole array for seconds
        m.minimum[i] = row[i] = -m.gradient[i]
    _backward(m.factor, row[:nu])
    if _keeps(m.constraint, m.lower, m.upper, row):
        return FREE
    for i in range(m.constraint.shape[0]):
        _forward(m.factor, m.constraint[i])
        length = 0.0
        for j in range(nu):
            length += m.constraint[i, j] * m.constraint[i, j]
        scale = 1.0 / np.sqrt(max(length, 1e-300))
        for j in range(nu):
            m.constraint[i, j] *= scale
        m.lower[i] *= scale
        if m.upper[i] < _FAR:
            m.upper[i] *= scale
    return BOUNDED


@compiled
def _keeps(constraint: Array, lower: Array, upper: Array, z: Array) -> bool:
    """True if lower <= constraint z <= upper; ``z`` may be longer."""
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
def torques(m: Matrices, w: Array) -> None:
    """Write the model's joint torques of the QP's solution, tau_max * (L^-T w).

    They are rounded to 2^-24 of tau_max, which is near ProxQP's tolerance. Where a process has
    loaded another build of ProxQP than :func:`.solver.load_proxqp` does, the last digits of the
    solution depend on where its workspace happens to lie in memory; without the rounding such a
    walk would not be the same twice.
    """
    for i in range(w.shape[0]):
        m.torque[i] = w[i]
    _backward(m.factor, m.torque)
    for i in range(w.shape[0]):
        # The solver's tolerance may leave a torque a hair beyond its limit.
        share = np.round(min(1.0, max(-1.0, m.torque[i])) * _GRID) / _GRID
        m.torque[i] = share * m.torque_limit[i]


@compiled
def _add_square(m: Matrices, weight: float) -> None:
    """Add the square of (row[:-1] tau + row[-1]), tau = tau_max z, to H's lower triangle and g."""
    nu, scale, row = m.gradient.shape[0], m.torque_limit, m.row
    for i in range(nu):
        left = weight * row[i] * scale[i]
        m.gradient[i] += left * row[nu]
        for j in range(i + 1):
            m.factor[i, j] += left * row[j] * scale[j]


@compiled
def _affine(matrix: Array, tau: Array, out: Array) -> None:
    """out = matrix[:, :-1] tau + matrix[:, -1]."""
    n = tau.shape[0]
    for i in range(out.shape[0]):
        total = matrix[i, n]
        for j in range(n):
            total += matrix[i, j] * tau[j]
        out[i] = total


@compiled
def answer(load: float, m: Matrices, found: Answer) -> None:
    """Write a tick's answer into ``found``; ``load`` is the robot's inertia over the model's."""
    torque, force, acceleration = found
    _affine(m.a_map, m.torque, acceleration)
    _affine(m.f_map, m.torque, force)
    for i in range(torque.shape[0]):
        torque[i] = load * m.torque[i]


@compiled
def bounds_needed(p: Any, r: Any) -> bool:
    """True if a joint is near its limit of speed, or the one that it has before its stop."""
    if r.fastest <= p.stop_share:
        return False
    return r.fastest > p.speed_share or r.soonest_stop <= p.stop_time


@compiled_into
def solve_free(
    qp: Any, data: Any, arrays: tuple[Any, ...], tasks: Array, m: Matrices, found: Answer
) -> int:
    """Solve a tick in which no limit acts: ``FREE`` where none does.

    Else what :func:`assemble` finds, or ``BRAKED`` where accelerations are to be bounded and
    nothing has been assembled yet. ``m`` is from :meth:`.solver.WholeBodyQp.room`, ``found`` as for
    :func:`answer`.
    """
    if bounds_needed(qp[0], data[0]):
        return BRAKED
    kind = assemble(qp, data, arrays, tasks, m)
    if kind == FREE:
        torques(m, m.minimum)
        answer(qp[0].load, m, found)
    return kind
