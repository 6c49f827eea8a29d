"""The robot's state from what a real robot measures: encoders, an IMU, contacts of the feet."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
