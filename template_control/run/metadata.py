"""JSON-serialisable metadata of a run."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import fields, is_dataclass
from typing import Any

from template_control.checks.fitting import shown
from template_control.embedding.controller import EmbeddingController
from template_control.run.statistics import Statistics
from template_control.slip.gaits.gait import flight_share
from template_control.storage import to_jsonable


def about(controller: EmbeddingController) -> dict[str, Any]:
    """Facts of a robot and its controller, which has started, before a run's first tick."""
    robot = controller.robot
    nodes = controller.supervisor.automaton.nodes
    found = {
        "robot": robot.name,
        "urdf": robot.urdf,
        "mass": robot.mass,
        "joints": robot.joint_names,
        "torque_limit": controller.qp.torque_limit,
        "velocity_limit": robot.velocity_limit,
        "feet": robot.feet,
        "groups": robot.groups,
        "legs": robot.legs,
        "hinges": robot.hinges,
        "soles": [[*patch.centre, *patch.half_sides] for patch in robot.patches],
        "trunk_com": robot.trunk_com,
        "nodes": [node.name for node in nodes],
        "phases": [node.phase.name for node in nodes],
        "stiffness_slots": [[node.rear, node.front] for node in nodes],
        **_gait(controller),
        "plant": "",
        "options": {"plant": {}, "embedding": controller.options},
    }
    return plain(found)


def outcome(controller: EmbeddingController, figures: Statistics) -> dict[str, Any]:
    """Facts of a run so far; ``figures`` are over its ticks."""
    arrived = controller.supervisor.arrived
    return plain({**_gait(controller), "arrived": arrived, "summary": figures})


def _gait(controller: EmbeddingController) -> dict[str, Any]:
    """The gait that the planner leads to now."""
    planner = controller.planner
    gait = planner.gait
    return {
        "gait": gait.name,
        "template": gait.parameters,
        "gait_state": gait.state,
        "gait_controls": gait.controls,
        "gait_flight_share": flight_share(gait, controller.supervisor.automaton),
        "gait_mean_speed": gait.step_length / gait.step_duration,
        "planner": type(planner).__name__,
    }


def plain(value: Any) -> Any:
    """A value as JSON keeps it, with :func:`_described` of what it does not have."""
    return to_jsonable(value, _described)


def _described(value: Any) -> Any:
    """A dataclass as a dictionary, a set as a list, anything else as its text."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    return list(value) if isinstance(value, Sequence | Set) else shown(value)
