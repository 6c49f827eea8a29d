"""Raising disturbances until a walk breaks, and ``template-control robustness``."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import template_control as tc
from template_control import settings
from template_control.cli import robustness as command
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.planners.planner import Context
from template_control.errors import ParameterError, RobotError, SweepError
from template_control.plant.mujoco import MujocoOptions
from template_control.robot.library import load_robot
from template_control.robot.spec import RobotSpec
from template_control.robustness import disturbances
from template_control.robustness import severity_sweep as robustness
from template_control.robustness.disturbances import (
    AFTER,
    BEGIN,
    DISTURBANCES,
    LATERAL_PUSHES,
    footholds,
)
from template_control.robustness.findings import Finding, Level, wilson_interval
from template_control.robustness.severity_sweep import (
    SETTLED,
    gait_errors,
    measure,
    template_limit,
    trial,
)
from template_control.run.experiment import Experiment, perturbed_start
from template_control.run.options import FallOptions
from template_control.run.simulation import simulate
from template_control.run.specs import GaitSpec
from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.dynamics.stride import simulate_stride
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.slip.similarity import Scale
from template_control.view.trial_figures import robustness_figure

BY_NAME = {d.name: d for d in DISTURBANCES}


@pytest.fixture
def undisturbed(long_walk):
    return long_walk


# -- what a disturbance is -------------------------------------------------------------


def test_levels_are_those_of_a_walk_of_the_same_dimensionless_robot():
    small = SlipParameters(mass=5.0, rest_length=0.25, leg_stiffness=16500.0 * 5 / 80 / 0.25)
    time = 0.5  # sqrt(l0 / g), and so the speeds
    for name, factor in (
        ("push-forward", 5.0 / 80.0 * time),
        ("step-down", 0.25),
        ("friction", 1.0),
        ("heavier", 1.0),
        ("noise", 1.0),
    ):
        d = BY_NAME[name]
        assert d.levels_for(SlipParameters()) == pytest.approx(d.levels)
        assert d.levels_for(small) == pytest.approx(factor * np.array(d.levels))
    # Whole physics steps: 1.4, 2.8, 4.2, ... ms.
    long = SlipParameters(rest_length=0.49, leg_stiffness=16500.0 / 0.49)
    assert BY_NAME["delay"].levels_for(long)[:4] == pytest.approx([1e-3, 3e-3, 4e-3, 6e-3])
    tiny = SlipParameters(rest_length=0.01, leg_stiffness=1.65e6)
    assert BY_NAME["delay"].levels_for(tiny) == pytest.approx([1e-3, 2e-3, 3e-3, 4e-3, 5e-3])


def test_levels_are_round_and_grow_more_severe():
    for d in DISTURBANCES:
        assert len(set(np.sign(np.diff(d.levels)))) == 1
    assert BY_NAME["push-forward"].levels[:3] == (5.0, 10.0, 15.0)
    assert BY_NAME["step-up"].levels[1:4] == (0.01, 0.02, 0.03)
    assert BY_NAME["lighter"].shown(-0.2) == "20 %"
    assert BY_NAME["friction"].shown(0.55) == "0.55"


def test_options_hold_the_level(robot, gait, monkeypatch):
    # Where the robot really treads is the next test's.
    monkeypatch.setattr(
        disturbances, "footholds", lambda e, _, steps: e.gait.step_length * np.arange(steps + 1)
    )
    where = Experiment(robot, planner=LqrPlanner(gait)).prepare()

    def of(name, level, number=2):
        return BY_NAME[name].experiment(where, level, number)

    (push,) = of("push-forward", 15.0).pushes
    assert (push.impulse, push.step, push.phase, push.duration) == (15.0, BEGIN, 0.2, 0.1)
    assert of("push-backward", 15.0).pushes[0].impulse == -15.0
    assert of("push-backward", 15.0).steps == BEGIN + 1 + AFTER
    assert of("step-up", 0.03).world.terrain.points[1][1] == 0.03
    assert of("step-down", 0.03).world.terrain.points[1][1] == -0.03
    edges = [of("step-up", 0.03, number).world.terrain.points[0][0] for number in (0, 4)]
    assert edges == pytest.approx([4.3 * gait.step_length, 4.7 * gait.step_length])
    assert of("friction", 0.4).world.friction == 0.4
    assert of("heavier", 0.2).world.mass_scale == pytest.approx(1.2)
    assert of("lighter", -0.2).world.mass_scale == pytest.approx(0.8)
    assert of("torque", 0.7).controller.qp.torque_scale == 0.7
    noise = of("noise", 1e-3, 4).sensors
    assert (noise.deviations(Scale(1.0, 1.0)), noise.seed) == ((1e-3, 0.02), 4)
    assert of("delay", 4e-3).delay_ticks == 4
    starts = {of("delay", 4e-3, i).start for i in range(5)}
    assert len(starts) == 5
    assert of("delay", 4e-3).steps == AFTER


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 4])
def test_the_edge_of_a_step_lies_between_two_footholds(robot, gait, number):
    where = Experiment(robot, planner=LqrPlanner(gait)).prepare()
    stepped = BY_NAME["step-up"].experiment(where, 0.001, number)
    edge = stepped.world.terrain.points[0][0]
    record = simulate(replace(stepped, steps=8))
    at = np.searchsorted(record.time, record.section_time)
    foothold = record.foot[at, record.rear[at]]
    beyond = int(np.argmax(foothold[:, 0] > edge))
    assert beyond == 5
    share = (edge - foothold[4, 0]) / (foothold[5, 0] - foothold[4, 0])
    assert share == pytest.approx(0.3 + 0.1 * number, abs=0.02)
    np.testing.assert_allclose(foothold[[4, 5], 1], [0.0, 0.001], atol=1e-4)


# -- what a trial is -------------------------------------------------------------------


def test_the_error_of_a_walk_is_that_of_its_last_five_steps(undisturbed, default_gait):
    gait = default_gait
    errors = gait_errors(undisturbed, gait)
    last = undisturbed.time >= undisturbed.section_time[-6]
    speed = undisturbed.com_velocity[last, 0].mean()
    assert errors[0] == pytest.approx(speed / gait.mean_speed - 1.0, abs=1e-3)
    height = np.mean([z[1] for z in undisturbed.section_state[-5:]])
    assert errors[1] == pytest.approx(height / gait.vlo[1] - 1.0)
    slower = replace(gait, step_length=0.9 * gait.step_length)
    assert gait_errors(undisturbed, slower)[0] == pytest.approx((1.0 + errors[0]) / 0.9 - 1.0)


def test_footholds_of_a_run_are_where_its_feet_bear(robot):
    gait = tc.running_gait(tc.template_for(robot), 3.0)
    where = Experiment(robot, planner=tc.RunningPlanner(gait)).prepare()
    holds = footholds(where, perturbed_start(gait, 0), 3)
    assert len(holds) == 3
    assert np.diff(holds) == pytest.approx(gait.step_length, rel=0.1)


def test_a_trial_of_no_disturbance_is_refused():
    with pytest.raises(ParameterError, match="disturbance is 'wind': give one of push-forward, "):
        trial(Experiment(), "wind", 1.0, 0)


@pytest.mark.slow(seconds=6)
def test_trials_of_a_run_succeed_and_know_its_speed():
    good = trial(Experiment(motion=GaitSpec("run", 3.0)), "step-down", 0.01, 1)
    assert not good["fell"]
    assert abs(good["speed_error"]) < 0.02
    assert abs(good["height_error"]) < 0.02


@pytest.mark.slow(seconds=3)
def test_trials_fall_alike():
    bad = trial(Experiment(), "torque", 0.5, 0)
    assert bad["fell"]
    assert bad["reason"]
    assert bad["speed_error"] is None
    assert trial(Experiment(), "torque", 0.5, 0) == bad


# -- where it breaks -------------------------------------------------------------------


def finding(*rates, name="delay"):
    """Levels 1, 2, ... with these numbers of successes in four trials."""
    levels = (Level(float(i + 1), n, 4 - n, 0) for i, n in enumerate(rates))
    return Finding(BY_NAME[name], tuple(levels))


@pytest.mark.parametrize(
    ("rates", "breaking", "half", "broken"),
    [
        ((), None, None, False),
        ((4, 4), 2.0, 2.0, False),
        ((4, 3, 4), 1.0, 3.0, False),  # a better level later does not count
        ((4, 3, 1), 1.0, 2.0, False),
        ((4, 1, 3, 1), 1.0, 1.0, False),
        ((4, 1, 1), 1.0, 1.0, True),
        ((4, 2, 0), 1.0, 2.0, True),
        ((0,), None, None, True),
        ((2, 1), None, 1.0, False),
    ],
)
def test_breaking_points(rates, breaking, half, broken):
    found = finding(*rates)
    assert (found.breaking_point, found.half_point, found.broken) == (breaking, half, broken)
    assert found.standing_point == breaking  # all that fail have fallen


def test_a_walk_off_its_gait_fails_but_does_not_break():
    delay = BY_NAME["delay"]
    levels = (Level(1.0, 4, 0, 0), Level(2.0, 0, 0, 4), Level(3.0, 0, 0, 4), Level(4.0, 0, 1, 3))
    found = Finding(delay, levels)
    assert (found.breaking_point, found.half_point, found.standing_point) == (1.0, 1.0, 3.0)
    assert not found.broken
    assert Finding(delay, (*levels, Level(5.0, 0, 4, 0))).broken


def made_up(experiment, disturbance, level, number):
    """Falls from 10 % mass on, is off its gait from a step of 3 cm on in two trials of five."""
    fell = disturbance == "heavier" and level > 0.25
    error = 0.03 if number < 2 and level > 0.025 else -0.01
    error = None if fell else error
    return {"fell": fell, "reason": "", "steps": 3, "speed_error": error, "height_error": error}


def not_to_be_called(experiment, disturbance, level, number):
    raise AssertionError("this trial was finished before")


@pytest.fixture
def cheap(monkeypatch, undisturbed):
    """``measure`` with made-up trials in threads of this process."""
    monkeypatch.setattr(robustness, "_undisturbed", lambda *_: undisturbed)
    monkeypatch.setattr(robustness, "trial", made_up)

    def run(*arguments, **options):
        with ThreadPoolExecutor(1) as pool:
            return measure("five-link", *arguments, executor=pool, progress=False, **options)

    return run


@pytest.mark.slow(seconds=1)
def test_levels_rise_until_the_walk_breaks(cheap, tmp_path, monkeypatch):
    found = cheap(["heavier", "step-down"], tmp_path)
    down, heavier = found.findings
    assert [d.disturbance.name for d in found.findings] == ["step-down", "heavier"]
    assert heavier.breaking_point == pytest.approx(0.2)
    assert heavier.half_point == pytest.approx(0.2)
    assert [level.rate for level in heavier.levels] == [1.0, 1.0, 0.0]
    assert heavier.levels[-1].fell == 5
    # Never fewer than half: raised to the last level.
    assert [level.level for level in down.levels] == pytest.approx(BY_NAME["step-down"].levels)
    assert down.breaking_point == pytest.approx(0.02)
    assert down.half_point == pytest.approx(0.08)
    assert (down.levels[-1].fell, down.levels[-1].off_gait) == (0, 2)
    # The same again takes everything from the files.
    monkeypatch.setattr(not_to_be_called, "__module__", made_up.__module__)
    monkeypatch.setattr(not_to_be_called, "__qualname__", made_up.__qualname__)
    monkeypatch.setattr(robustness, "trial", not_to_be_called)
    assert cheap(["heavier", "step-down"], tmp_path).findings == found.findings


def test_lasting_disturbances_need_not_end_on_the_gait(cheap):
    (heavier,) = cheap(["heavier"], quick=True).findings
    assert [level.rate for level in heavier.levels] == [1.0, 1.0]
    assert heavier.disturbance.trials == 2


def test_files_are_of_this_robot_and_these_trials(cheap, tmp_path, monkeypatch):
    cheap(["heavier"], tmp_path, quick=True)
    first = set(tmp_path.glob("*.jsonl"))
    cheap(["lighter"], tmp_path, quick=True)
    second = set(tmp_path.glob("*.jsonl")) - first
    stiff = load_robot("five-link")
    stiff.urdf += "<!-- another -->"
    gait = tc.default_gait(stiff)
    where = Experiment(stiff, planner=LqrPlanner(gait)).prepare()
    monkeypatch.setattr(Experiment, "prepare", lambda _: where)
    cheap(["heavier"], tmp_path, quick=True)
    third = set(tmp_path.glob("*.jsonl")) - first - second
    assert len(first) == len(second) == len(third) == 2


def broken(experiment, disturbance, level, number):
    raise RobotError("no such leg")


def test_a_trial_that_fails_otherwise_is_no_fall(cheap, monkeypatch):
    monkeypatch.setattr(robustness, "trial", broken)
    with pytest.raises(SweepError, match=r"heavier.*no such leg"):
        cheap(["heavier"], quick=True)


def test_unknown_disturbances_are_named():
    with pytest.raises(ParameterError, match=r"wind.*push-forward"):
        measure("five-link", ["wind"])
    with pytest.raises(ParameterError, match=r"push-left.*push-forward"):
        measure("five-link", ["push-left"])


def test_a_free_robot_is_pushed_aside_too():
    bolt = tc.load_floating_robot("bolt")
    gait = tc.robot_gait_for_speed(bolt, 0.55)
    planner = LqrPlanner(gait, tc.embedding.FREE_PLANNER)
    where = Experiment(bolt, planner=planner).prepare()
    turned = {d.name: d.experiment(where, 0.1, 3).pushes[0].direction for d in LATERAL_PUSHES}
    assert turned == {"push-left": np.pi / 2, "push-right": -np.pi / 2}
    weak = BY_NAME["torque"].experiment(where, 0.9, 0).controller
    assert weak.kind == "free"
    assert weak.qp.torque_scale == 0.9


@pytest.mark.slow(seconds=4)
def test_trials_of_a_free_robot():
    bolt = Experiment(RobotSpec("bolt", free=True), GaitSpec(speed=0.55))
    found = robustness.trial(settings.to_table(bolt), "noise", 1e-3, 0)
    assert not found["fell"]
    assert abs(found["speed_error"]) < 0.04


def test_figure_shows_every_disturbance(cheap):
    found = cheap(quick=True)
    panels = robustness_figure(found).axes
    assert [axes.get_title() for axes in panels] == [d.title for d in DISTURBANCES]
    inverted = {axes.get_title() for axes in panels if axes.xaxis_inverted()}
    assert inverted == {"friction", "torque limits"}
    heavier = next(axes for axes in panels if axes.get_title() == "heavier")
    np.testing.assert_allclose(heavier.lines[0].get_xydata(), [[10.0, 100.0], [20.0, 100.0]])


def test_markdown_says_where_it_breaks(cheap):
    text = command.report(cheap(["heavier", "lighter", "step-up"])).markdown()
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| ")]
    most, sure = "8 cm or more", "57 to 100 %"  # Wilson's interval of 5 of 5
    assert rows[2] == ["| step up", "5", "2 cm", sure, most, most, "", "3 cm: 2 off its gait |"]
    assert rows[3] == ["| heavier", "5", "20 %", sure, "20 %", "20 %", "", "30 %: 5 fell |"]
    most = "90 % or more"
    assert rows[4] == ["| lighter", "5", most, sure, most, most, "", " |"]


def test_every_level_says_how_sure_it_is(cheap):
    (heavier,) = command.data(cheap(["heavier"]))["disturbances"].values()
    good, _, bad = (level["interval"] for level in heavier["levels"])
    assert good == wilson_interval(5, 5)
    assert bad == wilson_interval(0, 5)


# -- the template alone ----------------------------------------------------------------


def come_back(gait, planner, impulse):
    """Whether the template, pushed at its section, is on its gait 20 strides later."""
    planner.reset()
    z = gait.vlo + [impulse / gait.parameters.mass, 0.0, 0.0]
    for _ in range(20):
        u = planner.decide(Context(z)).controls
        stride = simulate_stride(gait.parameters, STRIDE_START[gait.stride], VLO.state(z), u)
        if not stride.completed:
            return False
        z = VLO.of(stride.state)
    return bool(np.all(abs(z[:2] / gait.vlo[:2] - 1.0) < SETTLED))


@pytest.mark.slow(seconds=2)
@pytest.mark.parametrize(("name", "sign"), [("push-forward", 1.0), ("push-backward", -1.0)])
def test_the_template_has_a_limit_to_pushes(robot, gait, name, sign):
    planner = LqrPlanner(gait)
    limit = template_limit(
        BY_NAME[name], Experiment(robot, planner=planner).prepare(), AFTER, SETTLED
    )
    levels = [level for level in BY_NAME[name].levels_for(gait.parameters) if level <= limit + 5.1]
    back = [come_back(gait, planner, sign * level) for level in levels]
    assert back == [True] * (len(levels) - 1) + [False]


def test_the_template_has_no_friction(robot, gait):
    where = Experiment(robot, planner=LqrPlanner(gait)).prepare()
    assert template_limit(BY_NAME["friction"], where, AFTER, SETTLED) is None


def test_a_limit_below_the_mildest_level_is_none_of_them(robot, gait):
    where = Experiment(robot, planner=LqrPlanner(gait)).prepare()
    assert template_limit(BY_NAME["push-forward"], where, AFTER, 0.0) == 0.0


# -- the engine ------------------------------------------------------------------------


@pytest.mark.slow
def test_trials_go_in_the_engine_that_is_asked_for():
    worlds = tc.PlantOptions(), MujocoOptions()
    one, other = (trial(Experiment(world=w), "push-backward", 15.0, 3) for w in worlds)
    assert [one["fell"], other["fell"]] == [False, False]
    assert one["steps"] == BEGIN + 1 + AFTER
    assert abs(one["speed_error"]) < 0.02
    assert one["speed_error"] != other["speed_error"]
    assert one["speed_error"] == pytest.approx(other["speed_error"], abs=0.01)


def test_options_keep_the_world(robot, gait):
    plant = MujocoOptions(contact_time=5e-3)
    where = Experiment(robot, planner=LqrPlanner(gait), world=plant).prepare()
    for d in DISTURBANCES:
        if d.name.startswith("step"):
            continue  # walks first, to know its footholds
        world = d.experiment(where, d.levels[0], 0).world
        assert replace(world, friction=plant.friction, mass_scale=1.0) == plant


@pytest.mark.parametrize(
    ("successes", "trials", "expected"),
    # Newcombe (1998), Table I, method 3.
    [(81, 263, (0.2553, 0.3662)), (15, 148, (0.0624, 0.1605)), (0, 20, (0.0, 0.1611))],
)
def test_wilsons_interval_is_the_published_one(successes, trials, expected):
    assert wilson_interval(successes, trials) == pytest.approx(expected, abs=5e-5)
    low, high = wilson_interval(trials - successes, trials)
    assert (1.0 - high, 1.0 - low) == pytest.approx(expected, abs=5e-5)


def test_more_successes_than_trials_are_refused():
    with pytest.raises(ParameterError, match="successes are 3 of 2 trials"):
        wilson_interval(3, 2)


# -- a simulation that diverges --------------------------------------------------------


def test_a_base_that_no_leg_threw_so_fast_is_a_simulation_that_diverged(robot, gait):
    falls = FallOptions(thrown=0.3)  # slower than this robot walks
    record = simulate(Experiment(robot, planner=LqrPlanner(gait), steps=2, falls=falls))
    assert record.fell
    assert "diverged" in record.fall_reason


@pytest.mark.slow
def test_a_trial_that_diverges_is_a_fall():
    """With long delays bolt was foreseen 1e16 m above the ground; the report ended there."""
    assert trial(Experiment("bolt"), "delay", 0.016, 0)["fell"]
