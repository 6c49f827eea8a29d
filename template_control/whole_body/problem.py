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
from template_control.compiled import compiled
from template_control.robot.terms import MOST_CONTACTS, PATCH, UP
from template_control.whole_body.elimination import eliminate
from template_control.whole_body.task import BIAS, DESIRED, WEIGHT

_FAR = 1e20  # ProxQP's infinity
_GRID = 2.0**24  # steps of a torque up to its limit

SINGULAR, BOUNDED, FREE, BRAKED = 0, 1, 2, 3
"""No problem; one whose constraints act; one where none does; one that bounds accelerations."""

_F, _I = np.float64, np.int64

QP_DATA = np.dtype(
    [
        ("force_cost", _F),  # of the contact forces' distance from the wanted ones, per (m g)^2
        ("sole_share", _F),  # share of a sole in which its centre of pressure is kept
        ("torque_cost", _F),  # of the joint torques, per squared limit
        ("friction", _F),  # coefficient that the cones are built with
        ("contact_damping", _F),  # brings a foot that landed sliding to rest [1/s]
        ("speed_share", _F),  # share of its limit from which on a joint's speed is bounded
        ("stop_share", _F),  # share of its limit from which on a joint slows down before its stop
        ("stop_time", _F),  # by which a stop is looked at before a joint is there [s]
        ("load", _F),  # ratio of the real to the modelled inertia
        ("contacts", _I),  # number of contacts on the ground
        ("contact", _I, (MOST_CONTACTS,)),  # which
        ("force", _F, (MOST_CONTACTS, PATCH)),  # to stay near, of each, by row [N, N m]
        ("cap", _F, (MOST_CONTACTS,)),  # largest normal force of each; inf: none [N]
    ],
    align=True,
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


class Matrices(NamedTuple):
    """The QP in w, and how it is mapped back; :func:`assemble` overwrites all."""

    a_map: Array  # (nv, nu + 1) accelerations as an affine function of the torques
    f_map: Array  # (rows, nu + 1) the same of the contact forces, or wrenches of patches
    factor: Array  # (nu, nu) L in its lower triangle
    gradient: Array  # (nu,) L^-1 g
    constraint: Array  # (rows, nu) of unit length; nu more where accelerations are bounded
    lower: Array  # bounds of the rows times w
    upper: Array
    minimum: Array  # (nu,) the w of least cost without the constraints


@compiled
def matrices(work: Array, nv: int, nu: int, forces: int, rows: int) -> tuple[Array, ...]:
    """:class:`Matrices`, as a plain tuple of views into one array: a call takes one in less time.

    ``forces`` are the numbers of all contact forces, ``rows`` those of the constraints.
    """
    a = nv * (nu + 1)
    b = a + forces * (nu + 1)
    c = b + nu * nu
    d = c + nu
    e = d + rows * nu
    return (
        work[:a].reshape((nv, nu + 1)),
        work[a:b].reshape((forces, nu + 1)),
        work[b:c].reshape((nu, nu)),
        work[c:d],
        work[d:e].reshape((rows, nu)),
        work[e : e + rows],
        work[e + rows : e + 2 * rows],
        work[e + 2 * rows : e + 2 * rows + nu],
    )


@compiled
def sizes(p: Any, arrays: tuple[Any, ...], bounds: Array) -> tuple[int, int, int, int]:
    """Arguments of :func:`matrices` after the first; arguments as for :func:`assemble`."""
    directions, nv, nu = arrays[4].shape[1], arrays[0].shape[0], arrays[6].shape[1]
    rows = nu + rows_per_contact(directions) * p.contacts + bounds.shape[1]
    return nv, nu, directions * p.contacts, rows


@compiled
def assemble(
    p: Any,
    r: Any,
    arrays: tuple[Any, ...],
    tasks: Array,
    torque_limit: Array,
    bounds: Array,
    work: Array,
) -> int:
    """Fill the QP's matrices, in ``work``; ``SINGULAR``, ``BOUNDED``, or ``FREE``.

    ``FREE`` where ``minimum`` keeps all constraints, which are then left in z. ``p`` is of
    ``QP_DATA``, ``r`` of ``ROBOT_DATA``; ``tasks`` (t, nv + 3) a stack's table; ``bounds`` (2, nu)
    the least and greatest accelerations of the joints [rad/s^2], (2, 0): none.
    """
    nv, nu, forces, rows = sizes(p, arrays, bounds)
    out = matrices(work, nv, nu, forces, rows)
    a_map, f_map, factor, gradient, constraint, lower, upper, minimum = out
    mass_matrix, nonlinear_effects, contact = arrays[0], arrays[1], arrays[4]
    contacts, directions = p.contacts, contact.shape[1]
    up = min(directions, UP + 1) - 1
    per_contact, weight, friction = rows_per_contact(directions), r.mass * r.gravity, p.friction
    jacobian, bias = np.empty((directions * contacts, nv)), np.empty(directions * contacts)
    for i in range(contacts):
        point = p.contact[i]
        for d in range(directions):
            axis = UP if d == up else d
            for k in range(nv):
                jacobian[i * directions + d, k] = contact[point, d, k]
            sliding = p.contact_damping * r.contact_velocity[point, axis]
            bias[i * directions + d] = r.contact_bias[point, axis] + sliding
    if not eliminate(mass_matrix, nonlinear_effects, jacobian, bias, nv - nu, a_map, f_map):
        return SINGULAR
    factor[:], gradient[:] = 0.0, 0.0
    row = np.empty(nu + 1)
    for i in range(nu):
        factor[i, i] = p.torque_cost
    for t in range(tasks.shape[0]):
        if tasks[t, nv + WEIGHT] == 0.0:
            continue
        row[:] = 0.0
        for k in range(nv):
            if tasks[t, k] != 0.0:  # a foot moves with few of the joints
                for j in range(nu + 1):
                    row[j] += tasks[t, k] * a_map[k, j]
        row[nu] += tasks[t, nv + BIAS] - tasks[t, nv + DESIRED]
        _add_square(row, tasks[t, nv + WEIGHT], torque_limit, factor, gradient)
    for i in range(contacts):
        for d in range(up + 1):
            for j in range(nu + 1):
                row[j] = f_map[i * directions + d, j] / weight
            row[nu] -= p.force[i, d] / weight
            _add_square(row, p.force_cost, torque_limit, factor, gradient)
    if directions == PATCH:
        _add_moments(p, r, f_map, (row, torque_limit), factor, gradient)

    constraint[:] = 0.0
    for i in range(nu):
        constraint[i, i] = 1.0
        lower[i], upper[i] = -1.0, 1.0
    if directions == PATCH:
        _bound_patches(p, r, f_map, torque_limit, constraint, lower, upper)
    for i in range(contacts):
        top, normal = nu + per_contact * i, directions * i + up
        for d in range(up if directions < PATCH else 0):
            along = directions * i + d
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
        at = top + per_contact - 1
        for j in range(nu):
            constraint[at, j] = f_map[normal, j] * torque_limit[j] / weight
        lower[at] = -f_map[normal, nu] / weight
        upper[at] = min(_FAR, (p.cap[i] - f_map[normal, nu]) / weight)
    for i in range(bounds.shape[1]):
        row_of, joint = nu + per_contact * contacts + i, nv - nu + i
        for j in range(nu):
            constraint[row_of, j] = a_map[joint, j] * torque_limit[j]
        lower[row_of] = bounds[0, i] - a_map[joint, nu]
        upper[row_of] = bounds[1, i] - a_map[joint, nu]

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
def _add_moments(
    p: Any, r: Any, f_map: Array, parts: tuple[Array, Array], factor: Array, gradient: Array
) -> None:
    """Add the cost of the soles' moments about their toes; ``parts``: a row, torque limits."""
    row, torque_limit = parts
    wrench, weight = np.empty((PATCH, f_map.shape[1])), r.mass * r.gravity
    for i in range(p.contacts):
        patch = p.contact[i]
        _in_sole(r.contact_axes[patch], f_map, PATCH * i, wrench)
        for axis in range(3):
            side = r.sole_half[patch, 1 if axis == 0 else 0]
            for j in range(f_map.shape[1]):
                row[j] = wrench[3 + axis, j] / (weight * side)
            cost = p.force_cost if axis == UP else _CROOKED * p.force_cost
            _add_square(row, cost, torque_limit, factor, gradient)


@compiled
def _bound_patches(
    p: Any,
    r: Any,
    f_map: Array,
    torque_limit: Array,
    constraint: Array,
    lower: Array,
    upper: Array,
) -> None:
    """Write the cones of the soles that stand; arguments as in :func:`assemble`."""
    nu = torque_limit.shape[0]
    wrench, cone, weight = np.empty((PATCH, nu + 1)), np.empty((CONE, PATCH)), r.mass * r.gravity
    half = np.empty(2)
    for i in range(p.contacts):
        patch, top = p.contact[i], nu + (CONE + 1) * i
        _in_sole(r.contact_axes[patch], f_map, PATCH * i, wrench)
        for k in range(2):
            half[k] = p.sole_share * r.sole_half[patch, k]
        patch_cone(p.friction, half, r.sole_centre[patch], cone)
        for k in range(CONE):
            for j in range(nu):
                total = 0.0
                for d in range(PATCH):
                    total += cone[k, d] * wrench[d, j]
                constraint[top + k, j] = total * torque_limit[j] / weight
            total = 0.0
            for d in range(PATCH):
                total += cone[k, d] * wrench[d, nu]
            lower[top + k], upper[top + k] = -total / weight, _FAR


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
def torques(factor: Array, w: Array, torque_limit: Array, out: Array) -> None:
    """Write the joint torques of the QP's solution, tau_max * (L^-T w), into ``out`` (nu,) [N m].

    They are rounded to 2^-24 of tau_max, which is near ProxQP's tolerance. Where a process has
    loaded another build of ProxQP than :func:`.solver.load_proxqp` does, the last digits of the
    solution depend on where its workspace happens to lie in memory; without the rounding such a
    walk would not be the same twice.
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
    """Add the square of (row[:-1] tau + row[-1]), tau = scale * z, to H's lower triangle and g."""
    nu = gradient.shape[0]
    for i in range(nu):
        left = row_weight * row[i] * scale[i]
        gradient[i] += left * row[nu]
        for j in range(i + 1):
            hessian[i, j] += left * row[j] * scale[j]


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
def answer(p: Any, work: Array, model: Array, found: tuple[Array, Array, Array]) -> None:
    """Write a tick's answer into ``found``: torques, forces of the contacts, accelerations.

    ``model`` are the joint torques (nu,) of the model [N m], ``work`` is what :func:`assemble` has
    filled.
    """
    torque, force, acceleration = found
    out = matrices(work, acceleration.shape[0], torque.shape[0], force.shape[0], 0)
    _affine(out[0], model, acceleration)
    _affine(out[1], model, force)
    for i in range(torque.shape[0]):
        torque[i] = p.load * model[i]


@compiled
def bounds_needed(p: Any, r: Any) -> bool:
    """True if a joint is near its limit of speed, or the one that it has before its stop."""
    if r.fastest <= p.stop_share:
        return False
    return r.fastest > p.speed_share or r.soonest_stop <= p.stop_time


@compiled
def solve_free(
    qp: Any,
    data: Any,
    arrays: tuple[Any, ...],
    tasks: Array,
    room: tuple[Array, Array, Array, Array],
    found: tuple[Array, Array, Array],
) -> int:
    """Solve a tick in which no limit acts: ``FREE`` where none does.

    Else what :func:`assemble` finds, or ``BRAKED`` where accelerations are to be bounded and
    nothing has been assembled yet. ``room`` is from :meth:`.solver.WholeBodyQp.room`, ``found`` as
    for :func:`answer`.
    """
    p, r = qp[0], data[0]
    if bounds_needed(p, r):
        return BRAKED
    torque_limit, bounds, work, model = room
    kind = assemble(p, r, arrays, tasks, torque_limit, bounds, work)
    if kind == FREE:
        nv, nu, forces, rows = sizes(p, arrays, bounds)
        out = matrices(work, nv, nu, forces, rows)
        torques(out[2], out[7], torque_limit, model)
        answer(p, work, model, found)
    return kind
