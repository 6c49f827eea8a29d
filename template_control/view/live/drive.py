"""A robot driven in the browser: page, physics and controller in one process."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from template_control.checks.checked import checked
from template_control.errors import ParameterError, TemplateControlError
from template_control.plant.terrain import Terrain
from template_control.robot.biped import Biped
from template_control.robot.library import ROBOTS, SHIPPED
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import Experiment
from template_control.run.live import LiveRun, Tick
from template_control.run.record import Record
from template_control.run.velocity import VelocityCommand, VelocityRange
from template_control.slip.maps.section import APEX, REST, VLO
from template_control.storage import writing
from template_control.view.browser import PORTS, show_in_browser
from template_control.view.live.pace import Pace
from template_control.view.live.page import Controls, Figures, Plots, Step, first_push
from template_control.view.live.scene import LiveScene
from template_control.view.live.server import PageServer
from template_control.view.replay.playback import FRAME_RATES

FPS = 30.0
KEPT = 60.0  # end of a run that is kept for its record [s]
_DRAWN = 7  # frames between two plots
_MANY_LATE = 0.5  # of the frames between two plots
_PUSHED = 0.4  # [s] a push is shown: most last for three frames
_GAITS = {VLO: "walks", APEX: "runs", REST: "stands"}  # by the section that a stride begins at
_IDLE = 0.05  # [s] between two looks for a tab
_MOST_TICKS = 1024  # of a frame, that are looked at


class Drive(AbstractContextManager["Drive"]):
    """A run on a page, driven by its visitors; ends with :meth:`close` or the ``with`` block.

    The loop is in the thread that calls :meth:`loop`; what the page asks for is done between two of
    its frames. Without a tab the run waits. Arguments as for :func:`drive`, of an experiment.

    Attributes:
        url: where a browser finds the page.
        run: that goes on; None until its kernels are compiled.
        pace: clock of the frames.
        paused: whether a visitor has halted the run.
        tick: the last one.
        step: speed of the last step.
    """

    tick: Tick
    step: Step

    def __init__(self, experiment: Experiment, port: int | None, fps: float, folder: Path) -> None:
        if experiment.motion is not None or experiment.steps is not None:
            raise ParameterError("the page is the robot's motion: leave motion and steps out")
        spec = experiment.robot
        self._robot = spec.load() if isinstance(spec, RobotSpec) else spec
        self._experiment, self._folder = experiment, folder
        self._page = PageServer(port)
        self._server, self.url = self._page.viser, self._page.url
        self.pace = Pace(experiment.world.time_step, fps)
        self.run: LiveRun | None = None
        self.paused = False
        self._asked: deque[Any] = deque()
        self._closed = False
        self._thread: threading.Thread | None = None
        self._late = 0  # frames, until the last plot
        self._single = 0  # ticks to make in spite of a pause
        self._halt_at: int | None = None  # steps at which a halted run halts again
        self._status = self._server.gui.add_markdown("loading; a first run compiles for a minute")

    @property
    def tabs(self) -> int:
        """Number of tabs that show the page."""
        return len(self._server.get_clients())

    def start(self) -> Drive:
        """Let :meth:`loop` go on in a thread of its own, as a notebook needs it; itself."""
        self._thread = threading.Thread(target=self.loop, daemon=True)
        self._thread.start()
        return self

    def close(self) -> None:
        """End the loop, the run and the page."""
        self._closed = True
        if self._thread is not None:
            self._thread.join()
        self._page.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """The page in a notebook."""
        return f'<iframe src="{self.url}" width="100%" height="600"></iframe>'

    def record(self) -> Record:
        """The last minute of the run.

        Raises:
            ParameterError: if the run has not begun.
        """
        return self._going.record()

    def experiment(self) -> Experiment:
        """What repeats the run from its start to the last bit; see :meth:`~.LiveRun.experiment`."""
        return self._going.experiment()

    @property
    def _going(self) -> LiveRun:
        if self.run is None:
            raise ParameterError("the run has not begun: wait until the page shows the robot")
        return self.run

    def loop(self) -> None:
        """Go on until :meth:`close` or Ctrl-C."""
        try:
            self._begin()
            while not self._closed:
                self._do_asked()
                if self.tabs or self._single:
                    self._frame()
                    self.pace.wait()
                else:
                    time.sleep(_IDLE)
                    self.pace.restart()
        finally:
            if self.run is not None:
                self.run.close()

    def _begin(self) -> None:
        """Load the robot, put up the controls, and begin the run."""
        assert isinstance(self._robot, Biped)
        self._ranges = ranges = VelocityRange.of(self._robot)
        self._restart()
        gui, run = self._server.gui, self._going
        record = run.record()
        ground = getattr(self._experiment.world, "ground", None) or Terrain.flat()
        self._scene = LiveScene(self._server.scene, record, ground)
        self._scene.look(self._server.initial_camera)
        self._figures = Figures(record)
        impulse = first_push(run.controller.parameters)
        self._controls = Controls(gui, ranges, impulse, self._ask, run.hand.friction)
        with gui.add_folder("Plots"):
            self._plots = Plots(gui, max(ranges.speeds[1], ranges.run))
        self.pace.restart()

    def _do(self, deed: str, *values: float) -> None:
        """Do a deed of the page's controls."""
        hand = self._going.hand
        deeds: dict[str, Callable[..., None]] = {
            "velocity": hand.set_velocity,
            "push": lambda impulse, turn: hand.push(impulse, direction=turn),
            "friction": hand.set_friction,
            "speed": lambda value: setattr(self.pace, "speed", value),
            "pause": self._pause,
            "tick": self._one_tick,
            "step": self._one_step,
            "reset": self._reset,
            "save": self._save,
        }
        deeds[deed](*values)

    def _ask(self, deed: str, *values: float) -> None:
        """Let the loop do a deed, which other threads ask for."""
        self._asked.append((deed, *values))

    def _do_asked(self) -> None:
        """Do what the page has asked for; what cannot be done is said there."""
        while self._asked:
            try:
                self._do(*self._asked.popleft())
            except TemplateControlError as error:
                self._say(str(error))

    def _say(self, text: str) -> None:
        for client in self._server.get_clients().values():
            client.add_notification("template-control", text, auto_close_seconds=10.0)

    def _pause(self) -> None:
        self.paused, self._halt_at = not self.paused, None

    def _one_tick(self) -> None:
        self.paused, self._single = True, self._single + 1

    def _one_step(self) -> None:
        self.paused, self._halt_at = True, self.tick.steps + 1

    def _reset(self) -> None:
        self._restart()
        self._controls.reset()
        self._plots.clear()
        self._scene.clear()
        self._show(1)

    def _save(self) -> None:
        with writing(self._folder) as folder:
            self.record().save(folder / "run.npz")
            self.experiment().save(folder / "run.toml")
        self._say(f"{folder}: run.npz, and run.toml, which repeats the run from its start")

    def _restart(self) -> None:
        """Begin a run at the first speed; the world is the experiment's."""
        if self.run is not None:
            self.run.close()
        command = VelocityCommand(self._ranges.first, gaits=self._ranges.gaits)
        run = LiveRun(replace(self._experiment, motion=command), keep=KEPT)
        self.tick = next(run)
        self._push, self._pushed = (0.0, 0.0), -np.inf
        self._frames, self._single, self._halt_at = 0, 0, None
        self.step = Step(self.tick.steps, 0.0, None)
        self.run = run

    def _frame(self) -> None:
        """Ticks of a frame, and what the page shows of them."""
        halted, due = self.paused and self._halt_at is None, self.pace.ticks()
        made = self._advance(self._single if halted else due)
        self._single = 0
        if made:
            self._show(made)
        self._frames += 1
        if self._frames % _DRAWN == 0:
            self._tell()

    def _advance(self, ticks: int) -> int:
        """Go on by some ticks, but not beyond a fall; the number of those made."""
        run = self._going
        for made in range(0 if run.ended else ticks):
            if self._halt_at is not None and self.tick.steps >= self._halt_at:
                self._halt_at = None
                return made
            try:
                tick = next(run, None)
            except TemplateControlError as error:
                self._say(f"{error}. Reset begins anew")
                return made
            if tick is None:
                self._say(f"fell: {run.reason}. Reset begins anew")
                return made
            self.tick = tick
            if any(tick.push):
                self._push, self._pushed = tick.push, tick.time
        return 0 if run.ended else ticks

    def _show(self, ticks: int) -> None:
        columns = self._going.recorder.latest(min(ticks, _MOST_TICKS))
        now = self.tick.time
        push = self._push if now - self._pushed < _PUSHED else (0.0, 0.0)
        with self._server.atomic():
            self._scene.draw(columns, push)
        self.step = self.step.after(self.tick, columns)
        wanted = self._going.hand.velocities[-1][1]
        self._plots.add(now, (wanted, self.step.speed, *self._figures.of(columns)))

    def _tell(self) -> None:
        """Plots, and two lines about the run; a third would move the controls below them."""
        run, tick = self._going, self.tick
        state = _GAITS[run.controller.supervisor.reports[-1].section]
        if run.ended:
            state = f"{f'fell: {run.reason}' if run.reason else 'stopped'}; reset begins anew"
        if not run.ended and self.paused:
            state = "halted"
        late, self._late = self.pace.late - self._late, self.pace.late
        slow = "; frames are late: slow machine" if late > _MANY_LATE * _DRAWN else ""
        line = f"{tick.time:.1f} s, {tick.steps} steps, {self.step.speed:.2f} m/s"
        self._status.content = f"{line}  \n**{state}**{slow}"
        self._plots.draw()


