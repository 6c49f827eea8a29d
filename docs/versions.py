"""Site of every released version, and of the working tree, each of which leads to the others.

Run: python docs/versions.py build/site

A release is a tag v1.2.3 of the repository. Its site is in a folder named after it, that of the
working tree in ``latest``; ``index.html`` leads to the newest release, or to ``latest`` where there
is none. Every version is built with the packages that are installed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

LATEST = "latest"
ROOT = Path(__file__).resolve().parents[1]
_INDEX = '<!doctype html><meta http-equiv="refresh" content="0; url={}/index.html">\n'


def _git(*words: str) -> str:
    return subprocess.run(
        ["git", "-C", str(ROOT), *words], check=True, capture_output=True, text=True
    ).stdout


def build(tree: Path, site: Path, name: str, names: list[str]) -> None:
    """Build the site of a checkout as the version ``name`` of the versions ``names``."""
    shown = {"DOCS_VERSIONS": " ".join(names), "DOCS_VERSION": name, "PYTHONPATH": str(tree)}
    command = [sys.executable, "-m", "sphinx", "-q", "-W", str(tree / "docs"), str(site / name)]
    subprocess.run(command, check=True, env={**os.environ, **shown})


def main() -> None:
    """Build all versions."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("site", type=Path, help="folder for the versions' folders")
    site = parser.parse_args().site
    tags = _git("tag", "--list", "v*", "--sort=-version:refname").split()
    names = [LATEST, *tags]
    build(ROOT, site, LATEST, names)
    for tag in tags:
        with tempfile.TemporaryDirectory() as folder:
            _git("worktree", "add", "--detach", folder, tag)
            try:
                build(Path(folder), site, tag, names)
            finally:
                _git("worktree", "remove", "--force", folder)
    (site / "index.html").write_text(_INDEX.format(tags[0] if tags else LATEST))


if __name__ == "__main__":
    main()
