"""Which contents of the sources a compiled function was made from."""

from __future__ import annotations

import os
import re
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

_IMPORT = re.compile(rb"^(?:from|import) ([\w.]+)", re.MULTILINE)
_HOLDS_COMPILED = b"\nfrom template_control.compiled import"


def sources(folder: Path) -> dict[str, bytes]:
    """Contents by path of the files of a package that compiled code can depend on.

    They are the modules that hold compiled functions and, as their integers are frozen into
    the code, all modules of the package that these import.

    Args:
        folder: the package's.
    """
    contents: dict[str, bytes] = {}
    for place, _, names in os.walk(folder):
        for name in names:
            if name.endswith(".py"):
                path = os.path.join(place, name)
                with open(path, "rb") as file:
                    contents[path] = file.read()
    start = len(str(folder.parent)) + 1
    modules = {path[start:-3].replace(os.sep, "."): path for path in contents}
    waiting = [path for path, content in contents.items() if _HOLDS_COMPILED in b"\n" + content]
    found: dict[str, bytes] = {}
    while waiting:
        path = waiting.pop()
        if path not in found:
            found[path] = contents[path]
            imported = (match.decode() for match in _IMPORT.findall(contents[path]))
            waiting += [modules[name] for name in imported if name in modules]
    return found


class Stamp(NamedTuple):
    """One content of the sources.

    Attributes:
        digest: of names and contents; "" where they cannot be read, as in a zip file.
        files: (path, size, time of the last change [ns]) of each.
    """

    digest: str
    files: tuple[tuple[str, int, int], ...]

    @property
    def holds(self) -> bool:
        """Whether the files are as they were."""
        try:
            return all(_state(path) == (size, time) for path, size, time in self.files)
        except OSError:
            return False


def _state(path: str) -> tuple[int, int]:
    found = os.stat(path)
    return found.st_size, found.st_mtime_ns


@cache
def stamp(folders: tuple[Path, ...]) -> Stamp:
    """Of the :func:`sources` of packages, as they are when this process first asks."""
    digest, files = sha256(), []
    try:
        for folder in folders:
            for path, content in sorted(sources(folder).items()):
                files.append((path, *_state(path)))
                digest.update(f"{os.path.relpath(path, folder)} {len(content)}\n".encode())
                digest.update(content)
    except OSError:
        return Stamp("", ())
    return Stamp(digest.hexdigest()[:16], tuple(files))
