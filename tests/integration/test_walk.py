"""The robot walking in PyBullet: what must hold on every tick, and over many steps."""

import numpy as np
import pytest

from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.modified import ModifiedPlanner
from template_control.embedding.planners.planner import Cause
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.plant.terrain import Terrain
from template_control.robot.library import load_robot
from template_control.robustness.disturbances import footholds as find_footholds
from template_control.robustness.severity_sweep import gait_errors
from template_control.run.experiment import Experiment, perturbed_start
from template_control.run.options import Push
from template_control.run.record import Record
from template_control.run.simulation import simulate
from template_control.run.summary import summarise
from template_control.slip.gaits.walking_by_speed import gait_for_speed
from template_control.slip.parameters import SlipParameters
from template_control.whole_body.solver import QpOptions

P = SlipParameters()


def walk(gait, planner=LqrPlanner, **options):
    return simulate(Experiment(load_robot("five-link"), planner=planner(gait), **options))


@pytest.fixture
def record(long_walk):
    return long_walk


def test_walks_without_a_fall(record):
    assert record.steps == 12
    assert not record.fell
    assert record.summary.qp_failures == 0
    assert np.all(record.solved)
    speed = (record.com[-1, 0] - record.com[0, 0]) / record.time[-1]
    assert 1.1 < speed < 1.3


def test_follows_the_template(record):
    rms = np.sqrt(np.mean(record.com_error**2, axis=0))
    assert rms[0] <= 0.01
    assert rms[1] <= 0.005
    np.testing.assert_allclose(rms, list(vars(record.summary.com_error_rms).values()))


def test_torques_stay_within_the_urdf(record):
    assert np.abs(record.torque).max() <= 350.0
    peaks = [j.peak for j in record.summary.joint_torque.values()]
    np.testing.assert_allclose(np.abs(record.torque).max(axis=0), peaks)


def test_only_joint_torques_act_on_the_robot(record):
    """Each tick's change of momentum is weight and the contact forces PyBullet reports."""
    dt = record.time[1] - record.time[0]
    force = record.contact_force[1:].sum(axis=1)
    force[:, 1] -= 80.0 * 9.81
    residual = 80.0 * np.diff(record.com_velocity, axis=0) / dt - force
    # First-order in the physics step where joints move fast; a hidden force would not average.
    assert np.all(np.abs(residual.mean(axis=0)) < 0.5)  # N, of 785
    assert np.quantile(np.abs(residual), 0.99) < 10.0


def test_contact_forces_lie_in_the_cone(record):
    x, y = record.contact_force[..., 0], record.contact_force[..., 1]
    assert np.all(y >= 0.0)
    assert np.all(np.abs(x) <= 0.7 * y + 1e-6)


def test_stance_feet_do_not_slide(record):
    nodes = np.array(record.nodes)[record.node]
    single = nodes == "SS_bv^wp"
    rear = record.foot[np.arange(len(record.time)), record.rear]
    step = np.abs(np.diff(rear[:, 0]))
    # Rolling of a 1 cm sphere moves its lowest point by less than 0.1 mm a millisecond.
    assert step[single[1:] & single[:-1]].max() < 1e-4


def test_the_trunk_is_held_where_the_options_say(gait):
    leant = walk(gait, steps=2, controller=EmbeddingOptions(trunk_pitch=0.1))
    assert leant.q[0, 2] == pytest.approx(0.1, abs=1e-6)
    assert leant.q[:, 2].mean() == pytest.approx(0.1, abs=0.02)


def test_the_node_sequence_is_the_automatons(record):
    names = np.array(record.nodes)[record.node]
    changes = names[np.concatenate(([True], names[1:] != names[:-1]))]
    cycle = ["SS_av^wp", "DS_sc^wp", "DS_sd^wp", "SS_bv^wp"]
    assert list(changes) == [cycle[i % 4] for i in range(len(changes))]
    assert len(changes) >= 4 * record.steps


def test_walk_is_deterministic(record, short_walk):
    """Walked twice: the second time for fewer steps."""
    samples = len(short_walk.time)
    assert samples > 2000
    for name in ("q", "v", "torque", "contact_force"):
        again, first = getattr(short_walk, name), getattr(record, name)
        np.testing.assert_array_equal(again, first[:samples])


@pytest.mark.slow
def test_a_disturbed_walk_is_the_same_wherever_its_memory_lies(gait):
    """The last digits of ProxQP's harder solves depend on where its workspace lies."""
    pushed = {"steps": 6, "pushes": (Push(25.0, step=2),)}
    first = walk(gait, **pushed)
    moved = []
    for n in range(1, 4):
        moved.append([np.zeros(3 * n) for _ in range(1000)])
        again = walk(gait, **pushed)
        np.testing.assert_array_equal(again.torque, first.torque)


