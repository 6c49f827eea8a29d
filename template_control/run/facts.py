"""Facts of a run as a whole, with their types: what the metadata of its file hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, Self, TypeVar, overload

import numpy as np

from template_control.arrays import Array
from template_control.run.statistics import Statistics
from template_control.slip.automaton.vocabulary import Phase
from template_control.slip.parameters import SlipParameters

T = TypeVar("T")
_PLAIN: dict[Any, tuple[type, ...]] = {
    str: (str,),
    bool: (bool,),
    float: (float, int),
    int: (float, int),
    dict: (dict,),
}


class Fact(Generic[T]):
    """Attribute that is ``make`` of the entry ``name`` of ``metadata``, by default its own name.

    ``plain`` are the types that the entry may have.
    """

    def __init__(self, make: Callable[[Any], T], name: str = "", plain: type | None = None) -> None:
        self._make, self.name = make, name
        self.plain: tuple[type, ...] = (plain,) if plain else _PLAIN.get(make, (list,))

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.name or name

    @overload
    def __get__(self, facts: None, owner: type) -> Self: ...

    @overload
    def __get__(self, facts: Facts, owner: type) -> T: ...

    def __get__(self, facts: Facts | None, owner: type) -> Self | T:
        return self if facts is None else self._make(facts.metadata[self.name])


def _indices(entry: Any) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(leg) for leg in entry)


def _rows_of_four(entry: Any) -> Array:
    return np.array(entry).reshape(-1, 4)


class Facts:
    """Facts of a run.

    Attributes:
        robot_name, urdf: of the URDF.
        mass: [kg].
        trunk_com: height of the trunk's own CoM above the hips [m].
        joints, feet: names.
        groups: the contacts, by their places in ``feet``, of each template leg.
        legs: for each foot, the indices into ``joints`` of its joints, hip first.
        soles: (n, 4) of flat feet x and y of each sole's centre from the toe, and its half sides
            [m]; (0, 4) of point feet.
        hinges: for each foot, those of hip and knee, and of a flat foot's ankle.
        torque_limit, velocity_limit: (nu,) of the joints [N m, rad/s].
        nodes, phases: of the automaton.
        stiffness_slots: for each node, the Slot of its rear and of its front leg; None without.
        template: the SLIP model.
        gait_name, gait_mean_speed: of the gait that the planner leads to [m/s].
        gait_state, gait_controls: (n,) at its section, (NUM_SLOTS,) by Slot.
        gait_flight_share: share of its time without a foot on the ground.
        planner: its class.
        plant: the world's name; "" where nothing was said of it.
        options: how the run went, as plain data.
        fall_reason: why the robot fell; "" where it did not.
        arrived: whether the route is at its end.
        interrupted: whether Ctrl-C ended the run.
        error: that ended it; "" where none did.
        duration, wall_seconds: of the run, and of the clock on the wall [s].
        ticks: of the controller.
        summary: statistics over all of them.
        sections, strides: names that ``section`` and ``stride`` are indices into.
        section_course: (S, 4) of the stride that begins at each section, as it was accepted: the
            goal's speed along the way that the robot goes, its speed to the left of that way
            [m/s], the trunk's turning rate [rad/s], and the angle from that way to where the trunk
            faces, to the left [rad].
        metadata: all of these as plain data, as the file has them.
    """

    metadata: dict[str, Any]

    robot_name = Fact(str, "robot")
    urdf = Fact(str)
    mass = Fact(float)
    trunk_com = Fact(float)
    joints: Fact[tuple[str, ...]] = Fact(tuple)
    feet: Fact[tuple[str, ...]] = Fact(tuple)
    groups = Fact(_indices)
    legs = Fact(_indices)
    hinges = Fact(_indices)
    soles = Fact(_rows_of_four)
    torque_limit: Fact[Array] = Fact(np.array)
    velocity_limit: Fact[Array] = Fact(np.array)
    nodes: Fact[tuple[str, ...]] = Fact(tuple)
    phases = Fact(lambda names: tuple(Phase[name] for name in names))
    stiffness_slots: Fact[list[list[int | None]]] = Fact(list)
    template = Fact(lambda entry: SlipParameters(**entry), plain=dict)
    gait_name = Fact(str, "gait")
    gait_mean_speed = Fact(float)
    gait_state: Fact[Array] = Fact(np.array)
    gait_controls: Fact[Array] = Fact(np.array)
    gait_flight_share = Fact(float)
    planner = Fact(str)
    plant = Fact(str)
    options: Fact[dict[str, Any]] = Fact(dict)
    fall_reason = Fact(str)
    arrived = Fact(bool)
    interrupted = Fact(bool)
    error = Fact(str)
    duration = Fact(float)
    wall_seconds = Fact(float)
    ticks = Fact(int)
    summary = Fact(Statistics.read, plain=dict)
    sections: Fact[tuple[str, ...]] = Fact(tuple)
    strides: Fact[tuple[str, ...]] = Fact(tuple)
    section_course = Fact(_rows_of_four, "courses")

    @property
    def weight(self) -> float:
        """Of the robot [N]."""
        return self.mass * self.template.gravity

    @property
    def fell(self) -> bool:
        """True where the run ended in a fall."""
        return bool(self.fall_reason)


METADATA = {fact.name: fact.plain for fact in vars(Facts).values() if isinstance(fact, Fact)}
"""Types of the entries of a run's metadata."""
