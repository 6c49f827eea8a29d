"""Text that a user types: numbers as an annotation declares them, and entries ``key=value``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, get_args, get_origin

from template_control.checks.fitting import Refused, fitter, words_for
from template_control.errors import ParameterError


def parsed(text: str, hint: Any) -> Any:
    """Number that a text holds; Refused says "is ...: give ...", to follow the number's name."""
    kind = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    try:
        value = kind(text)
    except ValueError:
        raise Refused(f"is {text!r}: give {words_for(hint)}") from None
    try:
        return fitter(hint)(value)
    except Refused as refused:
        raise Refused(f"is {text}: give {refused}") from None


def number(where: str, text: str, hint: Any) -> Any:
    """Number that a text holds, as :func:`parsed`; a ParameterError names it by ``where``."""
    try:
        return parsed(text, hint)
    except Refused as refused:
        raise ParameterError(f"{where} {refused}") from None


def entries(where: str, texts: Iterable[str], form: str) -> dict[str, str]:
    """Values by key of entries ``key=value``, of which ``form`` says what one looks like."""
    found: dict[str, str] = {}
    for text in texts:
        key, equals, value = text.rpartition("=")
        if not (key and equals):
            raise ParameterError(f"{where} {text}: give {form}")
        if key in found:
            raise ParameterError(f"{where}: {key} is given twice: give it once")
        found[key] = value
    return found


def numbers(where: str, texts: Iterable[str], form: str, hint: Any) -> dict[str, float]:
    """:func:`entries` whose values are numbers."""
    found = entries(where, texts, form)
    return {key: number(f"{where} {key}", text, hint) for key, text in found.items()}
