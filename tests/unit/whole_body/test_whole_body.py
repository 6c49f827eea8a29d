"""The whole-body QP: exact dynamics, hard constraints, and the same optimum as a plain QP."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from template_control.robot.library import load_robot
from template_control.slip.automaton.vocabulary import Leg
from template_control.whole_body.problem import rows_per_contact
from template_control.whole_body.solver import (
    FORCE_COST,
    TORQUE_COST,
    QpOptions,
    Stance,
    WholeBodyQp,
    load_proxqp,
)
from template_control.whole_body.stack import TaskStack
from template_control.whole_body.task import DESIRED, WEIGHT, References
from template_control.whole_body.tasks import (
    ComTask,
    FootTask,
    MomentumTask,
    PostureTask,
)

FRICTION = 0.6
OPTIONS = QpOptions(friction=FRICTION, friction_margin=1.0)
TASKS = {
    0: (PostureTask(), FootTask(Leg.REAR), FootTask(Leg.FRONT)),
    1: (ComTask((0.01, 3.0)), PostureTask(), FootTask(Leg.FRONT)),
    2: (ComTask((1.0, 3.0)), PostureTask()),
}
ROWS_PER_FOOT = rows_per_contact(2)
STANCES = {0: (), 1: (0,), 2: (0, 1)}


def written(robot, feet, rng=None, scale=0.0):
    """The rows of a phase's tasks, with random wanted accelerations."""
    stack = TaskStack(TASKS[feet], 7)
    references = References()
    references.com_now[:] = *robot.com, *robot.com_velocity
    stack.write(robot, references)
    rows = stack.table[:, 7 + DESIRED]
    rows[:] = 0.0 if rng is None else rng.normal(0.0, scale, len(rows))
    return stack


def standing(rng):
    """A state near standing with the feet apart."""
    q = np.array([0.0, 0.75, 0.0, -0.5, 0.6, 0.1, 0.6]) + rng.normal(0.0, 0.05, 7)
    return q, rng.normal(0.0, 0.5, 7)


def solve(robot, rng, feet, qp=None, scale=2.0, torque_scale=1.0):
    q, v = standing(rng)
    robot.update(q, v)
    tasks = written(robot, feet, rng, scale)
    forces = np.tile([0.0, 785.0 / max(feet, 1)], feet)
    qp = qp or WholeBodyQp(robot, replace(OPTIONS, torque_scale=torque_scale))
    solution = qp.solve(tasks, Stance(STANCES[feet], forces, np.full(feet, np.inf)))
    return tasks, forces, solution


def stance_rows(robot, feet):
    on_ground = list(STANCES[feet])
    jacobian = robot.foot_jacobian[on_ground].reshape(-1, 7)
    return jacobian, robot.foot_bias[on_ground].ravel(), robot.foot_velocity[on_ground].ravel()


@pytest.mark.parametrize("feet", [0, 1, 2])
def test_dynamics_and_stance_are_exact(robot, feet):
    rng = np.random.default_rng(1)
    qp = WholeBodyQp(robot, replace(OPTIONS, contact_damping=25.0))
    for _ in range(20):
        *_, s = solve(robot, rng, feet, qp)
        assert s.solved
        jacobian, bias, velocity = stance_rows(robot, feet)
        generalised = np.concatenate((np.zeros(3), s.torque)) + jacobian.T @ s.force
        left = robot.mass_matrix @ s.acceleration + robot.nonlinear_effects
        np.testing.assert_allclose(left, generalised, atol=1e-8)
        # A foot at rest stays at rest; one that slides is braked at 25 1/s.
        np.testing.assert_allclose(jacobian @ s.acceleration + bias, -25.0 * velocity, atol=1e-8)


@pytest.mark.parametrize("feet", [0, 1, 2])
def test_constraints_hold_for_wild_tasks(robot, feet):
    rng = np.random.default_rng(2)
    qp = WholeBodyQp(robot, replace(OPTIONS, torque_scale=0.6))
    solved = 0
    for _ in range(200):
        *_, s = solve(robot, rng, feet, qp, scale=15.0)
        assert np.all(np.abs(s.torque) <= 0.6 * 350.0 + 1e-9)
        if not s.solved:
            continue
        solved += 1
        for x, y in s.force.reshape(-1, 2):
            assert y >= -1e-3
            assert abs(x) <= FRICTION * y + 1e-3
    assert solved >= 190


