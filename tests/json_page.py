"""What the page of the commands' JSON says, and what a command prints."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "json.md"


def patterns(command):
    """Patterns of the keys that the page lists for a command."""
    for part in PAGE.read_text().split("\n## ")[1:]:
        names, _, text = part.partition("\n")
        if command in names.split(", "):
            rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
            found = [key for row in rows for key in re.findall(r"`([^`]+)`", row)]
            return {key: _pattern(key) for key in found}
    raise AssertionError(f"no table for {command}")


def _pattern(key):
    text = re.escape(key).replace(r"\.\*", r"(\..*)?")
    return re.compile(re.sub(r"<[^>]+>", ".+", text))


def leaves(data, path=""):
    """Paths of the values in printed data."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from leaves(value, f"{path}.{key}" if path else key)
    elif isinstance(data, list):
        for value in data or [None]:
            yield from leaves(value, f"{path}[]")
    else:
        yield path


def undocumented(command, data):
    """Keys of printed data that the page does not list."""
    known = patterns(command).values()
    return {leaf for leaf in leaves(data) if not any(p.fullmatch(leaf) for p in known)}


def unprinted(command, *printed):
    """Keys that the page lists, and none of the printed data has."""
    found = {leaf for data in printed for leaf in leaves(data)}
    return {key for key, p in patterns(command).items() if not any(map(p.fullmatch, found))}
