"""Move at a speed that changes at any time: random profiles, or one from a file.

    python examples/any_speed.py [--trials 4] [--first 0] [--duration 60] [--robot five-link]
    python examples/any_speed.py --commands 3.0 [--backward 0.4] [--trials 4] [--first 0]
    python examples/any_speed.py --ramp 0.3 [--stay 5]
    python examples/any_speed.py --profile FILE [--save run.npz]
    python examples/any_speed.py --speeds 8 [--robot rabbit] [--starts 3]

A random profile goes at 0.1 to 0.5 m/s^2 from one speed to the next, all within 0.3 to 1.4 m/s for
l0 = 1 m and the robot's own range, and keeps each for 1 to 5 s. Its number is its seed. With
--commands the robot stands, walks and runs: the speed jumps to one between 0 and this one every 3
to 8 s, to 0 in a quarter of the cases, and, with --backward, as often to this speed backward. A
ramp goes from 0.4 to 1.4 m/s with this acceleration, stays, and goes back. FILE is TOML with two
lists, times [s] and speeds [m/s].
With --speeds the robot keeps so many speeds, spread evenly over its own range, for 50 steps each;
with --starts also from so many starts off its gait.
"""

import argparse
import tomllib
from pathlib import Path

import numpy as np

import template_control as tc
from template_control.robustness import wilson_interval
from template_control.run.experiment import perturbed_start
from template_control.run.summary import summarise
from template_control.slip import Scale, WalkingGait
from template_control.slip.scenario.scenario import Gait

_STEPS, _LAST = 50, 20  # of a run that keeps a speed, and those that it is judged by
_ALL: tuple[Gait, ...] = ("stand", "walk", "run")


def random_profile(
    seed: int, duration: float, within: tuple[float, float], rates: tuple[float, float]
) -> tc.SpeedProfile:
    """A profile drawn with its seed; ``within`` bounds speeds, ``rates`` accelerations."""
    rng = np.random.default_rng(seed)
    times, speeds = [0.0], [rng.uniform(*within)]
    while times[-1] < duration:
        speed, acceleration = rng.uniform(*within), rng.uniform(*rates)
        times.append(times[-1] + abs(speed - speeds[-1]) / acceleration)
        times.append(times[-1] + rng.uniform(1.0, 5.0))
        speeds += [speed, speed]
    return tc.SpeedProfile(tuple(times), tuple(speeds))


def random_commands(
    seed: int, duration: float, fastest: float, backward: float
) -> tc.run.VelocityProfile:
    """Speeds that jump, drawn with this seed; ``fastest`` ahead, and the one ``backward`` [m/s]."""
    rng, time, rows = np.random.default_rng(seed), 0.0, []
    while time < duration:
        draw = rng.random()
        if draw < 0.25:
            speed = 0.0
        else:
            speed = -backward if draw < 0.5 and backward else rng.uniform(0.0, fastest)
        rows.append((time, speed, 0.0, 0.0))
        time += rng.uniform(3.0, 8.0)
    return tc.run.VelocityProfile(tuple(rows), duration, gaits=_ALL)


def ramp(acceleration: float, stay: float, unit: float) -> tc.SpeedProfile:
    """0.4 to 1.4 m/s and back, ``stay`` seconds at either end."""
    rise = 1.0 / acceleration
    times = np.cumsum([0.0, 2.0, rise, stay, rise, stay])
    return tc.SpeedProfile(tuple(times), tuple(unit * v for v in (0.4, 0.4, 1.4, 1.4, 0.4, 0.4)))


def follow(
    name: str,
    robot: str,
    profile: tc.SpeedProfile | tc.run.VelocityProfile,
    duration: float,
) -> tc.Record:
    """Follow a profile, and say how it went."""
    model = tc.load_robot(robot)
    motion: tc.SpeedRoute | tc.run.VelocityProfile
    if isinstance(profile, tc.SpeedProfile):
        motion = tc.SpeedRoute(tc.template_for(model), profile, duration)
    else:
        motion = profile
    record = tc.simulate(tc.Experiment(model, motion, record_every=10))
    summary, speed = summarise(record, None), record.section_state[:, 0]
    off = speed[1:] - record.section_target[:-1, 0]
    ended = f"FELL: {summary['fall_reason']}" if record.fell else "no fall"
    accepted, torques = summary["accepted_speed"], summary["joint_torque"].values()
    kinds = record.kinds_of_stride
    others = sum(kind != kinds[0] for kind in kinds) if isinstance(profile, tc.SpeedProfile) else 0
    caught = f" ({others} strides that catch it)" if others else ""
    print(
        f"{name}: {ended}, {record.steps} steps{caught} in {summary['duration']:.1f} s,"
        f" {speed.min():.2f} to {speed.max():.2f} m/s at VLO,"
        f" off the wanted {np.sqrt(np.mean(off**2)):.3f} m/s RMS,"
        f" off the accepted {accepted['error_rms']:.3f} m/s RMS,"
        f" reduced {accepted['strides']} times by up to {accepted['most']:.2f} m/s,"
        f" |dy/dt| up to {np.abs(record.section_state[:, 2]).max():.2f} m/s,"
        f" torque up to {max(joint['peak'] for joint in torques):.0f} N m, at the limit in"
        f" {100 * summary['saturated_share']:.2f} % of the ticks",
        flush=True,
    )
    return record


