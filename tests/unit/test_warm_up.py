"""Compilation ahead of use: what is compiled, by how many processes, and what is announced."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from places import EXAMPLES

from template_control import warm_up
from template_control.warm_up import Part

TOY = """\
import os
from pathlib import Path

def note(name):
    with open(os.environ["NOTES"], "a") as file:
        file.write(f"{name} {os.getpid()}\\n")

def one():
    note("one")

def two():
    note("two")

def three():
    note("three")

def bad():
    raise ZeroDivisionError("of the part")
"""
RUN = """\
import sys, toy
from template_control import warm_up
warm_up._processes = lambda: int(sys.argv[1])
warm_up.ready([warm_up.Part(getattr(toy, name), 2.0) for name in sys.argv[2:]])
"""


@pytest.fixture
def prepare(tmp_path):
    """Gives what calls ``ready`` in a new process; it returns its notes and standard error."""
    (tmp_path / "toy.py").write_text(TOY)
    notes = tmp_path / "notes"

    def run(processes, *names, status=0):
        notes.write_text("")
        more = {
            "NOTES": str(notes),
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            "PYTHONPATH": os.pathsep.join((str(tmp_path), str(Path(warm_up.__file__).parents[1]))),
        }
        done = subprocess.run(
            [sys.executable, "-c", RUN, str(processes), *names],
            env=os.environ | more,
            capture_output=True,
            text=True,
        )
        assert done.returncode == status, done.stderr
        return [line.split() for line in notes.read_text().splitlines()], done.stderr

    return run


@pytest.mark.slow(seconds=4)
def test_two_processes_share_the_parts_and_the_first_loads_all(prepare):
    notes, said = prepare(2, "one", "two")
    by_process = {}
    for name, process in notes:
        by_process.setdefault(process, []).append(name)
    assert sorted(by_process.values()) == [["one", "one", "two"], ["two"]]
    assert said.count(warm_up.ANNOUNCEMENT) == 1
    # What is kept is not announced again.
    notes, said = prepare(2, "one")
    assert [name for name, _ in notes] == ["one"]
    assert "compiling" not in said
    assert "compiling" in prepare(1, "one", "three")[1]


@pytest.mark.slow(seconds=4)
def test_a_part_that_fails_is_not_taken_for_compiled(prepare):
    for _ in range(2):
        assert "ZeroDivisionError" in prepare(2, "one", "bad", status=1)[1]


@pytest.mark.parametrize("count", [1, 2, 3, 10])
def test_the_shares_keep_the_order_and_are_alike(count):
    parts = [Part(int, float(seconds)) for seconds in (4, 6, 5, 3, 2, 1, 1, 1)]
    shares = warm_up._shares(parts, count)
    assert [part for share in shares for part in share] == parts
    assert len(shares) <= count
    assert max(sum(p.seconds for p in share) for share in shares) <= max(23 / count, 6) + 3


def compiled_code(*lines):
    """Files of machine code that commands load or write, by command, in one new process."""
    code = (
        "import sys; from template_control.cli.main import main\n"
        "for line in sys.argv[1:]:\n"
        "    print('command', line, flush=True)\n"
        "    assert main(line.split()) == 0, line\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *lines],
        env=os.environ | {"NUMBA_DEBUG_CACHE": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = {}
    for part in re.split(r"^command ", done.stdout, flags=re.MULTILINE)[1:]:
        line, _, said = part.partition("\n")
        found[line] = set(re.findall(r"\[cache\] data (?:saved to|loaded from) '(.*?)'", said))
    return found


@pytest.mark.slow(seconds=11)
def test_after_a_warm_up_no_command_compiles(tmp_path, monkeypatch):
    """What a command calls is what the warm-up has compiled, whatever else is in the cache."""
    monkeypatch.chdir(tmp_path)
    (warm,) = compiled_code("warm-up").values()
    assert len(warm) > 20
    commands = compiled_code(
        "walk --steps 3 --push 60@1 --no-figures",
        "run --steps 2 --no-figures",
        f"go {EXAMPLES}/zero_five_zero.toml --robot runner --steps 5 --no-figures",
        "walk --steps 2 --from-stand --to-stand --no-figures",
        "walk --steps 1 --plant ideal --no-figures",
        "walk --steps 2 --plant mujoco --terrain slope:angle=2 --no-figures",
        "walk --robot bolt --free --steps 2 --no-figures",
        f"slip {EXAMPLES}/example_one.toml --no-figures",
        "gaits",
        "reproduce table3",
    )
    called = {
        re.sub(r".*\.(\w+)-\d+\.py.*", r"\1", code) for code in set().union(*commands.values())
    }
    assert {"choose", "section_jacobian", "one_stride", "map_many"} <= called  # of planners, maps
    assert {"least_squares", "modified_step", "record_stride"} <= called  # of scenarios
    assert {"_keep", "gather_planar", "gather_floating"} <= called  # of ticks
    for line, code in commands.items():
        assert code <= warm, line
