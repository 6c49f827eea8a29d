"""Lateral half of a walk: footholds to the left or right, found at every tick.

Next to the stance foot the CoM falls away from it all the time: after t its distance has grown by
about exp(t sqrt(g / z)). After a lateral push the next foothold may be wanted further away than
the legs reach, or on the other side of the stance foot. A steeper touchdown angle puts the foot
down earlier, while it still is in reach.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from template_control.arrays import Array
from template_control.compiled import compiled
from template_control.embedding.planners.planner import Decision
from template_control.slip.automaton.vocabulary import Slot
from template_control.slip.gaits.gait import Gait
from template_control.slip.lateral.gait import (
    LateralCycle,
    LateralGait,
    LateralOptions,
    LateralWish,
    Side,
    lateral_cycle,
    lateral_gait,
)
from template_control.slip.lateral.path import LateralPath, lateral_path
from template_control.slip.lateral.placing import (
    LateralAim,
    LateralLearnt,
    Placement,
    before_turn,
    contact,
    lateral_aim,
    pivot,
    place,
)
from template_control.slip.parameters import SlipParameters
from template_control.slip.path import TemplatePath
from template_control.slip.similarity import Scale, scaled
from template_control.structured import structure

BEYOND = 0.03
"""A foothold that is wanted further than this beyond its bounds is out of reach [m, of the
reference template]."""
STEEPER = (0.02, 0.04, 0.06)
"""Touchdown angles that are tried, over the one decided, in turn [rad]."""
_GAIN = 0.8  # share that a steeper angle must leave of the error's price to be taken


class LateralForecast(NamedTuple):
    """Forecast of the next foothold to the side."""

    beyond: float  # how far the wanted foothold is beyond its bounds [m]; NaN: none is known
    price: float  # of the error that is left at the section after the foothold


def lateral_forecast(found: Placement, aim: LateralAim) -> LateralForecast:
    """Forecast of a foothold that was chosen for ``aim``."""
    error = found.state(found.y) - aim.state
    return LateralForecast(abs(found.wanted - found.y), float(error @ aim.cost @ error))


def early_touchdown(
    decision: Decision,
    decide: Callable[[float], Decision],
    look: Callable[[Decision], LateralForecast],
    reach: float = BEYOND,
) -> Decision:
    """The decision for a step, with a steeper touchdown where the foothold is out of reach.

    Or where the robot's path does not come to the next section, and no foothold is known.
    Of the steeper steps it is the one that leaves the least error, which is not nominal. ``decide``
    makes the step with a touchdown angle of at least so much [rad], ``look`` is a decision's
    forecast to the side; a foothold wanted further than ``reach`` [m] beyond its bounds is out.
    """
    best, now = decision, look(decision)
    known = np.isfinite(now.price)
    if now.beyond <= reach or not (known or decision.feasible):
        return decision
    angle = float(decision.controls[Slot.TOUCHDOWN_ANGLE])
    bar = _GAIN * now.price if known else np.inf
    for more in STEEPER:
        steeper = decide(angle + more)
        if not steeper.feasible:
            break
        then = look(steeper)
        if then.price < bar:
            best, bar = replace(steeper, nominal=False), then.price
    return best


LATERAL = structure(
    rolling=float,  # of the feet, see pivot
    feet=(np.int64, (2,)),  # that were rear and front at the start of the path
    stood=(float, (2, 2)),  # x and y where each foot stands, or stood last [m]
    # -- the turn of a run's stride --
    turn=float,  # of the heading in it [rad]
    begun=float,  # when it began [s]
    duration=float,  # of it [s]
    bank=float,  # roll that the turn's curve asks for [rad]
    bank_rate=float,  # at which the roll goes there [rad/s]
    spin=float,  # angular momentum about the vertical [N m s]
    # Of the periodic motion, at the section of the foot that landed last: y of the CoM from it,
    # and dy/dt [m, m/s].
    cycle=(float, (2,)),
    section_began=float,  # time of the last section [s]
    # -- the plan of a stand --
    unit=float,  # of time, over the reference template's
    pressure=float,  # y of the centre of pressure [m]; NaN: not planned
    pressure_at=float,  # when it was planned [s]
    # Whether the capture point is further off the ground under both feet, on which it is held,
    # than the trunk's roll leads it back.
    leaves=np.int64,
    catches=np.int64,  # whether a step catches it
    half_width=float,  # how far to either side of its middle a foot bears; 0 of a point [m]
    # -- the foothold: see Placement --
    step=float,  # to it in the gait, see LateralAim [m]
    steps=(float, (2,)),  # the least and the largest, to the left [m]
    second_step=float,  # from it to the one after it, to the left [m]
    hold=float,  # time before touchdown from which on it is kept [s]
    placed=np.int64,  # whether there is one
    y=float,
    wanted=float,
    left=float,
    com=float,
    expected=(float, (2,)),
    slope=(float, (2,)),
)
"""The lateral half of a tick."""


@compiled
def lateral_foothold(
    lateral: Any, plan: tuple[LateralPath, LateralAim], time: float, com: Array, feet: Array
) -> float:
    """y of the next foothold [m]; NaN where none is known.

    ``plan`` are the path, on which ``time`` is [s], and what the foothold is for; ``com`` (2,) is y
    of the CoM and dy/dt [m, m/s], ``feet`` (2,) y of the feet that were rear and front at the start
    of the path [m].
    """
    path, aim = plan
    found = place(path, aim, time, com, pivot(feet, com[0], lateral.rolling))
    if found.left > lateral.hold or not lateral.placed:
        lateral.placed = 1 if np.isfinite(found.y) else 0
        lateral.y, lateral.wanted = found.y, found.wanted
        lateral.left, lateral.com = found.left, found.com
        lateral.expected[:], lateral.slope[:] = found.expected, found.slope
    return contact(lateral.y, lateral.com, lateral.rolling)


SIDES = (Side.LEFT, Side.RIGHT)
"""Of each foot, in the order of the robot's ``feet``."""
_NO_AIM = LateralAim(np.zeros(2), 0.0, np.zeros((2, 2)), 0.0, np.zeros(2), np.zeros(2), 0.0)
"""Of a robot that has walked towards no gait yet: its path comes to no foothold."""


