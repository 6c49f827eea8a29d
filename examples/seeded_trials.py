"""Robustness of a scenario with everything a little wrong at once, in either engine.

    python examples/seeded_trials.py [--scenario examples/zero_five_zero.toml] [--robot runner]
        [--plant pybullet] [--trials 20] [--results seeded_trials.jsonl]

Of each trial drawn with its number: friction 0.6 to 0.9, which the controller takes for 0.7, 3 %
of mass too much or too little, feet 0.2 to 0.35 of l0 apart, noise of 0.2 mrad, 0 or 1 ms of delay.
The results are kept as they come; the same line goes on from there.
"""

import argparse
from typing import Any

import numpy as np

import template_control as tc
from template_control.embedding import standing_pose
from template_control.robustness import wilson_interval
from template_control.sweep import SweepOptions, sample, sweep

PLANTS = {"pybullet": tc.PlantOptions, "mujoco": tc.MujocoOptions}


def trial(about: dict[str, str], world: dict[str, float], seed: int) -> dict[str, Any]:
    """One way through the scenario; true numbers of the plant, none of which the robot knows."""
    model = tc.load_robot(about["robot"])
    template = tc.template_for(model)
    plant = PLANTS[about["plant"]](friction=world["friction"], mass_scale=world["mass"])
    record = tc.simulate(
        tc.Experiment(
            model,
            tc.load_scenario(about["scenario"]),
            world=plant,
            pose=standing_pose(template, world["spacing"] * template.rest_length),
            sensors=tc.SensorOptions(noise=2e-4, seed=seed % 2**32),
            delay=round(world["delay"]) * plant.time_step,
            record_every=10,
        )
    )
    error = record.section_state[1:, 0] - record.section_target[:-1, 0]
    return {
        "arrived": bool(record.arrived),
        "why": record.fall_reason,
        "top_speed": float(record.section_state[:, 0].max()),
        "speed_error": float(np.sqrt(np.mean(error**2))),
        "saturated": float(record.summary.saturated_share),
        "torque": float(np.max(np.abs(record.torque))),
    }


def main() -> None:
    """Run the trials and say how many arrived."""
    parser = argparse.ArgumentParser(description="Falls of a scenario in seeded random trials.")
    parser.add_argument("--scenario", default="examples/zero_five_zero.toml")
    parser.add_argument("--robot", default="runner")
    parser.add_argument("--plant", choices=tuple(PLANTS), default="pybullet")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--results", default=None)
    chosen = parser.parse_args()
    about = {"scenario": chosen.scenario, "robot": chosen.robot, "plant": chosen.plant}
    draws = sample(
        chosen.trials, 1, friction=(0.6, 0.9), mass=(0.97, 1.03), spacing=(0.2, 0.35), delay=(0, 1)
    )
    found = sweep(
        trial, [{"about": about, "world": draw} for draw in draws], chosen.results,
        seed=1, options=SweepOptions(progress=True, label="trials"),
    )  # fmt: skip
    for item, result, error in zip(found.items, found.results, found.errors, strict=True):
        known = ", ".join(f"{name} {value:.3g}" for name, value in item["world"].items())
        if error is not None or not result["arrived"]:
            print(f"{known}: {error or result['why'] or 'did not arrive'}")
    good = [r for r in found.results if r is not None and r["arrived"]]
    low, high = wilson_interval(len(good), chosen.trials)
    print(f"{len(good)} of {chosen.trials} arrive: {low:.0%} to {high:.0%} with 95 % confidence")
    for name in ("top_speed", "speed_error", "saturated", "torque"):
        values = [r[name] for r in good]
        print(f"{name}: {min(values):.3g} to {max(values):.3g}" if values else name)


if __name__ == "__main__":
    main()
