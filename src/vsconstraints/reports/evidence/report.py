"""The report of evidence: report.md, the same as a page, its figures, and its claims as data."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from ...comparisons.evidence import Evidence
from ...comparisons.runs.files import replaced
from ...errors import ConfigurationError, StorageError
from ..page import write_pages
from ..plots import PNG, Formats
from .closing import closing
from .decisions import decisions
from .failing import failing
from .holding import conclusions, holding, powers
from .knowledge import knowledge
from .material import Material
from .opening import opening
from .profiles import profiles
from .rates import rates
from .scenes import scenes
from .singles import singles
from .tuned import tuned, tuning_folder

SECTIONS: tuple[Callable[[Material], str], ...] = (
    decisions,
    holding,
    rates,
    profiles,
    knowledge,
    failing,
    singles,
    tuned,
    scenes,
    closing,
)
"""The parts below the first screen, in their order; one that has nothing to say is empty."""

CLAIMS = "claims.json"


OnWritten = Callable[[int, int], None]
"""Told how many parts of a report are there, and how many there will be."""


def write_evidence_report(
    folder: Path,
    *,
    figures: bool = True,
    tuning: Path | None = None,
    formats: Formats = PNG,
    trust: bool = False,
    on_written: OnWritten = lambda done, total: None,
    on_remark: Callable[[str], None] = lambda remark: None,
) -> Path:
    """Write report.md, the same as report.html, its figures and claims.json from the evidence in a folder.

    Parameters
    ----------
    folder
        Where a campaign is stored.
    figures
        Whether to draw figures; without them, those that are there stay as they are, and the report shows none.
    tuning
        Folder of the tuning that tuned settings come from; ``tuning`` in the campaign's folder if not given.
    formats
        In which figures are written; the report shows the first.
    trust
        Whether laws and constraints that the campaign names as ``module:Class`` are imported, to make single runs again
        that figures show; else nothing that the folder names is run, and the report says which runs these are.
    on_written
        Told how many parts are there, and how many there will be.
    on_remark
        Told what a reader should know of what is stored: see :class:`Evidence`.

    Returns
    -------
    Path
        Where the report is.

    Raises
    ------
    ConfigurationError
        if there is no evidence in the folder, it is not what was stored, or the runs are gone that its report was made
        from.
    StorageError
        if the report cannot be written.
    """
    evidence = Evidence.load(folder, trust)
    for remark in evidence.remarks:
        on_remark(remark)
    if not len(evidence.runs) and (made := evidence.manifest.get("runs")):
        raise ConfigurationError(
            f"{folder} has none of the {made} runs that its report was made from: runs, rows and scenes are missing. "
            "What stands there is left as it is"
        )
    material = Material(evidence, tuning_folder(folder, tuning), figures, formats)
    return write_report_of(material, on_written)


def write_report_of(material: Material, on_written: OnWritten = lambda done, total: None) -> Path:
    """Write the report of evidence that has been read."""
    first = opening(material)
    sections = SECTIONS if first.sentences else (scenes, closing)
    parts = [first.text]
    for section in sections:
        on_written(len(parts), 1 + len(sections))
        parts.append(section(material))
    on_written(len(parts), len(parts))
    report = material.folder / "report.md"
    every = {
        **first.as_data(),
        "conclusions": [one.as_data() for one in conclusions(material)],
        "power": [one.as_data() for one in powers(material)],
    }
    claims = json.dumps(every, indent=1, ensure_ascii=False)
    try:
        write_pages(report, "\n\n".join(part for part in parts if part) + "\n")
        with replaced(material.folder / CLAIMS) as part:
            part.write_text(claims + "\n", encoding="utf-8")
    except OSError as error:
        raise StorageError(f"the report cannot be written to {material.folder}: {error}") from error
    return report