def keep(name: str, count: int, starts: int) -> tc.Record:
    """Keep ``count`` speeds of a robot's own range, and print a row of a table for each run."""
    robot = tc.load_robot(name)
    slowest, fastest = tc.walking_speeds(robot)
    print(f"{robot.name} walks at {slowest:.2f} to {fastest:.2f} m/s")
    print("| [m/s] | start | steps | dx/dt [m/s] | y [mm] | dy/dt [m/s] | torque | at the limit |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for speed in np.linspace(slowest, fastest, count).round(4):
        gait = tc.robot_gait_for_speed(robot, float(speed))
        for seed in (None, *range(starts)):
            start = None if seed is None else perturbed_start(gait, seed)
            record = tc.simulate(
                tc.Experiment(
                    robot, planner=tc.LqrPlanner(gait), steps=_STEPS, start=start, record_every=10
                )
            )
            print(row(record, gait, float(speed), seed), flush=True)
    return record


def row(record: tc.Record, gait: WalkingGait, speed: float, seed: int | None) -> str:
    """Result of a run: distance of the last steps' ends from the gait, mean and deviation."""
    error = record.section_state[1:][-_LAST:] - gait.vlo
    units = (1.0, 1e3, 1.0)
    settled = [
        f"{unit * off:.{3 if unit == 1.0 else 1}f} ± {unit * spread:.{3 if unit == 1.0 else 1}f}"
        for unit, off, spread in zip(units, error.mean(axis=0), error.std(axis=0), strict=True)
    ]
    summary = summarise(record, None)
    torque = max(joint["peak"] / joint["limit"] for joint in summary["joint_torque"].values())
    cells = [
        f"{speed:.3f}",
        "gait" if seed is None else f"seed {seed}",
        f"{record.steps}{', FELL' if record.fell else ''}",
        *settled,
        f"{100 * torque:.0f} %",
        f"{100 * summary['saturated_share']:.2f} %",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Follow what was asked for."""
    parser = argparse.ArgumentParser(description="Move at a speed that changes at any time.")
    parser.add_argument("--trials", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="seed of the first trial")
    parser.add_argument("--duration", type=float, default=60.0, help="of a random profile [s]")
    parser.add_argument("--commands", type=float, help="fastest of random commands [m/s]")
    parser.add_argument("--backward", type=float, default=0.0, help="speed of commands [m/s]")
    parser.add_argument(
        "--rates", type=float, nargs=2, default=(0.1, 0.5), help="of a random profile [m/s^2]"
    )
    parser.add_argument("--ramp", type=float, help="acceleration [m/s^2]")
    parser.add_argument("--stay", type=float, default=5.0, help="at the end of a ramp [s]")
    parser.add_argument("--profile", type=Path, help="TOML with times and speeds")
    parser.add_argument("--speeds", type=int, help="of the robot's own range, to keep")
    parser.add_argument("--starts", type=int, default=0, help="off the gait, at each of them")
    parser.add_argument("--robot", default="five-link", help="name or URDF file")
    parser.add_argument("--save", type=Path, help="file of the last run's record")
    chosen = parser.parse_args()
    robot = tc.load_robot(chosen.robot)
    unit, (slowest, fastest) = Scale.of(tc.template_for(robot)).speed, tc.walking_speeds(robot)
    within = max(0.3 * unit, slowest), min(1.4 * unit, fastest)
    if chosen.speeds is not None:
        record = keep(chosen.robot, chosen.speeds, chosen.starts)
    elif chosen.profile is not None:
        data = tomllib.loads(chosen.profile.read_text(encoding="utf-8"))
        profile = tc.SpeedProfile(tuple(data["times"]), tuple(data["speeds"]))
        record = follow(str(chosen.profile), chosen.robot, profile, profile.times[-1])
    elif chosen.ramp is not None:
        profile = ramp(chosen.ramp, chosen.stay, unit)
        record = follow(f"{chosen.ramp:g} m/s^2", chosen.robot, profile, profile.times[-1])
    else:
        falls = 0
        for seed in range(chosen.first, chosen.first + chosen.trials):
            drawn: tc.SpeedProfile | tc.run.VelocityProfile
            if chosen.commands is None:
                drawn = random_profile(seed, chosen.duration, within, chosen.rates)
            else:
                drawn = random_commands(seed, chosen.duration, chosen.commands, chosen.backward)
            record = follow(f"seed {seed}", chosen.robot, drawn, chosen.duration)
            falls += record.fell
        low, high = wilson_interval(chosen.trials - falls, chosen.trials)
        print(
            f"{chosen.trials - falls} of {chosen.trials} did not fall"
            f" ({100 * low:.0f} to {100 * high:.0f} % with 95 % confidence)"
        )
    if chosen.save is not None:
        print(record.save(chosen.save))


if __name__ == "__main__":
    main()
