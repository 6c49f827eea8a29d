"""Search a walk that costs less work at the same speed, and see what pushes do to it.

    python examples/cheap_gait.py [--robot five-link] [--speed 1.1] [--generations 12] [--seed 1]

Differential evolution over the touchdown angle and the leg stiffness of the gait, the clearance of
the swing foot, and the pitch of the trunk. The price of a walk of twelve steps is its cost of
transport; a walk at another speed pays for it, and one that falls has the price of a standstill.
Then gait and search's result are pushed, in places that the search has not seen.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from os import cpu_count

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution

import template_control as tc
from template_control.errors import GaitError
from template_control.run.summary import summarise
from template_control.slip.similarity import Scale

_STEPS = 12
_NOTHING = 2.0  # cost of transport of what does not walk
_OFF = 5.0  # price of 1 m/s of another speed than the wanted one
_FREE = 0.02  # of a speed's error [m/s] has no price: the template's and the robot's means differ
# Touchdown angle [deg], leg stiffness over the robot's template's, clearance [m], pitch [rad].
_BOUNDS = ((62.0, 76.0), (0.7, 1.8), (0.02, 0.07), (-0.2, 0.2))
_GIVEN = (66.0, 1.0, 0.05, 0.0)
_IMPULSES = (-20.0, -10.0, 10.0, 20.0)  # of the pushes [N s], for 80 kg and l0 = 1 m
_PHASES = 8


def walk(x: tuple[float, ...], robot: str, speed: float) -> tc.Experiment:
    """A walk with these four numbers; a GaitError if the template has none."""
    degrees, stiffness, clearance, pitch = x
    p = tc.template_for(tc.load_robot(robot))
    p = replace(p, leg_stiffness=stiffness * p.leg_stiffness)
    gait = tc.gait_for_speed(p, speed, touchdown_angle=np.radians(degrees))
    tuned = {
        "controller.swing.clearance": clearance * Scale.of(p).length,
        "controller.trunk_pitch": pitch,
    }
    experiment = tc.Experiment(robot, planner=tc.LqrPlanner(gait), steps=_STEPS)
    return experiment.with_(tuned)


def price(x: tuple[float, ...], robot: str, speed: float) -> float:
    """Cost of transport, and what an error of the speed costs."""
    try:
        record = tc.simulate(walk(x, robot, speed))
    except GaitError:
        return _NOTHING
    if record.fell:
        return _NOTHING
    figures = summarise(record, None)
    off = max(abs(figures["mean_speed"] - speed) - _FREE, 0.0)
    return float(figures["cost_of_transport"] + _OFF * off)


def falls(push: tc.Push, x: tuple[float, ...], robot: str, speed: float) -> bool:
    """Whether a push fells the walk."""
    return bool(tc.simulate(replace(walk(x, robot, speed), pushes=(push,))).fell)


def main() -> None:
    """Search, push, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--robot", default="five-link")
    parser.add_argument("--speed", type=float, default=1.1, help="mean speed [m/s]")
    parser.add_argument("--generations", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1, help="of the search")
    o = parser.parse_args()
    p = tc.template_for(tc.load_robot(o.robot))
    unit = p.mass / tc.SlipParameters().mass * Scale.of(p).speed
    pushes = [
        tc.Push(size * unit, step=3, phase=i / _PHASES)
        for size in _IMPULSES
        for i in range(_PHASES)
    ]

    def report(intermediate_result: OptimizeResult) -> None:
        r = intermediate_result
        print(f"{r.fun:.4f}", " ".join(f"{x:8.3f}" for x in r.x), flush=True)

    priced = partial(price, robot=o.robot, speed=o.speed)
    with ProcessPoolExecutor(cpu_count()) as processes:
        found = differential_evolution(
            priced,
            _BOUNDS,
            popsize=4,
            maxiter=o.generations,
            tol=0.0,
            rng=o.seed,
            x0=_GIVEN,
            polish=False,
            workers=processes.map,
            updating="deferred",
            callback=report,
        )
        for name, x in (("given", _GIVEN), ("found", tuple(found.x))):
            felled = processes.map(partial(falls, x=x, robot=o.robot, speed=o.speed), pushes)
            count = sum(felled)
            print(f"{name}: cost {priced(x):.4f}, {count} of {len(pushes)} pushes fell it")


if __name__ == "__main__":
    main()
