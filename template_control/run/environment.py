"""Environment of Gymnasium: a robot commanded stride by stride, its controller included."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from template_control.arrays import Array
from template_control.checks.checked import checked
from template_control.checks.ranges import Count, NotNegative
from template_control.embedding.planners.planner import Planner
from template_control.embedding.planners.residual import ResidualPlanner
from template_control.errors import MissingPackageError, ParameterError
from template_control.robot.floating_biped import FloatingBaseBiped
from template_control.robot.spec import RobotSpec
from template_control.run.experiment import Experiment
from template_control.run.live import LiveRun
from template_control.run.specs import GaitSpec
from template_control.run.velocity import VelocityCommand, VelocityRange
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.similarity import Scale

try:
    import gymnasium
except ImportError:
    raise MissingPackageError(
        "an environment needs the package gymnasium: pip install 'template-control[gym]'"
    ) from None


_PUSHED = 0.25  # share of the strides in which a push begins
_OFF = 4.0  # price of an error of 1 m/s in the speed, or of 1 rad/s in the turning rate
# Controls that a residual changes, and what its 1 is: rad, and shares of the template's stiffness.
# Drawn anew for each stride, it falls in 1 of 8 episodes of 20 strides (five-link, Bolt), and twice
# as much would in 4.
_RESIDUAL = {Slot.TOUCHDOWN_ANGLE: 0.05, Slot.K_SC: 0.1, Slot.K_SD: 0.1}
_FALL = 10.0  # price of a fall: that of ten strides without an error
_MOST = 10.0  # of an entry of an observation, which are of the order of one
_KEPT = 2.0  # [s] of the run that are kept


class WalkEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A walk that is to keep a wanted velocity; pushes may disturb it.

    A step of the environment is a stride of the robot, from section to section. Lengths, speeds and
    rates are those of a robot of the reference template's size (l0 = 1 m) that moves alike, in m,
    m/s and rad/s: what is learnt with one robot can be tried with another.

    **Action** (1,) or, of a floating base, (2,), from -1 to 1, beyond which it is clipped: the mean
    speed, from the robot's slowest to its fastest, and the turning rate, from its largest to the
    right to that to the left. It holds from the next section on.

    With ``residuals`` the planner of a walk at the wanted speed keeps its say, and the action (3,)
    is added to its controls from the next section on: 1 is 0.05 rad of the touchdown angle, and a
    tenth of the template's stiffness before and after the bottom. The wanted turning rate is 0.

    **Observation** dx/dt, y and dy/dt of the CoM at the section, the trunk's pitch, the mean speed
    of the last stride, the wanted one; of a floating base also y of the CoM from the rear foot and
    its rate, the trunk's roll, the turning rate of the last stride, the wanted one; and at last the
    action before, which the coming stride is planned with.

    **Reward** 1 - 4 abs(speed - wanted) - 4 abs(turning rate - wanted), and -10 for a fall.

    An episode is terminated by a fall, and truncated after ``strides``. ``info`` has the ``time``
    [s], and why the robot fell, ``fall_reason``. ``reset(options={"wanted": (0.6, 0.0)})`` sets the
    wanted speed [m/s] and turning rate [rad/s], which else are drawn.

    Args:
        experiment: robot, world, sensors and so on, without a motion; or a robot's name.
        strides: of an episode.
        impulse: of the largest push [N s]; a push begins in a quarter of the strides, with a drawn
            size and, of a floating base, from a drawn side.
        residuals: whether an action is added to the planner's controls, instead of a command.

    Raises:
        MissingPackageError: if gymnasium is not installed.
        ParameterError: if the experiment has a motion.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  (as Gymnasium declares it)

    @checked
    def __init__(
        self,
        experiment: Experiment | str = "five-link",
        strides: Count = 40,
        impulse: NotNegative = 0.0,
        residuals: bool = False,
    ) -> None:
        if isinstance(experiment, str):
            experiment = Experiment(experiment)
        if experiment.motion is not None or experiment.steps is not None:
            raise ParameterError("the action is the robot's motion: leave motion and steps out")
        self._experiment, self._strides, self._impulse = experiment, strides, impulse
        spec = experiment.robot
        robot: Any = spec.load() if isinstance(spec, RobotSpec) else spec
        self._range = VelocityRange.of(robot)
        self._free = isinstance(robot, FloatingBaseBiped)
        self._residuals, self._turns = residuals, self._free and not residuals
        actions = len(_RESIDUAL) if residuals else 1 + self._free
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (actions,), np.float32)
        size = (11 if self._free else 6) + actions
        self.observation_space = gymnasium.spaces.Box(-_MOST, _MOST, (size,), np.float32)
        self._over = True
        self._run: LiveRun | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode; see :class:`gymnasium.Env`.

        Args:
            seed: of all draws from now on; None: they go on.
            options: ``wanted``, the speed [m/s] and turning rate [rad/s] of the episode.

        Raises:
            ParameterError: if the robot does not walk like that, or an option is unknown.
        """
        super().reset(seed=seed)
        self.close()
        r, draw = self._range, self.np_random
        turning = float(draw.uniform(-r.turning, r.turning))
        drawn = float(draw.uniform(*r.speeds)), turning if self._turns else 0.0
        self._wanted = self._asked(options) or drawn
        self._action, self._over = np.zeros(self.action_space.shape or ()), False
        self._run = run = LiveRun(self._commanded(self._wanted[0]), keep=_KEPT)
        self._tick = next(run)
        self._scale = Scale.of(run.controller.parameters)
        self._place = self._where(run)
        self._walked = self._wanted[0], 0.0
        return self._observation(run), self._info(run)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Walk a stride; see :class:`gymnasium.Env`."""
        run, r = self._run, self._range
        if run is None or self._over:
            raise ParameterError("the environment has no episode, or it is over: call reset first")
        given = np.asarray(action, dtype=float)
        if given.shape != self.action_space.shape or not np.isfinite(given).all():
            raise ParameterError(
                f"the action is {given.tolist()}: give {self.action_space.shape} finite numbers"
            )
        before, self._action = self._tick, np.clip(given, -1.0, 1.0)
        share = self._action
        if self._residuals:
            unit = [1.0, *[run.controller.parameters.leg_stiffness] * 2]
            self._planner.residual[list(_RESIDUAL)] = share * list(_RESIDUAL.values()) * unit
        else:
            low, high = r.speeds
            turning = float(share[1]) * r.turning if self._turns else 0.0
            speed = low + 0.5 * (float(share[0]) + 1.0) * (high - low)
            run.hand.set_velocity(speed, 0.0, turning)
        self._push(run)
        for tick in run:
            self._tick = tick
            if tick.steps > before.steps:
                break
        place, duration = self._where(run), max(self._tick.time - before.time, 1e-3)
        x, y, heading = place - self._place
        ahead = np.cos(self._place[2]) * x + np.sin(self._place[2]) * y
        self._place, self._walked = place, (float(ahead) / duration, float(heading) / duration)
        fell = bool(run.reason)
        reward = -_FALL if fell else 1.0 - _OFF * self._error()
        truncated = not fell and self._tick.steps >= self._strides
        self._over = fell or truncated
        return self._observation(run), reward, fell, truncated, self._info(run)

    def close(self) -> None:
        """End the episode's run."""
        if self._run is not None:
            self._run.close()
            self._run = None

    def _asked(self, options: dict[str, Any] | None) -> tuple[float, float] | None:
        """The wanted velocity of a reset's options; None where they have none."""
        options, r = options or {}, self._range
        if strange := options.keys() - {"wanted"}:
            raise ParameterError(f"unknown option {min(strange)}: known is wanted")
        if "wanted" not in options:
            return None
        wanted = np.asarray(options["wanted"], dtype=float)
        most = r.turning if self._turns else 0.0
        (slowest, fastest) = r.speeds
        if wanted.shape != (2,) or not (slowest <= wanted[0] <= fastest and abs(wanted[1]) <= most):
            raise ParameterError(
                f"wanted is {options['wanted']}: give a speed from {slowest:.3g} to {fastest:.3g}"
                f" m/s, and a turning rate within {most:.3g} rad/s"
            )
        return float(wanted[0]), float(wanted[1])

    def _commanded(self, speed: float) -> Experiment:
        """The experiment with the motion of an episode that wants this speed [m/s]."""
        if not self._residuals:
            return replace(self._experiment, motion=VelocityCommand(speed))
        walk = replace(self._experiment, motion=GaitSpec(speed=speed)).prepare()
        assert isinstance(walk.planner, Planner)
        self._planner = ResidualPlanner(walk.planner)
        return replace(self._experiment, planner=self._planner)

    def _push(self, run: LiveRun) -> None:
        draw = self.np_random
        if self._impulse and draw.random() < _PUSHED:
            size, side = float(draw.uniform(-1.0, 1.0)), float(draw.uniform(-np.pi, np.pi))
            run.hand.push(self._impulse * size, direction=side if self._free else 0.0)

    def _where(self, run: LiveRun) -> Array:
        """x and y of the CoM [m], and the heading [rad]."""
        last = run.recorder.latest(1)
        com = last["space_com"][0, :2] if self._free else (last["com"][0, 0], 0.0)
        return np.array([*com, last["heading"][0]])

    def _error(self) -> float:
        (speed, rate), (wanted, turning) = self._walked, self._wanted
        time = self._scale.time
        return abs(speed - wanted) / self._scale.speed + abs(rate - turning) * time

    def _observation(self, run: LiveRun) -> NDArray[np.float32]:
        scale, last = self._scale, run.recorder.latest(1)
        speed, height, climb = run.controller.reports[-1].state
        pitch = last["attitude"][0, 1] if self._free else last["q"][0, 2]
        values = [speed / scale.speed, height / scale.length, climb / scale.speed, pitch]
        values += [self._walked[0] / scale.speed, self._wanted[0] / scale.speed]
        if self._free:
            sway, rate = last["sway"][0]
            values += [sway / scale.length, rate / scale.speed, last["attitude"][0, 0]]
            values += [self._walked[1] * scale.time, self._wanted[1] * scale.time]
        values += self._action.tolist()
        return np.clip(np.array(values, dtype=np.float32), -_MOST, _MOST)

    def _info(self, run: LiveRun) -> dict[str, Any]:
        return {"time": self._tick.time, "fall_reason": run.reason}
