"""The QP with three and four contacts, against Pinocchio's own constrained dynamics."""

import numpy as np
import pinocchio as pin
import pytest

from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.library import load_floating_robot, robot_path
from template_control.robot.start import Pose, floating_state_in
from template_control.slip.automaton.vocabulary import Leg
from template_control.whole_body.solver import QpOptions, Stance, WholeBodyQp
from template_control.whole_body.stack import TaskStack
from template_control.whole_body.task import WEIGHT, References
from template_control.whole_body.tasks import ComTask, FootTask, OrientationTask, SideFootTask

FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
STANDING = Pose(
    com=np.array([0.0, 0.0, 0.3]),
    com_velocity=np.array([0.3, -0.1, 0.05]),
    feet=np.zeros((2, 3)),
    feet_velocity=np.zeros((2, 3)),
    momentum_speed=True,
)


@pytest.fixture(scope="module")
def pointed():
    """Go2 on points, whose contacts do not roll: they are points of its shanks."""
    return FloatingBaseBiped.from_urdf(robot_path("go2"), FEET, 1e-9)


def constrained(robot, q, v, torque, contacts):
    """Accelerations, and sizes of the contacts' forces, as Pinocchio finds them."""
    model, data = robot.model, robot.model.createData()
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for contact in contacts:
        frame = model.frames[model.getFrameId(f"{robot.feet[contact]} sphere's centre")]
        kind = pin.ContactType.CONTACT_3D
        models.append(pin.RigidConstraintModel(kind, model, frame.parentJoint, frame.placement))
    for one in models:
        datas.append(one.createData())
    pin.initConstraintDynamics(model, data, models, datas)
    settings = pin.ProximalSettings(1e-14, 0.0, 1)
    tau = np.concatenate((np.zeros(6), torque))
    found = pin.constraintDynamics(model, data, q, v, tau, models, datas, settings)
    return np.array(found), np.linalg.norm(np.reshape(data.lambda_c, (-1, 3)), axis=1)


@pytest.mark.parametrize("contacts", [(0, 3), (0, 1, 3), (0, 1, 2, 3)])
def test_pinocchio_agrees_on_several_contacts(pointed, contacts):
    q, v = floating_state_in(pointed, STANDING)
    rng, weight = np.random.default_rng(4), pointed.mass * pointed.gravity
    tasks, references = TaskStack((ComTask(), OrientationTask()), pointed.nv), References()
    references.com_now[:] = *pointed.com, *pointed.com_velocity
    references.com[:] = [*pointed.com + rng.normal(0.0, 0.01, 2), 0.3, 0.0, 0.5, -0.2]
    tasks.write(pointed, references)
    count = len(contacts)
    force = np.tile([0.0, 0.0, weight / count], count)
    qp = WholeBodyQp(pointed, QpOptions(contact_damping=0.0))
    solution = qp.solve(tasks, Stance(contacts, force, np.full(count, np.inf)))
    assert solution.solved
    acceleration, sizes = constrained(pointed, q, v, solution.torque, contacts)
    np.testing.assert_allclose(solution.acceleration, acceleration, atol=1e-6)
    np.testing.assert_allclose(
        np.linalg.norm(solution.force.reshape(count, 3), axis=1), sizes, atol=1e-6 * weight
    )
    # The rows of the contacts hold, and each bears within its own cone.
    jacobian = pointed.contact_jacobian[list(contacts)].reshape(3 * count, -1)
    bias = pointed.contact_bias[list(contacts)].ravel()
    np.testing.assert_allclose(jacobian @ solution.acceleration + bias, 0.0, atol=1e-7)
    for x, y, z in solution.force.reshape(count, 3):
        assert max(abs(x), abs(y)) <= 0.63 * z + 1e-5


def test_each_contact_of_a_foot_has_its_own_rows():
    """A foot that swings is followed by both of its contacts; one that stands asks for nothing."""
    robot = load_floating_robot("go2")
    floating_state_in(robot, STANDING)
    tasks = [task(Leg.FRONT, contact=i) for i in (0, 1) for task in (FootTask, SideFootTask)]
    stack, references, nv = TaskStack(tasks, robot.nv), References(), robot.nv
    references.feet[:] = 0, 1
    for axis in range(3):
        references.offset[:4, axis, 0] = robot.contact_position[:, axis]
    references.offset[1, 0, 0] += 0.01
    references.stands[2] = 1
    stack.write(robot, references)
    wanted = [robot.contact_jacobian[contact, axis] for contact in (1, 2) for axis in (0, 2, 1)]
    np.testing.assert_array_equal(stack.table[:, :nv], wanted)
    asked = stack.table[:, nv + 1] + 45.0 * (stack.table[:, :nv] @ velocity(robot))
    np.testing.assert_allclose(asked, [6.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(stack.table[:, nv + WEIGHT], [1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


def velocity(robot):
    """A velocity of the robot with that of its contacts."""
    rows = robot.contact_jacobian.reshape(-1, robot.nv)
    return np.linalg.lstsq(rows, robot.contact_velocity.ravel(), rcond=None)[0]


def test_an_absent_contact_is_refused():
    with pytest.raises(Exception, match="asks for contact 1 of a leg, and the legs of bolt have 1"):
        TaskStack((FootTask(contact=1),), 12).check(load_floating_robot("bolt"))
