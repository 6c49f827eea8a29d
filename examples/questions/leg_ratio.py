"""Share of the leg that the thigh has."""

from pathlib import Path
from tempfile import TemporaryDirectory

import template_control as tc

for share in (0.4, 0.45, 0.5, 0.55, 0.6):
    thigh, shank = (
        tc.Link(0.8 * part, 3.0 * part, com=0.36 * part, inertia=0.16 * part**3)
        for part in (share, 1.0 - share)
    )
    trunk = tc.Link(0.5, 24.0, com=0.25, inertia=0.6)
    robot = tc.FiveLink("mine", trunk, thigh, shank, (120.0, 120.0))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mine.urdf"
        path.write_text(robot.urdf())
        record = tc.simulate(tc.Experiment(str(path), steps=6))
    knee = record.summary.joint_torque["left_knee"]
    print(f"{share:.0%}: fell {record.fell}, knee torque {knee.peak:.1f} N m at most")
