"""The whole-body QP: from the tasks of a tick to joint torques."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
