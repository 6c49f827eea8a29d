"""Figures of any run: whole, fallen, interrupted, without a completed step."""

from dataclasses import fields, replace

import numpy as np
import pytest
from matplotlib.image import imread

import template_control as tc
from template_control.cli.main import main
from template_control.slip.maps.section import VLO
from template_control.view.figures import figures_of
from template_control.view.state_figures import phase_portrait, section_states, template_energies


@pytest.fixture(scope="module")
def gait(default_gait):
    return default_gait


def walk(gait, steps, **options):
    robot = tc.load_robot("five-link")
    return tc.simulate(tc.Experiment(robot, planner=tc.LqrPlanner(gait), steps=steps, **options))


@pytest.fixture(scope="module")
def record(gait):
    return walk(gait, 4, pushes=(tc.Push(impulse=5.0, step=2),))


def cut(record, samples):
    """The run as it would be, had it been interrupted after so many samples."""
    sections = int(np.sum(record.section_time <= record.time[samples - 1]))
    held = {}
    for field in fields(record):
        value = getattr(record, field.name)
        if field.name.startswith("section") or field.name in ("stride", "plan_seconds"):
            held[field.name] = value[:sections]
        elif field.name != "metadata":
            held[field.name] = value[:samples]
    return replace(record, **held)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["whole", "two samples", "fallen", "no step"])
def test_every_run_has_every_figure(record, gait, kind, tmp_path):
    if kind == "fallen":
        weak = tc.EmbeddingOptions(torque_scale=0.2)
        record = walk(gait, 4, controller=weak)
        assert record.fell
    elif kind != "whole":
        record = cut(record, 2 if kind == "two samples" else 150)
        assert record.steps == 0
    paths = tc.save_figures(record, tmp_path)
    assert [path.stem for path in paths] == list(figures_of(record))
    for path in paths:
        picture = imread(path)[..., :3]
        assert np.mean(picture.min(axis=2) < 0.8) > 0.005, f"{path} is empty"


@pytest.mark.slow(seconds=5)
def test_the_command_draws_beside_the_run(record, tmp_path, capfd):
    run = record.save(tmp_path / "run.npz")
    assert main(["plots", str(run)]) == 0
    beside = [tmp_path / f"{name}.png" for name in figures_of(record)]
    assert capfd.readouterr().out.split() == [str(path) for path in beside]
    assert all(path.is_file() for path in beside)


@pytest.mark.slow
def test_the_command_draws_elsewhere(record, tmp_path):
    run = record.save(tmp_path / "run.npz")
    assert main(["plots", str(run), "--output", str(tmp_path / "new" / "folder")]) == 0
    assert len(list((tmp_path / "new" / "folder").glob("*.png"))) == len(figures_of(record))


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["missing.npz"], "missing.npz"),
        (["junk.npz"], "junk.npz"),
        (["run.npz", "--output", "/proc/none"], "/proc/none"),
        (["short.npz"], "fewer than two samples"),
    ],
)
def test_bad_input_is_one_line(record, arguments, culprit, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    record.save("run.npz")
    cut(record, 1).save("short.npz")
    (tmp_path / "junk.npz").write_text("junk")
    assert culprit in refused(["plots", *arguments])


def test_template_conserves_its_energy_within_a_phase(record, gait):
    total = template_energies(record)["total"]
    target = VLO.energy(gait.parameters, gait.vlo)
    first = record.time < 0.1
    assert np.allclose(total[first], target, atol=0.01)
    # After the rear liftoff until VLO nothing changes the template.
    last = record.nodes.index("SS_bv^wp")
    for begin, end in zip(record.section_time, record.section_time[1:], strict=False):
        on = (record.node == last) & (record.time > begin) & (record.time < end)
        # The template's own VLO may come some milliseconds before the robot's.
        toe = record.foot[np.arange(len(record.time)), record.rear, 0]
        on &= record.template_com[:, 0] < toe
        assert np.ptp(total[on]) < 0.02


def test_energies_add_up(record):
    parts = template_energies(record)
    assert np.all(parts["spring"] >= 0.0)
    assert np.allclose(parts["total"], parts["kinetic"] + parts["gravity"] + parts["spring"])


def test_section_figure_shows_the_recorded_states(record, gait):
    figure = section_states(record)
    speed, height, vertical, energy = figure.axes
    for axes, column in ((speed, 0), (height, 1), (vertical, 2)):
        shown = {line.get_label(): line.get_ydata() for line in axes.lines}
        assert np.array_equal(shown["reached"], record.section_state[:, column])
        assert np.array_equal(
            shown["expected by the planner"], record.section_predicted[:-1, column]
        )
        assert np.allclose(shown["target"], gait.vlo[column])
    reached = next(line for line in energy.lines if line.get_label() == "reached").get_ydata()
    assert reached[-1] == pytest.approx(VLO.energy(gait.parameters, record.section_state[-1]))


def test_portrait_is_broken_where_the_stance_foot_changes(record):
    figure = phase_portrait(record)
    forward = figure.axes[1]
    robot = next(line for line in forward.lines if line.get_label() == "robot")
    steps = np.diff(robot.get_xdata())
    assert np.nanmax(np.abs(steps)) < 0.05
    assert np.isnan(robot.get_xdata()).sum() >= 3
    vlo = next(line for line in forward.lines if line.get_label() == "robot at VLO")
    assert np.allclose(vlo.get_xdata(), 0.0, atol=0.01)
