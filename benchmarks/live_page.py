"""Processor time and late frames of the page on which a robot is driven, with tabs in Chromium.

Run: python benchmarks/live_page.py [--robots five-link go2] [--tabs 1] [--seconds 20]

Where there is no graphics card, Chromium draws on the same cores, at a lower priority: run nothing
else meanwhile.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import tempfile
import time

import template_control as tc

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
WAYS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--no-first-run", "--disable-background-networking"),
)


def measured(robot: str, tabs: int, seconds: float) -> str:
    """A row of the table: the robot, CPU seconds per simulated second, late frames."""
    browser = next(filter(None, map(shutil.which, BROWSERS)))
    page = tc.view.drive(robot, wait=False)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, page:
        shown = [
            subprocess.Popen(
                [
                    "nice", browser, *WAYS, "--remote-debugging-port=0", "--window-size=320,200",
                    f"--user-data-dir={folder}/{tab}", page.url,
                ],
                stderr=subprocess.DEVNULL,
            )
            for tab in range(tabs)
        ]  # fmt: skip
        try:
            while page.run is None or page.tabs < tabs or page.tick.time < 3.0:
                time.sleep(0.1)
            pace = page.pace
            before = time.process_time(), page.tick.time, pace.frames, pace.late
            time.sleep(seconds)
            after = time.process_time(), page.tick.time, pace.frames, pace.late
        finally:
            for process in shown:
                process.terminate()
    cpu, walked, frames, late = (b - a for a, b in zip(before, after, strict=True))
    fell = ", fell" if page.run.ended and page.run.reason else ""
    return f"| {robot} | {cpu / walked:.3f} | {late} of {frames}{fell} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    robots = ["five-link", "bolt", "five-link-3d", "go2"]
    parser.add_argument("--robots", nargs="+", default=robots)
    parser.add_argument("--tabs", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    print("| robot | CPU s per simulated s | late frames |\n| --- | --- | --- |")
    for robot in options.robots:
        print(measured(robot, options.tabs, options.seconds), flush=True)


if __name__ == "__main__":
    main()
