"""The compiled code of a walk, in parts that processes can compile side by side.

Each part calls compiled functions with arguments of the types that a walk calls them with. It
has no result: what counts is that they are compiled then.
"""

from __future__ import annotations

import numpy as np

from template_control.embedding.com_path import plan_is_due
from template_control.embedding.modes import first_fired
from template_control.embedding.planners.running import leg_bounds
from template_control.embedding.planners.step_search import KneeLoadPenalty, Law, choose
from template_control.robot.library import load_robot
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.automaton.vocabulary import MapKind, StrideKind
from template_control.slip.control.least_squares import Search
from template_control.slip.control.stride_solver import Prior, solve_stride, whole
from template_control.slip.dynamics.kernel import new_scratch
from template_control.slip.dynamics.model import ORDER, stride_kernel
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.structured import keep
from template_control.warm_up import Part
from template_control.whole_body.solver import WholeBodyQp
from template_control.whole_body.stack import TaskStack
from template_control.whole_body.task import References
from template_control.whole_body.tasks import PostureTask

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


def whole_tick() -> None:
    """A tick of the controller; only Pinocchio knows how its arrays lie."""
    from template_control.embedding.tick import TICK, act, sense, stand  # which imports planners

    robot, references, tick = load_robot("five-link"), References(), np.zeros(1, TICK)
    robot.update(robot.neutral(), np.zeros(robot.nv))
    qp, tasks = WholeBodyQp(robot), TaskStack((PostureTask(),), robot.nv)
    memory = references.data, qp.data
    sense(tick, robot.data, *memory, np.zeros(2, dtype=bool), np.zeros((2, 2)), 1e-3)
    stand(tick, robot.data, *memory)
    plan_is_due(tick["path"][0], True, 0.0, 0.0, 0.0)
    first_fired(tick[0])
    curve = np.ones((2, 1, ORDER + 1)), np.ones((1, 7)), np.ones(3)
    rows = tasks.program, tasks.table
    kept = keep(((tick, robot.data, *memory, robot.arrays), (curve, None), rows, qp.room(1.0)))
    act(kept, qp.answer_arrays(), 1e-3)


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


def solver() -> None:
    """The solver of strides."""
    table = np.array([[_CONTROLS[0]], [1.0], [1.0], [1.2]])
    prior = Prior(_CONTROLS, [0], table, Search(1))
    solve_stride(whole(ReturnMap(_TEMPLATE), _STATE), _STATE, prior, np.eye(3))


def catch() -> None:
    """The planner of the run that a walk breaks into."""
    leg_bounds(np.ones(2), np.ones(3), (0.0, 1.0), 1.0, (1.0, 1.0, 1.0), (0.0, 1.0))


CONTROL = (
    Part(whole_tick, 9.0),
    Part(catch, 0.5),
)
"""Compiled functions of a tick of the controller."""

WALK = (
    Part(closed_form_map, 4.2),
    Part(step_search, 6.3),
    Part(solver, 6.0),
    Part(derivatives, 4.7),
    Part(exact_map, 2.8),
    *CONTROL,
)
"""Compiled functions of the default planner and the controller."""
