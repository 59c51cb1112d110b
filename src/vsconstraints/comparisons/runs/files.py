"""Files written completely or not at all, with SHA-256 checksums in the format of ``sha256sum``."""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import re
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import ConfigurationError, StorageError
from ...plugins.regular_files import read_regular

MAX_BYTES = 2e9  # maximum size of the arrays of a file [bytes]; a run may use as much memory
MAX_NAMED = 3  # maximum number of files named in a message
# an array is compressed if its first SAMPLE bytes shrink below the share WORTH
SAMPLE = 1 << 13
WORTH = 0.7
#: Time stamp of all arrays in a file. The system time is not used, because ZIP has no dates before
#: 1980 or after 2107, which a controller with an empty battery may have.
MEMBER_TIME = (1980, 1, 1, 0, 0, 0)
# level 6, the default of NumPy, takes 1.7 times as long for files that are 0.3 % smaller
LEVEL = 1

#: File of checksums. Lines are appended as files are written; the whole file is rewritten when the
#: command ends.
SUMS = "checksums.sha256"
TRAJECTORIES = "trajectories"  #: Folder of the runs' records, inside the results folder.

#: Results that remain if a file cannot be written.
RUNS_ARE_KEPT = "finished runs are kept, and the same command continues"

Sums = dict[str, str]  #: SHA-256 of files, by their paths relative to the folder.


@contextmanager
def storing(what: str, folder: Path, kept: str = RUNS_ARE_KEPT) -> Iterator[None]:
    """Turn an OSError in the block into a StorageError that states which results are ``kept``."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"{what} cannot be stored in {folder}: {error}; {kept}") from error


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Provide a temporary file that replaces ``path`` when the block ends.

    If the block raises, the temporary file is removed and ``path`` is unchanged.
    """
    part = path.with_name(path.name + ".part")
    try:
        yield part
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_json(path: Path, data: object) -> None:
    """Write data as JSON, completely or not at all; raises OSError."""
    text = json.dumps(data, indent=1, ensure_ascii=False, default=str) + "\n"
    with replaced(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace")


def plain(data: object) -> Any:
    """Return data as it would be after storing it as JSON."""
    return json.loads(json.dumps(data, default=str))


def write_arrays(path: Path, values: Mapping[str, Any]) -> None:
    """Write a .npz file of arrays by name; all other values are stored in ``facts``, as JSON."""
    arrays: dict[str, Any] = {}
    facts = {}
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            arrays[name] = value
        else:
            facts[name] = value
    text = json.dumps(facts, default=lambda number: number.item())
    with replaced(path) as part, zipfile.ZipFile(part, "w") as archive:
        for name, array in {"facts": np.array(text), **arrays}.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, array, allow_pickle=False)
            member = buffer.getbuffer()
            info = zipfile.ZipInfo(f"{name}.npy", MEMBER_TIME)
            archive.writestr(info, member, _compression(member), compresslevel=LEVEL)


def _compression(member: memoryview) -> int:
    """Return the compression that an array is worth, judged by its first bytes.

    Measured numbers hardly shrink, and compressing them would take most of the time.
    """
    begin = member[:SAMPLE]
    is_worth_it = len(zlib.compress(begin, LEVEL)) < WORTH * len(begin)
    return zipfile.ZIP_DEFLATED if is_worth_it else zipfile.ZIP_STORED


#: Readers of the header of an array, by the version of its format.
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def read_arrays(path: Path, most: float = MAX_BYTES, *, facts_only: bool = False) -> dict[str, Any]:
    """Read a file of :func:`write_arrays`; raises any error if it is missing or damaged.

    No data is expanded unless the archive and the array headers together declare at most ``most``
    bytes. With ``facts_only`` no array is read.
    """
    with path.open("rb") as file:
        with zipfile.ZipFile(file) as archive:
            _require_sizes(archive, most)
        file.seek(0)
        with np.load(file, allow_pickle=False) as stored:
            names = ("facts",) if facts_only else stored.files
            arrays = {name: stored[name] for name in names}
    return {**json.loads(str(arrays.pop("facts"))), **arrays}


def _require_sizes(archive: zipfile.ZipFile, most: float) -> None:
    """Raise an error if arrays are not as large as they declare, or larger than ``most`` bytes."""
    members = archive.infolist()
    size = sum(member.file_size for member in members)
    if size > most:
        raise ValueError(f"it expands to {size} bytes, and may take {most:.0f}")
    for member in members:
        with archive.open(member) as array:
            version = np.lib.format.read_magic(array)
            shape, _, dtype = _HEADERS[version](array)
            content = math.prod(shape) * dtype.itemsize
            if array.tell() + content != member.file_size:
                raise ValueError(f"{member.filename} is not as large as it says")


