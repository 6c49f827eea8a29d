"""Records on disk: a compressed ``.npz`` with one array a field and the metadata as JSON."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from template_control.errors import RecordError

T = TypeVar("T")


def save(record: Any, path: str | Path, kind: str) -> Path:
    """Write a dataclass of arrays with a ``metadata`` dictionary.

    Args:
        record: the dataclass instance.
        path: of the ``.npz``.
        kind: what :func:`load` must ask for.

    Raises:
        RecordError: if the file cannot be written.
    """
    arrays = {f.name: getattr(record, f.name) for f in fields(record) if f.name != "metadata"}
    text = json.dumps({"format": kind, **record.metadata})
    try:
        np.savez_compressed(path, metadata=np.array(text), **arrays)
    except OSError as error:
        raise RecordError(f"cannot write the run to {path}: {error.strerror}") from None
    return Path(path)


Upgrade = Callable[[dict[str, Any]], dict[str, Any]]
"""From the fields of an older format, by name, to those of today."""


def load(
    record_type: Callable[..., T],
    path: str | Path,
    kind: str,
    older: Mapping[str, Upgrade] | None = None,
) -> T:
    """Read what :func:`save` wrote with the same ``kind``, or an older one.

    Args:
        record_type: the dataclass.
        path: of the ``.npz``.
        kind: format of today.
        older: how formats of earlier versions are upgraded.

    Raises:
        RecordError: if the file is missing or is no such record.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            metadata = json.loads(str(data["metadata"]))
            found = str(metadata.pop("format", ""))
            upgrade = (older or {}).get(found)
            if upgrade is not None:
                names = [name for name in data.files if name != "metadata"]
                values = {name: data[name] for name in names}
                return record_type(**upgrade({**values, "metadata": metadata}))
            if found != kind:
                if found.rpartition(" ")[0] == kind.rpartition(" ")[0]:
                    raise RecordError(
                        f"{path} was written by another version of this library ({found!r}, not"
                        f" {kind!r}): record it anew"
                    )
                raise KeyError("format")
            names = [f.name for f in fields(record_type) if f.name != "metadata"]  # type: ignore[arg-type]
            return record_type(**{name: data[name] for name in names}, metadata=metadata)
    except RecordError:
        raise
    except FileNotFoundError:
        raise RecordError(f"there is no run at {path}: give a run.npz") from None
    except (KeyError, TypeError, ValueError, OSError, EOFError, zipfile.BadZipFile):
        raise RecordError(f"{path} is no recorded run: give a run.npz of this library") from None


def write_text(path: str | Path, text: str) -> Path:
    """Write a text file.

    Args:
        path: of the file.
        text: all of it.

    Raises:
        RecordError: if the file cannot be written.
    """
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write {path}: {error.strerror}") from None
    return Path(path)


def writable(folder: Path) -> Path:
    """The folder, made if need be.

    Raises:
        RecordError: if nothing can be written there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise RecordError(
            f"cannot write to {folder}: {error.strerror}; give another --output"
        ) from None
    return folder
