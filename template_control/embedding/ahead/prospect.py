"""What a plan of several walking steps is made of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.ahead.gait_row import GaitTable
from template_control.slip.dynamics.kernel import Scratch
from template_control.slip.dynamics.model import Kernel

Array = NDArray[np.float64]


class Prospect(NamedTuple):
    """What holds for every plan.

    Attributes:
        kernel: the step.
        table: gaits by speed.
        tolerance: (3,) of the states.
        control_tolerance: (4,) of the controls.
        rise: |dy/dt| that costs nothing, and what is beyond it and costs 1 [m/s].
        bounds: (2, 4) least and greatest alpha relative to the gait's [rad], stiffnesses over k.
        top_margin: alpha stays this far below asin(y / l0) [rad].
        rounds: Gauss-Newton steps.
        done: share of the cost; a step that lowers it by less is the last.
        slots: (4,) of the controls.
        columns: (7,) of the map's derivatives, states and controls.
    """

    kernel: Kernel
    table: GaitTable
    tolerance: Array
    control_tolerance: Array
    rise: tuple[float, float]
    bounds: Array
    top_margin: float
    rounds: int
    done: float
    slots: NDArray[np.int64]
    columns: NDArray[np.int64]


class Aim(NamedTuple):
    """Where a plan is to lead.

    Attributes:
        speed: dx/dt at VLO of the aimed gait [m/s].
        offset: (3,) what the robot adds to each step of the template.
        angles: least and greatest touchdown angle of the first step [rad].
    """

    speed: float
    offset: Array
    angles: tuple[float, float]


class Plan(NamedTuple):
    """N steps.

    Attributes:
        states: (N + 1, 3) at VLO, the present one first.
        controls: (N, 4) alpha and shares of the aimed gait's k.
        row: of the aimed gait, see :mod:`~.gait_row`.
    """

    states: Array
    controls: Array
    row: Array


class Workspace(NamedTuple):
    """Scratch of the maps.

    Attributes:
        real: of plans.
        complex: of their derivatives.
    """

    real: Scratch
    complex: Scratch
