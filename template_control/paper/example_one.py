"""Fig. 10: Example I, with controllers on each map (Section V-A)."""

from __future__ import annotations

from typing import Any

import numpy as np

from template_control.embedding.robot_route import robot_route
from template_control.paper.reproduction import Reproduction
from template_control.plant.c_library import stdout_to_stderr
from template_control.robot.library import load_robot
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate
from template_control.run.summary import summarise
from template_control.slip.automaton.vocabulary import MapKind, Slot, StrideKind
from template_control.slip.scenario.run import ScenarioRecord, simulate_scenario
from template_control.slip.scenario.scenario import example_one
from template_control.view.scenario_figures import energy_figure, route_figures, scenario_figure
from template_control.view.style import Look

_TOP_SPEED = 5.0
_PAPER_STIFFNESS = 28.2e3
_MAPS = (MapKind.PAPER, MapKind.IMPROVED, MapKind.EXACT)


def summary(record: ScenarioRecord) -> dict[str, Any]:
    """Summary figures of a run of Example I, SI units."""
    kinds = np.array(record.strides)
    error = record.section_state[1:, 0] - record.wanted_speed
    running, walking = kinds == StrideKind.RUN, kinds == StrideKind.WALK
    phases = np.array([record.energy_phase(i) for i in range(len(kinds))])
    top = np.flatnonzero(running & (record.wanted_speed >= _TOP_SPEED))
    first = int(np.flatnonzero(kinds != StrideKind.WALK)[0])
    step = record.during(first - 1)
    walked = record.state[step.stop, 0] - record.state[step.start, 0]
    last_walk = kinds.size - 1 - int(np.argmax(kinds[::-1] != StrideKind.WALK))
    return {
        "completed": record.completed,
        "strides": kinds.size,
        "walking_speed_before": float(walked / np.diff(record.section_time)[first - 1]),
        "speed_error_rms": float(np.sqrt(np.mean(error**2))),
        "speed_error_rms_running": float(np.sqrt(np.mean(error[running] ** 2))),
        "speed_error_max": float(np.max(np.abs(error))),
        "stiffness_at_5": float(np.mean(record.controls[top[-1], [Slot.K_SC, Slot.K_SD]])),
        "rwt_apex": record.section_state[kinds.tolist().index(StrideKind.RUN_TO_WALK), :2].tolist(),
        "rwt_vlo": record.section_state[kinds.tolist().index(StrideKind.RUN_TO_WALK) + 1].tolist(),
        "walking_steps_after": int(kinds.size - 1 - last_walk),
        "last_vlo": record.section_state[-1].tolist(),
        "energy_phase_walking": [float(phases[walking].min()), float(phases[walking].max())],
        "energy_phase_running": [float(phases[running].min()), float(phases[running].max())],
        "solve_seconds_median": float(np.median(record.solve_seconds)),
    }


