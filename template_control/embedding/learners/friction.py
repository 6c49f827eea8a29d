"""Friction coefficient of the ground, learnt where a foot slides."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.slip.similarity import TIME, Scale, tuned

Array = NDArray[np.float64]


# A foot on the ground that moves faster along it slides [m/s, of the reference template]. Speeds
# of a foot that stands are noise; 0.5 mrad of it is about 0.02 m/s there, which never stays this
# large, and against the force, for the duration.
SLIDING_SPEED = 0.05
# Share of the weight that a foot carries at least. A small force's direction is not known well.
_LOAD = 0.05
# Share by which the ground has to be more slippery than believed, to be learnt.
_DOUBT = 0.03


@dataclass(frozen=True)
class FrictionOptions(Checked):
    """Tuning of the friction's estimate.

    Attributes:
        duration: a foot has to slide for so long to teach anything [s].
        settling: for so long after a touchdown nothing is learnt [s]. The force is the impact's.
        lowest: coefficient that is believed. On less no gait stands, and a smaller one would come
            from a fault.
    """

    duration: NotNegative = tuned(0.008, TIME)
    settling: NotNegative = tuned(0.005, TIME)
    lowest: Positive = tuned(0.3)


@dataclass
class _Slide:
    """Forces and time of a foot since it began to slide.

    Attributes:
        standing: time since touchdown [s].
        time: that it has slid for [s].
        along, normal: sums of the ground's forces [N].
    """

    standing: float = 0.0
    time: float = 0.0
    along: float = 0.0
    normal: float = 0.0

    def lift(self) -> None:
        """The foot has lifted off."""
        self.standing = 0.0
        self.end()

    def end(self) -> None:
        """The foot slides no longer."""
        self.time = self.along = self.normal = 0.0


class FrictionEstimate:
    """Coulomb coefficient of the ground.

    The force on a foot that slides lies on the friction cone, whatever was asked for. So its mean
    ratio while the foot slides is the coefficient. It is only ever lowered: how far a foot that
    stands is from sliding, nothing tells; and ground that was slippery once may be so again.

    Args:
        options: what counts as sliding.
        before: the coefficient before anything is learnt.
        weight: of the robot [N].
        scale: units of the template.

    Attributes:
        coefficient: the estimate.
    """

    def __init__(
        self, options: FrictionOptions, before: float, weight: float, scale: Scale
    ) -> None:
        self.options = options
        self.coefficient = before
        self._least = _LOAD * weight
        self._speed = SLIDING_SPEED * scale.speed
        self._slides = (_Slide(), _Slide())

    def update(self, standing: NDArray[np.bool_], force: Array, speed: Array, dt: float) -> bool:
        """Look at how the feet move, and what acts on them.

        Args:
            standing: (2,) whether each foot is on ground to stand on; one that chatters is, though
                it carries nothing every other millisecond.
            force: (2, d) the ground's force on each foot, along the ground first and up last [N].
            speed: (2, d) of the feet's material points on the ground [m/s].
            dt: since the last look [s].

        Returns:
            Whether the estimate has changed.
        """
        before = self.coefficient
        # Number by number: arrays of two would take five times as long, at every tick.
        feet = zip(self._slides, standing.tolist(), force.tolist(), speed.tolist(), strict=True)
        for slide, stands, one, moves in feet:
            if not stands:
                slide.lift()
                continue
            slide.standing += dt
            if one[-1] < self._least:
                continue
            if self._slides_on(slide, one, moves):
                slide.time += dt
                slide.along += hypot(*one[:-1])
                slide.normal += one[-1]
                self._learn(slide)
            else:
                slide.end()
        return self.coefficient != before

    def _slides_on(self, slide: _Slide, force: list[float], speed: list[float]) -> bool:
        """Whether a foot that stands slides, so that friction holds it back."""
        if slide.standing < self.options.settling or hypot(*speed[:-1]) <= self._speed:
            return False
        return sum(f * v for f, v in zip(force[:-1], speed[:-1], strict=True)) < 0.0

    def _learn(self, slide: _Slide) -> None:
        if slide.time < self.options.duration:
            return
        ratio = max(slide.along / slide.normal, self.options.lowest)
        if ratio < (1.0 - _DOUBT) * self.coefficient:
            self.coefficient = ratio
