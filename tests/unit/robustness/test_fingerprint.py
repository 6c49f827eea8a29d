"""Which changes throw away the trials of a campaign, and which it goes on from."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import template_control as tc
from template_control.errors import SweepError
from template_control.robustness import campaign, fingerprint
from template_control.robustness.campaign import CampaignConfig, run_campaign
from template_control.sweep.sweep import SweepOptions, grid, sweep

SOURCE = '''"""A module."""

from dataclasses import dataclass

KINDS = frozenset({"a", "b"})
"""Of things."""


@dataclass
class Thing:
    """A thing."""

    size: float = 1.0
    """Of it."""

    def grown(self, by: float) -> float:
        """How large it is then."""
        if "a" in {"a", "b", "c"}:
            return self.size + by
        return 0.0
'''

SAME = {
    "comment": SOURCE.replace("KINDS =", "# What there is.\nKINDS ="),
    "comment behind": SOURCE.replace("+ by", "+ by  # larger"),
    "docstring": SOURCE.replace("How large it is then.", "The size then."),
    "docstring of a class": SOURCE.replace('    """A thing."""\n\n', ""),
    "docstring of a module": SOURCE.replace('"""A module."""\n', ""),
    "docstring of a field": SOURCE.replace('    """Of it."""\n\n', ""),
    "lines": SOURCE.replace("@dataclass\n", "\n\n@dataclass\n"),
}
OTHER = {
    "number": SOURCE.replace("1.0", "1.5"),
    "operator": SOURCE.replace("+ by", "- by"),
    "name": SOURCE.replace("size", "length"),
    "annotation": SOURCE.replace("size: float", "size: int"),
    "set": SOURCE.replace('"b", "c"', '"b", "d"'),
    "text": SOURCE.replace('{"a", "b"})', '{"a", "e"})'),
    "statement": SOURCE + "Thing.size = 2.0\n",
}


def _package(folder, source=SOURCE, **others):
    """Digest of a package with a file in ``slip`` and one in ``cli``."""
    texts = {"slip/thing.py": source, "cli/tell.py": "x = 1\n", "slip/data.json": "[1]"}
    for place, text in (texts | others).items():
        path = folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return fingerprint._code(folder)


@pytest.mark.parametrize("source", SAME.values(), ids=SAME)
def test_words_do_not_count(tmp_path, source):
    assert source != SOURCE
    assert _package(tmp_path / "one") == _package(tmp_path / "other", source)


@pytest.mark.parametrize("source", OTHER.values(), ids=OTHER)
def test_code_counts(tmp_path, source):
    assert source != SOURCE
    assert _package(tmp_path / "one") != _package(tmp_path / "other", source)


def test_only_rooms_that_a_trial_uses_count(tmp_path):
    one = _package(tmp_path / "one")
    for room in fingerprint.WITHOUT:
        others = {f"{room}/tell.py": "x = 2\n", f"{room}/more.py": "y = 1\n"}
        assert _package(tmp_path / room, **others) == one
    assert _package(tmp_path / "new", **{"plant/new.py": "x = 1\n"}) != one
    assert _package(tmp_path / "data", **{"slip/data.json": "[2]"}) != one


def _told(code, seed):
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    return done.stdout


@pytest.mark.slow(seconds=2)
def test_a_trial_imports_no_room_that_does_not_count():
    code = """
import sys
import template_control.run.experiment, template_control.robustness.disturbances
import template_control.robustness.fall_cause, template_control.run.live
print(*{name.split(".")[1] for name in sys.modules if name.startswith("template_control.")})
"""
    rooms = set(_told(code, "0").split())
    assert "embedding" in rooms
    assert not rooms & set(fingerprint.WITHOUT)


@pytest.mark.slow(seconds=4)
def test_the_digest_is_that_of_every_process():
    code = "from template_control.robustness import fingerprint as f; print(f._code(f._PACKAGE))"
    assert _told(code, "1") == _told(code, "2") == fingerprint._code(fingerprint._PACKAGE) + "\n"


@pytest.mark.slow(seconds=1)
def test_the_urdf_counts():
    one, other = tc.load_robot("five-link"), tc.load_robot("rabbit")
    assert fingerprint.fingerprint(one) != fingerprint.fingerprint(other)
    assert fingerprint.fingerprint(one, 1) != fingerprint.fingerprint(one, 2)
    assert fingerprint.fingerprint(one, 1) == fingerprint.fingerprint(one, 1)


@pytest.fixture
def trials(monkeypatch):
    """Trials that are made up, and the numbers of those that were run."""
    run = []

    def made_up(conditions, number):
        run.append(number)
        fell = number % 3 == 1
        error = None if fell else 0.001 * number
        return {"fell": fell, "reason": "x" * fell, "first": "slip" * fell, "speed_error": error}

    made_up.__module__ = campaign.campaign_trial.__module__
    made_up.__qualname__ = campaign.campaign_trial.__qualname__
    monkeypatch.setattr(campaign, "campaign_trial", made_up)
    return run


def _campaign(count, folder, seed=1):
    folder.mkdir(exist_ok=True)
    with ThreadPoolExecutor(1) as pool:
        return run_campaign(CampaignConfig(seed=seed), count, folder, pool, progress=False)


def test_a_longer_campaign_goes_on_from_a_shorter_one(tmp_path, trials):
    short = _campaign(6, tmp_path / "grown")
    assert trials == list(range(6))
    grown = _campaign(14, tmp_path / "grown")
    assert trials == list(range(14)), "what was there is not run again"
    trials.clear()
    fresh = _campaign(14, tmp_path / "fresh")
    assert trials == list(range(14))
    assert grown == fresh
    assert grown.trials[:6] == short.trials
    trials.clear()
    assert _campaign(6, tmp_path / "grown") == short
    assert _campaign(14, tmp_path / "grown") == fresh
    assert not trials
    assert len(list((tmp_path / "grown").iterdir())) == 1


def test_other_conditions_have_a_file_of_their_own(tmp_path, trials):
    _campaign(3, tmp_path)
    _campaign(3, tmp_path, seed=2)
    assert trials == [0, 1, 2, 0, 1, 2]
    assert len(list(tmp_path.iterdir())) == 2


def square(x):
    return x * x


def test_a_growing_sweep_refuses_a_file_of_other_items(tmp_path):
    path, options = Path(tmp_path / "s.jsonl"), SweepOptions(progress=False)
    with ThreadPoolExecutor(1) as pool:
        sweep(square, grid(x=[1, 2, 3]), path, pool, options=options)
        with pytest.raises(SweepError, match=r"holds another sweep \(another item 1\)"):
            sweep(square, grid(x=[1, 5, 3, 4]), path, pool, options=options)
        grown = sweep(square, grid(x=[1, 2, 3, 4]), path, pool, options=options)
    assert grown.results == (1, 4, 9, 16)