def fig10() -> Reproduction:
    """Example I on the paper's map, and the tracking error with each map."""
    records = {kind: simulate_scenario(example_one(kind)) for kind in _MAPS}
    data = {kind.name.lower(): summary(record) for kind, record in records.items()}

    def row(name: str, published: str, text: Any) -> tuple[str, ...]:
        return (name, published, *(text(s) for s in data.values()))

    def state(values: list[float]) -> str:
        return "  ".join(f"{value:.4f}" for value in values)

    rows = [
        row("completed", "yes", lambda s: "yes" if s["completed"] else "no"),
        row("walking speed before [m/s]", "1.17", lambda s: f"{s['walking_speed_before']:.3f}"),
        row("speed error RMS, all sections [m/s]", "", lambda s: f"{s['speed_error_rms']:.2g}"),
        row("speed error RMS, running [m/s]", "", lambda s: f"{s['speed_error_rms_running']:.2g}"),
        row("speed error max [m/s]", "", lambda s: f"{s['speed_error_max']:.2g}"),
        row(
            "leg stiffness at 5 m/s [kN/m]",
            f"{_PAPER_STIFFNESS / 1e3:g}",
            lambda s: f"{s['stiffness_at_5'] / 1e3:.2f}",
        ),
        row("apex before RWT", "1.754  0.9766", lambda s: state(s["rwt_apex"])),
        row("VLO after RWT", "", lambda s: state(s["rwt_vlo"])),
        row("walking steps after RWT", "", lambda s: f"{s['walking_steps_after']}"),
        row(
            "last VLO (target 1.1  0.98  0)",
            "1.085  0.9807  -0.018",
            lambda s: state(s["last_vlo"]),
        ),
        row(
            "energy phase, walking",
            "out",
            lambda s: f"{s['energy_phase_walking'][0]:.2f} to {s['energy_phase_walking'][1]:.2f}",
        ),
        row(
            "energy phase, running",
            "in",
            lambda s: f"{s['energy_phase_running'][0]:+.2f} to {s['energy_phase_running'][1]:+.2f}",
        ),
    ]
    record = records[MapKind.PAPER]
    return Reproduction(
        title="Fig. 10: Example I",
        columns=("", "paper", *(f"{kind.name.lower()} map" for kind in _MAPS)),
        rows=rows,
        data={**data, "published": {"stiffness_at_5": _PAPER_STIFFNESS}},
        notes=(
            "The simulation is exact in every column; the columns differ in the map that the"
            " controllers compute with.",
            "Energy phase: correlation of forward kinetic and gravitational energy over a"
            " stride, -1 out of phase, +1 in phase.",
            "Walking starts at 1.125 m/s at VLO, which is 1.17 m/s on average as in Section"
            " V-A; Table IV's 1.1 m/s would be 1.13 m/s.",
        ),
        figures={"fig10": scenario_figure(record), "fig10_energies": energy_figure(record)},
    )


def fig10_on(robot_name: str) -> Reproduction:
    """Example I on a robot, shipped or a URDF's path, compared with its template.

    A ScenarioError if the robot cannot follow Example I.
    """
    robot = load_robot(robot_name)
    route = robot_route(robot, example_one())
    with stdout_to_stderr():
        record = simulate(Experiment(robot, route))
    template = simulate_scenario(route.scenario)
    figures, names = summarise(record, None), record.kinds_of_stride
    torque, speed = figures["joint_torque"], figures["joint_speed"]
    data = {
        "robot": robot.name,
        "completed": record.arrived,
        "fall_reason": figures["fall_reason"],
        "top_speed": float(record.section_state[:, 0].max()),
        "speed_error_rms": figures["speed_error_rms"],
        "walking_steps_after": int(np.argmax([name != StrideKind.WALK for name in names[-2::-1]])),
        "joint_torque": torque,
        "joint_speed": speed,
        "saturated_share": figures["saturated_share"],
        "qp_failures": figures["qp_failures"],
        "template": summary(template) if template.completed else {"completed": False},
    }
    other = data["template"]
    top = float(template.section_state[:, 0].max())

    def of(joints: dict[str, dict[str, float]], unit: str) -> str:
        most = max(joints.values(), key=lambda joint: joint["peak"] / joint["limit"])
        return f"{most['peak']:.3g} of {most['limit']:g} {unit}"

    rows = [
        ("completed", *("yes" if x["completed"] else "no" for x in (other, data))),
        ("top speed at an apex [m/s]", f"{top:.3f}", f"{data['top_speed']:.3f}"),
        (
            "speed error RMS, all sections [m/s]",
            *(f"{x['speed_error_rms']:.2g}" if x["completed"] else "" for x in (other, data)),
        ),
        ("walking steps after RWT", "", f"{data['walking_steps_after']}"),
        ("joint torque, nearest its limit", "", of(torque, "N m")),
        ("joint speed, nearest its limit", "", of(speed, "rad/s")),
        ("ticks with a torque at its limit", "", f"{100 * data['saturated_share']:.2f} %"),
        ("failed QPs", "", f"{data['qp_failures']}"),
    ]
    return Reproduction(
        title=f"Fig. 10: Example I on {robot.name}",
        columns=("", "its template, paper map", robot.name),
        rows=rows,
        data=data,
        notes=(
            "The robot's apexes are as high as suits its knees, not 0.98 m.",
            "Wanted is the profile, which waits for nobody.",
        ),
        figures={
            f"fig10_{name}": draw(record, Look())
            for name, draw in route_figures(record, template).items()
        },
    )
