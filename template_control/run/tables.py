"""A run as tables: named columns with their units, for pandas, xarray or anything else."""

from __future__ import annotations

import importlib
import re
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from template_control.errors import MissingPackageError
from template_control.slip.automaton.vocabulary import Slot

_BASE = {"x": "m", "y": "m", "pitch": "rad"}
_FLOATING_BASE = {**dict.fromkeys("xyz", "m"), **dict.fromkeys(("qx", "qy", "qz", "qw"), "")}
_FLOATING_RATES = {**dict.fromkeys("xyz", "m/s"), **dict.fromkeys(("wx", "wy", "wz"), "rad/s")}
_WRENCH = {**dict.fromkeys(("fx", "fy", "fz"), "N"), **dict.fromkeys(("mx", "my", "mz"), "N m")}
_CONTROLS = {slot.name.lower(): "rad" if slot is Slot.TOUCHDOWN_ANGLE else "N/m" for slot in Slot}
_FIRST = {"T": "time", "S": "section", "ticks": "tick"}


class Quantity(NamedTuple):
    """Axes and SI unit of a field of a record.

    ``axes`` are those of :func:`~template_control.storage.load` with what each stands for, such
    as "T n:foot 2:axis"; ``unit`` is "" where there is none, or where the last dimension's labels
    have them.
    """

    axes: str
    unit: str = ""

    @property
    def layout(self) -> str:
        """The axes' sizes."""
        return re.sub(r":\w+", "", self.axes)

    @property
    def dimensions(self) -> tuple[str, ...]:
        """What the axes stand for."""
        return (_FIRST[self.axes.split()[0]], *re.findall(r":(\w+)", self.axes))


def quantities(kind: type) -> dict[str, Quantity]:
    """Quantities of a class of records, by field."""
    hints = get_type_hints(kind, include_extras=True)
    return {f.name: get_args(hints[f.name])[1] for f in fields(kind) if f.name != "metadata"}


class Column(NamedTuple):
    """One quantity of a run: (T,) values at each sample, and their SI unit, "" without one."""

    values: NDArray[Any]
    unit: str


def _labels(record: Any) -> dict[str, Mapping[str, str]]:
    """Labels of each dimension, with their units where they differ."""
    floating = hasattr(record, "space_com")
    joints, feet = record.joints, dict.fromkeys(record.feet, "")
    base = _FLOATING_BASE if floating else _BASE
    rates = _FLOATING_RATES if floating else {name: f"{unit}/s" for name, unit in _BASE.items()}
    return {
        "coordinate": base | dict.fromkeys(joints, "rad"),
        "velocity": rates | dict.fromkeys(joints, "rad/s"),
        "joint": dict.fromkeys(joints, ""),
        "foot": feet,
        "group": dict.fromkeys(_groups(record), ""),
        "leg": {"rear": "", "front": ""},
        "axis": dict.fromkeys("xy", ""),
        "space_axis": dict.fromkeys("xyz", ""),
        "angle": dict.fromkeys(("roll", "pitch", "yaw"), ""),
        "sway_state": {"place": "m", "rate": "m/s"},
        "wrench": _WRENCH,
        "state": {"dx": "m/s", "y": "m", "dy": "m/s"},
        "control": _CONTROLS,
    }


def _groups(record: Any) -> list[str]:
    """Names of the template legs' feet: of their contacts."""
    return ["+".join(record.feet[contact] for contact in group) for group in record.groups]


def _values(record: Any, name: str) -> NDArray[Any]:
    """A field; indices as the names that they stand for."""
    values = getattr(record, name)
    if name == "rear":
        return np.array(_groups(record))[values]
    names = {"node": "nodes", "section": "sections", "stride": "strides"}
    return np.array(getattr(record, names[name]))[values] if name in names else values


def columns(record: Any) -> dict[str, Column]:
    """Every quantity that a run, a :class:`~.record.Record`, has at each sample, by name.

    A name is the field of that class, then what its axes stand for: ``q_pitch``,
    ``torque_left_knee``, ``foot_right_foot_y``. ``node`` and ``rear`` hold the names of the
    automaton's node and of the rear stance foot.
    """
    labels, found = _labels(record), {}
    for name, quantity in quantities(type(record)).items():
        first, *dimensions = quantity.dimensions
        if first != "time":
            continue
        values, axes = _values(record, name), [list(labels[axis]) for axis in dimensions]
        for index in np.ndindex(*(len(axis) for axis in axes)):
            words = [axis[i] for axis, i in zip(axes, index, strict=True)]
            own = labels[dimensions[-1]][words[-1]] if words else ""
            found["_".join((name, *words))] = Column(values[:, *index], quantity.unit or own)
    return found


def _package(name: str, function: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingPackageError(
            f"{function} needs {name}, which is not installed: pip install {name}"
        ) from None


def to_dataframe(record: Any) -> Any:
    """The run as a pandas ``DataFrame``: a row a sample, a column a quantity.

    Columns are named after the fields of the record and what their axes stand for, such as
    ``time``, ``q_pitch``, ``torque_left_knee``, ``com_x`` and ``contact_force_left_foot_y``.
    ``frame.attrs["units"]`` has the SI unit of each column by name.

    Raises:
        MissingPackageError: if pandas is not installed.
    """
    table = columns(record)
    frame = _package("pandas", "to_dataframe").DataFrame(
        {name: column.values for name, column in table.items()}
    )
    frame.attrs["units"] = {name: column.unit for name, column in table.items()}
    return frame


def to_xarray(record: Any) -> Any:
    """The run as an xarray ``Dataset``: every array with its dimensions, labels and units.

    Dimensions are ``time``, ``section`` and ``tick``, and ``joint``, ``foot``, ``leg``, ``axis``
    and the like, whose coordinates hold the names. Each variable's ``attrs["units"]`` is its SI
    unit; where entries differ, their names' coordinate has a coordinate of units with it. ``attrs``
    of the set holds the facts of the run that are numbers or texts.

    Raises:
        MissingPackageError: if xarray is not installed.
    """
    xarray = _package("xarray", "to_xarray")
    # A variable cannot have the name of a dimension that it does not run along alone.
    renamed = {"joint": "joint_position", "foot": "foot_position", "section": "section_kind"}
    found, used = {}, set()
    for name, quantity in quantities(type(record)).items():
        axes, units = quantity.dimensions, {"units": quantity.unit}
        found[renamed.get(name, name)] = (axes, _values(record, name), units)
        used |= set(axes)
    coordinates: dict[str, Any] = {"time": found.pop("time")}
    for axis, labels in _labels(record).items():
        if axis in used:
            coordinates[axis] = list(labels)
            if any(labels.values()):
                coordinates[f"{axis}_unit"] = (axis, list(labels.values()))
    # netCDF knows no truth values.
    facts = {
        key: int(entry) if isinstance(entry, bool) else entry
        for key, entry in record.metadata.items()
        if isinstance(entry, str | int | float)
    }
    return xarray.Dataset(found, coordinates, facts)
