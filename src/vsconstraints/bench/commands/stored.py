"""Commands for the folders of a campaign: its report, and the check that it is complete."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from ...cli.results import ReportOptions, ResultsKind
from ...cli.terminal import Show, note
from ...errors import ConfigurationError
from ...plugins.extras import demand
from ...reports.formats import formats_of


def _write_report(
    folders: Sequence[Path], wanted: ReportOptions, tuning: Path | None, show: Show
) -> Path:
    """Write the report of a campaign."""
    if wanted.replays:
        raise ConfigurationError(f"--replays is for comparisons, and {folders[0]} holds a campaign")
    if len(folders) > 1 and wanted.out is None:
        raise ConfigurationError("the report of several folders needs a folder of its own: --out")
    from ..reports import write_evidence_report  # needs an extra

    return write_evidence_report(
        folders,
        out=wanted.out,
        tuning=tuning,
        on_written=partial(show, "writing the report"),
        figures=wanted.figures,
        formats=formats_of(wanted.formats or ()),
        trust=wanted.trust,
        on_remark=note,
    )


def _contents(folders: Sequence[Path]) -> tuple[str, list[Path], list[str]]:
    """Return a summary of a campaign, its files, and missing parts.

    Raises ConfigurationError if it cannot be loaded.
    """
    demand("evidence", "a campaign")
    from ..evidence import Evidence, Shard
    from ..evidence.folder import stored_files

    evidence = Evidence.load(folders, trust=True)  # no part of it is built
    shard = Shard(*evidence.manifest.get("shard", (1, 1)))
    scenes = evidence.manifest["configuration"]["scenes"]
    lost = evidence.missing_scenes(shard.scenes(scenes))
    contents = (
        f"{len(evidence.runs)} runs in {len(evidence.scenes)} scenes of "
        f"{len(evidence.families)} families"
    )
    files = [path for folder in folders for path in stored_files(folder)]
    missing = []
    if lost:
        missing.append(f"scenes {lost} are missing")
    return contents, files, missing


CAMPAIGN = ResultsKind(_write_report, _contents)
