"""A floating-base robot follows velocities forward, to the left and about the vertical, at random.

    python examples/any_velocity.py [ROBOT] [--trials 4] [--first 0] [--duration 60]
        [--forward 0.35 2.0] [--backward 0.4] [--left 0.2] [--turn 0.5] [--rest 0.2] [--stay 5 10]

The command jumps every 5 to 10 s, and the robot learns of it as it jumps: a speed forward within
the range, or backward up to --backward, or 0 with the probability --rest where the robot can
stand or hop; speeds to the left, and turning rates, up to these to both sides. The number of a
trial is its seed. The error in each of the three is that of the mean over a command from 3 s after
its jump on, in the frame of the trunk's heading; a robot that turns round first stands by then. It
is that off the command, and off what was accepted of it: a run changes its speed as fast as it can.
"""

import argparse
from itertools import pairwise

import numpy as np

import template_control as tc
from template_control.robustness import wilson_interval
from template_control.run.velocity import VelocityRange

_SETTLING = 3.0  # [s]


Row = tuple[float, float, float, float]


def random_velocities(seed: int, o: argparse.Namespace, rests: bool) -> list[Row]:
    """Times and velocities, drawn with this seed."""
    rng, time = np.random.default_rng(seed), 0.0
    slowest, fastest = o.forward
    back = max(o.backward - slowest, 0.0)
    rows = []
    while time < o.duration:
        least, most = (-back, -o.left, -o.turn), (fastest - slowest, o.left, o.turn)
        forward, left, turn = rng.uniform(least, most)
        forward += slowest if forward >= 0.0 else -slowest
        if rng.random() < o.rest and rests:
            forward = left = turn = 0.0
        rows.append((time, forward, left, turn))
        time += rng.uniform(*o.stay)
    return rows


def errors(record: tc.run.FloatingRecord, rows: list[Row]) -> np.ndarray:
    """(n, 2, 3) mean velocity less the commanded, and less the accepted, of each command.

    In m/s, m/s, rad/s.
    """
    time, found = record.time, []
    c, s = np.cos(record.heading), np.sin(record.heading)
    velocity = np.gradient(record.space_com[:, :2], time, axis=0)
    ahead = c * velocity[:, 0] + s * velocity[:, 1]
    left = c * velocity[:, 1] - s * velocity[:, 0]
    begun = np.searchsorted(record.section_time, time, side="right") - 1
    accepted = record.section_velocity[np.maximum(begun, 0)]
    for row, (end, *_) in pairwise([*rows, (time[-1],)]):
        here = (time >= row[0] + _SETTLING) & (time < end)
        if here.sum() < 2:
            continue
        turned = np.diff(record.heading[here][[0, -1]]) / np.diff(time[here][[0, -1]])
        mean = np.array([ahead[here].mean(), left[here].mean(), turned[0]])
        found.append([mean - row[1:], mean - accepted[here].mean(axis=0)])
    return np.array(found).reshape(-1, 2, 3)


def shown(found: np.ndarray) -> str:
    """Root mean squares of errors (n, 2, 3)."""
    off, less = np.sqrt((found**2).mean(axis=0))
    parts = "{:.3f}, {:.3f} m/s, {:.3f} rad/s"
    return f"off the command {parts.format(*off)}, off the accepted {parts.format(*less)} RMS"


def main() -> None:
    """Follow random velocities, and say how it went."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", nargs="?", default="go2")
    parser.add_argument("--trials", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="seed of the first trial")
    parser.add_argument("--duration", type=float, default=60.0, help="of a trial [s]")
    parser.add_argument("--forward", type=float, nargs=2, default=[0.35, 2.0], help="[m/s]")
    parser.add_argument("--backward", type=float, default=0.0, help="fastest [m/s]")
    parser.add_argument("--left", type=float, default=0.2, help="to both sides [m/s]")
    parser.add_argument("--turn", type=float, default=0.5, help="to both sides [rad/s]")
    parser.add_argument("--rest", type=float, default=0.2, help="probability of the speed 0")
    parser.add_argument("--stay", type=float, nargs=2, default=[5.0, 10.0], help="[s]")
    parser.add_argument("--save", help="file of the last run's record")
    o = parser.parse_args()
    robot = tc.load_floating_robot(o.robot)
    can = VelocityRange.of(robot)
    falls, all_errors = 0, []
    for seed in range(o.first, o.first + o.trials):
        rows = random_velocities(seed, o, can.backward > 0.0)
        profile = tc.run.VelocityProfile(tuple(rows), o.duration, foreseen=False, gaits=can.gaits)
        record = tc.simulate(tc.Experiment(robot, motion=profile, record_every=10))
        assert isinstance(record, tc.run.FloatingRecord)
        falls += record.fell
        all_errors.append(errors(record, rows))
        print(
            f"seed {seed}: {f'FELL: {record.fall_reason}' if record.fell else 'no fall'},"
            f" {record.steps} steps in {record.duration:.1f} s, {shown(all_errors[-1])}",
            flush=True,
        )
    low, high = wilson_interval(o.trials - falls, o.trials)
    print(
        f"{o.trials - falls} of {o.trials} did not fall"
        f" ({100 * low:.0f} to {100 * high:.0f} % with 95 % confidence);"
        f" {shown(np.concatenate(all_errors))}"
    )
    if o.save:
        record.save(o.save)


if __name__ == "__main__":
    main()
