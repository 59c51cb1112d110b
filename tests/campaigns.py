"""A small campaign for tests: scenes of a fast example that take milliseconds, and laws that
misbehave.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from vsconstraints.bench.evidence import Campaign, Evidence, parquet
from vsconstraints.comparisons.metrics import timing_columns

FAMILY = """
extends = "example-2d-fast"
duration = 0.3
q0 = { gaussian = [[-0.720, -1.744, 1.074], 0.01] }
[conditions.limited.limits]
acceleration = { uniform = [20.0, 40.0] }
"""

CAMPAIGN = """
title = "Small"
families = ["quick.toml"]
scenes = 6
[controllers.sliding-mode]
[controllers.hierarchical-qp]
rows = "barrier"
"""

LAWS = '''
import os, time
import numpy as np
from vsconstraints.controllers import Tracking


class Bad(Tracking):
    """Misbehaves where a row is so far outside."""

    def __init__(self, how="raise", above=-9.0):
        super().__init__()
        self.how, self.above = how, above

    def solve(self, rows, task):
        if rows.phi.max() > self.above:
            if self.how == "raise":
                raise ValueError("no idea")
            if self.how == "die":
                os._exit(3)
            while True:
                pass
        return super().solve(rows, task)
'''


def campaign(folder: Path, controllers: str = "", **changes: int) -> Campaign:
    """The campaign's files in a folder, read."""
    (folder / "quick.toml").write_text(FAMILY)
    (folder / "odd.py").write_text(LAWS)
    (folder / "small.toml").write_text(CAMPAIGN + controllers)
    return Campaign.load(folder / "small.toml").select(**changes)


def tables(folder: Path) -> dict[str, pd.DataFrame]:
    """All that is stored, without what differs from time to time."""
    evidence = Evidence.load(folder)
    return {
        name: getattr(evidence, name).drop(
            columns=[column for column in timing_columns() if name == "runs"]
        )
        for name in parquet.tables()
    }


def assert_same(one: dict[str, pd.DataFrame], other: dict[str, pd.DataFrame]) -> None:
    """To the last digit."""
    for name, table in one.items():
        pd.testing.assert_frame_equal(table, other[name], check_exact=True)
