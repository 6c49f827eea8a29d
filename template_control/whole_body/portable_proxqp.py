"""ProxQP as built for any processor: the same problem gives the same bits each time.

The builds with wider vector instructions sum in an order that depends on where in memory a solver
happens to lie. Near the edge of what has a solution, the last bits decide; a run that is repeated
with the same seed would then fall at another moment. For the small problems of a tick these
builds are no faster.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

_CHECKS = "proxsuite.instructionset"
"""Where proxsuite asks, while it is imported, which of its builds the processor can run."""


def load_proxqp() -> Any:
    """ProxQP of proxsuite's portable build.

    Whoever imports proxsuite later in this process gets this build too: only one can be loaded. Of
    a process that has imported proxsuite before, the build that it chose is taken.
    """
    if "proxsuite" not in sys.modules:
        none = ModuleType(_CHECKS)
        vars(none).update(has_AVX512F=bool, has_AVX2=bool)  # called without arguments: False
        sys.modules[_CHECKS] = none
        try:
            import_module("proxsuite")
        finally:
            del sys.modules[_CHECKS]
    return import_module("proxsuite").proxqp
