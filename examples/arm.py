"""The whole-body control alone, on an arm: its hand draws a circle, within the motors' torques.

Run: python examples/arm.py
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from template_control.robot import FixedBaseRobot
from template_control.whole_body import FrameTask, JointTask, TaskStack, WholeBodyQp

STEP, RADIUS, RATE = 1e-3, 0.1, 2.0  # [s], [m], [rad/s]


def main() -> None:
    """Print how far the hand is from its target in each second, and the largest torque."""
    model = pin.buildSampleModelManipulator()  # or pin.buildModelFromUrdf("arm.urdf")
    model.effortLimit[:] = 60.0  # [N m]
    robot = FixedBaseRobot(model)
    q, v = np.array([0.3, 0.8, 0.4, -0.8, 0.5, 0.2]), np.zeros(model.nv)
    robot.update(q, v)
    middle = robot.frame("effector_body").position - (RADIUS, 0.0, 0.0)
    hand, posture = FrameTask("effector_body"), JointTask(q, weight=1e-3)
    tasks, qp = TaskStack([hand, posture], model.nv), WholeBodyQp(robot)
    data, away, torque = model.createData(), 0.0, 0.0
    for tick in range(4000):
        phase = RATE * tick * STEP
        way = RADIUS * np.array([np.cos(phase), 0.0, np.sin(phase)])
        ahead = RADIUS * RATE * np.array([-np.sin(phase), 0.0, np.cos(phase)])
        hand.set_target(middle + way, ahead, -(RATE**2) * way)
        robot.update(q, v)
        tasks.write(robot)
        solution = qp.solve(tasks)
        v = v + STEP * pin.aba(model, data, q, v, solution.torque)
        q = pin.integrate(model, q, STEP * v)
        away = max(
            away, float(np.linalg.norm(robot.frame("effector_body").position - middle - way))
        )
        torque = max(torque, float(np.abs(solution.torque).max()))
        if tick % 1000 == 999:
            print(f"{(tick + 1) * STEP:.0f} s: at most {1e3 * away:.2f} mm off, {torque:.1f} N m")
            away = torque = 0.0


if __name__ == "__main__":
    main()
