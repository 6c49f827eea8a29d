"""Bipedal SLIP templates, their control, and their embedding in multibody robots.

>>> import template_control as tc
>>> robot = tc.load_robot("five-link")
>>> gait = tc.gait_for_speed(tc.template_for(robot), mean_speed=1.2)
>>> record = tc.simulate(robot, tc.LqrPlanner(gait), tc.SimulationOptions(steps=4))
>>> record.steps, record.fell
(4, False)

Here stand the names that most users need; each room (``tc.slip``, ``tc.embedding``, ...) has
the rest of its own. A name is imported when it is first used, so ``import template_control``
costs next to nothing. The public names of a room stand in its ``__init__.pyi`` and nowhere else.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
