"""Bipedal SLIP templates, their control, and their embedding in multibody robots.

>>> import template_control as tc
>>> robot = tc.load_robot("five-link")
>>> gait = tc.gait_for_speed(tc.template_for(robot), mean_speed=1.2)
>>> record = tc.simulate(tc.Experiment(robot, planner=tc.LqrPlanner(gait), steps=4))
>>> record.steps, record.fell
(4, False)

Here stand the names that most users need; each room (``tc.slip``, ``tc.embedding``, ...) has
the rest of its own. A name is imported when it is first used, so ``import template_control``
costs next to nothing. The public names of a room stand in its ``__init__.pyi`` and nowhere else.

What is worth knowing while it works goes to the logger ``template_control``, which is silent
until ``logging`` is configured: ``logging.basicConfig(level=logging.INFO)``.
"""

import logging

from template_control.deprecated import attach_stub

# A library leaves it to its user whether and where its messages are seen.
logging.getLogger(__name__).addHandler(logging.NullHandler())

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
