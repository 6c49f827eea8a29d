"""Figures of any run: whole, fallen, interrupted, without a completed step."""

from dataclasses import fields, replace
from importlib.util import find_spec

import numpy as np
import pytest
from matplotlib.image import imread
from places import EXAMPLES

import template_control as tc
from template_control.cli.main import main
from template_control.slip.maps.section import VLO
from template_control.view.figures import figures_of
from template_control.view.state_figures import phase_portrait, section_states, template_energies
from template_control.view.style import Look, telling


@pytest.fixture(scope="session")
def gait(default_gait):
    return default_gait


def walk(gait, steps, **options):
    robot = tc.load_robot("five-link")
    return tc.simulate(tc.Experiment(robot, planner=tc.LqrPlanner(gait), steps=steps, **options))


@pytest.fixture(scope="session")
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
@pytest.mark.parametrize("kind", ["two samples", "fallen", "no step"])
def test_every_run_has_every_figure(record, gait, kind, tmp_path):
    if kind == "fallen":
        weak = tc.EmbeddingOptions(qp=tc.QpOptions(torque_scale=0.2))
        record = walk(gait, 4, controller=weak)
        assert record.fell
    else:
        record = cut(record, 2 if kind == "two samples" else 150)
        assert record.steps == 0
    paths = tc.save_figures(record, tmp_path, dpi=40)
    assert [path.stem for path in paths] == list(figures_of(record))
    assert_drawn(paths)


def assert_drawn(paths):
    for path in paths:
        picture = imread(path)[..., :3]
        assert np.mean(picture.min(axis=2) < 0.8) > 0.005, f"{path} is empty"


@pytest.mark.slow(seconds=5)
def test_the_command_draws_beside_the_run(record, tmp_path, capfd):
    run = record.save(tmp_path / "run.npz")
    assert main(["plots", str(run)]) == 0
    beside = [tmp_path / f"{name}.png" for name in figures_of(record)]
    assert capfd.readouterr().out.split() == [str(path) for path in beside]
    assert_drawn(beside)


def test_the_command_draws_elsewhere(record, tmp_path):
    run, folder = record.save(tmp_path / "run.npz"), tmp_path / "new" / "folder"
    assert main(["plots", str(run), "--figures", "com", "--output", str(folder)]) == 0
    assert [path.name for path in folder.iterdir()] == ["com.png"]


@pytest.mark.slow(seconds=1)
def test_the_command_draws_what_it_is_asked_for(record, tmp_path, capfd):
    run = record.save(tmp_path / "run.npz")
    words = ["--figures", "com,forces", "--format", "pdf", "--start", "0.2", "--end", "-0.3"]
    assert main(["plots", str(run), *words, "--no-title", "--dpi", "300"]) == 0
    paths = [tmp_path / name for name in ("com.pdf", "forces.pdf")]
    assert capfd.readouterr().out.split() == [str(path) for path in paths]
    assert all(path.read_bytes().startswith(b"%PDF") for path in paths)
    assert not list(tmp_path.glob("*.png"))


def test_a_run_draws_what_it_is_asked_for(tmp_path, capfd, refused):
    words = ["walk", "--steps", "1", "--output", str(tmp_path), "--json"]
    assert "--figures is 'comm': give a list" in refused([*words, "--figures", "comm"])
    assert not list(tmp_path.iterdir())
    (tmp_path / "template.npz").write_text("of the run that was here")
    figures = ["--figures", "com", "--format", "pdf", "--start", "0.1", "--no-title"]
    assert main([*words, *figures]) == 0
    assert {p.name for p in tmp_path.iterdir()} >= {"run.npz", "run.toml", "com.pdf"}
    assert not list(tmp_path.glob("*.png"))
    assert not (tmp_path / "template.npz").exists()


@pytest.mark.slow(seconds=2)
def test_a_scenario_draws_what_it_is_asked_for(tmp_path, capfd):
    words = ["go", str(EXAMPLES / "walk_run_walk.toml"), "--robot", "runner", "--steps", "1"]
    asked = ["--figures", "scenario,forces", "--format", "pdf", "--output", str(tmp_path)]
    assert main([*words, *asked]) == 0
    assert {p.name for p in tmp_path.glob("*.pdf")} == {"scenario.pdf", "forces.pdf"}
    assert main(["plots", str(tmp_path / "run.npz"), "--figures", "scenario"]) == 0
    assert {p.name for p in tmp_path.glob("*.png")} == {"scenario.png"}


def test_a_look_chooses_the_part_and_the_title(record):
    look = Look(0.2, -0.3, titled=False)
    for name in ("com", "torques", "forces", "tracking", "turning", "energies"):
        figure = tc.plot(record, name, look)
        line = max(figure.axes[0].lines, key=lambda line: len(line.get_xdata()))
        shown = line.get_xdata()[[0, -1]]
        np.testing.assert_allclose(shown, (0.2, record.time[-1] - 0.3), atol=2e-3)
        assert figure.get_suptitle() == ""
    assert "five-link" in tc.plot(record, "com").get_suptitle()
    with pytest.raises(tc.TemplateControlError, match="nothing lies between start 9 s"):
        tc.plot(record, "com", Look(9.0))


def test_a_figure_has_one_legend_that_explains_all_of_it(record):
    for name in figures_of(record):
        figure = tc.plot(record, name)
        assert len(figure.legends) <= 1
        assert not any(axes.get_legend() for axes in figure.axes)
        shaded = any(axes.collections for axes in figure.axes if axes.get_xlabel() == "time [s]")
        told = {text.get_text() for legend in figure.legends for text in legend.get_texts()}
        assert not shaded or told & {"single stance", "push"}, name


def test_the_telling_part_of_a_run_has_its_push(record):
    begin, end = telling(record, 0.6)
    pushed = record.time[record.push != 0.0]
    assert begin < pushed[0] < pushed[-1] < end
    still = replace(record, push=np.zeros_like(record.push))
    assert telling(still, 0.6)[1] == pytest.approx(record.time[-1])


def test_an_impact_is_marked_with_its_size(record):
    force = record.contact_force.copy()
    hit = len(force) // 2
    force[hit, 0, 1] = 9876.0
    hard = replace(record, contact_force=force)
    figure = tc.plot(hard, "forces", Look(record.time[hit] - 0.2, record.time[hit] + 0.2))
    assert "9.9" in {text.get_text() for text in figure.axes[0].texts}


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["missing.npz"], "missing.npz"),
        (["run.npz", "--figures", "com,none"], "--figures is 'none': give a list"),
        (["run.npz", "--start", "5", "--end", "4"], "nothing lies between start 5 s and end 4 s"),
        (["run.npz", "--dpi", "3"], "--dpi is 3"),
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


@pytest.mark.skipif(find_spec("pybullet") is None, reason="feet sink, and the template's with them")
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
