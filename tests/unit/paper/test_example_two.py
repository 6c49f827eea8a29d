"""Example II: start, liftoff rules, and what is reported of it."""

from functools import cache

import numpy as np
import pytest
from robot_guards import RobotGuards

from template_control.embedding.modes import GuardOptions
from template_control.embedding.options import EmbeddingOptions
from template_control.embedding.planners.lqr import LqrPlanner
from template_control.embedding.state import TemplateState
from template_control.paper.example_two import (
    EARLIER,
    PLANNERS,
    START,
    liftoff,
    sections,
    start_state,
    template_walk,
)
from template_control.plant.ideal import IdealOptions
from template_control.robot.library import load_robot
from template_control.run.experiment import Experiment
from template_control.run.simulation import simulate
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.vocabulary import Event
from template_control.slip.parameters import SlipParameters


@pytest.fixture(scope="module")
def first_steps(paper_gait):
    """Two steps on the ideal plant, with a predefined liftoff direction or the template's."""

    @cache
    def walk(beta=None):
        return simulate(
            Experiment(
                load_robot("five-link"),
                planner=LqrPlanner(paper_gait),
                steps=2,
                world=IdealOptions(),
                controller=EmbeddingOptions(guards=GuardOptions(liftoff_angle=beta)),
            )
        )

    return walk


def test_z0_is_the_papers(paper_gait):
    z = np.array(start_state(paper_gait))
    assert z[0] > 0.0 > z[2], "downward"
    np.testing.assert_allclose(sections(paper_gait, z[None])[0], START, rtol=1e-12)
    p = paper_gait.parameters
    spring = 0.5 * p.leg_stiffness * (p.rest_length - z[1]) ** 2
    kinetic = 0.5 * p.mass * (z[0] ** 2 + z[2] ** 2)
    assert kinetic + p.mass * p.gravity * z[1] + spring == pytest.approx(821.55)


def test_the_template_alone_shows_what_a_map_costs(paper_gait):
    target = sections(paper_gait, paper_gait.vlo[None])[0]
    settled = {name: template_walk(name).settled for name in PLANNERS}
    for name in ("LQR", "modified, improved map", "modified, exact map"):
        mean, spread = settled[name]
        np.testing.assert_allclose(mean, target, atol=2e-4, rtol=2e-5)
        assert spread[0] < 1e-4
    mean, _ = settled["modified, paper map"]
    assert mean[0] - target[0] > 0.005
    assert mean[2] == pytest.approx(826.0, abs=0.05), "(38) holds on any map"


def test_liftoff_waits_for_the_predefined_direction():
    ahead = TemplateState(np.array([0.4, 0.9, 1.0, 0.0]), np.array([0.0, 0.6]))
    beta = np.arctan2(0.9, 0.4)
    liftoff = AUTOMATON.node("DS_sd^w").edge(Event.REAR_LIFTOFF)
    for angle, lifts in ((beta + 1e-6, True), (beta - 1e-6, False)):
        # Whatever the template's time says.
        for due in (0.5, -0.5):
            predefined = RobotGuards(SlipParameters(), GuardOptions(liftoff_angle=angle))
            assert predefined.fired(liftoff, ahead, due) is lifts
            template = RobotGuards(SlipParameters(), GuardOptions())
            assert template.fired(liftoff, ahead, due) is (due <= 0.0)


@pytest.mark.slow(seconds=3)
def test_an_earlier_liftoff_is_rougher_with_smaller_amplitudes(first_steps):
    """The paper's words for Fig. 13(c)."""
    template, predefined = liftoff(first_steps()), liftoff(first_steps(EARLIER))
    # One tick turns beta by less than 0.1 degrees.
    assert 0.0 <= EARLIER - predefined.beta < np.radians(0.15)
    assert template.beta < predefined.beta
    assert predefined.load > 300.0
    assert template.load < 0.1 * predefined.load
    assert predefined.jump.max() > 4.0 * template.jump.max()
    assert template.jump.max() < 15.0
    assert np.all(predefined.peak[[0, 2]] < 0.95 * template.peak[[0, 2]]), "hips"


def test_each_foot_has_its_own_template_force_about_liftoff(first_steps):
    """The template's and the robot's liftoff differ by some ticks; forces go to the feet."""
    record = first_steps()
    nodes = np.array(record.nodes)[record.node]
    lifted = np.flatnonzero((nodes[1:] == "SS_bv^w") & (nodes[:-1] == "DS_sd^w"))[0] + 1
    near = slice(lifted - 5, lifted + 5)
    lifting = 1 - record.rear[lifted]
    force = np.where(
        record.rear[near] == lifting,
        record.template_force[near, 0, 1],
        record.template_force[near, 1, 1],
    )
    assert np.all(force < 100.0), "the lifting leg's fades"
