"""Gaits are data: a robot hops on one leg on the spot, and the package knows nothing of it.

Own nodes, an own task, an own entry for each phase and an own planner; the automaton's
interpreter, the return map, the controller, the whole-body QP and PyBullet are the library's.
docs/guides/your_gait.md leads through it.
"""

from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.optimize import least_squares

from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.phases import Clock, PhaseControl
from template_control.embedding.planners.planner import Decision, Planner
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.ideal import IdealOptions
from template_control.plant.mujoco import MujocoOptions
from template_control.robot.library import load_robot, robot_path
from template_control.robot.planar_biped import PlanarBiped
from template_control.robot.start import Pose
from template_control.run.experiment import Experiment
from template_control.run.record import Record
from template_control.run.simulation import simulate
from template_control.slip.automaton.hybrid import Automaton, Edge, Node
from template_control.slip.automaton.vocabulary import Event, Leg, Outcome, Phase, Reset, Slot
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.gaits.gait import Gait
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.maps.section import APEX
from template_control.slip.parameters import SlipParameters
from template_control.view.figures import FIGURES, save_figures
from template_control.whole_body.solver import QpOptions
from template_control.whole_body.tasks import ComTask, FootTask, MomentumTask, PostureTask

P = SlipParameters(leg_stiffness=25e3)
HEIGHT = 1.02  # of the apex [m]
HOPS = 10

_FALLS = (Edge(Event.FALL, Outcome.FALL),)
# As running, but the same leg lands again: liftoff changes no role.
HOPPING = Automaton(
    (
        Node(
            "F_aa^hop",
            Phase.F,
            None,
            None,
            (Edge(Event.TOUCHDOWN, "SS_sc^hop", Reset.PLACE_REAR, "G_t^hop"), *_FALLS),
        ),
        Node(
            "SS_sc^hop",
            Phase.SS,
            Slot.K_SC,
            None,
            (Edge(Event.BOTTOM, "SS_sd^hop", Reset.NONE, "G_b^hop"), *_FALLS),
        ),
        Node(
            "SS_sd^hop",
            Phase.SS,
            Slot.K_SD,
            None,
            (Edge(Event.REAR_LIFTOFF, "F_ba^hop", Reset.NONE, "G_l^hop"), *_FALLS),
        ),
        Node(
            "F_ba^hop",
            Phase.F,
            None,
            None,
            (Edge(Event.APEX, "F_aa^hop", Reset.NONE, "G_a^hop", section=True), *_FALLS),
        ),
    ),
    {"hop": "F_aa^hop"},
)


@dataclass(frozen=True)
class TuckedFoot:
    """Two rows: a foot stays where it is relative to the CoM."""

    leg: Leg
    place: tuple[float, float]  # from the CoM [m]
    weight: float = 0.1
    gains: tuple[float, float] = (200.0, 28.0)

    @property
    def weights(self):
        return (self.weight, self.weight)

    def write(self, robot, references, rows):
        foot, (kp, kd) = references.feet[self.leg], self.gains
        rows.jacobian[:] = robot.foot_jacobian[foot] - robot.com_jacobian
        rows.bias[:] = robot.foot_bias[foot] - robot.com_bias
        away = robot.com + self.place - robot.foot_position[foot]
        rows.desired[:] = kp * away + kd * (robot.com_velocity - robot.foot_velocity[foot])


TUCKED = TuckedFoot(Leg.FRONT, (-0.05, -0.75))
PHASES = {
    Phase.F: PhaseControl(
        tasks=(PostureTask(0.01), FootTask(Leg.REAR), TUCKED),
        swings=(Leg.REAR,),
        clock=Clock.TIME,
        momentum_speed=False,
        estimate_load=False,
    ),
    Phase.SS: PhaseControl(
        tasks=(ComTask((0.01, 10.0)), MomentumTask(), TUCKED), clock=Clock.TIME, estimate_load=False
    ),
}


