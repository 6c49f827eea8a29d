"""Clock of a page's frames."""

from __future__ import annotations

import time
from collections.abc import Callable

_LATE = 0.5  # of a frame's duration: a frame that begins later than this is late
_GIVEN_UP = 0.25  # [s] what is missed beyond this is not made up for


class Pace:
    """Clock of frames: how many ticks a frame has, and when the next one is due.

    ``time_step`` is of a tick [s], ``fps`` frames per second; ``clock`` and ``sleep`` are of
    wall-clock time. ``speed`` is seconds of the run per second; ``late`` of the ``frames`` began
    more than half a frame too late, the ``worst`` by so much [s].
    """

    def __init__(
        self,
        time_step: float,
        fps: float,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.speed = 1.0
        self.frames = self.late = 0
        self.worst = 0.0
        self._step, self._period = time_step, 1.0 / fps
        self._clock, self._sleep = clock, sleep
        self._owed = 0.0  # ticks, a share of one included
        self.restart()

    def restart(self) -> None:
        """Let the next frame be due at once: what was missed before is not made up for."""
        self._due = self._clock()

    def ticks(self) -> int:
        """Number of ticks of the frame that begins now."""
        self._owed += self.speed * self._period / self._step
        whole = int(self._owed)
        self._owed -= whole
        return whole

    def wait(self) -> None:
        """Wait until the next frame is due."""
        self._due += self._period
        left = self._due - self._clock()
        if left > 0.0:
            self._sleep(left)
        delay = self._clock() - self._due
        self.frames += 1
        self.late += delay > _LATE * self._period
        self.worst = max(self.worst, delay)
        if delay > _GIVEN_UP:
            self.restart()
