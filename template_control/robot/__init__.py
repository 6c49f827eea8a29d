"""Planar bipeds: those that come along, those read from a URDF, and where they start."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
