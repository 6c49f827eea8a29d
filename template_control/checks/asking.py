"""Calls of parts that may be the user's own: what goes wrong in one is told by its class."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn, ParamSpec, TypeVar

from template_control.checks.words import shown
from template_control.errors import DivergedError, ParameterError, TemplateControlError

P = ParamSpec("P")
T = TypeVar("T")


def asked(method: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Call a method; an error goes up with the name of its class and method.

    An error of this library has them in its message, any other one in a note. A state of the
    part's own that is not finite is no divergence of the run, but a ParameterError.

    Args:
        method: of a planner, a route or a task.
        args, kwargs: its arguments.

    Returns:
        What the method returns.
    """
    try:
        return method(*args, **kwargs)
    except Exception as error:
        blame(error, method)


def blame(error: Exception, method: Callable[..., Any]) -> NoReturn:
    """Raise an error that came up in a method, as :func:`asked` does.

    Args:
        error: that is being handled.
        method: where it came up.
    """
    if isinstance(error, TemplateControlError):
        kind = ParameterError if isinstance(error, DivergedError) else type(error)
        raise kind(f"{name_of(method)}: {error}") from error
    error.add_note(f"It came up in {name_of(method)}.")
    raise error


def answered(kind: type[T], method: Callable[P, Any], *args: P.args, **kwargs: P.kwargs) -> T:
    """As :func:`asked`, of a method that must return one kind of object.

    Args:
        kind: of what it returns.
        method, args, kwargs: as for :func:`asked`.

    Raises:
        ParameterError: if it returns something else.
    """
    answer = asked(method, *args, **kwargs)
    if not isinstance(answer, kind):
        raise ParameterError(
            f"{name_of(method)} returned {shown(answer)}: return a {kind.__name__}"
        )
    return answer


def name_of(method: Callable[..., Any]) -> str:
    """Class and name of a method, for a message.

    Args:
        method: bound to its object, as a rule.
    """
    owner = getattr(method, "__self__", None)
    name = getattr(method, "__name__", None)
    return shown(method) if owner is None or name is None else f"{type(owner).__name__}.{name}"
