"""``python -m checks.mutation [--sample N]``: puts small mistakes into the code, one at a time, and runs quick tests.

Mistakes that no test notices are listed. Exit code 1 if fewer than 95 % of a group's are noticed (of a sample: if that
many are not probable any more), or if one that has a name (``named.toml``) is not. Of the laws the NumPy form is
changed and tested: it is their definition.
"""

from __future__ import annotations

import os

# before NumPy is imported: matrices are small, and forks must not meet threads
os.environ.update(VSCONSTRAINTS_COMPILE="0", OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MPLBACKEND="Agg")

import argparse
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from .mutants import Mutant, edited, mutants_of, sampled
from .run import ROOT, Runner, Verdict
from .targets import COMPILED, GROUPS, LEAST, TESTS, files_of, suffices

HERE = Path(__file__).parent


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge mutants and print what was found."""
    parser = argparse.ArgumentParser(prog="python -m checks.mutation", description="Do tests notice wrong code?")
    parser.add_argument("--sample", type=int, metavar="N", help="only so many of all mutants; all named ones as ever")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default: 1)")
    parser.add_argument("--only", metavar="TEXT", default="", help="only files with this in their path")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="mutants at a time")
    parser.add_argument("--verbose", action="store_true", help="print every mutant with the test that noticed it")
    chosen = parser.parse_args(arguments)
    started = time.monotonic()
    files = [file for group in GROUPS for file in files_of(ROOT, group) if chosen.only in file]
    named = [edited(ROOT, **table) for table in _tables("named.toml") if chosen.only in table["file"]]
    equivalent = {(table["file"], table["old"], table["new"]) for table in _tables("equivalent.toml")}
    every = [mutant for file in files for mutant in mutants_of(ROOT, file, COMPILED)]
    stale = {key for key in equivalent if key[0] in files} - {mutant.key for mutant in every}
    worth = [mutant for mutant in every if mutant.key not in equivalent]
    mutants = sampled(worth, chosen.sample or len(worth), chosen.seed)
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        watched = list(dict.fromkeys([*files, *(mutant.file for mutant in named)]))
        runner = Runner(Path(folder), TESTS, watched, chosen.jobs)
        print(f"{len(runner.reached)} tests, {time.monotonic() - started:.0f} s", file=sys.stderr, flush=True)
        verdicts = []
        for verdict in runner.judge([*named, *mutants]):
            verdicts.append(verdict)
            if chosen.verbose or not verdict.noticed:
                print(f"{verdict.state}: {verdict.mutant} {verdict.by}", flush=True)
        os.chdir(ROOT)
    print(f"\n{len(verdicts)} mutants, {len(every) - len(worth)} equivalent, {time.monotonic() - started:.0f} s")
    ordinary = [verdict for verdict in verdicts if not verdict.mutant.why]
    missed = [verdict for verdict in verdicts if verdict.mutant.why and not verdict.noticed]
    print(f"named: {len(named) - len(missed)} of {len(named)} noticed")
    for key in sorted(stale):
        print("equivalent.toml lists what is no mutant:", *key, sep="\n    ")
    good = _scores(ordinary, every, equivalent, whole=chosen.sample is None)
    return 0 if good and not missed and not stale else 1


def _tables(name: str) -> list[dict[str, str]]:
    tables: list[dict[str, str]] = tomllib.loads((HERE / name).read_text(encoding="utf-8")).get("mutant", [])
    return tables


def _scores(verdicts: list[Verdict], every: list[Mutant], equivalent: set[tuple[str, str, str]], whole: bool) -> bool:
    """Print the score of each file and group; whether they suffice: of all groups, or of a sample as a whole."""
    judged = Counter(verdict.mutant.file for verdict in verdicts)
    noticed = Counter(verdict.mutant.file for verdict in verdicts if verdict.noticed)
    apart = Counter(mutant.file for mutant in every if mutant.key in equivalent)

    def line(what: str, files: Sequence[str]) -> float:
        seen, of, left = (sum(count[file] for file in files) for count in (noticed, judged, apart))
        share = seen / of if of else 1.0
        print(f"{what:55} {seen:5} of {of:5}  {100.0 * share:6.2f} %  ({left} equivalent)")
        return share

    shares = []
    for group in GROUPS:
        files = files_of(ROOT, group)
        for file in files:
            if judged[file]:
                line(f"  {file}", [file])
        shares.append(line(group, files))
    if whole:
        return all(share >= LEAST for share in shares)
    line("sample", list(judged))
    return suffices(noticed.total(), judged.total())


if __name__ == "__main__":
    sys.exit(main())
