"""The compiled code of the sideways motion, to be made ready before a tick needs it."""

from __future__ import annotations

import numpy as np

from template_control.slip.automaton.automaton import STRIDE_START
from template_control.slip.dynamics.stride import controls, simulate_stride
from template_control.slip.lateral.path import NEXT, lateral_path
from template_control.slip.lateral.placing import LateralAim, place
from template_control.slip.lateral.transition import acceleration, transition
from template_control.slip.maps.section import VLO
from template_control.slip.parameters import SlipParameters
from template_control.warm_up import Part


def sideways() -> None:
    """A step's motion aside, and the foothold that is chosen on it."""
    p = SlipParameters()
    u = controls(1.152, p.leg_stiffness, p.leg_stiffness)
    stride = simulate_stride(p, STRIDE_START["w"], VLO.state([1.1, 0.978, 0.0]), u)
    path, two = lateral_path((stride,), p.gravity), np.zeros(2)
    transition(path, 0.0, path.section, 1.0)
    acceleration(path, 0.0, 0.0, np.zeros(NEXT + 1))
    aim = LateralAim(
        state=two,
        step=0.1,
        cost=np.eye(2),
        step_cost=0.1,
        offset=two,
        steps=two,
        reach=0.1,
        stretch=1.0,
    )
    place(path, aim, 0.0, two, two)


LATERAL = (Part(sideways, 2.0),)
"""What a tick of a robot that is free in space calls, for :func:`~template_control.parts.ready`."""
