"""A mix of disturbances: the ranges from which a trial draws them, all at once."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from template_control.checks.checked import Checked
from template_control.checks.ranges import Count, Index, NotNegative
from template_control.errors import ParameterError
from template_control.plant.bullet import PlantOptions

Ends = tuple[float, float]


@dataclass(frozen=True)
class Draw(Checked):
    """What disturbs one trial; units and meaning as in :class:`Mix`.

    Attributes:
        speed, height: how far off its gait the robot starts.
        friction: of the ground.
        mass: error of every link's.
        push: impulse on the trunk.
        direction: of the push, to the left of forward [deg].
        push_at: when it begins, in steps from the start.
        ground_step: height of the step.
        ground_step_at: place of its edge, in step lengths from the start.
        noise: of the sensors.
        delay: of the torques.
    """

    speed: float = 0.0
    height: float = 0.0
    friction: float = PlantOptions().friction
    mass: float = 0.0
    push: float = 0.0
    push_at: float = 0.0
    ground_step: float = 0.0
    ground_step_at: float = 0.0
    noise: float = 0.0
    delay: float = 0.0
    direction: float = 0.0


@dataclass(frozen=True)
class Mix(Checked):
    """Ranges of the disturbances; a trial draws one number uniformly from each, by its seed.

    Numbers with a dimension are those of the reference template (80 kg, 1 m); another robot gets
    them scaled by dynamic similarity. The controller is told of none of them.

    Attributes:
        speed: of the start's dx/dt, a share of the gait's.
        height: of the start's y at the section [m].
        friction: coefficient of the ground; the controller reckons with 0.9 of 0.7.
        mass: of every link, a share too much.
        push: impulse on the trunk over 0.1 s, forward positive [N s].
        ground_step: height of one step of the ground, up positive [m].
        noise: standard deviation of measured angles [rad]; see ``SensorOptions.of_size``.
        delay: from measurement to torque [s], rounded to physics steps.
        direction: of the push, to the left of forward [deg]; only a free robot has other directions
            than 0, and it is no part of a draw's severity.
        within: steps in which push and ground step come, anywhere in them.
        after: steps that follow.

    Raises:
        ParameterError: if a range's ends are out of order, or a number is out of its range.
    """

    speed: Ends = (-0.05, 0.05)
    height: Ends = (-0.02, 0.02)
    friction: Ends = (0.5, 1.0)
    mass: Ends = (-0.1, 0.1)
    push: Ends = (-20.0, 20.0)
    ground_step: Ends = (-0.02, 0.02)
    noise: tuple[NotNegative, NotNegative] = (5e-4, 5e-4)
    delay: tuple[NotNegative, NotNegative] = (0.0, 0.004)
    direction: Ends = (0.0, 0.0)
    within: tuple[Index, Count] = (2, 6)
    after: Count = 20

    def __post_init__(self) -> None:
        super().__post_init__()
        for f in fields(self):
            ends = getattr(self, f.name)
            if isinstance(ends, tuple) and ends[0] > ends[1]:
                raise ParameterError(f"Mix.{f.name} is {list(ends)}: give its lower end first")
        if self.within[0] == self.within[1]:
            raise ParameterError(f"Mix.within is {list(self.within)}: give two numbers that differ")
        for name, lowest in (("friction", 0.0), ("mass", -1.0)):
            if getattr(self, name)[0] <= lowest:
                raise ParameterError(
                    f"Mix.{name} is {list(getattr(self, name))}: stay above {lowest:g}"
                )

    @property
    def steps(self) -> int:
        """Steps of a trial."""
        return self.within[1] + self.after

    def draw(self, seed: Index) -> Draw:
        """The numbers of one trial.

        Args:
            seed: of the draw.
        """
        lot = np.random.default_rng(seed)
        drawn = {name: float(lot.uniform(*getattr(self, name))) for name in _DRAWN}
        at = lot.uniform(*self.within, 2)
        drawn["direction"] = float(lot.uniform(*self.direction))
        return Draw(**drawn, push_at=float(at[0]), ground_step_at=float(at[1]))

    def times(self, factor: NotNegative) -> Mix:
        """The same mix with all its ranges so many times as far from where nothing disturbs.

        Args:
            factor: 0 for no disturbance, 1 for this mix.

        Raises:
            ParameterError: if a range then holds what cannot be, such as a friction below 0.
        """
        ends = {}
        for name in _DRAWN:
            still = getattr(_STILL, name)
            ends[name] = tuple(still + factor * (end - still) for end in getattr(self, name))
        try:
            return Mix(**ends, direction=self.direction, within=self.within, after=self.after)
        except ParameterError as error:
            text = str(error).replace("Mix.", "")
            raise ParameterError(f"the mix {factor:g} times as severe: {text}") from None

    def severity(self, draw: Draw) -> float:
        """How severe a draw is for this mix: root mean square of its shares of the ranges.

        Each share is a number's distance from where nothing disturbs over the distance of its
        range's end on that side. Ranges of no width are left out, as all trials share them.

        Args:
            draw: of this mix.
        """
        shares = []
        for name in _DRAWN:
            (low, high), still = getattr(self, name), getattr(_STILL, name)
            away = getattr(draw, name) - still
            reach = (high if away > 0.0 else low) - still
            if low < high:
                shares.append(away / reach if away != 0.0 else 0.0)
        return float(np.sqrt(np.mean(np.square(shares)))) if shares else 0.0


FREE_MIX = Mix(
    height=(-0.01, 0.01), push=(0.0, 10.0), ground_step=(-0.01, 0.01), direction=(-180.0, 180.0)
)
"""For a robot that nothing holds: pushes from all sides, half as strong, and half the heights."""

_DRAWN = ("speed", "height", "friction", "mass", "push", "ground_step", "noise", "delay")
_STILL = Draw()  # nothing disturbs
