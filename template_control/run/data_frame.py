"""A run as a table: named columns with their units, for pandas or for anything else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.errors import MissingPackageError

_AXES = ("x", "y")
_LEGS = ("rear", "front")
_SPACE = ("x", "y", "z")
_BASE = {"x": "m", "y": "m", "pitch": "rad"}
_FREE_BASE = {**dict.fromkeys(_SPACE, "m"), **dict.fromkeys(("qx", "qy", "qz", "qw"), "")}
_FREE_RATES = {**dict.fromkeys(_SPACE, "m/s"), **dict.fromkeys(("wx", "wy", "wz"), "rad/s")}


class Column(NamedTuple):
    """One quantity of a run.

    Attributes:
        values: (T,) one at each sample.
        unit: in SI; "" for a number without one.
    """

    values: NDArray[Any]
    unit: str


def columns(record: Any) -> dict[str, Column]:
    """Every quantity that a run has at each sample, by name.

    A name is the field of :class:`~.record.Record`, then what its axes stand for:
    ``q_pitch``, ``torque_left_knee``, ``foot_right_foot_y``. ``node`` and ``rear`` hold the names
    of the automaton's node and of the rear stance foot.

    Args:
        record: the run, a :class:`~.record.Record`; that class imports this function, so it
            cannot be named as the type here.
    """
    joints: list[str] = record.metadata["joints"]
    feet: list[str] = record.metadata["feet"]
    found = {"time": Column(record.time, "s")}

    def add(name: str, unit: str | Sequence[str], *labels: Sequence[str]) -> None:
        values = getattr(record, name)
        units = [unit] * len(labels[0]) if isinstance(unit, str) else unit
        for index in np.ndindex(*(len(axis) for axis in labels)):
            words = [axis[i] for axis, i in zip(labels, index, strict=True)]
            found["_".join((name, *words))] = Column(values[:, *index], units[index[0]])

    free = hasattr(record, "space_com")
    base = _FREE_BASE if free else _BASE
    rates = _FREE_RATES if free else {name: f"{unit}/s" for name, unit in _BASE.items()}
    for name, first, unit in (("q", base, "rad"), ("v", rates, "rad/s")):
        add(name, [*first.values(), *[unit] * len(joints)], [*first, *joints])
    add("torque", "N m", joints)
    add("com", "m", _AXES)
    add("com_velocity", "m/s", _AXES)
    found["angular_momentum"] = Column(record.angular_momentum, "kg m^2/s")
    add("template_com", "m", _AXES)
    add("template_velocity", "m/s", _AXES)
    add("foot", "m", feet, _AXES)
    add("joint", "m", joints, _AXES)
    add("contact_force", "N", feet, _AXES)
    add("template_force", "N", _LEGS, _AXES)
    found["node"] = Column(np.array(record.metadata["nodes"])[record.node], "")
    found["rear"] = Column(np.array(feet)[record.rear], "")
    found["solved"] = Column(record.solved, "")
    add("swing_reference", "m", feet, _AXES)
    found["push"] = Column(record.push, "N")
    if free:
        add("space_com", "m", _SPACE)
        add("space_foot", "m", feet, _SPACE)
        add("space_force", "N", feet, _SPACE)
        add("attitude", "rad", ("roll", "pitch", "yaw"))
        found["heading"] = Column(record.heading, "rad")
        add("sway", ["m", "m/s"], ("place", "rate"))
        add("side_reference", "m", feet)
    return found


def to_dataframe(record: Any) -> Any:
    """A run as a pandas ``DataFrame``, see :meth:`.record.Record.to_dataframe`.

    Args:
        record: the run, as for :func:`columns`.

    Raises:
        MissingPackageError: if pandas is not installed.
    """
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
