"""``template-control warm-up``: compile once what all commands call."""

from __future__ import annotations

import argparse

import numpy as np

from template_control.embedding.planners.modified import ModifiedPlanner
from template_control.plant.bullet import READ
from template_control.plant.ideal import IdealOptions
from template_control.robot.library import load_robot
from template_control.robot.spec import RobotSpec
from template_control.robot.template import paper_gait, template_for
from template_control.run.experiment import COMPILED, Experiment
from template_control.run.simulation import simulate
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.control.controllers import ModifiedWalking
from template_control.slip.dynamics.stride import controls
from template_control.slip.gaits.basin import steps_to_fall
from template_control.slip.gaits.gait import gait_at
from template_control.slip.lateral.placing import LATERAL
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters
from template_control.slip.planning.look_ahead import AHEAD
from template_control.slip.scenario.run import simulate_scenario
from template_control.slip.scenario.scenario import example_one
from template_control.terminal import plain_console
from template_control.warm_up import Part, ready


def add_options(parser: argparse.ArgumentParser) -> None:
    """The command has no options: everything is compiled."""
    parser.description = (
        "Compile all functions of the library and keep their machine code, so that no later"
        " command compiles. Each command compiles what it needs without it, once."
    )


def run(options: argparse.Namespace) -> int:
    """Compile what is not yet; returns 0."""
    # Not above: what a module with that import imports is taken for part of the compiled code.
    from template_control.compiled import cache_folder

    ready(COMPILED)
    # These call the first ones; not each other, but for the floating base.
    others = (Part(scenarios, 1.0), Part(basins, 1.2), Part(ideal_plant, 1.8))
    ready((*READ, *LATERAL, Part(floating_base, 26.0), *AHEAD, *others))
    plain_console().print(f"everything is compiled, in {cache_folder()}", soft_wrap=True)
    return 0


def scenarios() -> None:
    """All maps, and the paper's controllers on them: Example I, and a step without a guess."""
    for kind in MapKind:
        simulate_scenario(example_one(kind))
        z, u = (1.1, 0.98, 0.0), controls(1.15, 16e3, 16e3)
        ModifiedWalking(SlipParameters(), kind).solve(z, z)
        ReturnMap(SlipParameters(), kind=kind)(z, u)


def basins() -> None:
    """Steps to fall of the default gait."""
    template = SlipParameters()
    gait = gait_at(template, 1.152, 1.1)
    steps_to_fall(template, gait.vlo[None], gait.controls, np.zeros(2), limit=1)


def floating_base() -> None:
    """A step of robots with a floating base: on points, on soles, and on pairs of feet."""
    for name in ("five-link-3d", "g1", "go2"):
        simulate(Experiment(RobotSpec(name, free=True), steps=1))


def ideal_plant() -> None:
    """A step of the paper's gait by the paper's controller on the ideal plant."""
    robot = load_robot("five-link")
    planner = ModifiedPlanner(paper_gait(template_for(robot)))
    simulate(Experiment(robot, planner=planner, steps=1, world=IdealOptions()))
