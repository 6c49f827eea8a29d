"""``run.toml`` of every kind of run holds what the run used, and repeats it."""

from dataclasses import fields, replace

import numpy as np
import pytest
from places import EXAMPLES

from template_control.cli.main import main
from template_control.embedding.options import FREE_PLANNER, EmbeddingOptions
from template_control.embedding.planners.lqr import LqrOptions
from template_control.errors import ParameterError
from template_control.plant.plant import Plant
from template_control.robot.spec import RobotSpec
from template_control.robustness.campaign import CampaignConfig
from template_control.run.experiment import Experiment
from template_control.run.live import LiveRun
from template_control.run.record import load_record
from template_control.run.simulation import simulate
from template_control.run.specs import GaitSpec
from template_control.slip.similarity import Scale, scaled

LINES = {
    "own, estimate": "walk --estimate --steps 2 --torque-scale 0.9 --friction 0.6 --no-catch",
    "paper": "walk --gait paper --planner modified --map improved --steps 1",
    "ahead": "walk --planner ahead --speed 0.9 --steps 2",
    "run": "run --speed 3 --steps 2",
    "scenario": f"go {EXAMPLES / 'example_one.toml'} --robot runner --steps 3",
    "speed profile": f"go {EXAMPLES / 'any_speed.toml'} --steps 2",
    "walk of a scenario": f"walk --scenario {EXAMPLES / 'walk_speeds.toml'} --steps 2",
    "stand": "walk --from-stand --steps 1",
    "free bolt": "walk --robot bolt --free --speed 0.6 --steps 2 --turn 0.2",
    "free, own": "walk --robot five-link-3d --free --planner lqr --steps 1 --friction 0.6",
    "free in MuJoCo": "walk --robot bolt --free --steps 1 --plant mujoco --noise 0.0005",
    "mujoco, push": "walk --plant mujoco --push 25@1:0.3 --steps 2 --delay 0.002",
    "ideal, terrain": "walk --plant ideal --steps 1 --mass-scale 1.05 --terrain slope:angle=4",
}


@pytest.fixture
def held(monkeypatch):
    """What each run holds: plant, controller and options."""
    found, finish = [], LiveRun.finish

    def looking(run, progress):
        found.append((run.plant, run.controller, run._o))
        return finish(run, progress)

    monkeypatch.setattr(LiveRun, "finish", looking)
    return found


def _command(line, folder, *more):
    command, *words = line.split()
    status = main([command, *words, *more, "--no-figures", "--output", str(folder)])
    assert status == 0
    return load_record(folder / "run.npz")


@pytest.mark.parametrize("line", LINES.values(), ids=LINES)
@pytest.mark.slow(seconds=4)
def test_the_file_holds_what_the_run_used_and_repeats_it(line, held, tmp_path):
    first = _command(line, tmp_path / "first")
    file = tmp_path / "first" / "run.toml"
    command = line.split()[0]
    again = main(
        [command, "--config", str(file), "--no-figures", "--output", str(tmp_path / "again")]
    )
    assert again == 0
    second = load_record(tmp_path / "again" / "run.npz")
    for f in fields(first):
        if f.name != "metadata" and not f.name.endswith("_seconds"):
            one, other = (getattr(record, f.name) for record in (first, second))
            np.testing.assert_array_equal(one, other, err_msg=f.name)
    assert file.read_text() == (tmp_path / "again" / "run.toml").read_text()

    written = Experiment.load(file)
    assert len(held) == 2
    for plant, controller, options in held:
        assert isinstance(plant, Plant)
        for name in ("pushes", "sensors", "delay", "course", "falls", "record_every"):
            assert getattr(options, name) == getattr(written, name)
        scale = Scale.of(controller.parameters)
        tuning = written.controller
        tuning = replace(tuning, phases=tuning.phase_table())
        assert controller.options == scaled(tuning, scale)
        kinds = type(written.planner)
        used = [
            planner.options
            for planner in controller.supervisor.planners.values()
            if type(getattr(planner, "options", None)) is kinds
        ]
        assert scaled(written.planner, scale) in used
        assert plant.options == written.world


def test_the_default_is_the_robots_own_and_a_given_one_is_kept():
    free = RobotSpec("bolt", free=True)
    assert Experiment(free).resolved().planner == FREE_PLANNER
    assert Experiment(free).resolved().controller == EmbeddingOptions.of_kind("free")
    assert Experiment().resolved().planner == LqrOptions()
    assert Experiment().resolved().controller == EmbeddingOptions()
    given = Experiment(free, planner=LqrOptions())
    assert given.resolved().planner == LqrOptions()
    (planner,) = given.prepare().planners.values()
    assert planner.options == scaled(LqrOptions(), Scale.of(planner.gait.parameters))


@pytest.mark.parametrize("gait", [GaitSpec(), GaitSpec("run", 3.0)])
def test_a_trial_is_written_with_the_planner_that_it_has(gait, tmp_path):
    config, ready = CampaignConfig(Experiment(motion=gait)).trial(0)
    written = Experiment.load(config.save(tmp_path / "trial.toml"))
    (planner,) = ready.planners.values()
    assert planner.options == scaled(written.planner, Scale.of(planner.gait.parameters))


def test_a_free_trial_is_written_with_the_planner_that_it_has(tmp_path):
    conditions = CampaignConfig(Experiment(RobotSpec("bolt", free=True), GaitSpec(speed=0.6)))
    config, ready = conditions.trial(0)
    written = Experiment.load(config.save(tmp_path / "trial.toml"))
    assert written.planner == FREE_PLANNER
    (planner,) = ready.planners.values()
    assert planner.options == scaled(FREE_PLANNER, Scale.of(planner.gait.parameters))


@pytest.mark.parametrize("free", [False, True])
def test_tuning_of_the_other_kind_of_robot_is_refused(free):
    kind, right = ("planar", "free") if free else ("free", "planar")
    tuning = EmbeddingOptions.of_kind(kind)
    had = "has a floating base" if free else "is held in its plane"
    experiment = Experiment(RobotSpec("bolt", free=free), controller=tuning)
    told = rf"{had}, and its embedding has options of kind '{kind}' .*: give .*'{right}'"
    with pytest.raises(ParameterError, match=told):
        simulate(experiment)
