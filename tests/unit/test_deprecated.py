"""Deprecated public names: each still works, warns at the caller's line, and names the new one."""

import importlib

import pytest

import template_control as tc
from template_control.deprecated import ADAPTED, DEPRECATED
from template_control.embedding.standing.planners import standing_planners
from template_control.slip.scenario.route import SteadyRoute

OLD_NAMES = {
    "template_control.Course",
    "template_control.embedding.BreakingPlanner",
    "template_control.embedding.ChangePlanner",
    "template_control.embedding.ForgettingPlanner",
    "template_control.embedding.Free",
    "template_control.embedding.FreeController",
    "template_control.embedding.FreeControls",
    "template_control.embedding.LandingPlanner",
    "template_control.embedding.PricingPlanner",
    "template_control.embedding.rehearse",
    "template_control.embedding.SlopePlanner",
    "template_control.embedding.SpeedChangePlanner",
    "template_control.embedding.StandPlanner",
    "template_control.embedding.StartPlanner",
    "template_control.embedding.StopPlanner",
    "template_control.load_free_robot",
    "template_control.robot.FREE_ROBOTS",
    "template_control.robot.free_state_in",
    "template_control.robot.FreeBiped",
    "template_control.robot.FreeFiveLink",
    "template_control.robot.FreePose",
    "template_control.robot.load_free_robot",
    "template_control.robustness.ASIDE",
    "template_control.robustness.Conditions",
    "template_control.robustness.Draw",
    "template_control.robustness.first_wrong",
    "template_control.robustness.FREE_MIX",
    "template_control.robustness.Mix",
    "template_control.RunInterrupted",
    "template_control.SpeedCommand",
    "template_control.run.Course",
    "template_control.run.FreeRecord",
    "template_control.run.GaitChoice",
    "template_control.run.RobotChoice",
    "template_control.run.RobotSpec",
    "template_control.slip.CatchOptions",
    "template_control.whole_body.Wanted",
}


def test_no_deprecated_name_is_lost():
    assert set(DEPRECATED) == OLD_NAMES


@pytest.mark.parametrize("old", sorted(OLD_NAMES))
def test_a_deprecated_name_is_the_new_object_and_warns(old):
    package, _, name = old.rpartition(".")
    home, _, new = DEPRECATED[old].partition(":")
    home, package = importlib.import_module(home), importlib.import_module(package)
    assert new in home.__all__
    assert name not in package.__all__
    with pytest.warns(DeprecationWarning, match=f"use {home.__name__}.{new}$") as caught:
        assert getattr(package, name) is getattr(home, new)
    assert {warning.filename for warning in caught} == {__file__}


ADAPTED_NAMES = {
    "template_control.RunConfig",
    "template_control.SimulationOptions",
    "template_control.robustness.Situation",
    "template_control.robustness.Subject",
    "template_control.run.RunConfig",
    "template_control.run.SimulationOptions",
}


def test_no_adapted_name_is_lost():
    assert set(ADAPTED) == ADAPTED_NAMES


def _old(name):
    with pytest.warns(DeprecationWarning, match=r"use template_control.Experiment$") as caught:
        found = getattr(tc, name) if "." not in name else getattr(tc.robustness, name[11:])
    assert {warning.filename for warning in caught} == {__file__}
    return found


def test_what_described_a_run_makes_an_experiment(robot, tmp_path):
    options = _old("SimulationOptions")(5, plant=tc.IdealOptions(), embedding=None, delay=0.002)
    assert options == tc.Experiment(steps=5, world=tc.IdealOptions(), delay=0.002)
    gait = tc.run.GaitSpec("run")
    config = _old("RunConfig")(tc.robot.RobotSpec("runner"), gait, simulation=options)
    assert config == tc.Experiment("runner", gait, steps=5, world=tc.IdealOptions(), delay=0.002)
    path = config.save(tmp_path / "run.toml")
    assert _old("RunConfig").load(path) == config.resolved()
    subject = _old("robustness.Subject")("bolt", 2.0, "mujoco")
    assert subject == tc.Experiment("bolt", tc.run.GaitSpec("run", 2.0), world=tc.MujocoOptions())
    planner = tc.LqrPlanner(tc.default_gait(robot))
    situation = _old("robustness.Situation")(robot, planner.gait, planner)
    assert (situation.robot, situation.planner, situation.gait) == (robot, planner, planner.gait)


def test_the_old_call_is_the_new_one(robot):
    planner = tc.LqrPlanner(tc.default_gait(robot))
    new = tc.simulate(tc.Experiment(robot, planner=planner, steps=1))
    done = []
    with pytest.warns(DeprecationWarning, match="use simulate"):
        old = tc.simulate(robot, planner, tc.Experiment(steps=1), progress=done.append)
    assert (old.q == new.q).all()
    assert done == [1]


def test_a_file_of_the_first_version_is_read(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text(
        '[robot]\nmodel = "bolt"\n[gait]\nname = "run"\nspeed = 2.0\n[simulation]\nsteps = 3\n'
        '[simulation.plant]\nkind = "mujoco"\nfriction = 0.6\n'
        '[simulation.embedding]\nkind = "planar"\nfriction = 0.6\n'
        "[[simulation.pushes]]\nimpulse = 1.0\nstep = 2\n"
    )
    assert tc.Experiment.load(path) == tc.Experiment(
        "bolt",
        tc.run.GaitSpec("run", 2.0),
        controller=tc.EmbeddingOptions(friction=0.6),
        world=tc.MujocoOptions(friction=0.6),
        pushes=(tc.Push(1.0, 2),),
        steps=3,
    )


def test_an_import_of_a_deprecated_name_warns_at_its_line():
    with pytest.warns(DeprecationWarning, match="load_floating_robot") as caught:
        from template_control import load_free_robot  # noqa: F401
    assert {warning.filename for warning in caught} == {__file__}


def test_an_unknown_name_is_no_attribute():
    import template_control

    with pytest.raises(AttributeError, match="no_such_name"):
        _ = template_control.no_such_name


def test_the_old_call_takes_planners_by_kind_of_stride(robot):
    planners = standing_planners(tc.template_for(robot))
    route = SteadyRoute(tc.template_for(robot), "s", planners["s"].gait.state)
    new = tc.simulate(tc.Experiment(robot, route, planner=planners, steps=1))
    with pytest.warns(DeprecationWarning, match="use simulate"):
        old = tc.simulate(robot, route, tc.Experiment(steps=1), planners=planners)
    assert (old.q == new.q).all()
