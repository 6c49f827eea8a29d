"""ProxQP as built for any processor: the same problem gives the same bits each time.

The builds with wider vector instructions sum in an order that depends on where in memory a solver
happens to lie. Near the edge of what has a solution, the last bits decide; a run that is repeated
with the same seed would then fall at another moment. For the small problems of a tick these
builds are no faster.
"""

from __future__ import annotations

import logging
import os
import sys
from importlib import import_module
from types import ModuleType
from typing import Any

_LOG = logging.getLogger(__name__)

BUILD = "TEMPLATE_CONTROL_PROXQP"
"""Environment variable: ``native`` leaves the build to proxsuite, as if it was imported alone."""

_CHECKS = "proxsuite.instructionset"
"""Where proxsuite asks, while it is imported, which of its builds the processor can run."""


def load_proxqp() -> Any:
    """ProxQP of proxsuite's portable build.

    The first robot's QP of a process calls it, not an import of this library. An import of
    proxsuite later in the process gets this build too: only one can be loaded. Of a process that
    has imported proxsuite before, the build that it chose is taken. The log says so.
    """
    if "proxsuite" not in sys.modules and os.environ.get(BUILD) != "native":
        none = ModuleType(_CHECKS)
        vars(none).update(has_AVX512F=bool, has_AVX2=bool)  # called without arguments: False
        sys.modules[_CHECKS] = none
        try:
            import_module("proxsuite")
        finally:
            del sys.modules[_CHECKS]
        _LOG.info(
            "this process has ProxQP's portable build, with which runs repeat to the last bit; for"
            " another one import proxsuite first, or set %s=native",
            BUILD,
        )
    return import_module("proxsuite").proxqp
