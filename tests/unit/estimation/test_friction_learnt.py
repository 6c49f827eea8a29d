"""What sliding feet tell of the ground's friction, and what they must not tell."""

from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control.embedding.options import EmbeddingOptions
from template_control.estimation.friction import (
    SLIDES,
    SLIDING_SPEED,
    FrictionOptions,
    feel_slides,
    set_friction,
)
from template_control.plant.bullet import PlantOptions
from template_control.slip.similarity import Scale

OPTIONS = FrictionOptions()
DT, WEIGHT, TOLD, TRUE = 1e-3, 800.0, 0.7, 0.5
FIRST = np.array([True, False])
STOOD, SLID = 0.05, 0.03
"""Times in these stories [s]: a foot stands, then slides."""


def estimate(told=TOLD, **options):
    found, scale = np.zeros(1, SLIDES), Scale.of(tc.SlipParameters())
    set_friction(found, replace(OPTIONS, **options), told, WEIGHT, scale)
    return found[0]


def feel(friction, seconds, force, speed, standing=FIRST):
    """The first foot feels a force and moves, for some time; whether anything was learnt."""
    forces, speeds = np.zeros((2, 2, len(force)))
    forces[0], speeds[0] = force, speed
    stands, ticks = standing.view(np.uint8), range(round(seconds / DT))
    return any([feel_slides(friction, stands, forces, speeds, DT) for _ in ticks])


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_foot_that_slides_tells_the_friction(way):
    friction = estimate()
    assert not feel(friction, STOOD, (-way * 0.6 * WEIGHT, WEIGHT), (0.0, 0.0))
    assert feel(friction, SLID, (-way * TRUE * 300.0, 300.0), (way * 0.2, 0.0))
    assert np.isclose(friction["coefficient"], TRUE)


def test_a_foot_that_slides_aside_tells_it_too():
    friction = estimate()
    feel(friction, STOOD, (0.0, 0.0, WEIGHT), (0.0, 0.0, 0.0))
    feel(friction, SLID, (-0.3 * WEIGHT, 0.4 * WEIGHT, WEIGHT), (0.12, -0.16, 0.0))
    assert np.isclose(friction["coefficient"], TRUE)


def test_the_force_is_averaged_over_a_slide():
    friction, draw = estimate(), np.random.default_rng(3)
    feel(friction, STOOD, (0.0, WEIGHT), (0.0, 0.0))
    for noise in draw.normal(0.0, 0.1 * TRUE, 30):
        feel(friction, DT, (-(TRUE + noise) * 300.0, 300.0), (0.2, 0.0))
    assert 0.85 * TRUE < friction["coefficient"] < 1.05 * TRUE


@pytest.mark.parametrize(("standing", "learns"), [(FIRST, True), (np.zeros(2, dtype=bool), False)])
def test_a_foot_that_chatters_slides_on(standing, learns):
    """A light foot that slides carries nothing every other millisecond."""
    friction = estimate(settling=0.01)
    for _ in range(10):
        feel(friction, 0.002, (-TRUE * 300.0, 300.0), (0.2, 0.0))
        assert not feel(friction, 0.003, (0.0, 0.0), (0.4, 0.0), standing), "no force, no ratio"
    assert np.isclose(friction["coefficient"], TRUE if learns else TOLD)


@pytest.mark.parametrize(
    ("seconds", "force", "speed"),
    [
        (SLID, (-0.3 * WEIGHT, WEIGHT), (0.8 * SLIDING_SPEED, 0.0)),
        (SLID, (0.3 * WEIGHT, WEIGHT), (0.2, 0.0)),
        (SLID, (-0.3 * WEIGHT, WEIGHT), (0.0, 0.2)),
        (SLID, (-0.01 * WEIGHT, 0.03 * WEIGHT), (0.2, 0.0)),
        (0.8 * OPTIONS.duration, (-0.3 * WEIGHT, WEIGHT), (0.2, 0.0)),
        (SLID, (-0.98 * TOLD * WEIGHT, WEIGHT), (0.2, 0.0)),
    ],
    ids=["stands", "is pushed along", "lifts off", "carries little", "for a moment", "as told"],
)
def test_what_is_no_evidence_teaches_nothing(seconds, force, speed):
    friction = estimate()
    feel(friction, STOOD, (0.0, WEIGHT), (0.0, 0.0))
    assert not feel(friction, seconds, force, speed)
    assert friction["coefficient"] == TOLD