def test_a_planner_knows_the_swing_at_a_section(gait, monkeypatch):
    asked, decide = [], LqrPlanner.decide

    def spied(self, context):
        if context.cause is Cause.SECTION:
            asked.append(context)
        return decide(self, context)

    monkeypatch.setattr(LqrPlanner, "decide", spied)
    record = walk(gait, steps=4)
    changes = record.time[1:][np.diff(record.node) != 0]
    assert np.isinf(asked[0].due)
    for context, section in zip(asked[1:4], record.section_time[1:4], strict=True):
        liftoff, _, touchdown = changes[np.searchsorted(changes, section + 1e-6) - 2 :][:3]
        assert context.lifted == pytest.approx(section - liftoff, abs=2e-3)
        assert context.due == pytest.approx(touchdown - section, abs=0.01)


def test_summary_has_every_figure(record):
    figures = summarise(record, "somewhere")
    assert figures["record"] == "somewhere"
    assert set(figures["vlo_target"]) == {"speed", "height", "vertical_speed"}
    assert set(figures["joint_torque"]["left_hip"]) == {"peak", "rms", "limit"}
    assert figures["fall_reason"] is None


@pytest.mark.slow(seconds=2)
def test_a_fall_is_recorded_whole(gait, tmp_path):
    record = walk(gait, steps=30, pushes=(Push(-200.0, step=3),))
    assert record.fell
    assert 3 <= record.steps < 30
    assert "step" in record.fall_reason
    again = Record.load(record.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(again.q, record.q)
    assert again.metadata == record.metadata
    assert again.fell


def test_weak_legs_report_failed_qps_or_a_fall(gait):
    record = walk(
        gait,
        steps=5,
        controller=EmbeddingOptions(qp=QpOptions(torque_scale=0.2)),
    )
    assert record.fell
    assert np.abs(record.torque).max() <= 70.0
    assert record.summary.qp_failures == np.sum(~record.solved)
    assert record.summary.saturated_share > 0.0


@pytest.mark.parametrize("steps", [4, pytest.param(15, marks=pytest.mark.slow)])
def test_the_papers_planner_walks_too(gait, steps):
    record = walk(gait, ModifiedPlanner, steps=steps)
    assert not record.fell
    assert record.steps == steps


def test_bad_options_are_named():
    with pytest.raises(ParameterError, match="friction"):
        PlantOptions(friction=-1.0)
    with pytest.raises(ParameterError, match="steps"):
        Experiment(steps=0)
    with pytest.raises(ParameterError, match="record_every"):
        Experiment(record_every=0)


@pytest.mark.slow(seconds=5)
def test_a_hundred_steps_settle_on_the_default_gait(default_gait):
    record = walk(default_gait, steps=100, record_every=10)
    figures = summarise(record, "")
    assert record.steps == 100
    assert not record.fell
    error = np.abs(record.section_state[-50:].mean(axis=0) - default_gait.vlo)
    assert np.all(error <= (0.01 * default_gait.vlo[0], 0.005, 0.03))
    assert 1.1 <= figures["mean_speed"] <= 1.3
    assert figures["com_error_rms"]["x"] <= 0.01
    assert figures["com_error_rms"]["y"] <= 0.005
    assert figures["qp_failures"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.9, 1.3])
def test_other_speeds(speed):
    record = walk(gait_for_speed(P, speed), steps=15)
    assert not record.fell
    walked = (record.com[-1, 0] - record.com[0, 0]) / record.time[-1]
    assert walked == pytest.approx(speed, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_perturbed_starts(gait, seed):
    assert not walk(gait, steps=10, start=perturbed_start(gait, seed)).fell


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_unknown_mass(gait, scale):
    assert not walk(gait, steps=15, world=PlantOptions(mass_scale=scale)).fell


@pytest.mark.slow
def test_slippery_ground(gait):
    record = walk(
        gait,
        steps=12,
        world=PlantOptions(friction=0.5),
        controller=EmbeddingOptions(qp=QpOptions(friction=0.5)),
    )
    assert not record.fell


@pytest.mark.slow
@pytest.mark.parametrize(  # in turn, so that every phase of the step has one
    ("impulse", "phase"),
    [(-20.0, 0.0), (25.0, 0.2), (-20.0, 0.4), (25.0, 0.5), (-20.0, 0.7), (25.0, 0.9)],
)
def test_pushes(default_gait, impulse, phase):
    record = walk(default_gait, steps=13, pushes=(Push(impulse, 2, phase),))
    assert not record.fell
    assert max(map(abs, gait_errors(record, default_gait))) < 0.02, "back within 10 steps"


@pytest.fixture(scope="module")
def footholds(default_gait):
    """About the place where the ground is to step up or down."""
    where = Experiment("five-link", planner=LqrPlanner(default_gait)).prepare()
    return find_footholds(where, tuple(default_gait.vlo), 5)[-2:]


@pytest.mark.slow
# Elsewhere between the footholds it is the same walk but for rounding.
@pytest.mark.parametrize(("height", "share"), [(-0.03, 0.3), (0.03, 0.7)])
def test_a_step_of_the_ground_that_it_does_not_see(default_gait, footholds, height, share):
    before, beyond = footholds
    edge = Terrain.step(height, before + share * (beyond - before))
    record = walk(default_gait, steps=13, world=PlantOptions(terrain=edge))
    assert not record.fell
    assert max(map(abs, gait_errors(record, default_gait))) < 0.02, "back within 10 steps"
