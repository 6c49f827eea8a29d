"""State estimation from the sensors of a real robot: encoders, an IMU, foot contacts."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
