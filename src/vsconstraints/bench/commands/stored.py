"""What commands do with the folder of a campaign: its report, and whether it is whole."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ...cli.results import ReportOptions, ResultsKind
from ...cli.terminal import Show, note
from ...errors import ConfigurationError
from ...plugins.extras import demand
from ...reports.formats import formats_of


def _write_report(folder: Path, wanted: ReportOptions, tuning: Path | None, show: Show) -> Path:
    """Write the report of a campaign."""
    if wanted.replays:
        raise ConfigurationError(f"--replays is for comparisons, and {folder} holds a campaign")
    from ..reports import write_evidence_report  # needs an extra

    return write_evidence_report(
        folder,
        tuning=tuning,
        on_written=partial(show, "writing the report"),
        figures=wanted.figures,
        formats=formats_of(wanted.formats or ()),
        trust=wanted.trust,
        on_remark=note,
    )


def _contents(folder: Path) -> tuple[str, list[Path], list[str]]:
    """Return a summary of a campaign, its files, and missing parts.

    Raises ConfigurationError if it cannot be loaded.
    """
    demand("evidence", "a campaign")
    from ..evidence import Evidence, Shard
    from ..evidence.folder import missing_scenes, shards, stored_files

    evidence = Evidence.load(folder, trust=True)  # no part of it is built
    configuration = evidence.manifest["configuration"]
    shard = Shard(*evidence.manifest.get("shard", (1, 1)))
    facts = [each.facts for each in shards(folder)]
    lost = missing_scenes(configuration, facts, shard.scenes(configuration["scenes"]))
    contents = (
        f"{len(evidence.runs)} runs in {len(evidence.scenes)} scenes of "
        f"{len(evidence.families)} families"
    )
    return contents, stored_files(folder), [f"scenes {lost} are missing"] if lost else []


CAMPAIGN = ResultsKind(_write_report, _contents)