@pytest.mark.parametrize("feet", [0, 1, 2])
def test_optimum_is_that_of_the_full_problem(robot, feet):
    """The same QP over (a, f, tau) with explicit equalities, solved independently."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        tasks, reference, s = solve(robot, rng, feet, scale=3.0)
        jacobian, bias, velocity = stance_rows(robot, feet)
        n, m = 7 + 2 * feet + 4, 2 * feet
        a, f, tau = slice(0, 7), slice(7, 7 + m), slice(7 + m, n)
        hessian, gradient = np.zeros((n, n)), np.zeros(n)
        for row in tasks.table:
            t, (row_bias, wanted, w) = row[:7], row[7:]
            hessian[a, a] += w * np.outer(t, t)
            gradient[a] += w * t * (row_bias - wanted)
        scale = (robot.mass * robot.gravity) ** 2
        hessian[f, f] += FORCE_COST / scale * np.eye(m)
        gradient[f] -= FORCE_COST / scale * reference
        hessian[tau, tau] += TORQUE_COST / 350.0**2 * np.eye(4)
        equal = np.zeros((7 + m, n))
        equal[:7, a], equal[:7, f] = robot.mass_matrix, -jacobian.T
        equal[3:7, tau] = -np.eye(4)
        equal[7:, a] = jacobian
        right = np.concatenate((-robot.nonlinear_effects, -bias - 40.0 * velocity))
        inside = np.zeros((4 + ROWS_PER_FOOT * feet, n))
        inside[:4, tau] = np.eye(4) / 350.0
        low = np.concatenate((np.full(4, -1.0), np.zeros(ROWS_PER_FOOT * feet)))
        high = np.concatenate((np.full(4, 1.0), np.full(ROWS_PER_FOOT * feet, 1e20)))
        for foot in range(feet):
            x, y, top = 7 + 2 * foot, 8 + 2 * foot, 4 + ROWS_PER_FOOT * foot
            inside[top, [x, y]] = 1.0, FRICTION
            inside[top + 1, [x, y]] = -1.0, FRICTION
            inside[top + 2, y] = 1.0
        qp = load_proxqp().dense.QP(n, 7 + m, len(low))
        qp.settings.eps_abs = 1e-9
        qp.init(hessian * 1e4, gradient * 1e4, equal, right, inside, low, high)
        qp.solve()

        def cost(z, hessian=hessian, gradient=gradient):
            return 0.5 * z @ hessian @ z + gradient @ z

        ours = np.concatenate((s.acceleration, s.force, s.torque))
        assert cost(ours) <= cost(qp.results.x) + 1e-5 * (1.0 + abs(cost(qp.results.x)))


@pytest.mark.parametrize(
    ("feet", "share", "most"), [(0, 0.1, 80.0), (1, 1.0, 12.0), (2, 1.0, 12.0)]
)
def test_proxqp_is_asked_where_a_limit_acts_and_nowhere_else(robot, feet, share, most):
    qp = WholeBodyQp(robot, replace(OPTIONS, torque_scale=share))
    rng, limited = np.random.default_rng(5), 0
    for _ in range(100):
        *_, s = solve(robot, rng, feet, qp, scale=rng.uniform(0.0, most))
        m = qp.workspaces[feet].matrices
        assert s.solved
        if s.solve_seconds > 0.0:
            limited += 1
            reached = m.constraint @ m.minimum
            assert np.any((reached < m.lower) | (reached > m.upper))
            continue
        # In z, the torques over their limits.
        factor = np.tril(m.factor)
        plain = load_proxqp().dense.QP(4, 0, len(m.lower))
        plain.settings.eps_abs = 1e-10
        plain.init(
            factor @ factor.T, factor @ m.gradient, None, None, m.constraint, m.lower, m.upper
        )
        plain.solve()
        np.testing.assert_allclose(s.torque, share * 350.0 * plain.results.x, atol=0.01)
    assert 10 < limited < 90


def test_infeasible_problem_is_reported_and_recovers(robot):
    rng = np.random.default_rng(4)
    qp = WholeBodyQp(robot, OPTIONS)
    *_, before = solve(robot, rng, 2, qp)
    qp.torque_limit = np.full(4, 1.0)  # cannot carry the robot
    *_, s = solve(robot, np.random.default_rng(4), 2, qp)
    assert not s.solved
    assert np.all(np.isfinite(s.torque))
    assert np.all(np.abs(s.torque) <= 1.0)
    qp.torque_limit = robot.torque_limit
    *_, after = solve(robot, np.random.default_rng(4), 2, qp)
    assert after.solved
    np.testing.assert_allclose(after.torque, before.torque, atol=1e-4)


def hurried(robot, options, torque_scale=1.0):
    """In the air, a hip near its limit of speed is asked for more; its acceleration [rad/s^2]."""
    q, v = standing(np.random.default_rng(7))
    v[3] = 19.0
    robot.update(q, v)
    tasks = TaskStack((PostureTask(),), 7)
    tasks.table[0, 3], tasks.table[0, 7 + DESIRED] = 1.0, 1000.0
    qp = WholeBodyQp(robot, replace(options, torque_scale=torque_scale))
    s = qp.solve(tasks, Stance((), np.zeros(0), np.zeros(0)))
    assert s.solved
    return s.acceleration[3]


def test_a_joint_near_its_limit_gains_at_most_the_rest_in_the_horizon(robot):
    unbounded = hurried(robot, replace(OPTIONS, speed_share=0.96))
    assert robot.fastest == pytest.approx(19.0 / 20.0)
    for horizon in (0.005, 0.02):
        bound = (20.0 - 19.0) / horizon
        assert unbounded > 1.1 * bound
        bounded = hurried(robot, replace(OPTIONS, speed_horizon=horizon))
        assert bounded == pytest.approx(bound, abs=0.1)


def straightening(robot, options, knee):
    """In the air, a fast knee is asked to go straight; its acceleration [rad/s^2]."""
    q, v = standing(np.random.default_rng(7))
    q[4], v[4] = knee, -15.0
    robot.update(q, v)
    tasks = TaskStack((PostureTask(),), 7)
    tasks.table[0, 4], tasks.table[0, 7 + DESIRED] = 1.0, -100.0
    s = WholeBodyQp(robot, options).solve(tasks, Stance((), np.zeros(0), np.zeros(0)))
    assert s.solved
    return s.acceleration[4]


def test_a_fast_joint_slows_down_before_its_stop(robot):
    # At 15 rad/s the stop is 20 ms away where the knee is bent by 0.3 rad.
    assert straightening(robot, OPTIONS, 0.32) == pytest.approx(-100.0, abs=1.0)
    braking = straightening(robot, OPTIONS, 0.29)
    assert braking == pytest.approx((15.0 - 0.29 / 0.02) / 0.005, abs=1.0)
    slow = replace(OPTIONS, stop_share=0.8)
    assert straightening(robot, slow, 0.29) == pytest.approx(-100.0, abs=1.0)
    assert robot.joint_angle[1] == 0.29


def test_motors_that_cannot_slow_a_joint_down_make_it_no_faster(tmp_path, robot):
    slow = tmp_path / "slow.urdf"
    slow.write_text(robot.urdf.replace('velocity="20"', 'velocity="17"'))
    it = load_robot(slow)
    bound = (17.0 - 19.0) / OPTIONS.speed_horizon
    assert hurried(it, OPTIONS) == pytest.approx(bound, abs=1.0)
    assert hurried(it, OPTIONS, torque_scale=0.2) == pytest.approx(0.0, abs=1.0)
    assert np.isfinite(hurried(it, OPTIONS, torque_scale=0.01))  # not even that


def test_straight_coinciding_feet_are_reported_not_raised(robot):
    q = np.array([0.0, 0.9, 0.0, 0.0, 0.0, 0.0, 0.0])
    robot.update(q, np.zeros(7))
    stance = Stance((0, 1), np.zeros(4), np.full(2, np.inf))
    s = WholeBodyQp(robot, OPTIONS).solve(written(robot, 2), stance)
    assert not s.solved


def test_rear_force_cap_is_a_hard_limit(robot):
    q, _ = standing(np.random.default_rng(5))
    robot.update(q, np.zeros(7))
    stance = Stance((0, 1), np.array([0.0, 600.0, 0.0, 100.0]), np.array([50.0, np.inf]))
    s = WholeBodyQp(robot, OPTIONS).solve(written(robot, 2), stance)
    assert s.solved
    assert s.force[1] <= 50.0 + 1e-3


def test_load_scales_torques_within_their_limits(robot):
    q, _ = standing(np.random.default_rng(6))
    robot.update(q, np.zeros(7))
    stance = Stance((0, 1), np.tile([0.0, 390.0], 2), np.full(2, np.inf))
    plain, loaded = (
        WholeBodyQp(robot, OPTIONS).solve(written(robot, 2), stance, load) for load in (1.0, 1.1)
    )
    np.testing.assert_allclose(loaded.acceleration, plain.acceleration, atol=2e-3)
    left = robot.mass_matrix @ loaded.acceleration + robot.nonlinear_effects
    jacobian = np.vstack(robot.foot_jacobian)
    np.testing.assert_allclose(left[3:], loaded.torque / 1.1 + (jacobian.T @ loaded.force)[3:])
    assert np.all(np.abs(loaded.torque) <= robot.torque_limit)


def test_no_torque_is_a_hair_beyond_its_limit_whatever_the_load(robot):
    robot.update(*standing(np.random.default_rng(4)))
    stance = Stance((0,), np.array([0.0, 780.0]), np.full(1, np.inf))
    loads = np.linspace(0.7, 1.4, 71)
    assert np.any(loads * (robot.torque_limit[0] / loads) > robot.torque_limit[0]), "by rounding"
    saturated = 0
    for load in loads:
        wild = written(robot, 1, np.random.default_rng(8), 200.0)
        torque = np.abs(WholeBodyQp(robot, OPTIONS).solve(wild, stance, load).torque)
        assert np.all(torque <= robot.torque_limit)
        saturated += np.any(torque > (1.0 - 1e-15) * robot.torque_limit)
    assert saturated > 10


def quantity_of(task, robot):
    """What the task's rows move, at the robot's last update: their time integral's rate."""
    if isinstance(task, ComTask):
        extra = robot.angular_momentum / (robot.mass * robot.com[1])
        return robot.com_velocity + [extra, 0.0]
    if isinstance(task, MomentumTask):
        return np.array([robot.angular_momentum])
    if isinstance(task, PostureTask):
        return None
    return robot.foot_velocity[1].copy()


