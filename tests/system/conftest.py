"""What the tests of whole commands share."""

from contextlib import contextmanager

import pytest

from template_control.cli import report


@pytest.fixture
def interrupted(monkeypatch):
    """Ctrl-C once two steps of a run are done."""

    @contextmanager
    def impatient(*_):
        def advance(done):
            if done == 2:
                raise KeyboardInterrupt

        yield advance

    monkeypatch.setattr(report, "progress_bar", impatient)
