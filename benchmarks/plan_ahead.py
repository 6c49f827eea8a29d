"""Time of a planner's decision, in milliseconds and in template steps, near a gait and off it.

Run: python benchmarks/plan_ahead.py [--decisions 100]

The speed changes by 0.3 m/s where it says so; a push has changed dx/dt by 0.1 m/s, and dy/dt by as
much. Times are those of the thread: whatever else the machine does in between does not count.
"""

from __future__ import annotations
