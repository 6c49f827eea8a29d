"""Golden runs: fourteen short runs whose results a change of the code must keep.

``python tests/golden_runs.py compare OLD NEW`` runs them on two commits on this machine and demands
equal bits. ``tests/system/test_golden.py`` compares with files, within tolerances: other processors
round otherwise. ``python tests/golden_runs.py make --because REASON`` writes these files anew, says
what changed, and adds the reason to ``tests/golden/CHANGES.md``.
"""

import argparse
import contextlib
import io
import os
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path

import numpy as np
from places import EXAMPLES, ROOT, TESTS

FILES = TESTS / "golden"
CHANGES = FILES / "CHANGES.md"
COMMANDS = {
    "walk": "walk --steps 8",
    "paper": "walk --steps 6 --gait paper --planner modified",
    "run_3": "run --steps 10 --speed 3",
    "run_5": "run --steps 10 --speed 5 --robot runner",
    "example_one": "go {examples}/example_one.toml --robot runner --steps 14",
    "stand_walk_stand": "walk --steps 2 --from-stand --to-stand",
    "speed_profile": "go {examples}/any_speed.toml --steps 8",
    "slope": "walk --steps 8 --terrain slope:angle=4",
    "push": "walk --steps 8 --push 25@3:0.3",
    "estimate": "walk --steps 6 --estimate",
    "floating_bolt": "walk --robot bolt --free --speed 0.6 --steps 8 --turn 0.2",
    "floating_five_link_3d": "walk --robot five-link-3d --free --steps 6",
    "soles_g1": "walk --robot g1 --floating-base --steps 3",
    "pairs_go2": "walk --robot go2 --floating-base --steps 8",
}
SAMPLED = ("q", "v", "torque", "contact_force")
BY_SECTION = ("section_time", "section_state", "section_controls")
INTERVAL = 0.05  # [s] between kept samples: a file has about 10 kB


def run(name, folder):
    """Arrays of one run, as its ``run.npz`` has them."""
    from template_control.cli.main import main

    words = COMMANDS[name].format(examples=EXAMPLES).split()
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = main([*words, "--no-figures", "--output", str(folder)])
    if status:
        raise SystemExit(f"{name}: `{COMMANDS[name]}` ended with {status}:\n{said.getvalue()}")
    with np.load(Path(folder) / "run.npz") as data:
        return {key: data[key] for key in ("time", *SAMPLED, *BY_SECTION)}


def kept(arrays):
    """What a golden file keeps of a run: a sample every 50 ms, and every section."""
    time = arrays["time"]
    rows = np.searchsorted(time, np.arange(0.0, time[-1], INTERVAL))
    return {key: arrays[key][rows] for key in ("time", *SAMPLED)} | {
        key: arrays[key] for key in BY_SECTION
    }


def load(name):
    """Arrays of a golden file."""
    with np.load(FILES / f"{name}.npz") as data:
        return dict(data)


def deviations(old, new):
    """Largest deviation of each array, over its largest value; infinite for another shape."""
    return {
        key: float(np.abs(new[key] - value).max() / np.abs(value).max())
        if new[key].shape == value.shape
        else np.inf
        for key, value in old.items()
    }


def make(because):
    """Write the golden files anew, print what changed, and keep the reason."""
    FILES.mkdir(exist_ok=True)
    lines = []
    for name in COMMANDS:
        with tempfile.TemporaryDirectory() as folder:
            new = kept(run(name, folder))
        path = FILES / f"{name}.npz"
        found = deviations(load(name), new) if path.exists() else {}
        if found and not any(found.values()):
            continue
        key = max(found, key=found.get, default="")
        lines.append(f"- `{name}`: " + (f"{key} by {found[key]:.1e}" if found else "new"))
        np.savez_compressed(path, **new)
    if not lines:
        print("nothing changed")
        return
    print(*lines, sep="\n")
    earlier = CHANGES.read_text() if CHANGES.exists() else "# Changes of the golden runs\n"
    entry = "\n".join((f"\n## {date.today()}: {because}\n", *lines))
    CHANGES.write_text(f"{earlier}{entry}\n")


def digests(root):
    """Hash of each run's arrays, computed by the checkout at ``root``."""
    code = (
        "import sys, tempfile, hashlib; sys.path[:0] = sys.argv[1:]\n"
        "import golden_runs as g, numpy as np, pathlib\n"
        "g.EXAMPLES = pathlib.Path(sys.argv[1]) / 'examples'\n"
        "for name in g.COMMANDS:\n"
        "    with tempfile.TemporaryDirectory() as folder:\n"
        "        arrays = g.run(name, folder)\n"
        "    data = b''.join(np.ascontiguousarray(a).tobytes() for a in arrays.values())\n"
        "    print(name, hashlib.sha256(data).hexdigest()[:16], flush=True)\n"
    )
    words = [sys.executable, "-c", code, str(root), str(TESTS)]
    path = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, env=path, check=True)
    return dict(line.split() for line in done.stdout.splitlines())


def compare(commits):
    """Run everything on both commits; returns how many runs differ."""
    found = []
    for commit in commits:
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder) / "checkout"
            git = ["git", "-C", str(ROOT), "worktree"]
            subprocess.run([*git, "add", "--quiet", "--detach", str(root), commit], check=True)
            try:
                found.append(digests(root))
            finally:
                subprocess.run([*git, "remove", "--force", str(root)], check=True)
    old, new = found
    for name in COMMANDS:
        print(f"{name:24}{'equal' if old[name] == new[name] else 'DIFFERS'}")
    return sum(old[name] != new[name] for name in COMMANDS)


def main():
    """Read the command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    both = commands.add_parser("compare", help="demand equal bits of two commits")
    both.add_argument("commits", nargs=2, metavar="COMMIT")
    anew = commands.add_parser("make", help="write the files anew")
    anew.add_argument("--because", required=True, help="what changed, and why")
    options = parser.parse_args()
    if options.command == "make":
        make(options.because)
        return 0
    return 1 if compare(options.commits) else 0


if __name__ == "__main__":
    sys.exit(main())
