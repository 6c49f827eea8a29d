"""JSON-serialisable metadata of a run."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import fields, is_dataclass
from typing import Any

from template_control.checks.fitting import shown
from template_control.embedding.controller import EmbeddingController
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.plant import plant_name
from template_control.run.options import SimulationOptions
from template_control.run.recorder import Recorder
from template_control.slip.gaits.gait import flight_share
from template_control.storage import to_jsonable


def about(controller: EmbeddingController, o: SimulationOptions) -> dict[str, Any]:
    """What is known of a run before its first tick.

    Args:
        controller: which has started.
        o: how the run goes.
    """
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
        "legs": robot.legs,
        "trunk_com": robot.trunk_com,
        "nodes": [node.name for node in nodes],
        "phases": [node.phase.name for node in nodes],
        "stiffness_slots": [[node.rear, node.front] for node in nodes],
        **_gait(controller),
        "plant": plant_name(o.plant),
        "options": _told(o),
    }
    return {name: to_jsonable(value, _described) for name, value in found.items()}


def outcome(recorder: Recorder, time_step: float, reason: str, seconds: float) -> dict[str, Any]:
    """What is known only when a run has ended.

    Args:
        recorder: of the run.
        time_step: of the plant [s].
        reason: why the robot fell, "" if it did not.
        seconds: of wall-clock time that the run took.
    """
    found = {
        **_gait(recorder.controller),
        "fall_reason": reason,
        "arrived": recorder.controller.supervisor.arrived,
        "wall_seconds": seconds,
        "duration": recorder.ticks * time_step,
        "ticks": recorder.ticks,
        "summary": recorder.summary(),
    }
    return {name: to_jsonable(value, _described) for name, value in found.items()}


def _told(o: SimulationOptions) -> dict[str, Any]:
    """The options as data; a plant of one's own is not data."""
    told: dict[str, Any] = to_jsonable(o, _described)
    return told if isinstance(o.plant, PlantOptions | IdealOptions) else {**told, "plant": {}}


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


def _described(value: Any) -> Any:
    """A dataclass as a dictionary, a set as a list, anything else as its text."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    return list(value) if isinstance(value, Sequence | Set) else shown(value)
