"""Records of the version before, which knew one section and one kind of stride."""

import json
from dataclasses import fields

import numpy as np
import pytest

from template_control.errors import RecordError
from template_control.run.old_record import RENAMED
from template_control.run.record import Record
from template_control.view.figures import save_figures


@pytest.fixture
def old(short_walk, tmp_path):
    """The short walk as the version before wrote it."""
    back = {new: name for name, new in RENAMED.items()}
    gone = ("section", "stride", "section_target", "metadata")
    held = {
        back.get(f.name, f.name): getattr(short_walk, f.name)
        for f in fields(short_walk)
        if f.name not in gone
    }
    swing = short_walk.swing_reference[np.arange(len(short_walk.time)), 1 - short_walk.rear]
    held["swing_reference"] = np.nan_to_num(swing)
    held["vlo_controls"] = short_walk.section_controls[:, :5]
    metadata = dict(short_walk.metadata, format="template-control run 2")
    metadata["gait_vlo"] = metadata.pop("gait_state")
    for name in ("sections", "strides"):
        del metadata[name]
    path = tmp_path / "old.npz"
    np.savez(path, metadata=np.array(json.dumps(metadata)), **held)
    return path


def test_an_old_record_opens_as_a_new_one(old, short_walk):
    record = Record.load(old)
    assert record.steps == short_walk.steps
    assert record.metadata["sections"] == ["VLO"]
    assert record.metadata["strides"] == ["w"]
    for name in ("section", "stride", "section_state", "section_target", "section_nominal"):
        np.testing.assert_array_equal(getattr(record, name), getattr(short_walk, name), name)
    assert set(record.metadata) == set(short_walk.metadata)
    carrying = record.swing_reference[np.arange(len(record.time)), record.rear]
    assert np.isnan(carrying).all(), "the foot that carries has no reference"


@pytest.mark.slow
def test_an_old_record_is_drawn(old, tmp_path):
    assert save_figures(Record.load(old), tmp_path)


def test_an_old_record_with_a_field_missing_is_refused(old, tmp_path):
    with np.load(old) as data:
        np.savez(tmp_path / "less.npz", **{k: data[k] for k in data.files if k != "vlo_time"})
    with pytest.raises(RecordError, match="no recorded run"):
        Record.load(tmp_path / "less.npz")


def test_a_record_without_push_off_opens(short_walk, tmp_path):
    short_walk.save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as data:
        held = {name: data[name] for name in data.files}
    metadata = json.loads(str(held["metadata"])) | {"format": "template-control run 3"}
    held["metadata"] = np.array(json.dumps(metadata))
    held["section_controls"] = held["section_controls"][:, :5]
    np.savez(tmp_path / "old.npz", **held)
    record = Record.load(tmp_path / "old.npz")
    np.testing.assert_array_equal(record.section_controls[:, :5], held["section_controls"])
    np.testing.assert_array_equal(record.section_controls[:, 5], 0.0)
