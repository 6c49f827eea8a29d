"""How compiled functions are made, and kept from one process to the next.

Every compiled function of the package is decorated with :data:`compiled` or :data:`inner`.
Numba's own cache knows a function's file only, and would go on with machine code whose
callees, in other files, have changed since. The cache here is one folder for one content of
all the files that compiled code comes from.
"""

from __future__ import annotations

import gc
import logging
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import config, event
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache, _CacheLocator
from numba.core.dispatcher import Dispatcher
from numba.extending import overload
from numba.misc.appdirs import AppDirs

from template_control.code_cache.linked import LinkedCompiler, is_linked, rebuild
from template_control.code_cache.source_stamp import stamp
from template_control.compiling import TELLER
from template_control.file_lock import FileLock, locked

Decorator = Callable[[Callable[..., Any]], Any]

_LOG = logging.getLogger("template_control")
_PACKAGE = Path(__file__).parent
_NAME = _PACKAGE.name
_KEPT = 3  # folders of other contents: who goes back and forth in a history compiles once


def packages_of(function: Callable[..., Any]) -> tuple[Path, ...]:
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
        folders = packages_of(py_func)
        return cls(py_func, folders)


class _CacheImpl(CompileResultCacheImpl):
    _locator_classes = (_Locator,)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        if is_linked(payload):
            return rebuild(target_context, payload)
        return super().rebuild(target_context, payload)


class _Cache(FunctionCache):
    """Numba's cache of one function, in our folder; it fails silently, never an import.

    A function that several processes need is compiled by one of them. The others wait for it.
    They do not wait in a circle: who compiles a function waits only for those that it calls.
    """

    _impl_class = _CacheImpl

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._locks: dict[Any, FileLock] = {}

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = self._read(sig, target_context)
        if found is None and sig not in self._locks:
            name = sha256(repr((self._impl.filename_base, sig)).encode()).hexdigest()[:16]
            lock = self._locks[sig] = FileLock(lock_folder(Path(self.cache_path)) / name)
            if not lock.take():
                with TELLER.waiting():
                    lock.wait(TELLER.look)
            found = self._read(sig, target_context)
            if found is not None:
                self.release(sig)
        return found

    def _read(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except (OSError, EOFError) as error:
            _LOG.debug("%s is not read from the cache: %s", self._name, error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            # If the files have changed under this process, whose code is this?
            if stamp(packages_of(self._py_func)).holds:
                # Numba reads the function's index, adds to it and writes it.
                with locked(lock_folder(Path(self.cache_path)) / self._impl.filename_base):
                    super().save_overload(sig, data)
                TELLER.kept += 1
        except OSError as error:
            _LOG.debug("%s is not written to the cache: %s", self._name, error)
        finally:
            self.release(sig)

    def release(self, sig: Any) -> None:
        """Let others compile the function for ``sig``."""
        lock = self._locks.pop(sig, None)
        if lock is not None:
            lock.release()


def lock_folder(folder: Path) -> Path:
    """Where the locks of a cache folder lie."""
    return folder / "locks"


@contextmanager
def uncollected() -> Iterator[None]:
    """While this lasts, Python's collector rests.

    It would look at the many objects of Numba again and again, which takes a fifth of all the
    time. What they leave is collected afterwards.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


class _Listener(event.Listener):
    """Takes part when Numba compiles a function; one read from the cache is no event."""

    def __init__(self) -> None:
        self._resting = ExitStack()
        self._depth = 0

    def on_start(self, event: Any) -> None:
        TELLER.begin()
        if self._depth == 0:
            self._resting.enter_context(uncollected())
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._resting.close()
        TELLER.end()
        cache = event.data["dispatcher"]._cache
        if sys.exc_info()[0] is not None and isinstance(cache, _Cache):
            cache.release(tuple(event.data["args"]))  # what fails is not saved


event.register("numba:compile", _Listener())


def _cached(dispatcher: Any) -> Any:
    function = dispatcher.py_func
    known = cache_folder(packages_of(function)) and _own_stamp(function) != "no file"
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
    return _doorless(function, **_LEAN)


def callee(function: Callable[..., Any]) -> Any:
    """As :func:`inner`, for functions that :data:`compiled` ones call; they may allocate arrays."""
    return _doorless(function, **_SMALL)


def inner_by_type(function: Callable[..., Any]) -> Decorator:
    """Decorates what chooses, by its arguments' types, the code of an :func:`inner` function.

    Args:
        function: what Python runs; compiled functions call it by this name.
    """
    options = {**_LEAN, "pipeline_class": LinkedCompiler}
    # Not strict: the choices have type hints of their own.
    return overload(function, jit_options=options, strict=False, prefer_literal=True)


def _doorless(function: Callable[..., Any], **options: Any) -> Any:
    if not _BARE:
        return _cached(njit(**options)(function))
    dispatcher = _cached(njit(**options, **_BARE, pipeline_class=LinkedCompiler)(function))
    kind = type(dispatcher)
    if issubclass(kind, Dispatcher):
        dispatcher.__class__ = _without_door(kind)
    return dispatcher


@cache
def _without_door(kind: type) -> type:
    return type("Inner", (_Inner, kind), {})
