"""``python -m checks.mutation [--sample N [--minutes M]]``: mutation tests with the quick tests.

Small mistakes are put into the code, one at a time. Mistakes that no test notices are listed. The
exit code is 1 if less than 95 % of a group's mistakes are noticed (for a sample: if a share of 95 %
of those that can be noticed is improbable), or if a named one is not.

For mistakes in what compiled code is made of, compiled functions run as Python, and also with
``--named`` and ``--renew``. For all others, compiled code is read from beside the sources, where a
run of the tests has left it; what is missing is compiled first, which takes a minute or two.

Which tests enter which functions is found by watching them, and kept between runs (``coverage``).
With ``--minutes``, 60 % of that time is for watching, no mutant is begun after all of it, and the
tests of each take a minute at most. The test of a sample is about the mutants that were judged, 30
at least. Where test files were not watched in time, mutants in functions that no other test enters
are undecided, and mutants that only tests in these files would notice survive: the share of those
that are noticed is then too small, never too large. The next run continues to watch.

Named mistakes are those of ``named.toml``, with reasons, and of ``noticed.tsv``, each with a test
that notices it. ``--named`` runs only these, each against its test; ``--renew N`` chooses N new
ones, evenly from all files.
"""

from __future__ import annotations

import os

# before NumPy is imported: matrices are small, and a fork with threads is unsafe
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MPLBACKEND="Agg")

import argparse
import csv
import math
import random
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from pathlib import Path

from .coverage import cache_folder
from .mutants import Mutant, edited, mutants_of, sampled
from .run import ROOT, WATCHED_FOLDERS, Runner, Verdict
from .targets import GROUPS, LEAST, TESTS, Mode, files_named, files_of, suffices

HERE = Path(__file__).parent
NOTICED = HERE / "noticed.tsv"
SPARE = 1.25
"""With ``--renew``, factor of judged mutants."""

LONGEST = 60.0
"""With ``--renew`` or ``--minutes``, time limit [s] of all tests of a mutant together."""

WATCHING = 0.6
"""With ``--minutes``, share of the time after which no further test file is watched."""

FEWEST = 30
"""With ``--minutes``, least number of judged mutants of a sample: fewer contradict no share."""

