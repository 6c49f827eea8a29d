"""A walk runs through few files, so that a stranger can follow it."""

import sys

import pytest
from places import ROOT

import template_control as tc
from template_control.plant.bullet import BulletPlant
from template_control.run.live import LiveRun

MOST = 45
RECORDING = {"run/recorder.py", "run/statistics.py"}


@pytest.fixture
def entered(monkeypatch):
    """Files of the library that a run enters from its first tick to its last."""
    library, files, loop, read = (
        ROOT / "template_control",
        set(),
        LiveRun.finish,
        BulletPlant.read,
    )

    def note(frame, event, _):
        if event == "call" and frame.f_code.co_filename.startswith(f"{library}/"):
            files.add(frame.f_code.co_filename[len(f"{library}/") :])

    def first_tick(plant, q, v):
        sys.setprofile(note)
        return read(plant, q, v)

    def to_the_last(*parts, **others):
        try:
            return loop(*parts, **others)
        finally:
            sys.setprofile(None)

    monkeypatch.setattr(BulletPlant, "read", first_tick)
    monkeypatch.setattr(LiveRun, "finish", to_the_last)
    return files


def test_four_steps_run_through_few_files(entered):
    record = tc.simulate(tc.Experiment(steps=4, world=tc.PlantOptions()))
    assert record.steps == 4
    assert {"embedding/controller.py", "embedding/tick.py", "whole_body/solver.py"} <= entered
    followed = entered - RECORDING
    assert len(followed) <= MOST, sorted(followed)
