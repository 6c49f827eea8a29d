"""The sideways motion of Bolt's gaits: eigenvalues by speed, and a walk seen from above.

Run: python examples/sideways.py [folder]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import template_control as tc
from template_control.slip import (
    LateralGait,
    LateralLearnt,
    LateralOptions,
    LateralWish,
    Side,
    WalkingGait,
    lateral_aim,
    lateral_cycle,
    lateral_gait,
    lateral_path,
    place,
    simulate_stride,
)
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.lateral.path import transition
from template_control.slip.maps.section import VLO
from template_control.slip.similarity import Scale, scaled

# Stiffness over the nominal, touchdown angle [deg], speed at VLO [m/s].
GAITS = ((1, 66, 0.65), (1, 68, 0.60), (1, 70, 0.50), (3, 74, 0.45), (2, 74, 0.40), (3, 76, 0.30))
WIDTH, TURN = 0.1, 0.1  # [m], [rad]
STEPS, PUSHED, PUSH = 8, 2, 0.12  # the walk that is drawn; the change of dy/dt [m/s]


def main(folder: Path) -> None:
    """Print the table, and draw a walk with the second gait."""
    template = tc.template_for(tc.load_robot("bolt"))
    for factor, angle, speed in GAITS:
        parameters = replace(template, leg_stiffness=factor * template.leg_stiffness)
        gait = tc.gait_at(parameters, np.radians(angle), speed)
        print(f"{factor}, {angle} deg, {speed:.2f} m/s: {row(gait, lateral_gait(gait))}")
    walk = tc.gait_at(template, np.radians(68.0), 0.60)
    figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
    draw(axes, walk, lateral_gait(walk))
    figure.savefig(folder / "sideways.png", dpi=110)


def row(gait: WalkingGait, lateral: LateralGait) -> str:
    """Mean speed, step, eigenvalues, gain, the CoM from the stance foot, and its lean in a turn."""
    straight = lateral_cycle(lateral, LateralWish(WIDTH)).states
    turning = lateral_cycle(lateral, LateralWish(WIDTH, turn=TURN)).states
    open_loop, closed_loop = (
        ", ".join(f"{e:.3f}" for e in sorted(values.real, key=abs))
        for values in (lateral.open_loop, lateral.closed_loop)
    )
    return (
        f"{gait.mean_speed:.2f} m/s, {gait.step_duration:.2f} s; {open_loop}; {closed_loop};"
        f" {-lateral.gain[0]:.2f}, {-lateral.gain[1]:.2f} s;"
        f" {1e3 * abs(straight[0, 0]):.1f} mm; {1e3 * turning.mean(axis=0)[0]:.1f} mm"
    )


def draw(axes: Axes, gait: WalkingGait, lateral: LateralGait) -> None:
    """From above: CoM and footholds of the linear motion, pushed to the left at one VLO."""
    p, learnt = gait.parameters, LateralLearnt()
    options = scaled(LateralOptions(), Scale.of(p))
    cycle = lateral_cycle(lateral, LateralWish(WIDTH))
    stride = simulate_stride(p, STRIDE_START["w"], VLO.state(gait.vlo), gait.controls)
    path, side = lateral_path((stride,), p.gravity), Side.LEFT
    times = np.linspace(0.0, path.section, 40)
    foot = np.array([0.0, 0.5 * WIDTH])
    com = cycle.states[0] + (foot[1], 0.0)
    for step in range(STEPS):
        com[1] += PUSH if step == PUSHED else 0.0
        aim = lateral_aim(lateral, cycle, side, learnt, options)
        feet = np.array([foot[1], 0.0])
        following = np.array(
            [foot[0] + gait.step_length, place(path, aim, 0.0, com, feet).y],
        )
        motion = np.array([*com, *feet, following[1]])
        way = np.array([transition(path, 0.0, t) @ motion for t in times])
        axes.plot(foot[0] + stride.sample(times)[:, 0], way[:, 0], "k")
        axes.plot(*foot, "o", color="C0" if side is Side.LEFT else "C1")
        foot, com, side = following, way[-1], side.other
    axes.set(xlabel="x [m]", ylabel="y [m]", title=f"pushed by {PUSH} m/s at the third VLO")
    axes.axvline(PUSHED * gait.step_length, color="0.7", zorder=0)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("."))