class LateralPlanner:
    """The lateral half of the walk; all positions are y in the heading frame.

    ``options`` are of the reference template; ``wish``, step width, lateral motion and turn, may be
    changed between two steps; ``data`` (1,) are of ``LATERAL``, which ticks read and write;
    ``ratio`` is that of a :class:`.LateralPath`, ``rolling`` that of :func:`.pivot`.
    ``lessons`` is what the robot adds to the template's sideways motion, by kind of stride,
    ``cycle`` the wish's periodic motion.
    """

    def __init__(
        self,
        parameters: SlipParameters,
        options: LateralOptions,
        wish: LateralWish,
        data: Any,
        ratio: float = 1.0,
        rolling: float = 0.0,
    ) -> None:
        self.wish, self.data = wish, data
        self._unscaled = options
        self.options = scaled(options, Scale.of(parameters))
        self._gravity, self._ratio = parameters.gravity, ratio * (1.0 - rolling)
        data["rolling"] = rolling
        self.lessons: dict[str, LateralLearnt] = {}
        self.cycle: LateralCycle
        self._gait: Gait | None = None
        self._kind = ""
        self._lateral: LateralGait
        self._aim = _NO_AIM
        self._stretch = 1.0
        self._path: LateralPath
        data["hold"], data["duration"] = self.options.hold, 1.0
        self.reset(None)

    @property
    def learnt(self) -> LateralLearnt:
        """What has been learnt of the present gait's strides."""
        return self.lessons.get(self._kind, LateralLearnt())

    @property
    def placed(self) -> Placement | None:
        """The foothold that was chosen for the foot in the air; None before the first."""
        now = self.data[0]
        if not now["placed"]:
            return None
        return Placement(*(now[name].copy() for name in Placement._fields))

    def reset(self, gait: Gait | None) -> None:
        """Begin anew with a gait, or with none; nothing is learnt yet."""
        self._planar: TemplatePath | None = None
        self.lessons.clear()
        self.data["placed"] = 0
        self._landed: Placement | None = None
        self.due = np.inf  # time from the section to the template's touchdown [s]; inf: in flight
        self.walk(gait)

    def walk(self, gait: Gait | None) -> None:
        """Take the periodic motion of a gait, walked or walked towards, and of what is learnt.

        None: of the gait so far, if there is one.
        """
        if gait is not None and gait is not self._gait:
            self._gait, self._kind = gait, gait.stride
            self._lateral = lateral_gait(gait, self._unscaled, ratio=self._ratio)
        if self._gait is not None:
            self.cycle = lateral_cycle(self._lateral, self.wish, self.learnt.offset)

    def end_step(self, stance: Side, foot: float, com: Array) -> None:
        """Learn from a nominal step that has ended at a section with the CoM at ``com`` (2,).

        ``stance`` is the side of the foot that stands now, at y ``foot`` [m].
        """
        if self._landed is not None:
            foot = pivot(foot, com[0], float(self.data[0]["rolling"]))
            surprise = com - (foot, 0.0) - self._landed.state(foot)
            learnt = self.learnt.after_step(stance.other, surprise, self.options.learning)
            self.lessons[self._kind] = learnt

    def touch_down(self, lasted: float) -> None:
        """Learn the duration of single stance from a touchdown so long after the section [s]."""
        if np.isfinite(self.due) and self.due > 0.0:
            self.lessons[self._kind] = self.learnt.after_stance(lasted, self.due)
        self._landed, self.due = self.placed, np.inf
        self.data["placed"] = 0

    def aim(self, stance: Side, *, turned: bool = False) -> None:
        """Aim at the next foothold, next to the foot on the side ``stance``, and the one after it.

        That foot stands, or stood last; ``turned`` says whether the heading has turned at its
        section already. A foot that lands shortly after an apex is placed before the turn there;
        one that lands after a VLO has the time to be placed anew.
        """
        if self._gait is None:
            return
        state = self.cycle.states[stance.row].copy()
        if turned:
            state[1] -= self._lateral.speed * self.wish.turn
        self.data["cycle"] = state
        self._stretch = self.learnt.stretch
        self._aim = lateral_aim(self._lateral, self.cycle, stance, self.learnt, self.options)
        if self._lateral.ahead and not turned:
            self._aim = before_turn(self._aim, self._lateral, self.wish.turn)
        self.data["second_step"] = self.cycle.steps[stance.other.row]
        self.data["step"], self.data["steps"] = self._aim.step, self._aim.steps

    def forecast(self, path: TemplatePath, com: Array, feet: Array) -> LateralForecast:
        """Forecast of the next foothold, where the robot's planar path begins.

        ``com`` and ``feet`` are as for :func:`lateral_foothold`.
        """
        self._take(path)
        pivots = pivot(feet, com[0], float(self.data[0]["rolling"]))
        return lateral_forecast(place(self._path, self._aim, 0.0, com, pivots), self._aim)

    def follow(self, path: TemplatePath, feet: tuple[int, int]) -> tuple[LateralPath, LateralAim]:
        """Take the planar path from now on, with its feet; the plan of :func:`lateral_foothold`."""
        self._take(path)
        self.data["feet"] = feet
        return self._path, self._aim

    def _take(self, path: TemplatePath) -> None:
        if path is not self._planar or self._stretch != self._path.stretch:
            self._planar = path
            self._path = lateral_path(path.strides, self._gravity, self._ratio, self._stretch)
