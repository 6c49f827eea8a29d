"""Deprecated public names: each still works, warns at the caller's line, and names the new one."""

import importlib

import pytest

from template_control.deprecated import DEPRECATED

OLD_NAMES = {
    "template_control.Course",
    "template_control.embedding.apex_pose",
    "template_control.embedding.ApexStart",
    "template_control.embedding.BreakingPlanner",
    "template_control.embedding.ChangePlanner",
    "template_control.embedding.check_feasibility",
    "template_control.embedding.ContactOptions",
    "template_control.embedding.default_gait",
    "template_control.embedding.FloatingSnapshot",
    "template_control.embedding.ForgettingPlanner",
    "template_control.embedding.Free",
    "template_control.embedding.FreeController",
    "template_control.embedding.FreeControls",
    "template_control.embedding.FreeOptions",
    "template_control.embedding.FrictionOptions",
    "template_control.embedding.gaits_by_speed",
    "template_control.embedding.LandingPlanner",
    "template_control.embedding.paper_gait",
    "template_control.embedding.PricingPlanner",
    "template_control.embedding.rehearse",
    "template_control.embedding.robot_gait_for_speed",
    "template_control.embedding.robot_route",
    "template_control.embedding.SlopePlanner",
    "template_control.embedding.SpeedChangePlanner",
    "template_control.embedding.StandPlanner",
    "template_control.embedding.StartPlanner",
    "template_control.embedding.StepPlanner",
    "template_control.embedding.StopPlanner",
    "template_control.embedding.template_for",
    "template_control.embedding.walking_speeds",
    "template_control.load_free_robot",
    "template_control.robot.FloatingBasePose",
    "template_control.robot.FreeBiped",
    "template_control.robot.FreePose",
    "template_control.robot.FREE_ROBOTS",
    "template_control.robot.free_state_in",
    "template_control.robot.load_free_robot",
    "template_control.robustness.ASIDE",
    "template_control.robustness.Conditions",
    "template_control.robustness.Draw",
    "template_control.robustness.first_wrong",
    "template_control.robustness.FREE_MIX",
    "template_control.robustness.Mix",
    "template_control.run.Course",
    "template_control.run.FreeRecord",
    "template_control.run.GaitChoice",
    "template_control.run.RobotChoice",
    "template_control.run.RobotSpec",
    "template_control.RunInterrupted",
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


def test_an_import_of_a_deprecated_name_warns_at_its_line():
    with pytest.warns(DeprecationWarning, match="load_floating_robot") as caught:
        from template_control import load_free_robot  # noqa: F401
    assert {warning.filename for warning in caught} == {__file__}


def test_an_unknown_name_is_no_attribute():
    import template_control

    with pytest.raises(AttributeError, match="no_such_name"):
        _ = template_control.no_such_name
