"""Recorded runs, and their files.

``run.npz`` holds one array a field of :class:`Record` and the metadata as JSON text.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from template_control import settings, storage
from template_control.arrays import Array, BoolArray, IntArray
from template_control.checks.checked import checked
from template_control.errors import RecordError, TemplateControlError
from template_control.plant.terrain import Terrain
from template_control.robot.biped import leg_means
from template_control.run import tables
from template_control.run.facts import METADATA, Facts
from template_control.run.tables import Quantity, quantities
from template_control.slip.automaton.vocabulary import Phase


@dataclass(frozen=True, repr=False)
class Record(Facts):
    """A run of a robot; T samples, S sections, SI units, world frame with y up.

    What holds for the run as a whole, such as ``fall_reason``, ``summary`` and ``joints``, are the
    attributes of :class:`~template_control.run.facts.Facts`.

    Attributes:
        time: (T,) [s].
        q, v: (T, nv) true configuration and velocity, without the noise of the sensors.
        torque: (T, nu) joint torques computed at the sample, applied right after it, or the
            options' ``delay`` later [N m].
        com, com_velocity: (T, 2).
        angular_momentum: (T,) about the CoM, forward pitch positive [kg m^2/s].
        template_com, template_velocity: (T, 2) the template at the robot's phase.
        foot: (T, n, 2) lowest points of the foot spheres, of a biped two.
        joint: (T, nu, 2) positions of the actuated joints.
        contact_force: (T, n, 2) the ground's force on each of them during the step before the
            sample, averaged over the physics step [N].
        template_force: (T, 2, 2) the template's leg forces, rear and front [N].
        node: (T,) index into ``nodes``.
        rear: (T,) index of the template leg that is the rear one.
        solved: (T,) False where the QP was not solved.
        swing_reference: (T, 2, 2) position of the reference of each template leg's foot, NaN where
            it has none.
        push: (T,) disturbance on the trunk, forward positive; of a free robot its size, negative
            where it acts backward [N].
        section: (S,) index into ``sections`` of each section reached, the start's included.
        section_time: (S,) of each.
        section_state: (S, 3) dx/dt (angular-momentum based where the phase before it is), y
            over the stance foot's ground, dy/dt, as measured.
        stride: (S,) index into ``strides`` of the kind of stride that begins there.
        section_target: (S, 3) state that the stride is to end in.
        section_accepted: (S,) dx/dt that the planner took for the target's: another one where the
            wanted change could not be had [m/s].
        section_predicted: (S, 3) state the planner expected it to end in.
        section_controls: (S, NUM_SLOTS) controls of the stride, by Slot.
        section_offset: (S, 3) the planner's offset estimate.
        section_nominal: (S,) False where the planner left its own law.
        section_feasible: (S,) False where the template cannot complete the stride at all.
        section_load: (S,) load factor.
        section_trim: (S,) momentum trim [m/s^2].
        tick_seconds, solve_seconds: (ticks,) wall-clock time of every control tick, and of ProxQP
            in it: 0 where no limit acts, and it was not needed.
        plan_seconds: (S,) wall-clock time of every plan.
        metadata: the facts as the file has them.
    """

    time: Annotated[Array, Quantity("T", "s")]
    q: Annotated[Array, Quantity("T nv:coordinate")]
    v: Annotated[Array, Quantity("T nv:velocity")]
    torque: Annotated[Array, Quantity("T nu:joint", "N m")]
    com: Annotated[Array, Quantity("T 2:axis", "m")]
    com_velocity: Annotated[Array, Quantity("T 2:axis", "m/s")]
    angular_momentum: Annotated[Array, Quantity("T", "kg m^2/s")]
    template_com: Annotated[Array, Quantity("T 2:axis", "m")]
    template_velocity: Annotated[Array, Quantity("T 2:axis", "m/s")]
    foot: Annotated[Array, Quantity("T n:foot 2:axis", "m")]
    joint: Annotated[Array, Quantity("T nu:joint 2:axis", "m")]
    contact_force: Annotated[Array, Quantity("T n:foot 2:axis", "N")]
    template_force: Annotated[Array, Quantity("T 2:leg 2:axis", "N")]
    node: Annotated[IntArray, Quantity("T <nodes")]
    rear: Annotated[IntArray, Quantity("T <2")]
    solved: Annotated[BoolArray, Quantity("T")]
    swing_reference: Annotated[Array, Quantity("T 2:group 2:axis", "m")]
    push: Annotated[Array, Quantity("T", "N")]
    section: Annotated[IntArray, Quantity("S <sections")]
    section_time: Annotated[Array, Quantity("S", "s")]
    section_state: Annotated[Array, Quantity("S 3:state")]
    stride: Annotated[IntArray, Quantity("S <strides")]
    section_target: Annotated[Array, Quantity("S 3:state")]
    section_accepted: Annotated[Array, Quantity("S", "m/s")]
    section_predicted: Annotated[Array, Quantity("S 3:state")]
    section_controls: Annotated[Array, Quantity("S 6:control")]
    section_offset: Annotated[Array, Quantity("S 3:state")]
    section_nominal: Annotated[BoolArray, Quantity("S")]
    section_feasible: Annotated[BoolArray, Quantity("S")]
    section_load: Annotated[Array, Quantity("S")]
    section_trim: Annotated[Array, Quantity("S", "m/s^2")]
    tick_seconds: Annotated[Array, Quantity("ticks", "s")]
    solve_seconds: Annotated[Array, Quantity("ticks", "s")]
    plan_seconds: Annotated[Array, Quantity("S", "s")]
    metadata: dict[str, Any]

    file_format: ClassVar[str] = "template-control run 6"

    def check_shown(self) -> None:
        """Check that the run can be drawn.

        Raises:
            RecordError: if it has fewer than two samples, or values of the robot that are not
                finite.
        """
        if len(self.time) < 2:
            raise RecordError("the run has fewer than two samples: there is nothing to show")
        for name, quantity in quantities(type(self)).items():
            values = getattr(self, name)
            # A foot without a reference has NaN there.
            if quantity.dimensions[0] != "time" or name.endswith("reference"):
                continue
            good = np.isfinite(values).reshape(len(values), -1).all(axis=1)
            if not good.all():
                raise RecordError(
                    f"the run has no finite {name} in {np.sum(~good)} of {len(good)} samples, from"
                    f" sample {np.argmin(good)} on: it cannot be shown, record it anew"
                )

    @property
    def steps(self) -> int:
        """Completed steps: strides from one section to the next."""
        return len(self.section_time) - 1

    def in_phase(self, phase: Phase) -> BoolArray:
        """(T,) whether the controller was in a ``phase``, such as ``Phase.SS``."""
        return np.array([other is phase for other in self.phases])[self.node]

    @property
    def kinds_of_stride(self) -> list[str]:
        """(S,) kind of the stride that begins at each section."""
        return [self.strides[i] for i in self.stride]

    def of_legs(self, values: Array) -> Array:
        """(T, 2, ...) means of ``values`` (T, n, ...), such as ``foot``, over each leg's contacts.

        NaN of a leg without any.
        """
        return leg_means(values, self.groups, axis=1)

    @property
    def com_error(self) -> Array:
        """(T, 2) template less robot at the robot's phase [m]."""
        return self.template_com - self.com

    @property
    def ground(self) -> Terrain:
        """The ground the robot went on; level where the plant was one of the user's own."""
        return settings.from_table(Terrain, self.options["plant"].get("terrain") or {})

    def __repr__(self) -> str:
        end = f"; fell: {self.fall_reason}" if self.fell else ""
        end += "; interrupted" if self.interrupted else ""
        end += f"; ended by an error: {self.error}" if self.error else ""
        return (
            f"<Record of {self.robot_name}, gait {self.gait_name}: {self.steps} steps in"
            f" {self.duration:.2f} s, {len(self.time)} samples{end}>"
        )

    to_dataframe = tables.to_dataframe
    to_xarray = tables.to_xarray

    def plot(self, figure: str = "stick_diagram") -> Any:
        """Matplotlib ``figure`` of the run, a key of :data:`template_control.view.FIGURES`.

        Raises:
            ParameterError: if there is no such figure.
            RecordError: if the run has no samples.
        """
        # A run knows no view. The root knows every room, and is asked when somebody wants to see.
        return importlib.import_module("template_control").plot(self, figure)

    @checked
    def save(self, path: str | Path) -> Path:
        """Write the run as an ``.npz``, compressed unless Ctrl-C ended it: somebody waits then.

        Raises:
            RecordError: if the file cannot be written.
        """
        return storage.save(self, path, self.file_format, quick=self.interrupted)

    @classmethod
    @checked
    def load(cls, path: str | Path) -> Self:
        """Read a run that :meth:`save` wrote, of a floating-base robot too.

        Raises:
            RecordError: if the file is missing or is no recorded run, naming what is wrong in it.
        """
        special = (k for k in (SoleRecord, FloatingRecord) if issubclass(k, cls))
        kind: Any = next((k for k in special if _holds(path, k)), cls)
        layout = {name: quantity.layout for name, quantity in quantities(kind).items()}
        return storage.load(kind, path, kind.file_format, layout, METADATA)


class RunInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a run.

    It is a KeyboardInterrupt, so that it ends a loop of runs too.

    Attributes:
        record: what was recorded until then, marked ``interrupted`` in its metadata.
    """

    def __init__(self, record: Record) -> None:
        super().__init__("the run was interrupted")
        self.record = record


def one_line(error: BaseException) -> str:
    """Error on one line: its class, unless its text names the culprit, its text and its notes."""
    text = str(error)
    if not isinstance(error, TemplateControlError):
        text = f"{type(error).__name__}: {text}" if text else type(error).__name__
    return " ".join(". ".join((text, *getattr(error, "__notes__", ()))).split())


def keep(error: Exception, record: Record) -> None:
    """Give an error that ended a run what was recorded until then, for :func:`recorded`."""
    vars(error)["record"] = record
    error.add_note("What the run had recorded is this error's attribute record.")


def recorded(error: BaseException) -> Record | None:
    """Record of a run until an error, or Ctrl-C, ended it; None if it had not begun."""
    record = vars(error).get("record")
    return record if isinstance(record, Record) else None


@dataclass(frozen=True, repr=False)
class FloatingRecord(Record):
    """A run of a robot that nothing holds.

    The fields of :class:`~template_control.run.record.Record` are those of its view in the heading
    frame: x there is the way walked, as the frame turns about the stance foot. ``v`` is Pinocchio's
    of a free flyer.

    Attributes:
        q: (T, nq) configuration, Pinocchio's of a free flyer.
        space_com: (T, 3) of the CoM in the world, x, y to the left, z up [m].
        space_foot: (T, n, 3) lowest points of the foot spheres in the world [m].
        space_force: (T, n, 3) the ground's force on each of them in the world [N].
        attitude: (T, 3) roll, pitch and yaw of the trunk in the heading frame [rad].
        heading: (T,) angle from the world's x to where the trunk is to face, which is along the
            heading frame's but for ``facing`` [rad].
        sway: (T, 2) y of the CoM from the rear foot and dy/dt, in the heading frame; dy/dt has the
            angular momentum about the CoM as ``section_state`` has it [m, m/s].
        side_reference: (T, 2) y of the reference of each template leg's foot in the heading frame,
            NaN where it has none [m].
    """

    file_format: ClassVar[str] = "template-control free run 2"

    q: Annotated[Array, Quantity("T nq:coordinate")]
    space_com: Annotated[Array, Quantity("T 3:space_axis", "m")]
    space_foot: Annotated[Array, Quantity("T n:foot 3:space_axis", "m")]
    space_force: Annotated[Array, Quantity("T n:foot 3:space_axis", "N")]
    attitude: Annotated[Array, Quantity("T 3:angle", "rad")]
    heading: Annotated[Array, Quantity("T", "rad")]
    sway: Annotated[Array, Quantity("T 2:sway_state")]
    side_reference: Annotated[Array, Quantity("T 2:group", "m")]

    @property
    def facing(self) -> Array:
        """(T,) angle from the way that the robot goes, the heading frame's x, to ``heading``."""
        half = 0.5 * self.duration / max(len(self.tick_seconds), 1)  # of a tick
        begun = np.searchsorted(self.section_time - half, self.time, side="right") - 1
        return self.section_course[np.maximum(begun, 0), 3]

    @property
    def section_velocity(self) -> Array:
        """(S, 3) accepted velocity in each stride, in the frame of ``heading``.

        Forward and to the left [m/s], of a run or a walk by a commanded speed the mean; and the
        turning rate [rad/s].
        """
        along, left, turning, facing = self.section_course.T
        c, s = np.cos(facing), np.sin(facing)
        return np.column_stack((c * along + s * left, c * left - s * along, turning))


