"""How much heavier the robot is than its model says, learnt from the vertical feedback."""

from __future__ import annotations

from dataclasses import dataclass

from template_control.checks.checked import Checked
from template_control.checks.ranges import NotNegative, Positive, Share
from template_control.slip.similarity import tuned


@dataclass(frozen=True)
class LoadOptions(Checked):
    """Tuning of the load estimate.

    Attributes:
        gain: share of a step's mean feedback that enters the estimate.
        dead_zone: mean feedback over g that counts as none; a step of the nominal robot
            has up to this much, from the swing leg, and must not be learnt.
        leak: share of the estimate forgotten in a step that teaches nothing; what a disturbance
            taught must not stay.
        step_bound: largest change of the factor in one step; a push is no load.
        bounds: of the factor.
    """

    gain: Share = tuned(0.7)
    dead_zone: NotNegative = tuned(0.02)
    leak: Share = tuned(0.1)
    step_bound: NotNegative = tuned(0.05)
    bounds: tuple[Positive, Positive] = tuned((0.7, 1.4))


class LoadEstimate:
    """Ratio of the real to the modelled weight.

    Over a whole step the feedback part of the CoM's vertical acceleration averages to
    nothing, unless forces computed with the model's mass do not carry the robot. All joint
    torques are then scaled by the factor learnt here; the model itself stays nominal.

    Args:
        options: gain, leak and bounds of the estimate.
        gravity: of the robot's model [m/s^2]; the feedback is measured in units of it.

    Attributes:
        factor: the estimate, 1 at first.
    """

    def __init__(self, options: LoadOptions, gravity: float) -> None:
        self.options = options
        self.factor = 1.0
        self._gravity = gravity
        self._sum = 0.0
        self._time = 0.0

    def observe(self, feedback: float, dt: float) -> None:
        """Add the feedback of one tick to the mean over the present stride.

        Args:
            feedback: the feedback part of the CoM's vertical acceleration, up positive [m/s^2].
            dt: duration of the tick [s].
        """
        self._sum += feedback * dt
        self._time += dt

    def end_stride(self, nominal: bool) -> None:
        """Learn from the stride that has just ended.

        Args:
            nominal: whether the stride went near the gait. Another one, such as a stride with a
                push, teaches nothing; the estimate then leaks.
        """
        if self._time == 0.0:
            return
        o = self.options
        mean = self._sum / self._time / self._gravity if nominal else 0.0
        change = min(o.gain * max(abs(mean) - o.dead_zone, 0.0), o.step_bound)
        factor = self.factor + (change if mean > 0.0 else -change)
        if change == 0.0:
            factor -= o.leak * (factor - 1.0)
        self.factor = min(max(factor, o.bounds[0]), o.bounds[1])
        self._sum = self._time = 0.0
