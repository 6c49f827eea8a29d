"""Sweeps: one function over a grid or a sample of parameters, on any executor.

The function may do anything that returns plain data: a step of the template, a scenario, a
robot's run. Where it runs is the executor's affair: processes of this machine by default, or
whatever has ``submit`` like ``concurrent.futures``, a Dask cluster's ``client.get_executor()``
for one.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.progress import Progress

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.checks.fitting import check, shown
from template_control.checks.ranges import Count, Index, Range
from template_control.errors import SweepError
from template_control.sweep.executor import ExecutorLostError, check_pickles, run_calls
from template_control.sweep.file import Outcome, SweepFile
from template_control.terminal import bar, plain_console

Item = dict[str, Any]


@dataclass(frozen=True)
class SweepResult:
    """Results of a sweep, in the order of its items.

    Attributes:
        items: arguments of each call.
        seeds: of each call, whether the function takes one or not.
        results: what each call returned, as plain data; None where it failed.
        errors: None, or why it failed as 'TypeName: message'.
    """

    items: tuple[Item, ...]
    seeds: tuple[int, ...]
    results: tuple[Any, ...]
    errors: tuple[str | None, ...]

    @property
    def failures(self) -> dict[int, str]:
        """Reason by index of the items that failed."""
        return {i: error for i, error in enumerate(self.errors) if error is not None}

    def column(self, name: str | None = None) -> Array:
        """(n, ...) one entry of every result as numbers, NaN where an item failed.

        ``name`` is the entry's, of results that are dictionaries; None: the results themselves.

        Raises:
            SweepError: if a result has no such entry, or it is not numbers of one shape.
        """
        what = "the result" if name is None else repr(name)
        values: dict[int, Array] = {}
        for i, (result, error) in enumerate(zip(self.results, self.errors, strict=True)):
            if error is None:
                try:
                    value = result if name is None else result[name]
                    values[i] = np.asarray(value, dtype=np.float64)
                except (KeyError, TypeError, ValueError, IndexError):
                    raise SweepError(f"item {i}: {what} is missing or is no number") from None
        shapes = {value.shape for value in values.values()} or {()}
        if len(shapes) > 1:
            raise SweepError(f"{what} has another shape from item to item: {sorted(shapes)}")
        table = np.full((len(self.items), *shapes.pop()), np.nan)
        for i, value in values.items():
            table[i] = value
        return table


@dataclass(frozen=True)
class SweepOptions(Checked):
    """Options of :func:`sweep`.

    Attributes:
        progress: show a bar on stderr.
        label: of the bar and of error messages.
        retry_failed: repeat the items that failed according to the file.
        in_flight: number of items submitted at a time; at least the number of workers.

    Raises:
        SweepError: if no item may be in flight.
    """

    _error = SweepError

    progress: bool = True
    label: str = "sweep"
    retry_failed: bool = False
    in_flight: Count = 1000


def grid(**axes: Iterable[Any]) -> list[Item]:
    """All combinations of the axes' values, the last axis changing fastest.

    Raises:
        SweepError: if an axis is no list of values.
    """
    values = []
    for name, axis in axes.items():
        if isinstance(axis, str) or not isinstance(axis, Iterable):
            raise SweepError(f"axis {name} is {shown(axis)}: give a list of values")
        values.append(axis.tolist() if isinstance(axis, np.ndarray) else list(axis))
    return [dict(zip(axes, row, strict=True)) for row in product(*values)]


def sample(count: int, seed: int, **ranges: tuple[float, float]) -> list[Item]:
    """Uniform draws; a longer sample of one seed begins with the shorter one.

    Args:
        count: how many items.
        seed: of the draws, not negative.
        ranges: low and high of each parameter.

    Raises:
        SweepError: if a range is not two finite numbers, low first.
    """
    count = check("count", count, Annotated[int, Range(0, 10_000_000)], SweepError)
    seed = check("seed", seed, Index, SweepError)
    for name, bounds in ranges.items():
        pair = check(f"range {name}", bounds, tuple[float, float], SweepError)
        if pair[0] > pair[1]:
            raise SweepError(f"range {name} is {pair!r}: give (low, high)")
    low, high = np.array(list(ranges.values()), dtype=np.float64).reshape(-1, 2).T
    draws = np.random.default_rng(seed).uniform(low, high, (count, len(ranges)))
    return [dict(zip(ranges, row, strict=True)) for row in draws.tolist()]


def item_seed(seed: int, index: int) -> int:
    """Seed of one item: 64 bits of numpy's ``SeedSequence(seed, spawn_key=(index,))``.

    It depends on these two numbers only: not on the order items run in, on the executor or on
    what an earlier run of the sweep had finished.

    Args:
        seed: of the whole sweep, not negative.
        index: place of the item in the sweep, from 0.
    """
    seed, index = check("seed", seed, Index, SweepError), check("index", index, Index, SweepError)
    return int(np.random.SeedSequence(seed, spawn_key=(index,)).generate_state(1, np.uint64)[0])


def sweep(
    function: Callable[..., Any],
    items: Iterable[Mapping[str, Any]],
    path: str | Path | None = None,
    executor: Executor | None = None,
    seed: int = 0,
    options: SweepOptions = SweepOptions(),
) -> SweepResult:
    """Call ``function(**item)`` for every item; failures are recorded and do not end the sweep.

    A function with a parameter ``seed`` gets :func:`item_seed`. It returns plain data (see
    :func:`~template_control.storage.to_jsonable`), and for worker processes it is defined at the
    top level of a module. With a ``path`` every item is on disk as soon as it finishes. The same
    sweep run again, or one of more items that begins alike, goes on from there. The file knows the
    function by its name: give another path after a change of its code. Ctrl-C keeps the results
    that are there, those of the next half second too, and ends processes that the sweep has begun
    itself.

    Args:
        function: what to call.
        items: keyword arguments of each call, as of :func:`grid` or :func:`sample`.
        path: of the results file (JSON lines); None keeps the results in memory only.
        executor: where to run; None for one process a core, for the sweep's time.
        seed: from which the items' seeds are derived, not negative.
        options: bar, label, retries, number of items at a time.

    Raises:
        SweepError: if function and items do not fit, the file is another's or cannot be
            written, or the executor breaks down (what finished by then is in the file).
    """
    takes_seed, rows = _checked(function, items, seed)
    check_pickles(function, executor)
    seeds = tuple(item_seed(seed, i) for i in range(len(rows)))
    book = nullcontext() if path is None else SweepFile(path, function, rows, seed)
    with book as file, _bar(options.progress) as progress:
        ledger: dict[int, Outcome] = {} if file is None else file.finished
        if options.retry_failed:
            ledger = {i: outcome for i, outcome in ledger.items() if outcome.error is None}
        failed = sum(outcome.error is not None for outcome in ledger.values())
        task = progress.add_task(
            options.label, total=len(rows), completed=len(ledger), failed=failed
        )

        def keep(index: int, outcome: Outcome) -> None:
            nonlocal failed
            if file is not None:
                file.append(index, seeds[index], outcome)
            ledger[index] = outcome
            failed += outcome.error is not None
            progress.update(task, completed=len(ledger), failed=failed)

        waiting = [i for i in range(len(rows)) if i not in ledger]
        calls = ((i, rows[i] | ({"seed": seeds[i]} if takes_seed else {})) for i in waiting)
        try:
            if waiting:
                run_calls(function, calls, executor, options.in_flight, keep, progress.refresh)
        except ExecutorLostError as error:
            kept = (
                "nothing is kept: give a path, to go on from there the next time"
                if path is None
                else f"{len(ledger)} of {len(rows)} results are safe in {path}: run the same"
                " sweep again, it goes on from there"
            )
            raise SweepError(
                f"{options.label}: the executor broke down ({error}); {kept}"
            ) from None
    outcomes = [ledger[i] for i in range(len(rows))]
    results = tuple(outcome.result for outcome in outcomes)
    return SweepResult(tuple(rows), seeds, results, tuple(outcome.error for outcome in outcomes))


def _checked(
    function: Callable[..., Any], items: Iterable[Mapping[str, Any]], seed: int
) -> tuple[bool, list[Item]]:
    """True if the function has a parameter ``seed``, and the items after a check of their names."""
    if seed < 0:
        raise SweepError(f"seed is {seed}: give at least 0")
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        raise SweepError(f"{function!r} shows no parameters: give a function of Python") from None
    seeds = {"seed": seed} if "seed" in signature.parameters else {}
    rows: list[Item] = []
    fitting: set[tuple[str, ...]] = set()
    for i, item in enumerate(items):
        if not isinstance(item, Mapping) or "seed" in item:
            raise SweepError(
                f"item {i} is {item!r}: give a dictionary of the function's arguments, without"
                " 'seed', which the sweep deals out"
            )
        rows.append(dict(item))
        names = tuple(item)
        if names not in fitting:
            try:
                signature.bind(**item, **seeds)
            except TypeError as error:
                raise SweepError(f"item {i} does not fit the function: {error}") from None
            fitting.add(names)
    return bool(seeds), rows


def _bar(shown: bool) -> Progress:
    """Bar on stderr; without a thread of its own, as workers may be forked meanwhile."""
    return bar(
        plain_console(stderr=True),
        "{task.fields[failed]} failed",
        auto_refresh=False,
        redirect_stdout=False,
        redirect_stderr=False,
        disable=not shown,
    )
