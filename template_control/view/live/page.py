"""Controls and plots of a page on which a robot is driven, and the figures that it plots."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, radians, sin
from typing import Any

import numpy as np

from template_control.arrays import Array
from template_control.run.live import Tick
from template_control.run.record import Record
from template_control.run.velocity import VelocityRange
from template_control.slip.parameters import SlipParameters
from template_control.view.style import COM, LEFT, RIGHT, TEMPLATE

_PUSH = 0.04  # of m sqrt(g l0), size of a push at first: 10 N s for five-link
_FRICTIONS = (0.05, 1.2)
_STEP = 0.05  # of the speed by a key [m/s, of the reference template's sqrt(g l0)]
_WINDOW = 8.0  # [s] of the plots
_HEIGHT = 130  # of a plot [px]


def first_push(p: SlipParameters) -> float:
    """Impulse of a push at first, to two digits, for a robot of this template [N s]."""
    return float(f"{_PUSH * p.mass * p.speed_unit:.2g}")


class Controls:
    """Sliders, buttons and keys of viser's ``gui``.

    ``do`` gets a deed's name and values: ``velocity`` forward, to the left [m/s] and turning
    [rad/s]; ``push`` an impulse [N s] and its direction from forward to the left [rad];
    ``friction``; ``speed``, seconds of the run per second; ``pause``, ``tick``, ``step``, ``reset``
    and ``save``. It is called by another thread than the loop's. ``impulse`` is of a push at first
    [N s], ``friction`` of the ground; None: it cannot be changed.
    """

    def __init__(
        self,
        gui: Any,
        ranges: VelocityRange,
        impulse: float,
        do: Callable[..., None],
        friction: float | None,
    ) -> None:
        self._gui, self._ranges, self._do = gui, ranges, do
        self._first_push, self._friction = impulse, friction
        with gui.add_folder("Walk"):
            self._add_walk()
        with gui.add_folder("Push"):
            self._add_pushes()
        with gui.add_folder("Time"):
            pace = self._slide("times real time", (0.05, 2.0), 1.0, 0.05)
            pace.on_update(lambda _: do("speed", float(pace.value)))
            buttons = gui.add_button_group("run", ("pause", "tick", "step", "reset", "save"))
            buttons.on_click(lambda _: do(buttons.value))
        with gui.add_folder("Keys", expand_by_default=False):
            gui.add_markdown(
                "W, S: faster, slower; A, D: turn; I, K, J, L: push ahead, back, to the left, to"
                " the right; space: pause or go on; T: a tick; N: a step; R: reset"
            )
        self._add_keys()

    def _slide(self, label: str, limits: tuple[float, float], first: float, step: float) -> Any:
        return self._gui.add_slider(label, *limits, step, min(max(first, limits[0]), limits[1]))

    def _add_walk(self) -> None:
        r = self._ranges
        slowest = -r.backward if r.backward else r.speeds[0]
        fastest = max(r.speeds[1], r.run)
        self.speed = self._slide("speed [m/s]", (slowest, fastest), r.first, 0.01)
        self._velocity = [self.speed]
        if r.left:
            self._velocity += [
                self._slide("to the left [m/s]", (-r.left, r.left), 0.0, 0.01),
                self._slide("turning [rad/s]", (-r.turning, r.turning), 0.0, 0.01),
            ]
        for slider in self._velocity:
            slider.on_update(lambda _: self._want())
        self._ground = None
        if self._friction is not None:
            self._ground = ground = self._slide("friction", _FRICTIONS, self._friction, 0.01)
            ground.on_update(lambda _: self._do("friction", float(ground.value)))

    def _want(self) -> None:
        values = [float(slider.value) for slider in self._velocity]
        self._do("velocity", *[*values, 0.0, 0.0][:3])

    def _add_pushes(self) -> None:
        free, first = bool(self._ranges.left), self._first_push
        self._impulse = self._gui.add_number("impulse [N s]", first, min=0.0, step=first / 10.0)
        names = {"ahead": 0.0, "back": 180.0} | ({"left": 90.0, "right": -90.0} if free else {})
        buttons = self._gui.add_button_group("push", tuple(names))
        buttons.on_click(lambda _: self._push(names[buttons.value]))
        if free:
            angle = self._gui.add_slider("direction [deg]", -180.0, 180.0, 5.0, 45.0)
            other = self._gui.add_button("push in this direction")
            other.on_click(lambda _: self._push(float(angle.value)))

    def _push(self, degrees: float) -> None:
        impulse, back = float(self._impulse.value), abs(degrees) == 180.0
        self._do("push", -impulse if back else impulse, 0.0 if back else radians(degrees))

    def _add_keys(self) -> None:
        turn = self._ranges.turning / 5.0
        keys: list[tuple[str, str, Callable[[], None]]] = [
            ("faster", "W", lambda: self._nudge(0, _STEP)),
            ("slower", "S", lambda: self._nudge(0, -_STEP)),
            ("push ahead", "I", lambda: self._push(0.0)),
            ("push back", "K", lambda: self._push(180.0)),
            ("pause or go on", "space", lambda: self._do("pause")),
            ("one tick", "T", lambda: self._do("tick")),
            ("one step", "N", lambda: self._do("step")),
            ("reset", "R", lambda: self._do("reset")),
        ]
        if turn:
            keys += [
                ("turn left", "A", lambda: self._nudge(2, turn)),
                ("turn right", "D", lambda: self._nudge(2, -turn)),
                ("push to the left", "J", lambda: self._push(90.0)),
                ("push to the right", "L", lambda: self._push(-90.0)),
            ]
        for label, key, deed in keys:
            command = self._gui.add_command(label, hotkey=key)
            command.on_trigger(lambda _, deed=deed: deed())

    def _nudge(self, which: int, by: float) -> None:
        slider = self._velocity[which]
        slider.value = min(max(slider.value + by, slider.min), slider.max)  # which calls _want

    def reset(self) -> None:
        """Put what is wanted, and the ground, back to what it was at first."""
        self.speed.value = self._ranges.first
        for slider in self._velocity[1:]:
            slider.value = 0.0
        if self._ground is not None:
            self._ground.value = self._friction


class Plots:
    """Plots of the last seconds; ``gui`` is viser's, ``fastest`` the robot's speed [m/s]."""

    def __init__(self, gui: Any, fastest: float) -> None:
        self._rows: deque[tuple[float, ...]] = deque()
        speeds, sides = {"wanted": TEMPLATE, "walked": COM}, {"left": LEFT, "right": RIGHT}
        forces = {"ground": COM, "template": TEMPLATE}
        plots: tuple[tuple[str, dict[str, str], dict[str, Any]], ...] = (
            ("mean speed of the last step [m/s]", speeds, {"range": (0.0, 1.2 * fastest)}),
            ("torque over its limit, largest", sides, {"range": (0.0, 1.0)}),
            ("vertical force over weight", forces, {"auto": True}),
        )
        empty = np.array([0.0, 1e-3])
        self._plots = [
            gui.add_uplot(
                data=(empty, *(0.0 * empty for _ in lines)),
                series=(
                    {"label": "s"},
                    *({"label": k, "stroke": color, "width": 1.5} for k, color in lines.items()),
                ),
                title=title,
                scales={"x": {"time": False, "auto": True}, "y": scale},
                legend={"live": False},
                height=_HEIGHT,
            )
            for title, lines, scale in plots
        ]

    def clear(self) -> None:
        """Forget all values."""
        self._rows.clear()

    def add(self, time: float, values: tuple[float, ...]) -> None:
        """Add a value for each of the two lines of each plot; times [s] rise."""
        self._rows.append((time, *values))
        while self._rows[0][0] < time - _WINDOW:
            self._rows.popleft()

    def draw(self) -> None:
        """Send what the plots show."""
        if len(self._rows) >= 2:
            time, *columns = np.array(self._rows).T
            for i, handle in enumerate(self._plots):
                handle.data = (time, *columns[2 * i : 2 * i + 2])


Columns = Mapping[str, Array]


class Figures:
    """Torques and forces of some ticks; ``record`` is of the run so far."""

    def __init__(self, record: Record) -> None:
        self._weight = record.weight
        self._limit = np.asarray(record.torque_limit)
        legs = record.legs
        self._joints = [[i for foot in group for i in legs[foot]] for group in record.groups]

    def of(self, columns: Columns) -> tuple[float, float, float, float]:
        """Largest torque over its limit in each leg, and mean vertical forces over the weight."""
        share = np.abs(columns["torque"]).max(axis=0) / self._limit
        left, right = (float(share[joints].max()) for joints in self._joints)
        ground = columns["contact_force"][..., 1].sum(axis=1).mean() / self._weight
        template = columns["template_force"][..., 1].sum(axis=1).mean() / self._weight
        return left, right, float(ground), float(template)


@dataclass(frozen=True)
class Step:
    """Number of steps done, mean speed of the last one along the heading [m/s], and its end.

    ``began`` is when the present step was seen first [s], with x and y of the CoM [m]; or None.
    """

    number: int
    speed: float
    began: tuple[float, float, float] | None

    def after(self, tick: Tick, columns: Columns) -> Step:
        """The same after some more ticks, of which ``tick`` and the ``columns`` end the last."""
        if tick.steps == self.number:
            return self
        com = columns["space_com" if "space_com" in columns else "com"][-1]
        x, y = float(com[0]), float(com[1]) if len(com) > 2 else 0.0
        speed, heading = self.speed, float(columns["heading"][-1])
        if self.began is not None and tick.time > self.began[0]:
            time, x_before, y_before = self.began
            ahead = cos(heading) * (x - x_before) + sin(heading) * (y - y_before)
            speed = ahead / (tick.time - time)
        return Step(tick.steps, speed, (tick.time, x, y))