def test_an_impact_and_a_foot_in_the_air_teach_nothing():
    friction = estimate(duration=0.0)
    still = np.zeros(2, dtype=bool)
    assert not feel(friction, STOOD, (-0.3 * WEIGHT, WEIGHT), (1.0, 0.0), standing=still)
    assert not feel(friction, 0.8 * OPTIONS.settling, (-0.3 * WEIGHT, WEIGHT), (1.0, 0.0))
    assert feel(friction, OPTIONS.settling, (-0.3 * WEIGHT, WEIGHT), (1.0, 0.0))


def test_noise_teaches_nothing():
    friction, draw = estimate(), np.random.default_rng(0)
    deviation = 0.04  # of 1 mrad of noise [m/s]
    for speed in draw.normal(0.0, deviation, (20_000, 2)):
        feel(friction, DT, (-0.2 * WEIGHT, WEIGHT), speed)
    assert friction["coefficient"] == TOLD


def test_the_estimate_falls_to_the_lowest_and_never_rises():
    friction = estimate()
    feel(friction, STOOD, (0.0, WEIGHT), (0.0, 0.0))
    feel(friction, SLID, (-0.1 * WEIGHT, WEIGHT), (0.2, 0.0))
    assert friction["coefficient"] == OPTIONS.lowest
    feel(friction, SLID, (-TRUE * WEIGHT, WEIGHT), (-0.2, 0.0))
    feel(friction, SLID, (-TRUE * WEIGHT, WEIGHT), (0.2, 0.0))
    assert friction["coefficient"] == OPTIONS.lowest


def test_a_robot_that_is_told_less_than_the_lowest_keeps_that():
    friction = estimate(0.2)
    feel(friction, STOOD, (0.0, WEIGHT), (0.0, 0.0))
    assert not feel(friction, SLID, (-0.1 * WEIGHT, WEIGHT), (0.2, 0.0))
    assert friction["coefficient"] == 0.2


def test_rolling_feet_stand():
    """The speed of a round foot that is looked at is the material point's on the ground."""
    robot = tc.load_robot("rabbit")
    draw = np.random.default_rng(1)
    robot.update(robot.neutral(), draw.normal(0.0, 1.0, robot.nv))
    jacobian = robot.contact_jacobian[0].copy()
    v = np.linalg.svd(jacobian)[2][2:].T @ draw.normal(0.0, 1.0, robot.nv - 2)
    robot.update(robot.neutral(), v)
    assert abs(robot.foot_turning[0] @ v) * robot.foot_radius > 0.0
    np.testing.assert_allclose(robot.contact_velocity[0], 0.0, atol=1e-12)


def sliding_share(robot, gait, options):
    """Share of the ticks in which a loaded foot slides, after the third step of a walk."""
    plant = PlantOptions(friction=TRUE)
    record = tc.simulate(
        tc.Experiment(robot, planner=tc.LqrPlanner(gait), steps=8, world=plant, controller=options)
    )
    assert not record.fell
    along, up = np.abs(record.contact_force[..., 0]), record.contact_force[..., 1]
    slides = (up > 0.05 * robot.mass * robot.gravity) & (along > 0.995 * TRUE * up)
    return float(slides[record.time > record.section_time[3]].any(axis=1).mean())


@pytest.mark.slow(seconds=4)
def test_a_walk_on_slippery_ground_slides_less_once_it_has_learnt(robot, default_gait):
    learns = sliding_share(robot, default_gait, EmbeddingOptions())
    deaf = EmbeddingOptions(slides=replace(OPTIONS, lowest=TOLD))
    assert learns < 0.01
    assert sliding_share(robot, default_gait, deaf) > 0.05
