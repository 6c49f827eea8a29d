"""Options as TOML: nested dataclasses to tables and back.

A dataclass is a table, its fields are the keys. A tuple is a list, an enumeration's member is its
name in lower case, a field that is None is left out. Where a field may hold one of several
dataclasses, the key ``kind`` says which by the class attribute of that name. Keys that a field had
before are in the class attribute ``old_keys``. What TOML cannot say, such as a table of tasks, is
given in Python only.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
import tomli_w

from template_control.errors import ParameterError, TemplateControlError

T = TypeVar("T")

_KIND = "kind"
_NUMBERS = re.compile(r"""\[\n((?:\ +[^\s"'\[\]{},]+,\n)+)\ *\]""")
"""A list of numbers, one a line, as ``tomli_w`` writes it: texts have quotes, and no line break."""
_SCALARS = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text in quotes",
}


def read(kind: type[T], path: str | Path) -> T:
    """A dataclass from a TOML file.

    Args:
        kind: the dataclass.
        path: of the file. Keys that it leaves out keep their defaults.

    Raises:
        ParameterError: naming the file and the key, if it cannot be read, has an unknown key or a
            value of another type, or the dataclass refuses a value.
    """
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


def from_table(kind: type[T], table: Any, where: str = "") -> T:
    """A dataclass from a table as :mod:`tomllib` reads it.

    Args:
        kind: the dataclass.
        table: by key.
        where: the table's own key, for messages; "" for the whole file.

    Raises:
        ParameterError: naming the key, if it is unknown or its value is of another type.
    """
    if not isinstance(table, dict):
        raise ParameterError(f"{where} is {table!r}: give a table")
    known = {f.name: f for f in fields(kind) if f.init}  # type: ignore[arg-type]
    hints = get_type_hints(kind)
    old_keys: Mapping[str, str] = getattr(kind, "old_keys", {})
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key == _KIND and hasattr(kind, _KIND):
            continue
        place = f"{where}.{key}" if where else key
        name = old_keys.get(key, key)
        if name not in known:
            raise ParameterError(f"unknown key {place}: known are {', '.join(known)}")
        if name in values:
            raise ParameterError(f"{place} is given by two keys: give {name} only")
        values[name] = _read(hints[name], value, place)
    for name, f in known.items():
        if name not in values and f.default is MISSING and f.default_factory is MISSING:
            raise ParameterError(f"{where or 'the table'} has no {name}: give one")
    try:
        return kind(**values)
    except TemplateControlError as error:  # which names the class, and not the key
        text = str(error).replace(f"{kind.__name__}.", f"{where}." if where else "")
        raise type(error)(text) from None


def _read(hint: Any, value: Any, where: str) -> Any:
    """A value of the type ``hint`` from what TOML holds."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return _read_one_of([a for a in arguments if a is not NoneType], value, where)
    if is_dataclass(hint):
        return from_table(hint, value, where)  # type: ignore[arg-type]
    if hint in _SCALARS:
        allowed = (int, float) if hint is float else hint
        if isinstance(value, bool) is not (hint is bool) or not isinstance(value, allowed):
            raise ParameterError(f"{where} is {value!r}: give {_SCALARS[hint]}")
        return hint(value)
    if origin is Literal:
        if value not in arguments:
            raise ParameterError(f"{where} is {value!r}: give one of {', '.join(arguments)}")
        return value
    if origin is tuple:
        return _read_tuple(arguments, value, where)
    if origin is np.ndarray:
        try:
            return np.array(value, dtype=float)
        except (TypeError, ValueError):
            raise ParameterError(f"{where} is {value!r}: give a list of numbers") from None
    if isinstance(hint, type) and issubclass(hint, Enum):
        names = {member.name.lower(): member for member in hint}
        if value not in names:
            raise ParameterError(f"{where} is {value!r}: give one of {', '.join(names)}")
        return names[value]
    if isinstance(origin, type) and issubclass(origin, Mapping) and arguments[0] is str:
        if not isinstance(value, dict):
            raise ParameterError(f"{where} is {value!r}: give a table")
        return {k: _read(arguments[1], v, f"{where}.{k}") for k, v in value.items()}
    raise ParameterError(f"{where} can be given in Python only: leave it out")


def _read_one_of(hints: list[Any], value: Any, where: str) -> Any:
    """A value of the first type, or of the dataclass whose ``kind`` the table names."""
    kinds: dict[str, Any] = {hint.kind: hint for hint in hints if hasattr(hint, _KIND)}
    if not kinds:
        return _read(hints[0], value, where)
    if not isinstance(value, dict):
        raise ParameterError(f"{where} is {value!r}: give a table")
    wanted = value.get(_KIND, next(iter(kinds)))
    if wanted not in kinds:
        raise ParameterError(f"{where}.{_KIND} is {wanted!r}: give one of {', '.join(kinds)}")
    return from_table(kinds[wanted], value, where)


def _read_tuple(hints: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise ParameterError(f"{where} is {value!r}: give a list")
    if hints[-1] is Ellipsis:
        hints = hints[:1] * len(value)
    if len(value) != len(hints):
        raise ParameterError(f"{where} has {len(value)} entries: give {len(hints)}")
    pairs = zip(hints, value, strict=True)
    return tuple(_read(hint, entry, f"{where}[{i}]") for i, (hint, entry) in enumerate(pairs))


def to_table(options: Any, where: str = "") -> dict[str, Any]:
    """A dataclass as a table, with every value that TOML can say.

    Args:
        options: the dataclass instance.
        where: its own key, for messages; "" for the whole.

    Raises:
        ParameterError: naming the key, if a value that differs from its default can be given in
            Python only.
    """
    table: dict[str, Any] = {_KIND: options.kind} if hasattr(options, _KIND) else {}
    for f in fields(options):
        value = getattr(options, f.name)
        place = f"{where}.{f.name}" if where else f.name
        if value is None:
            continue
        try:
            table[f.name] = _toml_value(value, place)
        except ParameterError:
            if not _is_default(f, value):
                raise
    return table


def _is_default(f: Field[Any], value: Any) -> bool:
    if f.default_factory is not MISSING:
        return bool(f.default_factory() == value)
    return f.default is not MISSING and bool(f.default == value)


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
    if isinstance(value, Mapping) and all(type(key) is str for key in value):
        return {key: _toml_value(entry, f"{where}.{key}") for key, entry in value.items()}
    raise ParameterError(f"{where} is {type(value).__name__}, which TOML cannot say")


def text(table: Mapping[str, Any]) -> str:
    """A table as TOML text that :mod:`tomllib` reads back bit by bit.

    Args:
        table: as :func:`to_table` returns it.
    """
    return _NUMBERS.sub(lambda row: f"[{' '.join(row[1].split())[:-1]}]", tomli_w.dumps(table))
