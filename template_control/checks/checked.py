"""Checks of a user's values against the types that fields and parameters declare.

A dataclass that inherits :class:`Checked`, and a function decorated with :func:`checked`, take
what fits their annotations and refuse the rest in one line. The annotation says the range too::

    @dataclass(frozen=True)
    class Options(Checked):
        steps: Count | None = None
        friction: Positive = 0.7
        start: tuple[float, float, float] = (1.1, 0.98, 0.0)

Arrays and lists are welcome where a tuple is declared, and NumPy's numbers where a number is;
they become tuples and plain numbers. A number is finite, if its range does not say otherwise.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, Field, fields
from functools import cache, wraps
from itertools import chain, repeat
from types import SimpleNamespace
from typing import Any, ClassVar, ParamSpec, TypeVar, get_type_hints

import numpy as np

from template_control.checks.fitting import Refused, check, fitter
from template_control.errors import ParameterError, TemplateControlError

P = ParamSpec("P")
T = TypeVar("T")


class Checked:
    """Base of frozen dataclasses whose fields are checked when one is made.

    A subclass with a ``__post_init__`` of its own calls this one first. Instances are equal if
    their fields are, arrays too; their ``repr`` has the fields that are not as by default.
    """

    _error: ClassVar[type[TemplateControlError]] = ParameterError

    def __init_subclass__(cls) -> None:
        """Give the class these two before ``dataclass`` does, which keeps what a class has."""
        for name, method in (("__repr__", _brief), ("__eq__", _equal)):
            if name not in vars(cls):
                setattr(cls, name, method)

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, hint, fit in _fields(kind):
            value = getattr(self, name)
            try:
                found = fit(value)
            except Refused:
                check(f"{kind.__name__}.{name}", value, hint, self._error)
                raise
            if found is not value:
                object.__setattr__(self, name, found)


def _brief(options: Any) -> str:
    shown = [
        f"{f.name}={getattr(options, f.name)!r}"
        for f in fields(options)
        if f.repr and not is_default(f, getattr(options, f.name))
    ]
    return f"{type(options).__qualname__}({', '.join(shown)})"


def _equal(options: Any, other: Any) -> Any:
    if type(options) is not type(other):
        return NotImplemented
    return all(_same(getattr(options, f.name), getattr(other, f.name)) for f in fields(options))


def _same(value: Any, other: Any) -> bool:
    if isinstance(value, np.ndarray):
        return np.array_equal(value, other)
    return value is other or bool(value == other)


def default_of(f: Field[Any]) -> Any:
    """Default of a dataclass field; ``dataclasses.MISSING`` where it has none."""
    return f.default if f.default_factory is MISSING else f.default_factory()


def is_default(f: Field[Any], value: Any) -> bool:
    """True if the value of a dataclass field is its default."""
    return _same(value, default_of(f))


@cache
def _fields(kind: Any) -> tuple[tuple[str, Any, Callable[[Any], Any]], ...]:
    """Names, annotations, and what fits a value to each."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple((name, hints[name], fitter(hints[name])) for name in kind.__dataclass_fields__)


def checked(function: Callable[P, T]) -> Callable[P, T]:
    """Let a function check its arguments against its annotations.

    The function has neither ``*args`` nor ``**kwargs``. What does not fit is a
    :class:`~.errors.ParameterError`; a wrong number of arguments stays a TypeError.
    """
    names = list(inspect.signature(function).parameters)
    owner, _, name = function.__qualname__.rpartition(".")
    called = owner if name == "__init__" else name

    @cache
    def hints() -> dict[str, Any]:
        # Not before the first call: a module that is being imported knows not all its names.
        wanted = {k: v for k, v in function.__annotations__.items() if k != "return"}
        holder = SimpleNamespace(__annotations__=wanted)
        return get_type_hints(holder, function.__globals__, include_extras=True)

    def fitting(key: str, value: Any) -> Any:
        known = hints()
        if key not in known:  # self; or one too many, which Python reports
            return value
        return check(f"{called}: {key}", value, known[key])

    @wraps(function)
    def with_checks(*args: P.args, **kwargs: P.kwargs) -> T:
        # Not by Signature.bind, which takes as long as the check.
        keys = chain(names, repeat(""))
        named: dict[str, Any] = {k: fitting(k, v) for k, v in kwargs.items()}
        return function(*map(fitting, keys, args), **named)

    return with_checks
