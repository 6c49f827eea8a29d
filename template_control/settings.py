"""Options as TOML: nested dataclasses to tables and back.

A dataclass is a table, its fields are the keys. A tuple is a list, an enumeration's member is its
name in lower case, a field that is None is left out, or is "none" where that is not its default.
Where a field may hold one of several dataclasses, the key ``kind`` says which by the class
attribute of that name. A class with presets has them by the value of its field ``kind`` in the
class method ``of_kind``: its table has the keys that differ. Keys that a field had before are in
the class attribute ``old_keys``. What TOML cannot say, such as a table of tasks, is given in Python
only.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import MISSING, fields, is_dataclass, replace
from datetime import date, time
from enum import Enum
from functools import cache
from inspect import getdoc
from pathlib import Path
from types import MappingProxyType, NoneType, UnionType
from typing import Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
import tomli_w

from template_control.checks.checked import default_of, is_default
from template_control.checks.fitting import unaliased
from template_control.errors import ParameterError, TemplateControlError, meant

_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)

T = TypeVar("T")

_OF_TOML = (bool, int, float, str, list, dict, date, time)
_KIND = "kind"
_PRESETS = "of_kind"
_NONE = "none"
PYTHON_ONLY = {"python_only": True}  # metadata of a field that a file leaves out

_NUMBERS = re.compile(r"""\[\n((?:\ +[^\s"'\[\]{},]+,\n)+)\ *\]""")
"""A list of numbers, one a line, as ``tomli_w`` writes it: texts have quotes, and no line break."""
_ATTRIBUTES = re.compile(r"^(?:Attributes|Args):\n((?:(?:    .*)?\n?)+)", re.MULTILINE)
_ATTRIBUTE = re.compile(r"^    (\w+(?:, \w+)*): ((?:.|\n {8,})*)", re.MULTILINE)
_SCALARS = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text in quotes",
}


def read(kind: type[T], path: str | Path) -> T:
    """A dataclass from a TOML file; a ParameterError names the file and the key."""
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ParameterError(f"cannot read {path}: {error.strerror}; give a TOML file") from None
    except (ValueError, RecursionError) as error:  # of the parser, of UTF-8, of dates, of numbers
        raise ParameterError(f"{path} is no TOML: {error}") from None
    try:
        return from_table(kind, table)
    except ValueError as error:
        raise ParameterError(f"{path}: {error}") from None


class _Keys(dict[str, Any]):
    """Table of the keys to set in ``base``, a dataclass that has the others already."""

    def __init__(self, base: Any, keys: Mapping[str, Any] = MappingProxyType({})) -> None:
        super().__init__(keys)
        self.base = base


def from_table(kind: type[T], table: Any, where: str = "") -> T:
    """A dataclass from a table of :mod:`tomllib`; ``where`` is its own key for messages."""
    if not isinstance(table, dict):
        raise ParameterError(f"{where} is {table!r}: give a table")
    base = table.base if isinstance(table, _Keys) else None
    known = {f.name: f for f in fields(kind) if f.init}  # type: ignore[arg-type]
    hints = _hints(kind)
    preset = None
    if hasattr(kind, _PRESETS):
        preset = base = _preset(kind, base, table, where)
    values: dict[str, Any] = {}
    for name, (place, value) in _by_name(kind, table, where).items():
        if name == _KIND and name not in known and hasattr(kind, _KIND):
            continue
        if name not in known:
            raise _unknown(place, name, known)
        if isinstance(value, dict) and not isinstance(value, _Keys):
            usual = getattr(default_of(known[name]), _KIND, None)
            if is_dataclass(getattr(preset, name, None)):
                value = _Keys(getattr(preset, name), value)
            elif usual is not None:
                value = {_KIND: usual, **value}
        values[name] = _read(hints[name], value, place)
    if type(base) is kind:
        return _made(lambda: replace(base, **values), kind, where)  # type: ignore[type-var]
    if base is not None:
        shared = [(f, getattr(base, f.name)) for f in fields(base) if f.name in known]
        values = {f.name: value for f, value in shared if not is_default(f, value)} | values
    for name, f in known.items():
        if name not in values and default_of(f) is MISSING:
            raise ParameterError(f"{where or 'the table'} has no {name}: give one")
    return _made(lambda: kind(**values), kind, where)


def _preset(kind: Any, base: Any, table: Mapping[str, Any], where: str) -> Any:
    """Preset of a table's ``kind``, with what ``base`` has otherwise than its own preset."""
    place = f"{where}.{_KIND}" if where else _KIND
    wanted = table.get(_KIND, getattr(base or kind, _KIND))
    found = kind.of_kind(_read(_hints(kind)[_KIND], wanted, place))
    if base is None:
        return found
    usual = kind.of_kind(base.kind)
    own = {f.name: getattr(base, f.name) for f in fields(base)}
    return replace(found, **{k: v for k, v in own.items() if v != getattr(usual, k)})


def _by_name(kind: Any, table: Mapping[str, Any], where: str) -> dict[str, tuple[str, Any]]:
    """A table's values by the fields' names of today, each with its key for messages."""
    old_keys: Mapping[str, str] = getattr(kind, "old_keys", {})
    now = {key: old_keys.get(key, key) for key in table}
    found: dict[str, tuple[str, Any]] = {}
    for key in sorted(table, key=lambda key: now[key].count(".")):
        name, _, inner = now[key].partition(".")
        place = f"{where}.{key}" if where else key
        if not inner and name not in found:
            found[name] = place, table[key]
            continue
        # Of an inner table by now.
        held = copy(found[name][1]) if name in found else _opened(table, name, place)
        if not inner or inner in held:
            raise ParameterError(f"{place} is given by two keys: give {now[key]} only")
        held[inner] = table[key]
        found[name] = place.removesuffix(key) + name, held
    return found


def _unknown(place: str, name: str, known: Iterable[str]) -> ParameterError:
    near = meant(name, known)
    return ParameterError(f"unknown key {place}{near}: known are {', '.join(known)}")


def _made(make: Callable[[], T], kind: type, where: str) -> T:
    """Dataclass from ``make``, whose errors name the key and not the class."""
    try:
        return make()
    except TemplateControlError as error:
        text = str(error).replace(f"{kind.__name__}.", f"{where}." if where else "")
        raise type(error)(text) from None


def changed(options: T, keys: Mapping[str, Any]) -> T:
    """A dataclass with some of its keys set; a ParameterError names one that is unknown or wrong.

    ``keys`` are dotted, such as ``{"world.friction": 0.5}``, with values as in TOML or as the
    fields hold them. Another ``kind`` keeps what was set and both kinds have.
    """
    table: dict[str, Any] = _Keys(options)
    for key, value in sorted(keys.items(), key=lambda item: item[0].count(".")):
        *path, last = key.split(".")
        inner = table
        for depth, name in enumerate(path, 1):
            opened = _opened(inner, name, ".".join(path[:depth]))
            inner[name] = opened
            inner = opened
        inner[last] = value
    return from_table(type(options), table)


def _opened(table: Mapping[str, Any], name: str, where: str) -> dict[str, Any]:
    """What a table holds under a name, as a table in which keys can be set."""
    base = table.base if isinstance(table, _Keys) else None
    value: Any = table.get(name, getattr(base, name, None))
    if isinstance(value, _Keys):
        return value
    if value is None or isinstance(value, Mapping):
        opened: dict[str, Any] = _toml_value(value or {}, where)
        return opened
    if not is_dataclass(value):
        raise ParameterError(f"{where} is a {type(value).__name__}: it has no keys to set")
    return _Keys(value)


def _read(hint: Any, value: Any, where: str) -> Any:
    """A value of the type ``hint`` from what TOML holds; what it cannot hold stays as it is."""
    hint = unaliased(hint)
    said = isinstance(value, _OF_TOML)
    if hint is Any or not said:
        return value
    origin, arguments = get_origin(hint), get_args(hint)
    if isinstance(value, _Keys):
        kinds = _kinds(arguments)
        wanted, own = value.get(_KIND), getattr(value.base, _KIND, None)
        if wanted in (None, own) or not kinds:
            return from_table(type(value.base), value, where)
    if origin in (Union, UnionType):
        if value == _NONE and NoneType in arguments and str not in arguments:
            return None
        return _read_one_of([a for a in arguments if a is not NoneType], value, where)
    if is_dataclass(hint):
        return from_table(hint, value, where)  # type: ignore[arg-type]
    if hint in _SCALARS:
        allowed = (int, float) if hint is float else hint
        if isinstance(value, bool) is not (hint is bool) or not isinstance(value, allowed):
            raise ParameterError(f"{where} is {value!r}: give {_SCALARS[hint]}")
        return hint(value)
    if origin is Literal:
        return _chosen({word: word for word in arguments}, value, where)
    if origin is tuple:
        return _read_tuple(arguments, value, where)
    if origin is np.ndarray:
        try:
            return np.array(value, dtype=float)
        except (TypeError, ValueError):
            raise ParameterError(f"{where} is {value!r}: give a list of numbers") from None
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _chosen({member.name.lower(): member for member in hint}, value, where)
    if isinstance(origin, type) and issubclass(origin, Mapping) and arguments[0] is str:
        if not isinstance(value, dict):
            raise ParameterError(f"{where} is {value!r}: give a table")
        return {k: _read(arguments[1], v, f"{where}.{k}") for k, v in value.items()}
    raise ParameterError(f"{where} can be given in Python only: leave it out")


def _kinds(hints: Sequence[Any]) -> dict[str, Any]:
    """The dataclasses of a union that have a ``kind`` each, by it."""
    return {
        getattr(h, _KIND): h
        for h in hints
        if is_dataclass(h) and hasattr(h, _KIND) and not hasattr(h, _PRESETS)
    }


def _read_one_of(hints: list[Any], value: Any, where: str) -> Any:
    """A value of the first type, or of the dataclass whose ``kind`` the table names."""
    kinds = _kinds(hints)
    if isinstance(value, str) and str in hints:
        return value
    if not kinds:
        lists = [h for h in hints if get_origin(h) is tuple]
        return _read(lists[0] if lists and isinstance(value, list) else hints[0], value, where)
    if not isinstance(value, dict):
        raise ParameterError(f"{where} is {value!r}: give a table")
    wanted = value.get(_KIND, next(iter(kinds)))
    return from_table(_chosen(kinds, wanted, f"{where}.{_KIND}"), value, where)


def _chosen(known: Mapping[str, T], word: Any, where: str) -> T:
    """What a word stands for."""
    if word not in list(known):  # which may be a list, too
        raise ParameterError(f"{where} is {word!r}: give one of {', '.join(known)}")
    return known[word]


def _read_tuple(hints: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise ParameterError(f"{where} is {value!r}: give a list")
    if hints[-1] is Ellipsis:
        hints = hints[:1] * len(value)
    if len(value) != len(hints):
        raise ParameterError(f"{where} has {len(value)} entries: give {len(hints)}")
    pairs = zip(hints, value, strict=True)
    return tuple(_read(hint, entry, f"{where}[{i}]") for i, (hint, entry) in enumerate(pairs))


class Leaf(NamedTuple):
    """A key of a file that holds no table, dotted, with its value's type.

    ``default`` is that of the first kind of table that has the key, None where there is none, and
    ``about`` what the docstring of its class says.
    """

    path: str
    hint: Any
    default: Any
    about: str


def leaves(kind: Any, where: str = "") -> Iterator[Leaf]:
    """The keys that a dataclass's file can have, of all kinds of tables; ``where`` is its own."""
    found: dict[str, Leaf] = {}
    hints, abouts = _hints(kind), described(kind)
    for f in fields(kind):
        if f.metadata.keys() >= PYTHON_ONLY.keys():
            continue
        place = f"{where}.{f.name}" if where else f.name
        hint = hints[f.name]
        union = [h for h in get_args(hint) if h is not NoneType] if _is_union(hint) else [hint]
        tables = [h for h in union if is_dataclass(h) and _said(h)]
        if tables:
            kinds = _kinds(tables)
            if kinds:
                path, usual = f"{place}.{_KIND}", getattr(default_of(f), _KIND, next(iter(kinds)))
                found[path] = Leaf(path, Literal[*kinds], usual, f"one of {', '.join(kinds)}")
            for table in kinds.values() or tables:
                for leaf in leaves(table, place):
                    found.setdefault(leaf.path, leaf)
        elif _said(hint):
            default = default_of(f)
            default, about = None if default is MISSING else default, abouts.get(f.name, "")
            found.setdefault(place, Leaf(place, hint, default, about))
    return iter(found.values())


@cache
def described(kind: type) -> dict[str, str]:
    """What the docstrings of a class and its bases say of its attributes, by their names."""
    found: dict[str, str] = {}
    for part in _ATTRIBUTES.findall("\n".join(getdoc(c) or "" for c in kind.__mro__[:-1])):
        for names, text in _ATTRIBUTE.findall(part):
            for name in names.split(", "):
                found.setdefault(name, " ".join(text.split()))
    return found


def _is_union(hint: Any) -> bool:
    return get_origin(hint) in (Union, UnionType)


def _said(hint: Any) -> bool:
    """True if TOML can hold values of a type."""
    hint = unaliased(hint)
    arguments = get_args(hint)
    if _is_union(hint):
        return any(_said(h) for h in arguments if h is not NoneType)
    origin = get_origin(hint)
    if origin is tuple:
        return all(_said(h) for h in arguments if h is not Ellipsis)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return arguments[0] is str and _said(arguments[1])
    if is_dataclass(hint):
        required = [f for f in fields(hint) if f.default is MISSING is f.default_factory]
        hints = _hints(hint)
        return all(_said(hints[f.name]) for f in required)
    known = hint in _SCALARS or origin in (Literal, np.ndarray)
    return known or (isinstance(hint, type) and issubclass(hint, Enum))


def to_table(options: Any, where: str = "") -> dict[str, Any]:
    """A dataclass as a table; a ParameterError names a value that TOML cannot hold."""
    table: dict[str, Any] = {_KIND: options.kind} if hasattr(options, _KIND) else {}
    kind: Any = type(options)
    hints = _hints(kind)
    preset = kind.of_kind(options.kind) if hasattr(kind, _PRESETS) else None
    for f in fields(options):
        value = getattr(options, f.name)
        place = f"{where}.{f.name}" if where else f.name
        if value is None:
            if getattr(preset, f.name, None) is not None:
                table[f.name] = _NONE
            continue
        try:
            if not _fits(hints[f.name], value) or f.metadata.keys() >= PYTHON_ONLY.keys():
                raise ParameterError(f"{place} is {type(value).__name__}, which TOML cannot say")
            table[f.name] = _toml_value(value, place)
        except ParameterError:
            if not is_default(f, value):
                raise
    return table


def _fits(hint: Any, value: Any) -> bool:
    """True if a field's dataclass is one that its table can be read as."""
    if not is_dataclass(value) or isinstance(value, type):
        return True
    tables = get_args(hint) if _is_union(hint) else (hint,)
    return type(value) in (_kinds(tables).values() or tables)


def _toml_value(value: Any, where: str) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return to_table(value, where)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, tuple | list):
        return [_toml_value(entry, where) for entry in value]
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {str(key): _toml_value(entry, f"{where}.{key}") for key, entry in value.items()}
    raise ParameterError(f"{where} is {type(value).__name__}, which TOML cannot say")


def literal(value: Any) -> str:
    """A field's value as TOML text on one line; a ParameterError if TOML cannot hold it."""
    said = _toml_value(value, "the value")
    if isinstance(said, Mapping):
        pairs = (f"{_key(key)} = {literal(entry)}" for key, entry in said.items())
        return "{" + ", ".join(pairs) + "}"
    if isinstance(said, list):
        return "[" + ", ".join(map(literal, said)) + "]"
    return tomli_w.dumps({"x": said}).removeprefix("x = ").strip()


def _key(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name) else literal(name)


def text(table: Mapping[str, Any]) -> str:
    """A table of :func:`to_table` as TOML text that :mod:`tomllib` reads back bit by bit."""
    return _NUMBERS.sub(lambda row: f"[{' '.join(row[1].split())[:-1]}]", tomli_w.dumps(table))
