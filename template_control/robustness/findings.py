"""Results of the disturbances: trials by level, and the level from which on a robot falls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import takewhile

from scipy.stats import binomtest

from template_control.checks.checked import checked
from template_control.checks.ranges import Count, Index
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions
from template_control.robustness.disturbances import Disturbance
from template_control.slip.gaits.gait import Gait

_HALF = 0.5


@checked
def wilson_interval(successes: Index, trials: Count) -> tuple[float, float]:
    """Wilson's 95 % interval of a success rate.

    Args:
        successes: how many.
        trials: of how many, independent of each other.

    Returns:
        Least and largest rate.

    Raises:
        ParameterError: if there are more successes than trials, or a number is out of its range.
    """
    if successes > trials:
        raise ParameterError(f"successes are {successes} of {trials} trials: give at most as many")
    interval = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


@dataclass(frozen=True)
class Level:
    """Results of one disturbance at one level.

    Attributes:
        level: the disturbance's size for this robot [SI].
        succeeded, fell, off_gait: how many trials; off_gait is on its feet but not on its gait.
    """

    level: float
    succeeded: int
    fell: int
    off_gait: int

    @property
    def trials(self) -> int:
        """Number of trials."""
        return self.succeeded + self.fell + self.off_gait

    @property
    def rate(self) -> float:
        """Share of the trials that succeeded."""
        return self.succeeded / self.trials

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of that share."""
        return wilson_interval(self.succeeded, self.trials)

    @property
    def standing(self) -> float:
        """Share of the trials without a fall."""
        return 1.0 - self.fell / self.trials


@dataclass(frozen=True)
class Finding:
    """Effect of one disturbance on a robot.

    Attributes:
        disturbance: the one that was raised.
        levels: those tried, from mild to severe.
        template: the template's own limit; see :func:`~.severity_sweep.template_limit`.
    """

    disturbance: Disturbance
    levels: tuple[Level, ...] = ()
    template: float | None = None

    @property
    def breaking_point(self) -> float | None:
        """The severest level up to which every trial of each level succeeds, or None."""
        return self._last(lambda level: level.rate >= 1.0)

    @property
    def half_point(self) -> float | None:
        """The severest level up to which at least half of each level's trials succeed, or None."""
        return self._last(lambda level: level.rate >= _HALF)

    @property
    def standing_point(self) -> float | None:
        """The severest level up to which no trial falls, or None."""
        return self._last(lambda level: level.fell == 0)

    @property
    def broken(self) -> bool:
        """True if the disturbance need not be raised further.

        All trials of the last level fell, or more than half of the trials at each of the last two.
        """
        rates = [level.standing for level in self.levels]
        twice = len(rates) > 1 and max(rates[-2:]) < _HALF
        return bool(rates) and (rates[-1] == 0.0 or twice)

    def _last(self, good: Callable[[Level], bool]) -> float | None:
        """The level before the first that is not good; None where that is the first."""
        passed = list(takewhile(good, self.levels))
        return passed[-1].level if passed else None


@dataclass(frozen=True)
class Robustness:
    """Findings for a robot.

    Attributes:
        robot: its name.
        gait: that it kept.
        speed_error, height_error: undisturbed, relative, as trials are judged.
        findings: one a disturbance.
        plant: the engine that it went in.
    """

    robot: str
    gait: Gait
    speed_error: float
    height_error: float
    findings: tuple[Finding, ...]
    plant: str = PlantOptions.kind
