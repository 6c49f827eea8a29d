"""Calls of one function on an executor with the ``submit`` of ``concurrent.futures``."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, nullcontext
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any

from threadpoolctl import threadpool_limits

from template_control.errors import SweepError
from template_control.storage import to_jsonable
from template_control.sweep.file import Outcome

_REFRESH = 0.2  # [s] between two looks of the progress bar
_GRACE = 0.5  # [s] in which calls and threads may end that Ctrl-C found running


class ExecutorLostError(Exception):
    """Failure of the executor, as opposed to a failure of a call."""


def check_pickles(function: Callable[..., Any], executor: Executor | None) -> None:
    """Check, before the first call, that the function can be sent to worker processes."""
    # Dask sends what pickle cannot.
    if executor is not None and not isinstance(executor, ProcessPoolExecutor):
        return
    try:
        pickle.dumps(function)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise SweepError(
            f"the function cannot go to worker processes ({error}):"
            " define it at the top level of a module"
        ) from None


def run_calls(
    function: Callable[..., Any],
    calls: Iterator[tuple[int, dict[str, Any]]],
    executor: Executor | None,
    in_flight: int,
    keep: Callable[[int, Outcome], None],
    refresh: Callable[[], None],
) -> None:
    """Submit calls to the executor and keep each outcome, also those finished before an error.

    ``calls`` are index and keyword arguments, of which ``in_flight`` are with the executor at a
    time; None stands for processes of this machine. ``refresh`` is called a few times a second. An
    ExecutorLostError if the executor cannot go on.
    """
    # Dask takes calls with equal arguments for one, whose outcome it may still hold.
    token = uuid.uuid4().hex
    done: SimpleQueue[Future[Outcome]] = SimpleQueue()
    under_way: dict[Future[Outcome], int] = {}
    due = time.monotonic()
    with workers() if executor is None else nullcontext(executor) as pool:
        try:
            while True:
                for index, arguments in islice(calls, in_flight - len(under_way)):
                    try:
                        future = pool.submit(_call, token, function, arguments)
                    except RuntimeError as error:  # BrokenExecutor; or a pool that was shut down
                        raise ExecutorLostError(str(error)) from None
                    under_way[future] = index
                    future.add_done_callback(done.put)
                if not under_way:
                    return
                if time.monotonic() >= due:
                    refresh()
                    due = time.monotonic() + _REFRESH
                try:
                    future = done.get(timeout=_REFRESH)
                except Empty:
                    continue
                keep(under_way[future], _outcome(future))
                del under_way[future]
        except BaseException as error:
            if not isinstance(pool, _Workers):
                for future in under_way:
                    future.cancel()
            if isinstance(error, SweepError):
                raise
            # Our own processes are ended next: what needs little more time gets it.
            running = [future for future in under_way if future.running()]
            wait(running, _GRACE if executor is None else 0.0)
            for future, index in under_way.items():
                if future.done() and not future.cancelled() and future.exception() is None:
                    keep(index, future.result())
            raise


def _call(_: str, function: Callable[..., Any], arguments: dict[str, Any]) -> Outcome:
    """Outcome of one call, in the worker; exceptions are caught."""
    with _no_interrupt():
        try:
            return Outcome(to_jsonable(function(**arguments)), None)
        except (Exception, SystemExit) as error:
            return Outcome(None, f"{type(error).__name__}: {error}")


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Ignore Ctrl-C in a worker, where it would end a robot's run early without a trace."""
    if (
        multiprocessing.parent_process() is None
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _outcome(future: Future[Outcome]) -> Outcome:
    if future.cancelled():
        raise ExecutorLostError("it cancelled a call")
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, BrokenExecutor):
        raise ExecutorLostError(str(error))
    if isinstance(error, KeyboardInterrupt):
        raise error
    return Outcome(None, f"{type(error).__name__}: {error}")


class _Workers(ProcessPoolExecutor):
    """Process pool of :func:`workers`, which cancels its pending calls as it ends.

    To cancel them one by one makes it fail if a process dies meanwhile.
    """


@contextmanager
def workers(count: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """Worker processes for the time of a ``with`` block, one a core or ``count``.

    They leave Ctrl-C to this process, and end with it however it ends. An error in the block,
    Ctrl-C for one, kills them whatever they are doing.
    """
    others, threads = set(multiprocessing.active_children()), set(threading.enumerate())
    pool = _Workers(count, initializer=_begin_worker)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.kill()
        # The pool's thread closes a pipe last. Python's exit, in that moment, writes to it.
        for thread in set(threading.enumerate()) - threads:
            if not thread.daemon:
                thread.join(_GRACE)
        raise
    pool.shutdown(cancel_futures=True)


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, and end with it once compiled code returns (in a worker).

    Linear algebra has one thread. More wait for work in a loop, on the core of another worker.
    """
    threadpool_limits(1, user_api="blas")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A command line handles these in the parent; the executor ends its processes with the first.
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    if parent is not None:

        def watch() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()
