"""The robot's state from what a real robot measures: encoders, an IMU, contacts of the feet."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
