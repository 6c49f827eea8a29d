"""Scenarios: Example I end to end, files, commands, and what is wrong with them."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from places import EXAMPLES

from template_control.cli.main import main
from template_control.errors import RecordError, ScenarioError
from template_control.paper import REPRODUCTIONS
from template_control.paper.example_one import summary
from template_control.slip.automaton.vocabulary import MapKind
from template_control.slip.scenario.run import ScenarioRecord, simulate_scenario
from template_control.slip.scenario.scenario import Scenario, Segment, example_one, load_scenario

EXAMPLE = EXAMPLES / "example_one.toml"


@pytest.fixture(scope="module", params=[MapKind.PAPER, MapKind.IMPROVED, MapKind.EXACT])
def record(request):
    return simulate_scenario(example_one(request.param))


def test_example_one_goes_as_told(record):
    s = summary(record)
    assert s["completed"]
    assert s["walking_speed_before"] == pytest.approx(1.17, abs=0.01)
    assert s["stiffness_at_5"] == pytest.approx(28.2e3, rel=0.05)
    assert s["walking_steps_after"] >= 20
    kinds = record.strides
    assert kinds.count("wr") == kinds.count("rw") == 1
    first_run, last_run = kinds.index("r"), len(kinds) - 1 - kinds[::-1].index("r")
    assert set(kinds[first_run : last_run + 1]) == {"r"}
    assert record.section_time[kinds.index("wr")] >= 0.8
    apex = record.section_state[kinds.index("rw"), 0]
    assert apex < 2.0 <= record.section_state[kinds.index("rw") - 1, 0]
    top = record.section_state[1:][np.array(record.wanted_speed) == 5.0]
    assert np.all(np.abs(top[:, 0] - 5.0) < 0.05)
    held = record.section_time[1:][np.array(record.wanted_speed) == 5.0]
    assert np.ptp(held) == pytest.approx(1.5, abs=0.4)


def test_energies_are_out_of_phase_walking_and_in_phase_running(record):
    kinds = record.strides
    phases = {
        kind: [record.energy_phase(i) for i, k in enumerate(kinds) if k == kind]
        for kind in ("w", "r")
    }
    assert max(phases["w"]) < -0.4
    assert min(phases["r"]) > 0.4


def test_profile_accelerates_as_asked(record):
    kinds = np.array(record.strides)
    running = kinds == "r"
    rising = running & (record.wanted_speed < 5.0) & (np.arange(len(kinds)) < 15)
    t, v = record.section_time[1:][rising], record.section_state[1:][rising, 0]
    assert np.polyfit(t, v, 1)[0] == pytest.approx(1.05, rel=0.1)


def test_energy_changes_only_where_a_stiffness_is_switched(record):
    """Within a node of the automaton the exact model conserves energy."""
    total = record.energies()["total"]
    same = (np.diff(record.node) == 0) & (np.diff(np.sum(record.stiffness, axis=1)) == 0.0)
    assert np.max(np.abs(np.diff(total)[same])) < 1e-6


def test_the_file_is_example_one():
    assert load_scenario(EXAMPLE) == example_one()


def test_record_survives_the_disk(tmp_path):
    scenario = replace(example_one(), segments=(Segment("walk", speed=1.125, steps=3),))
    record = simulate_scenario(scenario)
    again = ScenarioRecord.load(record.save(tmp_path / "run.npz"))
    assert again.strides == ["w"] * 3
    np.testing.assert_array_equal(again.state, record.state)
    assert again.metadata == json.loads(json.dumps(record.metadata))
    (tmp_path / "junk.npz").write_text("junk")
    with pytest.raises(RecordError, match="no recorded run"):
        ScenarioRecord.load(tmp_path / "junk.npz")


def test_a_failed_stride_ends_the_run_and_is_told():
    scenario = Scenario(
        segments=(Segment("walk", speed=1.1, steps=1), Segment("run", speed=15.0, steps=3))
    )
    record = simulate_scenario(scenario)
    assert not record.completed
    assert "stride" in record.metadata["failure"]
    assert len(record.section_state) == len(record.strides) + 1


SEGMENT = '[[segment]]\ngait = "walk"\nspeed = 1.1\nsteps = 2\n'


@pytest.mark.parametrize(
    ("text", "culprit"),
    [
        ("spead = 3\n" + SEGMENT, "unknown key spead"),
        (SEGMENT + "paces = 3\n", "unknown key segment[0].paces"),
        (SEGMENT + SEGMENT.replace("walk", "trot"), "segment[1].gait is 'trot'"),
        (SEGMENT.replace("1.1", "inf"), "segment[0].speed is inf"),
        (SEGMENT.replace("steps = 2", ""), "segment 1 never ends"),
        (SEGMENT.replace("walk", "run"), "segment 1 must stand, or walk"),
        (SEGMENT.replace("2", "0"), "steps is 0"),
        ('map = "mercator"\n' + SEGMENT, "map is 'mercator'"),
        ("apex_height = -1\n" + SEGMENT, "apex_height is -1"),
        ("vlo = [1.2, 0.0]\n" + SEGMENT, "vlo height is 1.2"),
        ("[parameters]\nmass = -80.0\n" + SEGMENT, "mass is -80"),
        ('[parameters]\nmass = "80"\n' + SEGMENT, "parameters.mass is '80'"),
        ("[parameters]\nmass = true\n" + SEGMENT, "parameters.mass is True"),
        (SEGMENT.replace("walk", "jump"), "segment[0].gait is 'jump': give one of walk, run"),
        (SEGMENT.replace("steps = 2", "duration = 1e300"), "at most 3600 s"),
        (SEGMENT.replace("2", "100000000"), "steps is 100000000: give a whole number from 1 to"),
        (SEGMENT.replace("2", "2.5"), "segment[0].steps is 2.5: give a whole number"),
        (SEGMENT.replace("steps = 2", "until_speed = 5\nacceleration = -0.5"), "the other sign"),
        (SEGMENT.replace("steps = 2", "until_speed = 5\nacceleration = 1e-9"), "at most 3600 s"),
        ("start = 3\n" + SEGMENT, "start is 3: give a list"),
        ("[parameters]\nweight = 80.0\n" + SEGMENT, "unknown key parameters.weight"),
        (SEGMENT + "duration = 1.0\n", "segment 1 has duration and steps: give it one of them"),
        (SEGMENT + SEGMENT.replace("steps = 2", "steps = 9999"), "at most 10000"),
        (SEGMENT.replace("1.1", "99"), "segment[0].speed is 99: give a number above 0"),
        ("touchdown_angle = 90\n" + SEGMENT, "touchdown_angle is 90: give a number above 0 and"),
        ("", "no segments"),
        (SEGMENT + SEGMENT.replace("segment", "segments"), "segments is given by two keys"),
        ("[segment]\ngait = 'walk'", "segment is {'gait': 'walk'}: give a list"),
        ("= 3", "is no TOML"),
    ],
)
def test_bad_files_are_named_in_one_line(tmp_path, capfd, text, culprit):
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=re.escape(culprit)):
        load_scenario(path)
    assert main(["slip", str(path), "--output", str(tmp_path)]) == 2
    out, error = capfd.readouterr()
    assert out == ""
    assert error.count("\n") == 1
    assert culprit in error


def test_unreachable_apex_is_named_with_its_segment():
    scenario = replace(example_one(), apex_height=0.5)
    with pytest.raises(ScenarioError, match=r"segment 2 at .* under the lowest touchdown height"):
        simulate_scenario(scenario)


@pytest.mark.slow(seconds=2)
def test_slip_command(tmp_path, capfd):
    arguments = ["slip", str(EXAMPLE), "--map", "improved", "--output", str(tmp_path)]
    assert main([*arguments, "--json"]) == 0
    figures = json.loads(capfd.readouterr().out)
    assert figures["completed"]
    assert figures["map"] == "improved"
    assert figures["strides"]["running"] > 10
    assert figures["speed_error_rms"] < 0.01
    assert {p.name for p in tmp_path.iterdir()} == {"run.npz", "scenario.png", "energies.png"}
    assert main([*arguments, "--no-figures"]) == 0
    assert "as planned" in capfd.readouterr().out
    assert main(["slip", str(tmp_path / "none.toml")]) == 2
    assert "cannot read" in capfd.readouterr().err


# About so many seconds on two cores.
LONG = {"fig12": 14, "fig8": 5, "fig13": 5, "fig9": 4, "fig10": 3, "fig5": 3}
# What is enough here. The planners that are missing walk in the tests of the README's commands.
LESS = {
    "fig8": {"energies": np.array([824.0, 826.0])},
    "fig9": {"counts": (50, 200)},
    "fig12": {"planners": ("LQR", "modified, exact map"), "steps": 34},
    "fig13": {"steps": 8},
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[pytest.mark.slow(seconds=LONG[n])] if n in LONG else [])
        for n in REPRODUCTIONS
    ],
)
def test_reproduce_command(name, tmp_path, monkeypatch, capfd):
    """Computed once, told twice: as the README prints the command, and as JSON."""
    result = REPRODUCTIONS[name](**LESS.get(name, {}))
    monkeypatch.setitem(REPRODUCTIONS, name, lambda: result)
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", name]) == 0
    told = "".join(capfd.readouterr().out.split())
    assert "".join(result.title.split()) in told
    for figure in result.figures:
        assert (tmp_path / "runs" / "reproduce" / f"{figure}.png").is_file()
        assert f"{figure}.png" in told
    assert main(["reproduce", name, "--output", str(tmp_path), "--json"]) == 0
    data = json.loads(capfd.readouterr().out)
    assert data["name"] == name
    assert [Path(p) for p in data["figures"]] == sorted(tmp_path.glob("*.png"))
    if name == "table3":
        assert data["valid"] >= 5000
        assert data["improved"]["position"]["mean"] <= 0.35
        assert data["improved"]["velocity"]["mean"] <= 2.0
    if name == "fig8":
        assert data["fold"] == pytest.approx(827.62, abs=0.02)
        assert data["lower_by_steps_to_fall"] == pytest.approx(822.06, abs=0.3)
        assert data["shares"] == pytest.approx([0.303, 0.491], abs=0.001)
    if name == "fig9":
        assert data["paper map"]["failing"] > 100 > data["improved map"]["failing"]
    if name == "fig12":
        walks = data["walks"]
        asked = {"template alone", "ideal", "PyBullet"}
        assert set(walks["LQR"]) == asked | {"ideal, full grip"}
        assert all(set(walks[planner]) == asked for planner in walks if planner != "LQR")
        assert all(walk["spread"][0] < 0.0015 for walk in walks["LQR"].values())
        for planner, by_plant in walks.items():
            for plant, walk in by_plant.items():
                assert (walk["fall"], walk["steps"]) == (None, 34), (planner, plant)
                # The bound of a walk's settling, 0.1 m/s upward, is 5 degrees here.
                off = np.abs(np.subtract(walk["mean"], data["target"]))
                assert np.all(off < (0.008, np.radians(4.98), 2.0)), (planner, plant)
            # What the template itself misses is the planner's map.
            assert by_plant["template alone"]["mean"][0] == pytest.approx(
                data["target"][0], abs=0.008 if planner == "modified, paper map" else 2e-4
            )
    if name == "fig13":
        jumps = {(c["plant"], c["liftoff"]): max(c["jump"]) for c in data["cases"]}
        for plant in ("PyBullet", "ideal"):
            assert jumps[plant, "earlier"] > 5.0 * jumps[plant, "template's"]
    if name == "fig6":
        assert data["Table IV's gains"]["end"][1] == pytest.approx(0.98, abs=0.01)


def test_unknown_reproduction_is_named(capfd):
    assert main(["reproduce", "fig99"]) == 2
    assert "no reproduction 'fig99'" in capfd.readouterr().err


def test_a_run_that_is_stopped_is_not_called_complete(monkeypatch):
    monkeypatch.setattr("template_control.slip.scenario.run.MOST_STRIDES", 3)
    record = simulate_scenario(Scenario((Segment("walk", speed=1.1, steps=9),)))
    assert not record.completed
    assert record.metadata["failure"] == "stopped in segment 1, after 3 strides"
    assert len(record.strides) == 3
