"""Fourteen short runs against files that keep them; see golden_runs.py."""

import golden_runs
import numpy as np
import pytest

# Of the largest value of each array. Other roundings (no AVX-512, no FMA) were measured to change a
# walk by 2e-6 at most. A run at its torque limits multiplies them, and Example I's transitions
# move by whole ticks: there only the sections are compared.
ROUNDING = 2e-5
SATURATED = {"run_5": 2e-2, "floating_bolt": 3e-3}
BY_TICKS = {"example_one": {"section_time": 0.02, "section_state": 0.03}}


@pytest.mark.slow(seconds=3)
@pytest.mark.parametrize("name", golden_runs.COMMANDS)
def test_a_run_is_as_it_was(name, tmp_path):
    found = golden_runs.deviations(
        golden_runs.load(name), golden_runs.kept(golden_runs.run(name, tmp_path))
    )
    limits = BY_TICKS.get(name) or dict.fromkeys(found, SATURATED.get(name, ROUNDING))
    assert {key: found[key] for key in limits if found[key] > limits[key]} == {}


def test_a_change_is_found():
    old = golden_runs.load("walk")
    shorter = {key: value[:-1] for key, value in old.items()}
    moved = old | {"q": old["q"] + 1e-3}
    assert all(np.isinf(list(golden_runs.deviations(old, shorter).values())))
    assert golden_runs.deviations(old, moved)["q"] > ROUNDING
    assert not any(golden_runs.deviations(old, old).values())


def test_each_file_has_a_run_and_a_reason():
    assert {p.stem for p in golden_runs.FILES.glob("*.npz")} == set(golden_runs.COMMANDS)
    assert all(f"`{name}`" in golden_runs.CHANGES.read_text() for name in golden_runs.COMMANDS)
