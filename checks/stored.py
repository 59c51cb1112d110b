"""``python -m checks.stored [--mutations N] [--seed S] [--only FIRST:LAST]``: stored results with something changed.

A comparison and a campaign are made once. Each time a thing or two is changed in a copy of one of them, at random: a
bit, a file's end, a file as a whole, a value in the manifest or in a table, a text that names code, a path, an address.
In half of the copies only that is done, and whoever reads it has to refuse it or to find the very numbers that were
stored. In the others the checksums are made anew or removed, as by somebody who means harm, and reading has to end with
an error of this package, or as it likes, but without running code, without writing outside the folder, and without a
connection. What does otherwise is printed with its number, and the exit code is 1. The same seed changes the same.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from io import BytesIO, StringIO
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import typer

from vsconstraints.commands.verify import verify
from vsconstraints.comparisons import StoredComparison, Suite, compare
from vsconstraints.comparisons.folder import stored_files as files_of_comparison
from vsconstraints.comparisons.record import SHAPES
from vsconstraints.difference.difference import Question, difference
from vsconstraints.errors import VsconstraintsError
from vsconstraints.evidence import TABLES, Campaign, Evidence, Plan, collect, merge, parquet
from vsconstraints.evidence.folder import stored_files as files_of_campaign
from vsconstraints.replay.asked import asked_for
from vsconstraints.reports import write_report
from vsconstraints.reports.evidence import replay, write_evidence_report
from vsconstraints.runs.checksums import SUMS, digests, write_sums

LIMIT = 120
"""Seconds that the readers of one copy may take; usual are some hundredths."""

PLANTED = "planted:Planted"
"""Code that runs if anything imports it: the folder in which it is stands in every place that names one."""

PLANT = """
import os
open(os.environ["VSCONSTRAINTS_PLANTED"], "w").close()
from vsconstraints.controllers import Tracking as Planted
"""

ODD: tuple[Any, ...] = (
    None, True, -1, 0, 2, 0.5, -1e300, 10**400, float("nan"), float("inf"), "", "x", PLANTED, "os:system", "../../../x",
    "/etc/passwd", "/dev/zero", "![x](http://127.0.0.1:9/x)", "<img src=http://127.0.0.1:9/x>", "a\nb", "\x00",
    "\ud800", "x" * 5000, [], [[]], [PLANTED], ["a"] * 3, {}, {"type": PLANTED}, {"a": {"b": 1}}, {"type": "x"},
)  # fmt: skip
"""Values that are put where another belongs."""

FAMILY = """
extends = "example-2d-fast"
duration = 0.3
q0 = { gaussian = [[-0.720, -1.744, 1.074], 0.01] }
"""

CAMPAIGN = """
families = ["quick.toml"]
scenes = 2
[controllers.sliding-mode]
"""


Change = Callable[[Path, random.Random], None]
"""Changes a file, or what lies beside it, in place."""


class Here:
    """Workers that are this process."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def run(self, calls: Mapping[Any, tuple[Any, ...]], *_: object, **__: object) -> Iterator[tuple[Any, Any]]:
        """What each call comes to."""
        return ((key, self.function(*arguments)) for key, arguments in calls.items())


@dataclass
class Watch:
    """What a process did while it was watched, by the interpreter's own hook: each is a finding."""

    inside: str = ""
    did: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        sys.addaudithook(self._heard)  # for good: there is no way to remove one

    @contextmanager
    def over(self, inside: Path) -> Iterator[list[str]]:
        """Note what is written elsewhere than in a folder, imported from a plant, connected to or started meanwhile."""
        self.inside, self.did = os.path.realpath(inside), []
        try:
            yield self.did
        finally:
            self.inside = ""

    def _heard(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.inside:
            return
        if event == "open":
            path, mode, flags = arguments
            if isinstance(path, int) or not (
                flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) or set(mode or "") & set("wax+")
            ):
                return
            self._wrote(event, path)
        elif event in ("os.mkdir", "os.remove", "os.rmdir", "os.truncate"):
            self._wrote(event, arguments[0])
        elif event in ("os.rename", "os.link", "os.symlink"):
            for path in arguments[:2]:
                self._wrote(event, path)
        elif event in ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect"):
            self.did.append(f"{event} {arguments[:1]}")
        elif event == "import" and str(arguments[0]).startswith("planted"):
            self.did.append(f"import {arguments[0]}")

    def _wrote(self, event: str, path: Any) -> None:
        whole = os.path.realpath(os.fsdecode(path)) if isinstance(path, (str, bytes, os.PathLike)) else str(path)
        # what Python and its libraries keep for themselves
        own = "cache" in whole or whole.endswith("matplotlib")
        if not own and not whole.startswith((self.inside + os.sep, "/dev/null")):
            self.did.append(f"{event} {whole}")


