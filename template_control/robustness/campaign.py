"""Monte Carlo campaign: fall rate under random disturbances, all at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields, replace
from math import radians
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from template_control import settings
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Count, Index, NotNegative
from template_control.errors import ParameterError, SweepError
from template_control.plant.bullet import PlantOptions
from template_control.robustness.disturbances import PUSH_SECONDS, engine, impulse_unit, with_step
from template_control.robustness.fall_cause import fall_cause
from template_control.robustness.findings import wilson_interval
from template_control.robustness.fingerprint import fingerprint
from template_control.robustness.severity_sweep import gait_errors
from template_control.run.experiment import Experiment, PreparedExperiment
from template_control.run.options import Push
from template_control.run.sensing import SensorOptions
from template_control.run.simulation import simulate
from template_control.slip.similarity import Scale
from template_control.sweep.sweep import Item, SweepOptions, item_seed, sweep

Ends = tuple[float, float]


@dataclass(frozen=True)
class DisturbanceSample(Checked):
    """Disturbances of one trial.

    As :class:`DisturbanceDistribution`, whose ranges they are drawn from; ``push_at`` is in steps
    from the start, ``ground_step_at`` in step lengths.
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
class DisturbanceDistribution(Checked):
    """Ranges of the disturbances; a trial draws one number uniformly from each, by its seed.

    Numbers with a dimension are those of the reference template (80 kg, 1 m); another robot gets
    them scaled by dynamic similarity. The controller does not know them.

    Attributes:
        speed: of the start's dx/dt, a share of the gait's.
        height: of the start's y at the section [m].
        friction: coefficient of the ground; the controller counts on 0.9 of 0.7.
        mass: of every link, a share too much.
        push: impulse on the trunk over 0.1 s, forward positive [N s].
        ground_step: height of one step of the ground, up positive [m].
        noise: standard deviation of measured angles [rad]; see ``SensorOptions.noise``.
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
        own = type(self).__name__
        for f in fields(self):
            ends = getattr(self, f.name)
            if isinstance(ends, tuple) and ends[0] > ends[1]:
                raise ParameterError(f"{own}.{f.name} is {list(ends)}: give its lower end first")
        if self.within[0] == self.within[1]:
            raise ParameterError(
                f"{own}.within is {list(self.within)}: give two numbers that differ"
            )
        for name, lowest in (("friction", 0.0), ("mass", -1.0)):
            if getattr(self, name)[0] <= lowest:
                raise ParameterError(
                    f"{own}.{name} is {list(getattr(self, name))}: stay above {lowest:g}"
                )

    @property
    def steps(self) -> int:
        """Steps of a trial."""
        return self.within[1] + self.after

    def draw(self, seed: Index) -> DisturbanceSample:
        """The numbers of one trial, drawn with a ``seed``."""
        lot = np.random.default_rng(seed)
        drawn = {name: float(lot.uniform(*getattr(self, name))) for name in _DRAWN}
        at = lot.uniform(*self.within, 2)
        drawn["direction"] = float(lot.uniform(*self.direction))
        return DisturbanceSample(**drawn, push_at=float(at[0]), ground_step_at=float(at[1]))

    def times(self, factor: NotNegative) -> DisturbanceDistribution:
        """The same mix with all its ranges ``factor`` times as far from where nothing disturbs.

        Raises:
            ParameterError: if a range then holds what cannot be, such as a friction below 0.
        """
        ends: dict[str, Any] = {}
        for name in _DRAWN:
            still = getattr(_STILL, name)
            ends[name] = tuple(still + factor * (end - still) for end in getattr(self, name))
        try:
            return replace(self, **ends)
        except ParameterError as error:
            text = str(error).replace(f"{type(self).__name__}.", "")
            raise ParameterError(f"the mix {factor:g} times as severe: {text}") from None

    def severity(self, draw: DisturbanceSample) -> float:
        """Severity of a ``draw`` of this mix: root mean square of its shares of the ranges.

        Each share is a number's distance from where nothing disturbs over the distance of its
        range's end on that side. Ranges of no width are left out, as all trials share them.
        """
        shares = []
        for name in _DRAWN:
            (low, high), still = getattr(self, name), getattr(_STILL, name)
            away = getattr(draw, name) - still
            reach = (high if away > 0.0 else low) - still
            if low < high:
                shares.append(away / reach if away != 0.0 else 0.0)
        return float(np.sqrt(np.mean(np.square(shares)))) if shares else 0.0


FLOATING_MIX = DisturbanceDistribution(
    height=(-0.01, 0.01), push=(0.0, 10.0), ground_step=(-0.01, 0.01), direction=(-180.0, 180.0)
)
"""For a robot that nothing holds: pushes from all sides, half as strong, and half the heights."""

_DRAWN = ("speed", "height", "friction", "mass", "push", "ground_step", "noise", "delay")
_STILL = DisturbanceSample()  # nothing disturbs


OFF_GAIT = 0.03
"""Share of the gait's speed beyond which a robot is off its gait after the last step."""


