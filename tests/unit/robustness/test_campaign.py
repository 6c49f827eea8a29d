"""Campaigns: draws from a mix, trials as runs, and ``template-control campaign``."""

import json
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from json_page import undocumented, unprinted
from places import DOCS

from template_control import settings
from template_control.cli import campaign as command
from template_control.cli.main import main
from template_control.errors import ParameterError
from template_control.robot.spec import RobotSpec
from template_control.robustness import (
    FLOATING_MIX,
    Campaign,
    CampaignConfig,
    DisturbanceDistribution,
    DisturbanceSample,
    Trial,
    fall_cause,
)
from template_control.run.experiment import Experiment
from template_control.run.record import Record
from template_control.view.trial_figures import campaign_figure

PAGE = (DOCS / "guides" / "campaign.md").read_text()
RANGES = [f.name for f in fields(DisturbanceDistribution) if f.name not in ("within", "after")]


@given(seed=st.integers(0, 2**64 - 1), factor=st.floats(0.0, 1.3))
def test_a_draw_is_within_its_mix(seed, factor):
    mix = DisturbanceDistribution().times(factor)
    draw = mix.draw(seed)
    assert draw == mix.draw(seed)
    for name in RANGES:
        low, high = getattr(mix, name)
        assert low <= getattr(draw, name) <= high
    for at in (draw.push_at, draw.ground_step_at):
        assert mix.within[0] <= at <= mix.within[1]
    assert 0.0 <= mix.severity(draw) <= 1.0 + 1e-12


def test_draws_fill_their_ranges():
    mix = DisturbanceDistribution()
    draws = [mix.draw(seed) for seed in range(400)]
    for name in RANGES:
        low, high = getattr(mix, name)
        drawn = np.array([getattr(d, name) for d in draws])
        assert np.mean(drawn) == pytest.approx(0.5 * (low + high), abs=0.08 * (high - low) + 1e-12)
        assert np.ptp(drawn) >= 0.97 * (high - low)


def test_severity_is_the_share_of_the_range_that_is_used():
    mix = DisturbanceDistribution()
    assert mix.severity(DisturbanceSample()) == 0.0
    worst = DisturbanceSample(**{name: getattr(mix, name)[1] for name in RANGES})
    assert mix.severity(worst) == pytest.approx(1.0)
    # Noise is the same in all trials: seven ranges are left.
    assert mix.severity(DisturbanceSample(push=-10.0)) == pytest.approx(0.5 / np.sqrt(7))
    assert mix.severity(DisturbanceSample(friction=0.6)) == pytest.approx(0.5 / np.sqrt(7))


def test_a_mix_of_no_severity_disturbs_nothing():
    draw = DisturbanceDistribution().times(0.0).draw(3)
    assert replace(draw, push_at=0.0, ground_step_at=0.0) == DisturbanceSample()


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"push": (5.0, -5.0)}, "DisturbanceDistribution.push is [5.0, -5.0]"),
        ({"within": (3, 3)}, "DisturbanceDistribution.within is [3, 3]"),
        ({"friction": (0.0, 1.0)}, "friction is"),
        ({"mass": (-1.0, 1.0)}, "DisturbanceDistribution.mass"),
        ({"noise": (-1e-3, 1e-3)}, "DisturbanceDistribution.noise"),
        ({"delay": (0.0, float("nan"))}, "DisturbanceDistribution.delay"),
    ],
)
def test_a_mix_that_cannot_be_is_refused(wrong, told):
    with pytest.raises(ParameterError) as error:
        DisturbanceDistribution(**wrong)
    assert told in str(error.value)


def test_a_trial_is_a_run_that_its_file_repeats(tmp_path):
    conditions = CampaignConfig(seed=5)
    config, ready = conditions.trial(3)
    draw = conditions.draw(3)
    assert config.steps == 26
    assert config.world.friction == draw.friction
    assert config.world.mass_scale == 1.0 + draw.mass
    assert config.start[0] == pytest.approx(ready.gait.vlo[0] * (1.0 + draw.speed))
    (push,) = config.pushes
    assert push.impulse == pytest.approx(draw.push)
    assert push.step + push.phase == pytest.approx(draw.push_at)
    assert Experiment.load(config.save(tmp_path / "trial.toml")) == config
    assert settings.from_table(CampaignConfig, settings.to_table(conditions)) == conditions
    assert conditions.trial(4)[0] != config


def test_a_small_robot_is_disturbed_as_a_small_one():
    draw, conditions = CampaignConfig().draw(0), CampaignConfig(Experiment("bolt"))
    config, ready = conditions.trial(0)
    p = ready.gait.parameters
    length, time = p.rest_length, np.sqrt(p.rest_length * 9.81 / p.gravity)
    (push,) = config.pushes
    assert push.impulse == pytest.approx(draw.push * p.mass / 80.0 * length / time)
    assert push.duration == pytest.approx(0.1 * time)
    assert config.delay <= draw.delay * time + 0.5e-3


def test_a_free_robot_is_pushed_from_all_sides(tmp_path):
    conditions = CampaignConfig(Experiment(RobotSpec("bolt", free=True)), mix=FLOATING_MIX, seed=2)
    config, _ = conditions.trial(1)
    draw = conditions.draw(1)
    (push,) = config.pushes
    assert push.direction == pytest.approx(np.radians(draw.direction))
    assert config.robot.free
    assert Experiment.load(config.save(tmp_path / "trial.toml")) == config
    directions = [FLOATING_MIX.draw(seed).direction for seed in range(200)]
    assert min(directions) < -170.0
    assert max(directions) > 170.0
    # Without directions the other numbers are drawn as they always were.
    planar = replace(FLOATING_MIX, direction=(0.0, 0.0)).draw(7)
    assert replace(FLOATING_MIX.draw(7), direction=0.0) == planar
    assert FLOATING_MIX.times(2.0).direction == FLOATING_MIX.direction
    with pytest.raises(ParameterError, match=r"the mix has the direction .* is held"):
        CampaignConfig(mix=FLOATING_MIX)


