"""Ranges of the numbers a user gives on the command line."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping

from template_control.errors import ParameterError

Ranges = Mapping[str, tuple[float, float]]
"""Least and greatest value by the option's name in the namespace."""


def check_ranges(options: argparse.Namespace, ranges: Ranges) -> None:
    """Refuse numbers out of their range; options that were not given are left alone.

    Args:
        options: as parsed.
        ranges: of its numbers.

    Raises:
        ParameterError: naming the option and its range.
    """
    for name, (low, high) in ranges.items():
        value = getattr(options, name)
        if value is not None and not (math.isfinite(value) and low <= value <= high):
            flag = "--" + name.replace("_", "-")
            raise ParameterError(f"{flag} is {value:g}: give a number from {low:g} to {high:g}")
