"""The compiled code of strides, maps and their solver, in one part: each calls the one before."""

from __future__ import annotations

import numpy as np

from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import StrideKind
from template_control.slip.control.least_squares import Search
from template_control.slip.control.stride_solver import Prior, solve_stride, whole
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.warm_up import Part


def strides() -> None:
    """A stride, a map and its Jacobian, and the solver, called as planners call them."""
    template, z = SlipParameters(), np.array([1.1, 0.978, 0.0])
    k0 = template.leg_stiffness
    u = controls(1.152, k0, k0)  # near a gait's, so that a stride passes all of its phases
    simulate_stride(template, STRIDE_START[StrideKind.WALK], VLO.state(z), u)
    step = ReturnMap(template)
    step.step(z, u)
    step.linearise(z, u)
    prior = Prior(u, [0], np.array([[u[0]], [1.0], [1.0], [1.2]]), Search(1))
    solve_stride(whole(step, z), z, prior, np.eye(3))


STRIDES = (Part(strides, 21.3),)
"""Compiled functions of strides."""
