"""Deprecated public names, which keep working for one version."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pkgutil import resolve_name

import lazy_loader

DEPRECATED = {
    "template_control.Course": "template_control:HeadingCommand",
    "template_control.embedding.apex_pose": "template_control.run:apex_pose",
    "template_control.embedding.ApexStart": "template_control.run:ApexStart",
    "template_control.embedding.BreakingPlanner": "template_control.embedding:Planner",
    "template_control.embedding.ChangePlanner": "template_control.embedding:CurvePlanner",
    "template_control.embedding.check_feasibility": "template_control.run:check_feasibility",
    "template_control.embedding.ContactOptions": "template_control.estimation:ContactOptions",
    "template_control.embedding.default_gait": "template_control.robot:default_gait",
    "template_control.embedding.FloatingSnapshot": "template_control.embedding:Snapshot",
    "template_control.embedding.ForgettingPlanner": "template_control.embedding:Planner",
    "template_control.embedding.Free": "template_control.embedding:RestContext",
    "template_control.embedding.FreeController": "template_control.embedding:EmbeddingController",
    "template_control.embedding.FreeControls": "template_control.embedding:RestContext",
    "template_control.embedding.FreeOptions": "template_control.embedding:EmbeddingOptions",
    "template_control.embedding.FrictionOptions": "template_control.estimation:FrictionOptions",
    "template_control.embedding.gaits_by_speed": "template_control.slip:gaits_by_speed",
    "template_control.embedding.LandingPlanner": "template_control.embedding:Planner",
    "template_control.embedding.paper_gait": "template_control.robot:paper_gait",
    "template_control.embedding.PricingPlanner": "template_control.embedding:Planner",
    "template_control.embedding.rehearse": "template_control.run:check_feasibility",
    "template_control.embedding.robot_gait_for_speed": "template_control:robot_gait_for_speed",
    "template_control.embedding.robot_route": "template_control.run:robot_route",
    "template_control.embedding.SlopePlanner": "template_control.embedding:Planner",
    "template_control.embedding.SpeedChangePlanner": "template_control.embedding:CurvePlanner",
    "template_control.embedding.StandPlanner": "template_control.embedding:CurvePlanner",
    "template_control.embedding.StartPlanner": "template_control.embedding:CurvePlanner",
    "template_control.embedding.StepPlanner": "template_control.embedding:CurvePlanner",
    "template_control.embedding.StopPlanner": "template_control.embedding:CurvePlanner",
    "template_control.embedding.template_for": "template_control.robot:template_for",
    "template_control.embedding.walking_speeds": "template_control.robot:walking_speeds",
    "template_control.load_free_robot": "template_control:load_floating_robot",
    "template_control.robot.FloatingBasePose": "template_control.robot:Pose",
    "template_control.robot.FreeBiped": "template_control.robot:FloatingBaseBiped",
    "template_control.robot.FreePose": "template_control.robot:Pose",
    "template_control.robot.FREE_ROBOTS": "template_control.robot:FLOATING_ROBOTS",
    "template_control.robot.free_state_in": "template_control.robot:floating_state_in",
    "template_control.robot.load_free_robot": "template_control.robot:load_floating_robot",
    "template_control.robustness.ASIDE": "template_control.robustness:LATERAL_PUSHES",
    "template_control.robustness.Conditions": "template_control.robustness:CampaignConfig",
    "template_control.robustness.Draw": "template_control.robustness:DisturbanceSample",
    "template_control.robustness.first_wrong": "template_control.robustness:fall_cause",
    "template_control.robustness.FREE_MIX": "template_control.robustness:FLOATING_MIX",
    "template_control.robustness.Mix": "template_control.robustness:DisturbanceDistribution",
    "template_control.run.Course": "template_control.run:HeadingCommand",
    "template_control.run.FreeRecord": "template_control.run:FloatingRecord",
    "template_control.run.GaitChoice": "template_control.run:GaitSpec",
    "template_control.run.RobotChoice": "template_control.robot:RobotSpec",
    "template_control.run.RobotSpec": "template_control.robot:RobotSpec",
    "template_control.RunInterrupted": "template_control.run:RunInterrupted",
    "template_control.slip.CatchOptions": "template_control.embedding:CatchOptions",
    "template_control.whole_body.Wanted": "template_control.whole_body:References",
}
"""Old name -> new one, as "package:name" of a public package."""


def attach_stub(
    package: str, file: str
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """As ``lazy_loader.attach_stub``; a deprecated name gives a DeprecationWarning and its object.

    Takes ``__name__`` and ``__file__`` of a package whose stub is next to it; returns its
    ``__getattr__``, ``__dir__`` and ``__all__``.
    """
    attribute, directory, names = lazy_loader.attach_stub(package, file)

    def attribute_or_deprecated(name: str) -> object:
        old = f"{package}.{name}"
        if old not in DEPRECATED:
            return attribute(name)
        new = DEPRECATED[old].replace(":", ".")
        warnings.warn(f"{old} is deprecated: use {new}", DeprecationWarning, stacklevel=2)
        return resolve_name(DEPRECATED[old])

    return attribute_or_deprecated, directory, names
