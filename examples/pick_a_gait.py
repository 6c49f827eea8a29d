"""Find the walking gaits of one height, and pick the one that forgives most.

Run: python examples/pick_a_gait.py [folder]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import template_control as tc
from template_control.slip import BranchPoint, Family, Kind, margin, steps_to_fall, vlo_state
from template_control.view import basin_figure

HEIGHT, STIFFNESS = 0.9818, 16.5e3
HEIGHTS, ANGLES = np.linspace(0.945, 1.0, 81), np.linspace(-8.0, 8.0, 81)


def main(folder: Path) -> None:
    """Follow the branch, print every stable gait's margin, draw the best one's basin."""
    parameters = tc.SlipParameters(leg_stiffness=STIFFNESS)
    gait = tc.gait_from_energy(parameters, HEIGHT, 826.0)
    family = Family(parameters, "w", {"height": HEIGHT, "stiffness": STIFFNESS})
    start = np.array([*gait.vlo, gait.controls[0], STIFFNESS])
    branch = family.trace(start, "energy", (820.0, 828.0), step=0.01)
    margins: list[tuple[float, BranchPoint]] = []
    for point in branch:
        if point.kind is Kind.STABLE:
            radius = margin(parameters, point.controls, (HEIGHT, 0.0), point.energy)
            margins.append((radius, point))
            print(
                f"{point.energy:8.2f} J  {np.degrees(point.angle):6.2f} deg"
                f"  {point.state[0]:.4f} m/s  margin {100.0 * radius:.1f} cm or degrees"
            )
    radius, best = max(margins, key=lambda pair: pair[0])
    print(f"most forgiving: {best.energy:.2f} J, {np.degrees(best.angle):.2f} deg")
    y, phi = np.meshgrid(HEIGHTS, np.radians(ANGLES))
    z = vlo_state(parameters, y.ravel(), phi.ravel(), best.energy)
    basin = steps_to_fall(parameters, z, best.controls, np.array([HEIGHT, 0.0]))
    shape = (1, *y.shape)
    figure = basin_figure(
        np.array([best.energy]),
        HEIGHTS,
        ANGLES,
        basin.steps.reshape(shape),
        basin.converges.reshape(shape),
    )
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "basin.png", dpi=110)
    print(f"its basin: {folder / 'basin.png'}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("runs/pick_a_gait"))
