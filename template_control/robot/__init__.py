"""Planar bipeds: those that come along, those read from a URDF, and where they start."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
