"""Files: how they are written whole or not at all, and how records are kept in them.

A record is a ``.npz`` with one array a field and the metadata as JSON.
"""

from __future__ import annotations

import json
import os
import shutil
import uuid
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from template_control.errors import RecordError

T = TypeVar("T")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Where to write a file, so that what was there is replaced by a whole one or stays.

    Args:
        path: the file's. A link keeps pointing where it does; a device is written as it is.

    Yields:
        A path beside it with the same ending, that of an empty file. It takes the file's name
        when the ``with`` block is done, and is removed if an error ends the block.

    Raises:
        RecordError: for an OSError, also of the ``with`` block.
    """
    target = Path(os.path.realpath(path))
    device = target.exists() and not (target.is_file() or target.is_dir())
    beside = target if device else target.with_name(f".part-{uuid.uuid4().hex[:12]}{target.suffix}")
    try:
        if target.is_dir() or (target.exists() and not os.access(target, os.W_OK)):
            target.open("ab").close()  # which raises what is the matter with it
        beside.touch()
        yield beside
        if not device:
            with beside.open("rb+") as file:
                os.fsync(file.fileno())  # some file systems notice only now that they are full
            if target.exists():
                shutil.copymode(target, beside)
            beside.replace(target)
    except OSError as error:
        raise RecordError(
            f"cannot write {path}: {error.strerror or error}; make room, or give another place"
        ) from None
    finally:
        if not device:
            with suppress(OSError):
                beside.unlink(missing_ok=True)


class Files:
    """Writes files, so that a command's table is printed whatever becomes of them."""

    def __init__(self) -> None:
        self._trouble: RecordError | KeyboardInterrupt | None = None

    def write(self, write: Callable[[], T]) -> T | None:
        """Call ``write``; None where it fails, or Ctrl-C came before or meanwhile."""
        if isinstance(self._trouble, KeyboardInterrupt):
            return None
        try:
            return write()
        except RecordError as error:
            self._trouble = self._trouble or error
        except KeyboardInterrupt:
            self._trouble = KeyboardInterrupt("interrupted: not all files are written")
        return None

    def tell(self) -> None:
        """Once the table is printed.

        Raises:
            RecordError: if a file could not be written.
            KeyboardInterrupt: if Ctrl-C came while files were written.
        """
        if self._trouble is not None:
            raise self._trouble


def save(record: Any, path: str | Path, kind: str, quick: bool = False) -> Path:
    """Write a dataclass of arrays with a ``metadata`` dictionary.

    Args:
        record: the dataclass instance.
        path: of the ``.npz``, taken as it is.
        kind: what :func:`load` must ask for.
        quick: do not compress, for somebody who waits.

    Raises:
        RecordError: if the file cannot be written.
    """
    arrays = {f.name: getattr(record, f.name) for f in fields(record) if f.name != "metadata"}
    text = json.dumps({"format": kind, **record.metadata})
    write = np.savez if quick else np.savez_compressed
    with replacing(path) as place, place.open("wb") as file:
        write(file, metadata=np.array(text), **arrays)
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
    except (KeyError, TypeError, ValueError, OSError, zipfile.BadZipFile):
        raise RecordError(f"{path} is no recorded run: give a run.npz of this library") from None


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
