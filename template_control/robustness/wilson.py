"""How sure a share of successes is."""

from __future__ import annotations

from math import sqrt
from typing import Annotated

from template_control.checks.checked import checked
from template_control.checks.ranges import Count, Index, Range
from template_control.errors import ParameterError


@checked
def wilson_interval(
    successes: Index, trials: Count, deviations: Annotated[float, Range(0.0, above=True)] = 1.96
) -> tuple[float, float]:
    """Wilson's interval of the share of successes that trials come from.

    With s of n and z deviations, its ends are (s + z²/2 ± z √(s (n - s) / n + z²/4)) / (n + z²).
    It says something for 20 of 20 too, where the plain deviation is 0.

    Args:
        successes: s.
        trials: n, independent of each other.
        deviations: z; 1.96 for 95 %.

    Returns:
        Least and largest share.

    Raises:
        ParameterError: if there are more successes than trials, or a number is out of its range.
    """
    if successes > trials:
        raise ParameterError(f"successes are {successes} of {trials} trials: give at most as many")
    z = deviations**2
    middle = successes + 0.5 * z
    half = deviations * sqrt(successes * (trials - successes) / trials + 0.25 * z)
    return max((middle - half) / (trials + z), 0.0), min((middle + half) / (trials + z), 1.0)