@dataclass(frozen=True)
class CampaignConfig(Checked):
    """A campaign: the undisturbed experiment, the disturbances and the seed.

    Attributes:
        experiment: undisturbed: a gait that is kept, in a physics engine.
        mix: of the disturbances.
        seed: of the whole campaign; a trial's own follows from it and the trial's number.

    Raises:
        ParameterError: if a value is of a wrong type or out of its range, the plant is none whose
            friction can be disturbed, or a planar robot is to be pushed to a side.
    """

    experiment: Experiment = field(default_factory=Experiment)
    mix: DisturbanceDistribution = field(default_factory=DisturbanceDistribution)
    seed: Index = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        engine(self.experiment)
        lateral = self.mix.direction != DisturbanceDistribution().direction
        if lateral and not self.experiment.free:
            raise ParameterError(
                f"the mix has the direction {list(self.mix.direction)}, and"
                f" {self.experiment.robot_name} is held in its plane: leave it out, or take a"
                " floating-base robot"
            )

    def draw(self, number: Index) -> DisturbanceSample:
        """Disturbances of the trial with a ``number`` from 0."""
        return self.mix.draw(item_seed(self.seed, number))

    def trial(self, number: Index) -> tuple[Experiment, PreparedExperiment]:
        """The experiment of the trial with a ``number`` from 0, to be written and to be run.

        Raises:
            TemplateControlError: if robot or gait is not to be had.
        """
        where = self.experiment.prepare()
        gait, draw, world = where.gait, self.draw(number), engine(self.experiment)
        scale = Scale.of(gait.parameters)
        z = [*gait.state.tolist(), 0.0][:3]
        step, phase = divmod(draw.push_at, 1.0)
        impulse = draw.push * impulse_unit(gait.parameters)
        seconds, direction = PUSH_SECONDS * scale.time, radians(draw.direction)
        disturbed: dict[str, Any] = {
            "steps": self.mix.steps,
            "world": with_step(
                replace(
                    world, friction=draw.friction, mass_scale=world.mass_scale * (1.0 + draw.mass)
                ),
                draw.ground_step * scale.length,
                draw.ground_step_at * gait.step_length,
            ),
            "start": (z[0] * (1.0 + draw.speed), z[1] + draw.height * scale.length, z[2]),
            "pushes": (Push(impulse, int(step), phase, seconds, direction),),
            # Integers of TOML have 63 bits.
            "sensors": SensorOptions(noise=draw.noise, seed=item_seed(self.seed, number) % 2**63),
            "delay": round(draw.delay * scale.time / world.time_step) * world.time_step,
        }
        return replace(self.experiment.resolved(), **disturbed), replace(where, **disturbed)


