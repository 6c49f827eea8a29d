"""The reference: every public name is on one page."""

import importlib
import re
from types import ModuleType

from places import DOCS

import template_control as tc

ROOMS = [name for name in dir(tc) if isinstance(getattr(tc, name), ModuleType)]


def documented():
    """Paths of the names on the pages of the reference."""
    for page in sorted((DOCS / "reference").glob("*.md")):
        yield from re.findall(r"^\.\. auto\w+:: (\S+)$", page.read_text(), re.MULTILINE)


def found(path):
    """The object that a path leads to."""
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def public():
    """Every name of the package and of its rooms that is not a module."""
    for package in (tc, *(getattr(tc, room) for room in ROOMS if room != "errors")):
        for name in dir(package):
            if not name.startswith("_") and not isinstance(getattr(package, name), ModuleType):
                yield f"{package.__name__}.{name}"


def test_no_name_is_on_two_pages():
    paths = list(documented())
    assert len(paths) == len(set(paths))


def test_every_public_name_is_on_a_page():
    paths = list(documented())
    objects = [found(path) for path in paths]
    missing = [
        path
        for path in public()
        if path not in paths and not any(found(path) is one for one in objects)
    ]
    assert not missing
