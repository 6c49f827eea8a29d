"""Figure of eight of Bolt with a floating base: once around to the left, once to the right.

python examples/figure_of_eight.py [--speed 0.6] [--rate 0.35] [--picture eight.png]
"""

import argparse

import numpy as np
from matplotlib.figure import Figure

import template_control as tc
from template_control.run import FloatingRecord
from template_control.terminal import progress_bar
from template_control.view.figures import footholds
from template_control.view.style import save_figure


def main() -> None:
    """Walk, print where it came to, and draw the way."""
    parser = argparse.ArgumentParser(description="Bolt walks a figure of eight.")
    parser.add_argument("--speed", type=float, default=0.6, help="mean speed [m/s]")
    parser.add_argument("--rate", type=float, default=0.35, help="turning rate [rad/s]")
    parser.add_argument("--steps", type=int, default=None, help="the whole figure if not given")
    parser.add_argument("--picture", default="eight.png")
    chosen = parser.parse_args()
    bolt = tc.load_floating_robot("bolt")
    gait = tc.gait_for_speed(tc.template_for(bolt), chosen.speed)
    around = 2.0 * np.pi / chosen.rate
    course = tc.HeadingCommand(turning_rate=chosen.rate, turns=((around, -chosen.rate),))
    steps = chosen.steps or int(2.0 * around / gait.step_duration)
    planner = tc.LqrPlanner(gait, tc.embedding.FREE_PLANNER)
    experiment = tc.Experiment(bolt, planner=planner, steps=steps, course=course, record_every=5)
    with progress_bar(f"{steps} steps, about 20 s", steps) as progress:
        record = tc.simulate(experiment, progress)
    assert isinstance(record, FloatingRecord)
    roll, pitch, yaw = np.abs(record.attitude).max(axis=0)
    print(f"{record.steps} of {steps} steps in {record.time[-1]:.1f} s, fell: {record.fell}")
    print(f"turned to {record.heading.max():.2f} rad and back to {record.heading[-1]:.2f} rad")
    print(f"roll, pitch, yaw at most {roll:.4f}, {pitch:.4f}, {yaw:.2f} rad")
    figure = Figure(figsize=(5.0, 5.4), layout="constrained")
    axes = figure.subplots()
    axes.plot(*record.space_com[:, :2].T, color="0.3", linewidth=0.8, label="CoM")
    for foot, (name, color) in enumerate((("left foot", "#2a6196"), ("right foot", "#db7321"))):
        places, _ = footholds(record, foot)
        axes.plot(*places.T, "o", color=color, markersize=2.5, label=name)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="center", bbox_to_anchor=(0.5, 0.28), fontsize=8)
    save_figure(figure, chosen.picture)


if __name__ == "__main__":
    main()
