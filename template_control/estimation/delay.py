"""Estimation and compensation of the torques' delay."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from template_control.arrays import Array
from template_control.checks.checked import Checked, checked
from template_control.checks.ranges import NotNegative, Positive
from template_control.compiled import compiled
from template_control.robot.biped import Biped
from template_control.slip.similarity import RATE_SQUARED, TIME, tuned
from template_control.warm_up import Part, ready

_LOG = logging.getLogger(__name__)

_BLOCK = 64  # ticks whose accelerations are compared at once
# The estimate changes to another delay whose squared errors are smaller than those of the present
# one by this share. Neighbours differ by 1 % at a noise of 0.5 mrad.
_MARGIN = 0.01


@dataclass(frozen=True)
class DelayOptions(Checked):
    """Range of delays of :class:`DelayCompensation`, and how fast its estimate changes.

    Attributes:
        longest: largest delay considered [s]; 0 switches estimate and compensation off.
        memory: time constant of the sum of each delay's errors [s]. Delays differ clearly over a
            swing and a stance of each leg; a shorter memory follows the noise.
        most: bound at which errors of a joint's acceleration are clipped [rad/s^2]: impacts
            carry no information on delays.

    Raises:
        ParameterError: if a value is of a wrong type or out of its range.
    """

    longest: NotNegative = tuned(0.008, TIME)
    memory: Positive = tuned(0.5, TIME)
    most: Positive = tuned(60.0, RATE_SQUARED)


@compiled
def add_errors(
    errors: Array, measured: Array, expected: Array, first: int, rest: tuple[float, float]
) -> None:
    """Add a block's squared errors to those of each delay of whole ticks.

    ``errors`` (d + 1,) are of the delays up to d ticks, ``measured`` (n + 1, nv) velocities of the
    block's ticks and of the next one, ``expected`` (d + 1 + n, nv) accelerations from d + 1 ticks
    before it on; ``first`` is of the joints. ``rest`` are time step [s] and an error's bound
    [rad/s^2].
    """
    dt, most = rest
    ticks, longest = measured.shape[0] - 1, errors.shape[0]
    for k in range(ticks):
        for joint in range(first, measured.shape[1]):
            found = (measured[k + 1, joint] - measured[k, joint]) / dt
            for d in range(longest):
                error = min(max(found - expected[longest - d + k, joint], -most), most)
                errors[d] += error * error


def learnt_delay() -> None:
    """The errors of each delay."""
    add_errors(np.zeros(9), np.zeros((65, 7)), np.zeros((73, 7)), 3, (1e-3, 60.0))


DELAY = (Part(learnt_delay, 0.1),)  # compiled functions of the delay's estimate


class DelayCompensation:
    """Prediction of the state in which the torques of this tick will act.

    The torques of tick j act in the step after tick j + d. So the acceleration of the joints in
    the step before tick k is the one expected at tick k - 1 - d, but for errors of the model::

        d = argmin sum_k e^(-age_k / memory) |(v_k - v_{k-1}) / dt - a_{k-1-d}|^2,

    each error clipped, over whole ticks d. The state when the torques act is then::

        v + dt (a_{k-d} + ... + a_{k-1}),
        q + d dt v + dt^2 ((d - 1/2) a_{k-d} + ... + 1/2 a_{k-1}).

    Args:
        options: delays that are considered.
        robot: whose state.
        dt: control period [s].
    """

    @checked
    def __init__(self, options: DelayOptions, robot: Biped, dt: float) -> None:
        ready(DELAY)
        self._options, self._robot, self._dt = options, robot, dt
        self._most = round(options.longest / dt)
        self._expected = np.zeros((self._most + 1 + _BLOCK, robot.nv))
        self._measured = np.zeros((_BLOCK + 1, robot.nv))
        self._errors = np.zeros(self._most + 1)
        self._first = 0  # tick of the block
        self._tick = 0
        self.ticks = 0
        """Estimated delay in ticks."""

    @property
    def delay(self) -> float:
        """Estimated delay [s]."""
        return self.ticks * self._dt

    def foresee(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Predicted state at which this tick's torques will act; without delay the arguments.

        Args:
            q: (nq,) measured configuration.
            v: (nv,) measured velocity.
        """
        if self._most == 0:
            return q, v
        place = self._tick - self._first
        self._measured[place] = v
        if place == _BLOCK:
            self._compare()
            place = 0
        d = self.ticks
        if d == 0:
            return q, v
        dt, pending = self._dt, self._expected[place + self._most + 1 - d : place + self._most + 1]
        ages = np.arange(d - 0.5, 0.0, -1.0)
        step = (d * dt) * v + dt * dt * (ages @ pending)
        return self._robot.moved(q, step), v + dt * pending.sum(axis=0)

    def expect(self, acceleration: Array) -> None:
        """Store the acceleration (nv,) that this tick's torques should cause [m/s^2, rad/s^2]."""
        if self._most:
            self._expected[self._tick - self._first + self._most + 1] = acceleration
            self._tick += 1

    def _compare(self) -> None:
        """Add the block's errors to each delay's sum, update the estimate, start a new block."""
        o = self._options
        if self._first >= self._most:  # before, the first torques have no history
            self._errors *= np.exp(-_BLOCK * self._dt / o.memory)
            first = self._robot.base_dof
            add_errors(self._errors, self._measured, self._expected, first, (self._dt, o.most))
            likeliest = int(self._errors.argmin())
            if self._errors[likeliest] < (1.0 - _MARGIN) * self._errors[self.ticks]:
                self.ticks = likeliest
                _LOG.info("the torques act %.3g s after they are computed", self.delay)
        self._expected[: self._most + 1] = self._expected[_BLOCK:].copy()
        self._measured[0] = self._measured[_BLOCK]
        self._first = self._tick
