"""Size of round feet, which the template does not have."""

from pathlib import Path

import template_control as tc

link, trunk = tc.Link(0.4, 1.5, com=0.18, inertia=0.02), tc.Link(0.5, 24.0, com=0.25, inertia=0.6)
for radius in (0.005, 0.01, 0.02, 0.04, 0.08):
    robot = tc.FiveLink("mine", trunk, link, link, (120.0, 120.0), foot_radius=radius)
    Path("mine.urdf").write_text(robot.urdf())
    record = tc.simulate(tc.Experiment("mine.urdf", steps=6))
    error = 1e3 * record.summary.com_error_rms.x
    print(f"{1e3 * radius:g} mm: fell {record.fell}, CoM error in x {error:.1f} mm (RMS)")
