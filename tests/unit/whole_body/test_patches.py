"""Contact patches: their wrench cone, the QP that stands on them, and the rows of their tasks."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from template_control.errors import ParameterError
from template_control.robot.library import load_floating_robot
from template_control.robot.start import Pose, floating_state_in
from template_control.slip.automaton.vocabulary import Leg
from template_control.whole_body.problem import CONE, patch_cone
from template_control.whole_body.solver import SOLE_SHARE, QpOptions, Stance, WholeBodyQp
from template_control.whole_body.stack import TaskStack
from template_control.whole_body.task import References
from template_control.whole_body.tasks import ComTask, OrientationTask, SoleTask, SwayTask

FRICTION, HALF, CENTRE = 0.6, np.array([0.09, 0.04]), np.array([0.03, -0.01])
CORNERS = [(CENTRE[0] + x * HALF[0], CENTRE[1] + y * HALF[1]) for x in (-1, 1) for y in (-1, 1)]
SPEED = np.array([0.3, -0.1, 0.05])


@pytest.fixture(scope="module")
def g1():
    return load_floating_robot("g1")


def edges():
    """(6, 16) wrenches about the origin of unit forces along the friction pyramids' edges."""
    found = []
    for x, y in CORNERS:
        for fx in (-FRICTION, FRICTION):
            for fy in (-FRICTION, FRICTION):
                force = np.array([fx, fy, 1.0])
                found.append(np.concatenate((force, np.cross((x, y, 0.0), force))))
    return np.array(found).T


def cone():
    found = np.empty((CONE, 6))
    patch_cone(FRICTION, HALF, CENTRE, found)
    return found


def test_forces_at_the_corners_are_in_the_cone():
    draws = np.random.default_rng(0).exponential(1.0, (16, 2000)) ** 3
    assert (cone() @ edges() @ draws).min() > -1e-9


def test_the_cone_holds_no_other_wrench():
    """A wrench in the cone is one of forces at the corners; one a little outside is none."""
    rng, matrix, rows = np.random.default_rng(1), edges(), cone()
    inside = outside = 0
    for _ in range(300):
        # Of few edges it is near a face, where a wrong row would show.
        few = np.where(rng.random(16) < 0.25, rng.exponential(1.0, 16), 0.0)
        wrench = matrix @ few + rng.normal(0.0, 1.0, 6) * (0.2, 0.2, 0.2, 0.02, 0.02, 0.02)
        margin = (rows @ wrench).min()
        if abs(margin) < 1e-6:
            continue
        found = linprog(np.zeros(16), A_eq=matrix, b_eq=wrench, bounds=(0, None))
        assert (found.status == 0) == (margin > 0.0)
        inside, outside = inside + (margin > 0.0), outside + (margin < 0.0)
    assert min(inside, outside) > 50


def standing(robot, com, width=0.16, ahead=0.1):
    pose = Pose(
        com=np.array(com),
        com_velocity=SPEED,
        feet=np.array([[0.0, 0.5 * width, 0.0], [ahead, -0.5 * width, 0.0]]),
        feet_velocity=np.zeros((2, 3)),
        momentum_speed=True,
    )
    return floating_state_in(robot, pose)


def constrained(robot, q, v, torque, contacts):
    """Accelerations with soles that stand, as Pinocchio finds them."""
    model, data = robot.model, robot.model.createData()
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for contact in contacts:
        patch, frame = robot.patches[contact], model.getFrameId(robot.feet[contact])
        joint = model.frames[frame].parentJoint
        kind = pin.ContactType.CONTACT_6D
        models.append(pin.RigidConstraintModel(kind, model, joint, patch.placement))
    for one in models:
        datas.append(one.createData())
    pin.initConstraintDynamics(model, data, models, datas)
    settings = pin.ProximalSettings(1e-14, 0.0, 1)
    tau = np.concatenate((np.zeros(6), torque))
    found = pin.constraintDynamics(model, data, q, v, tau, models, datas, settings)
    return np.array(found), np.reshape(data.lambda_c, (-1, 6))


