"""Files of records: what is read back, and how a file that is none is told."""

import io
import json
import zipfile
from dataclasses import fields

import numpy as np
import pytest

import template_control as tc
from template_control.errors import RecordError
from template_control.run.record import Record
from template_control.slip.scenario.run import ScenarioRecord, simulate_scenario
from template_control.slip.scenario.scenario import example_one


@pytest.fixture(scope="module")
def short_walk(default_gait):
    """A step with few samples: here it is written and read hundreds of times."""
    return tc.simulate(
        tc.Experiment(
            tc.load_robot("five-link"),
            planner=tc.LqrPlanner(default_gait),
            steps=1,
            record_every=20,
        )
    )


@pytest.fixture(scope="module")
def content(short_walk, tmp_path_factory):
    return short_walk.save(tmp_path_factory.mktemp("record") / "run.npz").read_bytes()


@pytest.fixture
def saved(content, tmp_path):
    path = tmp_path / "run.npz"
    path.write_bytes(content)
    return path


@pytest.fixture(scope="module")
def written(content):
    """The file's fields."""
    with np.load(io.BytesIO(content)) as data:
        return {name: data[name] for name in data.files}


@pytest.fixture
def rewritten(saved, written):
    """Writes the run anew with other fields, and other entries of the metadata."""

    def rewrite(metadata=None, **changes):
        values = dict(written)
        told = json.loads(str(values["metadata"]))
        told.update(metadata or {})
        np.savez(saved, **{**values, "metadata": np.array(json.dumps(told)), **changes})
        return saved

    return rewrite


def same(a, b):
    for field in fields(a):
        if field.name != "metadata":
            one, other = getattr(a, field.name), getattr(b, field.name)
            np.testing.assert_array_equal(one, other, field.name)
            assert one.dtype == other.dtype
    assert a.metadata == b.metadata


def test_a_run_is_read_as_it_was_written(short_walk, saved):
    same(Record.load(saved), short_walk)


@pytest.mark.slow
def test_a_scenario_is_read_as_it_was_written(tmp_path):
    record = simulate_scenario(example_one())
    same(ScenarioRecord.load(record.save(tmp_path / "run.npz")), record)


@pytest.mark.parametrize("size", [0, 1, 100, 5000, -1])
def test_a_part_of_a_file_is_no_run(saved, size):
    saved.write_bytes(saved.read_bytes()[:size])
    with pytest.raises(RecordError, match=r"run.npz is no recorded run \(it cannot be read"):
        Record.load(saved)


def test_a_damaged_field_is_named(saved):
    with zipfile.ZipFile(saved) as archive:
        place = archive.getinfo("q.npy").header_offset + 200
    content = bytearray(saved.read_bytes())
    content[place : place + 50] = bytes(50)
    saved.write_bytes(content)
    with pytest.raises(RecordError, match=r"no recorded run \(q cannot be read"):
        Record.load(saved)


@pytest.mark.parametrize("name", [f.name for f in fields(Record)])
def test_a_missing_field_is_named(saved, written, name):
    np.savez(saved, **{key: value for key, value in written.items() if key != name})
    with pytest.raises(RecordError, match=rf"no recorded run \(it lacks {name}\)"):
        Record.load(saved)


@pytest.mark.parametrize("name", [f.name for f in fields(Record) if f.name != "metadata"])
@pytest.mark.parametrize("change", ["shorter", "flatter", "text"])
def test_a_field_of_another_shape_or_kind_is_named(rewritten, short_walk, name, change):
    array = getattr(short_walk, name)
    changed = {
        "shorter": lambda: array[:-1],
        "flatter": lambda: array[None],
        "text": lambda: array.astype(str),
    }[change]()
    # What the first field of a size says counts: the next one is the odd one then.
    culprit = {"time": "q", "section": "section_time", "tick_seconds": "solve_seconds"}.get(name)
    culprit = culprit if culprit and change == "shorter" else name
    with pytest.raises(RecordError, match=rf"no recorded run \({culprit} ") as told:
        Record.load(rewritten(**{name: changed}))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("name", ["node", "rear", "section", "stride"])
@pytest.mark.parametrize("index", [-1, 99])
def test_an_index_to_nowhere_is_named(rewritten, short_walk, name, index):
    array = getattr(short_walk, name).copy()
    array[0] = index
    with pytest.raises(RecordError, match=rf"\({name} holds indices that are not from 0 to"):
        Record.load(rewritten(**{name: array}))


@pytest.mark.parametrize("name", ["robot", "mass", "template", "legs", "fall_reason", "summary"])
@pytest.mark.parametrize("value", [None, [[]], {}, 3])
def test_metadata_that_do_not_fit_are_named(rewritten, short_walk, name, value):
    if isinstance(value, type(short_walk.metadata[name])) or (name, value) == ("mass", 3):
        value = None
    with pytest.raises(RecordError, match=f"its metadata has no {name}"):
        Record.load(rewritten({name: value}))


@pytest.mark.parametrize("text", ["", "junk", "[]", "3", "{}", '{"format": "another"}'])
def test_metadata_that_are_none_are_told(saved, text):
    with np.load(saved) as data:
        values = {name: data[name] for name in data.files}
    np.savez(saved, **{**values, "metadata": np.array(text)})
    with pytest.raises(RecordError, match=r"no recorded run \((its )?metadata"):
        Record.load(saved)


def test_an_array_alone_is_no_run(tmp_path):
    path = tmp_path / "run.npz"
    with path.open("wb") as file:
        np.save(file, np.zeros(3))
    with pytest.raises(RecordError, match="no recorded run"):
        Record.load(path)
    with pytest.raises(RecordError, match="no recorded run"):
        Record.load(tmp_path)


@pytest.mark.parametrize("command", ["replay", "plots"])
def test_a_file_that_is_no_run_is_one_line(refused, tmp_path, command):
    path = tmp_path / "run.npz"
    path.touch()
    assert f"{path} is no recorded run" in refused([command, str(path)])
