"""A bounded linear law of a walking step in compiled code: its controls, a step, what it costs.

The step is the template's exact VLO return map or the improved closed form, and what the robot
adds to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import compiled
from template_control.slip.automaton.vocabulary import NUM_SLOTS, MapKind, Outcome
from template_control.slip.dynamics.kernel import Scratch
from template_control.slip.dynamics.model import Kernel
from template_control.slip.maps.return_map import one_stride

Array = NDArray[np.float64]

_FAST = np.int64(MapKind.IMPROVED)  # Numba would compile once more for a literal int
_FLIES = int(Outcome.UNWANTED_FLIGHT)


class Strain(NamedTuple):
    """What a step costs whose leg forces are more than a knee carries.

    Attributes:
        reach: length of the leg at which the knee is straight [m].
        most: moment of the leg force about the knee from which on a step costs more [N m].
        price: of a moment that is twice as much.
    """

    reach: float
    most: float
    price: float


class Law(NamedTuple):
    """A bounded linear law u = u_s - K (z - z_s) and what it needs to be judged.

    There are c controls: 3 in the paper's walking step, 4 in one with push-off.

    Attributes:
        target: (3,) z_s, dx/dt, y, dy/dt.
        control: (c,) u_s: alpha [rad], kappa_1/k0, kappa_2/k0 and, with push-off, kappa_p/k0.
        gain: (c, 3) K.
        cost: (3, 3) cost-to-go about ``target``.
        offset: (3,) what the robot adds to the template's next VLO state.
        lower, upper: (c,) bounds of u.
        slots: (c,) places of u in a stride's controls.
        second_steps: (n, c) other controls than u_s - K (z - z_s) for the second step.
        enough: a cost below which no other second step is tried.
        first_weight: of the cost-to-go after the first step beside that after the second.
        effort: (c,) of (u - u_s)^2 in the first step, beside both.
        highest: a CoM that flies higher than this [m] has left the ground.
        top_margin: alpha stays this far [rad] below asin(y / l0).
        earliest: alpha also stays below asin(y / l0) this long after VLO [s].
        stiffness: k0 [N/m].
        softest: least stiffness/k0 that is chosen for the rest of a slow step.
        strain: what a step costs that strains the knees.
        kernel: the template's walking step.
    """

    target: Array
    control: Array
    gain: Array
    cost: Array
    offset: Array
    lower: Array
    upper: Array
    slots: NDArray[np.int64]
    second_steps: Array
    enough: float
    first_weight: float
    effort: Array
    highest: float
    top_margin: float
    earliest: float
    stiffness: float
    softest: float
    strain: Strain
    kernel: Kernel


@compiled
def copy(source: Array, target: Array) -> None:
    """Copy numbers; a slice would take Numba seconds to compile, for what it says of wrong shapes.

    Args:
        source: (n,) of them.
        target: (m,) overwritten, m <= n.
    """
    for i in range(target.shape[0]):
        target[i] = source[i]


@compiled
def bounded(law: Law, z: Array, u: Array) -> None:
    """Clip controls in place to what is admissible at a VLO state.

    The height a short time after VLO comes from its Taylor series to the second order.

    Args:
        law: its bounds, its ``top_margin`` and its ``earliest`` count.
        z: (3,) VLO state dx/dt, y, dy/dt [m/s, m, m/s].
        u: (c,) alpha [rad], stiffnesses/k0; overwritten.
    """
    for i in range(u.shape[0]):
        u[i] = min(max(u[i], law.lower[i]), law.upper[i])
    length, t = law.kernel.rest_length, law.earliest
    u[0] = min(u[0], np.arcsin(min(z[1] / length, 1.0)) - law.top_margin)
    if t > 0.0:
        lift = u[1] * law.stiffness / law.kernel.mass * (length - z[1]) - law.kernel.gravity
        later = z[1] + t * (z[2] + 0.5 * t * lift)
        u[0] = min(u[0], np.arcsin(min(max(later / length, 0.0), 1.0)))


@compiled
def linear(law: Law, z: Array, u: Array) -> None:
    """Write the law's controls, within their bounds, into ``u``.

    Args:
        law: u = u_s - K (z - z_s), and the bounds.
        z: (3,) VLO state dx/dt, y, dy/dt [m/s, m, m/s].
        u: (c,) overwritten with alpha [rad], stiffnesses/k0.
    """
    for i in range(u.shape[0]):
        u[i] = law.control[i]
        for j in range(3):
            u[i] -= law.gain[i, j] * (z[j] - law.target[j])
    bounded(law, z, u)


@compiled
def step(law: Law, exact: bool, s: Scratch, z: Array, u: Array, result: Array) -> int:
    """Take one walking step of the template, and add the robot's offset to where it ends.

    Args:
        law: the template's step and the offset.
        exact: try it on the exact map; else on the improved closed form.
        s: overwritten.
        z: (3,) VLO state dx/dt, y, dy/dt [m/s, m, m/s].
        u: (c,) alpha [rad], stiffnesses/k0.
        result: (RESULTS,) overwritten: the next VLO state first; see :func:`~.one_stride`.

    Returns:
        The Outcome's value; ``result`` means nothing where that is not SECTION.
    """
    # The template's leg would pull at the ground, which no robot's does.
    if z[1] + max(z[2], 0.0) ** 2 / (2.0 * law.kernel.gravity) > law.highest:
        return _FLIES
    controls = np.zeros(NUM_SLOTS)
    for i in range(u.shape[0]):
        controls[law.slots[i]] = u[i] if i == 0 else u[i] * law.stiffness
    if exact:
        outcome = one_stride(law.kernel, None, z, controls, s, result)
    else:
        outcome = one_stride(law.kernel, _FAST, z, controls, s, result)
    for i in range(3):
        result[i] += law.offset[i]
    return outcome


@compiled
def strain(law: Law, z: Array, u: Array, result: Array) -> float:
    """What the knees make a step cost, where the legs are shortest.

    A leg of length l bends a knee half-way up it, which is then sqrt(reach^2 - l^2) / 2 beside it.
    A robot that is fast may strain its knees: legs that brake as they can slow it down all the
    same. One that is slow sinks.

    Args:
        law: its ``strain``, ``stiffness`` and ``target`` count.
        z: (3,) VLO state that the step begins in.
        u: (c,) alpha [rad], stiffnesses/k0.
        result: (RESULTS,) of the step.
    """
    total, l0 = 0.0, law.kernel.rest_length
    if z[0] >= law.target[0]:
        return total
    for leg in range(2):
        length = result[4 + leg]
        # The rear leg has kappa_1 until the front one lands, and then kappa_p.
        k = max(u[1], u[u.shape[0] - 1]) if leg == 0 and u.shape[0] > 3 else u[1]
        arm = 0.5 * np.sqrt(max(law.strain.reach**2 - length**2, 0.0))
        excess = k * law.stiffness * (l0 - length) * arm / law.strain.most - 1.0
        if excess > 0.0:
            total += law.strain.price * excess**2
    return total


@compiled
def cost_to_go(target: Array, cost: Array, z: Array) -> float:
    """(z - z_s)^T P (z - z_s).

    It takes no :class:`Law`, which has 32 parts: a callee would take longer to compile.

    Args:
        target: (3,) z_s.
        cost: (3, 3) P.
        z: (3,) VLO state.
    """
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += (z[i] - target[i]) * cost[i, j] * (z[j] - target[j])
    return total