class Deadbeat(Planner):
    """The controls that lead to the target in one hop, by least squares on the exact map."""

    def __init__(self, height):
        u = np.array([0.5 * np.pi, P.leg_stiffness, P.leg_stiffness, 0.0, 0.0, 0.0])
        z = np.array([0.0, height])
        stride = simulate_stride(P, "F_aa^hop", APEX.state(z), u, automaton=HOPPING)
        self.gait = Gait("hop", P, z, u, 0.0, stride.duration, "hop")
        self.offset = np.zeros(3)
        self._map = ReturnMap(P, "hop", automaton=HOPPING)

    def reset(self):
        self.offset = np.zeros(3)

    def decide(self, context):
        z, target, angles, *_ = context
        aim = (self.gait.state if target is None else target) - self.offset[:2]
        low, high = np.maximum(angles[0], 1.3), np.minimum(angles[1], np.pi - 1.3)

        def controls(x):
            return np.array([x[0], x[1] * P.leg_stiffness, x[2] * P.leg_stiffness, 0.0, 0.0, 0.0])

        def errors(x):
            end, outcome = self._map.step(z, controls(x))
            away = end - aim if outcome is Outcome.SECTION else np.full(2, 10.0)
            return np.append(away / [0.05, 0.005], 0.1 * (x[1:] - 1.0))

        start = [np.clip(0.5 * np.pi - 0.1 * z[0], low + 1e-6, high - 1e-6), 1.0, 1.0]
        found = least_squares(errors, start, bounds=([low, 0.5, 0.5], [high, 2.0, 2.0]))
        end, outcome = self._map.step(z, controls(found.x))
        done = outcome is Outcome.SECTION
        return Decision(controls(found.x), np.append(end, 0.0) + self.offset, done, done, done)

    def observe(self, decision, z):
        self.offset[:2] += 0.3 * np.clip(z - decision.predicted[:2], -0.05, 0.05)


def hop(hops=HOPS, robot="five-link", **options):
    """A recorded run."""
    planner = Deadbeat(HEIGHT)
    start = Pose(
        com=np.array([0.0, HEIGHT]),
        com_velocity=np.zeros(2),
        feet=np.array([[0.0, HEIGHT - P.rest_length], np.add([0.0, HEIGHT], TUCKED.place)]),
        feet_velocity=np.zeros((2, 2)),
    )
    o = Experiment(
        steps=hops,
        pose=start,
        controller=EmbeddingOptions(phases=PHASES, qp=QpOptions(torque_scale=2.0)),
    )
    robot = load_robot(robot) if isinstance(robot, str) else robot
    return simulate(replace(o, **options, robot=robot, planner=planner, automaton=HOPPING))


def monopod(folder):
    """A planar robot with one leg, and the template of ``P``: five-link without the right one."""
    tree = ElementTree.parse(robot_path("five-link"))
    links = tree.getroot()
    for part in [e for e in links if e.get("name", "").startswith("right")]:
        links.remove(part)
    (trunk,) = (e.find("inertial") for e in links if e.get("name") == "trunk")
    trunk.find("mass").set("value", "72.8")
    trunk.find("origin").set("xyz", "0 0 0.25")
    tree.write(folder / "monopod.urdf")
    return PlanarBiped.from_urdf(folder / "monopod.urdf", feet=("left_foot",))


@pytest.fixture(scope="module")
def record():
    return hop()


def test_robot_hops_on_the_spot(record):
    assert record.fall_reason == ""
    assert record.steps == HOPS
    speed, height, _ = record.section_state[3:].T
    assert np.max(np.abs(height - HEIGHT)) < 0.02
    assert np.max(np.abs(speed)) < 0.15
    assert np.max(np.abs(record.com[:, 0])) < 0.3
    assert record.solved.mean() > 0.99