@pytest.mark.parametrize("task", [ComTask(), MomentumTask(), FootTask(Leg.FRONT)])
def test_task_rows_are_the_rates_of_what_they_move(robot, random_states, task):
    """T a + bias against central differences along a motion with constant a."""
    rng = np.random.default_rng(8)
    for q, v in random_states[:8]:
        a, h = rng.normal(0.0, 5.0, 7), 1e-6
        seen = []
        for t in (-h, h):
            robot.update(q + v * t + 0.5 * a * t * t, v + a * t)
            seen.append(quantity_of(task, robot))
        robot.update(q, v)
        stack, references = TaskStack((task,), 7), References()
        references.com_now[:] = *robot.com, *robot.com_velocity
        stack.write(robot, references)
        rate = (seen[1] - seen[0]) / (2.0 * h)
        rows = stack.table[:, :7] @ a + stack.table[:, 7]
        np.testing.assert_allclose(rows, rate, rtol=2e-6, atol=2e-5)
        unit = robot.mass * robot.com[1] ** 2 if isinstance(task, MomentumTask) else 1.0
        np.testing.assert_allclose(stack.table[:, 7 + WEIGHT] * unit**2, task.weights)


def test_a_flying_robot_keeps_its_momentum(robot):
    """Without feet on the ground no torque moves the CoM or turns the robot as a whole."""
    q, v = standing(np.random.default_rng(9))
    robot.update(q, v)
    s = WholeBodyQp(robot, OPTIONS).solve(
        written(robot, 0, np.random.default_rng(10), 20.0), Stance((), np.zeros(0), np.zeros(0))
    )
    assert s.solved
    assert s.force.size == 0
    fall = robot.com_jacobian @ s.acceleration + robot.com_bias
    np.testing.assert_allclose(fall, [0.0, -robot.gravity], atol=1e-9)
    turning = robot.angular_momentum_jacobian @ s.acceleration + robot.angular_momentum_bias
    assert turning == pytest.approx(0.0, abs=1e-8)


