"""Compiled functions, and the folder in which Numba keeps their machine code.

Numba's cache knows a function's own file only, and would go on with machine code whose callees, in
other files, have changed since. So each content of the package's sources has a folder of its own.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.extending import overload

Function = Callable[..., Any]

_PACKAGE = Path(__file__).parent
_IMPORT = re.compile(
    r"^(?:from|import) (template_control[\w.]*)(?: import (\([\w,\s]*\)|[\w, ]*))?", re.MULTILINE
)
_KEPT = 3  # folders: switching between revisions of the sources does not compile again


class _Flags(set[str]):
    """Flags whose text is the same in all processes.

    Numba puts it into the names of functions. With a set's own order, which differs from process to
    process, machine code of two processes would hold a function twice, be inlined otherwise, and
    round otherwise.
    """

    def __repr__(self) -> str:
        return str(sorted(self))


# No function is called through a C pointer. The rest is Numba's default; a function that does not
# say so has the flags of the one for which it happens to be compiled first.
_ALLOCATING: dict[str, Any] = {
    "error_model": "python",
    "fastmath": False,
    "no_cfunc_wrapper": True,
    "_nrt": True,
}
# Reference counting costs a fifth to a third of a closed-form step.
_LEAN: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": _Flags({"contract", "arcp", "nsz"}),
    "no_cfunc_wrapper": True,
    "_nrt": False,
}


@cache
def cache_folder() -> Path | None:
    """Folder of the machine code of the present sources; None if no place for it is writable.

    The package's own folder, or the user's cache where that is read-only; ``NUMBA_CACHE_DIR``
    where it is set. Folders of older sources are removed when a new one is made.
    """
    places = [_PACKAGE / "__pycache__" / "compiled", Path.home() / ".cache" / _PACKAGE.name]
    if numba.config.CACHE_DIR:
        places = [Path(numba.config.CACHE_DIR) / _PACKAGE.name]
    for place in places:
        folder = place / _digest()
        try:
            if not folder.is_dir():
                folder.mkdir(parents=True, exist_ok=True)
                ages = sorted((p.stat().st_mtime, p) for p in place.iterdir() if p != folder)
                for _, old in ages[: max(len(ages) - _KEPT + 1, 0)]:
                    shutil.rmtree(old, ignore_errors=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return folder
    return None


def _digest() -> str:
    """Hash of the sources that compiled code depends on: another change compiles nothing again.

    They are the modules with compiled functions, and what they import, whose constants are frozen
    into the code.
    """
    contents = {}
    for path in _PACKAGE.rglob("*.py"):
        name = ".".join(path.relative_to(_PACKAGE.parent).with_suffix("").parts)
        contents[name.removesuffix(".__init__")] = path.read_bytes()
    found: set[str] = set()
    waiting = [n for n, text in contents.items() if __name__ in _imported(text)]
    while waiting:
        name = waiting.pop()
        if name in contents and name not in found:
            found.add(name)
            waiting += _imported(contents[name])
    digest = sha256()
    for name in sorted(found):
        digest.update(f"{name} {len(contents[name])}\n".encode() + contents[name])
    return digest.hexdigest()[:16]


def _imported(source: bytes) -> list[str]:
    """Modules that a source imports, and names in them, which may be modules."""
    found = []
    for module, names in _IMPORT.findall(source.decode()):
        found += [module, *(f"{module}.{name}" for name in re.findall(r"\w+", names))]
    return found


def _cached(function: Function, options: dict[str, Any]) -> Any:
    folder = cache_folder()
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder or "")  # read while a function is decorated
    try:
        return numba.njit(cache=folder is not None, **options)(function)
    finally:
        numba.config.CACHE_DIR = before


def compiled(function: Function) -> Any:
    """Decorator of compiled functions that may allocate arrays."""
    return _cached(function, _ALLOCATING)


def compiled_into(function: Function) -> Any:
    """As :func:`compiled`, of long functions that become part of those that call them.

    Numba optimises a function alone, and again in each function that calls it; these are not
    compiled alone, unless Python calls them.
    """
    return _cached(function, {**_ALLOCATING, "inline": "always"})


def inner(function: Function) -> Any:
    """Decorator of compiled functions that allocate nothing: the template's kernels."""
    return _cached(function, _LEAN)


def unfused(function: Any) -> Any:
    """An :func:`inner` function again, whose operations are rounded one by one, as Python's are.

    Only compiled functions call it: the cache has one place for a function, and this one's
    code is part of theirs.
    """
    return numba.njit(function.py_func, **_ALLOCATING)


def constant(value: int) -> Any:
    """A constant that compiled functions hand on: a whole number, or a truth value.

    Numba would compile what it is handed to once more for each literal, as Python's constants are.
    """
    return np.bool_(value) if isinstance(value, bool) else np.int64(value)


def inner_by_type(function: Function) -> Callable[[Function], Any]:
    """Decorator of what chooses code for ``function`` by its arguments' types, as Numba's overload.

    Compiled functions call it by the name of ``function``, which is what Python runs.
    """
    # Not strict: the choices have type hints of their own.
    return overload(function, jit_options=_LEAN, strict=False, prefer_literal=True)
