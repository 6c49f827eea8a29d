"""The version in the installed package's metadata: ``pyproject.toml`` is its one source."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("template-control")
except PackageNotFoundError:  # a checkout on the path that was never installed
    __version__ = "unknown: not installed"
