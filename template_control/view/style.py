"""Shared parts of figures: colours, windows, shading, legend, marks, file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked
from template_control.errors import ParameterError
from template_control.run.record import FloatingRecord, Record
from template_control.slip.automaton.vocabulary import Event, Phase, StrideKind
from template_control.slip.scenario.run import ScenarioRecord
from template_control.storage import atomic_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# matplotlib is imported where a figure is made: a run without figures does not wait for it.

LEFT, RIGHT, TRUNK, COM, TEMPLATE = "#2a6196", "#db7321", "#6b7078", "#3a9a4a", "#111111"
SIDES = (LEFT, RIGHT)
"""Of the left and of the right foot or of the template's legs, of the rear and of the front one."""
WINDOW = 2.2  # [s], about four steps
TRANSITIONS: dict[str, str] = {
    StrideKind.WALK_TO_RUN: "walk to run",
    StrideKind.RUN_TO_WALK: "run to walk",
}
"""Strides from gait to gait, in words."""
_FEET = ("left foot", "right foot")
_SINGLE, _TRANSITION = "single stance", "transition"
_GREY, _GREEN = "0.92", 0.15  # of the shading; the green's share of COM
_MOST_POINTS = 20_000  # of a line that shows a whole run
_ROOMY = 1.6  # of the data: a limit further away would leave the panel empty
DPI = 110
Format = Literal["png", "pdf", "svg"]
FORMATS: tuple[str, ...] = get_args(Format)


def figure_style() -> AbstractContextManager[None]:
    """Type and spines of all figures; letters in a PDF stay letters."""
    import matplotlib as mpl

    look: dict[Any, Any] = {"font.size": 9, "pdf.fonttype": 42, "svg.fonttype": "none"}
    return mpl.rc_context({**look, "axes.spines.top": False, "axes.spines.right": False})


