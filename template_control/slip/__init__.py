"""The bipedal SLIP: its automaton, dynamics, return maps, controllers, gaits and scenarios."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
