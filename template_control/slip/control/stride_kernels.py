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

_TEMPLATE = SlipParameters()
_K0 = _TEMPLATE.leg_stiffness
_STATE = np.array([1.1, 0.978, 0.0])
_CONTROLS = controls(1.152, _K0, _K0)  # near a gait's, so that a stride passes all of its phases


def strides() -> None:
    """A stride, a map and its Jacobian, and the solver, called as planners call them."""
    simulate_stride(_TEMPLATE, STRIDE_START[StrideKind.WALK], VLO.state(_STATE), _CONTROLS)
    step = ReturnMap(_TEMPLATE)
    step.step(_STATE, _CONTROLS)
    step.linearise(_STATE, _CONTROLS)
    table = np.array([[_CONTROLS[0]], [1.0], [1.0], [1.2]])
    prior = Prior(_CONTROLS, [0], table, Search(1))
    solve_stride(whole(step, _STATE), _STATE, prior, np.eye(3))


STRIDES = (Part(strides, 21.3),)
"""Compiled functions of strides."""
