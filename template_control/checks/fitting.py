"""Fitting of a value to an annotation, and the words of messages about it."""

from __future__ import annotations

import inspect
import math
import types
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from functools import cache, partial
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Literal,
    NoReturn,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
)

import numpy as np
from numpy.typing import ArrayLike

from template_control.checks.ranges import Range, Rising, Shape
from template_control.errors import DivergedError, ParameterError, TemplateControlError

_LONGEST = 60  # characters of a value that a message shows


def shown(value: Any) -> str:
    """A value for a message, on one line and not long."""
    try:
        text = f"{value:g}" if isinstance(value, float) else repr(value)
    except Exception:  # a stranger's __repr__ may do anything
        text = f"a {type(value).__name__}"
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def inward(low: float, high: float) -> str:
    """A range for a message, of about three digits, rounded so that both ends lie in it."""
    size = max(abs(low), abs(high))
    step = 10.0 ** (math.floor(math.log10(size)) - 2) if size > 0.0 else 1.0
    first, last = math.ceil(low / step - 1e-9) * step, math.floor(high / step + 1e-9) * step
    if first > last:
        return f"{low!r} to {high!r}"
    return f"{first:.5g} to {last:.5g}"


def unaliased(hint: Any) -> Any:
    """The annotation that a type alias stands for, such as NumPy's NDArray from Python 3.12 on."""
    value = getattr(get_origin(hint) or hint, "__value__", None)
    if value is None:
        return hint
    arguments = get_args(hint)
    return value[arguments] if arguments else value


_WORDS: dict[Any, str] = {
    float: Range().words("number"),
    int: Range().words("whole number"),
    **dict.fromkeys((list, Sequence), "a list"),
    **dict.fromkeys((dict, Mapping), "a mapping"),
}


def words_for(hint: Any) -> str:
    """Words for what fits an annotation, for a message."""
    hint = unaliased(hint)
    origin, args = get_origin(hint), get_args(hint)
    if origin is Literal:
        return "one of " + ", ".join(dict.fromkeys(repr(x) for x in args))
    if origin is Annotated:
        return next(
            (
                extra.words("whole number" if args[0] is int else "number")
                for extra in args[1:]
                if isinstance(extra, Range)
            ),
            words_for(args[0]),
        )
    if origin is tuple:
        if len(args) == 2 and args[1] is Ellipsis:
            return "a tuple"
        each = list(dict.fromkeys(words_for(x) for x in args))
        if len(each) == 1:
            return f"{len(args)} times {each[0]}"
        return ", ".join(each)
    if (origin or hint) in _WORDS:
        return _WORDS[origin or hint]
    if isinstance(hint, type) and issubclass(hint, Enum):
        return f"a {hint.__name__}: " + ", ".join(str(member) for member in hint)
    name = getattr(hint, "__name__", str(hint))
    return f"{'an' if name[:1] in 'AEIOU' else 'a'} {name}"


class Refused(ArgumentTypeError):
    """A value does not fit; its text, which ``argparse`` shows, says what would."""


def check(
    where: str, value: Any, hint: Any, error: type[TemplateControlError] = ParameterError
) -> Any:
    """A value as its annotation wants it: tuples for lists and arrays, plain numbers for NumPy's.

    ``where`` names the value in the message of ``error``, which says what would fit.
    """
    try:
        return fitter(hint)(value)
    except Refused as refused:
        raise error(f"{where} is {shown(value)}: give {refused}") from None


_PLANS: dict[int, tuple[Any, Callable[[Any], Any]]] = {}
"""Functions that fit values to annotations, by the annotation's identity: hashing takes long."""


def fitter(hint: Any) -> Callable[[Any], Any]:
    """Function that fits values to an annotation as :func:`check`, but raises :class:`Refused`."""
    known = _PLANS.get(id(hint))
    if known is None:
        known = _PLANS[id(hint)] = hint, _plan(hint)  # held here, its identity stays its own
    return known[1]


def _plan(hint: Any) -> Callable[[Any], Any]:
    if hint in _SIMPLE:
        return _SIMPLE[hint]
    hint = unaliased(hint)
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _annotated(args[0], args[1:])
    if origin in (Union, types.UnionType):
        return partial(_one_of, hints=args)
    if origin in (list, Sequence):
        hint, origin = types.GenericAlias(tuple, (args[0], ...)), tuple
    if origin is np.ndarray:
        return partial(_array, kind=_kind(hint))
    if origin in _COMPOUND:
        return partial(_COMPOUND[origin], hint=hint)
    if isinstance(hint, type):
        return partial(_instance, kind=hint)
    return _as_is