@dataclass(frozen=True)
class Made:
    """Results that are as they were stored, and what reading them gives.

    Attributes
    ----------
    folder
        Where they are.
    files
        What they consist of.
    numbers
        Hashes of all numbers and texts that readers take from a folder, those of each trajectory that is there apart.
    read
        What readers do with a folder, by what it is called, and in one of how many copies.
    """

    folder: Path
    files: Callable[[Path], list[Path]]
    numbers: Callable[[Path], dict[str, str]]
    read: dict[str, tuple[int, Callable[[Path], object]]]


def comparison(root: Path) -> Made:
    """A comparison of two laws in one scene, each in two trials."""
    settings = ["scenario.duration=0.05", "scenario.start_deviation=0.01", "trials=2"]
    suite = Suite.load().select(["example-2d-fov"], ["sliding-mode"], settings=settings)
    compare(suite, root / "comparison", workers=0)

    def numbers(folder: Path) -> dict[str, str]:
        stored = StoredComparison.load(folder)
        found = {"tables": _hash((stored.manifest, stored.results, stored.constraints))}
        for line in stored.results:
            key = str(line["scenario"]), str(line["controller"]), int(line["trial"])
            record = stored.run(*key)
            if record is not None:
                parts = {**vars(record), **vars(record.trajectory)}
                found[str(key)] = _hash([(name, np.asarray(parts[name]).tobytes()) for name in SHAPES])
        return found

    file = "example-2d-fov--sliding-mode--1.npz"
    return Made(
        root / "comparison",
        files_of_comparison,
        numbers,
        {
            "report": (4, lambda folder: write_report(folder, figures=False)),
            "figures": (400, write_report),
            "replay": (20, lambda folder: asked_for(str(folder / "trajectories" / file))),
            "diff": (40, lambda folder: difference(root / "comparison", folder, Question())),
            "verify": (2, verify),
        },
    )


def campaign(root: Path) -> Made:
    """A campaign of a law in two scenes, some of its trajectories kept."""
    (root / "quick.toml").write_text(FAMILY)
    (root / "small.toml").write_text(CAMPAIGN)
    here = Plan(keep="first", workers=lambda function: nullcontext(Here(function)))
    collect(Campaign.load(root / "small.toml"), root / "campaign", here)

    def numbers(folder: Path) -> dict[str, str]:
        evidence = Evidence.load(folder)
        tables = [getattr(evidence, name).to_json(double_precision=15) for name in TABLES]
        return {"tables": _hash((evidence.manifest, tables))}

    def merged(folder: Path) -> None:
        merge(folder / "merged", [folder])

    return Made(
        root / "campaign",
        files_of_campaign,
        numbers,
        {
            "report": (20, lambda folder: write_evidence_report(folder, figures=False)),
            "figures": (400, write_evidence_report),
            "merge": (4, merged),
            "replay": (40, lambda folder: replay(folder, "quick", 0, "nominal", "sliding-mode")),
            "diff": (40, lambda folder: difference(root / "campaign", folder, Question())),
            "verify": (2, verify),
        },
    )


def _hash(data: Any) -> str:
    return hashlib.sha256(repr(data).encode("utf-8", "backslashreplace")).hexdigest()


# --- changes: of the files of a folder, in place; each says what it did ---


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
    shutil.copy(path, path.with_name(f"{path.stem.replace('0', '1', 1)}{chance.choice(('', '-'))}{path.suffix}"))


def _link(path: Path, chance: random.Random) -> None:
    name = chance.choice(("report.md", "figures", "report.html.part", "results.csv.part", ".vsconstraints-lock"))
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
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, inner in items:
        yield data, key
        yield from _places(inner)


def _contents(path: Path, chance: random.Random) -> None:
    """Something in a table or an archive, by its own format, if it has one; else a line."""
    if path.suffix == ".parquet":
        _table(path, chance)
    elif path.suffix == ".npz":
        _archive(path, chance)
    else:
        lines = path.read_text(encoding="utf-8").split("\n")
        i, j = chance.randrange(len(lines)), chance.randrange(len(lines))
        cells = lines[i].split(",")
        cells[chance.randrange(len(cells))] = str(chance.choice(ODD)).replace("\n", " ")
        lines[i] = chance.choice((",".join(cells), lines[j], "", lines[i] * 2))
        path.write_text("\n".join(lines), encoding="utf-8", errors="backslashreplace")


def _table(path: Path, chance: random.Random) -> None:
    import pyarrow as pa

    table, facts = parquet.read([path], TABLES[path.parent.name]), parquet.facts_of(path)
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
        arrays[name] = np.array([os.system, 1], dtype=object)  # which only a pickle can hold
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
        with zipfile.ZipFile(path, "a") as archive:  # a header that says more than there is
            header = b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
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
"""What happens to files by chance."""

MEANT: tuple[Change, ...] = (_manifest, _manifest, _contents, _contents, _link)
"""What takes somebody who knows what they hold."""


