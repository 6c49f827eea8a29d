"""Reproduction of the paper's tables and figures, compared with the published numbers."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
