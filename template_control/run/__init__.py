"""A walk from start to record: controller and plant in one loop."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