def test_it_flies_and_lands_on_the_same_foot(record):
    force = record.contact_force[:, :, 1]
    assert not force[:, 1].any(), "the tucked foot never touches"
    nodes = [record.nodes[i] for i in record.node]
    flying = np.array([name.startswith("F") for name in nodes])
    assert 0.2 < flying.mean() < 0.8
    assert (record.rear == 0).all()
    landings = np.flatnonzero(np.diff(flying.astype(int)) < 0)
    assert len(landings) == HOPS
    # What the ground gives over whole hops carries the robot's weight.
    begin, end = np.searchsorted(record.time, record.section_time[[2, -1]])
    assert force[begin:end, 0].mean() == pytest.approx(80.0 * 9.81, rel=0.05)


def test_record_names_the_toy_s_nodes_section_and_stride(record, tmp_path):
    assert record.sections == ("APEX",)
    assert record.strides == ("hop",)
    assert record.nodes == tuple(node.name for node in HOPPING.nodes)
    swings = record.swing_reference
    assert np.isnan(swings[:, 1]).all(), "only the leg that lands has a foothold"
    assert np.isfinite(swings[:, 0]).any()
    assert np.isnan(swings[:, 0]).any()
    again = Record.load(record.save(tmp_path / "hop.npz"))
    np.testing.assert_array_equal(again.section_state, record.section_state)


def test_a_table_that_does_not_fit_the_automaton_is_refused():
    def refused(phases):
        with pytest.raises(ParameterError) as told:
            hop(1, controller=EmbeddingOptions(phases=phases))
        return str(told.value)

    assert "no entry of the phases serves node F_aa^hop" in refused({Phase.SS: PHASES[Phase.SS]})
    assert "'SS_sc^hpo', which is no node" in refused({**PHASES, "SS_sc^hpo": PHASES[Phase.SS]})


@pytest.mark.slow(seconds=3)
@pytest.mark.parametrize(
    "world", [PlantOptions(), MujocoOptions(), IdealOptions()], ids=lambda o: o.kind
)
def test_a_monopod_hops_on_its_only_leg(tmp_path, world):
    """The template's front leg has no contact: no gait, phase or task asks for it."""
    robot = monopod(tmp_path)
    assert robot.groups == ((0,), ())
    assert np.isnan(robot.foot_jacobian[1]).all()
    of_one_leg = {
        phase: replace(control, tasks=tuple(t for t in control.tasks if t is not TUCKED))
        for phase, control in PHASES.items()
    }
    tuning = EmbeddingOptions(phases=of_one_leg, qp=QpOptions(torque_scale=2.0))
    record = hop(6, robot, controller=tuning, world=world)
    assert record.fall_reason == ""
    assert record.steps == 6
    speed, height, _ = record.section_state[3:].T
    assert np.max(np.abs(height - HEIGHT)) < 0.02
    assert np.max(np.abs(speed)) < 0.15
    assert record.solved.mean() > 0.99
    assert record.contact_force.shape[1:] == (1, 2)
    begin, end = np.searchsorted(record.time, record.section_time[[2, -1]])
    weight = record.contact_force[begin:end, 0, 1].mean()
    assert weight == pytest.approx(80.0 * 9.81, rel=0.05)
    again = Record.load(record.save(tmp_path / "hop.npz"))
    assert again.groups == ((0,), ())
    legs = again.of_legs(again.foot)
    np.testing.assert_array_equal(legs[:, 0], again.foot[:, 0])
    assert np.isnan(legs[:, 1]).all()
    assert save_figures(again, tmp_path, dpi=40, figures=("stick_diagram", "forces"))


def test_a_monopod_is_asked_for_its_own_leg_only(tmp_path):
    robot = monopod(tmp_path)
    with pytest.raises(ParameterError, match=r"node SS_av\^w of the automaton wants two"):
        simulate(Experiment(robot))
    front = PhaseControl(tasks=(FootTask(Leg.FRONT),), clock=Clock.TIME, estimate_load=False)
    with pytest.raises(ParameterError, match="FootTask asks for the front leg"):
        hop(1, robot, controller=EmbeddingOptions(phases={**PHASES, Phase.F: front}))


@pytest.mark.slow
def test_the_toy_s_figures_are_drawn(record, tmp_path):
    assert {path.stem for path in save_figures(record, tmp_path, dpi=40)} == set(FIGURES)
