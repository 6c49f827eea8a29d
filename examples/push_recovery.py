"""Push the walking robot and see its speed at VLO come back.

Run: python examples/push_recovery.py [impulse in N s]
"""

import sys

import template_control as tc

IMPULSE = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0

robot = tc.load_robot("five-link")
gait = tc.gait_for_speed(tc.SlipParameters(mass=robot.mass), mean_speed=1.2)
record = tc.simulate(
    tc.Experiment(
        robot, planner=tc.LqrPlanner(gait), steps=25, pushes=(tc.Push(IMPULSE, step=8, phase=0.5),)
    )
)

print(f"gait: {gait.vlo[0]:.3f} m/s at VLO; push of {IMPULSE:g} N s in step 8")
for step, (speed, height, vertical) in enumerate(record.section_state):
    print(f"step {step:2d}: {speed:.3f} m/s  {height:.4f} m  {vertical:+.3f} m/s")
print("fell: " + record.fall_reason if record.fell else "recovered")
