"""How compiled functions are made, and kept from one process to the next.

Every compiled function of the package is decorated with :data:`compiled` or :data:`inner`.
Numba's own cache knows a function's file only, and would go on with machine code whose
callees, in other files, have changed since. The cache here is one folder for one content of
all the files that compiled code comes from.
"""

from __future__ import annotations

import logging
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from numba import njit
from numba.core import config, event
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache, _CacheLocator
from numba.core.dispatcher import Dispatcher
from numba.misc.appdirs import AppDirs

from template_control.compiling import TELLER

Decorator = Callable[[Callable[..., Any]], Any]

_LOG = logging.getLogger("template_control")
_PACKAGE = Path(__file__).parent
_NAME = _PACKAGE.name
_IMPORT = re.compile(rb"^(?:from|import) ([\w.]+)", re.MULTILINE)
_HOLDS_COMPILED = b"\nfrom template_control.compiled import"
_KEPT = 3  # folders of other contents: who goes back and forth in a history compiles once


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


def _folders(function: Callable[..., Any]) -> tuple[Path, ...]:
    """Of the packages that ``function`` is compiled from: this one, and its own."""
    package = sys.modules.get(function.__module__.partition(".")[0])
    path = getattr(package, "__path__", None)
    return (_PACKAGE,) if not path or Path(path[0]) == _PACKAGE else (_PACKAGE, Path(path[0]))


def _own_stamp(function: Callable[..., Any]) -> str:
    """Digest of the file of a function that belongs to no package, such as a script's; or ""."""
    if "." in function.__module__:
        return ""
    try:
        return sha256(Path(function.__code__.co_filename).read_bytes()).hexdigest()
    except OSError:
        return "no file"


def _places(folder: Path) -> list[Path]:
    """Where the cache of a package may lie, best first."""
    own = f"{folder.name}-{sha256(str(folder.resolve()).encode()).hexdigest()[:12]}"
    user = Path(AppDirs(appname=_NAME, appauthor=False).user_cache_dir) / own
    if config.CACHE_DIR:
        return [Path(config.CACHE_DIR) / own]
    return [folder / "__pycache__" / "compiled", user]


@cache
def cache_folder(folders: tuple[Path, ...]) -> Path | None:
    """Folder for the machine code of these packages' present content; None if none is writable.

    The first time, the folders of contents long gone are removed.
    """
    present = stamp(folders).digest
    if not present:
        return None
    for place in _places(folders[-1]):
        folder = place / present
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            others = [p for p in place.iterdir() if p.is_dir() and p != folder]
            ages = sorted((p.stat().st_mtime, p) for p in others)
        except OSError:
            continue
        for _, old in ages[: max(len(ages) - _KEPT + 1, 0)]:
            shutil.rmtree(old, ignore_errors=True)
        return folder
    _LOG.info("no folder is writable for compiled functions: they are compiled in every process")
    return None


class _Locator(_CacheLocator):
    """Tells Numba's cache where to look, and for which content."""

    def __init__(self, function: Callable[..., Any], folders: tuple[Path, ...]) -> None:
        self._function = function
        self._folders = folders
        self._py_file = function.__code__.co_filename  # Numba names it in warnings

    def get_cache_path(self) -> str:
        return str(cache_folder(self._folders))

    def get_source_stamp(self) -> str:
        return stamp(self._folders).digest + _own_stamp(self._function)

    def get_disambiguator(self) -> str:
        return f"{self._function.__module__}-{self._function.__code__.co_firstlineno}"

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator | None:
        folders = _folders(py_func)
        return cls(py_func, folders)


class _CacheImpl(CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _Cache(FunctionCache):
    """Numba's cache of one function, in our folder; it fails silently, never an import."""

    _impl_class = _CacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except (OSError, EOFError) as error:
            _LOG.debug("%s is not read from the cache: %s", self._name, error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        if not stamp(_folders(self._py_func)).holds:
            return  # the files have changed under this process: whose code is this?
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _LOG.debug("%s is not written to the cache: %s", self._name, error)


class _Listener(event.Listener):
    """Passes on that Numba compiles a function; one read from the cache is no event."""

    def on_start(self, event: Any) -> None:
        TELLER.begin()

    def on_end(self, event: Any) -> None:
        TELLER.end()


event.register("numba:compile", _Listener())


def _cached(dispatcher: Any) -> Any:
    function = dispatcher.py_func
    known = cache_folder(_folders(function)) and _own_stamp(function) != "no file"
    dispatcher._cache = _Cache(function) if known else NullCache()
    return dispatcher


def _options(**wanted: Any) -> dict[str, Any]:
    """Those of these options that this Numba has: all make code smaller, none changes results."""
    known = {}
    for name, value in wanted.items():
        try:
            njit(**{name: value})(lambda: 0)
        except (KeyError, TypeError):
            continue
        known[name] = value
    return known


# No function is called through a C pointer. The last one turns reference counting off, which
# functions that allocate nothing do not need: it costs a fifth to a third of a closed-form step.
_SMALL = _options(no_cfunc_wrapper=True)
_LEAN: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "arcp", "nsz"},
    **_SMALL,
    **_options(_nrt=False),
}
_BARE = _options(no_cpython_wrapper=True)


def compiled(function: Callable[..., Any]) -> Any:
    """For functions that Python calls, and that may allocate arrays."""
    return _cached(njit(**_SMALL)(function))


def entry(function: Callable[..., Any]) -> Any:
    """For functions that Python calls too, and that allocate no array."""
    return _cached(njit(**_LEAN)(function))


class _Inner:
    """Mixed into the dispatcher of an :func:`inner` function: from Python, Python runs it."""

    py_func: Callable[..., Any]

    def __call__(self, *arguments: Any) -> Any:
        return self.py_func(*arguments)


def inner(function: Callable[..., Any]) -> Any:
    """For functions that compiled ones call, and that allocate no array.

    They have no door to Python, which takes as long to compile as what is behind it. Called
    from Python all the same, as by a test, they run as Python.
    """
    dispatcher = _cached(njit(**_LEAN, **_BARE)(function))
    kind = type(dispatcher)
    if _BARE and issubclass(kind, Dispatcher):
        dispatcher.__class__ = _without_door(kind)
    return dispatcher


@cache
def _without_door(kind: type) -> type:
    return type("Inner", (_Inner, kind), {})
