"""One stride of the template: run it, look at its path, its events and how it ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.errors import ParameterError
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.vocabulary import NUM_SLOTS, Event, Outcome, Reset
from template_control.slip.dynamics.kernel import new_scratch, plain, record_stride
from template_control.slip.dynamics.model import Kernel, node_kernel
from template_control.slip.parameters import SlipParameters

_OUTCOMES = tuple(Outcome)


class FiredEvent(NamedTuple):
    """A guard that fired: when since the stride's start [s], and between which nodes.

    ``target`` is "" where the stride failed; ``state`` (4,) is x, y, dx/dt, dy/dt [m, m/s] then.
    """

    time: float
    event: Event
    source: str
    target: str
    state: Array
    reset: Reset


@dataclass(frozen=True)
class Stride:
    """A simulated stride; world frame with y up, SI units.

    Attributes:
        outcome: how it ended.
        node: node at the end (the successor, where the section was reached).
        state: (4,) final x, y, dx/dt, dy/dt.
        toes: (2,) final x of rear and front toe.
        duration: [s].
        events: guards in the order they fired.
        cx, cy: (segments, ORDER + 1) Taylor polynomials of the path.
        meta: (segments, 7) start time, duration, node index, toes (2), stiffness (2).
        node_names: of the automaton, by index.
    """

    outcome: Outcome
    node: str
    state: Array
    toes: Array
    duration: float
    events: tuple[FiredEvent, ...]
    cx: Array
    cy: Array
    meta: Array
    node_names: tuple[str, ...]

    @property
    def start(self) -> str:
        """The node that it starts in."""
        return self.node_names[int(self.meta[0, 2])]

    @property
    def completed(self) -> bool:
        """True where the stride reached its section."""
        return self.outcome is Outcome.SECTION

    def time_of(self, event: Event) -> float:
        """Time of the first firing of ``event`` [s]; NaN if it did not fire."""
        return next((e.time for e in self.events if e.event is event), np.nan)

    def rows(self, times: ArrayLike) -> NDArray[np.intp]:
        """Indices of the segments in which ``times`` [s] are; those of the ends beyond them."""
        return np.maximum(np.searchsorted(self.meta[:, 0], times, side="right") - 1, 0)

    def sample(self, times: ArrayLike) -> Array:
        """States at ``times`` [s]: (n, 6) x, y, dx/dt, dy/dt, d2x/dt2, d2y/dt2."""
        t = np.atleast_1d(np.asarray(times, dtype=float))
        row = self.rows(t)
        local = t - self.meta[row, 0]
        out = np.empty((t.size, 6))
        powers = local[:, None] ** np.arange(self.cx.shape[1])
        for axis, c in enumerate((self.cx, self.cy)):
            coefficients = c[row]
            for derivative in range(3):
                terms = coefficients.shape[1]
                values = np.sum(coefficients * powers[:, :terms], axis=1)
                out[:, 2 * derivative + axis] = values
                coefficients = coefficients[:, 1:] * np.arange(1, terms)
        return out

    def nodes(self, times: ArrayLike) -> list[str]:
        """Name of the automaton's node at each of ``times`` [s]."""
        return [self.node_names[int(i)] for i in self.meta[self.rows(np.atleast_1d(times)), 2]]


def chained(*strides: Stride) -> Stride:
    """Strides, or parts of one, as one that ends as the last; each starts where one has ended."""
    meta = np.concatenate([stride.meta for stride in strides])
    events: list[FiredEvent] = []
    row, start = 0, 0.0
    for stride in strides:
        meta[row : row + len(stride.meta), 0] += start
        fired = stride.events
        events += [FiredEvent(start + e[0], *e[1:]) for e in fired] if row else fired
        row, start = row + len(stride.meta), start + stride.duration
    return replace(
        strides[-1],
        duration=start,
        events=tuple(events),
        cx=np.concatenate([stride.cx for stride in strides]),
        cy=np.concatenate([stride.cy for stride in strides]),
        meta=meta,
    )


@checked
def controls(
    touchdown_angle: float,
    k_sc: float,
    k_sd: float,
    k_sc_wr: float = 0.0,
    k_sd_wr: float = 0.0,
    k_push: float = 0.0,
) -> Array:
    """Control vector u (NUM_SLOTS,) of a stride, by Slot.

    Args:
        touchdown_angle: alpha, from the ground to the leg [rad].
        k_sc: stiffness before the stride's (virtual) bottom [N/m].
        k_sd: stiffness after it [N/m].
        k_sc_wr, k_sd_wr: the same of the front leg in a walk-to-run stride [N/m].
        k_push: stiffness of the rear leg in double stance, in a walking step with push-off [N/m].

    Raises:
        ParameterError: if the angle is not in (0, pi) or a stiffness is negative or NaN.
    """
    u = np.array([touchdown_angle, k_sc, k_sd, k_sc_wr, k_sd_wr, k_push], dtype=float)
    if not 0.0 < touchdown_angle < np.pi:
        raise ParameterError(
            f"touchdown angle is {touchdown_angle!r} rad: give one between 0 and pi"
        )
    if not (np.all(np.isfinite(u)) and np.all(u >= 0.0)):
        raise ParameterError(f"leg stiffnesses are {u[1:].tolist()}: give finite ones >= 0 [N/m]")
    return u


