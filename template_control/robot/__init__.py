"""Planar bipeds: those that come along, those read from a URDF, and where they start."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