def panelled(
    height: float, rows: int = 1, columns: int = 1, width: float = 9.0, **shared: Any
) -> tuple[Figure, Any]:
    """A figure of a size [inch], and its panels row by row."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **shared).ravel()


def gallery(
    count: int, columns: int, row: tuple[float, float], width: float = 9.0, **shared: Any
) -> tuple[Figure, Any]:
    """As :func:`panelled`, for so many panels; a row's height, and what is around the rows."""
    rows = -(-count // columns)
    figure, panels = panelled(row[0] * rows + row[1], rows, columns, width, **shared)
    for axes in panels[count:]:
        axes.set_visible(False)
    return figure, panels[:count]


Curve = tuple[Array, dict[str, Any]]  # values (T,), and how their line looks
AS_TEMPLATE: dict[str, Any] = {"color": TEMPLATE, "linestyle": "--", "linewidth": 1.0}
"""Look of the template's curve next to the robot's."""


def over_time(
    record: Record,
    w: slice,
    rows: Mapping[str, Sequence[Curve]],
    height: float,
    zero: bool = False,
    sharey: bool = False,
) -> tuple[Figure, Any]:
    """A panel over time for each row, by its name with the unit; ``zero`` has a line of its own."""
    figure, panels = panelled(height, len(rows), sharex=True, sharey=sharey)
    for axes, (name, curves) in zip(panels, rows.items(), strict=True):
        for values, look in curves:
            axes.plot(record.time[w], values[w], **look)
        if zero:
            axes.axhline(0.0, color=TEMPLATE, linewidth=0.5)
        axes.set_ylabel(name)
        shade(axes, record, w)
    panels[-1].set_xlabel("time [s]")
    return figure, panels


def feet_shown(record: Record) -> list[tuple[str, str]]:
    """Name and colour of each foot: of a biped left and right, of others by link and leg."""
    if len(record.feet) == len(SIDES):
        return list(zip(_FEET, SIDES, strict=True))
    colors = {foot: SIDES[leg] for leg, group in enumerate(record.groups) for foot in group}
    return [(as_text(name), colors[foot]) for foot, name in enumerate(record.feet)]


def legs_shown(record: Record) -> list[tuple[str, str]]:
    """Name and colour of the foot of each template leg."""
    names = [name for name, _ in feet_shown(record)]
    pairs = [" and ".join(names[foot] for foot in group) for group in record.groups]
    return list(zip(pairs, SIDES, strict=True))


def moment(value: float | None, default: float, last: float) -> float:
    """Time that a user gives [s], negative from the run's end; None: ``default``."""
    if value is None:
        return default
    if not math.isfinite(value):
        raise ParameterError(f"start and end are seconds of the run: {value} is none")
    return max(last + value, 0.0) if value < 0.0 else value


def interval(
    record: Record, start: float | None, end: float | None, part: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Part of a run between two :func:`moment` s, which is not empty [s]; by default all of it."""
    first, last = float(record.time[0]), float(record.time[-1])
    begin, stop = part or (first, last)
    begin, stop = moment(start, begin, last), moment(end, stop, last)
    if not (first <= begin < stop):
        raise ParameterError(
            f"nothing lies between start {begin:g} s and end {stop:g} s: the run goes from"
            f" {first:g} to {last:g} s"
        )
    return begin, min(stop, last)


@dataclass(frozen=True)
class Look(Checked):
    """Part of a run that its figures show, and their titles.

    Attributes:
        start, end: part of the run [s], negative from its end; None: what each figure shows by
            itself.
        titled: whether the title stands in the figure.
    """

    start: float | None = None
    end: float | None = None
    titled: bool = True

    def rows(self, record: Record, seconds: float | None = None) -> slice:
        """Samples to show.

        Args:
            record: the run.
            seconds: of the part that shows what the run is about; None: the whole run.
        """
        asked = self.start is not None or self.end is not None
        part = None if asked or seconds is None else telling(record, seconds)
        begin, stop = interval(record, self.start, self.end, part)
        first, after = np.searchsorted(record.time, (begin, stop + 1e-9)).tolist()
        first = min(first, max(after - 2, 0))
        return slice(first, after, 1 + (after - first) // _MOST_POINTS)


Draw = Callable[[Any, Look], "Figure"]  # figure of a run, of which it shows a part


def telling(record: Record, seconds: float = WINDOW) -> tuple[float, float]:
    """Part of a run that shows its fall, else its first push, other stride or uneven ground [s]."""
    time = record.time
    first, last = float(time[0]), float(time[-1])
    heights = [record.ground.height_at(x) for x in record.com[::50, 0]]
    pushed = time[record.push != 0.0] + 0.3 * seconds
    changed = record.section_time[1:][np.diff(record.stride) != 0]
    uneven = time[::50][:-1][np.diff(heights) != 0.0]
    found = [last] if record.fell else [*pushed[:1], *changed[:1], *uneven[:1], last]
    begin = min(max(float(found[0]) - 0.5 * seconds, first), max(last - seconds, first))
    return begin, min(begin + seconds, last)


def upward(record: Record) -> str:
    """Name of the upward axis: y in the plane, z of a floating base, whose y is to the left."""
    return "z" if isinstance(record, FloatingRecord) else "y"


def in_words(name: str) -> str:
    """Name of an event or a reset in words: ``"rear liftoff"``, ``"place front"``, ``"VLO"``."""
    return name if name == Event.VLO.name else name.lower().replace("_", " ")


def as_text(name: str) -> str:
    """A user's name for a title: its dollar signs begin no formula, and it stays on one line."""
    return " ".join(name.split()).replace("$", r"\$")


def shade(
    axes: Axes, record: Record | ScenarioRecord, w: slice, horizontal: Array | None = None
) -> None:
    """Shade single stance in the samples ``w`` of a panel over ``horizontal`` (T,), or time [s]."""
    single = np.array([name == Phase.SS.name for name in record.metadata["phases"]])[record.node]
    axes.fill_between(
        (record.time if horizontal is None else horizontal)[w], 0.0, 1.0,
        where=single[w].tolist(), transform=axes.get_xaxis_transform(), color=_GREY, linewidth=0,
        zorder=0, label=_SINGLE,
    )  # fmt: skip
    axes.margins(x=0)


def mark_transitions(axes: Axes, spans: Iterable[tuple[float, float, str]]) -> None:
    """Shade strides from gait to gait in green: begin and end of each [s], and its name."""
    for begin, end, _ in spans:
        axes.axvspan(begin, end, color=COM, alpha=_GREEN, linewidth=0, label=_TRANSITION)


def mark_limits(axes: Axes, limits: Sequence[float], unit: str) -> None:
    """Dotted lines at ± each limit; a limit far beyond the data is written instead."""
    largest = max((np.nanmax(np.abs(line.get_ydata())) for line in axes.lines), default=0.0)
    near = sorted({limit for limit in limits if limit <= _ROOMY * largest})
    far = sorted({limit for limit in limits if limit > _ROOMY * largest})
    for limit in near:
        for sign in (-1.0, 1.0):
            axes.axhline(sign * limit, color="0.4", linestyle=":", linewidth=0.9, label="limit")
    if far:
        text = "limit ±" + ", ±".join(f"{limit:.4g}" for limit in far)
        axes.set_title(f"{text} {unit}, outside", loc="right", fontsize=8)


def mark_peaks(axes: Axes, time: Array, values: Array, color: str) -> None:
    """Mark what sticks out of a panel over time [s], such as impacts, with its size [N]."""
    low, high = axes.get_ylim()
    out = (values > high) | (values < low)
    edges = np.flatnonzero(np.diff(out.astype(np.int8), prepend=0, append=0))
    shown = -np.inf
    for first, after in edges.reshape(-1, 2):
        peak = first + int(np.argmax(np.abs(values[first:after])))
        if time[peak] - shown < 0.02 * (time[-1] - time[0]):
            continue  # the same impact rattles
        shown = time[peak]
        up = values[peak] > high
        place = high if up else low
        axes.plot(
            time[peak], place, "^" if up else "v", color=color, markersize=4, clip_on=False,
            label="impact [kN]",
        )  # fmt: skip
        axes.annotate(
            f"{1e-3 * values[peak]:.1f}", (time[peak], place), (2, -3 if up else 3),
            textcoords="offset points", fontsize=6, color=color, va="top" if up else "bottom",
        )  # fmt: skip


def finish(figure: Figure, panels: Iterable[Axes], title: str, look: Look) -> Figure:
    """Give a figure one legend, below its panels, and its title if the look has one."""
    from matplotlib.patches import Patch

    found: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    for name, color, alpha in ((_SINGLE, _GREY, None), (_TRANSITION, COM, _GREEN)):
        if found.pop(name, None) is not None:  # last, and as a patch
            found[name] = Patch(facecolor=color, alpha=alpha, edgecolor="0.7", linewidth=0.4)
    if found:
        figure.legend(
            list(found.values()), list(found), loc="outside lower center",
            ncols=min(len(found), 6), frameon=False, fontsize=8,
        )  # fmt: skip
    if look.titled:
        figure.suptitle(title, fontsize=10)
    return figure


def save_figure(figure: Figure, path: str | Path, dpi: int = DPI) -> Path:
    """Write a figure in the format of the path's ending; ``dpi`` are dots per inch."""
    with atomic_path(path) as place:
        figure.savefig(place, dpi=dpi)
    return Path(path)
