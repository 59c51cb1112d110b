"""Command ``python -m benchmarks [--quick] [--out FOLDER] [--part NAME]``.

It measures, and writes FOLDER/benchmarks.md.
"""

from __future__ import annotations

import os

# before NumPy is imported: for small matrices, threads only add noise
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from . import beside_peers, forms, growth, laws, loop, measured, own, stacks, startup, steps
from .part import FULL, QUICK, Effort, Part
from .report import write

PARTS: dict[str, Callable[[Effort], Part]] = {
    "steps": steps.measure,
    "forms": forms.measure,
    "laws": laws.measure,
    "measured": measured.measure,
    "own": own.measure,
    "growth": growth.measure,
    "loop": loop.measure,
    "trials": loop.measure_trials,
    "scenes": loop.measure_scenes,
    "stacks": stacks.measure,
    "startup": startup.measure,
    "first": startup.measure_first_calls,
    "comparison": startup.measure_default_comparison,
    "peers": beside_peers.measure,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the parts and write the report; return 1 if a part failed."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description="Measure control steps."
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer scenarios and samples: about a minute"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("reports"),
        help="folder for benchmarks.md (default: reports)",
    )
    parser.add_argument(
        "--part", action="append", choices=list(PARTS), help="only this part; can be repeated"
    )
    chosen = parser.parse_args(arguments)
    effort = QUICK if chosen.quick else FULL
    started = perf_counter()
    parts, failures = run(chosen.part or list(PARTS), effort)
    words = ["python -m benchmarks", *(arguments if arguments is not None else sys.argv[1:])]
    print(write(parts, failures, chosen.out, " ".join(words), perf_counter() - started))
    return 1 if failures else 0


def run(names: Sequence[str], effort: Effort) -> tuple[dict[str, Part], dict[str, str]]:
    """Return the parts by name, and the reasons for failures."""
    parts: dict[str, Part] = {}
    failures: dict[str, str] = {}
    for name in names:
        started = perf_counter()
        try:
            parts[name] = PARTS[name](effort)
        except Exception as error:  # a part that fails affects only its own lines
            failures[name] = f"{type(error).__name__}: {error}"
        said = failures.get(name, "measured")
        print(f"{name}: {said}, {perf_counter() - started:.1f} s", file=sys.stderr, flush=True)
    return parts, failures


if __name__ == "__main__":
    sys.exit(main())