def finite(name: str, values: ArrayLike, size: int) -> Array:
    """Copy numbers into a new (size,) array; a ParameterError that calls them ``name`` if bad."""
    array = np.array(values, dtype=float)
    if array.shape != (size,):
        raise ParameterError(f"{name} has shape {array.shape}: give {size} numbers")
    # The sum is much quicker, and not finite where a number is not.
    if not isfinite(sum(array.tolist())) and not np.isfinite(array).all():
        raise ParameterError(f"{name} is {array.tolist()}: give finite numbers")
    return array


class StrideSimulator:
    """Simulates strides on the exact model, one after the other, on one thread.

    A stride is given up after ``max_time`` [s], by default 20 sqrt(l0/g).
    """

    def __init__(
        self,
        parameters: SlipParameters,
        automaton: Automaton = AUTOMATON,
        max_time: float | None = None,
    ) -> None:
        self.parameters = parameters
        self.automaton = automaton
        self._kernel = node_kernel(parameters, automaton, max_time=max_time)
        self._scratch = new_scratch()
        self._plain = tuple(self._scratch)
        self._names = tuple(node.name for node in automaton.nodes)
        # By numbers: to hash a member of an enumeration takes long.
        self._edges = [{int(edge.event): edge for edge in node.edges} for node in automaton.nodes]
        self._kernels = {name: plain(self.kernel(name)) for name in automaton.index}

    def kernel(self, start: str) -> Kernel:
        """The compiled stride's input for strides from a node."""
        return self._kernel._replace(node=self.automaton.index[start])

    def run(
        self,
        start: str,
        state: Sequence[float] | Array,
        u: Array,
        toes: Sequence[float] | Array = (0.0, 0.0),
    ) -> Stride:
        """Simulate one stride; arguments and errors as for :func:`simulate_stride`."""
        if start not in self._kernels:
            raise ParameterError(
                f"there is no node {start!r}: give one of {', '.join(self.automaton.index)}"
            )
        w, names = self._scratch, self._names
        x = finite("state", state, 4)
        c = finite("toes", toes, 2)
        outcome, node, segments, events, duration = record_stride(
            self._kernels[start], x, c, finite("controls", u, NUM_SLOTS), self._plain
        )
        return Stride(
            outcome=_OUTCOMES[outcome],
            node=names[node],
            state=x,
            toes=c,
            duration=duration,
            events=self._fired(w.events[:events]),
            cx=w.cx[:segments].copy(),
            cy=w.cy[:segments].copy(),
            meta=w.meta[:segments].copy(),
            node_names=names,
        )

    def _fired(self, rows: Array) -> tuple[FiredEvent, ...]:
        """Events from the kernel's rows (n, 8): time, event, nodes left and entered, state."""
        fired, names = [], self._names
        for (time, event, node, *_), state in zip(rows.tolist(), rows[:, 4:8].copy(), strict=True):
            edge = self._edges[int(node)][int(event)]
            target = edge.target if isinstance(edge.target, str) else ""
            fired.append(FiredEvent(time, edge.event, names[int(node)], target, state, edge.reset))
        return tuple(fired)


@checked
def simulate_stride(
    parameters: SlipParameters,
    start: str,
    state: Sequence[float] | Array,
    u: Array,
    toes: Sequence[float] | Array = (0.0, 0.0),
    automaton: Automaton = AUTOMATON,
) -> Stride:
    """Simulate one stride on the exact model.

    For many strides a :class:`StrideSimulator`, which this makes anew, is quicker.

    Args:
        parameters: the template.
        start: first node, usually from ``STRIDE_START``.
        state: (4,) x, y, dx/dt, dy/dt [m, m/s].
        u: (NUM_SLOTS,) controls from :func:`controls`.
        toes: (2,) x of the rear and front toe [m].
        automaton: that the stride is of.

    Raises:
        ParameterError: for NaN, a wrong shape, or if there is no node ``start``.
    """
    return StrideSimulator(parameters, automaton).run(start, state, u, toes)
