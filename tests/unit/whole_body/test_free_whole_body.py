"""The whole-body QP in space: dynamics, stance, friction pyramid, and its tasks' rows."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from template_control.embedding.options import EmbeddingOptions
from template_control.errors import ParameterError
from template_control.robot.library import load_floating_robot, load_robot
from template_control.robot.start import Pose, floating_state_in
from template_control.slip.automaton.vocabulary import Leg
from template_control.whole_body.solver import QpOptions, Stance, WholeBodyQp
from template_control.whole_body.stack import TaskStack
from template_control.whole_body.task import DESIRED, WEIGHT, References
from template_control.whole_body.tasks import (
    ComTask,
    FootTask,
    OrientationTask,
    SideFootTask,
    SpinTask,
)

FRICTION = 0.6
OPTIONS = QpOptions(
    friction=FRICTION,
    friction_margin=1.0,
    stop_share=EmbeddingOptions.of_kind("free").qp.stop_share,
    stop_horizon=EmbeddingOptions.of_kind("free").qp.stop_horizon,
)
TASKS = {
    0: (OrientationTask(), FootTask(Leg.REAR), SideFootTask(Leg.REAR)),
    1: (ComTask((0.01, 10.0)), OrientationTask(), FootTask(), SideFootTask()),
    2: (ComTask((30.0, 30.0)), OrientationTask((4.0, 4.0, 0.4))),
}
STANCES = {0: (), 1: (0,), 2: (0, 1)}


@pytest.fixture(scope="module")
def bolt():
    return load_floating_robot("bolt")


def standing(robot, rng):
    """A state near standing, with the feet apart."""
    pose = Pose(
        com=np.array([0.06, 0.0, 0.34]) + rng.normal(0.0, 0.005, 3),
        com_velocity=rng.normal(0.0, 0.1, 3),
        feet=np.array([[0.0, 0.05, 0.0], [0.12, -0.05, 0.0]]),
        feet_velocity=rng.normal(0.0, 0.05, (2, 3)),
        momentum_speed=True,
    )
    return floating_state_in(robot, pose)


def turning(robot, angle, speed, **options):
    """Acceleration of a knee in the air that is asked for 1000 rad/s^2 upwards [rad/s^2]."""
    q, v = robot.neutral(), np.zeros(robot.nv)
    q[9], v[8] = angle, speed
    robot.update(q, v)
    tasks = TaskStack((SideFootTask(Leg.REAR),), robot.nv)
    tasks.table[0, 8], tasks.table[0, robot.nv + DESIRED] = 1.0, 1000.0
    tasks.table[0, robot.nv + WEIGHT] = 1.0
    s = WholeBodyQp(robot, replace(OPTIONS, **options)).solve(
        tasks, Stance((), np.zeros(0), np.zeros(0))
    )
    assert s.solved
    return s.acceleration[8]


def test_a_joint_near_an_end_of_its_range_brakes(bolt):
    end, horizon = bolt.joint_range[2, 1], OPTIONS.stop_horizon
    assert end == pytest.approx(3.4)
    assert turning(bolt, 1.0, 5.0) == pytest.approx(1000.0, rel=0.01)
    for left in (0.2, 0.0, -0.1):
        bound = (left / horizon - 5.0) / OPTIONS.speed_horizon
        assert turning(bolt, end - left, 5.0) == pytest.approx(bound, abs=0.5)
    # A longer horizon brakes earlier, and away from the end nothing is bounded.
    assert turning(bolt, end - 0.5, 5.0, stop_horizon=0.2) < -400.0
    assert turning(bolt, end - 0.2, -5.0, torque_scale=2.0) > 900.0


def solve(robot, rng, feet, qp, scale):
    standing(robot, rng)
    stack, references = TaskStack(TASKS[feet], robot.nv), References()
    references.com_now[:] = *robot.com, *robot.com_velocity
    stack.write(robot, references)
    rows = stack.table[:, robot.nv + DESIRED]
    rows[:] = rng.normal(0.0, scale, len(rows))
    forces = np.tile([0.0, 0.0, 12.3 / max(feet, 1)], feet)
    return qp.solve(stack, Stance(STANCES[feet], forces, np.full(feet, np.inf)))


@pytest.mark.parametrize("feet", [0, 1, 2])
def test_dynamics_stance_and_limits_hold(bolt, feet):
    rng, qp = np.random.default_rng(1), WholeBodyQp(bolt, replace(OPTIONS, torque_scale=0.8))
    solved = 0
    for _ in range(30):
        s = solve(bolt, rng, feet, qp, 4.0)
        solved += s.solved
        on_ground = list(STANCES[feet])
        jacobian = bolt.contact_jacobian[on_ground].reshape(-1, bolt.nv)
        bias, velocity = bolt.contact_bias[on_ground], bolt.contact_velocity[on_ground]
        generalised = np.concatenate((np.zeros(6), s.torque)) + jacobian.T @ s.force
        left = bolt.mass_matrix @ s.acceleration + bolt.nonlinear_effects
        np.testing.assert_allclose(left, generalised, atol=1e-8)
        # A foot at rest stays at rest; one that slides is braked at 40 1/s, also sideways.
        braked = -40.0 * velocity.ravel()
        np.testing.assert_allclose(jacobian @ s.acceleration + bias.ravel(), braked, atol=1e-8)
        assert np.all(np.abs(s.torque) <= 0.8 * 2.7 + 1e-9)
        if s.solved:
            for x, y, z in s.force.reshape(-1, 3):
                assert z >= -1e-5
                assert max(abs(x), abs(y)) <= FRICTION * z + 1e-5
    assert solved >= 28


def test_pyramid_binds_in_either_direction(bolt):
    """A task that pulls sideways meets the cone, not something looser or tighter."""
    rng, qp = np.random.default_rng(2), WholeBodyQp(bolt, OPTIONS)
    most = np.zeros(2)
    for _ in range(60):
        s = solve(bolt, rng, 2, qp, 25.0)
        if s.solved:
            force = s.force.reshape(-1, 3)
            loaded = force[force[:, 2] > 0.5]
            share = np.abs(loaded[:, :2]) / loaded[:, 2:]
            most = np.maximum(most, share.max(axis=0, initial=0.0))
    np.testing.assert_allclose(most, FRICTION, atol=1e-3)


def test_rows_match_finite_differences(bolt):
    """T a + dT/dt v is the rate of what the task speaks of, along a motion with acceleration a."""
    rng, h = np.random.default_rng(3), 1e-6
    bolt.face(0.4, np.array([0.1, 0.2]))
    tasks = (OrientationTask(), SideFootTask(Leg.REAR), SpinTask())
    references = References()
    references.com_now[1] = 0.3  # m, the height that weighs the momentum
    for _ in range(5):
        q = pin.integrate(bolt.model, bolt.neutral(), rng.uniform(-0.5, 0.5, bolt.nv))
        v, a = rng.uniform(-1.0, 1.0, bolt.nv), rng.uniform(-5.0, 5.0, bolt.nv)

        def measured(step, q=q, v=v, a=a):
            at = pin.integrate(bolt.model, q, step * v + 0.5 * step * abs(step) * a)
            bolt.update(at, v + step * a)
            s = bolt.space
            return np.array([*s.turning, bolt.contact_velocity[0, 1], *s.momentum])

        rate = (measured(h) - measured(-h)) / (2.0 * h)
        bolt.update(q, v)
        stack = TaskStack(tasks, bolt.nv)
        stack.write(bolt, references)
        rows = stack.table[:, : bolt.nv] @ a + stack.table[:, bolt.nv]
        np.testing.assert_allclose(rows, rate, atol=1e-5)
    bolt.face(0.0, np.zeros(2))


def test_orientation_and_side_ask_for_their_way_back(bolt):
    rng = np.random.default_rng(4)
    standing(bolt, rng)
    q = bolt.neutral()
    q[3:7] = pin.Quaternion(pin.exp3(np.array([0.02, -0.03, 0.04]))).coeffs()
    bolt.update(q, np.zeros(bolt.nv))
    references = References()
    references.side[0] = bolt.space.foot_position[0, 1] + 0.01, 0.0, 0.5
    stack = TaskStack((OrientationTask(), SideFootTask(Leg.REAR)), bolt.nv)
    stack.write(bolt, references)
    desired = stack.table[:, bolt.nv + DESIRED]
    np.testing.assert_allclose(desired, [-2.0, 3.0, -36.0 * 0.04, 0.5 + 600.0 * 0.01], atol=0.1)


def test_a_planar_robot_has_no_tasks_in_space():
    robot = load_robot("five-link")
    stack = TaskStack((OrientationTask(),), robot.nv)
    with pytest.raises(ParameterError, match="held in its plane"):
        stack.write(robot, References())
