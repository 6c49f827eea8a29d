"""The compiled code of a walk, in parts that processes can compile side by side.

Each part calls compiled functions with arguments of the types that a walk calls them with. It
has no result: what counts is that they are compiled then.
"""

from __future__ import annotations

import numpy as np

from template_control.embedding.com_path import LOCATE
from template_control.embedding.leg_forces import leg_forces
from template_control.embedding.planners.running import leg_bounds
from template_control.embedding.planners.step_search import KneeLoadPenalty, Law, choose
from template_control.embedding.planners.stride_solver import improve
from template_control.embedding.swing import (
    SwingOptions,
    quintic_step,
    swing_step,
)
from template_control.robot.library import load_robot
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import MapKind, StrideKind
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import ORDER, stride_kernel
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.warm_up import Part
from template_control.whole_body.problem import (
    Matrices,
    assemble,
    follow,
    rows_per_foot,
    torques,
)
from template_control.whole_body.tasks import follow_foot

_TEMPLATE = SlipParameters()
_K0 = _TEMPLATE.leg_stiffness
_STATE = np.array([1.1, 0.978, 0.0])
_CONTROLS = controls(1.152, _K0, _K0)  # near a gait's, so that a stride passes all of its phases


def closed_form_map() -> None:
    """The improved closed-form map, which the search tries steps on."""
    ReturnMap(_TEMPLATE, kind=MapKind.IMPROVED).step(_STATE, _CONTROLS)


def derivatives() -> None:
    """The exact map's Jacobian, from which a planner's law is made."""
    ReturnMap(_TEMPLATE).linearise(_STATE, _CONTROLS)


def exact_map() -> None:
    """The exact map, with which gaits are found and steps planned."""
    ReturnMap(_TEMPLATE).step(_STATE, _CONTROLS)
    simulate_stride(_TEMPLATE, STRIDE_START[StrideKind.WALK], VLO.state(_STATE), _CONTROLS)


def whole_body() -> None:
    """The whole-body QP, of two degrees of freedom, one motor and one foot."""
    matrices = Matrices.zeros(2, 1, 2, 1 + rows_per_foot(2))
    mass_matrix = np.asfortranarray(np.eye(2))
    bias, limits, costs = np.zeros(2), np.ones(1 + 1 + 2), np.ones(2)
    contact, tasks, out = np.zeros((1, 2, 4)), np.zeros((1, 5)), tuple(matrices)
    assemble(mass_matrix, bias, contact, tasks, costs, limits, out)
    torques(np.ones((1, 1)), np.zeros(1), np.ones(1), np.zeros(1))
    feet, wish = np.zeros((2, 2)), (np.zeros((2, 2, 3)), np.zeros(2))
    follow_foot(0, (feet, feet, np.zeros((2, 2, 2)), feet), wish, 0.0, (1.0,) * 4, np.zeros((2, 5)))
    follow(matrices.a_map, matrices.f_map, np.zeros(1), np.zeros(2), np.zeros(2))


def planar_terms() -> None:
    """The sagittal part of what Pinocchio computes; only Pinocchio knows how its arrays lie."""
    robot = load_robot("five-link")
    robot.update(np.zeros(robot.nv), np.zeros(robot.nv))


def step_search() -> None:
    """The planner's look-ahead: its law, what a step is worth, and the search for a better one."""
    law = Law(
        target=_STATE,
        control=np.ones(3),
        gain=np.zeros((3, 3)),
        cost=np.eye(3),
        offset=np.zeros(3),
        lower=np.ones(3),
        upper=np.ones(3),
        slots=np.arange(3),
        second_steps=np.ones((1, 3)),
        trusted_price=0.0,
        effort=np.zeros(3),
        highest=1.0,
        earliest=0.0,
        stiffness=_K0,
        knee_load=KneeLoadPenalty(1.1, 350.0, 1.0),
        kernel=stride_kernel(_TEMPLATE, StrideKind.WALK),
    )
    scratch, u, first = new_scratch(), np.ones(3), np.empty(3)
    choose(law, scratch, _STATE, u, first)


def references() -> None:
    """The template's path, its leg forces and the swing of a foot."""
    coefficients, meta = np.ones((2, 1, ORDER + 1)), np.ones((1, 7))
    for locate in LOCATE.values():
        locate(coefficients, meta, np.ones(3), 0.1, 1.0, 0.0, np.zeros(6))
    leg_forces(meta[0], 0.1, np.ones(6), np.array([1.0, 1.0, 0.0, 1.0, 0.0]), np.zeros((2, 2)))
    quintic_step(np.zeros(3), 0.1, 0.0, 1.0, 1e-3)
    shape = SwingOptions().shape
    swing_step(np.zeros(3), np.zeros(3), (0.1, 0.0, 1.0), shape, (0.0, 0.0), 1e-3)


def catch() -> None:
    """The planner of the run that a walk breaks into."""
    one, square, prior = np.ones(1), np.ones((1, 1)), np.ones((4, 1))
    improve((one, one, one, square, square), one, one, one, prior)
    leg_bounds(np.ones(2), np.ones(3), (0.0, 1.0), 1.0, (1.0, 1.0, 1.0), (0.0, 1.0))


CONTROL = (
    Part(whole_body, 2.0),
    Part(planar_terms, 0.7),
    Part(catch, 1.3),
    Part(references, 0.9),
)
"""What a tick of the controller calls."""

WALK = (
    Part(closed_form_map, 4.2),
    Part(step_search, 6.3),
    Part(derivatives, 4.7),
    Part(exact_map, 2.8),
    *CONTROL,
)
"""What the default planner and the controller call."""
