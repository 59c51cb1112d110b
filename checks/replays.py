"""Size of replays and time to make them: ``python -m checks.replays [SCENARIO …]``.

The unconstrained baseline and the sliding mode are replayed in all shipped scenarios, or in the
named ones. It needs the extra ``replay``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence

from vsconstraints.scenarios import shipped_scenarios
from vsconstraints.view.replay import replay_html
from vsconstraints.view.replay.runs import select_run

LAWS = ("tracking", "sliding-mode")

MOST_BYTES = 4e6
MOST_TIME = 5.0
"""Bounds on a page: size, and processor time [s]."""


def check(scenarios: Sequence[str] = (), tell: Callable[[str], None] = print) -> bool:
    """Print size and times of each page; return True if all are within the bounds."""
    good = True
    for name in scenarios or shipped_scenarios():
        runs = [select_run(f"{name}:{law}") for law in LAWS]
        begun = time.process_time()
        clock = time.perf_counter()
        size = len(replay_html(runs).encode())
        spent = time.process_time() - begun
        waited = time.perf_counter() - clock
        small = size < MOST_BYTES and spent < MOST_TIME
        good &= small
        tell(
            f"{name:32} {size / 1e6:4.1f} MB, made in {spent:4.1f} s of a processor, "
            f"{waited:4.1f} s by the clock"
        )
    return good


if __name__ == "__main__":
    sys.exit(not check(sys.argv[1:]))
