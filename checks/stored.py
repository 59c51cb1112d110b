"""``python -m checks.stored [--mutations N] [--seed S] [--only FIRST:LAST]``: damaged results.

A comparison and a campaign are made once. Each time one or two changes are made at random in a copy
of one of them: a bit, a file's end, a whole file, a value in the manifest or in a table, a text
that names code, a path, an address.

In half of the copies nothing else is done, and readers must refuse the copy or find exactly the
stored numbers. In the others the checksums are renewed or removed, as by an attacker. Reading must
then end with an error of this package, or in any other way without running code, writing outside
the folder, or opening a connection. Failures are printed with their number; then the exit code is
1. The same seed gives the same changes.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import typer

from vsconstraints.bench.difference import difference
from vsconstraints.bench.evidence import Campaign, Evidence, Plan, collect, merge, parquet
from vsconstraints.bench.evidence.folder import stored_files as files_of_campaign
from vsconstraints.bench.reports import replay, write_evidence_report
from vsconstraints.cli.results import verify
from vsconstraints.comparisons import StoredComparison, Suite, compare
from vsconstraints.comparisons.record import ARRAYS
from vsconstraints.comparisons.runs.files import SUMS, digests, write_sums
from vsconstraints.comparisons.stored import stored_files as files_of_comparison
from vsconstraints.errors import VsconstraintsError
from vsconstraints.reports import write_report
from vsconstraints.view.replay.runs import select_run

from .damage import MEANT, PLAIN

LIMIT = 120
"""Time limit of the readers of one copy [s]; some hundredths are usual."""

PLANT = """
import os
open(os.environ["VSCONSTRAINTS_PLANTED"], "w").close()
from vsconstraints.controllers import Tracking as Planted
"""

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


class Here:
    """Worker pool that runs in this process."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def run(
        self, calls: Mapping[Any, tuple[Any, ...]], *_: object, **__: object
    ) -> Iterator[tuple[Any, Any]]:
        """Yield the result of each call."""
        return ((key, self.function(*arguments)) for key, arguments in calls.items())


@dataclass
class Watch:
    """Actions of a process while it is watched by an audit hook; each is a finding."""

    inside: str = ""
    did: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        sys.addaudithook(self._heard)  # permanent: audit hooks cannot be removed

    @contextmanager
    def over(self, inside: Path) -> Iterator[list[str]]:
        """Note forbidden actions during the block.

        These are writes outside a folder, imports of planted code, connections, and new processes.
        """
        self.inside = os.path.realpath(inside)
        self.did = []
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
        elif event in (
            "os.system",
            "os.exec",
            "os.posix_spawn",
            "subprocess.Popen",
            "socket.connect",
        ):
            self.did.append(f"{event} {arguments[:1]}")
        elif event == "import" and str(arguments[0]).startswith("planted"):
            self.did.append(f"import {arguments[0]}")

    def _wrote(self, event: str, path: Any) -> None:
        whole = (
            os.path.realpath(os.fsdecode(path))
            if isinstance(path, (str, bytes, os.PathLike))
            else str(path)
        )
        # caches of Python and its libraries
        own = "cache" in whole or whole.endswith("matplotlib")
        if not own and not whole.startswith((self.inside + os.sep, "/dev/null")):
            self.did.append(f"{event} {whole}")


@dataclass(frozen=True)
class Made:
    """Unchanged results, and the numbers that readers find in them.

    Attributes
    ----------
    folder
        Folder of the results.
    files
        Returns the files of a folder.
    numbers
        Returns hashes of all numbers and texts that readers take from a folder, separately for each
        stored trajectory.
    read
        Readers by name, each with the number of copies of which it reads one.
    """

    folder: Path
    files: Callable[[Path], list[Path]]
    numbers: Callable[[Path], dict[str, str]]
    read: dict[str, tuple[int, Callable[[Path], object]]]


def comparison(root: Path) -> Made:
    """Make a comparison of two laws in one scene, each in two trials."""
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
                found[str(key)] = _hash(
                    [(name, np.asarray(parts[name]).tobytes()) for name in ARRAYS]
                )
        return found

    file = "example-2d-fov--sliding-mode--1.npz"
    return Made(
        root / "comparison",
        files_of_comparison,
        numbers,
        {
            "report": (4, lambda folder: write_report(folder, figures=False)),
            "figures": (400, write_report),
            "replay": (20, lambda folder: select_run(str(folder / "trajectories" / file))),
            "diff": (40, lambda folder: difference(root / "comparison", folder)),
            "verify": (2, lambda folder: verify([folder])),
        },
    )


def campaign(root: Path) -> Made:
    """Make a campaign of one law in two scenes, with some trajectories stored."""
    (root / "quick.toml").write_text(FAMILY)
    (root / "small.toml").write_text(CAMPAIGN)
    here = Plan(keep="first", workers=lambda function: nullcontext(Here(function)))
    collect(Campaign.load(root / "small.toml"), root / "campaign", here)

    def numbers(folder: Path) -> dict[str, str]:
        evidence = Evidence.load(folder)
        tables = [getattr(evidence, name).to_json(double_precision=15) for name in parquet.tables()]
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
            "diff": (40, lambda folder: difference(root / "campaign", folder)),
            "verify": (2, lambda folder: verify([folder])),
        },
    )


