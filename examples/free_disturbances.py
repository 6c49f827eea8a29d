"""A robot that nothing holds is pushed from all sides, slips, weighs more, and treads on steps.

    python examples/free_disturbances.py [ROBOT] [SPEED] [--gait run] [--impulse 10]
        [--phases 0.1 0.6] [--places 3] [--grounds 0]

Levels are those of the reference template (80 kg, 1 m), scaled to the robot: 10 N s in eight
directions at some phases of a step, friction 0.5, masses 10 % off, 1 mrad of noise, 2 ms of delay,
both of them, steps of the ground of 1 % of l0 at random places, and grounds all of such steps. The
controller knows of none of them. A trial ends 16 steps after its push or step of the ground. It
is back on its gait if its last five steps are within 2 % of it in speed and height.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from math import radians

import numpy as np

import template_control as tc
from template_control.robustness.disturbances import PUSH_SECONDS, impulse_unit
from template_control.robustness.severity_sweep import SETTLED, gait_errors
from template_control.run import FloatingRecord
from template_control.run.specs import GaitSpec
from template_control.slip import RunningGait, Scale, WalkingGait

HEIGHT, DELAY, NOISE = 0.01, 0.002, 1e-3
BEFORE, AFTER, LONG = 4, 16, 40
DIRECTIONS = range(0, 360, 45)


def trials(
    gait: WalkingGait | RunningGait, options: argparse.Namespace
) -> Iterator[tuple[str, tc.Experiment]]:
    """Name and options of each trial."""
    scale = Scale.of(gait.parameters)
    steps = BEFORE + AFTER
    impulse = options.impulse * impulse_unit(gait.parameters)
    for degrees in DIRECTIONS:
        for phase in options.phases:
            seconds, direction = PUSH_SECONDS * scale.time, radians(degrees)
            push = tc.Push(impulse, BEFORE, phase, seconds, direction)
            name = f"push to {degrees} deg, phase {phase}"
            yield name, tc.Experiment(steps=steps, pushes=(push,))
    for share in (-0.1, 0.1):
        plant = tc.PlantOptions(mass_scale=1.0 + share)
        yield f"mass {share:+.0%}", tc.Experiment(steps=steps, world=plant)
    yield "friction 0.5", tc.Experiment(steps=steps, world=tc.PlantOptions(friction=0.5))
    sensors = tc.SensorOptions(noise=NOISE, seed=1)
    yield f"noise {1e3 * NOISE:g} mrad", tc.Experiment(steps=steps, sensors=sensors)
    grain = tc.PlantOptions().time_step
    delay = grain * max(1, round(DELAY * scale.time / grain))
    yield f"delay {1e3 * delay:.3g} ms", tc.Experiment(steps=steps, delay=delay)
    both = tc.Experiment(steps=steps, sensors=sensors, delay=delay)
    yield f"noise {1e3 * NOISE:g} mrad and delay {1e3 * delay:.3g} ms", both
    lot = np.random.default_rng(7)
    for sign in (1.0, -1.0):
        for x in lot.uniform(BEFORE, BEFORE + 1.0, options.places) * gait.step_length:
            height = sign * HEIGHT * scale.length
            plant = tc.PlantOptions(terrain=tc.Terrain.step(height, float(x)))
            name = f"step of {1e3 * height:+.1f} mm at {x:.2f} m"
            yield name, tc.Experiment(steps=steps, world=plant)
    for seed in range(options.grounds):
        terrain = tc.Terrain.random_steps(HEIGHT * scale.length, seed=seed)
        plant = tc.PlantOptions(terrain=terrain)
        yield f"ground {seed}", tc.Experiment(steps=LONG, world=plant)


def main() -> None:
    """Disturb the robot in one way after the other, and tell what comes of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", nargs="?", default="bolt")
    parser.add_argument("speed", nargs="?", type=float, default=0.55, help="mean speed [m/s]")
    parser.add_argument("--phases", nargs="+", type=float, default=[0.1, 0.6], help="of pushes")
    parser.add_argument("--places", type=int, default=3, help="of steps up, and of steps down")
    parser.add_argument("--gait", choices=("walk", "run"), default="walk")
    parser.add_argument("--impulse", type=float, default=10.0, help="of pushes [N s, at 80 kg]")
    parser.add_argument("--grounds", type=int, default=0, help="of random steps, 40 steps each")
    parser.add_argument("--only", default="", help="trials whose names begin so")
    options = parser.parse_args()
    robot = tc.load_floating_robot(options.robot)
    motion = GaitSpec(options.gait, speed=options.speed)
    gait = motion.of(robot)
    stood = back = count = 0
    for name, run in trials(gait, options):
        if not name.startswith(options.only):
            continue
        record = tc.simulate(replace(run, robot=robot, motion=motion))
        assert isinstance(record, FloatingRecord)  # of a free robot
        count += 1
        if record.fell:
            print(f"{name}: {record.fall_reason}", flush=True)
            continue
        speed, height = gait_errors(record, gait)
        stood += 1
        back += max(abs(speed), abs(height)) <= SETTLED
        roll, pitch, yaw = np.abs(record.attitude).max(axis=0)
        print(
            f"{name}: speed {speed:+.1%}, height {height:+.1%}, roll {roll:.3f}, pitch {pitch:.3f},"
            f" yaw {yaw:.2f} rad, {record.summary.qp_failures} failed QPs",
            flush=True,
        )
    print(f"{options.robot}, {count} trials: {stood} without a fall, {back} back on the gait")


if __name__ == "__main__":
    main()
