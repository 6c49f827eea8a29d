"""The worlds a robot walks in: PyBullet, MuJoCo, and ideal contacts that stick."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