@checked
def drive(
    robot: Biped | RobotSpec | Experiment | str = "five-link",
    *,
    port: Annotated[int, PORTS] | None = None,
    fps: Annotated[float, FRAME_RATES] = FPS,
    folder: str | Path = "runs/drive",
    browser: bool = True,
    wait: bool = True,
) -> Drive:
    """Drive a robot in the browser: physics, controller and page in real time.

    Sliders and keys command speed, turning and friction, push the robot, halt and slow down time;
    plots show the speed, the torques and the ground's force next to the template's. The page is for
    this machine only, and no other page may steer it.

    Args:
        robot: a shipped robot's name, which is planar where there is a planar one; or its options;
            or the model; or an experiment without a motion.
        port: of the server; None: the first free one from 8080 up.
        fps: frames per second.
        folder: where the page's ``save`` puts the run, and what repeats it.
        browser: show the page in the user's browser, where there is a display.
        wait: go on until Ctrl-C; if not, the loop is in a thread of its own, and the page is shown
            where a notebook shows the result.

    Returns:
        The page: ``url``, ``record()``, ``experiment()``, ``close()``. It is closed after a wait.

    Raises:
        MissingPackageError: if viser is not installed.
        ParameterError: if the experiment has a motion, or no port is free.
        RobotError: if there is no such robot.
    """
    experiment = robot if isinstance(robot, Experiment) else Experiment(robot)
    spec = experiment.robot
    if isinstance(spec, RobotSpec) and spec.model in SHIPPED and spec.model not in ROBOTS:
        experiment = replace(experiment, robot=replace(spec, free=True))  # it has no plane
    page = Drive(experiment, port, fps, Path(folder))
    if not wait:
        return page.start()
    with page, suppress(KeyboardInterrupt):
        print(f"drive {experiment.robot_name} at {page.url}, until Ctrl-C", flush=True)
        if browser:
            show_in_browser(page.url)
        page.loop()
    return page