def change(folder: Path, made: Made, chance: random.Random) -> tuple[str, bool]:
    """Change a thing or two in a folder; what, and whether a reader has to see it or to find the numbers unchanged."""
    by_chance, what = chance.random() < 0.5, []
    for _ in range(1 if by_chance else chance.choice((1, 1, 2))):
        files = [path for path in made.files(folder) if path.is_file() and path.stat().st_size]
        files += [folder / SUMS] if by_chance else []
        path = chance.choice(files)
        done = chance.choice(PLAIN if by_chance or chance.random() < 0.3 else MEANT)
        what.append(f"{done.__name__[1:]} of {path.relative_to(folder)}")
        with suppress(Exception):  # what the first left need not be readable any more
            done(path, chance)
    if by_chance:
        return what[0], True
    if chance.random() < 0.5:
        write_sums(folder, digests(folder, made.files(folder)))
    else:
        (folder / SUMS).unlink(missing_ok=True)
    return ", ".join(what), False


class Fuzz:
    """Results to be changed, in a folder of their own, and what was found."""

    def __init__(self, root: Path, kinds: Sequence[Callable[[Path], Made]] = (comparison, campaign)) -> None:
        self.root, self.watch = root.resolve(), Watch()
        self.made = [kind(self.root) for kind in kinds]
        self.stored = [made.numbers(made.folder) for made in self.made]
        self.outcomes: Counter[str] = Counter()
        (self.root / "planted.py").write_text(PLANT)
        self.marker = self.root / "planted-has-run"
        os.environ["VSCONSTRAINTS_PLANTED"] = str(self.marker)

    def findings(self, seed: int, number: int) -> Iterator[str]:
        """Change a copy, and read it; what should not have happened."""
        chance = random.Random(f"{seed} {number}")
        which = chance.randrange(len(self.made))
        made, stored = self.made[which], self.stored[which]
        folder = self.root / "at" / "work"
        shutil.rmtree(folder.parent, ignore_errors=True)
        shutil.copytree(made.folder, folder)
        (self.root / "outside").mkdir(exist_ok=True)
        what, seen = change(folder, made, chance)
        readers = {name: read for name, (every, read) in made.read.items() if chance.randrange(every) == 0}
        before = dict(_listing(self.root, folder.parent))
        with self.watch.over(folder.parent) as did:
            for name, read in {"numbers": made.numbers, **readers}.items():
                problem = self._read(read, folder, stored if name == "numbers" and seen else None)
                if problem:
                    yield f"{what}; {name}: {problem}"
        if did:
            yield f"{what}: {did[:3]}"
        if self.marker.exists():
            self.marker.unlink()
            yield f"{what}: code was run"
        if dict(_listing(self.root, folder.parent)) != before:
            yield f"{what}: something changed outside the folder"

    def _read(self, read: Callable[[Path], object], folder: Path, expected: dict[str, str] | None) -> str:
        """What a reader should not have done."""
        signal.alarm(LIMIT)
        try:
            with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
                found = read(folder)
        except (VsconstraintsError, typer.Exit) as error:
            self.outcomes["refused"] += 1
            text = str(error)
            return f"an error of several lines: {text!r}" if "\n" in text else ""
        except Exception as error:  # which is what is looked for
            self.outcomes["raised"] += 1
            return f"{type(error).__name__}: {error}"
        finally:
            signal.alarm(0)
        self.outcomes["read"] += 1
        same = expected is None or (isinstance(found, dict) and "tables" in found and found.items() <= expected.items())
        return "" if same else "other numbers, and nobody said so"


def _listing(root: Path, but: Path) -> Iterator[tuple[str, tuple[int, int]]]:
    for at, folders, files in os.walk(root):
        folders[:] = [name for name in folders if Path(at, name) != but]
        for name in files:
            stat = os.stat(os.path.join(at, name))
            yield os.path.join(at, name), (stat.st_size, stat.st_mtime_ns)


def main(arguments: Sequence[str] | None = None) -> int:
    """Change and read, print what was found; 1 if something was."""
    parser = argparse.ArgumentParser(
        prog="python -m checks.stored", description="Read stored results that were changed."
    )
    parser.add_argument("--mutations", type=int, default=10_000, help="how many copies (default: 10000)")
    parser.add_argument("--seed", type=int, default=0, help="of all changes (default: 0)")
    parser.add_argument("--only", default="", help="FIRST:LAST, only these copies: to see a finding again")
    chosen = parser.parse_args(arguments)
    numbers = range(chosen.mutations)
    if chosen.only:
        numbers = range(*(int(part) for part in chosen.only.split(":")))
    count, started = 0, perf_counter()
    with tempfile.TemporaryDirectory(prefix="vsconstraints-stored-") as root:
        fuzz = Fuzz(Path(root))
        for number in numbers:
            for finding in fuzz.findings(chosen.seed, number):
                count += 1
                print(f"copy {number} of seed {chosen.seed}: {finding}", flush=True)
    said = ", ".join(f"{number} {outcome}" for outcome, number in sorted(fuzz.outcomes.items()))
    print(f"{len(numbers)} copies in {perf_counter() - started:.0f} s, readings: {said}; {count} findings")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
