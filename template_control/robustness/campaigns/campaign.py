"""How sure a gait is: many trials, each with a draw of everything that disturbs, all at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from math import radians
from pathlib import Path
from typing import Any, NamedTuple

from template_control import settings
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import Count, Index
from template_control.errors import ParameterError, SweepError
from template_control.plant.ground import GroundStep
from template_control.robustness.campaigns.first_wrong import first_wrong
from template_control.robustness.campaigns.mix import Draw, Mix
from template_control.robustness.disturbances import PUSH_SECONDS, impulse_unit
from template_control.robustness.findings import wilson_interval
from template_control.robustness.fingerprint import fingerprint
from template_control.robustness.ladder import off_gait
from template_control.robustness.subject import ENGINES, Engine
from template_control.run.config import PreparedRun, RunConfig
from template_control.run.options import Push, SimulationOptions
from template_control.run.sensing import SensorOptions
from template_control.run.specs import GaitSpec, RobotSpec
from template_control.slip.similarity import Scale
from template_control.sweep.sweep import Item, SweepOptions, item_seed, sweep

ASTRAY = 0.03
"""Share of the gait's mean speed beyond which a robot is off its gait after the last step."""


@dataclass(frozen=True)
class Conditions(Checked):
    """What is tried.

    Attributes:
        robot: which one.
        gait: that it keeps.
        plant: kind of the engine.
        mix: of the disturbances.
        seed: of the whole campaign; a trial's own follows from it and the trial's number.

    Raises:
        ParameterError: if a value is of a wrong type or out of its range, or a planar robot is to
            be pushed aside.
    """

    robot: RobotSpec = field(default_factory=RobotSpec)
    gait: GaitSpec = field(default_factory=GaitSpec)
    plant: Engine = "pybullet"
    mix: Mix = field(default_factory=Mix)
    seed: Index = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.robot.free and self.mix.direction != Mix().direction:
            raise ParameterError(
                f"the mix has the direction {list(self.mix.direction)}, and {self.robot.model} is"
                " held in its plane: leave it out, or take a free robot"
            )

    def draw(self, number: Index) -> Draw:
        """What disturbs a trial.

        Args:
            number: of the trial, from 0.
        """
        return self.mix.draw(item_seed(self.seed, number))

    def trial(self, number: Index) -> tuple[RunConfig, PreparedRun]:
        """A trial as a run, and what the run is made of.

        Args:
            number: of the trial, from 0.

        Raises:
            TemplateControlError: if robot or gait is not to be had.
        """
        config = RunConfig(self.robot, self.gait)
        ready = config.prepare()
        gait, draw = ready.gait, self.draw(number)
        scale = Scale.of(gait.parameters)
        plant = ENGINES[self.plant](
            friction=draw.friction,
            mass_scale=1.0 + draw.mass,
            ground_step=_ground_step(draw, scale.length, gait.step_length),
        )
        z = [*gait.state, 0.0][:3]
        step, phase = divmod(draw.push_at, 1.0)
        impulse = draw.push * impulse_unit(gait.parameters)
        seconds, direction = PUSH_SECONDS * scale.time, radians(draw.direction)
        push = Push(impulse, int(step), phase, seconds, direction)
        delay = round(draw.delay * scale.time / plant.time_step) * plant.time_step
        simulation = SimulationOptions(
            steps=self.mix.steps,
            plant=plant,
            start=(z[0] * (1.0 + draw.speed), z[1] + draw.height * scale.length, z[2]),
            pushes=(push,),
            sensors=SensorOptions.of_size(
                draw.noise, scale, item_seed(self.seed, number) % 2**_SEED_BITS
            ),
            delay=delay,
        )
        return replace(config, simulation=simulation).resolved(), ready


_SEED_BITS = 63  # that TOML can say


def _ground_step(draw: Draw, length: float, step_length: float) -> GroundStep | None:
    height = draw.ground_step * length
    return GroundStep(height, draw.ground_step_at * step_length) if height != 0.0 else None


class Trial(NamedTuple):
    """What came of one trial.

    Attributes:
        number: from 0.
        fell: whether the robot fell.
        reason: of the fall, "" without one.
        first: what went wrong first, "" without a fall; see :func:`first_wrong`.
        speed_error: mean speed of the last 5 steps over the gait's, less one; None after a fall.
        draw: what disturbed.
        severity: of the draw.
    """

    number: int
    fell: bool
    reason: str
    first: str
    speed_error: float | None
    draw: Draw
    severity: float

    @property
    def astray(self) -> bool:
        """Whether the robot is on its feet and off its gait."""
        return self.speed_error is not None and abs(self.speed_error) > ASTRAY

    @property
    def good(self) -> bool:
        """Whether it is on its gait."""
        return not (self.fell or self.astray)


@dataclass(frozen=True)
class Campaign:
    """What came of a campaign.

    Attributes:
        conditions: that were tried.
        trials: by number.
    """

    conditions: Conditions
    trials: tuple[Trial, ...]

    @property
    def fell(self) -> tuple[Trial, ...]:
        """Trials in which the robot fell."""
        return tuple(t for t in self.trials if t.fell)

    @property
    def astray(self) -> tuple[Trial, ...]:
        """Trials that ended on the feet, off the gait."""
        return tuple(t for t in self.trials if t.astray)

    @property
    def reasons(self) -> dict[str, int]:
        """How many falls began with what."""
        return dict(Counter(t.first for t in self.fell).most_common())

    def interval(self, of: Sequence[Trial]) -> tuple[float, float]:
        """Wilson's 95 % interval of the share of some of the trials.

        Args:
            of: those trials.
        """
        return wilson_interval(len(of), len(self.trials))


def campaign_trial(conditions: dict[str, Any], number: int) -> dict[str, Any]:
    """One trial, as a sweep's worker runs it.

    Args:
        conditions: as :func:`~.settings.to_table` makes them.
        number: of the trial, from 0.

    Returns:
        fell, reason, first, speed_error; see :class:`Trial`.
    """
    config, ready = settings.from_table(Conditions, conditions).trial(number)
    record = ready.run(config.simulation)
    return {
        "fell": record.fell,
        "reason": record.metadata["fall_reason"],
        "first": first_wrong(record) if record.fell else "",
        "speed_error": None if record.fell else off_gait(record, ready.gait)[0],
    }


@checked
def run_campaign(
    conditions: Conditions,
    trials: Count,
    folder: Path | None = None,
    executor: Executor | None = None,
    progress: bool = True,
) -> Campaign:
    """Run trials, or those that are missing.

    A longer campaign begins with the trials of a shorter one, and goes on in its file.

    Args:
        conditions: what is tried.
        trials: how many.
        folder: for the trials' results, from which the same call goes on; None keeps them in
            memory. They are those of this code and this URDF; a longer campaign goes on from a
            shorter one's.
        executor: where to run the trials; None for one process a core.
        progress: show a bar on stderr.

    Raises:
        TemplateControlError: if robot or gait is not to be had.
        SweepError: if a trial ends otherwise than by its steps or a fall, or files do not fit.
    """
    _, ready = conditions.trial(0)  # a mistake is told before a worker meets it
    table = settings.to_table(conditions)
    items: list[Item] = [{"conditions": table, "number": i} for i in range(trials)]
    stem = fingerprint(ready.robot, table)
    done = sweep(
        campaign_trial,
        items,
        None if folder is None else folder / f"trials-{stem}.jsonl",
        executor,
        conditions.seed,
        SweepOptions(progress, label="trials", retry_failed=True, grows=True),
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
        for t in (*campaign.fell, *campaign.astray)
    }
