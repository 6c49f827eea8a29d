"""Target states for controllers: a section state from two of energy, height and speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from template_control.checks.checked import checked
from template_control.errors import ParameterError
from template_control.slip.control.controllers import Controller
from template_control.slip.maps.section import VLO, Section
from template_control.slip.parameters import SlipParameters

Array = NDArray[np.float64]

TargetedPolicy = Callable[[Array, float], Array]
"""Controls (NUM_SLOTS,) at a section state (n,) and a target."""

VARIED = ("energy", "height", "speed")


@checked
def section_target(
    parameters: SlipParameters, section: Section, quantities: Mapping[str, float]
) -> Array:
    """A symmetric (n,) state: dx/dt, y, 0 at VLO, dx/dt, y at apex.

    Args:
        parameters: the template; at VLO the stance leg's spring, of stiffness k0, counts.
        section: VLO or APEX.
        quantities: two of energy [J], height [m], speed [m/s].

    Raises:
        ParameterError: if there is no such state.
    """
    if len(quantities) != 2 or not set(quantities) <= set(VARIED):
        raise ParameterError(
            f"a target is given by {', '.join(quantities) or 'nothing'}: give two of"
            f" {', '.join(VARIED)}"
        )
    p = parameters
    if "height" in quantities:
        y = quantities["height"]
    else:
        weight = p.mass * p.gravity
        stiffness = p.leg_stiffness if section is VLO else 0.0
        # weight * y + stiffness * (rest_length - y)^2 / 2 = rest, the root next to rest_length
        rest = quantities["energy"] - 0.5 * p.mass * quantities["speed"] ** 2
        over = rest - weight * p.rest_length
        slope = weight
        root = slope**2 + 2.0 * stiffness * over
        y = p.rest_length + (2.0 * over / (slope + np.sqrt(root)) if root >= 0.0 else np.nan)
    if "speed" in quantities:
        speed = quantities["speed"]
    else:
        speed = float(section.speed(p, y, quantities["energy"]))
    if not (np.isfinite(y) and np.isfinite(speed)):
        text = ", ".join(f"{name} {value:g}" for name, value in quantities.items())
        raise ParameterError(f"no {section.name} state has {text}: give more energy")
    return section.of([0.0, y, speed, 0.0])


@checked
def targeted(
    controller: Controller,
    parameters: SlipParameters,
    section: Section,
    held: Mapping[str, float],
    varied: str,
    guess: Array,
) -> TargetedPolicy:
    """A controller as a policy over one quantity of its target.

    Args:
        controller: of a stride from a section to the same.
        parameters: the template.
        section: VLO or APEX.
        held: the target's other quantity.
        varied: which of :data:`VARIED` the policy's second argument is.
        guess: (NUM_SLOTS,) controls to search from, which tell gaits of the same target apart.
    """

    def controls(z: Array, value: float) -> Array:
        target = section_target(parameters, section, {**held, varied: value})
        return controller.solve(z, target, guess).controls

    return controls