@pytest.mark.parametrize("contacts", [(0,), (1,), (0, 1)])
def test_pinocchio_agrees_on_soles(g1, contacts):
    over = (0.05, 0.0) if len(contacts) > 1 else ((0.0, 0.08), (0.1, -0.08))[contacts[0]]
    q, v = standing(g1, (*over, 0.62))
    count, weight = len(contacts), g1.mass * g1.gravity
    tasks, references = TaskStack((ComTask(), SwayTask(), OrientationTask()), g1.nv), References()
    references.com_now[:] = *g1.com, *g1.com_velocity
    references.com[:] = [*g1.com, *g1.com_velocity, 0.3, 0.0]
    references.sway = 0.2
    tasks.write(g1, references)
    force = np.tile([0.0, 0.0, weight / count, 0.0, 0.0, 0.0], count)
    qp = WholeBodyQp(g1, QpOptions(contact_damping=0.0, friction=FRICTION, friction_margin=1.0))
    solution = qp.solve(tasks, Stance(contacts, force, np.full(count, np.inf)))
    assert solution.solved
    found, wrenches = constrained(g1, q, v, solution.torque, contacts)
    np.testing.assert_allclose(solution.acceleration, found, atol=1e-6)
    # Pinocchio's are along the sole's axes, which are the world's: the soles are level.
    np.testing.assert_allclose(solution.force.reshape(-1, 6), wrenches, atol=1e-5)
    for contact, wrench in zip(contacts, wrenches, strict=True):
        rows, patch = np.empty((CONE, 6)), g1.patches[contact]
        patch_cone(FRICTION, SOLE_SHARE * patch.half_sides, patch.centre, rows)
        assert (rows @ wrench).min() > -1e-4


def test_the_centre_of_pressure_stays_in_its_share(g1):
    """A wish that would tip the foot is served up to the edge of the share, and no further."""
    standing(g1, [0.0, 0.08, 0.62])
    weight, patch = g1.mass * g1.gravity, g1.patches[0]
    tasks, references = TaskStack((ComTask(), SwayTask(), OrientationTask()), g1.nv), References()
    references.com_now[:] = *g1.com, *g1.com_velocity
    for sign in (-1.0, 1.0):
        references.com[:] = [*g1.com, *g1.com_velocity, sign * 3.0, 0.0]
        references.sway = sign * 2.0
        tasks.write(g1, references)
        qp = WholeBodyQp(g1, QpOptions(contact_damping=0.0))
        force = np.array([0.0, 0.0, weight, 0.0, 0.0, 0.0])
        solution = qp.solve(tasks, Stance((0,), force, np.full(1, np.inf)))
        assert solution.solved
        _, _, fz, mx, my, _ = solution.force
        edge = SOLE_SHARE * patch.half_sides
        # The CoM goes forward where the pressure is at the heel.
        assert -my / fz == pytest.approx(patch.centre[0] - sign * edge[0], abs=1e-4)
        assert mx / fz == pytest.approx(patch.centre[1] - sign * edge[1], abs=1e-4)


def test_rows_match_finite_differences(g1):
    """T a + dT/dt v is the rate of what the task speaks of, along a motion with acceleration a."""
    rng, h = np.random.default_rng(3), 1e-6
    g1.face(0.4, np.array([0.1, 0.2]))
    references = References()
    references.com_now[1] = 0.6  # m, the height that weighs the momentum
    stack = TaskStack((SoleTask(Leg.REAR), SoleTask(Leg.FRONT), SwayTask()), g1.nv)
    height = references.com_now[1]

    def spoken(q, v):
        g1.update(q, v)
        s, turning = g1.space, g1.data["contact_velocity"][0, :2, 3:]
        speed = s.com_velocity[1] - s.momentum[0] / (g1.mass * height)
        return np.array([*turning.ravel(), speed])

    for _ in range(5):
        q = pin.integrate(g1.model, g1.neutral(), rng.uniform(-0.5, 0.5, g1.nv))
        v, a = rng.uniform(-1.0, 1.0, (2, g1.nv))
        after, before = (
            spoken(pin.integrate(g1.model, q, side * h * v + 0.5 * h**2 * a), v + side * h * a)
            for side in (1.0, -1.0)
        )
        g1.update(q, v)
        stack.write(g1, references)
        table = stack.table
        rate = table[:, : g1.nv] @ a + table[:, g1.nv]
        # The height is a number here, and moves in the row.
        s = g1.space
        rate[-1] -= s.momentum[0] * s.com_velocity[2] / height / (g1.mass * height)
        np.testing.assert_allclose(rate, (after - before) / (2.0 * h), atol=1e-5)
    g1.face(0.0, np.zeros(2))


def test_a_sole_task_turns_a_sole_level(g1):
    q = g1.bent()
    g1.update(q, np.zeros(g1.nv))
    ankle = list(g1.joint_names).index("left_ankle_roll_joint")
    q[7 + ankle] += 0.2
    g1.update(q, np.zeros(g1.nv))
    stack = TaskStack((SoleTask(Leg.REAR),), g1.nv)
    stack.write(g1, References())
    desired = stack.table[:, g1.nv + 1]
    np.testing.assert_allclose(desired, [-600.0 * np.sin(0.2), 0.0, 0.0], atol=1e-3)


def test_point_feet_have_no_soles():
    bolt = load_floating_robot("bolt")
    with pytest.raises(ParameterError, match="bolt has point feet, and a SoleTask asks for soles"):
        TaskStack((SoleTask(),), bolt.nv).check(bolt)
