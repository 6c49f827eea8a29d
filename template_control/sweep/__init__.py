"""Sweeps of any function over a grid or a sample of its arguments, on many processes."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
