"""Numbers of the phases' tasks, set by name in Python, in a file and on the command line."""

import numpy as np
import pytest
from places import EXAMPLES

import template_control as tc
from template_control.cli.experiment_options import experiment_from
from template_control.errors import ParameterError
from template_control.slip import Phase
from template_control.whole_body import ComTask, FootTask, PostureTask


def tasks(options, phase, kind):
    return [task for task in options.phase_table()[phase].tasks if isinstance(task, kind)]


def test_a_name_alone_stands_for_the_task_of_all_phases():
    options = tc.EmbeddingOptions(tasks={"com": {"gains": (80.0, 18.0)}})
    found = [t for c in options.phase_table().values() for t in c.tasks if isinstance(t, ComTask)]
    assert {task.gains for task in found} == {(80.0, 18.0)}
    assert len({task.weight for task in found}) > 1, "their weights are as they were"
    assert options.phases is None, "the table stays as it is"


def test_a_phase_or_a_node_is_named_before_the_task():
    options = tc.EmbeddingOptions(
        tasks={"SS.posture": {"weight": 2.0}, "SS_av^wp.foot": {"gains": (500.0, 40.0)}}
    )
    assert tasks(options, Phase.SS, PostureTask)[0].weight == 2.0
    assert tasks(options, "SS_bv^wp", PostureTask)[0].weight == 2.0
    assert tasks(options, Phase.DS, PostureTask)[0].weight == 1.0
    assert tasks(options, "SS_av^wp", FootTask)[0].gains == (500.0, 40.0)
    assert tasks(options, Phase.SS, FootTask)[0].gains == FootTask().gains


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (
            {"com": {"gain": 1.0}},
            r"unknown key EmbeddingOptions.tasks.com.gain \(did you mean gains\?",
        ),
        ({"com": {"gains": (1.0, -1.0)}}, "EmbeddingOptions.tasks.com.gains is"),
        ({"trunk": {"weight": 1.0}}, "tasks.trunk is no task of a phase: give one of com, foot"),
        ({"XX.com": {"weight": 1.0}}, "tasks.XX.com is no task"),
    ],
)
def test_a_wrong_name_is_refused(wrong, told):
    with pytest.raises(ParameterError, match=told):
        tc.EmbeddingOptions(tasks=wrong)


def test_a_floating_base_robot_has_tasks_of_its_own():
    options = tc.EmbeddingOptions.of_kind("free", tasks={"side_foot": {"weight": 2.0}})
    assert options.phase_table()[Phase.SS].tasks[3].weight == 2.0


def test_the_file_and_the_command_line_say_them_alike(understood, tmp_path):
    said = '{com = {gains = [80.0, 18.0]}, "SS.posture" = {weight = 2.0}}'
    line = understood(f"template-control walk --controller.tasks '{said}'")
    found = experiment_from(line, tc.Experiment())
    path = tmp_path / "mine.toml"
    path.write_text(
        "[controller.tasks.com]\ngains = [80.0, 18.0]\n"
        '[controller.tasks."SS.posture"]\nweight = 2.0\n'
    )
    assert tc.Experiment.load(path).controller == found.controller
    assert tc.Experiment.load(found.save(tmp_path / "run.toml")).controller == found.controller
    own = {"com": {"gains": (80.0, 18.0)}, "SS.posture": {"weight": 2.0}}
    assert found.controller == tc.EmbeddingOptions(tasks=own)


def test_the_example_walks():
    experiment = tc.Experiment.load(EXAMPLES / "softer_trunk.toml")
    assert experiment.controller.tasks["com"] == {"gains": (80.0, 18.0)}
    record = tc.simulate(experiment.with_({"steps": 2}))
    assert not record.fell


def test_the_controller_uses_them():
    usual, stiff, limp = (
        tc.simulate(tc.Experiment(controller=tc.EmbeddingOptions(tasks=tasks), steps=2))
        for tasks in ({}, {"com": {"gains": (60.0, 16.0)}}, {"posture": {"gains": (25.0, 10.0)}})
    )
    np.testing.assert_array_equal(stiff.q, usual.q, err_msg="the default's own numbers")
    assert np.ptp(limp.q[:, 2]) > 1.2 * np.ptp(usual.q[:, 2])
