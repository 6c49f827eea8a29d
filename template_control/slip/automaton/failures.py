"""What ends a phase against the template's will, by phase: the edges to a failed stride."""

from __future__ import annotations

from template_control.slip.automaton.node import Edge
from template_control.slip.automaton.vocabulary import Event, Outcome

SINGLE_STANCE_FAILURES = (
    Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
    Edge(Event.FALL, Outcome.FALL),
    Edge(Event.BACKWARD, Outcome.BACKWARD),
)
"""Of a single stance that goes to VLO or stands on one leg."""

AWAITING_TOUCHDOWN_FAILURES = (
    Edge(Event.REAR_LIFTOFF, Outcome.UNWANTED_FLIGHT),
    Edge(Event.FALL, Outcome.NO_TOUCHDOWN),
    Edge(Event.BACKWARD, Outcome.BACKWARD),
)
"""Of a single stance whose front leg is to touch down."""

DOUBLE_STANCE_FAILURES = (
    Edge(Event.FRONT_LIFTOFF, Outcome.UNWANTED_FLIGHT),
    Edge(Event.PASSED_FRONT_FOOT, Outcome.NO_LIFTOFF),
    Edge(Event.FALL, Outcome.FALL),
    Edge(Event.BACKWARD, Outcome.BACKWARD),
)
"""Of a double stance on springs."""

RUNNING_STANCE_FAILURES = (
    Edge(Event.FALL, Outcome.FALL),
    Edge(Event.BACKWARD, Outcome.BACKWARD),
)
"""Of a stance that a flight follows: its liftoff is wanted."""

CURVE_FAILURES = (Edge(Event.FALL, Outcome.FALL),)
"""Of a double stance that follows a curve in time."""

FLIGHT_FAILURES = (Edge(Event.FALL, Outcome.NO_TOUCHDOWN),)
"""Of a flight: it ends at the ground."""
