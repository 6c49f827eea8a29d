"""Bipedal SLIP templates, their control, and their embedding in multibody robots.

>>> import template_control as tc
>>> robot = tc.load_robot("five-link")
>>> gait = tc.gait_for_speed(tc.SlipParameters(mass=robot.mass), mean_speed=1.2)
>>> record = tc.simulate(robot, tc.LqrPlanner(gait), tc.SimulationOptions(steps=4))
>>> record.steps, record.fell
(4, False)
"""

from template_control.embedding.controller import EmbeddingController, EmbeddingOptions
from template_control.embedding.lqr import LqrOptions, LqrPlanner
from template_control.embedding.modified import ModifiedOptions, ModifiedPlanner
from template_control.embedding.planner import Decision, Planner
from template_control.errors import (
    GaitError,
    ParameterError,
    RecordError,
    RobotError,
    TemplateControlError,
)
from template_control.plant.bullet import PlantOptions
from template_control.plant.record import Record
from template_control.plant.simulation import Push, SimulationOptions, perturbed_start, simulate
from template_control.plant.summary import summarise
from template_control.robot.library import ROBOTS, load_robot
from template_control.robot.planar_biped import PlanarBiped
from template_control.slip.automaton import AUTOMATON, STRIDE_START
from template_control.slip.gait import WalkingGait, gait_at, gait_for_speed, gait_from_energy
from template_control.slip.parameters import SlipParameters
from template_control.slip.return_map import ReturnMap
from template_control.slip.stride import Stride, controls, run
from template_control.slip.vocabulary import Event, MapKind, Outcome, Slot
from template_control.view.figures import save_figures

__all__ = [
    "AUTOMATON",
    "ROBOTS",
    "STRIDE_START",
    "Decision",
    "EmbeddingController",
    "EmbeddingOptions",
    "Event",
    "GaitError",
    "LqrOptions",
    "LqrPlanner",
    "MapKind",
    "ModifiedOptions",
    "ModifiedPlanner",
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
    "SimulationOptions",
    "SlipParameters",
    "Slot",
    "Stride",
    "TemplateControlError",
    "WalkingGait",
    "controls",
    "gait_at",
    "gait_for_speed",
    "gait_from_energy",
    "load_robot",
    "perturbed_start",
    "run",
    "save_figures",
    "simulate",
    "summarise",
]
