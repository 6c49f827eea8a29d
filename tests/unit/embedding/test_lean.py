"""The trunk's lean: by stride and speed, slowly changing, right on average."""

import numpy as np
import pytest

from template_control.embedding.lean import (
    ERROR_BOUND,
    GAIN,
    LEAN,
    LEAN_RATE,
    Lean,
    LeanOptions,
    TrunkLean,
    advance_lean,
)
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.route import StrideGoal
from template_control.slip.similarity import Scale

OPTIONS = LeanOptions({"r": Lean((2.0, 4.0), (0.2, 0.4), excess=0.1)})
SCALE = Scale.of(SlipParameters())
DT = 1e-3


def goal(stride, speed, then=None):
    return StrideGoal(stride, np.array([speed, 1.0]), speed, then=then)


def test_lean_is_that_of_the_stride_and_the_speed():
    assert OPTIONS.pitch(goal("r", 3.0), 0.05) == pytest.approx(0.3)
    assert OPTIONS.pitch(goal("r", 9.0), 0.05) == pytest.approx(0.4)
    assert OPTIONS.pitch(goal("w", 1.0), 0.05) == 0.05


def test_a_stride_before_another_kind_prepares_its_lean():
    assert OPTIONS.pitch(goal("w", 2.0, "r"), 0.05) == pytest.approx(0.2)


def test_a_run_begins_with_its_lean_and_changes_it_slowly():
    lean = TrunkLean(OPTIONS, 0.0, SCALE, np.zeros(1, LEAN))
    lean.aim(goal("r", 2.0))
    assert advance_lean(lean.data[0], 0.2, DT) == pytest.approx(0.3), "mean and excess"
    lean.aim(goal("r", 4.0))
    for _ in range(1000):
        advance_lean(lean.data[0], 0.2, DT)
    assert lean.mean == pytest.approx(0.2 + LEAN_RATE)
    for _ in range(2000):
        advance_lean(lean.data[0], 0.2, DT)
    assert lean.mean == pytest.approx(0.4)


def test_the_mean_pitch_becomes_the_wanted_one():
    lean = TrunkLean(OPTIONS, 0.0, SCALE, np.zeros(1, LEAN))
    lean.aim(goal("r", 2.0))
    for _ in range(60):
        pitch = 0.0
        for _ in range(250):
            pitch = advance_lean(lean.data[0], pitch, DT) - 0.15
        lean.end_stride(True)
    assert pitch == pytest.approx(0.2, abs=1e-3)
    assert lean.correction == pytest.approx(0.15, abs=1e-3)
    lean.reset()
    assert lean.correction == 0.0


def test_a_disturbed_stride_teaches_nothing():
    lean = TrunkLean(OPTIONS, 0.0, SCALE, np.zeros(1, LEAN))
    lean.aim(goal("r", 2.0))
    advance_lean(lean.data[0], -0.5, DT)
    lean.end_stride(False)
    assert lean.correction == 0.1
    advance_lean(lean.data[0], -0.5, DT)
    lean.end_stride(True)
    assert lean.correction == pytest.approx(0.1 + GAIN * ERROR_BOUND)


def test_a_stride_without_a_lean_keeps_the_trunk_s_pitch():
    lean = TrunkLean(OPTIONS, 0.05, SCALE, np.zeros(1, LEAN))
    lean.aim(goal("w", 1.0))
    for _ in range(10):
        assert advance_lean(lean.data[0], 0.3, DT) == 0.05
    lean.end_stride(True)
    assert advance_lean(lean.data[0], 0.3, DT) == 0.05
