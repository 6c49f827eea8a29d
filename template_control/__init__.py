"""Bipedal SLIP templates, their control, and their embedding in multibody robots.

>>> import template_control as tc
>>> robot = tc.load_robot("five-link")
>>> gait = tc.gait_for_speed(tc.template_for(robot), mean_speed=1.2)
>>> record = tc.simulate(robot, tc.LqrPlanner(gait), tc.SimulationOptions(steps=4))
>>> record.steps, record.fell
(4, False)
"""

from template_control.embedding.controller import EmbeddingController
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.lqr import LqrOptions, LqrPlanner
from template_control.embedding.planners.modified import ModifiedOptions, ModifiedPlanner
from template_control.embedding.planners.planner import Decision, Planner
from template_control.embedding.robot_template import default_gait, paper_gait, template_for
from template_control.errors import (
    GaitError,
    ParameterError,
    RecordError,
    RobotError,
    ScenarioError,
    TemplateControlError,
)
from template_control.plant.bullet import PlantOptions
from template_control.plant.ground import GroundStep
from template_control.plant.ideal import IdealOptions
from template_control.robot.five_link import FiveLink, Link
from template_control.robot.library import ROBOTS, load_robot
from template_control.robot.planar_biped import PlanarBiped
from template_control.run.record import Record
from template_control.run.sensing import SensorOptions
from template_control.run.simulation import Push, SimulationOptions, perturbed_start, simulate
from template_control.run.summary import summarise
from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START
from template_control.slip.automaton.vocabulary import Event, MapKind, Outcome, Slot
from template_control.slip.control.controllers import (
    ActiveRunning,
    ActiveWalking,
    ModifiedWalking,
    RunToWalk,
    WalkToRun,
)
from template_control.slip.control.step_solver import StepSolution
from template_control.slip.dynamics.stride import Stride, controls, simulate_stride
from template_control.slip.gaits.gait import WalkingGait, gait_at, gait_for_speed, gait_from_energy
from template_control.slip.maps.return_map import ReturnMap
from template_control.slip.parameters import SlipParameters
from template_control.slip.scenario.record import ScenarioRecord
from template_control.slip.scenario.run import simulate_scenario
from template_control.slip.scenario.scenario import Scenario, Segment, example_one, load_scenario
from template_control.view.figures import save_figures
from template_control.view.replay.replay import replay, save_film, save_html
from template_control.view.scenario_figures import save_scenario_figures

__all__ = [
    "AUTOMATON",
    "ROBOTS",
    "STRIDE_START",
    "ActiveRunning",
    "ActiveWalking",
    "Decision",
    "EmbeddingController",
    "EmbeddingOptions",
    "Event",
    "FiveLink",
    "GaitError",
    "GroundStep",
    "IdealOptions",
    "Link",
    "LqrOptions",
    "LqrPlanner",
    "MapKind",
    "ModifiedOptions",
    "ModifiedPlanner",
    "ModifiedWalking",
    "Outcome",
    "ParameterError",
    "PlanarBiped",
    "Planner",
    "PlantOptions",
    "Push",
    "Record",
    "RecordError",
    "ReturnMap",
    "RobotError",
    "RunToWalk",
    "Scenario",
    "ScenarioError",
    "ScenarioRecord",
    "Segment",
    "SensorOptions",
    "SimulationOptions",
    "SlipParameters",
    "Slot",
    "StepSolution",
    "Stride",
    "TemplateControlError",
    "WalkToRun",
    "WalkingGait",
    "controls",
    "default_gait",
    "example_one",
    "gait_at",
    "gait_for_speed",
    "gait_from_energy",
    "load_robot",
    "load_scenario",
    "paper_gait",
    "perturbed_start",
    "replay",
    "save_figures",
    "save_film",
    "save_html",
    "save_scenario_figures",
    "simulate",
    "simulate_scenario",
    "simulate_stride",
    "summarise",
    "template_for",
]
