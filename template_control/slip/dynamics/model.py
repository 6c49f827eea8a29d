"""What a compiled stride reads: the template's physics and where in the automaton it begins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from template_control.compiled import inner
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.tables import Tables
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]


class Model(NamedTuple):
    """The template's physics.

    Attributes:
        mass: [kg].
        gravity: into the ground [m/s^2].
        along: gravity along the ground, backward positive [m/s^2].
        assist: forward acceleration that two legs add to their springs' [m/s^2].
        rest_length: l0 [m].
        max_time: a stride that takes longer counts as failed [s].
    """

    mass: float
    gravity: float
    along: float
    assist: float
    rest_length: float
    max_time: float


class Kernel(NamedTuple):
    """A kind of stride of one template.

    The model's numbers lie in it side by side: a tuple more within it would cost a
    microsecond at every call from Python.

    Attributes:
        tables: the packed automaton.
        mass, gravity, along, assist, rest_length, max_time: see :class:`Model`.
        node: index of the stride's first node.
    """

    tables: Tables
    mass: float
    gravity: float
    along: float
    assist: float
    rest_length: float
    max_time: float
    node: int


def kernel_model(parameters: SlipParameters, max_time: float | None = None) -> Model:
    """``parameters`` as the kernel takes them.

    Args:
        parameters: the template.
        max_time: time limit of a stride [s]; default 20 sqrt(l0/g).
    """
    p = parameters
    limit = 20.0 * np.sqrt(p.rest_length / p.gravity) if max_time is None else max_time
    return Model(p.mass, *p.gravity_parts, p.assist, p.rest_length, float(limit))


@inner
def model_of(kernel: Kernel) -> Model:
    """The template of a kernel."""
    k = kernel
    return Model(k.mass, k.gravity, k.along, k.assist, k.rest_length, k.max_time)


@inner
def backward(model: Model, stiffness: Array) -> float:
    """Acceleration along the ground by all but the springs, backward positive [m/s^2].

    Args:
        model: the template.
        stiffness: (2,) of the legs [N/m], 0 for a leg in the air.
    """
    if stiffness[0] == 0.0 or stiffness[1] == 0.0:
        return model.along
    return model.along - model.assist


def stride_kernel(
    parameters: SlipParameters, stride: str, automaton: Automaton = AUTOMATON
) -> Kernel:
    """The kernel's input for strides of a kind.

    Args:
        parameters: the template.
        stride: a key of the automaton's ``starts``.
        automaton: of the stride.

    Raises:
        ParameterError: if there is no such stride.
    """
    node = automaton.index[automaton.start(stride).name]
    return Kernel(automaton.tables, *kernel_model(parameters), node=node)
