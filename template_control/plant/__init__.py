"""The worlds a robot walks in: PyBullet, MuJoCo, and ideal contacts that stick."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
