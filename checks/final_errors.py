r"""``python -m checks.final_errors [--table TABLE] [--of FOLDER]``: success and final errors.

Prints two tables in Markdown for each condition, from a stored table. The first has success by the
strict standard and at 1 % of L, with 95 % intervals; bold marks the law that is significantly the
best, ≈ the best or not significantly worse. The second has the share of runs that succeed and also
end within 5 mm and 5 mrad, and the median and the 95 % quantile of the final errors of successful
runs.

The default table has disturbed scenes of test set v1. With ``--of`` a new table is made from the
folder of a campaign:

    vsconstraints testset run --laws comparisons/verdict.toml --scenes 12 \
      --set "conditions=['disturbed']" --out FOLDER

or, for ``--table comparisons/arms-with-mass.parquet``:

    vsconstraints evidence comparisons/arms-with-mass.toml --out FOLDER
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from vsconstraints.bench.evidence import Evidence, parquet
from vsconstraints.bench.evidence.parquet import KEYS, Column
from vsconstraints.bench.reports.ranking import Ranking, ranked
from vsconstraints.bench.statistics.judged import OUTCOMES
from vsconstraints.comparisons.runs.spec import BASELINE
from vsconstraints.simulation.setup import Tolerances

COMPARISONS = Path(__file__).parents[1] / "comparisons"
TABLE = COMPARISONS / "final-errors.parquet"  #: Table of disturbed scenes of test set v1.
WITH_MASS = COMPARISONS / "arms-with-mass.parquet"
SCENE = ["family", "scene"]
POSITION = "final_translation_error_m"
ORIENTATION = "final_rotation_error_rad"
COLUMNS = (
    *KEYS,
    Column("success", "flag"),
    Column("tolerant_success", "flag"),
    Column(POSITION, "number"),
    Column(ORIENTATION, "number"),
)


def keep(folder: Path, table: Path, scenes: int) -> None:
    """Write the table of a campaign's runs of laws in the first ``scenes`` of each family."""
    runs = Evidence.load(folder).runs
    runs = runs[(runs["controller"] != BASELINE) & (runs["scene"] < scenes)]
    runs = runs.assign(
        success=OUTCOMES["success"].flag(runs),
        tolerant_success=OUTCOMES["tolerant success"].flag(runs),
    )
    runs = runs.astype({column.name: str for column in KEYS if column.kind == "text"})
    parquet.write(table, parquet.table(COLUMNS, runs.to_dict("records")), {})


def places(runs: Any, column: str = "success") -> Ranking:
    """Rank the laws of one condition by success; ``column`` selects the kind of success."""
    condition = runs["condition"].iloc[0]
    return ranked(runs.pivot(index=SCENE, columns="controller", values=column), condition)


def summary(runs: Any) -> Any:
    """DataFrame with one line for each law, the most successful first.

    Shares are in per cent, errors in mm and mrad.
    """
    strict = Tolerances()
    near = (runs[POSITION] <= strict.translation_m) & (runs[ORIENTATION] <= strict.rotation_rad)
    runs = runs.assign(near=near & runs["success"])
    laws = runs.groupby("controller")
    good = runs[runs["success"]].groupby("controller")
    lines = pd.DataFrame(
        {
            "success": 100.0 * laws["success"].mean(),
            "near": 100.0 * laws["near"].mean(),
            "position": 1e3 * good[POSITION].median(),
            "position_95": 1e3 * good[POSITION].quantile(0.95),
            "orientation": 1e3 * good[ORIENTATION].median(),
            "orientation_95": 1e3 * good[ORIENTATION].quantile(0.95),
        }
    )
    return lines.sort_values("success", ascending=False, kind="stable")


def table_of_places(runs: Any) -> Iterator[str]:
    """Yield the lines of the first table."""
    strict = places(runs)
    tolerant = places(runs, "tolerant_success")
    yield "| law | success [%] | at 1 % of L [%] |"
    yield "|---|---:|---:|"
    for law in strict.laws:
        yield f"| `{law}` | {strict.cell(law)} | {tolerant.cell(law)} |"


def table_of_errors(lines: Any) -> Iterator[str]:
    """Yield the lines of the second table, from a :func:`summary`."""
    yield "| law | success [%] | and within 5 mm and 5 mrad [%] | final error [mm] | [mrad] |"
    yield "|---|---:|---:|---:|---:|"
    for law, own in lines.iterrows():
        position = f"{own['position']:.0f} / {own['position_95']:.0f}"
        orientation = f"{own['orientation']:.0f} / {own['orientation_95']:.0f}"
        yield f"| `{law}` | {own['success']:.0f} | {own['near']:.0f} | {position} | {orientation} |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = ArgumentParser(prog="python -m checks.final_errors", description=__doc__)
    parser.add_argument("--table", type=Path, default=TABLE)
    parser.add_argument("--of", type=Path, help="folder of a campaign, of which the table is made")
    parser.add_argument("--scenes", type=int, default=12, help="of each family, in that table")
    asked = parser.parse_args(arguments)
    if asked.of is not None:
        keep(asked.of, asked.table, asked.scenes)
    runs = pd.read_parquet(asked.table)
    for condition, own in runs.groupby("condition", sort=False):
        print(f"{condition}, {own.groupby(SCENE).ngroups} scenes\n")
        print("\n".join([*table_of_places(own), "", *table_of_errors(summary(own)), ""]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
