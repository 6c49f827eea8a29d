"""A gait's sideways step map, and the law that returns to its periodic motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from template_control.checks.checked import checked
from template_control.errors import GaitError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import Gait
from template_control.slip.lateral.options import LateralOptions
from template_control.slip.lateral.path import NEXT, lateral_path
from template_control.slip.lateral.transition import transition
from template_control.slip.maps.section import section_of
from template_control.slip.similarity import Scale, scaled

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_NEXT = 2 + NEXT  # column of the next foothold


@dataclass(frozen=True)
class LateralGait:
    """The sideways step map of a gait, from section to section, and its cost-to-go.

    A state X is (2,): y of the CoM from the stance foot and dy/dt [m, m/s]. At an apex the stance
    foot is the one that stood last. With the next foothold at d from the stance foot [m],
    X' = a X + b d at the next section, from the next foot.

    Attributes:
        a: (2, 2) of the state.
        b: (2,) of the next foothold.
        cost: (2, 2) P of the cost-to-go e' P e of an error e of the state; the next step's cost
            on the state is part of it.
        gain: (2,) K of d = d_s - K e.
        speed: dx/dt at the section [m/s].
    """

    a: Array
    b: Array
    cost: Array
    gain: Array
    speed: float

    @property
    def open_loop(self) -> ComplexArray:
        """Eigenvalues of a step with d = d_s, states of the left mirrored to those of the right."""
        return np.linalg.eigvals(-self.a).astype(np.complex128)

    @property
    def closed_loop(self) -> ComplexArray:
        """Eigenvalues of a step by the law, states of the left mirrored to those of the right."""
        return np.linalg.eigvals(np.outer(self.b, self.gain) - self.a).astype(np.complex128)


@checked
def lateral_gait(
    gait: Gait, options: LateralOptions | None = None, automaton: Automaton = AUTOMATON
) -> LateralGait:
    """The sideways step map along a planar gait.

    Args:
        gait: the planar one.
        options: what errors and steps cost, for the reference template; scaled to the gait's.
        automaton: of the gait's stride.

    Raises:
        GaitError: if the gait's stride is not completed, or no foot lands in it.
    """
    p, node = gait.parameters, automaton.start(gait.stride).name
    section = section_of(automaton.sections(node)[0])
    stride = simulate_stride(p, node, section.state(gait.state), gait.controls, automaton=automaton)
    path = lateral_path((stride,), p.gravity)
    if not np.isfinite(path.section):
        raise GaitError(
            f"gait {gait.name!r} has no sideways step: {stride.outcome.reason or 'no foot lands'}"
        )
    m = transition(path, 0.0, path.section, 1.0)
    a, b = m[:, :2], m[:, _NEXT] - (1.0, 0.0)
    o = scaled(options or LateralOptions(), Scale.of(p))
    cost = _cost_to_go(a, b, np.array(o.state_cost), o.step_cost)
    gain = (b @ cost @ a) / (o.step_cost + b @ cost @ b)
    return LateralGait(a.copy(), b, cost, gain, float(gait.state[0]))


def _cost_to_go(a: Array, b: Array, state_cost: Array, step_cost: float) -> Array:
    """The Riccati equation's solution (2, 2)."""
    try:
        found = solve_discrete_are(a, b[:, None], np.diag(state_cost), np.array([[step_cost]]))
    except np.linalg.LinAlgError:
        raise GaitError(
            "no law brings the sideways motion of this gait back: choose another gait"
        ) from None
    return np.asarray(found)
