"""Effect of pushes, unseen steps of the ground and another mass: counts, a line a row.

    python examples/push_tables.py [--row "run, five-link" ...] [--trial 7 ...]
        [--results push_tables.jsonl] [--processes 1]

Every trial is a run of its own from its start, the same at every call. The results are kept as
they come; the same line goes on from there. ``--trial`` repeats single trials of the rows, by the
number that is printed where they fall.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

import template_control as tc
from template_control import robustness
from template_control.embedding import Planner
from template_control.slip import Scenario, Segment
from template_control.sweep import SweepOptions, sweep

SPEED = 3.0  # of the runs, dx/dt at apex [m/s]
BEFORE, AFTER = 3, 10  # strides of a run before and after the one that is disturbed
WALKED = 4  # steps of a walk before a push
CATCH = 18  # steps of a walk that is pushed so hard that it breaks into a run
NEAR = 0.02  # of the wanted speed: a robot within this is back

WALK = Segment("walk", speed=1.1, steps=8)


def faster(until: float) -> Segment:
    """A run that accelerates from 1.3 m/s to this speed."""
    return Segment("run", speed=1.3, acceleration=0.35, until_speed=until)


SLOWER = Segment("run", acceleration=-0.35, until_speed=1.4)
WALK_ON = Segment("walk", speed=1.1, steps=8)

# Segments, and the stride in which the push comes.
WAYS: dict[str, tuple[tuple[Segment, ...], int]] = {
    "walk to run": ((WALK, Segment("run", speed=1.3, steps=6)), 8),
    "run to walk": ((WALK, Segment("run", speed=1.3, steps=4), WALK_ON), 13),
    "accelerating": (
        (WALK, faster(2.4), Segment("run", steps=6)),
        15,
    ),
    "decelerating": ((WALK, faster(2.6), SLOWER, WALK_ON), 23),
}


@dataclass(frozen=True)
class Row:
    """A line of the table.

    Attributes:
        way: "run", "walk", one of ``WAYS``, or "at" and the mean speed of a walk [m/s].
        robot: name of a shipped one.
        trials: what disturbs the robot: impulse [N s] and phase of the stride; height [m] and
            place, a share of the way between two footholds, of a step of the ground; or mass,
            a factor.
    """

    way: str
    robot: str
    trials: tuple[dict[str, float], ...]


def pushes(*impulses: float, phases: int = 10) -> tuple[dict[str, float], ...]:
    """Each impulse at phases all over the stride [N s]."""
    return tuple({"impulse": j, "phase": i / phases} for j in impulses for i in range(phases))


EDGES = tuple({"height": h, "place": p} for h in (0.03, -0.03) for p in (0.1, 0.3, 0.5, 0.7, 0.9))
MASSES = ({"mass": 1.1}, {"mass": 0.9})

ROWS = {
    "run, five-link": Row("run", "five-link", pushes(20.0, -20.0)),
    "run, runner": Row("run", "runner", pushes(40.0, -40.0)),
    "walk to run": Row("walk to run", "five-link", pushes(15.0, -15.0)),
    "run to walk": Row("run to walk", "five-link", pushes(15.0, -15.0)),
    "accelerating": Row("accelerating", "five-link", pushes(20.0, -20.0)),
    "decelerating": Row("decelerating", "five-link", pushes(20.0, -20.0)),
    "catch, runner, 60": Row("walk", "runner", pushes(60.0)),
    "catch, runner, 80": Row("walk", "runner", pushes(80.0)),
    "catch, five-link, 60": Row("walk", "five-link", pushes(60.0)),
    "catch, five-link, 80": Row("walk", "five-link", pushes(80.0)),
    **{
        f"hard, five-link, {j}": Row("walk", "five-link", pushes(float(j), phases=20))
        for j in (35, 45, -50, -65)
    },
    **{
        f"walk at {v}": Row(f"at {v}", "five-link", pushes(15.0, -15.0))
        for v in (0.4, 0.6, 0.8, 1.0, 1.2, 1.4)
    },
    "steps, five-link": Row("run", "five-link", EDGES),
    "steps, runner": Row("run", "runner", EDGES),
    "mass, five-link": Row("run", "five-link", MASSES),
    "mass, runner": Row("run", "runner", MASSES),
}


def trial(robot: str, way: str, disturbance: dict[str, float]) -> dict[str, Any]:
    """One run, and how it went."""
    model = tc.load_robot(robot)
    run = tc.RunningPlanner(tc.running_gait(tc.template_for(model), SPEED))
    planner: Planner | None = run
    scenario = None
    if way == "walk":
        planner = tc.LqrPlanner(tc.default_gait(model))
        step, last = WALKED, CATCH
    elif way.startswith("at "):
        gait = tc.gait_for_speed(tc.template_for(model), float(way.removeprefix("at ")))
        planner = tc.LqrPlanner(gait)
        step, last = WALKED, WALKED + 1 + AFTER
    elif way == "run":
        step, last = BEFORE, BEFORE + 1 + AFTER
    else:
        segments, step = WAYS[way]
        start = (1.1, 0.978, 0.0)
        planner, last = None, None
        scenario = Scenario(segments, map_kind=tc.MapKind.EXACT, start=start)
    plant, push = tc.PlantOptions(), tuple[tc.Push, ...]()
    if "mass" in disturbance:
        plant, last = tc.PlantOptions(mass_scale=disturbance["mass"]), 2 * AFTER
    elif "height" in disturbance:
        before, beyond = footholds(model, run, step + 1)
        edge = before + disturbance["place"] * (beyond - before)
        plant = tc.PlantOptions(terrain=tc.Terrain.step(disturbance["height"], edge))
    else:
        push = (tc.Push(disturbance["impulse"], step, disturbance["phase"]),)
    record = tc.simulate(
        tc.Experiment(
            model, scenario, planner, steps=last, world=plant, pushes=push, record_every=5
        )
    )
    kinds = record.kinds_of_stride
    speed, wanted = record.section_state[:, 0], record.section_target[:, 0]
    return {
        "fell": record.fell or (last is None and not record.arrived),
        "why": record.fall_reason,
        "pushed_at": float(speed[min(step, len(speed) - 1)]),
        "back": back(speed, step) if way == "run" and "mass" not in disturbance else None,
        "end": float(speed[-1] / wanted[-1] - 1.0),
        "fastest": float(speed.max()),
        "runs": kinds.count("r"),
        "torque": float(np.abs(record.torque).max()),
        "at_limit": record.summary.saturated_share * record.duration,
    }


def footholds(model: Any, planner: tc.RunningPlanner, step: int) -> tuple[float, float]:
    """The last two x of an undisturbed run's ``step`` strides [m]."""
    gait = planner.gait
    where = tc.Experiment(model, planner=planner).prepare()
    before, beyond = robustness.footholds(where, (*gait.apex, 0.0), step)[-2:]
    return float(before), float(beyond)


