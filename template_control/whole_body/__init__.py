"""The whole-body QP: from the tasks of a tick to joint torques."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