def _hash(data: Any) -> str:
    return hashlib.sha256(repr(data).encode("utf-8", "backslashreplace")).hexdigest()


def change(folder: Path, made: Made, chance: random.Random) -> tuple[str, bool]:
    """Make one or two changes in a folder.

    Returns a description, and True if a reader must notice it or find unchanged numbers.
    """
    by_chance = chance.random() < 0.5
    what = []
    for _ in range(1 if by_chance else chance.choice((1, 1, 2))):
        files = [path for path in made.files(folder) if path.is_file() and path.stat().st_size]
        files += [folder / SUMS] if by_chance else []
        path = chance.choice(files)
        done = chance.choice(PLAIN if by_chance or chance.random() < 0.3 else MEANT)
        what.append(f"{done.__name__[1:]} of {path.relative_to(folder)}")
        with suppress(Exception):  # after the first change the file may be unreadable
            done(path, chance)
    if by_chance:
        return what[0], True
    if chance.random() < 0.5:
        write_sums(folder, digests(folder, made.files(folder)))
    else:
        (folder / SUMS).unlink(missing_ok=True)
    return ", ".join(what), False


class Fuzz:
    """Results to be changed, in a separate folder, and the outcomes."""

    def __init__(
        self, root: Path, kinds: Sequence[Callable[[Path], Made]] = (comparison, campaign)
    ) -> None:
        self.root = root.resolve()
        self.watch = Watch()
        self.made = [kind(self.root) for kind in kinds]
        self.stored = [made.numbers(made.folder) for made in self.made]
        self.outcomes: Counter[str] = Counter()
        (self.root / "planted.py").write_text(PLANT)
        self.marker = self.root / "planted-has-run"
        os.environ["VSCONSTRAINTS_PLANTED"] = str(self.marker)

    def findings(self, seed: int, number: int) -> Iterator[str]:
        """Change a copy and read it; yield failures."""
        chance = random.Random(f"{seed} {number}")
        which = chance.randrange(len(self.made))
        made = self.made[which]
        stored = self.stored[which]
        folder = self.root / "at" / "work"
        shutil.rmtree(folder.parent, ignore_errors=True)
        shutil.copytree(made.folder, folder)
        (self.root / "outside").mkdir(exist_ok=True)
        what, seen = change(folder, made, chance)
        readers = {
            name: read for name, (every, read) in made.read.items() if chance.randrange(every) == 0
        }
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

    def _read(
        self, read: Callable[[Path], object], folder: Path, expected: dict[str, str] | None
    ) -> str:
        """Run a reader; describe its failure, if any."""
        signal.alarm(LIMIT)
        try:
            with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
                found = read(folder)
        except (VsconstraintsError, typer.Exit) as error:
            self.outcomes["refused"] += 1
            text = str(error)
            return f"an error of several lines: {text!r}" if "\n" in text else ""
        except Exception as error:  # any other error is a finding
            self.outcomes["raised"] += 1
            return f"{type(error).__name__}: {error}"
        finally:
            signal.alarm(0)
        self.outcomes["read"] += 1
        same = expected is None or (
            isinstance(found, dict) and "tables" in found and found.items() <= expected.items()
        )
        return "" if same else "other numbers, and nobody said so"


def _listing(root: Path, but: Path) -> Iterator[tuple[str, tuple[int, int]]]:
    for at, folders, files in os.walk(root):
        folders[:] = [name for name in folders if Path(at, name) != but]
        for name in files:
            stat = os.stat(os.path.join(at, name))
            yield os.path.join(at, name), (stat.st_size, stat.st_mtime_ns)


def main(arguments: Sequence[str] | None = None) -> int:
    """Change and read all copies, print failures; return 1 if there are any."""
    parser = argparse.ArgumentParser(
        prog="python -m checks.stored", description="Read stored results that were changed."
    )
    parser.add_argument(
        "--mutations", type=int, default=10_000, help="how many copies (default: 10000)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of all changes (default: 0)")
    parser.add_argument(
        "--only", default="", help="FIRST:LAST, only these copies: to see a finding again"
    )
    chosen = parser.parse_args(arguments)
    numbers = range(chosen.mutations)
    if chosen.only:
        numbers = range(*(int(part) for part in chosen.only.split(":")))
    count = 0
    started = perf_counter()
    with tempfile.TemporaryDirectory(prefix="vsconstraints-stored-") as root:
        fuzz = Fuzz(Path(root))
        for number in numbers:
            for finding in fuzz.findings(chosen.seed, number):
                count += 1
                print(f"copy {number} of seed {chosen.seed}: {finding}", flush=True)
    said = ", ".join(f"{number} {outcome}" for outcome, number in sorted(fuzz.outcomes.items()))
    print(
        f"{len(numbers)} copies in {perf_counter() - started:.0f} s, readings: {said}; {count} "
        f"findings"
    )
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
