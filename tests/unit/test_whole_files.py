"""Files are written whole or not at all: a full disk, an error or a kill spoils no good one."""

import json
import os
import resource
import stat
from contextlib import contextmanager
from pathlib import Path

import pytest
from places import ROOT

from template_control.cli.main import main
from template_control.errors import RecordError
from template_control.run.record import Record
from template_control.storage import atomic_path
from template_control.view.figures import save_figures
from template_control.view.replay.replay import save_film, save_html


@contextmanager
def full_disk(size=2000):
    """No file gets longer than ``size`` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_file_is_replaced_when_the_new_one_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with atomic_path(path) as place:
        place.write_text("new")
        assert path.read_text() == "old"
        assert place.suffix == ".txt"
    assert contents(tmp_path) == {"a.txt": b"new"}


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_the_old_file(tmp_path, error):
    def write(path):
        with atomic_path(path) as place:
            place.write_text("ne")
            raise error

    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(error):
        write(path)
    assert contents(tmp_path) == {"a.txt": b"old"}


def test_rights_and_links_stay(tmp_path):
    path, link = tmp_path / "a.txt", tmp_path / "link.txt"
    path.write_text("old")
    path.chmod(0o640)
    link.symlink_to(path)
    with atomic_path(link) as place:
        place.write_text("new")
    assert link.is_symlink()
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    mask = os.umask(0o022)
    try:
        with atomic_path(tmp_path / "b.txt"):
            pass
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "b.txt").stat().st_mode) == 0o644


def test_a_device_stays_one(tmp_path):
    with atomic_path("/dev/null") as place:
        place.write_text("nothing")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    told = "cannot write /dev/full: No space left on device"
    with pytest.raises(RecordError, match=told), atomic_path("/dev/full") as place:
        place.write_text("nothing")
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@pytest.mark.parametrize(("place", "why"), [("", "Is a directory"), ("no/a.txt", "No such file")])
def test_a_place_that_takes_no_file_is_named(tmp_path, place, why):
    with pytest.raises(RecordError, match=f"cannot write .*: {why}"), atomic_path(tmp_path / place):
        pass
    assert contents(tmp_path) == {}


@pytest.mark.parametrize("name", ["run.npz", "noext", "run.backup"])
def test_a_record_is_saved_under_the_name_that_is_told(short_walk, tmp_path, name):
    path = short_walk.save(tmp_path / name)
    assert path == tmp_path / name
    assert list(contents(tmp_path)) == [name]
    assert Record.load(path).steps == short_walk.steps


WRITERS = {
    "run.npz": lambda record, path: record.save(path),
    "walk.html": save_html,
    "walk.gif": lambda record, path: save_film(record, path, start=-0.2),
    "torques.png": lambda record, path: save_figures(record, path.parent),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_the_old_file(short_walk, tmp_path, name):
    for figure in ("stick_diagram.png", name):
        (tmp_path / figure).write_bytes(b"old")
    before = contents(tmp_path)
    with full_disk(), pytest.raises(RecordError, match=r"cannot write .*: File too large; make"):
        WRITERS[name](short_walk, tmp_path / name)
    assert contents(tmp_path) == before


@pytest.mark.slow(seconds=2)
def test_a_walk_on_a_full_disk_keeps_the_last_one_and_prints_its_table(tmp_path, capfd):
    arguments = ["walk", "--steps", "1", "--output", str(tmp_path)]
    assert main([*arguments, "--no-figures"]) == 0
    before = contents(tmp_path)
    capfd.readouterr()
    with full_disk(20_000):
        assert main(arguments) == 2
    told = capfd.readouterr()
    assert "mean speed" in told.out
    assert "not saved" in told.out
    assert told.err.strip().splitlines()[-1].startswith("template-control: cannot write")
    assert contents(tmp_path) == before
    with full_disk(20_000):
        assert main([*arguments, "--json"]) == 2
    assert json.loads(capfd.readouterr().out)["record"] is None


@pytest.mark.parametrize(
    ("words", "table", "size"),
    [
        pytest.param(
            ["automaton", "--output", "{}/automaton.png"],
            "successor",
            80_000,
            marks=pytest.mark.slow(seconds=5),
        ),
        pytest.param(["slip", "{}", "--output", "{}"], "duration", 5_000, marks=pytest.mark.slow),
        (["gaits", "--limits", "825", "826", "--output", "{}"], "stability", 10_000),
        pytest.param(
            ["reproduce", "fig5", "--output", "{}"], "fig5", 10_000, marks=pytest.mark.slow
        ),
    ],
)
def test_a_table_is_printed_whatever_becomes_of_the_files(tmp_path, capfd, words, table, size):
    if words[0] == "slip":
        words = ["slip", str(ROOT / "examples" / "example_one.toml"), *words[2:]]
    words = [word.format(tmp_path) for word in words]
    assert main(words) == 0
    before = contents(tmp_path)
    capfd.readouterr()
    with full_disk(size):
        assert main(words) == 2
    told = capfd.readouterr()
    assert table.lower() in told.out.lower().replace(". ", "")
    assert "cannot write" in told.err.strip().splitlines()[-1]
    assert contents(tmp_path) == before


@pytest.mark.slow(seconds=1)
@pytest.mark.parametrize("words", [["automaton", "--no-figure"], ["--help"]])
@pytest.mark.parametrize("device", ["/dev/full", "closed", "pipe"])
def test_output_that_takes_nothing_is_one_line(command, words, device):
    if device == "pipe":
        read, write = os.pipe()
        os.close(read)
        status, told = command(*words, stdout=write)
        os.close(write)
        assert (status, told) in ((141, ""), (1, ""))  # rich has a status of its own
    elif device == "closed":
        assert command(*words, stdout=None) == (0, "")
    else:
        with Path(device).open("w") as full:
            status, told = command(*words, stdout=full)
        assert status == 2
        assert told == (
            "template-control: cannot write to standard output: No space left on device\n"
        )


@pytest.mark.slow(seconds=2)
def test_a_full_standard_error_ends_no_walk(command, tmp_path):
    words = ["walk", "--steps", "1", "--no-figures", "--output", str(tmp_path)]
    with Path("/dev/full").open("w") as full:
        status, _ = command(*words, stdout=None, stderr=full)
    assert status == 0
    assert Record.load(tmp_path / "run.npz").steps == 1
