"""First thing that went wrong before a robot fell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from template_control.arrays import BoolArray, IntArray
from template_control.run.record import FloatingRecord, Record
from template_control.run.statistics import AT_LIMIT
from template_control.slip.similarity import Scale

_LOOKED_AT = 4  # strides before the fall
_LATE = 1.3  # step durations of the gait, after which a stride is late
_LONG = 0.02  # time that a torque is at its limit on end, on the reference [s]
_SLIP = 0.02  # of l0, that a foot slides since it bears
_BEARS = 0.05  # share of the weight that a foot bears when it stands
_STRAIGHT = 0.998  # of the leg's length, that a knee is straight from on
_WALL = 2.0  # times the friction, which only an edge of the ground can press with


def fall_cause(record: Record) -> str:
    """The first of these that happened in the four strides before a fall.

    ``failed QP``; ``torque limit``: a joint is at its limit for 20 ms on end; ``slip``: a loaded
    foot slides by 2 % of l0, of a free robot in any direction; ``stumble``: a foot is pressed
    backwards by more than friction can; ``reach``: a loaded leg is straight; ``late``: no section
    for 1.3 step durations; or ``none of these``. Times are those of the reference template. The
    ``record`` is of a run that fell, every sample kept.
    """
    begin = record.section_time[max(len(record.section_time) - _LOOKED_AT, 0)]
    since = int(np.searchsorted(record.time, begin))
    wrong = {name: look(record)[since:] for name, look in _LOOKS.items()}
    found = {name: int(np.argmax(of)) for name, of in wrong.items() if of.any()}
    return min(found, key=lambda name: found[name]) if found else "none of these"


def _bears(record: Record) -> BoolArray:
    """(T, n) which feet are loaded."""
    return np.asarray(record.contact_force[:, :, 1] > _BEARS * record.weight)


def _limited(record: Record) -> BoolArray:
    at_limit = np.abs(record.torque) >= AT_LIMIT * record.torque_limit
    lasts = record.time[:, None] - record.time[_began(at_limit)]
    long = lasts >= _LONG * Scale.of(record.template).time
    return np.asarray((at_limit & long).any(axis=1))


def _slipped(record: Record) -> BoolArray:
    bears, places = _bears(record), record.foot[..., :1]
    if isinstance(record, FloatingRecord):
        places = record.space_foot[..., :2]
    begun = np.take_along_axis(places, _began(bears)[..., None], axis=0)
    slid = np.linalg.norm(places - begun, axis=2)
    return np.asarray((bears & (slid > _SLIP * record.template.rest_length)).any(axis=1))


def _stumbled(record: Record) -> BoolArray:
    friction, force = record.options["plant"].get("friction", np.inf), record.contact_force
    least = np.maximum(_WALL * friction * force[:, :, 1], _BEARS * record.weight)
    return np.asarray((-force[:, :, 0] > least).any(axis=1))


def _stretched(record: Record) -> BoolArray:
    wrong = np.zeros(len(record.time), dtype=bool)
    for foot, (leg, bears) in enumerate(zip(record.hinges, _bears(record).T, strict=True)):
        # Down to the ankle, or the foot.
        hip, knee, tip, *_ = (*(record.joint[:, j] for j in leg), record.foot[:, foot])
        whole = np.linalg.norm(hip - knee, axis=1) + np.linalg.norm(knee - tip, axis=1)
        wrong |= bears & (np.linalg.norm(hip - tip, axis=1) > _STRAIGHT * whole)
    return wrong


def _late(record: Record) -> BoolArray:
    index = np.searchsorted(record.section_time, record.time, side="right") - 1
    waited = record.time - record.section_time[np.maximum(index, 0)]
    durations = np.diff(record.section_time)
    usual = float(np.median(durations)) if len(durations) else np.inf
    return np.asarray(waited > _LATE * usual)


def _began(true: BoolArray) -> IntArray:
    """(T, n) sample where the present stretch of each ``true`` began; undefined outside of it."""
    begins = np.diff(true, axis=0, prepend=False) & true
    samples = np.arange(len(true))[:, None]
    return np.maximum.accumulate(np.where(begins, samples, 0), axis=0)


_LOOKS: dict[str, Callable[[Record], BoolArray]] = {
    "failed QP": lambda record: ~record.solved,
    "torque limit": _limited,
    "slip": _slipped,
    "stumble": _stumbled,
    "reach": _stretched,
    "late": _late,
}
