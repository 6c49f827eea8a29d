"""The whole-body QP: exact dynamics, hard constraints, and the same optimum as a plain QP."""

import numpy as np
import proxsuite
import pytest

from template_control.whole_body.problem import ROWS_PER_FOOT
from template_control.whole_body.solver import WholeBodyQp
from template_control.whole_body.tasks import Row, TaskStack, Weights

FRICTION = 0.6
WEIGHTS = Weights((1.0, 3.0, 1.0, 0.0, 0.0))
SINGLE = Weights((0.01, 3.0, 1.0, 1.0, 1.0))
STANCES = {1: (0,), 2: (0, 1)}


def standing(rng):
    """A state near standing with the feet apart."""
    q = np.array([0.0, 0.75, 0.0, -0.5, 0.6, 0.1, 0.6]) + rng.normal(0.0, 0.05, 7)
    return q, rng.normal(0.0, 0.5, 7)


def solve(robot, rng, feet, qp=None, scale=2.0, torque_scale=1.0):
    q, v = standing(rng)
    robot.update(q, v)
    tasks = TaskStack(7)
    tasks.read(robot, 1, robot.com[1])
    tasks.desired[:] = rng.normal(0.0, scale, len(Row))
    weights = WEIGHTS if feet == 2 else SINGLE
    forces = np.tile([0.0, 785.0 / feet], feet)
    cap = np.full(feet, np.inf)
    qp = qp or WholeBodyQp(robot, FRICTION, torque_scale)
    rows = np.array(weights.rows)
    solution = qp.solve(tasks, weights, rows, STANCES[feet], forces, cap)
    return tasks, weights, forces, solution


def stance_rows(robot, feet):
    jacobian = np.vstack([robot.foot_jacobian[i] for i in STANCES[feet]])
    bias = np.concatenate([robot.foot_bias[i] for i in STANCES[feet]])
    velocity = np.concatenate([robot.foot_velocity[i] for i in STANCES[feet]])
    return jacobian, bias, velocity


@pytest.mark.parametrize("feet", [1, 2])
def test_dynamics_and_stance_are_exact(robot, feet):
    rng = np.random.default_rng(1)
    qp = WholeBodyQp(robot, FRICTION)
    for _ in range(20):
        *_, s = solve(robot, rng, feet, qp)
        assert s.solved
        jacobian, bias, velocity = stance_rows(robot, feet)
        generalised = np.concatenate((np.zeros(3), s.torque)) + jacobian.T @ s.force
        left = robot.mass_matrix @ s.acceleration + robot.nonlinear_effects
        np.testing.assert_allclose(left, generalised, atol=1e-8)
        # A foot at rest stays at rest; one that slides is braked at 40 1/s.
        np.testing.assert_allclose(jacobian @ s.acceleration + bias, -40.0 * velocity, atol=1e-8)


@pytest.mark.parametrize("feet", [1, 2])
def test_constraints_hold_for_wild_tasks(robot, feet):
    rng = np.random.default_rng(2)
    qp = WholeBodyQp(robot, FRICTION, 0.6)
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


@pytest.mark.parametrize("feet", [1, 2])
def test_optimum_is_that_of_the_full_problem(robot, feet):
    """The same QP over (a, f, tau) with explicit equalities, solved independently."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        tasks, weights, reference, s = solve(robot, rng, feet, scale=3.0)
        jacobian, bias, velocity = stance_rows(robot, feet)
        n, m = 7 + 2 * feet + 4, 2 * feet
        a, f, tau = slice(0, 7), slice(7, 7 + m), slice(7 + m, n)
        hessian, gradient = np.zeros((n, n)), np.zeros(n)
        for row, w in enumerate(weights.rows):
            t = tasks.jacobian[row]
            hessian[a, a] += w * np.outer(t, t)
            gradient[a] += w * t * (tasks.bias[row] - tasks.desired[row])
        scale = (robot.mass * robot.gravity) ** 2
        hessian[f, f] += weights.force / scale * np.eye(m)
        gradient[f] -= weights.force / scale * reference
        hessian[tau, tau] += weights.torque / 350.0**2 * np.eye(4)
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
        qp = proxsuite.proxqp.dense.QP(n, 7 + m, len(low))
        qp.settings.eps_abs = 1e-9
        qp.init(hessian * 1e4, gradient * 1e4, equal, right, inside, low, high)
        qp.solve()

        def cost(z, hessian=hessian, gradient=gradient):
            return 0.5 * z @ hessian @ z + gradient @ z

        ours = np.concatenate((s.acceleration, s.force, s.torque))
        assert cost(ours) <= cost(qp.results.x) + 1e-5 * (1.0 + abs(cost(qp.results.x)))


def test_infeasible_problem_is_reported_and_recovers(robot):
    rng = np.random.default_rng(4)
    qp = WholeBodyQp(robot, FRICTION)
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


def test_straight_coinciding_feet_are_reported_not_raised(robot):
    q = np.array([0.0, 0.9, 0.0, 0.0, 0.0, 0.0, 0.0])
    robot.update(q, np.zeros(7))
    tasks = TaskStack(7)
    tasks.read(robot, 1, robot.com[1])
    s = WholeBodyQp(robot, FRICTION).solve(
        tasks, WEIGHTS, np.array(WEIGHTS.rows), (0, 1), np.zeros(4), np.full(2, np.inf)
    )
    assert not s.solved


def test_rear_force_cap_is_a_hard_limit(robot):
    q, _ = standing(np.random.default_rng(5))
    robot.update(q, np.zeros(7))
    tasks = TaskStack(7)
    tasks.read(robot, 1, robot.com[1])
    s = WholeBodyQp(robot, FRICTION).solve(
        tasks,
        WEIGHTS,
        np.array(WEIGHTS.rows),
        (0, 1),
        np.array([0.0, 600.0, 0.0, 100.0]),
        np.array([50.0, np.inf]),
    )
    assert s.solved
    assert s.force[1] <= 50.0 + 1e-3


def test_load_scales_torques_within_their_limits(robot):
    q, _ = standing(np.random.default_rng(6))
    robot.update(q, np.zeros(7))
    tasks = TaskStack(7)
    tasks.read(robot, 1, robot.com[1])
    rows, cap = np.array(WEIGHTS.rows), np.full(2, np.inf)
    forces = np.tile([0.0, 390.0], 2)
    plain, loaded = (
        WholeBodyQp(robot, FRICTION).solve(tasks, WEIGHTS, rows, (0, 1), forces, cap, load)
        for load in (1.0, 1.1)
    )
    np.testing.assert_allclose(loaded.acceleration, plain.acceleration, atol=2e-3)
    left = robot.mass_matrix @ loaded.acceleration + robot.nonlinear_effects
    jacobian = np.vstack(robot.foot_jacobian)
    np.testing.assert_allclose(left[3:], loaded.torque / 1.1 + (jacobian.T @ loaded.force)[3:])
    assert np.all(np.abs(loaded.torque) <= robot.torque_limit)