def _annotated(inner: Any, extras: tuple[Any, ...]) -> Callable[[Any], Any]:
    for extra in extras:
        if isinstance(extra, Range):
            return partial(_number, within=extra, whole=inner is int)
        if isinstance(extra, Shape):
            return partial(_shaped, fit=fitter(inner), shape=extra)
        if isinstance(extra, Rising):
            return partial(_rising, fit=fitter(inner))
    return fitter(inner)


def _shaped(value: Any, fit: Callable[[Any], Any], shape: Shape) -> Any:
    array = fit(value)
    if not shape.holds(array.shape):
        had = f"; it has {len(array)}" if array.ndim == 1 and len(shape.sizes) == 1 else ""
        raise Refused(shape.words + had)
    if shape.finite and not np.isfinite(array).all():
        raise Refused(shape.words)
    return array


def _rising(value: Any, fit: Callable[[Any], Any]) -> Any:
    low, high = fit(value)
    if not low < high:
        raise Refused("two numbers, the smaller one first")
    return low, high


def _number(value: Any, within: Range, whole: bool = False) -> Any:
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    kinds = (int, np.integer) if whole else (int, np.integer, float, np.floating)
    fits = isinstance(value, kinds) and not isinstance(value, bool | np.bool_)
    try:
        number = (int if whole else float)(value) if fits else math.nan
    except OverflowError:
        number = math.nan
    if not within.holds(number):
        raise Refused(within.words("whole number" if whole else "number"))
    # A member of an enumeration stays one.
    kept = isinstance(value, Enum) or type(value) is type(number)
    return value if kept else number


def _as_is(value: Any) -> Any:
    return value


def _member(value: Any, of: tuple[type, ...], words: str) -> Any:
    if not isinstance(value, of):
        raise Refused(words)
    return bool(value) if isinstance(value, np.bool_) else value


_SIMPLE: dict[Any, Callable[[Any], Any]] = {
    Any: _as_is,
    object: _as_is,
    float: partial(_number, within=Range()),
    int: partial(_number, within=Range(), whole=True),
    bool: partial(_member, of=(bool, np.bool_), words="True or False"),
    str: partial(_member, of=(str,), words="a text"),
    Path: partial(_member, of=(Path,), words="a path"),
    type(None): partial(_member, of=(type(None),), words="None"),
    ArrayLike: lambda value: _array(value, np.float64),
}


def _one_of(value: Any, hints: tuple[Any, ...]) -> Any:
    if value is None and type(None) in hints:
        return None
    reasons: dict[str, None] = {}  # that of None is the last
    for hint in sorted(hints, key=lambda hint: hint is type(None)):
        try:
            return fitter(hint)(value)
        except Refused as refused:
            reasons[str(refused)] = None
    raise Refused(" or ".join(reasons))


def _items(value: Any, hint: Any) -> list[Any]:
    """Entries of a sequence; an array's rows become lists."""
    if isinstance(value, np.ndarray) and value.ndim > 0:
        return list(value.tolist())
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise Refused(words_for(hint))
    return list(value)


def _tuple(value: Any, hint: Any) -> tuple[Any, ...]:
    hints = get_args(hint)
    many = len(hints) == 2 and hints[1] is Ellipsis
    items = _items(value, hint)
    if not many and len(items) != len(hints):
        raise Refused(words_for(hint))
    each = [hints[0]] * len(items) if many else hints
    try:
        found = tuple(fitter(h)(item) for item, h in zip(items, each, strict=True))
    except Refused as refused:
        raise Refused(f"{words_for(hint)}; each {refused}" if many else words_for(hint)) from None
    unchanged = isinstance(value, tuple) and all(a is b for a, b in zip(found, value, strict=True))
    return value if unchanged else found


def _literal(value: Any, hint: Any) -> Any:
    if not any(type(value) is type(x) and value == x for x in get_args(hint)):
        raise Refused(words_for(hint))
    return value


def _mapping(value: Any, hint: Any) -> Any:
    if not isinstance(value, Mapping):
        raise Refused(words_for(hint))
    key_hint, value_hint = get_args(hint)
    found = {}
    for key, entry in value.items():
        where = "each key "
        try:
            fitted = fitter(key_hint)(key)
            where = ""
            found[fitted] = fitter(value_hint)(entry)
        except Refused as refused:
            where = where or f"{key} is {shown(entry)}, which should be "
            raise Refused(f"{words_for(hint)}; {where}{refused}") from None
    same = all(found.get(key) is entry for key, entry in value.items())
    return value if same else found


