"""Which build of ProxQP a process has, and who decides."""

import os
import subprocess
import sys

import pytest

IMPORTS = "import template_control.whole_body.solver, template_control.run.simulation\n"
QP = """
import template_control as tc
from template_control.whole_body.solver import WholeBodyQp
qp = WholeBodyQp(tc.load_robot("five-link"))
"""
TELL = """
import sys
print(sorted(m.split(".")[1] for m in sys.modules if m.count(".") == 1 and "proxsuite_pywrap" in m))
"""


def _builds(code, build=None):
    environment = {k: v for k, v in os.environ.items() if k != "TEMPLATE_CONTROL_PROXQP"}
    if build is not None:
        environment["TEMPLATE_CONTROL_PROXQP"] = build
    words = [sys.executable, "-c", code + TELL]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    return done.stdout.split("\n")[:-1], done.stderr


@pytest.fixture(scope="session")
def own():
    """The build that this processor's proxsuite chooses."""
    return _builds("import proxsuite\n")[0][-1]


@pytest.mark.slow(seconds=4)
def test_an_import_decides_nothing(own):
    assert _builds(IMPORTS + TELL + "import proxsuite\n")[0] == ["[]", own]


@pytest.mark.slow(seconds=4)
def test_a_robots_qp_takes_the_portable_build_and_the_log_says_so():
    loud = "import logging\nlogging.basicConfig(level=logging.INFO)\n"
    build, told = _builds(loud + IMPORTS + QP)
    assert build == ["['proxsuite_pywrap']"]
    assert told.count("this process has ProxQP's portable build") == 1
    assert "TEMPLATE_CONTROL_PROXQP=native" in told


@pytest.mark.slow(seconds=6)
def test_who_wants_another_build_has_it(own):
    assert _builds("import proxsuite\n" + QP)[0] == [own]
    assert _builds(QP, build="native")[0] == [own]
