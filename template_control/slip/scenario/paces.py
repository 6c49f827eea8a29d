"""Which changes of speed a walk makes by strides of their own."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative
from template_control.slip.similarity import tuned


@dataclass(frozen=True)
class PaceOptions(Checked):
    """When a walk of a scenario that stands changes its speed by a stride of its own.

    All are speeds at VLO over sqrt(g l0).

    Attributes:
        stoppable: from which one step leads to rest.
        slowed: to which a faster walk is slowed down first, so that its last step can be short.
        alike: difference from the wanted speed with which a walk begins after a start.
        behind: difference that the walking planner is left to make good.
    """

    stoppable: NotNegative = tuned(0.16)
    slowed: NotNegative = tuned(0.11)
    alike: NotNegative = tuned(0.012)
    behind: NotNegative = tuned(0.03)
