"""Stand, start and stop: from any spacing of the feet, at any phase, and pushed while standing.

    python examples/stand_start_stop.py [--robot five-link] [--what starts stops pushes]

One line a run: how it goes, the largest of torque, and how the robot stands in the end. Speeds
are mean speeds of the family of gaits by speed, with push-off, for l0 = 1 m.
"""

import argparse
from collections.abc import Iterator
from itertools import groupby

import numpy as np

import template_control as tc
from template_control.embedding import standing_planners, standing_pose
from template_control.robot import PlanarBiped
from template_control.slip import Scenario, ScenarioRoute, Segment, SteadyRoute, gaits_by_speed

SPACINGS = (0.1, 0.2, 0.3, 0.4)  # m
STARTS, STOPS = (0.5, 0.8, 1.1), (0.5, 0.9, 1.3)  # m/s
PHASES = 10
PUSHES = (12.0, 14.0, 16.0, 18.0, 19.0, 20.0, 21.0, 22.0, 23.5, 25.0)  # N s
SIDES = ((0.1, 1.0), (0.1, -1.0), (0.15, 1.0), (0.15, -1.0))  # feet apart [m], direction
STANDS, WALKS, LAST = 5.0, 2.0, 4.0  # s
BEATS = 12


def walk(robot: PlanarBiped, speed: float, segments: list[Segment], spacing: float) -> tc.Record:
    """A scenario with a mean speed [m/s]; it starts from a stand where its first segment does."""
    p = tc.template_for(robot)
    gait = tc.gait_for_speed(p, speed * np.sqrt(p.rest_length))
    at_vlo = float(gait.vlo[0])
    named = [
        s if s.gait == "stand" else Segment("walk", at_vlo, duration=s.duration) for s in segments
    ]
    speed_z, height, vertical = (float(value) for value in gait.vlo)
    start = (speed_z, height / p.rest_length, vertical)
    scenario = Scenario(segments=tuple(named), start=start).on(p)
    planners = standing_planners(p, family=gaits_by_speed(p)) | {"wp": tc.LqrPlanner(gait)}
    stands = segments[0].gait == "stand"
    pose = standing_pose(p, spacing * p.rest_length) if stands else None
    return tc.simulate(
        tc.Experiment(
            robot, ScenarioRoute(scenario, walks="wp"), planner=planners, pose=pose, record_every=5
        )
    )


def starts(robot: PlanarBiped) -> Iterator[tuple[str, tc.Record]]:
    """From every spacing to every speed and back to a stand."""
    for spacing in SPACINGS:
        for speed in STARTS:
            still = Segment("stand", duration=0.5)
            asked = [still, Segment("walk", duration=WALKS), Segment("stand", duration=STANDS)]
            yield f"{spacing} m to {speed} m/s", walk(robot, speed, asked, spacing)


def stops(robot: PlanarBiped) -> Iterator[tuple[str, tc.Record]]:
    """A command at ten phases, each in another step of a steady walk."""
    for speed in STOPS:
        p = tc.template_for(robot)
        duration = tc.gait_for_speed(p, speed * np.sqrt(p.rest_length)).step_duration
        for i in range(PHASES):
            at = (1 + i % 3 + i / PHASES) * duration
            asked = [Segment("walk", duration=at), Segment("stand", duration=2.0)]
            yield (
                f"{speed} m/s, phase {i / PHASES:g} of step {1 + i % 3}",
                walk(robot, speed, asked, 0),
            )


def pushes(robot: PlanarBiped) -> Iterator[tuple[str, tc.Record]]:
    """Pushes of 0.1 s to a stand on narrow feet, which cannot hold all of them."""
    p = tc.template_for(robot)
    scale = robot.mass * np.sqrt(p.rest_length) / 80.0
    for spacing, side in SIDES:
        for size in PUSHES:
            route = SteadyRoute(p, "s", [0.0, 0.97 * p.rest_length, 0.0])
            record = tc.simulate(
                tc.Experiment(
                    robot,
                    route,
                    planner=standing_planners(p),
                    steps=BEATS,
                    pose=standing_pose(p, spacing * p.rest_length),
                    pushes=(tc.Push(side * size * scale, step=1),),
                    record_every=5,
                )
            )
            yield f"{spacing} m apart, {side * size:+g} N s", record


def outcome(record: tc.Record) -> tuple[bool, str]:
    """True if a run ended in a stand, and a line about the run."""
    kinds = record.kinds_of_stride
    way = " ".join(kind for kind, _ in groupby(kinds))
    last = record.time > record.time[-1] - 1.0
    drift = 1e3 * float(np.ptp(record.com[last], axis=0).max())
    speed = 1e3 * float(np.abs(record.com_velocity[last]).max())
    torque = float(np.abs(record.torque).max())
    limit = record.torque_limit
    share = float(np.mean(np.any(np.abs(record.torque) > 0.999 * limit, axis=1)))
    apart = float(np.ptp(record.foot[-1, :, 0]))
    about = (
        f"{way}; feet {apart:.2f} m, drift {drift:.3f} mm, {speed:.3f} mm/s, torque {torque:.0f}"
        f" N m, at a limit {share:.2%}"
    )
    return not record.fell, record.fall_reason or about


def main() -> None:
    """Run what was asked for, and count."""
    parser = argparse.ArgumentParser(description="Stand, start and stop.")
    parser.add_argument("--robot", default="five-link")
    groups = {"starts": starts, "stops": stops, "pushes": pushes}
    parser.add_argument("--what", nargs="+", choices=tuple(groups), default=list(groups))
    chosen = parser.parse_args()
    robot = tc.load_robot(chosen.robot)
    for name in chosen.what:
        results = []
        for case, record in groups[name](robot):
            stood, about = outcome(record)
            results.append(stood)
            print(f"{case}: {about}", flush=True)
        print(f"{name}: {sum(results)} of {len(results)} stand in the end", flush=True)


if __name__ == "__main__":
    main()
