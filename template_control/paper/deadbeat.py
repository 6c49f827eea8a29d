"""The one-step deadbeat controller's domain of attraction, and what a map's error costs (IV-D).

All states from which one step of the modified controller (kappa_1 = k0, free kappa_2 and
alpha) leads exactly onto an equilibrium; and for each, whether the controls that a closed-form
map finds instead bring the template into the self-stable basin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, MapKind, Outcome, Slot
from template_control.slip.control.step_solver import StepProblem, Unknowns
from template_control.slip.dynamics.stride import StrideSimulator
from template_control.slip.gaits.basin import steps_to_fall
from template_control.slip.gaits.branch import BranchPoint
from template_control.slip.gaits.gait import WalkingGait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO

Array = NDArray[np.float64]

_RETURNS = 1e-7  # how exactly a step of the set must lead onto the equilibrium


@dataclass(frozen=True)
class DeadbeatSet:
    """States from which one exact step leads onto an equilibrium.

    Attributes:
        state: (n, 3) at VLO.
        controls: (n, NUM_SLOTS) of that step.
    """

    state: Array
    controls: Array


def backward_set(
    gait: WalkingGait,
    stiffness_range: tuple[float, float] = (0.5, 1.5),
    counts: tuple[int, int] = (60, 180),
) -> DeadbeatSet:
    """Integrate backward in time from a gait's VLO state over the controls.

    The dynamics are the same backward: the mirrored equilibrium is walked forward with
    kappa_2 first and k0 after the virtual bottom. Its touchdown is the real step's liftoff,
    and the other way round; so the angle at that liftoff is the real touchdown angle.

    Args:
        gait: the equilibrium, at k0.
        stiffness_range: of kappa_2 over k0.
        counts: numbers of kappa_2 and of angles between 0 and 90 degrees.
    """
    p = gait.parameters
    start = VLO.state(VLO.mirror(gait.vlo))
    forward = ReturnMap(p)
    walk = StrideSimulator(p)
    states, controls = [], []
    for kappa in np.linspace(*stiffness_range, counts[0]) * p.leg_stiffness:
        for angle in np.radians(np.linspace(0.0, 90.0, counts[1] + 2)[1:-1]):
            u = np.zeros(NUM_SLOTS)
            u[[Slot.TOUCHDOWN_ANGLE, Slot.K_SC, Slot.K_SD]] = angle, kappa, p.leg_stiffness
            back = walk.run(STRIDE_START["w"], start, u)
            if not back.completed:
                continue
            liftoff = next(e.state for e in back.events if e.event is Event.REAR_LIFTOFF)
            z = VLO.mirror(VLO.of(back.state))
            u[Slot.TOUCHDOWN_ANGLE] = np.arcsin(liftoff[1] / p.rest_length)
            u[[Slot.K_SC, Slot.K_SD]] = p.leg_stiffness, kappa
            end, outcome = forward.step(z, u)
            # A double stance without virtual bottom never switches stiffness: no such step.
            if outcome is Outcome.SECTION and np.max(np.abs(end - gait.vlo)) < _RETURNS:
                states.append(z)
                controls.append(u)
    return DeadbeatSet(np.array(states), np.array(controls))


def controlled_end(found: DeadbeatSet, gait: WalkingGait, kind: MapKind) -> Array:
    """Walk one exact step from each state, with the controls that a map finds for it.

    Args:
        found: the states; the search for controls begins at the exact step's.
        gait: the equilibrium that the controls aim at.
        kind: of the map that the controls are found on.

    Returns:
        (n, 3) VLO states after the step, NaN where it fails.
    """
    p = gait.parameters
    slots = (Slot.TOUCHDOWN_ANGLE, Slot.K_SD)
    k0 = p.leg_stiffness
    unknowns = Unknowns(
        slots, np.array([0.0, 0.5 * k0]), np.array([0.5 * np.pi, 1.5 * k0]), np.array([1.0, k0])
    )
    problem = StepProblem(ReturnMap(p, "w", kind), unknowns, evaluations=100)
    controls = np.array(
        [
            problem.solve(z, gait.vlo, [u]).controls
            for z, u in zip(found.state, found.controls, strict=True)
        ]
    )
    return ReturnMap(p)(found.state, controls).state


def settles(
    ends: Array, branch: list[BranchPoint], gait: WalkingGait, limit: int = 50
) -> NDArray[np.bool_]:
    """Whether passive walking from each state converges to the equilibria of a branch.

    The touchdown angle is that of the branch's equilibrium with the state's energy.

    Args:
        ends: (n, 3) VLO states; NaN does not settle.
        branch: stable equilibria with the height of ``gait``, energy rising or falling.
        gait: for the template and the height.
        limit: steps to take.

    Returns:
        (n,) whether it converges.
    """
    p = gait.parameters
    order = np.argsort([point.energy for point in branch])
    energies = np.array([branch[i].energy for i in order])
    angles = np.array([branch[i].angle for i in order])
    energy = np.asarray(VLO.energy(p, ends))
    inside = (energy >= energies[0]) & (energy <= energies[-1])
    u = np.tile(gait.controls, (len(ends), 1))
    u[:, Slot.TOUCHDOWN_ANGLE] = np.interp(energy, energies, angles)
    z = np.where(inside[:, None], ends, np.nan)
    goal = np.array([gait.vlo[1], 0.0])
    return steps_to_fall(p, z, u, goal, limit).converges


def inside_share(
    found: DeadbeatSet, settled: NDArray[np.bool_], least_angles: Array
) -> tuple[Array, float]:
    """Share of the set's states that settle, among those with at least a given touchdown angle.

    Args:
        found: the set.
        settled: (n,) from :func:`settles`.
        least_angles: (m,) alpha_min, the least touchdown angle of the step [rad].

    Returns:
        (m,) shares, NaN where no state is left; the least angle from which all settle [rad].
    """
    alpha = found.controls[:, Slot.TOUCHDOWN_ANGLE]
    shares = np.array(
        [settled[alpha >= a].mean() if np.any(alpha >= a) else np.nan for a in least_angles]
    )
    lost = alpha[~settled]
    return shares, float(lost.max()) if lost.size else float(alpha.min())
