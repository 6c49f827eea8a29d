"""The script that counts what pushes do to a robot's runs."""

import importlib.util

import pytest
from places import EXAMPLES

SCRIPT = EXAMPLES / "push_tables.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("push_tables", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_row_has_both_signs_and_all_phases(script):
    for name, row in script.ROWS.items():
        if "impulse" not in row.trials[0]:
            continue
        by_impulse = {d["impulse"] for d in row.trials}
        hard = name.startswith(("catch", "hard"))
        assert hard or {-j for j in by_impulse} == by_impulse
        phases = 20 if name.startswith("hard") else 10
        assert len({d["phase"] for d in row.trials}) == phases
        assert len(row.trials) == phases * len(by_impulse)


def test_strides_until_a_run_is_back(script):
    fast, near = 1.03 * script.SPEED, 1.01 * script.SPEED
    assert script.back(script.np.array([near, fast, fast, near, near]), 1) == 1
    assert script.back(script.np.array([near, near, near, near]), 1) == 0
    assert script.back(script.np.array([near, near, near, fast]), 1) is None


@pytest.mark.slow(seconds=3)
def test_a_pushed_run_is_told(script):
    result = script.trial("five-link", "run", {"impulse": -20.0, "phase": 0.3})
    assert not result["fell"]
    assert result["back"] <= 10
    line = script.markdown_row("run, five-link", [result, None])
    assert line.startswith("| run, five-link | 1 of 2 | 3 to 3 |")
