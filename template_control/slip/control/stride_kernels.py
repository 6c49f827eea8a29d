"""The compiled code of strides, maps and their solver, in parts that processes can compile.

Each part calls compiled functions with arguments of the types that planners call them with. It has
no result: what counts is that they are compiled then.
"""

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


def derivatives() -> None:
    """The exact map's Jacobian, from which a planner's law is made."""
    ReturnMap(_TEMPLATE).linearise(_STATE, _CONTROLS)


def maps() -> None:
    """The maps, exact or in closed form, with which gaits are found and steps planned."""
    ReturnMap(_TEMPLATE).step(_STATE, _CONTROLS)
    simulate_stride(_TEMPLATE, STRIDE_START[StrideKind.WALK], VLO.state(_STATE), _CONTROLS)


def solver() -> None:
    """The solver of strides."""
    table = np.array([[_CONTROLS[0]], [1.0], [1.0], [1.2]])
    prior = Prior(_CONTROLS, [0], table, Search(1))
    solve_stride(whole(ReturnMap(_TEMPLATE), _STATE), _STATE, prior, np.eye(3))


STRIDES = (
    Part(solver, 6.0),
    Part(derivatives, 4.7),
    Part(maps, 4.2),
)
"""Compiled functions of strides."""