def back(speed: Any, step: int) -> int | None:
    """Strides after the disturbed one until the speed stays near the wanted; None: it does not."""
    away = np.flatnonzero(np.abs(speed[step + 1 :] / SPEED - 1.0) > NEAR)
    strides = int(away[-1]) + 1 if len(away) else 0
    return strides if strides < len(speed) - step - 1 else None


def markdown_row(name: str, results: list[Any]) -> str:
    """A row of the table, as Markdown."""
    stood = [r for r in results if r is not None and not r["fell"]]
    late = [r["back"] for r in stood if r["back"] is not None]
    lost = sum(r["back"] is None for r in stood) if name.startswith(("run,", "steps")) else 0
    cells = [
        name,
        f"{len(stood)} of {len(results)}",
        f"{min(late)} to {max(late)}" + f", {lost} later" * bool(lost) if late else "",
        span([100.0 * abs(r["end"]) for r in stood], "%"),
        span([r["fastest"] for r in stood], "m/s"),
        span([r["torque"] for r in stood], "N m"),
        span([1e3 * r["at_limit"] for r in stood], "ms"),
        span([r["runs"] for r in stood], ""),
    ]
    return f"| {' | '.join(cells)} |"


def span(values: list[float], unit: str) -> str:
    """Least and greatest, three digits."""
    return f"{min(values):.3g} to {max(values):.3g} {unit}".strip() if values else ""


def main() -> None:
    """Run the trials, print what fell and the table."""
    parser = argparse.ArgumentParser(description="What pushes do to a robot that runs.")
    parser.add_argument("--row", action="append", choices=tuple(ROWS), help="all if none")
    parser.add_argument("--trial", action="append", type=int, help="its number in the row; all")
    parser.add_argument("--results", default=None)
    parser.add_argument("--processes", type=int, default=1)
    chosen = parser.parse_args()
    lines = []
    with ProcessPoolExecutor(chosen.processes) as executor:
        for name in chosen.row or ROWS:
            row = ROWS[name]
            numbers = chosen.trial or range(len(row.trials))
            if not set(numbers) <= set(range(len(row.trials))):
                parser.error(f"the trials of {name} are 0 to {len(row.trials) - 1}")
            trials = [row.trials[i] for i in numbers]
            items = [{"robot": row.robot, "way": row.way, "disturbance": d} for d in trials]
            path = f"{chosen.results}.{name.replace(', ', '-').replace(' ', '-')}"
            found = sweep(
                trial, items, path if chosen.results else None, executor,
                options=SweepOptions(progress=False),
            )  # fmt: skip
            for i, d, result, error in zip(
                numbers, trials, found.results, found.errors, strict=True
            ):
                if error is not None or result["fell"]:
                    print(f"{name}, trial {i}, {d}: {error or result['why']}", flush=True)
            lines.append(markdown_row(name, list(found.results)))
            print(lines[-1], flush=True)
    print(
        "\n| | go on | strides until back | off at the end | fastest | torque | at limit | runs |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |", *lines, sep="\n")


if __name__ == "__main__":
    main()
