"""Stiffness of the template's legs, at the same touchdown angle and speed at VLO."""

from dataclasses import replace
from math import radians

import template_control as tc

robot = tc.load_robot("five-link")
own = tc.template_for(robot)
for factor in (0.8, 0.9, 1.0, 1.1, 1.2):
    template = replace(own, leg_stiffness=factor * own.leg_stiffness)
    gait = tc.gait_at(template, radians(66.0), 1.1)
    record = tc.simulate(tc.Experiment(robot, planner=tc.LqrPlanner(gait), steps=6))
    knee = record.summary.joint_torque["left_knee"]
    print(f"{1e-3 * gait.controls[1]:.1f} kN/m: fell {record.fell}, knee {knee.rms:.0f} N m (RMS)")
