"""The automaton's guards on a robot's state."""

import numpy as np

from template_control.embedding.modes import GUARDS, PLACED, fired, set_guards
from template_control.embedding.state import SENSED
from template_control.embedding.swing import FEET


class RobotGuards:
    """Guards of a template's robot, with these options."""

    def __init__(self, parameters, options):
        self.data = np.zeros(1, GUARDS)
        set_guards(self.data, parameters, options)

    def fired(self, edge, sensed, due, *, contact=(False, False), swing_time=(np.inf, np.inf)):
        """Whether the edge's event has happened; the template's is due in so many seconds.

        By foot: whether it touches the ground, and the time since it lifted off [s].
        """
        state, feet = np.zeros(1, SENSED), np.zeros(1, FEET)
        state["state"], state["toes"] = sensed.state, sensed.toes
        feet["roles"], feet["swing_time"] = sensed.feet, swing_time
        number = int(edge.event), int(PLACED.get(edge.reset, -1))
        stands = np.array(contact, dtype=np.uint8)
        return bool(fired(self.data[0], number, state[0], feet[0], stands, due))
