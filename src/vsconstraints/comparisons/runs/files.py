"""Files that are there whole or not at all."""

from __future__ import annotations

import json
import math
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...errors import StorageError

MOST_EXPANDED = 2e9
"""Bytes of the arrays of a file; a run may take as much memory."""


@contextmanager
def storing(what: str, folder: Path) -> Iterator[None]:
    """Raise what the system raises meanwhile as an error that says what stays."""
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"{what} cannot be stored in {folder}: {error}; what is there stays, and the same command goes on"
        ) from error


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """A file to be written, which then takes the place of ``path``; if anything is raised, it is removed instead."""
    part = path.with_name(path.name + ".part")
    try:
        yield part
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_json(path: Path, data: object) -> None:
    """Write data as JSON, whole or not at all; raises OSError."""
    text = json.dumps(data, indent=1, ensure_ascii=False, default=str) + "\n"
    with replaced(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace")


def plain(data: object) -> Any:
    """Data as it comes back from JSON."""
    return json.loads(json.dumps(data, default=str))


def write_arrays(path: Path, values: Mapping[str, Any], *, compressed: bool = True) -> None:
    """Write a .npz file of arrays by their names; everything else is in ``facts``, as JSON."""
    arrays: dict[str, Any] = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    facts = {name: value for name, value in values.items() if name not in arrays}
    text = json.dumps(facts, default=lambda number: number.item())
    with replaced(path) as part, part.open("wb") as file:
        (np.savez_compressed if compressed else np.savez)(file, facts=np.array(text), **arrays)


def read_arrays(path: Path, most: float = MOST_EXPANDED) -> dict[str, Any]:
    """What :func:`write_arrays` wrote; raises anything if there is no such file or it is damaged.

    Before anything is expanded, the archive and the header of each array have to say that all of it together takes no
    more than ``most`` bytes.
    """
    with path.open("rb") as file:
        _demand_bounded(file, most)
        file.seek(0)
        with np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    return {**json.loads(str(arrays.pop("facts"))), **arrays}


def _demand_bounded(file: IO[bytes], most: float) -> None:
    """Raise ValueError unless the arrays of an archive are as large as it says, and together no larger than allowed."""
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        if (size := sum(member.file_size for member in members)) > most:
            raise ValueError(f"it expands to {size} bytes, and may take {most:.0f}")
        for member in members:
            with archive.open(member) as array:
                version = np.lib.format.read_magic(array)
                header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
                shape, _, dtype = header[version](array)
                if array.tell() + math.prod(shape) * dtype.itemsize != member.file_size:
                    raise ValueError(f"{member.filename} is not as large as it says")