class Trial(NamedTuple):
    """Result of one trial.

    Attributes:
        number: from 0.
        fell: whether the robot fell.
        reason: of the fall, "" without one.
        first: what went wrong first, "" without a fall; see :func:`fall_cause`.
        speed_error: of the last 5 steps, see :func:`.gait_errors`; None after a fall.
        draw: what disturbed.
        severity: of the draw.
    """

    number: int
    fell: bool
    reason: str
    first: str
    speed_error: float | None
    draw: DisturbanceSample
    severity: float

    @property
    def off_gait(self) -> bool:
        """True if the robot is on its feet and off its gait."""
        return self.speed_error is not None and abs(self.speed_error) > OFF_GAIT

    @property
    def good(self) -> bool:
        """True if the robot is on its gait."""
        return not (self.fell or self.off_gait)


@dataclass(frozen=True)
class Campaign:
    """Result of a campaign.

    Attributes:
        conditions: that were tried.
        trials: by number.
    """

    conditions: CampaignConfig
    trials: tuple[Trial, ...]

    @property
    def fell(self) -> tuple[Trial, ...]:
        """Trials in which the robot fell."""
        return tuple(t for t in self.trials if t.fell)

    @property
    def off_gait(self) -> tuple[Trial, ...]:
        """Trials that ended on the feet, off the gait."""
        return tuple(t for t in self.trials if t.off_gait)

    @property
    def reasons(self) -> dict[str, int]:
        """Number of falls by what went wrong first."""
        return dict(Counter(t.first for t in self.fell).most_common())

    def interval(self, of: Sequence[Trial]) -> tuple[float, float]:
        """Wilson's 95 % interval of the share ``of`` some of the trials."""
        return wilson_interval(len(of), len(self.trials))


def campaign_trial(conditions: dict[str, Any], number: int) -> dict[str, Any]:
    """One trial, as a sweep's worker runs it: fell, reason, first, speed_error."""
    _, where = settings.from_table(CampaignConfig, conditions).trial(number)
    record = simulate(where)
    return {
        "fell": record.fell,
        "reason": record.fall_reason,
        "first": fall_cause(record) if record.fell else "",
        "speed_error": None if record.fell else gait_errors(record, where.gait)[0],
    }


@checked
def run_campaign(
    conditions: CampaignConfig,
    trials: Count,
    folder: Path | None = None,
    executor: Executor | None = None,
    progress: bool = True,
) -> Campaign:
    """Run trials, or those that are missing.

    A longer campaign begins with the trials of a shorter one, and goes on in its file.

    Arguments as for :func:`~template_control.robustness.measure`; ``trials`` is how many.

    Raises:
        TemplateControlError: if robot or gait is not to be had.
        SweepError: if a trial ends otherwise than by its steps or a fall, or files do not fit.
    """
    _, where = conditions.trial(0)  # a mistake is reported before a worker meets it
    table = settings.to_table(conditions)
    items: list[Item] = [{"conditions": table, "number": i} for i in range(trials)]
    stem = fingerprint(where.robot, table)
    done = sweep(
        campaign_trial,
        items,
        None if folder is None else folder / f"trials-{stem}.jsonl",
        executor,
        conditions.seed,
        SweepOptions(progress, label="trials", retry_failed=True),
    )
    for i, reason in done.failures.items():
        raise SweepError(f"trial {i} came to no end: {reason}")
    found = []
    for i, result in enumerate(done.results):
        draw = conditions.draw(i)
        found.append(Trial(number=i, draw=draw, severity=conditions.mix.severity(draw), **result))
    return Campaign(conditions, tuple(found))


def save_falls(campaign: Campaign, folder: Path) -> dict[int, Path]:
    """Write each trial that went wrong as a run that ``walk --config`` or ``run --config`` repeats.

    Args:
        campaign: whose trials.
        folder: for ``trial-NUMBER.toml``.

    Returns:
        The files by number of the trial.

    Raises:
        RecordError: if a file cannot be written.
    """
    return {
        t.number: campaign.conditions.trial(t.number)[0].save(folder / f"trial-{t.number:04d}.toml")
        for t in (*campaign.fell, *campaign.off_gait)
    }
