"""A robot dropped in an engine, and the fall of its model by Pinocchio."""

import numpy as np
import pinocchio as pin

from template_control.plant.bullet import BulletPlant, PlantOptions
from template_control.plant.ideal import IdealOptions, IdealPlant
from template_control.plant.mujoco import MujocoOptions, MujocoPlant

DT = 1e-4  # [s]
FALL = 0.1  # [s]
FREE = {
    "pybullet": (BulletPlant, PlantOptions),
    "mujoco": (MujocoPlant, MujocoOptions),
}
PLANAR = {**FREE, "ideal": (IdealPlant, IdealOptions)}


def falls_as_pinocchio_says(robot, plant, seed=3):
    """Let a robot fall, its joints moving, and compare with the model's own fall."""
    rng = np.random.default_rng(seed)
    q, nu = robot.neutral(), len(robot.joint_names)
    middle = np.clip(robot.joint_range.mean(axis=1), -1.0, 1.0)
    q[-nu:] = middle + rng.uniform(-0.1, 0.1, nu)
    up = 1 if robot.base_dof == 3 else 2
    q[up] = 5.0
    v = np.concatenate([rng.uniform(-0.5, 0.5, robot.base_dof), rng.uniform(-1, 1, nu)])
    # Each joint is turned by 0.04 rad meanwhile, so that no light foot comes to its stop.
    upper = np.triu(pin.crba(robot.model, robot.model.createData(), q))
    inertia = 1.0 / np.diag(np.linalg.inv(upper + np.triu(upper, 1).T))[-nu:]
    torque = 8.0 * inertia * rng.uniform(-1.0, 1.0, nu)
    with plant:
        plant.reset(q, v)
        for _ in range(round(FALL / DT)):
            plant.step(torque)
        found_q, found_v = robot.neutral(), np.zeros(robot.nv)
        plant.read(found_q, found_v)
    data = robot.model.createData()

    def rate(q, v):
        moving = v[robot.base_dof :]
        drive = torque - robot.joint_damping * moving - robot.joint_friction * np.sign(moving)
        return pin.aba(robot.model, data, q, v, np.concatenate([np.zeros(robot.base_dof), drive]))

    h = 1e-3
    for _ in range(round(FALL / h)):  # the classical Runge-Kutta method
        a1 = rate(q, v)
        v2 = v + 0.5 * h * a1
        a2 = rate(pin.integrate(robot.model, q, 0.5 * h * v), v2)
        v3 = v + 0.5 * h * a2
        a3 = rate(pin.integrate(robot.model, q, 0.5 * h * v2), v3)
        v4 = v + h * a3
        a4 = rate(pin.integrate(robot.model, q, h * v3), v4)
        q = pin.integrate(robot.model, q, h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4))
        v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    assert v[up] < -0.3  # it fell
    np.testing.assert_allclose(pin.difference(robot.model, q, found_q), 0.0, atol=3e-4)
    np.testing.assert_allclose(found_v, v, atol=3e-3)
