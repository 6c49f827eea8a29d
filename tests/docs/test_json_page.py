"""The page of the commands' JSON has the keys that they print, and no other."""

import json

import pytest
from json_page import undocumented, unprinted

from template_control.cli.main import main

WALK = "walk --steps 1 --no-figures"


@pytest.fixture
def printed(tmp_path, capfd):
    def run(words):
        assert main([*words.split(), "--json"]) == 0
        return json.loads(capfd.readouterr().out)

    return run


@pytest.mark.slow(seconds=1)
def test_keys_of_a_run(printed, tmp_path):
    walk = printed(f"{WALK} --output {tmp_path}")
    free = printed(f"{WALK} --steps 2 --robot bolt --floating-base --output {tmp_path}")
    run = printed(f"run --steps 2 --no-figures --output {tmp_path}")
    for data in (walk, free, run):
        assert undocumented("walk", data) == set()
    assert unprinted("walk", walk, free, run) <= {"step_width", "<section>_mean_last_50"}


@pytest.mark.parametrize("command", ["robots", "automaton --no-figure", "keys delay"])
def test_keys_of_a_listing(printed, command):
    data, name = printed(command), command.split()[0]
    assert undocumented(name, data) == set()
    assert unprinted(name, data) == set()


def test_keys_of_the_template_s_commands(printed, tmp_path):
    for command in ("slip examples/walk_run_walk.toml --map paper", "gaits --over energy"):
        data, name = printed(f"{command} --no-figure --output {tmp_path}"), command.split()[0]
        assert undocumented(name, data) == set()
        assert unprinted(name, data) <= {"points[].target.*"}


def test_an_unknown_key_is_seen():
    assert undocumented("walk", {"steps": 3, "stepz": {"left": 4}}) == {"stepz.left"}
    assert "steps" in unprinted("walk", {"fell": False})