@pytest.mark.slow(seconds=1)
def test_shares_and_figure_of_a_campaign():
    conditions = CampaignConfig()
    trials = tuple(
        Trial(
            number=i,
            fell=i % 10 == 0,
            reason="the hip was low" if i % 10 == 0 else "",
            first="slip" if i % 10 == 0 else "",
            speed_error=None if i % 10 == 0 else 0.05 * (i % 10 == 1),
            draw=conditions.draw(i),
            severity=conditions.mix.severity(conditions.draw(i)),
        )
        for i in range(40)
    )
    found = Campaign(conditions, trials)
    assert len(found.fell) == 4
    assert len(found.off_gait) == 4
    assert found.reasons == {"slip": 4}
    low, high = found.interval(found.fell)
    assert low < 0.1 < high
    panels = _panels(found)
    assert len(panels) == 8  # severity, and seven ranges with a width
    marks, _, _ = panels[0].containers[0].lines
    assert 0.0 <= float(marks.get_ydata()[0]) <= 100.0
    # Where nearly all go well, a scale from 0 to 100 % would hide the intervals.
    sure = replace(found, trials=tuple(t for t in trials if t.good))
    for shown in (panels, _panels(sure)):
        lows = [
            container.lines[2][0].get_segments()[0][0, 1]
            for panel in shown
            for container in panel.containers
        ]
        bottom, top = shown[0].get_ylim()
        assert min(lows) - 10.0 < bottom < min(lows)
        assert 100.0 < top < 110.0


def _panels(campaign):
    return [axes for axes in campaign_figure(campaign).axes if axes.get_visible()]


def test_what_went_wrong_first(long_walk):
    assert fall_cause(long_walk) == "none of these"
    late = len(long_walk.time) - 400
    slid = long_walk.foot.copy()
    slid[late + 200 :, :, 0] += 0.1
    solved = np.array(long_walk.solved, dtype=bool)
    solved[late + 300] = False
    torque = long_walk.torque.copy()
    torque[late + 100 : late + 150, 0] = long_walk.torque_limit[0]
    force = long_walk.contact_force.copy()
    force[late, 0] = (-200.0, 10.0)
    wrong = replace(long_walk, solved=solved)
    assert fall_cause(wrong) == "failed QP"
    wrong = replace(wrong, foot=slid)
    assert fall_cause(wrong) == "slip"
    wrong = replace(wrong, torque=torque)
    assert fall_cause(wrong) == "torque limit"
    assert fall_cause(replace(wrong, contact_force=force)) == "stumble"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--trials", "0"], "--trials is 0"),
        (["--severity", "nan"], "--severity is nan"),
        (["--severity", "5"], "friction is"),
        (["--workers", "0"], "--workers is 0"),
        (["--mix", "missing.toml"], "missing.toml"),
        (["--robot", "nobody"], "nobody"),
        (["--speed", "9"], "9"),
    ],
)
def test_a_mistake_is_one_line(words, told, refused):
    assert told in refused(["campaign", *words])


def test_a_mix_with_an_unknown_key_is_refused(tmp_path, refused):
    path = tmp_path / "mix.toml"
    path.write_text("wind = [0, 1]\n")
    told = refused(["campaign", "--mix", str(path)])
    assert "wind" in told
    assert "friction" in told


def printed(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.parametrize("line", "".join(printed("sh")).strip().splitlines())
def test_commands_of_the_page_are_understood(line, understood):
    assert understood(line).command == "campaign"


@pytest.mark.slow(seconds=7)
def test_the_snippet_of_the_page_runs(capfd):
    (snippet,) = printed("python")
    exec(snippet, {})
    assert capfd.readouterr().out.startswith("0 (0.0, ")


def test_ctrl_c_says_where_the_trials_are(tmp_path, monkeypatch, capfd):
    def impatient(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "run_campaign", impatient)
    assert main(["campaign", "--output", str(tmp_path)]) == 130
    assert "goes on from there" in capfd.readouterr().err


@pytest.mark.slow(seconds=4)
def test_a_campaign_goes_on_and_its_falls_can_be_repeated(tmp_path, capfd):
    mix = tmp_path / "hard.toml"
    mix.write_text("push = [-160.0, -159.0]\nwithin = [1, 2]\nafter = 5\n")
    words = ["campaign", "--mix", str(mix), "--workers", "1", "--json"]
    words += ["--trials", "2", "--output", str(tmp_path / "out")]
    assert main(words) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["fell"]["count"] == 2
    assert undocumented("campaign", found) == unprinted("campaign", found) == set()
    results = {path: path.read_bytes() for path in (tmp_path / "out").glob("*.jsonl")}
    assert main(words) == 0
    assert json.loads(capfd.readouterr().out) == found
    assert {path: path.read_bytes() for path in (tmp_path / "out").glob("*.jsonl")} == results
    wrong = found["wrong"][0]
    assert Path(found["figure"]).is_file()
    assert wrong["first"]
    again = ["walk", "--config", wrong["config"], "--no-figures", "--json"]
    assert main([*again, "--output", str(tmp_path / "again")]) == 1
    assert json.loads(capfd.readouterr().out)["fall_reason"] == wrong["reason"]
    assert Record.load(tmp_path / "again" / "run.npz").fell