def _kind(hint: Any) -> Any:
    """Type of an annotated array's entries."""
    wanted = get_args(get_args(hint)[1])
    return wanted[0] if wanted and isinstance(wanted[0], type) else np.float64


def _array(value: Any, kind: Any) -> Any:
    if type(value) is np.ndarray and value.dtype == kind:
        return value  # as most are: what is below takes three times as long
    try:
        found = np.asarray(value)
        numbers = found.dtype.kind in "biufc"
        found = found.astype(kind, copy=False) if numbers else found
    except (TypeError, ValueError, OverflowError):
        numbers = False
    if not numbers:
        raise Refused("an array of numbers")
    return found


def _called(value: Any, hint: Any) -> Any:
    if not callable(value):
        raise Refused("a function")
    return value


def _iterable(value: Any, hint: Any) -> Any:
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        raise Refused("a list")
    return value


_COMPOUND: dict[Any, Callable[..., Any]] = {
    Literal: _literal,
    tuple: _tuple,
    Mapping: _mapping,
    dict: _mapping,
    Callable: _called,
    Iterable: _iterable,
}


def _instance(value: Any, kind: type) -> Any:
    if getattr(kind, "_is_protocol", False):
        missing = [name for name in members(kind) if not _has(value, name)]
        if isinstance(value, type) or 2 * len(missing) > len(members(kind)) + 1:
            raise Refused(words_for(kind))
        if missing:  # meant as one, as it seems
            base = inspect.isabstract(kind) and kind not in type(value).__mro__
            mend = f": derive it from {kind.__name__}" if base else ""
            raise Refused(f"{words_for(kind)} (this one lacks {', '.join(missing)}{mend})")
        return value
    if not isinstance(value, kind):
        raise Refused(words_for(kind))
    return value


def _has(value: Any, name: str) -> bool:
    return inspect.getattr_static(value, name, _has) is not _has or hasattr(value, name)


@cache
def members(kind: type) -> tuple[str, ...]:
    """Names that a protocol asks for."""
    names = [
        name
        for part in kind.__mro__
        if getattr(part, "_is_protocol", False)
        for name in (*vars(part), *vars(part).get("__annotations__", ()))
        if not name.startswith("_")
    ]
    return tuple(dict.fromkeys(names))


P = ParamSpec("P")
T = TypeVar("T")


def asked(method: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Call a method; an error goes up with the name of its class and method.

    A planner's, route's or task's own state that is not finite is no divergence of the run, but a
    ParameterError.
    """
    try:
        return method(*args, **kwargs)
    except Exception as error:
        blame(error, method)


def blame(error: Exception, method: Callable[..., Any]) -> NoReturn:
    """Raise an error that came up in a method, as :func:`asked` does."""
    if isinstance(error, TemplateControlError):
        kind = ParameterError if isinstance(error, DivergedError) else type(error)
        raise kind(f"{name_of(method)}: {error}") from error
    error.add_note(f"It came up in {name_of(method)}.")
    raise error


def answered(kind: type[T], method: Callable[P, Any], *args: P.args, **kwargs: P.kwargs) -> T:
    """As :func:`asked`; a ParameterError if the method returns another kind of object."""
    return _of_kind(kind, method, asked(method, *args, **kwargs))


def answered_or_none(
    kind: type[T], method: Callable[P, Any], *args: P.args, **kwargs: P.kwargs
) -> T | None:
    """As :func:`answered`, of a method that may return None as well."""
    answer = asked(method, *args, **kwargs)
    return None if answer is None else _of_kind(kind, method, answer)


def _of_kind(kind: type[T], method: Callable[..., Any], answer: Any) -> T:
    if not isinstance(answer, kind):
        raise ParameterError(
            f"{name_of(method)} returned {shown(answer)}: return a {kind.__name__}"
        )
    return answer


def name_of(method: Callable[..., Any]) -> str:
    """Class and name of a bound method, for a message; of anything else, the object itself."""
    owner = getattr(method, "__self__", None)
    name = getattr(method, "__name__", None)
    return shown(method) if owner is None or name is None else f"{type(owner).__name__}.{name}"
