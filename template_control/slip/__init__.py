"""The bipedal SLIP: its automaton, dynamics, return maps, controllers, gaits and scenarios."""

from template_control.deprecated import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
