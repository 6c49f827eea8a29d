"""What is learnt of a robot's sideways motion from step to step."""

from dataclasses import replace

import numpy as np
import pytest

from template_control.slip import LateralLearningOptions, LateralLearnt, Side

OPTIONS = LateralLearningOptions(offset_bound=(0.03, 0.1), surprise_bound=(0.025, 0.1))
ONE_SIDED = replace(OPTIONS, one_sided=1.0)


def taught(truth, options, steps=120):
    """After steps of a robot that adds ``truth`` (2, 2), rows left and right."""
    learnt = LateralLearnt()
    for i in range(steps):
        side = (Side.LEFT, Side.RIGHT)[i % 2]
        learnt = learnt.after_step(side, truth[side.row] - learnt.offset[side.row], options)
    return learnt.offset


def test_an_offset_that_both_sides_have_is_learnt_whole():
    truth = np.array([[0.01, -0.05], [-0.01, 0.05]])
    np.testing.assert_allclose(taught(truth, OPTIONS), truth, atol=1e-6)


def test_a_drift_aside_is_no_offset():
    offset = taught(np.array([[0.01, 0.05], [0.01, 0.05]]), OPTIONS)
    np.testing.assert_allclose(offset[0], -offset[1], atol=1e-15)
    assert np.abs(offset).max() < 0.006  # the sway between two lessons: 0.1 of the drift


def test_each_side_can_learn_for_itself():
    truth = np.array([[0.01, -0.05], [0.002, 0.01]])
    np.testing.assert_allclose(taught(truth, ONE_SIDED), truth, atol=1e-6)


def test_a_push_is_no_offset():
    learnt = LateralLearnt().after_step(Side.RIGHT, np.array([-1.0, 9.0]), ONE_SIDED)
    expected = OPTIONS.gain * np.array(OPTIONS.surprise_bound) * [-1.0, 1.0]
    np.testing.assert_allclose(learnt.offset, [[0.0, 0.0], expected])


def test_no_more_is_believed_than_the_bound():
    learnt = LateralLearnt()
    for _ in range(200):
        learnt = learnt.after_step(Side.LEFT, np.array([1.0, 1.0]), OPTIONS)
    np.testing.assert_allclose(learnt.offset, np.outer([1, -1], OPTIONS.offset_bound))


def test_a_lesson_leaves_what_was_known_as_it_is():
    before = LateralLearnt()
    before.after_step(Side.LEFT, np.array([0.01, 0.0]), OPTIONS)
    assert not before.offset.any()


@pytest.mark.parametrize(("lasted", "stretch"), [(0.107, 1.07), (0.3, 1.2), (0.01, 0.9)])
def test_the_stretch_of_single_stance(lasted, stretch):
    learnt = LateralLearnt()
    for _ in range(60):
        learnt = learnt.after_stance(lasted, 0.1)
    assert np.isclose(learnt.stretch, stretch, atol=1e-5)
