"""Damage to stored results: random and deliberate changes of their files in place."""

from __future__ import annotations

import json
import os
import random
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from vsconstraints.bench.evidence import parquet

PLANTED = "planted:Planted"
"""Code that runs if it is imported; its folder stands in every place that names one."""

ODD: tuple[Any, ...] = (
    None, True, -1, 0, 2, 0.5, -1e300, 10**400, float("nan"), float("inf"), "", "x", PLANTED,
    "os:system", "../../../x",
    "/etc/passwd", "/dev/zero", "![x](http://127.0.0.1:9/x)", "<img src=http://127.0.0.1:9/x>",
    "a\nb", "\x00",
    "\ud800", "x" * 5000, [], [[]], [PLANTED], ["a"] * 3, {}, {"type": PLANTED}, {"a": {"b": 1}},
    {"type": "x"},
)  # fmt: skip
"""Values that replace valid ones."""

Change = Callable[[Path, random.Random], None]
"""Changes a file, or its folder, in place."""


def _bit(path: Path, chance: random.Random) -> None:
    content = bytearray(path.read_bytes())
    content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def _cut(path: Path, chance: random.Random) -> None:
    path.write_bytes(path.read_bytes()[: chance.randrange(path.stat().st_size)])


def _grow(path: Path, chance: random.Random) -> None:
    path.write_bytes(path.read_bytes() + path.read_bytes()[-chance.randrange(1, 200) :])


def _remove(path: Path, chance: random.Random) -> None:
    path.unlink()


def _exchange(path: Path, chance: random.Random) -> None:
    other = chance.choice([one for one in path.parent.iterdir() if one.is_file()])
    content = other.read_bytes()
    other.write_bytes(path.read_bytes())
    path.write_bytes(content)


def _double(path: Path, chance: random.Random) -> None:
    shutil.copy(
        path,
        path.with_name(f"{path.stem.replace('0', '1', 1)}{chance.choice(('', '-'))}{path.suffix}"),
    )


def _link(path: Path, chance: random.Random) -> None:
    name = chance.choice(
        ("report.md", "figures", "report.html.part", "results.csv.part", ".vsconstraints-lock")
    )
    with suppress(FileExistsError):
        path.parent.joinpath(name).symlink_to(path.parents[1].parent / "outside")


def _manifest(path: Path, chance: random.Random) -> None:
    manifest = path.parent / "manifest.json"
    if not manifest.is_file():
        manifest = path.parent.parent / "manifest.json"
    data = json.loads(manifest.read_text(encoding="utf-8"))
    at, key = chance.choice(list(_places(data)))
    if isinstance(at, dict) and chance.random() < 0.4:
        at[str(chance.choice(ODD))] = at.pop(key) if chance.random() < 0.5 else at[key]
    elif chance.random() < 0.3:
        del at[key]
    else:
        at[key] = chance.choice(ODD)
    manifest.write_text(json.dumps(data), encoding="utf-8", errors="surrogatepass")


def _places(data: Any) -> Iterator[tuple[Any, Any]]:
    items = (
        data.items()
        if isinstance(data, dict)
        else enumerate(data)
        if isinstance(data, list)
        else ()
    )
    for key, inner in items:
        yield data, key
        yield from _places(inner)


def _contents(path: Path, chance: random.Random) -> None:
    """Change a table or an archive in its own format if possible, else a line of text."""
    if path.suffix == ".parquet":
        _table(path, chance)
    elif path.suffix == ".npz":
        _archive(path, chance)
    else:
        lines = path.read_text(encoding="utf-8").split("\n")
        i = chance.randrange(len(lines))
        j = chance.randrange(len(lines))
        cells = lines[i].split(",")
        cells[chance.randrange(len(cells))] = str(chance.choice(ODD)).replace("\n", " ")
        lines[i] = chance.choice((",".join(cells), lines[j], "", lines[i] * 2))
        path.write_text("\n".join(lines), encoding="utf-8", errors="backslashreplace")


def _table(path: Path, chance: random.Random) -> None:
    import pyarrow as pa

    table = parquet.read([path], parquet.tables()[path.parent.name])
    facts = parquet.facts_of(path)
    lines = table.to_pylist()
    what = chance.randrange(6)
    if what == 0:
        facts[chance.choice(list(facts))] = chance.choice(ODD)
    elif what == 1:
        at, key = chance.choice(list(_places(facts)))
        at[key] = chance.choice(ODD)
    elif what == 2 and lines:
        del lines[chance.randrange(len(lines))]
    elif what == 3:
        lines += lines[: chance.randrange(1, 3)]
    elif what == 4:
        lines = []
    elif lines:
        name = chance.choice(table.column_names)
        same = [one for one in ODD if type(one) is type(lines[0][name])] or [None]
        lines[chance.randrange(len(lines))][name] = chance.choice(same)
    for line in lines:
        for name, value in line.items():
            if isinstance(value, str):
                line[name] = value.encode("utf-8", "backslashreplace").decode()
            elif isinstance(value, int) and abs(value) > 2**62:
                line[name] = 7
    table = pa.Table.from_pylist(lines, schema=table.schema)
    if chance.random() < 0.1:
        table = table.drop_columns([chance.choice(table.column_names)])
    parquet.write(path, table, facts)


def _archive(path: Path, chance: random.Random) -> None:
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in stored.files}
    name = chance.choice(list(arrays))
    what = chance.randrange(6)
    if what == 0:
        del arrays[name]
    elif what == 1:
        arrays[name] = arrays[name][:-1] if arrays[name].ndim else np.array(str(chance.choice(ODD)))
    elif what == 2:
        arrays[name] = np.array([os.system, 1], dtype=object)  # only a pickle can hold this
    elif what == 3:
        facts = json.loads(str(arrays["facts"]))
        facts[chance.choice(list(facts))] = chance.choice(ODD)
        arrays["facts"] = np.array(json.dumps(facts).encode("utf-8", "backslashreplace").decode())
    elif what == 4 and chance.random() < 0.1:
        arrays[name] = np.zeros((3, 200_000_000 // 3), dtype=np.bool_)
    else:
        arrays[name] = np.full(arrays[name].shape, np.nan)
    file = BytesIO()
    np.savez_compressed(file, allow_pickle=True, **arrays)
    path.write_bytes(file.getvalue())
    if what == 5 and chance.random() < 0.5:
        # a header that declares more data than there is
        with zipfile.ZipFile(path, "a") as archive:
            header = (
                b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': "
                b"(1000000000000,), }"
            )
            archive.writestr("more.npy", header.ljust(128) + b"\n")


PLAIN: tuple[Callable[[Path, random.Random], None], ...] = (
    _bit,
    _bit,
    _bit,
    _bit,
    _cut,
    _grow,
    _remove,
    _exchange,
    _double,
)
"""Random changes of files."""

MEANT: tuple[Change, ...] = (_manifest, _manifest, _contents, _contents, _link)
"""Deliberate changes by a person who knows the content."""