def test_a_foot_is_held_where_its_leg_would_go_straight(robot):
    q, v = standing(np.random.default_rng(11))
    robot.update(q, v)
    stack, references = TaskStack((FootTask(Leg.FRONT),), 7), References()
    position = robot.foot_position[1]
    references.foot[1, :, 0] = position + [0.3, 0.0]
    stack.write(robot, references)
    free = stack.table[0, 7 + DESIRED]
    references.furthest[1] = position[0]
    stack.write(robot, references)
    assert free > 100.0
    held = stack.table[0, 7 + DESIRED]
    assert held == pytest.approx(200.0 * (robot.hip_speed - robot.foot_velocity[1, 0]))


def test_the_same_problem_gives_the_same_bits_wherever_it_lies_in_memory():
    """With so little room left, the last bits of a vectorised build differ for most problems."""
    proxqp = load_proxqp()
    kind = proxqp.dense.HessianType.Dense, proxqp.dense.DenseBackend.PrimalDualLDLT
    for seed in range(10):
        rng = np.random.default_rng(seed)
        rows, inside, gradient = rng.normal(size=(14, 4)), rng.normal(size=4), rng.normal(size=4)
        low, high = np.full(14, -1e20), rows @ inside + 1e-3
        found, alive = set(), []
        for size in range(24):
            qp = proxqp.dense.QP(4, 0, 14, False, *kind)
            qp.settings.eps_abs, qp.settings.max_iter, qp.settings.max_iter_in = 1e-8, 40, 40
            alive.append((qp, np.zeros(size)))  # the next one lies elsewhere
            qp.init(np.eye(4), 10.0 * gradient, None, None, rows, low, high)
            qp.solve()
            found.add(qp.results.x.tobytes())
        assert len(found) == 1


def test_whoever_imports_proxsuite_later_gets_the_same_build():
    assert import_module("proxsuite").proxqp is load_proxqp()
