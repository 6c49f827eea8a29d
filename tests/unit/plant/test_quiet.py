"""What C libraries print stays off standard output and stderr."""

import subprocess
import sys


def python(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)


def test_pybullet_is_imported_in_silence():
    done = python("import template_control.plant.bullet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


SPEAK = """
import os, sys
from template_control.plant.c_library import silenced
with silenced():
    print("lost")
    print("lost", file=sys.stderr)
    os.write(1, b"lost, as from C")
print("ended")
with silenced():
    print("printed")
    print("complained", file=sys.stderr)
    os.write(1, b"written by C\\n")
    raise ImportError("no such library")
"""


def test_silence_ends_and_tells_what_an_error_said():
    done = python(SPEAK)
    assert done.stdout == "ended\n"
    held, _, traceback = done.stderr.partition("Traceback")
    assert sorted(held.splitlines()) == ["complained", "printed", "written by C"]
    assert traceback.endswith("ImportError: no such library\n")