@dataclass(frozen=True, repr=False)
class SoleRecord(FloatingRecord):
    """A run of a robot on flat feet, whose ``foot`` and ``space_foot`` are the toes.

    Attributes:
        sole_wrench: (T, n, 6) the ground's force on each sole and its moment about the toe, in the
            sole's axes: x forward, y to the left, z up [N, N m].
    """

    file_format: ClassVar[str] = "template-control run on soles 1"

    sole_wrench: Annotated[Array, Quantity("T n:foot 6:wrench")]

    @property
    def centre_of_pressure(self) -> Array:
        """(T, n, 2) x and y of the centre of pressure from each toe [m], NaN in the air.

        In the air is a foot that bears less than a hundredth of the weight.
        """
        fz = self.sole_wrench[:, :, 2]
        load = np.where(fz > 0.01 * self.weight, fz, np.nan)[:, :, None]
        return self.sole_wrench[:, :, [4, 3]] * (-1.0, 1.0) / load


def _holds(path: str | Path, kind: type[Record]) -> bool:
    """True if a file has all fields of a kind of run; False if it cannot be read."""
    try:
        with np.load(path, allow_pickle=False) as data:
            return set(data.files) >= set(quantities(kind))
    except Exception:  # a damaged file has any of a dozen; its reader says which
        return False


@checked
def load_record(path: str | Path) -> Record:
    """As :meth:`Record.load`, of a robot of any kind."""
    return Record.load(path)
