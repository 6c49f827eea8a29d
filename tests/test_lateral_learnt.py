"""What is learnt of a robot's sideways motion from step to step."""

import numpy as np
import pytest

from template_control.slip import LateralLearningOptions, LateralLearnt, Side

OPTIONS = LateralLearningOptions()


def test_an_offset_is_learnt_whole():
    truth, learnt = np.array([0.01, -0.05]), LateralLearnt()
    for _ in range(60):
        surprise = truth - learnt.offset[Side.LEFT.row]
        learnt = learnt.after_step(Side.LEFT, surprise, OPTIONS)
    np.testing.assert_allclose(learnt.offset, [truth, [0.0, 0.0]], atol=1e-7)


def test_a_push_is_no_offset():
    learnt = LateralLearnt().after_step(Side.RIGHT, np.array([-1.0, 9.0]), OPTIONS)
    expected = OPTIONS.gain * np.array(OPTIONS.surprise_bound) * [-1.0, 1.0]
    np.testing.assert_allclose(learnt.offset, [[0.0, 0.0], expected])


def test_no_more_is_believed_than_the_bound():
    learnt = LateralLearnt()
    for _ in range(200):
        learnt = learnt.after_step(Side.LEFT, np.array([1.0, 1.0]), OPTIONS)
    np.testing.assert_allclose(learnt.offset[0], OPTIONS.offset_bound)


def test_a_lesson_leaves_what_was_known_as_it_is():
    before = LateralLearnt()
    before.after_step(Side.LEFT, np.array([0.01, 0.0]), OPTIONS)
    assert not before.offset.any()


@pytest.mark.parametrize(("lasted", "stretch"), [(0.107, 1.07), (0.3, 1.2), (0.01, 0.9)])
def test_the_stretch_of_single_stance(lasted, stretch):
    learnt = LateralLearnt()
    for _ in range(60):
        learnt = learnt.after_stance(lasted, 0.1, OPTIONS)
    assert np.isclose(learnt.stretch, stretch, atol=1e-5)
