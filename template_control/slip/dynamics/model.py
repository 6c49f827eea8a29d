"""What a compiled stride reads: the template's physics and where in the automaton it begins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from template_control.compiled import inner
from template_control.slip.automaton.automaton import AUTOMATON
from template_control.slip.automaton.hybrid import Automaton
from template_control.slip.automaton.tables import Tables
from template_control.slip.parameters import SlipParameters


class Model(NamedTuple):
    """The template's physics.

    Attributes:
        mass: [kg].
        gravity: [m/s^2].
        rest_length: l0 [m].
        max_time: a stride that takes longer counts as failed [s].
    """

    mass: float
    gravity: float
    rest_length: float
    max_time: float


class Kernel(NamedTuple):
    """A kind of stride of one template.

    The model's numbers lie in it side by side: a tuple more within it would cost a
    microsecond at every call from Python.

    Attributes:
        tables: the packed automaton.
        mass, gravity, rest_length, max_time: see :class:`Model`.
        node: index of the stride's first node.
    """

    tables: Tables
    mass: float
    gravity: float
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
    return Model(p.mass, p.gravity, p.rest_length, float(limit))


@inner
def model_of(kernel: Kernel) -> Model:
    """The template of a kernel."""
    return Model(kernel.mass, kernel.gravity, kernel.rest_length, kernel.max_time)


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
