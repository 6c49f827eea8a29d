"""Errors a user can cause; each carries one line that names the culprit and the mend."""

from collections.abc import Iterable
from difflib import get_close_matches


class TemplateControlError(ValueError):
    """Base of every error this library raises for bad input."""


class ParameterError(TemplateControlError):
    """A number out of its range, or not finite."""


class DivergedError(ParameterError):
    """A robot's state, or what is sensed of it, that is not finite; it ends a run as a fall."""


class GaitError(TemplateControlError):
    """A gait that does not exist: no step of the template returns to the wanted state."""


class ScenarioError(TemplateControlError):
    """A scenario that cannot be read, or that no template can follow."""


class RobotError(TemplateControlError):
    """A robot description that cannot be read or is not a planar biped."""


class RecordError(TemplateControlError):
    """A file that is not a recorded run, or a folder a run cannot be written to."""


class MissingPackageError(TemplateControlError, ImportError):
    """A package that the library does not depend on, and that one of its functions needs."""


class SweepError(TemplateControlError):
    """A sweep that cannot start or go on: its items, its results file or its executor."""


def meant(word: str, known: Iterable[str]) -> str:
    """Question for the known word that is nearest to an unknown one; "" if none is near."""
    return "".join(f" (did you mean {near}?)" for near in get_close_matches(word, known, 1))
