"""Walks on ground that the controller does not know: random steps, random treads, slopes.

``python examples/rough_ground.py`` prints the table of docs/lab/ground.md, row by row; ``--what``,
``--trials`` and ``--robot`` choose a part of it. Every draw is seeded: a trial's number gives its
ground.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import template_control as tc
from template_control.robustness.findings import wilson_interval
from template_control.slip import WalkingGait

SEED = 1
FIRST, LAST = 3.0, 6.0  # the gait's footholds between which a step comes
AFTER = 9  # steps of the robot after the last of them


@dataclass(frozen=True)
class Row:
    """One row of the table."""

    title: str
    trials: int
    steps: int


ROWS = {
    "steps-3": Row("one step of 3 cm, up and down in turn, anywhere", 200, round(LAST) + AFTER),
    "steps-5": Row("one step of 5 cm, up and down in turn, anywhere", 40, round(LAST) + AFTER),
    "treads": Row("treads of 0.3 to 0.6 m, each within 2 cm of level", 20, 200),
    "slopes": Row("slopes of 4 degrees, up and down", 2, 100),
}


def grounds(what: str, trials: int, gait: WalkingGait) -> Iterator[tc.Terrain]:
    """The grounds of a row: lengths are those of five-link, scaled to the gait's template."""
    length = gait.parameters.rest_length
    if what.startswith("steps"):
        height = int(what[-1]) * 0.01 * length
        places = np.random.default_rng(SEED).uniform(FIRST, LAST, trials) * gait.step_length
        for number, place in enumerate(places):
            yield tc.Terrain.step(height if number % 2 == 0 else -height, float(place))
    elif what == "treads":
        for seed in range(trials):
            treads = (0.3 * length, 0.6 * length)
            yield tc.Terrain.random_steps(0.02 * length, treads, seed, start=length)
    else:
        for number in range(trials):
            angle = np.radians(4.0 if number % 2 == 0 else -4.0)
            yield tc.Terrain.slope(float(angle), start=length)


def main() -> None:
    """Print the rows that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--what", choices=tuple(ROWS), nargs="*", default=tuple(ROWS))
    parser.add_argument("--robot", default="five-link")
    parser.add_argument("--trials", type=int, help="instead of the row's own number")
    options = parser.parse_args()
    robot = tc.load_robot(options.robot)
    gait = tc.default_gait(robot)
    for what in options.what:
        row = ROWS[what]
        trials = options.trials or row.trials
        falls, slow = 0, 0
        for number, ground in enumerate(grounds(what, trials, gait)):
            plant = tc.PlantOptions(terrain=ground)
            record = tc.simulate(
                tc.Experiment(
                    robot, planner=tc.LqrPlanner(gait), steps=row.steps, world=plant, record_every=5
                )
            )
            speed = record.section_state[-5:, 0].mean() / gait.state[0] - 1.0
            falls += record.fell
            slow += not record.fell and abs(speed) > 0.03
            if record.fell or trials < 10:
                reason = record.fall_reason or "goes on"
                print(f"  {what} {number}: {reason}, {record.steps} steps, {100 * speed:+.1f} %")
        low, high = wilson_interval(falls, trials)
        print(
            f"| {row.title} | {row.steps} | {trials} | {falls} ({100 * low:.0f} to"
            f" {100 * high:.0f} %) | {slow} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