def digests(folder: Path, paths: Iterable[Path]) -> Sums:
    """Return the hashes of files in a folder; missing files are left out."""
    sums = {}
    for path in paths:
        if path.is_file():
            with path.open("rb") as file:
                sums[path.relative_to(folder).as_posix()] = hashlib.file_digest(
                    file, "sha256"
                ).hexdigest()
    return sums


def recorded(folder: Path) -> Sums | None:
    """Return the hashes recorded in a folder; None if there is no record.

    An incomplete last line, of a process that was terminated, is ignored. Raises ConfigurationError
    if another line is not a checksum, or the file cannot be read.
    """
    path = folder / SUMS
    try:
        lines = read_regular(path).decode().split("\n")
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"{path} cannot be read: {error}") from error
    sums = {}
    for number, line in enumerate(lines[:-1], start=1):
        if (parts := re.fullmatch(r"([0-9a-f]{64})  (.+)", line)) is None:
            raise ConfigurationError(f"{path} was changed: line {number} is not a checksum")
        sums[parts[2]] = parts[1]
    return sums


def write_sums(folder: Path, sums: Mapping[str, str]) -> None:
    """Replace the recorded hashes; raises OSError."""
    with replaced(folder / SUMS) as part:
        part.write_bytes(_lines(sums))


def add_sums(folder: Path, paths: Iterable[Path]) -> None:
    """Record files that have just been written, one line each; raises OSError."""
    lines = _lines(digests(folder, paths))
    # a single write: a process that is terminated writes all lines or none
    with (folder / SUMS).open("ab", buffering=0) as file:
        file.write(lines)


def _lines(sums: Mapping[str, str]) -> bytes:
    return "".join(f"{digest}  {name}\n" for name, digest in sums.items()).encode()


def seal(folder: Path, paths: Iterable[Path]) -> None:
    """Record exactly these files, which will not be written again; raises OSError.

    Files that are already recorded are not read again.
    """
    known = recorded(folder) or {}
    names = {path.relative_to(folder).as_posix(): path for path in paths if path.is_file()}
    new = [path for name, path in names.items() if name not in known]
    known |= digests(folder, new)
    write_sums(folder, {name: known[name] for name in names})


def remove_changed(folder: Path, paths: Iterable[Path]) -> None:
    """Remove files that differ from their recorded checksum; raises OSError.

    Nothing is removed from a folder without checksums.
    """
    if (sums := recorded(folder)) is not None:
        for name, digest in digests(folder, paths).items():
            if sums.get(name) != digest:
                (folder / name).unlink()


def check_sums(
    folder: Path, paths: Iterable[Path], finished: bool = True, all_there: bool = True
) -> tuple[list[str], str]:
    """Check the files of results; return sentences on problems, and a remark for the reader.

    Both are empty if all files are intact. While the command that writes them is not ``finished``,
    files that it still writes are not recorded. Unless ``all_there``, trajectories may be missing;
    reports name these.
    """
    if (sums := recorded(folder)) is None:
        return (
            [],
            f"{folder} has no checksums, so changes to its files cannot be detected",
        )
    there = digests(folder, paths)
    missing = [name for name in sums if name not in there and not (folder / name).is_file()]
    unknown = [name for name in there if name not in sums]
    wrong = {
        "changed since they were stored (checksums differ)": [
            name for name in there if sums.get(name, there[name]) != there[name]
        ],
        "missing": [
            name for name in missing if all_there or not name.startswith(f"{TRAJECTORIES}/")
        ],
        f"not in {SUMS} (added later, or by an interrupted command)": unknown if finished else [],
    }
    remark = (
        f"{folder} is unfinished; files without checksums: {_named(unknown)}" if unknown else ""
    )
    return [f"{what}: {_named(names)}" for what, names in wrong.items() if names], remark


def require_unchanged(
    folder: Path, paths: Iterable[Path], finished: bool, all_there: bool = False
) -> str:
    """Raise ConfigurationError if a file was changed, added later, or lost.

    Return the remark of :func:`check_sums`.
    """
    problems, remark = check_sums(folder, paths, finished, all_there)
    if problems:
        instead = "Restore the stored files, or run the command that made them again"
        raise ConfigurationError(
            f"{folder} is incomplete or changed: {'; '.join(problems)}. {instead}"
        )
    return remark


def _named(names: Sequence[str]) -> str:
    more = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
