"""What the tests of sweeps sweep, and how they look at files and processes."""

import ctypes
import json
import math
import os
import sys
import time
from pathlib import Path

import numpy as np

from template_control.slip.parameters import SlipParameters
from template_control.sweep.sweep import SweepOptions, sweep

P = SlipParameters()
COUNT = 60


def quietly(function, items, path=None, executor=None, seed=0, **options):
    """A sweep without a bar; ``options`` are those of ``SweepOptions``."""
    return sweep(function, items, path, executor, seed, SweepOptions(progress=False, **options))


def square(x):
    return x * x


def other(x):
    return x


def drawn(x, seed):
    time.sleep(0.001 * (x % 3))  # later items may finish first
    return {"x": x, "seed": seed, "draw": np.random.default_rng(seed).uniform()}


def fragile(x):
    if x == 2:
        raise ValueError("two is too much")
    if x == 3:
        sys.exit("leaving")
    if x == 4:
        return object()
    return {"root": math.sqrt(x)}


def logged(x, pause=0.02):
    """Tells SWEEP_LOG that it ran, and in which process; cut short by Ctrl-C, as a robot's run."""
    try:
        time.sleep(pause)
    except KeyboardInterrupt:
        return {"square": -1, "pid": os.getpid()}
    with Path(os.environ["SWEEP_LOG"]).open("a") as log:
        log.write(f"{x} {os.getpid()}\n")
    return {"square": x * x, "pid": os.getpid()}


def walking_step(angle, speed):
    # Imported here: the processes that the other tests start and kill need nothing compiled.
    from template_control.slip.gaits.gait import gait_at
    from template_control.slip.maps.return_map import ReturnMap

    gait = gait_at(P, np.radians(angle), speed)
    mapped = ReturnMap(P, "w")(gait.vlo, gait.controls)
    return {"outcome": mapped.outcome, "error": np.max(np.abs(mapped.state - gait.vlo))}


def alive(pid):
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):  # before it is opened, before it is read
        return False


def wait_until(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


def lines(path):
    """Complete lines of a file."""
    return path.read_text().split("\n")[:-1] if path.exists() else []


def kept(path):
    """Indices of the items a results file holds."""
    return [json.loads(line)["index"] for line in lines(path)[1:]]


def calls(log):
    """(x, pid) of the calls since the last look."""
    found = [tuple(map(int, line.split())) for line in lines(log)]
    log.unlink(missing_ok=True)
    return found


def hold(seconds):
    """Sleeps as compiled code works: no other thread of the process runs meanwhile."""
    ctypes.PyDLL(None).usleep(int(1e6 * seconds))