Key = tuple[str, str, str]


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge mutants and print the results."""
    parser = argparse.ArgumentParser(
        prog="python -m checks.mutation", description="Do tests notice wrong code?"
    )
    parser.add_argument(
        "--sample", type=int, metavar="N", help="only so many, and no named ones unless --named"
    )
    parser.add_argument("--seed", default="1", help="of the sample (default: 1)")
    parser.add_argument(
        "--minutes", type=float, default=math.inf, metavar="M", help="time for all of it"
    )
    parser.add_argument(
        "--only", metavar="TEXT", default="", help="only files with this in their path"
    )
    parser.add_argument(
        "--changed", metavar="REV", help="only lines that were changed since this commit"
    )
    parser.add_argument(
        "--named", action="store_true", help="only named mutants, each against its test"
    )
    parser.add_argument("--renew", type=int, metavar="N", help="name so many mutants anew")
    parser.add_argument(
        "--jobs", type=int, default=len(os.sched_getaffinity(0)), help="mutants at a time"
    )
    parser.add_argument(
        "--verbose", action="store_true", help="print every mutant with the test that noticed it"
    )
    chosen = parser.parse_args(arguments)
    started = time.monotonic()
    scored = files_of(ROOT, [name for names in GROUPS.values() for name in names])
    wanted = files_named(ROOT) if chosen.named or chosen.renew or chosen.changed else scored
    files = [file for file in wanted if chosen.only in file]
    equivalent = {
        (table["file"], table["old"], table["new"]) for table in _tables("equivalent.toml")
    }
    every = [mutant for file in files for mutant in mutants_of(ROOT, file)]
    stale = {key for key in equivalent if key[0] in files} - {mutant.key for mutant in every}
    worth = [mutant for mutant in every if mutant.key not in equivalent]
    n_equivalent = len(every) - len(worth)
    reasoned = [
        edited(ROOT, **table) for table in _tables("named.toml") if chosen.only in table["file"]
    ]
    tests = _noticed()
    known = {mutant.key: mutant for mutant in worth}
    named = list(
        {
            mutant.key: mutant
            for mutant in [*(known[key] for key in tests if key in known), *reasoned]
        }.values()
    )
    if chosen.named:
        gone = [
            key for key in tests if key not in known.keys() | {mutant.key for mutant in reasoned}
        ]
        for key in gone if not chosen.only else ():
            print(
                "noticed.tsv lists what is no mutant any more; --renew chooses another one:",
                *key,
                sep="\n    ",
            )
        mutants = []
        named = sampled(named, chosen.sample or len(named), chosen.seed)
    elif chosen.renew:
        mutants = _evenly(worth, round(SPARE * chosen.renew), chosen.seed)
    else:
        lines = _changed(chosen.changed) if chosen.changed else None
        worth = [mutant for mutant in worth if lines is None or mutant.line in lines[mutant.file]]
        mutants = sampled(worth, chosen.sample or len(worth), chosen.seed)
        # in random order: those that are judged in a limited time are a sample, too
        random.Random(chosen.seed).shuffle(mutants)
        named = [] if chosen.sample else named
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        known_tests = {mutant.key: tests[mutant.key] for mutant in named if mutant.key in tests}
        is_limited = chosen.renew or math.isfinite(chosen.minutes)
        named_by = Counter(test.partition("::")[0] for test in tests.values())
        # tests of named mutants are quick without the compiler, whatever the mutated file is
        modes = [Mode.UNCOMPILED] if chosen.named or chosen.renew else list(Mode)
        runner = Runner(
            Path(folder),
            sorted(TESTS, key=lambda test_file: -named_by[test_file]),
            chosen.jobs,
            known=known_tests if chosen.named else None,
            longest=LONGEST if is_limited else math.inf,
            cache=cache_folder(),
            watch_until=started + WATCHING * 60.0 * chosen.minutes,
            modes=modes,
        )
        _print_watched(runner, time.monotonic() - started)
        # of a sample a missing test is noticed when it is to run
        missing = []
        if chosen.named and not chosen.sample:
            missing = runner.missing_tests(sorted(set(known_tests.values())))
        if missing:
            os.chdir(ROOT)
            print("tests of noticed.tsv that cannot be run:", *missing, sep="\n    ")
            return 1
        wanted_mutants = [*named, *mutants]
        every_verdict = _judged(
            runner, wanted_mutants, started + 60.0 * chosen.minutes, chosen.verbose
        )
        verdicts = [verdict for verdict in every_verdict if verdict.state != "undecided"]
        failing = "" if chosen.named else _failing_without_mutant(runner, verdicts)
        os.chdir(ROOT)
    print(
        f"\n{len(verdicts)} mutants of {len(wanted_mutants)}, "
        f"{n_equivalent} equivalent, {time.monotonic() - started:.0f} s"
    )
    if undecided := len(every_verdict) - len(verdicts):
        print(f"{undecided} mutants undecided: run it again, it continues to watch tests")
    if len(verdicts) < min(FEWEST, len(wanted_mutants)):
        print(f"fewer than {FEWEST} mutants were judged, which tell nothing: allow more --minutes")
        return 1
    if failing:
        print(f"{failing} fails without a mutant, too: what it notices says nothing")
        return 1
    if chosen.renew:
        return _write(verdicts, reasoned, chosen.renew)
    keys = {mutant.key for mutant in named}
    missed = [verdict for verdict in verdicts if verdict.mutant.key in keys and not verdict.noticed]
    if named:
        print(f"named: {len(named) - len(missed)} of {len(named)} noticed")
    for key in sorted(stale):
        print("equivalent.toml lists what is no mutant:", *key, sep="\n    ")
    ordinary = [verdict for verdict in verdicts if verdict.mutant.key not in keys]
    good = chosen.named or _scores(
        ordinary, every, equivalent, whole=not (chosen.sample or chosen.changed)
    )
    return 0 if good and not missed and not stale else 1


def _print_watched(runner: Runner, seconds: float) -> None:
    """Print how many tests are known, and which are not."""
    for mode in runner.modes:
        unwatched = sum(where is mode for where, _ in runner.unwatched)
        if unwatched:
            print(f"not watched in time, {mode}: {unwatched} of {len(TESTS)} test files")
    counts = " and ".join(f"{len(runner.reached[mode])} {mode}" for mode in runner.modes)
    print(f"tests: {counts}, {seconds:.0f} s", file=sys.stderr, flush=True)


def _failing_without_mutant(runner: Runner, verdicts: Sequence[Verdict]) -> str:
    """Return the first test of the verdicts that fails without a mutant, or an empty string."""
    noticing: dict[Mode, set[str]] = defaultdict(set)
    for verdict in verdicts:
        if verdict.by:
            noticing[runner.mode_of(verdict.mutant.file)].add(verdict.by)
    failing = (
        runner.failing_without_mutant(mode, sorted(tests)) for mode, tests in noticing.items()
    )
    return next(filter(None, failing), "")


def _judged(
    runner: Runner, mutants: Sequence[Mutant], until: float, verbose: bool
) -> list[Verdict]:
    """Judge mutants, and print those that are not noticed, or all of them."""
    verdicts = []
    for verdict in runner.judge(mutants, until):
        verdicts.append(verdict)
        if verbose or not verdict.noticed:
            print(f"{verdict.state}: {verdict.mutant} {verdict.by}", flush=True)
    return verdicts


def _tables(name: str) -> list[dict[str, str]]:
    tables: list[dict[str, str]] = tomllib.loads((HERE / name).read_text(encoding="utf-8")).get(
        "mutant", []
    )
    return tables


def _noticed() -> dict[Key, str]:
    """Return the test that notices each named mutant."""
    with NOTICED.open(encoding="utf-8", newline="") as file:
        return {
            (line["file"], line["old"], line["new"]): line["test"]
            for line in csv.DictReader(file, delimiter="\t")
        }


def _write(verdicts: Sequence[Verdict], reasoned: Sequence[Mutant], count: int) -> int:
    """Write the noticed mutants, those with reasons first; return 0 if there are enough."""
    first = {mutant.key for mutant in reasoned}
    noticed = {
        verdict.mutant.key: verdict.by
        for verdict in verdicts
        if verdict.state == "killed" and verdict.by
    }
    keys = sorted(sorted(noticed, key=lambda key: key not in first)[:count])
    with NOTICED.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, delimiter="\t", lineterminator="\n")
        writer.writerow(["file", "old", "new", "test"])
        writer.writerows([*key, noticed[key]] for key in keys)
    print(
        f"{NOTICED.name}: {len(keys)} mutants, {sum('/compiled/' in key[0] for key in keys)} of "
        f"them in compiled code"
    )
    return 0 if len(keys) == count and first <= set(keys) else 1


def _evenly(mutants: Sequence[Mutant], count: int, seed: str) -> list[Mutant]:
    """Select mutants evenly from all files, 40 % of them from compiled code."""
    by_file: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in random.Random(seed).sample(mutants, len(mutants)):
        by_file[mutant.file].append(mutant)

    def some(compiled: bool, wanted: int) -> list[Mutant]:
        turns: Iterable[tuple[Mutant | None, ...]] = zip_longest(
            *(own for file, own in by_file.items() if ("/compiled/" in file) is compiled)
        )
        return [mutant for turn in turns for mutant in turn if mutant][:wanted]

    compiled = some(True, round(0.4 * count))
    return compiled + some(False, count - len(compiled))


def _changed(revision: str) -> dict[str, set[int]]:
    """Return lines that differ from a commit, by file."""
    words = ["git", "diff", "-U0", "--no-renames", revision, "--", *WATCHED_FOLDERS]
    lines: dict[str, set[int]] = defaultdict(set)
    file = ""
    for line in subprocess.run(
        words, cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.splitlines():
        if line.startswith("+++ "):
            file = line[6:]
        elif at := re.match(r"@@ -\S+ \+(\d+)(?:,(\d+))? @@", line):
            first = int(at[1])
            count = int(at[2] or 1)
            lines[file] |= set(range(first, first + count))
    return lines


def _scores(
    verdicts: list[Verdict], every: list[Mutant], equivalent: set[tuple[str, str, str]], whole: bool
) -> bool:
    """Print the score of each file and group; return True if the scores suffice.

    All groups must suffice, or a sample as a whole.
    """
    judged = Counter(verdict.mutant.file for verdict in verdicts)
    noticed = Counter(verdict.mutant.file for verdict in verdicts if verdict.noticed)
    apart = Counter(mutant.file for mutant in every if mutant.key in equivalent)

    def line(what: str, files: Sequence[str]) -> float:
        seen, of, left = (sum(count[file] for file in files) for count in (noticed, judged, apart))
        share = seen / of if of else 1.0
        print(f"{what:55} {seen:5} of {of:5}  {100.0 * share:6.2f} %  ({left} equivalent)")
        return share

    shares = []
    for group, names in GROUPS.items():
        files = files_of(ROOT, names)
        for file in files:
            if judged[file]:
                line(f"  {file}", [file])
        if any(judged[file] for file in files):
            shares.append(line(group, files))
    if whole:
        return all(share >= LEAST for share in shares)
    line(f"sample of {len(judged)} files of {len({mutant.file for mutant in every})}", list(judged))
    return suffices(noticed.total(), judged.total())


if __name__ == "__main__":
    sys.exit(main())
