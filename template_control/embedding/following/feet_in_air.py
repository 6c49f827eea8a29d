"""Where the references of the feet in the air move: to footholds, up walls, down to the ground."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from template_control.embedding.contacts import ContactMonitor
from template_control.embedding.references.feet import Feet
from template_control.embedding.references.rolling import rolled
from template_control.embedding.sensing import Sensing
from template_control.embedding.station import Station
from template_control.embedding.stride_planning import StridePlanning
from template_control.robot.biped import Biped
from template_control.slip.automaton.vocabulary import Leg, Slot
from template_control.whole_body.task import References

Array = NDArray[np.float64]


class FeetInAir:
    """Moves the swings' references from tick to tick.

    Args:
        robot: the model; every tick updates it.
        feet: their roles and swings.
        contacts: which walls they have met.
        references: where it is kept how far each foot may be moved.
    """

    def __init__(
        self, robot: Biped, feet: Feet, contacts: ContactMonitor, references: References
    ) -> None:
        self._robot, self._feet = robot, feet
        self._contacts, self._references = contacts, references

    def advance(
        self,
        station: Station,
        planning: StridePlanning,
        sensing: Sensing,
        time: float,
        hips: Array,
        dt: float,
    ) -> None:
        """Move the references of the feet that swing.

        Args:
            station: of the robot.
            planning: which knows where the feet land.
            sensing: the robot's state, and the ground's height.
            time: along the path [s].
            hips: (2,) x and y [m].
            dt: duration of the tick [s].
        """
        robot, feet = self._robot, self._feet
        late, hip = self._overdue(station, planning), hips.tolist()
        for leg in station.swings:
            foot = feet.of[leg]
            swing = feet.swing[foot]
            landing = planning.landing(foot)
            foothold, due = landing.x, landing.time - time
            overdue = foot == late
            if self._contacts.blocked(foot):
                # The path goes on as if an overdue foot had time; it has none to go up again.
                swing.meet_wall(robot.foot_position[foot], foothold, 0.0 if overdue else due, dt)
            elif overdue:
                swing.drop(dt)
            else:
                if not isfinite(foothold):
                    # The template cannot complete the stride; the gait's own foothold is the
                    # best guess.
                    gait = planning.planner.gait
                    foothold = sensing.now.toes[Leg.REAR] + gait.step_length
                    due = gait.step_duration - feet.swing_time[foot]
                if station.control.rolls:
                    angle = float(planning.reports[-1].decision.controls[Slot.TOUCHDOWN_ANGLE])
                    foothold = rolled(foothold, angle, robot.foot_radius)
                swing.advance(foothold, due, dt, sensing.ground)
            self._references.furthest[foot] = swing.furthest(hip, robot.leg_length)

    def _overdue(self, station: Station, planning: StridePlanning) -> int | None:
        """The foot that should have found the ground by now."""
        leg = station.awaited
        return None if leg is None or not planning.reaching else self._feet.of[leg]
