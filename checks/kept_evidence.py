"""``python -m checks.kept_evidence [--out FOLDER] [--no-figures]``: report of the kept study.

``vsconstraints testset run --laws comparisons/verdict.toml`` executes all runs and makes this
report, while the package keeps only one line of each run. This command makes the report from these
lines. Reasons and rows of the runs that the report names as examples are not in these lines; these
runs are repeated. Settings come from the manifest in the folder, which must have the same laws and
scenes.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from vsconstraints.bench.evidence import Evidence, parquet
from vsconstraints.bench.evidence.parquet import KEYS
from vsconstraints.bench.evidence.work import Batch, Part, scored
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.bench.reports.dataset import Dataset
from vsconstraints.bench.reports.failures import example_failures
from vsconstraints.bench.reports.report import write_report_of
from vsconstraints.bench.study import SHIPPED, Study
from vsconstraints.comparisons.metrics import NEGLIGIBLE, TOLERANT
from vsconstraints.comparisons.runs.files import write_json
from vsconstraints.comparisons.runs.folder import MANIFEST, manifest_of
from vsconstraints.comparisons.runs.machine import new_manifest
from vsconstraints.comparisons.runs.spec import BASELINE, ControllerSpec
from vsconstraints.errors import ConfigurationError

FOLDER = Path(__file__).parents[1] / "reports" / "evidence"
RUN = [column.name for column in KEYS]
#: Entries of a manifest that a command which executes runs writes about them.
OF_RUNS = (
    "wall_time_s",
    "process_time_s",
    "runs_per_s",
    "stored_before",
    "trajectories",
    "finished",
    "loaded",
)


def runs_of(study: Study) -> Any:
    """Return the lines of a study, with the columns of evidence that the report reads."""
    runs = study.runs.copy()
    fraction = runs["violation_fraction"].fillna(0.0)
    tolerant = runs["violated"].where(fraction > TOLERANT, "")
    depth = fraction.where(fraction > NEGLIGIBLE, 0.0)
    return runs.assign(
        violated_tolerant=tolerant,
        violation_depth=depth,
        step_time_median_us=runs["call_us"],
        compiled=True,
        sliding_lost_s=0.0,
        reason="",
    )


def made_again(study: Study, keys: Iterable[tuple[Any, ...]]) -> Part:
    """Repeat runs of a study, named by their :data:`RUN`."""
    test_set = TestSet.load()
    families = {family.name: family for family in test_set.families}
    parts = []
    for family, condition, half, scene, law in keys:
        laws = ControllerSpec(BASELINE), study.laws[law]
        seed = study.frozen[family]["seed"]
        batch = Batch(families[family], (int(scene),), (condition,), laws, half, seed)
        parts.append(scored(batch))
    return Part.joined(parts)


@dataclass(frozen=True)
class Lines(Evidence):
    """Evidence whose runs are the lines of the study shipped with the package."""

    @cached_property
    def study(self) -> Study:
        """Study shipped with the package."""
        return Study.load(SHIPPED)

    @cached_property
    def runs(self) -> Any:
        """Runs as in :attr:`.Evidence.runs`."""
        runs = runs_of(self.study)
        order = {name: number for number, name in enumerate(self.controllers)}
        return runs.sort_values(
            RUN, key=lambda own: own.map(order) if own.name == "controller" else own
        )


class KeptEvidence(Lines):
    """Evidence with reasons and rows of the runs that the report names as examples.

    These runs are repeated.
    """

    @cached_property
    def examples(self) -> Part:
        """Repeat the runs that the report names."""
        lines = Dataset(Lines(self.folder, self.manifest), figures=False)
        named = [run for own in example_failures(lines).values() for run in own.values()]
        return made_again(self.study, dict.fromkeys(tuple(run[RUN]) for run in named))

    @cached_property
    def runs(self) -> Any:
        """Runs as in :attr:`.Evidence.runs`, with the reasons of examples."""
        runs = super().runs.set_index(RUN)
        again = self.examples.runs.to_pandas().set_index(RUN)
        again = again[again.index.isin(runs.index)]
        runs.loc[again.index, "reason"] = again["reason"]
        return runs.reset_index()

    @cached_property
    def rows(self) -> Any:
        """Rows as in :attr:`.Evidence.rows`, for examples only."""
        rows = self.examples.rows.to_pandas()
        return rows[rows["controller"] != BASELINE]

    @cached_property
    def scenes(self) -> Any:
        """Scenes as in :attr:`.Evidence.scenes`."""
        numbers = self.study.runs.groupby("family", sort=False)["scene"].unique()
        lines = []
        for family in TestSet.load().families:
            scenes = tuple(sorted(int(number) for number in numbers[family.name]))
            frozen = self.study.frozen[family.name]
            batch = Batch(family, scenes, (), (), "held-out", frozen["seed"])
            lines.append(scored(batch).scenes)
        return parquet.joined(lines).to_pandas()


def require_same(manifest: dict[str, Any], study: Study) -> None:
    """Raise ConfigurationError unless a manifest has a study's laws and scenes."""
    configuration = manifest.get("configuration", {})
    laws = {
        name: ControllerSpec.from_table(name, own)
        for name, own in configuration.get("controllers", {}).items()
    }
    laws.pop(BASELINE, None)
    frozen = {
        name: own["tables"]["frozen"]["held-out"]
        for name, own in configuration.get("families", {}).items()
    }
    if laws != study.laws or frozen != study.frozen:
        raise ConfigurationError(
            "the manifest is of other laws or scenes than the study that comes with the package"
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the report."""
    parser = ArgumentParser(prog="python -m checks.kept_evidence", description=__doc__)
    parser.add_argument(
        "--out", type=Path, default=FOLDER, help="folder with the manifest, for the report"
    )
    parser.add_argument(
        "--no-figures", action="store_true", help="figures that are there stay as they are"
    )
    asked = parser.parse_args(arguments)
    manifest = manifest_of(asked.out)
    study = Study.load(SHIPPED)
    require_same(manifest, study)
    kept = {name: value for name, value in manifest.items() if name not in OF_RUNS}
    command = ["python", "-m", "checks.kept_evidence"]
    manifest = {**kept, **new_manifest(command), "runs": len(study.runs)}
    evidence = KeptEvidence(asked.out, manifest)
    write_report_of(Dataset(evidence, figures=not asked.no_figures))
    write_json(asked.out / MANIFEST, manifest)
    return 0


if __name__ == "__main__":
    sys.exit(main())
