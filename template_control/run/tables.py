"""A run as tables: named columns with their units, for pandas, xarray or anything else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.errors import MissingPackageError
from template_control.slip.automaton.vocabulary import Slot

_BASE = {"x": "m", "y": "m", "pitch": "rad"}
_FLOATING_BASE = {**dict.fromkeys("xyz", "m"), **dict.fromkeys(("qx", "qy", "qz", "qw"), "")}
_FLOATING_RATES = {**dict.fromkeys("xyz", "m/s"), **dict.fromkeys(("wx", "wy", "wz"), "rad/s")}
_STATE = {"dx": "m/s", "y": "m", "dy": "m/s"}
_SWAY = {"place": "m", "rate": "m/s"}
_CONTROLS = {slot.name.lower(): "rad" if slot is Slot.TOUCHDOWN_ANGLE else "N/m" for slot in Slot}
# Of each field: dimensions after the first one, and the unit; "" where there is none, or where the
# last dimension's labels have their own.
_SAMPLED: dict[str, tuple[tuple[str, ...], str]] = {
    "time": ((), "s"),
    "q": (("coordinate",), ""),
    "v": (("velocity",), ""),
    "torque": (("joint",), "N m"),
    "com": (("axis",), "m"),
    "com_velocity": (("axis",), "m/s"),
    "angular_momentum": ((), "kg m^2/s"),
    "template_com": (("axis",), "m"),
    "template_velocity": (("axis",), "m/s"),
    "foot": (("foot", "axis"), "m"),
    "joint": (("joint", "axis"), "m"),
    "contact_force": (("foot", "axis"), "N"),
    "template_force": (("leg", "axis"), "N"),
    "node": ((), ""),
    "rear": ((), ""),
    "solved": ((), ""),
    "swing_reference": (("group", "axis"), "m"),
    "push": ((), "N"),
    "space_com": (("space_axis",), "m"),
    "space_foot": (("foot", "space_axis"), "m"),
    "space_force": (("foot", "space_axis"), "N"),
    "attitude": (("angle",), "rad"),
    "heading": ((), "rad"),
    "sway": (("sway_state",), ""),
    "side_reference": (("group",), "m"),
}
_BY_SECTION: dict[str, tuple[tuple[str, ...], str]] = {
    "section": ((), ""),
    "section_time": ((), "s"),
    "section_state": (("state",), ""),
    "stride": ((), ""),
    "section_target": (("state",), ""),
    "section_accepted": ((), "m/s"),
    "section_predicted": (("state",), ""),
    "section_controls": (("control",), ""),
    "section_offset": (("state",), ""),
    "section_nominal": ((), ""),
    "section_feasible": ((), ""),
    "section_load": ((), ""),
    "section_trim": ((), "m/s^2"),
    "plan_seconds": ((), "s"),
}
_BY_TICK = ("tick_seconds", "solve_seconds")


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
        "sway_state": _SWAY,
        "state": _STATE,
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
    """Every quantity that a run has at each sample, by name.

    A name is the field of :class:`~.record.Record`, then what its axes stand for:
    ``q_pitch``, ``torque_left_knee``, ``foot_right_foot_y``. ``node`` and ``rear`` hold the names
    of the automaton's node and of the rear stance foot.

    Args:
        record: the run, a :class:`~.record.Record`; that class imports this function, so it
            cannot be named as the type here.
    """
    labels, found = _labels(record), {}
    for name, (dimensions, unit) in _SAMPLED.items():
        if not hasattr(record, name):
            continue
        values, axes = _values(record, name), [list(labels[axis]) for axis in dimensions]
        for index in np.ndindex(*(len(axis) for axis in axes)):
            words = [axis[i] for axis, i in zip(axes, index, strict=True)]
            own = labels[dimensions[-1]][words[-1]] if words else ""
            found["_".join((name, *words))] = Column(values[:, *index], unit or own)
    return found


def to_dataframe(record: Any) -> Any:
    """A run as a pandas ``DataFrame``, see :meth:`.record.Record.to_dataframe`."""
    try:
        import pandas
    except ImportError:
        raise MissingPackageError(
            "to_dataframe needs pandas, which is not installed: pip install pandas"
        ) from None
    table = columns(record)
    frame = pandas.DataFrame({name: column.values for name, column in table.items()})
    frame.attrs["units"] = {name: column.unit for name, column in table.items()}
    return frame


def to_xarray(record: Any) -> Any:
    """A run as an xarray ``Dataset``, see :meth:`.record.Record.to_xarray`."""
    try:
        import xarray
    except ImportError:
        raise MissingPackageError(
            "to_xarray needs xarray, which is not installed: pip install xarray"
        ) from None
    fields = {
        **{name: (("time", *axes), unit) for name, (axes, unit) in _SAMPLED.items()},
        **{name: (("section", *axes), unit) for name, (axes, unit) in _BY_SECTION.items()},
        **dict.fromkeys(_BY_TICK, (("tick",), "s")),
    }
    # A variable cannot have the name of a dimension that it does not run along alone.
    renamed = {"joint": "joint_position", "foot": "foot_position", "section": "section_kind"}
    found, used = {}, set()
    for name, (axes, unit) in fields.items():
        if hasattr(record, name):
            found[renamed.get(name, name)] = (axes, _values(record, name), {"units": unit})
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
